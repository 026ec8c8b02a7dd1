#include "scene/gltf_camera.h"

#include <cmath>

#include "scene/framing.h"
#include "scene/limits.h"
#include "scene/relief_extensions.h"

namespace relief {
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
    constexpr float kSmallest = 1e-9f;
    if (!(min(camera.half_height, half_width) >= kSmallest && max(camera.half_height, half_width) <= kFarthest)) {
      throw SceneError(document.file, path + "/orthographic", "xmag and ymag other than 0 and up to 1e15 m",
                       number_text(source.orthographic.xmag) + " and " + number_text(source.orthographic.ymag));
    }
    out.aspect = half_width / camera.half_height;
  }
  camera_fit(camera, out.aspect > 0 ? out.aspect : image_aspect, 1);
  relief_camera(document, node.camera, camera, out.shutter, warnings);
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

}  // namespace relief
