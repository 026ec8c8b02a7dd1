// Meshes under displacement: which they are, where they lie in their height maps, and what about them would tear the
// displaced surface or leave it flat.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace relief {

/// A mesh as some instance displaces it.
struct MeshDisplacement {
  int mesh_index = 0;
  int displacement_index = 0;  ///< of the instance's material, which need not be the mesh's
};

/// Distinct pairs, in the order of their first instance.
std::vector<MeshDisplacement> displaced_meshes(const Scene& scene);

/// For each vertex the first one at the same position, itself if there is none before it.
/// @cost  a parallel sort
std::vector<std::uint32_t> weld_positions(std::span<const Vec3f> P);

/// Rectangle of texture space, after the texture's transform and before wrapping; empty (low > high) without vertices.
struct UvBounds {
  Vec2f low{kInfinity, kInfinity}, high{-kInfinity, -kInfinity};
};

UvBounds uv_bounds_union(UvBounds a, UvBounds b);

/// What the triangles of a mesh cover of a height map; empty if the mesh lacks the texture coordinates.
UvBounds displaced_mesh_uv_bounds(const Mesh& mesh, const TextureRef& height);

/// Warns if a displaced mesh has no normals, normals that differ at one position, no texture coordinates, or triangles
/// without area in texture space.
/// @param label   how the warnings name the mesh
/// @param height  the height map's use; null: there is none
void displaced_mesh_warn(const std::string& label, const Mesh& mesh, const TextureRef* height, Warnings& warnings);

}  // namespace relief
