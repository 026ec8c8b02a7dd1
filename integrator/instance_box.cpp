#include "integrator/instance_box.h"

#include <algorithm>

namespace relief {

namespace {

/// Grows boxes by a little, so that flat ones have an inside and hits on their faces are within.
constexpr float kBoxMargin = 1e-4f;

}  // namespace

Box3 instance_box(const SceneContext& context, std::size_t index)
{
  const Instance& instance = context.scene.instances[index];
  Box3 box = box_empty();
  const auto add_placed = [&](const Affine3& placed, Vec3f P_object) {
    const Vec3f P = transform_point(placed, P_object);
    box = box_union(box, {P, P});
  };
  const MotionView motion = context.motion.view(instance.motion_index);
  double stray = 0;
  const auto add = [&](Vec3f P_object) {
    if (motion.num_keys == 0) return add_placed(instance.world_from_object, P_object);
    const auto reach = static_cast<double>(length(P_object));
    for (std::uint32_t key = 0; key < motion.num_keys; ++key) {
      add_placed(motion_at(motion, static_cast<float>(key) / static_cast<float>(motion.num_keys - 1)), P_object);
      if (key > 0) stray = std::max(stray, motion_stray(motion.keys[key - 1], motion.keys[key], reach));
    }
  };
  if (const int displaced = context.displacements.geometry_index(index); displaced >= 0) {
    const Box3 local = context.accel->displaced_bounds(static_cast<std::size_t>(displaced));
    for (int corner = 0; corner < 8; ++corner) {
      add({(corner & 1) != 0 ? local.high.x : local.low.x, (corner & 2) != 0 ? local.high.y : local.low.y,
           (corner & 4) != 0 ? local.high.z : local.low.z});
    }
  } else {
    const MeshView& mesh = context.meshes[static_cast<std::size_t>(context.instances[index].mesh_index)];
    for (std::uint32_t i = 0; i < mesh.num_vertices; ++i) add(mesh.P[i]);
    for (const MeshShape& step : context.motion.shapes(static_cast<std::size_t>(context.instances[index].mesh_index))) {
      for (std::uint32_t i = 0; i < mesh.num_vertices; ++i) add(step.P[i]);
    }
  }
  const Vec3f margin = splat3(kBoxMargin * 0.5f * length(box.high - box.low) + static_cast<float>(stray));
  return {box.low - margin, box.high + margin};
}

}  // namespace relief
