// Triangle meshes and their placements as the kernel sees them: spans without ownership.
#pragma once

#include <cstdint>

#include "kernel/math/affine.h"

namespace relief {

struct TriangleIndices {
  std::uint32_t v0 = 0, v1 = 0, v2 = 0;
};

/// A named vertex attribute that value graphs read.
struct MeshColumn {
  const float* values = nullptr;  ///< num_components a vertex
  std::uint16_t name = 0;         ///< place in Scene::attribute_names
  std::uint16_t num_components = 0;
};

/// One triangle mesh with one material, or one of curves (kernel/shape/curve_hit.h). Optional attributes are null when absent.
struct MeshView {
  const Vec3f* P = nullptr;                 ///< object space, metres, num_vertices
  const Normal3f* N = nullptr;              ///< shading (and displacement) normals, object space; null: flat
  const Vec2f* uv[2] = {nullptr, nullptr};  ///< texture coordinate sets
  const Vec4f* tangent = nullptr;           ///< unit, w = handedness; null: derived from uv
  const Vec4f* color = nullptr;             ///< COLOR_0, linear, multiplies base colour and alpha
  const Vec3f* generated = nullptr;         ///< coordinates that value graphs call so; null: absent
  const MeshColumn* columns = nullptr;      ///< num_columns
  const float* radius = nullptr;  ///< of curves, object space, metres, num_vertices; null: these are triangles
  const TriangleIndices* triangles = nullptr;  ///< num_triangles
  std::uint32_t num_vertices = 0, num_triangles = 0, num_columns = 0;
  /// Of a mesh that deforms while the shutter is open, at some time: what P and N will be at the next step, and the part of the
  /// way to there. Null: the mesh does not deform, or has no normals. All else is as when the shutter is half done.
  const Vec3f* P_next = nullptr;
  const Normal3f* N_next = nullptr;
  float part = 0;
};

/// What most meshes do not need stays out of the way of those.
[[gnu::noinline]] RELIEF_KERNEL Vec3f mesh_mix(Vec3f from, Vec3f to, float part)
{
  return (1.0f - part) * from + part * to;
}

RELIEF_KERNEL Vec3f mesh_P(const MeshView& mesh, std::uint32_t vertex)
{
  const Vec3f P = mesh.P[vertex];
  if (__builtin_expect(mesh.P_next == nullptr, 1)) return P;
  return mesh_mix(P, mesh.P_next[vertex], mesh.part);
}

/// @pre the mesh has normals
RELIEF_KERNEL Normal3f mesh_N(const MeshView& mesh, std::uint32_t vertex)
{
  const Normal3f N = mesh.N[vertex];
  if (__builtin_expect(mesh.N_next == nullptr, 1)) return N;
  return as_normal(mesh_mix(as_vector(N), as_vector(mesh.N_next[vertex]), mesh.part));
}

/// A place on one primitive of a mesh: on a triangle by weights of vertices 1 and 2, on a curve by how far along the segment it is and,
/// on a ribbon, across. kernel/shape/primitive.h reads what is there.
struct PrimitivePlace {
  const MeshView* mesh = nullptr;  ///< null: on none, as points of lamps and of media are
  std::uint32_t primitive = 0;     ///< number of a triangle, or of what stands in its place
  float u = 0, v = 0;
};

enum InstanceFlag : std::uint32_t {
  kVisibleToCamera = 1u << 0,
  kCastsShadow = 1u << 1,
  kMirrored = 1u << 2,  ///< world_from_object has a negative determinant
  kCausticCaster = 1u << 3,
  kCausticReceiver = 1u << 4,
  kTracedInObjectSpace = 1u << 5,  ///< an instance of a shared mesh: the tracer transforms the ray, not the triangles
  kDisplaced = 1u << 6,            ///< hits bring a position and a normal of their own, in object space
  kNoCausticLight = 1u << 8,       ///< its emission starts no photons
  kGathersPhotons = 1u << 7,       ///< a receiver that has soft lobes, in a render with a photon pass
  kGathersTails = 1u << 9,         ///< likewise, a rough caster: see path_gathers_tails
  kHoldout = 1u << 10,             ///< a hole in the picture where the camera sees it; an object for all other rays
  kMoves = 1u << 11,          ///< while the shutter is open: hits bring a placement of their own, see path_instance
  kDeforms = 1u << 12,        ///< likewise, and a mesh: see path_mesh
  kCurves = 1u << 13,         ///< its mesh is one of curves
  kRibbons = 1u << 14,        ///< these are flat and face the ray
  kHiddenFromShift = 15,      ///< position of four bits, as of Light::hidden_from: bounced rays that do not meet it
  kPoints = 1u << 19,         ///< with kCurves: they are single points, balls
  kShadowCatcher = 1u << 20,  ///< the camera sees of it what all that is none takes from its light
};

inline constexpr std::uint32_t kHiddenFrom = 0xfu << kHiddenFromShift;

/// Groups of lights at most; an instance's flags have the number of that of what it emits, 0 for none.
inline constexpr std::uint32_t kMostLightGroups = 31;
inline constexpr int kLightGroupShift = 21;
inline constexpr std::uint32_t kLightGroup = kMostLightGroups << kLightGroupShift;

/// In place of an instance's number: what is placed so is none, but a lamp or the world.
inline constexpr std::uint32_t kNoInstance = ~0u;

/// One placement of a mesh.
struct InstanceView {
  Affine3 world_from_object, object_from_world;
  std::int32_t mesh_index = 0;
  std::int32_t material_index = 0;
  std::int32_t first_light_index = -1;  ///< lights of an emissive mesh are consecutive, one a triangle; −1: none
  std::int32_t light_copy_index = -1;   ///< of those lights, if it shares them with other instances: see LightRef
  std::uint32_t flags = kVisibleToCamera | kCastsShadow;
  std::uint32_t index = 0;  ///< in the scene; kNoInstance: it is not there
};

}  // namespace relief
