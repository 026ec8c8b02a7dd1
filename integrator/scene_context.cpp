#include "integrator/scene_context.h"

#include "integrator/intersect_stage.h"
#include "integrator/surface_kernels.h"
#include "scene/texture_store.h"

namespace relief {

SceneContext::SceneContext(const Scene& loaded,
                           const DisplacementOptions& displacement,
                           EnvironmentDensity environment_density)
    : scene(loaded),
      lights(light_set_make(loaded, loaded.textures->views(), environment_density)),
      bsdf_tables(std::make_unique<BsdfTables>()),
      displacements(loaded, displacement)
{
  for (const Mesh& mesh : scene.meshes) meshes.push_back(mesh.view());
  std::vector<int> uses(scene.meshes.size(), 0);
  for (const Instance& instance : scene.instances) ++uses[static_cast<std::size_t>(instance.mesh_index)];
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    InstanceView view;
    view.world_from_object = instance.world_from_object;
    view.object_from_world = inverse(instance.world_from_object);
    view.mesh_index = instance.mesh_index;
    view.material_index = instance.material_index;
    view.first_light_index = lights.first_light_index[i];
    view.flags = instance.flags;
    if (uses[static_cast<std::size_t>(instance.mesh_index)] > 1) view.flags |= kTracedInObjectSpace;
    if (displacements.geometry_index(i) >= 0) view.flags |= kDisplaced | kTracedInObjectSpace;
    instances.push_back(view);
  }
  unsigned features = 0;
  for (const Material& material : scene.materials) {
    features |= feature_mask_of(material);
    surface_kernel.push_back(static_cast<std::uint8_t>(surface_kernel_index(material)));
  }
  bsdf_tables_make(*bsdf_tables, features);
  accel = std::make_unique<Accel>(scene, lights.lights, lights.area_lights, displacements, shadow_filter);

  globals.meshes = meshes.data();
  globals.instances = instances.data();
  globals.num_instances = static_cast<std::uint32_t>(instances.size());
  globals.materials = scene.materials.data();
  globals.textures = scene.textures->views().data();
  globals.area_light_index = lights.area_lights.data();
  globals.lights = lights.view();
  globals.has_lights = lights.any();
  globals.bsdf_tables = bsdf_tables.get();
  globals.environment_visible_to_camera = scene.environment.visible_to_camera;
}

void SceneContext::fill(Statistics& stats) const
{
  for (const Mesh& mesh : scene.meshes) stats.mesh_bytes += mesh.bytes();
  stats.mesh_bytes += instances.size() * sizeof(InstanceView);
  stats.texture_bytes = scene.textures->bytes();
  stats.light_bytes = lights.bytes();
  stats.bvh_bytes = accel->bytes();
  stats.displacement = {displacements.method_names(),
                        displacements.size(),
                        displacements.num_triangles(),
                        displacements.bytes(),
                        height_map_bytes(scene.height_maps),
                        0,
                        displacements.reasons()};
}

}  // namespace relief
