// Stage: paths that met surfaces look for the photons around.
#pragma once

#include "kernel/photon/gather.h"
#include "kernel/stage/surface_interaction.h"

namespace relief {

/// Unit geometric normal of a path's hit, world space, on the front side.
RELIEF_KERNEL Vec3f hit_geometric_normal(const KernelGlobals& g, const PathState& state, std::uint32_t path)
{
  return normalize(hit_plane(g, state, path, path_instance(g, state, path)).Ng);
}

/// Unit shading normal of a path's hit, world space, on the front side, without a normal map.
RELIEF_KERNEL Vec3f hit_shading_normal(const KernelGlobals& g, const PathState& state, std::uint32_t path)
{
  const InstanceView& instance = path_instance(g, state, path);
  if ((instance.flags & kDisplaced) != 0) {
    const Vec3f Ns = state.hit_Ns[path];
    return normalize(transform_normal(instance.object_from_world, as_normal(Ns)));
  }
  return surface_hit_make(path_mesh(g, state, path, instance), instance, state.hit_triangle[path], state.hit_u[path],
                          state.hit_v[path])
      .Ns;
}

/// The lobe by whose tails a path's hit shows photons.
/// @param wo  unit
/// @param Ng  unit, on the side of wo
RELIEF_KERNEL PhotonLobe
hit_photon_lobe(const KernelGlobals& g, const PathState& state, std::uint32_t path, Vec3f wo, Vec3f Ng, bool front)
{
  const Material& material = g.materials[g.instances[state.hit_object[path]].material_index];
  PhotonLobe lobe;
  lobe.alpha = sqr(material.roughness);
  lobe.frame =
      frame_from_normal(shading_normal_towards(shading_normal_turned(hit_shading_normal(g, state, path), Ng), wo));
  lobe.wo = to_local(lobe.frame, wo);
  const float eta = front ? material.ior : 1.0f / material.ior;
  const bool glass = material.transmission > 0.0f && material.thickness > 0.0f && material.metallic == 0.0f;
  if (glass && !dielectric_is_matched(eta)) lobe.eta = eta;
  lobe.most = kTailDensity;
  return lobe;
}

/// Writes what photons bring to a path's hit.
RELIEF_KERNEL void gather_photons(const KernelGlobals& g, PathState& state, std::uint32_t path)
{
  const CausticStateView& caustic = state.caustic;
  (*caustic.irradiance)[path] = Vec3f{};
  const InstanceView& instance = g.instances[state.hit_object[path]];
  PhotonQuery query;
  const bool tails = path_gathers_tails(state.flags[path], instance);
  if (((instance.flags & kGathersPhotons) == 0 && !tails) || g.caustics.map.octaves == 0) return;
  // Photons went on from here to where the path comes from.
  if ((state.flags[path] & kPathCaustic) != 0) return;
  // What the event counts as, where it may be of several kinds, is known when a photon is.
  const BounceKind event = tails ? BounceKind::kAll : BounceKind::kDiffuse;
  if (!photon_bounces_left(g.limits, state.bounces[path], event, &query.bounces)) return;
  const Vec3f D = path_direction(state, path);
  query.P = path_origin(state, path) + D * state.hit_t[path];
  query.Ng = hit_geometric_normal(g, state, path);
  const bool front = dot(query.Ng, D) <= 0.0f;
  if (!front) query.Ng = -query.Ng;
  query.both_sides = g.materials[instance.material_index].transmission > 0.0f;
  if (tails) query.lobe = hit_photon_lobe(g, state, path, -D, query.Ng, front);
  query.Ng = path_level_normal(state, path, query.Ng);
  query.hash =
      state.pixel_hash[path] ^ (state.sample_index[path] + 1u) * 0x9e3779b1u ^ state.bounces[path] * 0x85ebca77u;
  const PhotonGather gather = photon_gather(g.caustics.map, query);
  const bool on_facet = state.facets != nullptr && state.facets[path].height > 0.0f;
  (*caustic.irradiance)[path] =
      on_facet ? gather.irradiance * facet_irradiance_factor(state.facets[path], gather.wi) : gather.irradiance;
  caustic.wi[path] = octahedral_encode(gather.wi);
  caustic.bounces[path] = gather.bounces;
}

}  // namespace relief
