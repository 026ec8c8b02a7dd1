#include "scene/displaced_mesh.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

#include "kernel/texture/texture.h"
#include "scene/json_reader.h"

namespace relief {
namespace {

using Vertices = std::array<std::uint32_t, 3>;

Vertices vertices(const TriangleIndices& t) { return {t.v0, t.v1, t.v2}; }

/// Angle between two normals, radians; of a zero one and another π/2.
double normal_angle(Normal3f a, Normal3f b)
{
  const auto d = [](float x) { return static_cast<double>(x); };
  const double x = d(a.y) * d(b.z) - d(a.z) * d(b.y);
  const double y = d(a.z) * d(b.x) - d(a.x) * d(b.z);
  const double z = d(a.x) * d(b.y) - d(a.y) * d(b.x);
  const double sine = std::sqrt(x * x + y * y + z * z);
  const double cosine = d(a.x) * d(b.x) + d(a.y) * d(b.y) + d(a.z) * d(b.z);
  const bool equal = a.x == b.x && a.y == b.y && a.z == b.z;
  return equal ? 0 : sine == 0 && cosine == 0 ? static_cast<double>(kPi) / 2 : std::atan2(sine, cosine);
}

void warn_split_normals(const std::string& label, const Mesh& mesh, Warnings& warnings)
{
  // Narrower cracks than a thousandth of the displacement are not worth a warning: exporters round.
  constexpr double kLeastAngle = 1e-3;
  const std::vector<std::uint32_t> first_at = weld_positions(mesh.P);
  std::vector<bool> is_split(mesh.P.size(), false);
  std::size_t num_split = 0;
  double widest = 0;
  for (const TriangleIndices& triangle : mesh.triangles) {
    for (const std::uint32_t v : vertices(triangle)) {
      const std::uint32_t first = first_at[v];
      const double angle = normal_angle(mesh.N[v], mesh.N[first]);
      widest = std::max(widest, angle);
      if (angle > kLeastAngle && !is_split[first]) {
        is_split[first] = true;
        ++num_split;
      }
    }
  }
  if (num_split > 0) {
    warnings.add(label + ": displaced with split normals: cracks open at " + std::to_string(num_split) +
                 " positions, whose normals are up to " + number_text(widest * 180 / static_cast<double>(kPi)) +
                 "° apart");
  }
}

/// Whether a triangle's texture coordinates span an area beyond their own rounding.
bool has_uv_area(Vec2f a, Vec2f b, Vec2f c)
{
  const auto d = [](float x) { return static_cast<double>(x); };
  const double bu = d(b.x) - d(a.x), bv = d(b.y) - d(a.y), cu = d(c.x) - d(a.x), cv = d(c.y) - d(a.y);
  const double largest = std::max(
      {std::abs(d(a.x)), std::abs(d(a.y)), std::abs(d(b.x)), std::abs(d(b.y)), std::abs(d(c.x)), std::abs(d(c.y))});
  // Each coordinate is off by half an ulp, 2^-24 of it, and stands in a difference of two.
  const double rounding = 0x1p-23 * largest * (std::abs(bu) + std::abs(bv) + std::abs(cu) + std::abs(cv));
  return std::abs(bu * cv - bv * cu) > rounding;
}

void warn_uv_area(const std::string& label, const Mesh& mesh, const TextureRef& height, Warnings& warnings)
{
  const std::vector<Vec2f>& uv = mesh.uv[height.uv_set];
  std::size_t num_flat = 0;
  for (const TriangleIndices& t : mesh.triangles) {
    num_flat += has_uv_area(texture_ref_uv(height, uv[t.v0]), texture_ref_uv(height, uv[t.v1]),
                            texture_ref_uv(height, uv[t.v2]))
                    ? 0
                    : 1;
  }
  if (num_flat > 0) {
    warnings.add(label + ": displaced with " + std::to_string(num_flat) +
                 " triangles that have no area in the height map's texture space");
  }
}

}  // namespace

std::vector<MeshDisplacement> displaced_meshes(const Scene& scene)
{
  std::vector<MeshDisplacement> out;
  std::set<std::pair<int, int>> known;
  for (std::size_t i = 0; i < scene.num_placed(); ++i) {
    const Instance& instance = scene.instances[i];
    const int displacement = scene.materials[static_cast<std::size_t>(instance.material_index)].displacement_index;
    const int copy_of = scene.meshes[static_cast<std::size_t>(instance.mesh_index)].copy_of;
    const int mesh = copy_of >= 0 ? copy_of : instance.mesh_index;
    if (displacement >= 0 && known.emplace(mesh, displacement).second) {
      out.push_back({instance.mesh_index, displacement});
    }
  }
  return out;
}

std::vector<std::uint32_t> weld_positions(std::span<const Vec3f> P)
{
  std::vector<std::uint32_t> order(P.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto key = [&](std::uint32_t v) { return std::tie(P[v].x, P[v].y, P[v].z); };
  tbb::parallel_sort(order.begin(), order.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return key(a) != key(b) ? key(a) < key(b) : a < b; });
  std::vector<std::uint32_t> first_at(P.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && key(order[i]) == key(order[i - 1]);
    first_at[order[i]] = same ? first_at[order[i - 1]] : order[i];
  }
  return first_at;
}

UvBounds uv_bounds_union(UvBounds a, UvBounds b)
{
  return {{std::min(a.low.x, b.low.x), std::min(a.low.y, b.low.y)},
          {std::max(a.high.x, b.high.x), std::max(a.high.y, b.high.y)}};
}

UvBounds displaced_mesh_uv_bounds(const Mesh& mesh, const TextureRef& height)
{
  UvBounds bounds;
  const std::vector<Vec2f>& uv = mesh.uv[height.uv_set];
  if (uv.empty()) {
    return bounds;
  }
  for (const TriangleIndices& triangle : mesh.triangles) {
    for (const std::uint32_t v : vertices(triangle)) {
      const Vec2f at = texture_ref_uv(height, uv[v]);
      bounds = uv_bounds_union(bounds, {at, at});
    }
  }
  return bounds;
}

void displaced_mesh_warn(const std::string& label, const Mesh& mesh, const TextureRef* height, Warnings& warnings)
{
  if (mesh.N.empty()) {
    warnings.add(label + ": displaced without normals: triangles move along their own and open cracks");
  } else {
    warn_split_normals(label, mesh, warnings);
  }
  if (height == nullptr) return;
  if (mesh.uv[height->uv_set].empty()) {
    warnings.add(label + ": displaced without TEXCOORD_" + std::to_string(height->uv_set) +
                 ", which the height map needs");
  } else {
    warn_uv_area(label, mesh, *height, warnings);
  }
}

}  // namespace relief
