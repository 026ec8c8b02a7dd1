#include "integrator/border_seams.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <utility>

namespace relief {

namespace {

using Point = std::array<float, 3>;

/// A side of a triangle, from the end that comes first.
struct BorderEdge {
  Point ends[2];
  std::uint32_t part;  ///< place of its mesh among those that are compared
  std::uint32_t edge;  ///< 3 · triangle + k: from the triangle's vertex k to the next, or back
};

bool is_before(const BorderEdge& a, const BorderEdge& b)
{
  return std::tie(a.ends[0], a.ends[1], a.part, a.edge) < std::tie(b.ends[0], b.ends[1], b.part, b.edge);
}

/// A mesh at a place.
struct Part {
  const Mesh* mesh;
  int mesh_index;
  int displacement_index;  ///< −1: it is not displaced
  DisplacedMeshView displaced;
  const MovedMesh* moved = nullptr;  ///< in place of `displaced`: its own vertices are where displacement moves them to
};

/// Pairs of meshes between which there are walls.
using WeldedMeshes = std::set<std::pair<int, int>>;

Vec3d mix(Vec3d a, Vec3d b, double t) { return (1 - t) * a + t * b; }

/// A point of a displaced edge.
Vec3d displaced_point(const Part& part, const BorderEdge& edge, double t)
{
  const Vec3d from{edge.ends[0][0], edge.ends[0][1], edge.ends[0][2]},
      to{edge.ends[1][0], edge.ends[1][1], edge.ends[1][2]};
  const Vec3d P = mix(from, to, t);
  if (part.moved != nullptr) {
    const TriangleIndices& corners = part.mesh->triangles[edge.edge / 3];
    const std::uint32_t v[4] = {corners.v0, corners.v1, corners.v2, corners.v0};
    std::uint32_t a = v[edge.edge % 3], b = v[edge.edge % 3 + 1];
    const Vec3d at_a = to_double(part.mesh->P[a]);
    if (at_a.x != from.x || at_a.y != from.y || at_a.z != from.z) std::swap(a, b);
    return mix(to_double(part.moved->P[a]), to_double(part.moved->P[b]), t);
  }
  if (part.displacement_index < 0) return P;
  const DisplacedTriangle& tri = part.displaced.triangles[edge.edge / 3];
  std::uint32_t a = edge.edge % 3, b = (a + 1) % 3;
  if (to_double(tri.P[a]).x != from.x || to_double(tri.P[a]).y != from.y || to_double(tri.P[a]).z != from.z)
    std::swap(a, b);
  const Vec3d N = mix(to_double(tri.N[a]), to_double(tri.N[b]), t);
  const double size = length(N);
  if (!(size > 0)) return P;
  const double d =
      displacement_at(part.displaced, tri.x[a] + t * (tri.x[b] - tri.x[a]), tri.y[a] + t * (tri.y[b] - tri.y[a]));
  return P + N * (d / size);
}

double texels_along(const Part& part, const BorderEdge& edge)
{
  if (part.displacement_index < 0 || part.moved != nullptr) return 0;
  return texels_along(part.displaced.triangles[edge.edge / 3], static_cast<int>(edge.edge % 3));
}

/// Less counts as none, as in seam_report.
double least_gap(const Part& part)
{
  if (part.displacement_index < 0 || part.moved != nullptr) return 0;
  double low, high;
  stored_to_heights(*part.displaced.field, part.displaced.field->range, &low, &high);
  return 1e-3 * std::abs(part.displaced.scale) * (high - low);
}

SeamExtent extent_of(const Part& a, const BorderEdge& edge_a, const Part& b, const BorderEdge& edge_b)
{
  const double least = std::max(least_gap(a), least_gap(b));
  const auto num_points = static_cast<int>(
      std::clamp(std::ceil(2 * std::max(texels_along(a, edge_a), texels_along(b, edge_b))), 16.0, 4096.0));
  SeamExtent extent;
  int num_gaps = 0;
  for (int i = 0; i < num_points; ++i) {
    const double t = (i + 0.5) / num_points;
    const double gap = length(displaced_point(a, edge_a, t) - displaced_point(b, edge_b, t));
    if (!(gap > least)) continue;
    ++num_gaps;
    extent.largest_gap = std::max(extent.largest_gap, gap);
  }
  if (num_gaps == 0) return extent;
  extent.num_edges = 1;
  const Point &from = edge_a.ends[0], &to = edge_a.ends[1];
  extent.length = length(Vec3d{to[0] - from[0], to[1] - from[1], to[2] - from[2]}) * num_gaps / num_points;
  return extent;
}

void add_edges(const Part& part, std::uint32_t index, std::vector<BorderEdge>* edges)
{
  // Zeros of either sign are one place.
  const auto point = [&](std::uint32_t v) {
    const Vec3f P = part.mesh->P[v];
    return Point{P.x + 0.0f, P.y + 0.0f, P.z + 0.0f};
  };
  for (std::uint32_t triangle = 0; triangle < part.mesh->triangles.size(); ++triangle) {
    const TriangleIndices& t = part.mesh->triangles[triangle];
    const std::uint32_t v[4] = {t.v0, t.v1, t.v2, t.v0};
    for (std::uint32_t k = 0; k < 3; ++k) {
      BorderEdge edge{{point(v[k]), point(v[k + 1])}, index, 3 * triangle + k};
      if (edge.ends[0] == edge.ends[1]) continue;
      if (edge.ends[1] < edge.ends[0]) std::swap(edge.ends[0], edge.ends[1]);
      edges->push_back(edge);
    }
  }
}

/// Adds the borders between parts at one place.
void add_borders(const std::vector<Part>& parts, const WeldedMeshes& welded, std::vector<BorderReport>* sums)
{
  std::vector<BorderEdge> edges;
  for (std::uint32_t i = 0; i < parts.size(); ++i) add_edges(parts[i], i, &edges);
  std::sort(edges.begin(), edges.end(), is_before);
  for (std::size_t first = 0; first < edges.size();) {
    std::size_t end = first + 1;
    while (end < edges.size() && edges[end].ends[0] == edges[first].ends[0] &&
           edges[end].ends[1] == edges[first].ends[1])
      ++end;
    // One edge a part is compared with one of the next part.
    for (std::size_t k = first; k + 1 < end; ++k) {
      const BorderEdge &a = edges[k], &b = edges[k + 1];
      if (a.part == b.part) continue;
      const int of_a = parts[a.part].displacement_index, of_b = parts[b.part].displacement_index;
      if (of_a < 0 && of_b < 0) continue;
      const SeamExtent found = extent_of(parts[a.part], a, parts[b.part], b);
      const bool is_welded = welded.contains(std::minmax(parts[a.part].mesh_index, parts[b.part].mesh_index));
      for (const int index : {of_a, of_b == of_a ? -1 : of_b}) {
        if (index < 0) continue;
        BorderReport& sum = (*sums)[static_cast<std::size_t>(index)];
        sum.all = seam_extent_sum(sum.all, found);
        if (!is_welded) sum.open = seam_extent_sum(sum.open, found);
      }
    }
    first = end;
  }
}

}  // namespace

std::vector<BorderReport> border_seams(const Scene& scene, const DisplacementSet& displacements)
{
  std::vector<BorderReport> sums(scene.displacements.size());
  const auto mesh_of = [&](int instance) { return scene.instances[static_cast<std::size_t>(instance)].mesh_index; };
  WeldedMeshes welded;
  for (const BorderInstance& border : scene.border_instances)
    welded.insert(std::minmax(mesh_of(border.sides[0]), mesh_of(border.sides[1])));
  using Place = std::array<float, 12>;
  std::map<Place, std::map<std::pair<int, int>, Part>> places;  // by mesh and displaced geometry
  for (std::size_t i = 0; i < scene.num_placed(); ++i) {
    const Instance& instance = scene.instances[i];
    const Affine3& m = instance.world_from_object;
    const int geometry = displacements.geometry_index(i), moved = displacements.moved_index(i);
    const Mesh& mesh = scene.meshes[static_cast<std::size_t>(instance.mesh_index)];
    Part part{&mesh, instance.mesh_index, -1, {}};
    if (moved >= 0) {
      part.moved = &displacements.moved()[static_cast<std::size_t>(moved)];
      if (part.moved->divided != nullptr) continue;
      part.displacement_index = scene.materials[static_cast<std::size_t>(instance.material_index)].displacement_index;
    }
    if (geometry >= 0) {
      part.displaced = displacements.mesh(static_cast<std::size_t>(geometry)).view();
      part.displacement_index = displacements.displacement_index(static_cast<std::size_t>(geometry));
      if (part.displaced.field == nullptr) continue;
    }
    places[{m.x.x, m.x.y, m.x.z, m.y.x, m.y.y, m.y.z, m.z.x, m.z.y, m.z.z, m.p.x, m.p.y, m.p.z}].try_emplace(
        {instance.mesh_index, std::max(geometry, moved)}, part);
  }
  // Of meshes that are together in many places the borders are the same ones.
  std::map<std::vector<std::pair<int, int>>, bool> seen;
  for (const auto& [place, found] : places) {
    std::vector<Part> parts;
    std::vector<std::pair<int, int>> names;
    bool is_any_displaced = false;
    for (const auto& [name, part] : found) {
      names.push_back(name);
      parts.push_back(part);
      is_any_displaced |= part.displacement_index >= 0;
    }
    if (is_any_displaced && parts.size() > 1 && seen.try_emplace(names, true).second) add_borders(parts, welded, &sums);
  }
  return sums;
}

}  // namespace relief
