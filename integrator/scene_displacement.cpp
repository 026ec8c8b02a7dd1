#include "integrator/scene_displacement.h"

#include <vector>

#include "integrator/computed_heights.h"
#include "scene/limits.h"
#include "scene/memory.h"

namespace relief {

namespace {

int displacement_of(const Scene& scene, const Instance& instance)
{
  return scene.materials[static_cast<std::size_t>(instance.material_index)].displacement_index;
}

/// Embree leaves out what is beyond its limits without a word.
/// @param box  of an instance's displaced mesh, object space
void check_positions(const Scene& scene, const Instance& instance, const Box3& box)
{
  const Affine3& m = instance.world_from_object;
  const Vec3f extent = max(abs(box.low), abs(box.high));
  const Vec3f extent_world = abs(m.x) * extent.x + abs(m.y) * extent.y + abs(m.z) * extent.z + abs(m.p);
  // A mesh without triangles has a box of infinite extent, turned over.
  if (!(box.low.x <= box.high.x) || max_component(max(extent, extent_world)) <= kFarthestDisplaced) return;
  throw SceneError(scene.file, "", "displaced positions within 2e15 m of the origin",
                   "farther ones of node '" + instance.name + "'");
}

}  // namespace

DisplacementSet scene_displacement(const Scene& scene, const DisplacementOptions& asked)
{
  DisplacementOptions options = asked;
  options.require = [](std::uint64_t bytes) { memory_require(bytes, "displaced meshes"); };
  DisplacementInput input;
  for (const Mesh& mesh : scene.meshes) {
    input.meshes.push_back(mesh.view());
    input.mesh_names.push_back(mesh.name);
    std::vector<MeshShape>& steps = input.mesh_steps.emplace_back();
    for (const MeshStep& step : mesh.steps) steps.push_back({step.P.data(), step.N.empty() ? nullptr : step.N.data()});
  }
  for (const HeightMap& map : scene.height_maps) input.height_maps.push_back({map.view(), map.texels});
  input.settings = scene.displacements;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    input.instances.push_back({instance.mesh_index, i < scene.num_placed() ? displacement_of(scene, instance) : -1, -1,
                               instance.world_from_object});
  }
  for (std::size_t k = 0; k < scene.border_instances.size(); ++k) {
    const BorderInstance& border = scene.border_instances[k];
    input.borders.push_back({scene.num_placed() + k,
                             {static_cast<std::size_t>(border.sides[0]), static_cast<std::size_t>(border.sides[1])},
                             scene.borders[static_cast<std::size_t>(border.border_index)].edges});
  }
  computed_heights_add(scene, options, &input);
  DisplacementSet set(input, options);
  std::vector<Box3> boxes;
  for (const MovedMesh& moved : set.moved()) {
    Box3& box = boxes.emplace_back(box_empty());
    for (const Vec3f& P : moved.P) box = box_union(box, {P, P});
  }
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const int index = set.geometry_index(i);
    if (index >= 0) check_positions(scene, scene.instances[i], set.bounds(static_cast<std::size_t>(index)));
    const int moved = set.moved_index(i);
    if (moved >= 0) check_positions(scene, scene.instances[i], boxes[static_cast<std::size_t>(moved)]);
  }
  return set;
}

std::vector<std::string> displacement_warnings(const Scene& scene, const DisplacementOptions& options)
{
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    const int index = scene.materials[i].displacement_index;
    if (index < 0) continue;
    for (const std::string& text :
         displacement_warnings(scene.displacements[static_cast<std::size_t>(index)], options)) {
      texts.push_back("material '" + scene.material_names[i] + "': " + text);
    }
  }
  return texts;
}

double expected_rays(const RenderSettings& settings)
{
  // Of camera, bounces and shadows: what the example scenes have.
  constexpr double kRaysPerSample = 4;
  return kRaysPerSample * settings.samples * static_cast<double>(settings.width) * settings.height;
}

}  // namespace relief
