#include "cli/kept_scene.h"

#include <chrono>

#include "scene/texture_store.h"

namespace relief {

namespace {

std::uint64_t bytes_of(const Scene& scene)
{
  std::uint64_t sum = scene.textures->bytes() + height_map_bytes(scene.height_maps);
  for (const Mesh& mesh : scene.meshes) sum += mesh.bytes();
  return sum;
}

}  // namespace

std::shared_ptr<const Scene> KeptScene::get(const std::filesystem::path& path,
                                            const LoadOptions& options,
                                            KeptStatistics* kept)
{
  if (scene_ != nullptr && path == path_ && options == options_ && files_changed(scene_->files).empty()) {
    kept->scene = true;
    kept->bytes += bytes_of(*scene_);
    kept->seconds += seconds_;
    return scene_;
  }
  context_.reset();
  scene_.reset();
  path_ = path;
  options_ = options;
  const auto start = std::chrono::steady_clock::now();
  scene_ = std::make_shared<const Scene>(scene_load(path, options));
  seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return scene_;
}

}  // namespace relief
