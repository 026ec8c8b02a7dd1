#include "scene/gltf_camera.h"

#include <cmath>

#include "scene/relief_extensions.h"

namespace relief {
namespace {

/// Right-handed orthonormal frame that looks along −z, its y as near as possible to `up`.
Affine3 camera_frame(Vec3f z, Vec3f up, Vec3f P)
{
  Affine3 m;
  m.z = normalize(z);
  m.x = normalize(cross(up, m.z));
  m.y = cross(m.z, m.x);
  m.p = P;
  return m;
}

}  // namespace

SceneCamera gltf_camera(const GltfDocument& document,
                        int node_index,
                        const Transform& world,
                        float image_aspect,
                        Warnings& warnings)
{
  const tinygltf::Node& node = document.core.nodes[static_cast<std::size_t>(node_index)];
  const auto index = static_cast<std::size_t>(node.camera);
  const tinygltf::Camera& source = document.core.cameras[index];
  const std::string path = "/cameras/" + std::to_string(index);
  SceneCamera out;
  out.name = node.name.empty() ? source.name : node.name;
  Camera& camera = out.camera;
  camera.world_from_camera =
      camera_frame(unit_direction(world.z), unit_direction(world.y), transform_to_affine(world).p);
  if (source.type == "perspective") {
    camera.projection = Projection::kPerspective;
    camera.half_height = static_cast<float>(std::tan(0.5 * source.perspective.yfov));
    out.aspect = static_cast<float>(source.perspective.aspectRatio);
  } else {
    camera.projection = Projection::kOrthographic;
    camera.half_height = static_cast<float>(std::fabs(source.orthographic.ymag));
    const auto half_width = static_cast<float>(std::fabs(source.orthographic.xmag));
    constexpr float kSmallest = 1e-9f, kLargest = 1e15f;
    if (!(min(camera.half_height, half_width) >= kSmallest && max(camera.half_height, half_width) <= kLargest)) {
      throw SceneError(document.file, path + "/orthographic", "xmag and ymag other than 0 and up to 1e15 m",
                       number_text(source.orthographic.xmag) + " and " + number_text(source.orthographic.ymag));
    }
    out.aspect = half_width / camera.half_height;
  }
  camera.half_width = camera.half_height * (out.aspect > 0 ? out.aspect : image_aspect);
  relief_camera(document, node.camera, camera, warnings);
  return out;
}

Bounds bounds_of_points(const std::vector<Vec3f>& points)
{
  Bounds b;
  for (const Vec3f p : points) {
    b.low = min(b.low, p);
    b.high = max(b.high, p);
  }
  return b;
}

Bounds bounds_transform(const Affine3& m, const Bounds& box)
{
  Bounds out;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3f p{corner & 1 ? box.high.x : box.low.x, corner & 2 ? box.high.y : box.low.y,
                  corner & 4 ? box.high.z : box.low.z};
    const Vec3f q = transform_point(m, p);
    out.low = min(out.low, q);
    out.high = max(out.high, q);
  }
  return out;
}

Bounds bounds_union(const Bounds& a, const Bounds& b) { return {min(a.low, b.low), max(a.high, b.high)}; }

SceneCamera framing_camera(const Bounds& bounds, float image_aspect)
{
  const Bounds box = bounds.empty() ? Bounds{{-1, -1, -1}, {1, 1, 1}} : bounds;
  const Vec3f centre = (box.low + box.high) * 0.5f;
  const float radius = max(0.5f * length(box.high - box.low), 1e-6f);
  SceneCamera out;
  out.name = "framing";
  Camera& camera = out.camera;
  constexpr float kHalfField = 0.35f;  // radians: a normal lens, 40° in all
  camera.half_height = std::tan(kHalfField);
  camera.half_width = camera.half_height * image_aspect;
  const float half_field = image_aspect < 1 ? std::atan(camera.half_width) : kHalfField;
  const float distance = 1.05f * radius / std::sin(half_field);
  const Vec3f direction = normalize(Vec3f{0.5f, 0.4f, 1.0f});
  camera.world_from_camera = camera_frame(direction, {0, 1, 0}, centre + direction * distance);
  camera.focus_distance = distance;
  return out;
}

}  // namespace relief
