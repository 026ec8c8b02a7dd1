#include "integrator/scene_views.h"

namespace relief {

SceneViews::SceneViews(const Scene& scene) : motion(scene)
{
  std::vector<int> uses(scene.meshes.size(), 0);
  for (const Instance& instance : scene.instances) ++uses[static_cast<std::size_t>(instance.mesh_index)];
  for (const Instance& instance : scene.instances) {
    InstanceView view;
    view.world_from_object = instance.world_from_object;
    view.object_from_world = inverse(instance.world_from_object);
    view.mesh_index = instance.mesh_index;
    view.material_index = instance.material_index;
    view.flags = instance.flags;
    view.index = static_cast<std::uint32_t>(instances.size());
    if (instance.motion_index >= 0) view.flags |= kMoves;
    const Mesh& mesh = scene.meshes[static_cast<std::size_t>(instance.mesh_index)];
    if (!mesh.steps.empty()) view.flags |= kDeforms;
    if (!mesh.radius.empty()) {
      view.flags |=
          kCurves | kTracedInObjectSpace | (mesh.are_ribbons ? kRibbons : 0u) | (mesh.are_points ? kPoints : 0u);
    }
    const bool takes_time = (view.flags & (kMoves | kDeforms)) != 0;
    if (takes_time || uses[static_cast<std::size_t>(instance.mesh_index)] > 1) view.flags |= kTracedInObjectSpace;
    instances.push_back(view);
  }
  for (std::size_t k = 0; k < scene.border_instances.size(); ++k) {
    instances[scene.num_placed() + k].flags |= kTracedInObjectSpace;
    for (const int side : scene.border_instances[k].sides)
      instances[static_cast<std::size_t>(side)].flags |= kTracedInObjectSpace;
  }
  std::size_t num_columns = 0;
  for (const Mesh& mesh : scene.meshes) num_columns += mesh.columns.size();
  mesh_columns.reserve(num_columns);  // views point into it
  for (const Mesh& mesh : scene.meshes) {
    MeshView& view = meshes.emplace_back(mesh.view());
    view.columns = mesh_columns.data() + mesh_columns.size();
    view.num_columns = static_cast<std::uint32_t>(mesh.columns.size());
    for (const AttributeColumn& column : mesh.columns) {
      mesh_columns.push_back({column.values.data(), column.name, static_cast<std::uint16_t>(column.num_components)});
    }
  }
  instance_values.reserve(scene.instance_columns.size());
  for (const InstanceColumn& column : scene.instance_columns) {
    const float* values = column.values.data();
    if (column.values.size() < 4 * instances.size()) {
      instance_values.push_back(column.values);
      instance_values.back().resize(4 * instances.size());
      values = instance_values.back().data();
    }
    instance_columns.push_back({column.name, values});
  }
}

}  // namespace relief
