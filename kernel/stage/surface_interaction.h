// What a path meets at a surface, before anything is decided: the point, its material's parameters, and the frame its
// BSDF is evaluated in. Camera paths (shade_surface.h) and photons (shade_photon.h) see the same.
#pragma once

#include <new>

#include "kernel/bsdf/surface_params.h"
#include "kernel/feature_mask.h"
#include "kernel/globals.h"
#include "kernel/graph/graph_load.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/shape/facet_masking.h"
#include "kernel/shape/primitive.h"
#include "kernel/shape/surface_hits.h"
#include "kernel/stage/path_access.h"
#include "kernel/stage/surface_lobes.h"
#include "kernel/texture/ray_cone.h"

namespace relief {

/// The side of a surface that a path is on, and the frame its BSDF is evaluated in.
struct ShadingSide {
  Vec3f Ng;     ///< geometric normal on the side of wo
  Frame frame;  ///< local +z: for a solid dielectric the outward normal, otherwise the shading normal on wo's side
  Vec3f Ns;     ///< shading normal on wo's side
  bool front;   ///< wo is on the front side of the triangle
  bool bent;    ///< Ns is not the surface's: wo was below its horizon
};

/// What films and denoisers are told of a surface.
struct SurfaceSummary {
  Vec3f albedo{};
  bool is_seen_through = false;  ///< they are better told of what is behind, or mirrored
};

struct SurfaceInteraction {
  const InstanceView* instance;
  const Material* material;
  std::uint32_t triangle;
  SurfaceHit hit;
  ShadingSide side;        ///< Ng and front are known from the start, the rest is made by surface_interaction_frame
  SurfaceParams params;    ///< of closures their emission and alpha alone
  bool transmits = false;  ///< light may come through from behind
  RayCone cone;            ///< at the hit
  float uv_width[2];       ///< texture footprint in each set's uv units
  Vec3f passed{1, 1, 1};   ///< of closures: factor on the throughput of what passes, by a chance of 1 − alpha
  float holdout = 0;       ///< of closures: share that is a hole in the picture
  SurfaceSummary summary;  ///< of closures; see surface_summary
};

/// A material of closures, where the kernel has any.
template <unsigned kFeatures>
RELIEF_KERNEL bool has_mixture(const SurfaceInteraction& at)
{
  if constexpr ((kFeatures & kFeatureMixture) != 0) return at.material->has_closures;
  return false;
}

/// A shading normal on the side of the geometric one.
RELIEF_KERNEL Vec3f shading_normal_turned(Vec3f Ns, Vec3f Ng_side) { return dot(Ns, Ng_side) < 0.0f ? -Ns : Ns; }

/// The least cosine to wo keeps the local frame's arithmetic away from zero; 1e-3 is 0.06° and cannot be seen.
inline constexpr float kLeastShadingCosine = 1e-3f;

/// Bends a shading normal until wo is above its horizon.
/// Interpolated normals can face away from a viewer who sees the facet; leaving them so makes dark rims.
RELIEF_KERNEL Vec3f shading_normal_towards(Vec3f Ns, Vec3f wo)
{
  const float cos_o = dot(Ns, wo);
  if (cos_o >= kLeastShadingCosine) return Ns;
  return normalize(Ns + (kLeastShadingCosine - cos_o) * wo);
}

/// Cosine between a shading normal and what was made of it, less than which it was bent: 1 but for rounding.
inline constexpr float kUnbent = 1.0f - 1e-6f;

/// Whether a share of the light is so small.
/// @param others  scattered by other lobes
RELIEF_KERNEL bool share_is_seen_through(float others, float all) { return 4.0f * others < all; }

RELIEF_KERNEL bool surface_params_are_seen_through(const SurfaceParams& p)
{
  constexpr float kLeastReflection = 0.04f;
  if (p.unlit || p.roughness > kSeenThroughRoughness) return false;
  const float base = max_component(p.base_color);
  const float diffuse = (1.0f - p.metallic) * (1.0f - p.transmission) * base;
  const float sharp = p.metallic * base + (1.0f - p.metallic) * (p.specular * kLeastReflection + p.transmission * base);
  return share_is_seen_through(diffuse, diffuse + sharp);
}

/// @pre  the interaction is resolved
template <unsigned kFeatures>
RELIEF_KERNEL SurfaceSummary surface_summary(const SurfaceInteraction& at)
{
  if (has_mixture<kFeatures>(at)) return at.summary;
  return {surface_albedo(at.params), surface_params_are_seen_through(at.params)};
}

/// The plane of the surface that a path has met.
RELIEF_KERNEL PrimitivePlane hit_plane(const KernelGlobals& g,
                                       const PathState& state,
                                       std::uint32_t path,
                                       const InstanceView& instance)
{
  if ((instance.flags & kDisplaced) != 0) {
    const Vec3f Ng = state.hit_Ng[path], P = state.hit_P[path];
    return {transform_point(instance.world_from_object, P),
            transform_normal(instance.object_from_world, as_normal(Ng))};
  }
  return primitive_plane(path_place(g, state, path, instance), instance);
}

/// What a path has hit, without the hit.
RELIEF_KERNEL void surface_interaction_begin(const KernelGlobals& g,
                                             const PathState& state,
                                             std::uint32_t path,
                                             SurfaceInteraction& at)
{
  at.instance = &path_instance(g, state, path);
  at.material = &g.materials[at.instance->material_index];
  at.triangle = state.hit_triangle[path];
}

/// The side of a hit that a path is on, and how wide the path is there.
template <unsigned kFeatures>
RELIEF_KERNEL void surface_interaction_see(const PathState& state, std::uint32_t path, Vec3f wo, SurfaceInteraction& at)
{
  at.side.front = dot(wo, at.hit.Ng) >= 0.0f;
  at.side.Ng = at.side.front ? at.hit.Ng : -at.hit.Ng;

  at.cone = ray_cone_propagate({state.cone_width[path], state.cone_spread[path]}, state.hit_t[path]);
  at.uv_width[0] = at.uv_width[1] = 0.0f;
  if constexpr ((kFeatures & kFeatureTextures) != 0) {
    // Leaves that are images are read finely, as shadow rays read them: a blurred edge lets paths through and asks for light as
    // well, at every leaf behind the other. A forest took three times as many shadow rays as with edges that are sharp.
    if (at.material->transparency_index >= 0) return;
    const float footprint = kReadOfCone * ray_cone_footprint_world(at.cone, dot(wo, at.side.Ng));
    at.uv_width[0] = footprint * at.hit.area_ratio[0];
    at.uv_width[1] = footprint * at.hit.area_ratio[1];
  }
}

/// The point that a path has hit; its material's parameters there are left open.
/// @param wo  unit, back along the path's ray
template <unsigned kFeatures>
RELIEF_KERNEL SurfaceInteraction
surface_interaction_locate(const KernelGlobals& g, const PathState& state, std::uint32_t path, Vec3f wo)
{
  SurfaceInteraction at;
  surface_interaction_begin(g, state, path, at);
  const PrimitivePlace place = path_place(g, state, path, *at.instance);
  if (__builtin_expect((at.instance->flags & kDisplaced) == 0, 1)) {
    const Vec3f P_ray = path_origin(state, path) + path_direction(state, path) * state.hit_t[path];
    at.hit = primitive_hit(place, *at.instance, P_ray, wo);
  } else {
    at.hit = surface_hit_displaced(
        *place.mesh, *at.instance, place.primitive, place.u, place.v,
        {state.hit_P[path], state.hit_Ng[path], state.hit_Ns[path], state.hit_leave[path], state.hit_lift[path]});
  }
  surface_interaction_see<kFeatures>(state, path, wo, at);
  return at;
}

/// The points that paths have hit, as surface_interaction_locate has each.
/// @param count  1 to 8
/// @param at     gets those
template <unsigned kFeatures>
[[gnu::noinline]] RELIEF_KERNEL void surface_interactions_locate(const KernelGlobals& g,
                                                                 const PathState& state,
                                                                 const std::uint32_t* paths,
                                                                 int count,
                                                                 SurfaceInteraction* at)
{
  // Fewer are not worth it.
  bool are_triangles = count > 2;
  for (int k = 0; k < count; ++k) {
    are_triangles = are_triangles && (path_instance(g, state, paths[k]).flags & (kDisplaced | kCurves)) == 0;
  }
  if (!are_triangles) {
    for (int k = 0; k < count; ++k) {
      new (&at[k]) SurfaceInteraction(
          surface_interaction_locate<kFeatures>(g, state, paths[k], -path_direction(state, paths[k])));
    }
    return;
  }
  SurfaceHitQuestions questions{};
  SurfaceHit* hits[8];
  for (int k = 0; k < count; ++k) {
    surface_interaction_begin(g, state, paths[k], *new (&at[k]) SurfaceInteraction);
    questions.mesh[k] = &path_mesh(g, state, paths[k], *at[k].instance);
    questions.instance[k] = at[k].instance;
    questions.triangle[k] = at[k].triangle;
    questions.bary_u[k] = state.hit_u[paths[k]];
    questions.bary_v[k] = state.hit_v[paths[k]];
    hits[k] = &at[k].hit;
  }
  surface_hits_make(questions, count, hits);
  for (int k = 0; k < count; ++k) {
    surface_interaction_see<kFeatures>(state, paths[k], -path_direction(state, paths[k]), at[k]);
  }
}

/// What kinds of ray a path's present one is: bits GraphRayKind. A photon's is what the camera's path is told that goes the other
/// way: from what shows the photon it is a diffuse one, and before, as far as anyone knows yet, one through glass.
RELIEF_KERNEL std::uint32_t path_ray_kinds(const PathState& state, std::uint32_t path)
{
  const auto bit = [](GraphRayKind kind) { return 1u << static_cast<int>(kind); };
  if ((state.flags[path] & kPathPhoton) != 0) {
    if ((state.flags[path] & kPathCaustic) != 0) return bit(GraphRayKind::kReflection) | bit(GraphRayKind::kDiffuse);
    return bit(GraphRayKind::kTransmission) | bit(GraphRayKind::kGlossy) | bit(GraphRayKind::kSingular);
  }
  const auto event = static_cast<PathEvent>(path_event(state.flags[path]));
  if (event == PathEvent::kCamera) return bit(GraphRayKind::kCamera);
  // Cycles' bound on the least density of a path that still rounds edges.
  constexpr float kSharpPdf = 8.0f;
  const std::uint32_t blurred = state.least_pdf[path] < kSharpPdf ? bit(GraphRayKind::kBlurred) : 0u;
  if ((state.flags[path] & kPathScattered) != 0) return blurred;
  const std::uint32_t side =
      bit(event == PathEvent::kTransmission ? GraphRayKind::kTransmission : GraphRayKind::kReflection) | blurred;
  if (path_is_after_diffuse(state.flags[path])) return side | bit(GraphRayKind::kDiffuse);
  return side | bit(GraphRayKind::kGlossy) | (state.pdf[path] > 0.0f ? 0u : bit(GraphRayKind::kSingular));
}

/// What a graph may read of a located point.
RELIEF_KERNEL GraphPoint surface_graph_point(const KernelGlobals& g,
                                             const PathState& state,
                                             std::uint32_t path,
                                             const SurfaceInteraction& at,
                                             Vec3f wo)
{
  return {path_place(g, state, path, *at.instance),
          at.instance,
          &at.hit,
          wo,
          {at.uv_width[0], at.uv_width[1]},
          at.cone.width,
          &g.graph_scene,
          {path_ray_kinds(state, path), state.bounces[path], state.flags[path] >> kPathTransparentShift,
           path_ray_length(g, state, path), path_time(state, path)}};
}

/// Runs the program of a material at up to eight hits of it, a lane each.
/// @param located  of paths, in their order
RELIEF_KERNEL void surface_graph_run(const KernelGlobals& g,
                                     const PathState& state,
                                     const GraphProgramView& program,
                                     const std::uint32_t* paths,
                                     int count,
                                     const SurfaceInteraction* located,
                                     GraphRegisters& registers)
{
  const auto point_of = [&](int k) {
    return surface_graph_point(g, state, paths[k], located[k], -path_direction(state, paths[k]));
  };
  if (count > 2) {
    GraphPlaces places;
    for (int k = 0; k < 8; ++k) {
      const int i = k < count ? k : 0;
      places.hit[k] = &located[i].hit;
      places.instance[k] = located[i].instance;
      places.wo[k] = -path_direction(state, paths[i]);
      places.footprint[k] = located[i].cone.width;
    }
    graph_load_points(program, places, count, point_of, registers);
  } else {
    for (int k = 0; k < count; ++k) graph_load_point(program, point_of(k), k, registers);
  }
  registers.used = (1u << count) - 1;
  g.run_graph(program, g.textures, registers);
}

/// How a path blurs the microfacets that it meets.
struct SurfaceBlur {
  float alpha = 0;        ///< see path_blur
  float most_sharp = -1;  ///< perceptual roughness up to which lobes are left: photons see those as they are
};

template <unsigned kFeatures>
RELIEF_KERNEL SurfaceBlur
surface_blur(const KernelGlobals& g, const PathState& state, std::uint32_t path, const InstanceView& instance)
{
  SurfaceBlur blur{path_blur(g, state, path)};
  if constexpr ((kFeatures & kFeatureCaustics) != 0) {
    blur.most_sharp = (instance.flags & kCausticCaster) != 0 ? kInfinity : g.caustics.roughness;
  }
  return blur;
}

/// The same of glTF's layered material.
RELIEF_KERNEL void surface_params_blur(SurfaceParams& p, SurfaceBlur blur)
{
  const float least = __builtin_sqrtf(blur.alpha);
  for (float* roughness : {&p.roughness, &p.clearcoat_roughness}) {
    if (*roughness > blur.most_sharp) *roughness = max(*roughness, least);
  }
}

/// What closures depend on of the path that meets them.
struct ClosureSight {
  SurfaceBlur blur;
  std::uint32_t without = 0;  ///< see path_does_without
  bool is_first = false;      ///< the surface is the first of a path from the camera
  bool enters = false;        ///< it may go below the surface
  bool is_after_diffuse = false;
  Vec3f tangent{};  ///< unit, along the curve that is met; 0: it is a triangle
  float strand_radius = 0;  ///< as MixtureBuild's
};

/// Photons stay above: they end where there is a diffuse lobe. So does all light on curves.
RELIEF_KERNEL ClosureSight closure_sight(const KernelGlobals& g,
                                         const PathState& state,
                                         std::uint32_t path,
                                         const InstanceView& instance,
                                         SurfaceBlur blur)
{
  ClosureSight sight{blur, path_does_without(g, state.flags[path]), path_surface(state, path) == 0,
                     state.subsurface.entries != nullptr && (state.flags[path] & kPathPhoton) == 0,
                     path_bounces(state.bounces[path], BounceKind::kDiffuse) > 0};
  if (__builtin_expect((instance.flags & kCurves) != 0, 0)) {
    sight.enters = false;
    if (!has_strands(instance)) return sight;
    const PrimitivePlace place = path_place(g, state, path, instance);
    sight.tangent = primitive_strand(place, instance, -path_direction(state, path));
    if (static_cast<PathEvent>(path_event(state.flags[path])) == PathEvent::kCamera &&
        (state.flags[path] & (kPathPhoton | kPathScattered)) == 0) {
      sight.strand_radius = primitive_strand_radius(place, instance);
    }
  }
  return sight;
}

/// Resolves the closures of a located point: its lobes, its frame, and the parameters that stages ask for.
/// @param lane         of the material's program
/// @param columns      of closures_resolve_columns; null: there are none
/// @param lobes        gets the lobes, or has them
template <unsigned kFeatures, typename Lobes>
RELIEF_KERNEL void surface_interaction_mix(const KernelGlobals& g,
                                           Vec3f wo,
                                           const GraphLane& lane,
                                           const LobeColumns* columns,
                                           ClosureSight sight,
                                           SurfaceInteraction& at,
                                           Lobes& lobes)
{
  ShadingSide& side = at.side;
  // Number by number, and without copies of vectors that were just made: GCC clears what is given a list first, and copies by other
  // words than those that were stored. The processor waits for both, six nanoseconds a hit.
  MixtureBuild build;
  build.wo = wo;
  build.Ng = side.Ng;
  build.Ns = side.front ? at.hit.Ns : -at.hit.Ns;
  build.front = side.front;
  build.tables = g.bsdf_tables;
  build.lobes = lobes_begin(lobes);
  const SurfaceBlur blur = sight.blur;
  build.blur = blur.alpha;
  build.most_sharp = blur.most_sharp;
  build.reflects = !events_have(sight.without, false);
  build.refracts = !events_have(sight.without, true);
  build.enters = sight.enters;
  build.is_after_diffuse = sight.is_after_diffuse;
  build.footprint = at.cone.width;
  build.tangent = sight.tangent;
  build.strand_radius = sight.strand_radius;
  if (const std::uint16_t first = lane.program->surface_normal; first != kNoGraphOperand) {
    const Vec3f given{graph_result(lane, first), graph_result(lane, first + 1), graph_result(lane, first + 2)};
    // Since 4.0 what displaces nothing bends freely.
    bool is_free = false;
    for (std::uint32_t i = 0; i < lane.program->num_closures; ++i) {
      is_free = is_free || lane.program->closures[i].maths >= Maths::k43;
    }
    build.Ns = is_free ? closure_normal_as_given(build, given) : closure_normal(build, given);
  }
  side.Ns = shading_normal_towards(build.Ns, wo);
  side.bent = !(dot(side.Ns, side.front ? at.hit.Ns : -at.hit.Ns) > kUnbent);
  side.frame = lobes_side(lobes, side.Ns);
  if (build.lobes != nullptr || lane.program->num_closures > 1) {
    const bool has_all = build.lobes == nullptr || (build.reflects && build.refracts && is_zero(build.tangent));
    closures_resolve(lane, build, has_all ? columns : nullptr);
  }
  if (blur.alpha > 0.0f) lobes_blur(lobes, blur.alpha, blur.most_sharp);

  const Material& m = *at.material;
  SurfaceParams& p = at.params;
  p = {};
  p.emission = build.emission + m.emission * xyz(material_texture_sample<kFeatures>(m.emission_texture, g.textures,
                                                                                    at.hit.uv, at.uv_width));
  at.transmits = build.transmits || lobes_transmit(lobes);
  at.holdout = clamp(build.holdout, 0.0f, 1.0f);
  const LobesSum sum = lobes_sum(lobes);
  const float scattered = at.holdout + sum.probability;
  at.summary.albedo = min(sum.weight, splat3(1.0f));
  at.summary.is_seen_through = sum.sharp > 0.0f && share_is_seen_through(scattered - sum.sharp, scattered) &&
                               max_component(at.summary.albedo) > 0.0f;
  if (sight.is_first) lobes_defend(lobes, mean_component(build.transparency));
  const float passing = max_component(build.transparency);
  if (!(passing > 0.0f)) return;
  // Whichever way a path takes, it takes by its share of the light; what it then carries makes up for the chance.
  const float chance = passing / (passing + scattered);
  p.alpha = 1.0f - chance;
  at.passed = build.transparency / chance;
}

/// What a graph's program gave at a point that a path has hit.
struct GraphHit {
  GraphLane lane;                               ///< of the program, which has run
  const LobeColumns* columns = nullptr;         ///< see surface_interaction_mix
};

/// Completes a located point with its material there.
/// @param wo     unit, back along the path's ray
/// @param graph  of the material's program; null: it is run, if there is one
/// @param lobes  gets those of a material of closures
template <unsigned kFeatures>
RELIEF_KERNEL void surface_interaction_resolve(const KernelGlobals& g,
                                               const PathState& state,
                                               std::uint32_t path,
                                               Vec3f wo,
                                               SurfaceInteraction& at,
                                               MixtureLobes& lobes,
                                               const GraphHit* graph = nullptr)
{
  const SurfaceBlur blur = surface_blur<kFeatures>(g, state, path, *at.instance);
  if constexpr ((kFeatures & kFeatureGraphs) != 0) {
    if (at.material->graph_index >= 0) {
      GraphRegisters registers;
      const GraphLane lane = graph != nullptr
                                 ? graph->lane
                                 : graph_at_point(g.run_graph, g.graphs[at.material->graph_index], g.textures,
                                                  surface_graph_point(g, state, path, at, wo), registers);
      if (has_mixture<kFeatures>(at)) {
        surface_interaction_mix<kFeatures>(g, wo, lane, graph != nullptr ? graph->columns : nullptr,
                                           closure_sight(g, state, path, *at.instance, blur), at, lobes);
      } else {
        at.params = graph_surface_params<kFeatures>(*at.material, graph_values(lane), g.textures, at.hit, at.uv_width);
        at.transmits = at.params.transmission > 0.0f;
        if (blur.alpha > 0.0f) surface_params_blur(at.params, blur);
      }
      return;
    }
  }
  at.params = surface_params_eval<kFeatures>(*at.material, g.textures, at.hit.uv, at.hit.color, at.uv_width);
  at.transmits = at.params.transmission > 0.0f;
  if (blur.alpha > 0.0f) surface_params_blur(at.params, blur);
}

/// Completes an interaction with its shading frame and, where it has one, the coat's.
/// @param wo  as given to surface_interaction_resolve
template <unsigned kFeatures>
RELIEF_KERNEL void surface_interaction_frame(const KernelGlobals& g,
                                             const PathState& state,
                                             std::uint32_t path,
                                             Vec3f wo,
                                             SurfaceInteraction& at)
{
  if (has_mixture<kFeatures>(at)) return;
  const Material& material = *at.material;
  ShadingSide& side = at.side;
  Vec3f Ns = shading_normal_turned(at.hit.Ns, side.Ng);
  // On coarse meshes mirrors and glass would reflect into their own facets, whose places were dark. Diffuse light is not lost so.
  if (at.params.metallic > 0.0f || at.transmits) {
    Ns = normal_with_reflection_above(side.Ng, Ns, wo);
  }
  side.Ns = shading_normal_towards(Ns, wo);
  side.bent = !(__builtin_fabsf(dot(side.Ns, at.hit.Ns)) > kUnbent);
  Frame tangent_frame;
  bool has_tangents = false;
  if constexpr ((kFeatures & kFeatureNormalMaps) != 0) {
    if (material.normal_texture.texture_index >= 0 || material.clearcoat_normal_texture.texture_index >= 0) {
      has_tangents = surface_hit_tangent_frame(path_mesh(g, state, path, *at.instance), *at.instance, at.triangle,
                                               state.hit_u[path], state.hit_v[path], at.hit.Ns, &tangent_frame);
    }
    if (has_tangents && material.normal_texture.texture_index >= 0) {
      const Vec3f N = normalize(from_local(tangent_frame, normal_map_eval(material, g.textures, at.hit.uv)));
      side.Ns = shading_normal_consistent(side.Ng, side.front ? N : -N, wo);
      side.bent = !(dot(side.Ns, side.front ? N : -N) > kUnbent);
    }
  }
  const bool solid = at.transmits && !at.params.thin;
  side.frame = frame_from_normal(solid && !side.front ? -side.Ns : side.Ns);
  if constexpr ((kFeatures & kFeatureLayers) != 0 && (kFeatures & kFeatureNormalMaps) != 0) {
    if (has_tangents && at.params.clearcoat > 0.0f) {
      // The coat lies smoothly over the base's normal map unless it has one of its own (KHR_materials_clearcoat).
      Vec3f N = at.hit.Ns;
      if (material.clearcoat_normal_texture.texture_index >= 0) {
        N = normalize(from_local(tangent_frame, clearcoat_normal_map_eval(material, g.textures, at.hit.uv)));
      }
      at.params.clearcoat_N = to_local(side.frame, shading_normal_consistent(side.Ng, side.front ? N : -N, wo));
    }
  }
}

/// Whether light comes back as a path went. It does not where a direction is above the surface by its shading normal and
/// below by its geometric one, or the other way round: from there it meets the other side. Such events of sharp lobes are the
/// camera paths' alone, and photons end there: on a floor under a coarse mirror 8 % of the light was missing for want of this.
/// @param wi  unit, where the path goes on
RELIEF_KERNEL bool shading_is_reversible(const ShadingSide& side, Vec3f wi)
{
  return !side.bent && (dot(wi, side.Ns) > 0.0f) == (dot(wi, side.Ng) > 0.0f);
}

/// Whether a direction from a path's hit is_across_facets.
RELIEF_KERNEL bool path_crosses_facets(const PathState& state, std::uint32_t path, Vec3f wi)
{
  return state.facets != nullptr && is_across_facets(state.facets[path], wi);
}

/// Unit normal of the level on whose facet a path's hit is, world space, on the path's side.
/// @param Ng  of the hit; the result where it is on no facet
RELIEF_KERNEL Vec3f path_level_normal(const PathState& state, std::uint32_t path, Vec3f Ng)
{
  if (state.facets == nullptr || !(state.facets[path].height > 0.0f)) return Ng;
  return state.facets[path].side * state.facets[path].moments.mean;
}

/// Whether the surface is there for this path, or lets it through.
/// @param surface  of the path, see path_surface
template <unsigned kFeatures>
RELIEF_KERNEL bool surface_is_met(const PathState& state, std::uint32_t path, float alpha, int surface)
{
  if constexpr ((kFeatures & kFeatureTransparency) != 0) {
    if (alpha < 1.0f) {
      return sample_1d(state.pixel_hash[path], state.sample_index[path],
                       dimension_bounce(surface, BounceDimension::kTransparency)) < alpha;
    }
  }
  return true;
}

/// Sends a path on behind a surface that let it through.
/// @param passed  see SurfaceInteraction
/// @return false: it has passed as many as it may
RELIEF_KERNEL bool path_pass_through(const KernelGlobals& g, PathState& state, std::uint32_t path, Vec3f passed)
{
  if (passed != Vec3f{1, 1, 1}) state.throughput[path] = path_throughput(state, path) * passed;
  state.flags[path] += 1u << kPathTransparentShift;
  state.t_min[path] = t_min_behind(state.hit_t[path]);
  // As in Cycles, behind one more than it may pass a path sees what shines.
  const std::uint32_t passed_so_far = state.flags[path] >> kPathTransparentShift;
  const auto most = static_cast<std::uint32_t>(g.limits.transparent);
  if (passed_so_far > most) state.flags[path] |= kPathLast;
  return passed_so_far <= most + 1u;
}

/// Origin of a ray that goes on from the surface: where closures scatter it is the true surface that it leaves.
/// @param wi  unit, its direction
RELIEF_KERNEL Vec3f surface_ray_origin(const SurfaceInteraction& at, Vec3f wi)
{
  if (__builtin_expect((at.instance->flags & kCurves) != 0, 0)) {
    return surface_hit_origin(at.hit, at.hit.P, dot(wi, at.hit.leave) > 0.0f);
  }
  const bool above = dot(wi, at.material->has_closures ? at.side.Ng : at.side.Ns) > 0.0f;
  return surface_hit_origin(at.hit, at.hit.P, above == at.side.front);
}

/// Whether the mesh's normal looks to the other side of its triangle: such are given to leaves, that they be shaded as the crown is.
RELIEF_KERNEL bool surface_normal_looks_through(const SurfaceInteraction& at)
{
  return (dot(at.hit.Ns, at.side.Ng) > 0.0f) != at.side.front;
}

/// Origin of a ray that asks for a light: it leaves the smooth surface, on the side that its normal tells.
/// @param wi  as above
RELIEF_KERNEL Vec3f surface_light_origin(const SurfaceInteraction& at, Vec3f wi)
{
  const bool is_curve = (at.instance->flags & kCurves) != 0;
  if (__builtin_expect(is_curve || surface_normal_looks_through(at), 0)) return surface_ray_origin(at, wi);
  const bool above = dot(wi, at.side.Ns) > 0.0f;
  const float side = above ? 1.0f : -1.0f;
  const Vec3f P = at.hit.P + terminator_lift(at.hit.lift, wi, side * at.side.Ng, side * at.side.Ns);
  return surface_hit_origin(at.hit, P, above == at.side.front);
}

}  // namespace relief
