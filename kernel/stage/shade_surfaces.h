// Stage: paths that have met surfaces of one material of closures, eight together. The steps are those of shade_surface.h; between
// them closures are evaluated and sampled in columns, if they are no more than lobe_columns.h has.
#pragma once

#include "kernel/stage/shade_surface.h"

namespace relief {

/// Up to eight paths at located hits of one material, whose program has run.
struct SurfaceGroup {
  const std::uint32_t* paths;
  SurfaceInteraction* at;
  const GraphProgramView& program;
  const GraphRegisters& registers;
  unsigned lanes;  ///< those that are shaded, bit by bit: others are of no path, or have been sent on already
};

/// Calls f(lane) for those that are shaded.
template <typename F>
RELIEF_KERNEL void surface_group_visit(const SurfaceGroup& group, F&& f)
{
  for (unsigned left = group.lanes; left != 0; left &= left - 1) f(__builtin_ctz(left));
}

/// Whether all of a group are met on strands.
RELIEF_KERNEL bool group_is_on_curves(const SurfaceGroup& group)
{
  bool on_curves = true;
  surface_group_visit(group, [&](int k) { on_curves = on_curves && has_strands(*group.at[k].instance); });
  return on_curves;
}

/// What closures of a group are resolved for.
RELIEF_KERNEL MixtureBuildLanes surface_group_build(const KernelGlobals& g,
                                                    const PathState& state,
                                                    const SurfaceGroup& group)
{
  alignas(32) float numbers[9][8] = {};
  alignas(32) std::int32_t is_front[8] = {};
  surface_group_visit(group, [&](int k) {
    const SurfaceInteraction& at = group.at[k];
    store_lane(numbers, k, -path_direction(state, group.paths[k]));
    store_lane(numbers + 3, k, at.side.Ng);
    store_lane(numbers + 6, k, at.side.front ? at.hit.Ns : -at.hit.Ns);
    is_front[k] = at.side.front ? -1 : 0;
  });
  return {load8(numbers), load8(numbers + 3), load8(numbers + 6),
          g.bsdf_tables,  load8(is_front),    group_is_on_curves(group)};
}

/// Whether a group's closures may be columns: fewer hits are not worth it, and layers of light by its first event want parts of
/// closures.
RELIEF_KERNEL bool group_has_columns(const PathState& state, const SurfaceGroup& group)
{
  return __builtin_popcount(group.lanes) > 2 && state.light_passes == nullptr;
}

/// Whether all that a group's surfaces scatter by is columns of their closures.
/// @param closures  of closures_with_columns
RELIEF_KERNEL bool surface_group_is_resolved(const KernelGlobals& g,
                                             const PathState& state,
                                             const SurfaceGroup& group,
                                             std::uint64_t closures)
{
  bool is_resolved = group_has_columns(state, group) && closures_scatter_alone(group.program, closures);
  const bool on_curves = group_is_on_curves(group);
  surface_group_visit(group, [&](int k) {
    is_resolved = is_resolved && has_strands(*group.at[k].instance) == on_curves &&
                  path_does_without(g, state.flags[group.paths[k]]) == 0;
  });
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
  alignas(32) float blur[8] = {}, most_sharp[8] = {};
  surface_group_visit(group, [&](int k) {
    const SurfaceBlur of = surface_blur<kFeatures>(g, state, group.paths[k], *group.at[k].instance);
    blur[k] = of.alpha;
    most_sharp[k] = of.most_sharp;
  });
  hit_columns_begin(b, frame_from_normal(shading_normal_towards(b.Ns, b.wo)), load8(blur), load8(most_sharp), hits);
  surface_group_visit(group, [&](int k) {
    const std::uint32_t path = group.paths[k];
    SurfaceInteraction& at = group.at[k];
    const ClosureSight sight =
        closure_sight(g, state, path, *at.instance, surface_blur<kFeatures>(g, state, path, *at.instance));
    HitLane lane{&hits, k};
    surface_interaction_mix<kFeatures>(g, -path_direction(state, path), {&group.program, &group.registers, k},
                                       &hits.lobes, sight, at, lane);
  });
}

/// Resolves a group's hits one by one.
/// @param columns  of closures_resolve_columns; null: there are none
/// @param lists    get their lobes; empty
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
  surface_group_visit(group, [&](int k) {
    const std::uint32_t path = group.paths[k];
    SurfaceInteraction& at = group.at[k];
    const GraphHit hit{{&group.program, &group.registers, k}, columns};
    surface_interaction_resolve<kFeatures>(g, state, path, -path_direction(state, path), at, lists[k], &hit);
    has_lists = has_lists && has_mixture<kFeatures>(at);
    hit_columns_set_surface(hits, k, at.side.Ng, at.side.frame);
  });
  return has_lists && lobe_columns_take(hits.lobes, lists, 8);
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

/// Asks a group's hits what they send from where the photons come that have been gathered.
template <unsigned kFeatures>
RELIEF_KERNEL void surface_group_ask_photons(const KernelGlobals& g,
                                             const PathState& state,
                                             const SurfaceGroup& group,
                                             const SurfaceVisit* visits,
                                             HitColumns& hits)
{
  bool has_photons = false;
  surface_group_visit(group, [&](int k) {
    const std::uint32_t path = group.paths[k];
    const SurfaceInteraction& at = group.at[k];
    hits.most_sharp[k] =
        sharp_lobes(at.params, (at.instance->flags & kCausticCaster) != 0, g.caustics.roughness).most_roughness;
    if (visits[k].way != SurfaceWay::kScatters || is_zero((*state.caustic.irradiance)[path])) return;
    store_lane(hits.to[static_cast<int>(HitTowards::kPhoton)], k, octahedral_decode(state.caustic.wi[path]));
    has_photons = true;
  });
  if (has_photons) hit_columns_ask<HitTowards::kPhoton>(hits);
}

/// Shades a group that is resolved. Reads and writes what shade_surface does of each, and has the same ways to go on.
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
  surface_group_visit(group, [&](int k) {
    const std::uint32_t path = group.paths[k];
    SurfaceVisit& visit = visits[k];
    SurfaceInteraction& at = group.at[k];
    visit.u = scatter_samples(state.pixel_hash[path], state.sample_index[path], path_surface(state, path));
    shade_surface_meet<kFeatures>(g, state, path, at, HitLane{&hits, k}, visit, sinks.shadow, sinks.counters);
    hits.u[0][k] = visit.u.bsdf.x;
    hits.u[1][k] = visit.u.bsdf.y;
    hits.u[2][k] = visit.u.branch;
    scatter = scatter || visit.way == SurfaceWay::kScatters;
  });
  // Among many lights those that were chosen have been on their way from memory since.
  surface_group_visit(group, [&](int k) {
    SurfaceVisit& visit = visits[k];
    if (!(visit.chosen.probability > 0.0f)) return;
    answers[k] = light_ask(g, state, group.paths[k], visit.chosen, group.at[k].hit.P, visit.receiver.N, storage[k]);
    if (!light_answers(answers[k])) visit.chosen.probability = 0.0f;
    store_lane(hits.to[static_cast<int>(HitTowards::kLamp)], k, answers[k].sample.wi);
    are_lit = true;
  });
  constexpr bool kPhotons = (kFeatures & kFeatureCaustics) != 0;
  if (are_lit) hit_columns_ask<HitTowards::kLamp>(hits);
  if constexpr (kPhotons) surface_group_ask_photons<kFeatures>(g, state, group, visits, hits);
  if (scatter) hit_columns_sample<kPhotons>(hits);

  surface_group_visit(group, [&](int k) {
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
      if constexpr (kPhotons) {
        HitLane towards_photon = closure;
        towards_photon.towards = HitTowards::kPhoton;
        shade_surface_photons<kFeatures>(
            g, state, path, ScatterEvent<HitLane>{at, towards_photon, visit.throughput, visit.receiver, visit.cone},
            to_local(at.side.frame, -path_direction(state, path)));
      }
      shade_surface_continue<kFeatures>(g, state, path, event, closure_sample(closure), 1.0f, visit.u, sinks.next);
    }
  });
}

}  // namespace relief
