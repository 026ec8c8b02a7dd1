#include "scene/texture_table.h"

#include <cstring>
#include <utility>

#include "scene/texture_faults.h"

namespace relief {
namespace {

Wrap wrap_from_gltf(int value)
{
  return value == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? Wrap::kClamp
         : value == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? Wrap::kMirror
                                                          : Wrap::kRepeat;
}

std::vector<unsigned char> to_bytes(std::span<const std::byte> bytes)
{
  std::vector<unsigned char> out(bytes.size());
  if (!bytes.empty()) {
    std::memcpy(out.data(), bytes.data(), bytes.size());
  }
  return out;
}

}  // namespace

TextureTable::Key TextureTable::make_key(std::string file,
                                         const GltfDocument* document,
                                         int image,
                                         TextureColor color,
                                         TextureSampling sampling)
{
  return {std::move(file),
          document,
          image,
          static_cast<int>(color),
          static_cast<int>(sampling.wrap_u),
          static_cast<int>(sampling.wrap_v),
          static_cast<int>(sampling.filter)};
}

template <class Step>
bool TextureTable::succeeds(const Step& step)
{
  try {
    step();
    return true;
  } catch (const SceneError& fault) {
    if (faults_ == nullptr) throw;
    faults_->add(fault);
    return false;
  }
}

int TextureTable::add(Key key, TextureRequest request, TextureColor color, TextureSampling sampling)
{
  const auto index = static_cast<int>(requests_.size());
  request.color = color;
  request.wrap_u = sampling.wrap_u;
  request.wrap_v = sampling.wrap_v;
  request.filter = sampling.filter;
  request.faults = faults_;
  requests_.push_back(std::move(request));
  index_of_.emplace(std::move(key), index);
  return index;
}

int TextureTable::add_texture(const GltfDocument& document, int texture_index, TextureColor color)
{
  const tinygltf::Texture& texture = document.core.textures[static_cast<std::size_t>(texture_index)];
  const std::string path = "/textures/" + std::to_string(texture_index) + "/source";
  const bool has_source = succeeds([&] {
    if (texture.source < 0) throw SceneError(document.file, path, "an image", "nothing");
  });
  if (!has_source) {
    TextureRequest request;
    request.scene_file = document.file;
    request.json_path = path;
    request.label = document.file + ": " + path;
    request.is_missing = true;
    return add(make_key(request.label, nullptr, 0, color, {}), std::move(request), color, {});
  }
  TextureSampling sampling;
  if (texture.sampler >= 0) {
    const tinygltf::Sampler& sampler = document.core.samplers[static_cast<std::size_t>(texture.sampler)];
    sampling.wrap_u = wrap_from_gltf(sampler.wrapS);
    sampling.wrap_v = wrap_from_gltf(sampler.wrapT);
    sampling.filter =
        sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST ? TexelFilter::kNearest : TexelFilter::kLinear;
  }
  return add_image(document, texture.source, color, sampling);
}

int TextureTable::add_image(const GltfDocument& document, int image_index, TextureColor color, TextureSampling sampling)
{
  Key key = make_key("", &document, image_index, color, sampling);
  if (const auto known = index_of_.find(key); known != index_of_.end()) {
    return known->second;
  }
  const std::string path = "/images/" + std::to_string(image_index);
  TextureRequest request;
  request.scene_file = document.file;
  request.json_path = path;
  std::string name;
  request.is_missing = !succeeds([&] {
    const JsonReader image(document.element("images", static_cast<std::size_t>(image_index)), document.file, path);
    if (image.has("uri") == image.has("bufferView")) {
      image.fail("", "either uri or bufferView", image.has("uri") ? "both" : "neither");
    }
    name = image.string("name", "");
    if (image.has("bufferView")) {
      const int view = image.index("bufferView", document.core.bufferViews.size(), "buffer views");
      request.encoded = to_bytes(gltf_buffer_view(document, view));
      return;
    }
    const std::string uri = image.string("uri", "");
    if (gltf_is_data_uri(uri)) {
      request.encoded = to_bytes(gltf_decode_data_uri(uri, document.file, path + "/uri").span());
    } else {
      request.file = gltf_resolve_uri(document, uri, path + "/uri");
      name = request.file.filename().string();
    }
  });
  request.label = document.file + ": " + path + (name.empty() ? "" : " (" + name + ')');
  return add(std::move(key), std::move(request), color, sampling);
}

int TextureTable::add_file(const GltfDocument& document,
                           const std::string& uri,
                           const std::string& json_path,
                           TextureColor color,
                           TextureSampling sampling)
{
  TextureRequest request;
  request.is_missing = !succeeds([&] { request.file = gltf_resolve_uri(document, uri, json_path); });
  Key key = make_key(request.is_missing ? json_path : request.file.string(), nullptr, 0, color, sampling);
  if (const auto known = index_of_.find(key); known != index_of_.end()) {
    return known->second;
  }
  request.scene_file = document.file;
  request.json_path = json_path;
  request.label = document.file + ": " + json_path + " (" + request.file.filename().string() + ')';
  return add(std::move(key), std::move(request), color, sampling);
}

int TextureTable::add_path(const std::filesystem::path& file,
                           const std::string& option,
                           TextureColor color,
                           TextureSampling sampling)
{
  TextureRequest request;
  request.file = file;
  request.scene_file = file.string();
  request.json_path = option;
  request.label = file.string();
  return add(make_key(option + ' ' + file.string(), nullptr, 0, color, sampling), std::move(request), color, sampling);
}

const IesProfile& TextureTable::add_ies(const GltfDocument& document,
                                        const std::string& uri,
                                        const std::string& json_path)
{
  constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20;
  std::filesystem::path file;
  IesProfile profile;
  succeeds([&] {
    file = gltf_resolve_uri(document, uri, json_path);
    if (ies_.contains(file)) return;
    files_read_.push_back(file_stamp(file));
    const ByteArray bytes = gltf_read_file(file, document.file, json_path, kMostBytes);
    const std::string_view text(reinterpret_cast<const char*>(bytes.data.get()), bytes.size);
    profile = ies_parse(text, document.file, json_path);
  });
  return ies_.try_emplace(file, std::move(profile)).first->second;
}

std::shared_ptr<const Voxels> TextureTable::add_voxels(const GltfDocument& document,
                                                       const std::string& uri,
                                                       const std::string& grid,
                                                       const std::array<int, 3>& size,
                                                       const std::string& json_path)
{
  std::filesystem::path file;
  std::shared_ptr<const Voxels> voxels;
  succeeds([&] {
    file = gltf_resolve_uri(document, uri, json_path);
    if (voxels_.contains({file, grid, size})) return;
    files_read_.push_back(file_stamp(file));
    voxels = grid.empty() ? voxels_load_slices({file.string(), {}, document.file, json_path}, size)
                          : voxels_load(file, grid, document.file, json_path);
  });
  return voxels_.try_emplace({file, grid, size}, std::move(voxels)).first->second;
}

std::vector<TextureRequest> TextureTable::take()
{
  index_of_.clear();
  return std::exchange(requests_, {});
}

}  // namespace relief
