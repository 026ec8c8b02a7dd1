#include "displacement/displacement_set.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "displacement/stretch.h"

namespace relief {

BorderSide DisplacementSet::border_side(const DisplacementInput& input,
                                        std::size_t instance,
                                        const PartsOfMoved& parts) const
{
  if (geometry_of_instance_[instance] >= 0) {
    const PreparedMesh& d = displaced(instance);
    if (d.tiles != nullptr) return border_of_tiles(*d.tiles);
    if (d.tessellation == nullptr) return border_of_displaced(d.geometry);
    return border_of_tessellation(*d.tessellation,
                                  d.dicing != nullptr ? d.dicing->parts() : std::span<const LatticeTriangle>{});
  }
  const auto index = static_cast<std::size_t>(input.instances[instance].mesh_index);
  const MeshView& mesh = meshes_[index];
  std::vector<const Vec3f*> steps;
  if (const int moved_index = moved_of_instance_[instance]; moved_index >= 0) {
    const MovedMesh& moved = moved_[static_cast<std::size_t>(moved_index)];
    if (moved.divided != nullptr) return border_of_divided(moved, parts[static_cast<std::size_t>(moved_index)]);
    for (const MovedShape& step : moved.steps) steps.push_back(step.P.data());
    if (steps.empty()) steps.push_back(moved.P.data());
  } else {
    if (index < input.mesh_steps.size()) {
      for (const MeshShape& step : input.mesh_steps[index]) steps.push_back(step.P);
    }
    if (steps.empty()) steps.push_back(mesh.P);
  }
  return border_of_vertices(mesh.triangles, std::move(steps));
}

void DisplacementSet::make_borders(const DisplacementInput& input, const PartsOfMoved& parts)
{
  // What stands in several places has one strip: by its mesh, and what the sides are traced as.
  using Key = std::tuple<int, int, int, int, int>;
  const auto key_of = [&](const DisplacedBorder& border) {
    const std::size_t a = border.sides[0], b = border.sides[1];
    return Key{input.instances[border.instance].mesh_index, geometry_of_instance_[a], moved_of_instance_[a],
               geometry_of_instance_[b], moved_of_instance_[b]};
  };
  // What tracers round, of the coordinates of their rays: those of points in the world, and on the way to object space.
  constexpr double kRounding = 0x1p-21;
  std::map<Key, double> roundings;
  for (const DisplacedBorder& border : input.borders) {
    const DisplacedInstance& instance = input.instances[border.instance];
    const MeshView& mesh = meshes_[static_cast<std::size_t>(instance.mesh_index)];
    Vec3f extent{};
    for (std::uint32_t v = 0; v < mesh.num_vertices; ++v) extent = max(extent, abs(mesh.P[v]));
    for (const std::size_t side : border.sides) {
      if (geometry_of_instance_[side] < 0) continue;
      const Box3 box = bounds(static_cast<std::size_t>(geometry_of_instance_[side]));
      if (box.low.x <= box.high.x) extent = max(extent, max(abs(box.low), abs(box.high)));
    }
    const Affine3& m = instance.world_from_object;
    const Vec3f world = abs(m.x) * extent.x + abs(m.y) * extent.y + abs(m.z) * extent.z + abs(m.p);
    const double size = std::max(static_cast<double>(max_component(extent)),
                                 static_cast<double>(max_component(world)) / stretch_of(m).least);
    double& rounding = roundings[key_of(border)];
    rounding = std::max(rounding, kRounding * size);
  }
  std::map<Key, int> known;
  for (const DisplacedBorder& border : input.borders) {
    const Key key = key_of(border);
    const auto [at, is_new] = known.try_emplace(key, static_cast<int>(moved_.size()));
    moved_of_instance_[border.instance] = at->second;
    if (!is_new) continue;
    const auto index = static_cast<std::size_t>(input.instances[border.instance].mesh_index);
    const BorderSide sides[2] = {border_side(input, border.sides[0], parts),
                                 border_side(input, border.sides[1], parts)};
    const std::size_t num_steps = index < input.mesh_steps.size() ? input.mesh_steps[index].size() : 0;
    const auto mesh_of = [&](int side) {
      return meshes_[static_cast<std::size_t>(input.instances[border.sides[side]].mesh_index)];
    };
    const MeshView meshes[2] = {mesh_of(0), mesh_of(1)};
    BorderStrips strips = border_strips_make(border.edges, meshes_[index], meshes, sides, num_steps, roundings[key]);
    for (int side = 0; side < 2; ++side) {
      const int geometry = geometry_of_instance_[border.sides[side]];
      if (geometry >= 0)
        walls_beside_add(border.edges, strips, side, &geometries_[static_cast<std::size_t>(geometry)]->walls);
    }
    strips.mesh.name = input.mesh_names[index];
    strips.mesh.mesh_index = static_cast<int>(index);
    moved_.push_back(std::move(strips.mesh));
    ++num_borders_;
  }
}

}  // namespace relief
