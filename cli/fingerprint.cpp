#include "cli/fingerprint.h"

#include <cstring>

#include <fmt/format.h>

#include "exporters/errors.h"
#include "exporters/exr.h"

namespace relief {

namespace {

/// FNV-1a, 64 bits: enough to notice a change; nobody attacks it.
class Hash {
 public:
  void add_bytes(const void* data, std::size_t size)
  {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) value_ = (value_ ^ bytes[i]) * 0x100000001b3u;
  }
  template <class T>
  void add(const T& value)
  {
    static_assert(std::has_unique_object_representations_v<T> || std::is_floating_point_v<T>);
    add_bytes(&value, sizeof(value));
  }
  void add(const std::string& text)
  {
    add(text.size());
    add_bytes(text.data(), text.size());
  }
  void add(Vec3f v)
  {
    add(v.x);
    add(v.y);
    add(v.z);
  }
  void add(const Affine3& m)
  {
    for (const Vec3f axis : {m.x, m.y, m.z, m.p}) add(axis);
  }
  std::string text() const { return fmt::format("{:016x}", value_); }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

}  // namespace

std::string render_fingerprint(const Scene& scene, const RenderOptions& options, const std::string& storage)
{
  Hash hash;
  hash.add(storage);
  hash.add(std::string(RELIEF_VERSION));
  for (const std::string& file : scene.files) {
    std::error_code ignored;
    hash.add(file);
    hash.add(std::filesystem::file_size(file, ignored));
    hash.add(std::filesystem::last_write_time(file, ignored).time_since_epoch().count());
  }
  for (const Instance& instance : scene.instances) hash.add(instance.world_from_object);
  for (const Light& light : scene.lights) {
    for (const Vec3f v : {light.P, light.axis, light.edge_u, light.edge_v}) hash.add(v);
  }
  const Camera& camera = options.camera;
  hash.add(static_cast<int>(camera.projection));
  hash.add(camera.world_from_camera);
  for (const float v : {camera.half_width, camera.half_height, camera.shift_x, camera.shift_y, camera.aperture_radius,
                        camera.focus_distance, camera.clip_start, camera.clip_end}) {
    hash.add(v);
  }
  const RenderSettings& s = options.settings;
  for (const int v : {s.width, s.height, s.samples, s.max_bounces, s.diffuse_bounces, s.glossy_bounces,
                      s.transmission_bounces, s.transparent_bounces, static_cast<int>(s.filter), options.crop_x0,
                      options.crop_y0, options.crop_x1, options.crop_y1}) {
    hash.add(v);
  }
  for (const float v : {s.noise_threshold, s.clamp_indirect, s.filter_width}) hash.add(v);
  hash.add(static_cast<int>(s.caustics.mode));
  for (const double v : {s.caustics.photons, s.caustics.memory_mib}) hash.add(v);
  for (const float v : {s.caustics.alpha, s.caustics.radius}) hash.add(v);
  hash.add(s.seed);
  hash.add(options.time_limit_seconds);
  hash.add(options.aov_mask);
  hash.add(options.displacement.method ? static_cast<int>(*options.displacement.method) : -1);
  hash.add(options.displacement.auto_bytes);
  hash.add(options.displacement.lod.value_or(-2));
  return hash.text();
}

bool is_whole_render(const std::filesystem::path& exr, const std::string& fingerprint)
{
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(exr, ignored)) return false;
  try {
    // Reading all of it also finds a file that was cut short while it was copied.
    const Attributes attributes = exr_load(exr).attributes;
    const auto found = attributes.find("relief:fingerprint");
    return found != attributes.end() && found->second == fingerprint;
  } catch (const InputError&) {
    return false;
  }
}

}  // namespace relief
