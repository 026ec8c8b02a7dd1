#include "scene/border_walls.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "scene/displaced_mesh.h"
#include "scene/memory.h"
#include "scene/scene.h"

namespace relief {

namespace {

/// The parts of an object: instances of meshes that have one place.
struct Parts {
  std::vector<int> instances;
};

int displacement_of(const Scene& scene, const Instance& instance)
{
  return scene.materials[static_cast<std::size_t>(instance.material_index)].displacement_index;
}

/// Whether walls are to close the borders of what an instance is a part of.
bool welds(const Scene& scene, const Instance& instance)
{
  const int displacement = displacement_of(scene, instance);
  return displacement >= 0 && scene.displacements[static_cast<std::size_t>(displacement)].weld_seams;
}

bool is_same_place(const Instance& a, const Instance& b)
{
  return std::memcmp(&a.world_from_object, &b.world_from_object, sizeof a.world_from_object) == 0 &&
         a.motion_index == b.motion_index;
}

/// The objects of several parts, of which one welds at least.
std::vector<Parts> objects_that_weld(const Scene& scene)
{
  int num_objects = 0;
  for (const Instance& instance : scene.instances) num_objects = std::max(num_objects, instance.object_index + 1);
  std::vector<std::uint8_t> num_parts(static_cast<std::size_t>(num_objects)), is_welded(num_parts.size());
  for (const Instance& instance : scene.instances) {
    if (instance.object_index < 0) continue;
    std::uint8_t& count = num_parts[static_cast<std::size_t>(instance.object_index)];
    count = static_cast<std::uint8_t>(std::min(count + 1, 2));
    if (welds(scene, instance)) is_welded[static_cast<std::size_t>(instance.object_index)] = 1;
  }
  std::map<int, Parts> objects;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const int object = scene.instances[i].object_index;
    if (object < 0 || num_parts[static_cast<std::size_t>(object)] < 2 || !is_welded[static_cast<std::size_t>(object)])
      continue;
    objects[object].instances.push_back(static_cast<int>(i));
  }
  std::vector<Parts> out;
  for (auto& [object, parts] : objects) out.push_back(std::move(parts));
  return out;
}

/// An edge of a part, from the place that comes first.
struct PartEdge {
  std::uint32_t low, high;  ///< places
  std::uint32_t part, edge;
  bool turned;  ///< it runs from `high` to `low`

  auto key() const { return std::tie(low, high, part, edge); }
};

/// Edges by pairs of parts, the first one before the second.
using EdgesOfPairs = std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<BorderEdge>>;

EdgesOfPairs common_edges(const std::vector<const Mesh*>& meshes)
{
  std::vector<Vec3f> P;
  std::vector<std::uint32_t> first_vertex;
  for (const Mesh* mesh : meshes) {
    first_vertex.push_back(static_cast<std::uint32_t>(P.size()));
    // Zeros of either sign are one place.
    for (const Vec3f p : mesh->P) P.push_back(p + Vec3f{0, 0, 0});
  }
  const std::vector<std::uint32_t> places = weld_positions(P);
  constexpr std::uint32_t kNone = ~0u, kSeveral = ~0u - 1;
  std::vector<std::uint32_t> part_at(P.size(), kNone);
  for (std::uint32_t part = 0; part < meshes.size(); ++part) {
    for (std::size_t v = 0; v < meshes[part]->P.size(); ++v) {
      std::uint32_t& known = part_at[places[first_vertex[part] + v]];
      known = known == kNone || known == part ? part : kSeveral;
    }
  }
  std::vector<PartEdge> edges;
  for (std::uint32_t part = 0; part < meshes.size(); ++part) {
    const std::vector<TriangleIndices>& triangles = meshes[part]->triangles;
    for (std::uint32_t triangle = 0; triangle < triangles.size(); ++triangle) {
      const TriangleIndices& t = triangles[triangle];
      const std::uint32_t v[4] = {t.v0, t.v1, t.v2, t.v0};
      for (std::uint32_t k = 0; k < 3; ++k) {
        const std::uint32_t from = places[first_vertex[part] + v[k]], to = places[first_vertex[part] + v[k + 1]];
        if (from == to || part_at[from] != kSeveral || part_at[to] != kSeveral) continue;
        edges.push_back({std::min(from, to), std::max(from, to), part, 3 * triangle + k, to < from});
      }
    }
  }
  std::sort(edges.begin(), edges.end(), [](const PartEdge& a, const PartEdge& b) { return a.key() < b.key(); });
  EdgesOfPairs out;
  for (std::size_t k = 0; k + 1 < edges.size(); ++k) {
    const PartEdge &a = edges[k], &b = edges[k + 1];
    if (a.low != b.low || a.high != b.high || a.part == b.part) continue;
    out[{a.part, b.part}].push_back({{a.edge, b.edge}, a.turned == b.turned});
  }
  return out;
}

/// The ends of edges of a mesh, as one triangle without area for each edge.
Mesh edges_mesh(const Mesh& mesh, const std::vector<BorderEdge>& edges, int side)
{
  std::vector<std::uint32_t> ends;
  for (const BorderEdge& border : edges) {
    const TriangleIndices& t = mesh.triangles[border.edges[side] / 3];
    const std::uint32_t v[4] = {t.v0, t.v1, t.v2, t.v0}, k = border.edges[side] % 3;
    ends.push_back(v[k]);
    ends.push_back(v[k + 1]);
  }
  const auto of_ends = [&](const auto& values) {
    std::remove_cvref_t<decltype(values)> out;
    if (values.empty()) return out;
    out.reserve(ends.size() + 1);
    for (const std::uint32_t v : ends) out.push_back(values[v]);
    return out;
  };
  Mesh out;
  out.name = mesh.name;
  out.material_index = mesh.material_index;
  // Embree reads 16 bytes at the last vertex: of_ends has room for one more.
  out.P = of_ends(mesh.P);
  for (int set = 0; set < 2; ++set) out.uv[set] = of_ends(mesh.uv[set]);
  out.tangent = of_ends(mesh.tangent);
  out.color = of_ends(mesh.color);
  out.generated = of_ends(mesh.generated);
  for (const AttributeColumn& column : mesh.columns) {
    AttributeColumn& own = out.columns.emplace_back(AttributeColumn{column.name, column.num_components, {}});
    const auto width = static_cast<std::size_t>(column.num_components);
    for (const std::uint32_t v : ends) {
      const auto first = column.values.begin() + static_cast<std::ptrdiff_t>(v * width);
      own.values.insert(own.values.end(), first, first + static_cast<std::ptrdiff_t>(width));
    }
  }
  for (const MeshStep& step : mesh.steps) out.steps.push_back({of_ends(step.P), {}});
  for (std::uint32_t k = 0; k < edges.size(); ++k) out.triangles.push_back({2 * k, 2 * k + 1, 2 * k + 1});
  return out;
}

/// Copies what an instance has by name.
void copy_values(Scene& scene, std::size_t from, std::size_t to)
{
  for (InstanceColumn& column : scene.instance_columns) {
    if (column.values.size() < 4 * (from + 1)) continue;
    column.values.resize(std::max(column.values.size(), 4 * (to + 1)));
    std::copy_n(column.values.begin() + static_cast<std::ptrdiff_t>(4 * from), 4,
                column.values.begin() + static_cast<std::ptrdiff_t>(4 * to));
  }
}

}  // namespace

void border_walls_add(Scene& scene)
{
  if (std::none_of(scene.displacements.begin(), scene.displacements.end(),
                   [](const DisplacementSettings& d) { return d.weld_seams; }))
    return;
  MemoryWatch memory;
  const std::string what = scene.file + ": walls between materials";
  // Objects that have the same meshes have the same edges in common.
  std::map<std::vector<int>, EdgesOfPairs> known;
  std::map<std::pair<int, int>, int> borders;  // by the sides' meshes
  for (const Parts& object : objects_that_weld(scene)) {
    std::vector<int> names;
    std::vector<const Mesh*> meshes;
    for (const int i : object.instances) {
      names.push_back(scene.instances[static_cast<std::size_t>(i)].mesh_index);
      meshes.push_back(&scene.meshes[static_cast<std::size_t>(names.back())]);
    }
    const auto [at, is_new] = known.try_emplace(names);
    if (is_new) at->second = common_edges(meshes);
    for (const auto& [pair, edges] : at->second) {
      int sides[2] = {object.instances[pair.first], object.instances[pair.second]};
      const Instance* of[2];
      const auto look = [&] {
        for (int k = 0; k < 2; ++k) of[k] = &scene.instances[static_cast<std::size_t>(sides[k])];
      };
      look();
      if (!(welds(scene, *of[0]) || welds(scene, *of[1])) || !is_same_place(*of[0], *of[1])) continue;
      // Walls are of what is not displaced, or else of what comes later: Blender moves the points of a border with the first triangle
      // that is displaced, and the others' lean towards them.
      const bool turned = displacement_of(scene, *of[0]) < 0;
      if (turned) std::swap(sides[0], sides[1]);
      look();
      const auto [known_border, is_new_border] =
          borders.try_emplace({of[0]->mesh_index, of[1]->mesh_index}, static_cast<int>(scene.borders.size()));
      if (is_new_border) {
        Border border{static_cast<int>(scene.meshes.size()), edges};
        if (turned) {
          for (BorderEdge& edge : border.edges) std::swap(edge.edges[0], edge.edges[1]);
        }
        Mesh mesh = edges_mesh(scene.meshes[static_cast<std::size_t>(of[1]->mesh_index)], border.edges, 1);
        memory.add(mesh.bytes() + border.edges.size() * sizeof(BorderEdge), what);
        scene.meshes.push_back(std::move(mesh));
        scene.borders.push_back(std::move(border));
      }
      Instance walls = *of[1];
      walls.mesh_index = scene.borders[static_cast<std::size_t>(known_border->second)].mesh_index;
      copy_values(scene, static_cast<std::size_t>(sides[1]), scene.instances.size());
      scene.instances.push_back(std::move(walls));
      scene.border_instances.push_back({known_border->second, {sides[0], sides[1]}});
    }
  }
}

}  // namespace relief
