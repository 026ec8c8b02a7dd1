// Stage: paths that have met surfaces of one plain Principled material, eight together. The steps are those of shade_surface.h;
// between them closures are evaluated and sampled in columns (principled3_hits.h).
#pragma once

#include "kernel/stage/shade_surface.h"

namespace relief {

/// Up to eight paths at located hits of one material, whose program has run.
struct SurfaceGroup {
  const std::uint32_t* paths;
  int count;
  SurfaceInteraction* at;
  const GraphProgramView& program;
  const GraphRegisters& registers;
};

/// What closures of a group are resolved for.
RELIEF_KERNEL MixtureBuildLanes surface_group_build(const PathState& state, const SurfaceGroup& group)
{
  alignas(32) float numbers[9][8] = {};
  for (int k = 0; k < group.count; ++k) {
    const SurfaceInteraction& at = group.at[k];
    store_lane(numbers, k, -path_direction(state, group.paths[k]));
    store_lane(numbers + 3, k, at.side.Ng);
    store_lane(numbers + 6, k, shading_normal_turned(at.hit.Ns, at.side.Ng));
  }
  return {load8(numbers), load8(numbers + 3), load8(numbers + 6)};
}

/// Whether all that a group's surfaces scatter by is known in columns.
/// @param plain  of closures_plain
RELIEF_KERNEL bool surface_group_is_plain(const KernelGlobals& g,
                                          const PathState& state,
                                          const SurfaceGroup& group,
                                          const SurfaceClosureSpec& plain)
{
  bool is_plain = closure_scatters_alone(group.program, plain);
  for (int k = 0; k < group.count; ++k) {
    is_plain = is_plain && (group.at[k].instance->flags & kCurves) == 0 &&
               path_does_without(g, state.flags[group.paths[k]]) == 0;
  }
  return is_plain;
}

/// As shading_normal_towards.
RELIEF_KERNEL Vec3x8 shading_normal_towards(const Vec3x8& Ns, const Vec3x8& wo)
{
  const F8 cos_o = dot(Ns, wo);
  return select(cos_o >= kLeastShadingCosine, Ns, normalize(Ns + (kLeastShadingCosine - cos_o) * wo));
}

/// Shades a group. Reads and writes what shade_surface does of each, and has the same ways to go on. (Photons would ask for parts of
/// closures, and in more directions.)
/// @param b     of surface_group_build
/// @param hits  their lobes are made, of b
template <unsigned kFeatures>
[[gnu::flatten]] RELIEF_KERNEL void shade_surface_group(const KernelGlobals& g,
                                                        PathState& state,
                                                        const SurfaceGroup& group,
                                                        const MixtureBuildLanes& b,
                                                        Principled3Hits& hits,
                                                        QueueView& next,
                                                        ShadowQueue& shadow,
                                                        Counters& counters)
{
  alignas(32) float blur[8] = {};
  for (int k = 0; k < group.count; ++k) blur[k] = path_blur(g, state, group.paths[k]);
  principled3_hits_make(b, frame_from_normal(shading_normal_towards(b.Ns, b.wo)), load8(blur), hits);

  SurfaceVisit visits[8];
  LightAnswer answers[8];
  Light storage[8];
  bool are_lit = false, scatter = false;
  for (int k = 0; k < group.count; ++k) {
    const std::uint32_t path = group.paths[k];
    SurfaceVisit& visit = visits[k];
    SurfaceInteraction& at = group.at[k];
    visit.u = scatter_samples(state.pixel_hash[path], state.sample_index[path], path_surface(state, path));
    Principled3Lane lane{&hits, k};
    const ClosureSight sight =
        closure_sight(g, state, path, *at.instance, surface_blur<kFeatures>(g, state, path, *at.instance));
    surface_interaction_mix<kFeatures>(g, -path_direction(state, path), {&group.program, &group.registers, k},
                                       &hits.lobes, sight, at, lane);
    shade_surface_meet<kFeatures>(g, state, path, at, lane, visit, shadow, counters);
    if (visit.chosen.probability > 0.0f) {
      answers[k] = light_ask(g, state, path, visit.chosen, at.hit.P, visit.light_N, storage[k]);
      if (!light_answers(answers[k])) visit.chosen.probability = 0.0f;
      store_lane(hits.to_lamp, k, answers[k].sample.wi);
      are_lit = true;
    }
    hits.u[0][k] = visit.u.bsdf.x;
    hits.u[1][k] = visit.u.bsdf.y;
    scatter = scatter || visit.way == SurfaceWay::kScatters;
  }
  if (are_lit) principled3_hits_light(hits);
  if (scatter) principled3_hits_sample(hits);

  for (int k = 0; k < group.count; ++k) {
    const std::uint32_t path = group.paths[k];
    const SurfaceVisit& visit = visits[k];
    const SurfaceInteraction& at = group.at[k];
    const Principled3Lane closure{&hits, k, 1.0f / at.params.alpha};
    const ScatterEvent<Principled3Lane> event{at, closure, visit.throughput, visit.light_N, visit.cone};
    if (visit.chosen.probability > 0.0f) {
      const Vec3f wi = to_local(at.side.frame, answers[k].sample.wi);
      shade_surface_lit<kFeatures>(g, state, path, event, answers[k], wi,
                                   closure_eval<kFeatures>(closure, *g.bsdf_tables, wi), shadow);
    }
    if (visit.way == SurfaceWay::kPasses) {
      if (path_pass_through(g, state, path, at.passed)) queue_push(next, path);
    } else if (visit.way == SurfaceWay::kScatters) {
      shade_surface_continue<kFeatures>(g, state, path, event, closure_sample(closure), 1.0f, visit.u, next);
    }
  }
}

}  // namespace relief
