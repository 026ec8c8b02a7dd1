#include "scene/world_displacement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "scene/memory.h"
#include "scene/scene.h"

namespace relief {

namespace {

/// A vector's largest coordinate, in the place of its length, whose square can be beyond single precision.
float extent(Vec3f v) { return max_component(abs(v)); }

/// Whether a map mirrors, however small what it makes of things is.
bool mirrors(const Affine3& m)
{
  return determinant({m.x / extent(m.x), m.y / extent(m.y), m.z / extent(m.z), {}}) < 0.0f;
}

/// Applies a map without translation. Normals stay linear in what they were, so that interpolating them and transforming
/// them can change places, and become no longer than by a small factor.
/// @param m  its determinant is positive
void transform_mesh(Mesh& mesh, const Affine3& m)
{
  const auto transform_positions = [&](std::vector<Vec3f>& positions) {
    for (Vec3f& P : positions) P = transform_vector(m, P);
  };
  transform_positions(mesh.P);
  // The inverse transpose is the matrix of cofactors up to a factor. Each axis gives up its own size first: products of
  // what a scale of 1e-24 leaves of one are zero (test WorldDisplacementMeshes.NormalsOfTheFlattestMapsAreFinite).
  const float of_x = extent(m.x), of_y = extent(m.y), of_z = extent(m.z), least = std::min({of_x, of_y, of_z});
  const Vec3f x = m.x / of_x, y = m.y / of_y, z = m.z / of_z;
  const Affine3 cofactors{cross(y, z) * (least / of_x), cross(z, x) * (least / of_y), cross(x, y) * (least / of_z), {}};
  const auto transform_normals = [&](std::vector<Normal3f>& normals) {
    for (Normal3f& N : normals) N = as_normal(transform_vector(cofactors, as_vector(N)));
  };
  transform_normals(mesh.N);
  for (MeshStep& step : mesh.steps) {
    transform_positions(step.P);
    transform_normals(step.N);
  }
  for (Vec4f& tangent : mesh.tangent) {
    const Vec3f t = normalize(transform_vector(m, xyz(tangent)));
    tangent = {t.x, t.y, t.z, tangent.w};
  }
}

}  // namespace

bool is_similarity(const Affine3& m, float* scale)
{
  constexpr float kTolerance = 1e-5f;
  const float x = length(m.x), y = length(m.y), z = length(m.z);
  *scale = (x + y + z) / 3.0f;
  const float slack = kTolerance * *scale;
  return *scale > 0.0f && is_finite(*scale) && std::abs(x - *scale) <= slack && std::abs(y - *scale) <= slack &&
         std::abs(z - *scale) <= slack && std::abs(dot(m.x, m.y)) <= slack * *scale &&
         std::abs(dot(m.y, m.z)) <= slack * *scale && std::abs(dot(m.z, m.x)) <= slack * *scale;
}

void world_displacement_bake(Scene& scene)
{
  std::map<std::pair<int, std::array<float, 9>>, int> copies;
  MemoryWatch memory;
  std::uint64_t needed = 0;
  const std::string what = scene.file + ": meshes under world-space displacement";
  for (Instance& instance : scene.instances) {
    const int displacement = scene.materials[static_cast<std::size_t>(instance.material_index)].displacement_index;
    if (displacement < 0) continue;
    if (scene.displacements[static_cast<std::size_t>(displacement)].space != DisplacementSpace::kWorld) continue;
    float scale = 0;
    Affine3& placed = instance.world_from_object;
    if (is_similarity(placed, &scale)) continue;
    // What mirrors stays with the instance: the copy's triangles keep their winding.
    const float sign = mirrors(placed) ? -1.0f : 1.0f;
    const Affine3 m{placed.x * sign, placed.y * sign, placed.z * sign, {}};
    const auto [at, is_new] =
        copies.try_emplace({instance.mesh_index, {m.x.x, m.x.y, m.x.z, m.y.x, m.y.y, m.y.z, m.z.x, m.z.y, m.z.z}},
                           static_cast<int>(scene.meshes.size()));
    if (is_new) {
      // Besides the copy itself: 6 KB of Embree and tables for one triangle, 400 bytes for each further one.
      constexpr std::uint64_t kGeometryBytes = 6000, kTriangleBytes = 400;
      const Mesh& original = scene.meshes[static_cast<std::size_t>(instance.mesh_index)];
      needed += original.bytes() + kGeometryBytes + kTriangleBytes * original.triangles.size();
      memory.add(original.bytes() + kGeometryBytes, what);
      Mesh copy = scene.meshes[static_cast<std::size_t>(instance.mesh_index)];
      copy.copy_of = instance.mesh_index;
      transform_mesh(copy, m);
      scene.meshes.push_back(std::move(copy));
    }
    if (instance.motion_index >= 0) {
      const Affine3 undone = inverse(m);
      std::vector<Affine3> steps = scene.motions[static_cast<std::size_t>(instance.motion_index)];
      for (Affine3& step : steps) step = step * undone;
      instance.motion_index = static_cast<int>(scene.motions.size());
      scene.motions.push_back(std::move(steps));
    }
    instance.mesh_index = at->second;
    placed = {{sign, 0, 0}, {0, sign, 0}, {0, 0, sign}, placed.p};
  }
  memory_require(needed, what);
}

}  // namespace relief
