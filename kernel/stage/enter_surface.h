// A path goes below the surface that it has met. Where it walks there, and where it gets out, is found by
// integrator/subsurface_stage.h; leave_surface.h goes on.
#pragma once

#include "kernel/bsdf/mixture.h"
#include "kernel/stage/surface_interaction.h"

namespace relief {

/// @param lobe        by which it enters
/// @param bsdf        sampled, of that lobe
/// @param throughput  up to the surface
RELIEF_KERNEL void path_enter_surface(PathState& state,
                                      std::uint32_t path,
                                      const SurfaceInteraction& at,
                                      const MixtureLobe& lobe,
                                      const BsdfSample& bsdf,
                                      Vec3f throughput)
{
  const Subsurface& surface = lobe.shape.subsurface;
  state.subsurface.entries[path] = {surface, lobe.frame.n, lobe.maths, at.side.front};
  // Profiles lie on the surface as it is, whichever way its normal is bent.
  const Vec3f D = surface.entry == SubsurfaceEntry::kProfile ? -at.side.Ng : from_local(at.side.frame, bsdf.wi);
  path_set_ray(state, path, surface_hit_origin(at.hit, at.hit.P, !at.side.front), D);
  state.throughput[path] = throughput * bsdf.f / bsdf.pdf;
  state.cone_width[path] = at.cone.width;
  state.cone_spread[path] = 0.0f;
  // It counts as no bounce, and what follows must not have the random numbers of before.
  state.pixel_hash[path] = hash_mix_32(state.pixel_hash[path] + 1u);
  queue_push(state.subsurface.entered, path);
}

}  // namespace relief
