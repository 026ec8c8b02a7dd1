// Stage: paths that have met surfaces of one material of closures, eight together. The steps are those of shade_surface.h; between
// them closures are evaluated and sampled in columns, if they are no more than lobe_columns.h has.
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
RELIEF_KERNEL MixtureBuildLanes surface_group_build(const KernelGlobals& g,
                                                    const PathState& state,
                                                    const SurfaceGroup& group)
{
  alignas(32) float numbers[9][8] = {};
  for (int k = 0; k < group.count; ++k) {
    const SurfaceInteraction& at = group.at[k];
    store_lane(numbers, k, -path_direction(state, group.paths[k]));
    store_lane(numbers + 3, k, at.side.Ng);
    store_lane(numbers + 6, k, shading_normal_turned(at.hit.Ns, at.side.Ng));
  }
  return {load8(numbers), load8(numbers + 3), load8(numbers + 6), g.bsdf_tables};
}

/// Whether a group's closures may be columns: fewer hits are not worth it, and layers of light by its first event want parts of
/// closures.
RELIEF_KERNEL bool group_has_columns(const PathState& state, const SurfaceGroup& group)
{
  return group.count > 2 && state.light_passes == nullptr;
}

/// Whether all that a group's surfaces scatter by is what one closure has resolved.
/// @param closure  of closures_with_columns
RELIEF_KERNEL bool surface_group_is_resolved(const KernelGlobals& g,
                                             const PathState& state,
                                             const SurfaceGroup& group,
                                             const SurfaceClosureSpec& closure)
{
  bool is_resolved = group_has_columns(state, group) && closure_scatters_alone(group.program, closure);
  for (int k = 0; k < group.count; ++k) {
    is_resolved = is_resolved && (group.at[k].instance->flags & kCurves) == 0 &&
                  path_does_without(g, state.flags[group.paths[k]]) == 0;
  }
  return is_resolved;
}

/// As shading_normal_towards.
RELIEF_KERNEL Vec3x8 shading_normal_towards(const Vec3x8& Ns, const Vec3x8& wo)
{
  const F8 cos_o = dot(Ns, wo);
  return select(cos_o >= kLeastShadingCosine, Ns, normalize(Ns + (kLeastShadingCosine - cos_o) * wo));
}

/// Completes a group that surface_group_is_resolved.
/// @param b     of surface_group_build
/// @param hits  their lobes are resolved, of b
template <unsigned kFeatures>
[[gnu::flatten]] RELIEF_KERNEL void surface_group_resolve(const KernelGlobals& g,
                                                          const PathState& state,
                                                          const SurfaceGroup& group,
                                                          const MixtureBuildLanes& b,
                                                          HitColumns& hits)
{
  alignas(32) float blur[8] = {};
  for (int k = 0; k < group.count; ++k) blur[k] = path_blur(g, state, group.paths[k]);
  hit_columns_begin(b, frame_from_normal(shading_normal_towards(b.Ns, b.wo)), load8(blur), hits);
  for (int k = 0; k < group.count; ++k) {
    const std::uint32_t path = group.paths[k];
    SurfaceInteraction& at = group.at[k];
    const ClosureSight sight =
        closure_sight(g, state, path, *at.instance, surface_blur<kFeatures>(g, state, path, *at.instance));
    HitLane lane{&hits, k};
    surface_interaction_mix<kFeatures>(g, -path_direction(state, path), {&group.program, &group.registers, k},
                                       &hits.lobes, sight, at, lane);
  }
}

/// Resolves a group's hits one by one.
/// @param columns  of closures_resolve_columns; null: there are none
/// @param lists    get their lobes
/// @param hits     gets them too
/// @return         false: they are no columns
template <unsigned kFeatures>
[[gnu::flatten]] RELIEF_KERNEL bool surface_group_resolve(const KernelGlobals& g,
                                                          const PathState& state,
                                                          const SurfaceGroup& group,
                                                          const LobeColumns* columns,
                                                          MixtureLobes lists[8],
                                                          HitColumns& hits)
{
  bool has_lists = group_has_columns(state, group);
  for (int k = 0; k < group.count; ++k) {
    const std::uint32_t path = group.paths[k];
    SurfaceInteraction& at = group.at[k];
    const GraphHit hit{{&group.program, &group.registers, k}, columns};
    surface_interaction_resolve<kFeatures>(g, state, path, -path_direction(state, path), at, lists[k], &hit);
    has_lists = has_lists && has_mixture<kFeatures>(at);
    hit_columns_set_surface(hits, k, at.side.Ng, at.side.frame);
  }
  return has_lists && lobe_columns_take(hits.lobes, lists, group.count);
}

/// Shades one path of a group whose hits are resolved, but are no columns.
template <unsigned kFeatures>
[[gnu::flatten]] RELIEF_KERNEL void shade_surface_listed(const KernelGlobals& g,
                                                         PathState& state,
                                                         std::uint32_t path,
                                                         SurfaceInteraction& at,
                                                         const MixtureLobes& lobes,
                                                         const SurfaceSinks& sinks)
{
  SurfaceVisit visit;
  visit.u = scatter_samples(state.pixel_hash[path], state.sample_index[path], path_surface(state, path));
  shade_surface_resolved<kFeatures>(g, state, path, at, lobes, visit, sinks);
}

/// Shades a group that is resolved. Reads and writes what shade_surface does of each, and has the same ways to go on. (Photons
/// would ask for parts of closures, and in more directions.)
/// @param hits  has their lobes
template <unsigned kFeatures>
[[gnu::flatten]] RELIEF_KERNEL void shade_surface_group(const KernelGlobals& g,
                                                        PathState& state,
                                                        const SurfaceGroup& group,
                                                        HitColumns& hits,
                                                        const SurfaceSinks& sinks)
{
  SurfaceVisit visits[8];
  LightAnswer answers[8];
  Light storage[8];
  bool are_lit = false, scatter = false;
  for (int k = 0; k < group.count; ++k) {
    const std::uint32_t path = group.paths[k];
    SurfaceVisit& visit = visits[k];
    SurfaceInteraction& at = group.at[k];
    visit.u = scatter_samples(state.pixel_hash[path], state.sample_index[path], path_surface(state, path));
    shade_surface_meet<kFeatures>(g, state, path, at, HitLane{&hits, k}, visit, sinks.shadow, sinks.counters);
    hits.u[0][k] = visit.u.bsdf.x;
    hits.u[1][k] = visit.u.bsdf.y;
    scatter = scatter || visit.way == SurfaceWay::kScatters;
  }
  // Among many lights those that were chosen have been on their way from memory since.
  for (int k = 0; k < group.count; ++k) {
    SurfaceVisit& visit = visits[k];
    if (!(visit.chosen.probability > 0.0f)) continue;
    answers[k] = light_ask(g, state, group.paths[k], visit.chosen, group.at[k].hit.P, visit.receiver.N, storage[k]);
    if (!light_answers(answers[k])) visit.chosen.probability = 0.0f;
    store_lane(hits.to_lamp, k, answers[k].sample.wi);
    are_lit = true;
  }
  if (are_lit) hit_columns_light(hits);
  if (scatter) hit_columns_sample(hits);

  for (int k = 0; k < group.count; ++k) {
    const std::uint32_t path = group.paths[k];
    const SurfaceVisit& visit = visits[k];
    const SurfaceInteraction& at = group.at[k];
    const HitLane closure{&hits, k, 1.0f / at.params.alpha};
    const ScatterEvent<HitLane> event{at, closure, visit.throughput, visit.receiver, visit.cone};
    if (visit.chosen.probability > 0.0f) {
      const Vec3f wi = to_local(at.side.frame, answers[k].sample.wi);
      shade_surface_lit<kFeatures>(g, state, path, event, answers[k], wi,
                                   closure_eval<kFeatures>(closure, *g.bsdf_tables, wi), sinks.shadow);
    }
    if (visit.way == SurfaceWay::kPasses) {
      if (path_pass_through(g, state, path, at.passed)) queue_push(sinks.next, path);
    } else if (visit.way == SurfaceWay::kScatters) {
      shade_surface_continue<kFeatures>(g, state, path, event, closure_sample(closure), 1.0f, visit.u, sinks.next);
    }
  }
}

}  // namespace relief
