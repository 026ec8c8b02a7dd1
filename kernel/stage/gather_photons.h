// Stage: paths that met surfaces look for the photons around.
#pragma once

#include "kernel/photon/gather.h"
#include "kernel/stage/path_access.h"

namespace relief {

/// Bounces that photons gathered at a path's present hit may have, so that camera path and photon together keep the limits.
/// @param diffuse_event  the gathering event, which is one itself, counts as diffuse, else as glossy
/// @return               false: none may
RELIEF_KERNEL bool photon_bounces_left(const BounceLimits& limits,
                                       std::uint32_t bounces,
                                       bool diffuse_event,
                                       std::uint32_t* left)
{
  const int total = limits.total - path_bounces(bounces, BounceKind::kAll) - 1;
  const int diffuse = limits.diffuse - path_bounces(bounces, BounceKind::kDiffuse) - (diffuse_event ? 1 : 0);
  const int glossy = limits.glossy - path_bounces(bounces, BounceKind::kGlossy) - (diffuse_event ? 0 : 1);
  const int transmission = limits.transmission - path_bounces(bounces, BounceKind::kTransmission);
  if (total < 0 || diffuse < 0 || glossy < 0 || transmission < 0) return false;
  const auto byte = [](int count, BounceKind kind) {
    constexpr int kMost = 127;
    return static_cast<std::uint32_t>(count < kMost ? count : kMost) << static_cast<int>(kind);
  };
  *left = byte(total, BounceKind::kAll) | byte(diffuse, BounceKind::kDiffuse) | byte(glossy, BounceKind::kGlossy) |
          byte(transmission, BounceKind::kTransmission);
  return true;
}

/// Unit geometric normal of a path's hit, world space, on the front side.
RELIEF_KERNEL Vec3f hit_geometric_normal(const KernelGlobals& g, const PathState& state, std::uint32_t path)
{
  const InstanceView& instance = g.instances[state.hit_object[path]];
  if ((instance.flags & kDisplaced) != 0) {
    const Vec3f Ng{state.hit_Ng_x[path], state.hit_Ng_y[path], state.hit_Ng_z[path]};
    return normalize(transform_normal(instance.object_from_world, as_normal(Ng)));
  }
  const MeshView& mesh = g.meshes[instance.mesh_index];
  const TriangleIndices tri = mesh.triangles[state.hit_triangle[path]];
  const Vec3f edge1 = transform_vector(instance.world_from_object, mesh.P[tri.v1] - mesh.P[tri.v0]);
  const Vec3f edge2 = transform_vector(instance.world_from_object, mesh.P[tri.v2] - mesh.P[tri.v0]);
  const Vec3f Ng = normalize(cross(edge1, edge2));
  return (instance.flags & kMirrored) != 0 ? -Ng : Ng;
}

/// Writes what photons bring to a path's hit.
RELIEF_KERNEL void gather_photons(const KernelGlobals& g, PathState& state, std::uint32_t path)
{
  const CausticStateView& caustic = state.caustic;
  caustic.irradiance_r[path] = caustic.irradiance_g[path] = caustic.irradiance_b[path] = 0.0f;
  const InstanceView& instance = g.instances[state.hit_object[path]];
  PhotonQuery query;
  if ((instance.flags & (kGathersPhotons | kGathersInside)) == 0 || g.caustics.map.octaves == 0) return;
  // Photons went on from here to where the path comes from.
  if ((state.flags[path] & kPathCaustic) != 0) return;
  const bool diffuse_event = (instance.flags & kGathersPhotons) != 0;
  if (!photon_bounces_left(g.limits, state.bounces[path], diffuse_event, &query.bounces)) return;
  const Vec3f D = path_direction(state, path);
  query.P = path_origin(state, path) + D * state.hit_t[path];
  query.Ng = hit_geometric_normal(g, state, path);
  const bool front = dot(query.Ng, D) <= 0.0f;
  if (!diffuse_event && !path_gathers_inside(state.flags[path], instance, front)) return;
  if (!front) query.Ng = -query.Ng;
  query.both_sides = diffuse_event && g.materials[instance.material_index].transmission > 0.0f;
  if (!diffuse_event) {
    // The facets of a smooth mesh lean a little against what shades it.
    constexpr float kFacets = 0.05f;
    query.wo = -D;
    query.alpha = sqr(g.materials[instance.material_index].roughness) + kFacets;
  }
  query.hash =
      state.pixel_hash[path] ^ (state.sample_index[path] + 1u) * 0x9e3779b1u ^ state.bounces[path] * 0x85ebca77u;
  const PhotonGather gather = photon_gather(g.caustics.map, query);
  caustic.irradiance_r[path] = gather.irradiance.x;
  caustic.irradiance_g[path] = gather.irradiance.y;
  caustic.irradiance_b[path] = gather.irradiance.z;
  caustic.wi[path] = octahedral_encode(gather.wi);
}

}  // namespace relief
