#include "integrator/kept_trees.h"

#include <chrono>
#include <stdexcept>
#include <utility>

#include "scene/memory.h"

namespace relief {

namespace {

bool count_bytes(void* user, ssize_t bytes, bool)
{
  static_cast<std::atomic<std::ptrdiff_t>*>(user)->fetch_add(bytes, std::memory_order_relaxed);
  return true;
}

}  // namespace

KeptTrees::Device::~Device()
{
  if (device != nullptr) rtcReleaseDevice(device);
}

KeptTrees::KeptTrees(bool keeps) : keeps_(keeps), device_(std::make_shared<Device>())
{
  device_->device = rtcNewDevice(nullptr);
  if (device_->device == nullptr) {
    if (rtcGetDeviceError(nullptr) == RTC_ERROR_OUT_OF_MEMORY) throw OutOfMemory("the start of Embree");
    throw std::runtime_error("Embree cannot start on this machine");
  }
  rtcSetDeviceMemoryMonitorFunction(device_->device, count_bytes, &device_->bytes);
}

TreePointer KeptTrees::scene_make(RTCBuildQuality quality) const
{
  TreePointer tree = own(rtcNewScene(device()));
  rtcSetSceneBuildQuality(tree.get(), quality);
  rtcSetSceneFlags(tree.get(), RTC_SCENE_FLAG_ROBUST);
  return tree;
}

TreePointer KeptTrees::own(RTCScene scene) const
{
  // The device counts bytes until its last scene has gone.
  return TreePointer(scene, [device = device_](RTCScene s) {
    if (s != nullptr) rtcReleaseScene(s);
  });
}

TreePointer KeptTrees::mesh_tree(const ContentHash& content, const std::function<TreePointer()>& build)
{
  if (!keeps_) return build();
  if (const auto at = meshes_.find(content); at != meshes_.end()) {
    MeshTree& known = at->second;
    if (!std::exchange(known.is_wanted, true)) {
      ++found_.count;
      found_.bytes += known.bytes;
      found_.seconds += known.seconds;
    }
    return known.tree;
  }
  const auto start = std::chrono::steady_clock::now();
  const std::uint64_t bytes_before = bytes();
  MeshTree made;
  made.tree = build();
  made.bytes = bytes() - bytes_before;
  made.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return meshes_.emplace(content, std::move(made)).first->second.tree;
}

std::unique_ptr<SceneTree> KeptTrees::take(const ContentHash& content)
{
  std::unique_ptr<SceneTree> tree = std::move(scene_);
  if (tree == nullptr || tree->content != content) return nullptr;
  found_.count += tree->num_in_place;
  found_.bytes += tree->bytes;
  found_.seconds += tree->seconds;
  return tree;
}

KeptTrees::Tally KeptTrees::end_scene()
{
  std::erase_if(meshes_, [](const auto& mesh) { return !mesh.second.is_wanted; });
  for (auto& [content, mesh] : meshes_) mesh.is_wanted = false;
  return std::exchange(found_, {});
}

}  // namespace relief
