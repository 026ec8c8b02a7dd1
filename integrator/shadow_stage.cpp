#include "integrator/shadow_stage.h"

#include "integrator/intersect_stage.h"
#include "integrator/media.h"
#include "integrator/path_lod.h"
#include "integrator/ray_surface.h"
#include "kernel/graph/graph_material.h"
#include "kernel/math/rounding.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/shape/material_lookup.h"
#include "kernel/stage/path_access.h"

namespace relief {

namespace {

/// Context of one shadow query: Embree's part first, then what the filter needs and gathers.
struct ShadowContext {
  EmbreeContext embree;
  const KernelGlobals* globals = nullptr;
  const Accel* accel = nullptr;
  const DisplacementSet* displacements = nullptr;
  const SceneMotion* motion = nullptr;
  Vec3f visibility{1, 1, 1};
  Vec3f O, D;                                 ///< of the ray, world: filters see it in the space of the instance
  std::uint32_t depths = 0, transparent = 0;  ///< see GraphRay
  std::vector<ShadowBoundary>* boundaries = nullptr;  ///< gets those that it passes; null where there are no media
};

/// Events before a shadow ray, as GraphRay::depths: it counts as one more, of no kind. Its path may have gone on since.
std::uint32_t shadow_ray_depths(const PathState& state, const ShadowQueue& shadow, std::uint32_t ray)
{
  const std::uint32_t path = shadow.path[ray], depths = state.bounces[path];
  const bool has_gone_on =
      static_cast<std::uint32_t>(path_bounces(depths, BounceKind::kAll)) == shadow.scatterings[ray];
  if (!has_gone_on) return depths + 1u;
  if ((state.flags[path] & kPathScattered) != 0) return depths;
  const auto event = static_cast<PathEvent>(path_event(state.flags[path]));
  const BounceKind kind = event == PathEvent::kDiffuse  ? BounceKind::kDiffuse
                          : event == PathEvent::kGlossy ? BounceKind::kGlossy
                                                        : BounceKind::kTransmission;
  return depths - (1u << static_cast<int>(kind));
}

/// Of random numbers along a shadow ray, of which a path has several.
std::uint32_t shadow_seed(const PathState& state, const ShadowQueue& shadow, std::uint32_t ray)
{
  const std::uint32_t path = shadow.path[ray];
  const Vec3f D = shadow.D[ray];
  std::uint32_t seed = hash_mix_32(state.pixel_hash[path] ^ state.sample_index[path] * 0x9e3779b9u);
  for (const float part : {D.x, D.y, D.z, shadow.t_max[ray]}) {
    seed = hash_mix_32(seed ^ __builtin_bit_cast(std::uint32_t, part));
  }
  return seed;
}

/// What graphs are told of a shadow ray that meets nothing yet.
GraphRay shadow_ray_of(const ShadowContext& context, float time)
{
  return {1u << static_cast<int>(GraphRayKind::kShadow), context.depths, context.transparent, 0.0f, time};
}

/// What a graph may read where a shadow ray meets a surface.
GraphPoint shadow_graph_point(const ShadowContext& context,
                              const PrimitivePlace& place,
                              const InstanceView& instance,
                              const SurfaceHit& hit)
{
  const GraphRay ray{1u << static_cast<int>(GraphRayKind::kShadow), context.depths, context.transparent,
                     length(hit.P - context.O)};
  return {place, &instance, &hit, -context.D, {0.0f, 0.0f}, 0.0f, &context.globals->graph_scene, ray};
}

}  // namespace

void intersect_shadow(const KernelGlobals& g,
                      const Accel& accel,
                      const PathState& state,
                      const ShadowQueue& shadow,
                      ShadowStart start,
                      Vec3f* visibility,
                      DisplacementWork& displacement)
{
  ShadowContext context;
  context.globals = &g;
  context.accel = &accel;
  context.displacements = &accel.displacements();
  context.motion = &accel.motion();
  embree_context_init(context.embree, false);
  context.embree.displacement = &displacement.total;
  context.embree.texels = accel.displacements().texels();
  std::vector<ShadowBoundary> boundaries;
  if (state.media != nullptr) context.boundaries = &boundaries;
  const bool has_levels = accel.displacements().has_levels();
  std::uint32_t steps = 0;
  if (accel.displacements().size() > 0) context.embree.steps = &steps;
  for (std::uint32_t i = 0; i < shadow.size; ++i) {
    context.visibility = {1, 1, 1};
    context.D = shadow.D[i];
    if (state.facets != nullptr) {
      const FacetState& f = state.facets[shadow.path[i]];
      if (is_over_facets(f, context.D)) {
        const float chance = facets_leave_chance(f.height, facet_lambda(f.moments, f.side * context.D));
        if (!(chance > 0.0f)) {
          visibility[i] = {};
          continue;
        }
        context.visibility = splat3(chance);
      }
    }
    context.O = shadow.O[i];
    context.depths = shadow_ray_depths(state, shadow, i);
    context.transparent = state.flags[shadow.path[i]] >> kPathTransparentShift;
    RTCRay ray;
    ray.org_x = context.O.x;
    ray.org_y = context.O.y;
    ray.org_z = context.O.z;
    ray.dir_x = context.D.x;
    ray.dir_y = context.D.y;
    ray.dir_z = context.D.z;
    ray.tnear = kLeastDistance;
    ray.tfar = shadow.t_max[i];
    ray.time = path_time(state, shadow.path[i]);
    ray.mask = kRayShadow;
    ray.id = 0;
    ray.flags = 0;
    LodCone cone;
    if (has_levels) {
      cone = PathLod(state, shadow.path[i]).cone(shadow.cone_width[i], shadow.cone_spread[i]);
      context.embree.cones = &cone;
    }
    if (accel.has_curves() && start == ShadowStart::kAtHit) ray.flags = curve_left(g, state, shadow.path[i]);
    accel.occluded(context.embree, ray);
    if (context.embree.steps != nullptr) note_steps(steps, displacement);
    visibility[i] = ray.tfar < 0.0f ? Vec3f{} : context.visibility;
    if (state.media != nullptr) {
      const MediumState& around = state.media[shadow.path[i]];
      const bool may_be_within = around.size > 0 || around.hit_inside != kWholeWorld || !boundaries.empty();
      if (may_be_within && !is_zero(visibility[i]) && shadow.scatterings[i] != kAmbientRay) {
        MediumState inside = around;
        if (start == ShadowStart::kAtHit && inside.hit_inside != kWholeWorld && medium_is_behind(inside, context.O)) {
          medium_cross(inside, inside.hit_inside, inside.hit_front);
        }
        const ShadowWay way{context.O, context.D, shadow.t_max[i], shadow_seed(state, shadow, i),
                            shadow_ray_of(context, path_time(state, shadow.path[i]))};
        visibility[i] *= shadow_transmittance(g, inside, boundaries, way);
      }
      boundaries.clear();
    }
  }
}

void shadow_filter(const RTCFilterFunctionNArguments* arguments)
{
  auto* context = reinterpret_cast<ShadowContext*>(arguments->context);
  const KernelGlobals& g = *context->globals;
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    const unsigned instance_id = RTCHitN_instID(arguments->hit, arguments->N, i, 0);
    const unsigned object =
        instance_id != RTC_INVALID_GEOMETRY_ID ? instance_id : RTCHitN_geomID(arguments->hit, arguments->N, i);
    const float time = RTCRayN_time(arguments->ray, arguments->N, i);
    const InstanceView& centre = g.instances[object];
    if ((centre.flags & kCurves) != 0) {
      const TriangleIndices* triangles = g.meshes[centre.mesh_index].triangles;
      const auto name_of = [&](unsigned instance, unsigned segment) {
        return curve_name(instance, segment, centre.flags, triangles);
      };
      if (!curve_is_met(arguments, i, name_of, (centre.flags & kRibbons) == 0)) {
        arguments->valid[i] = 0;
        continue;
      }
    }
    const bool moves = (centre.flags & (kMoves | kDeforms)) != 0;
    const InstanceView instance = moves ? context->motion->instance_at(centre, time) : centre;
    DisplacedPoint at{RTCHitN_primID(arguments->hit, arguments->N, i), RTCHitN_u(arguments->hit, arguments->N, i),
                      RTCHitN_v(arguments->hit, arguments->N, i)};
    if ((instance.flags & kDisplaced) != 0) {
      at = context->displacements->locate(object, at.triangle,
                                          {at.u, at.v, RTCHitN_Ng_x(arguments->hit, arguments->N, i), time});
    } else {
      context->accel->to_triangle(object, &at.triangle, &at.u, &at.v);
    }
    const Material& material = g.materials[instance.material_index];
    const MeshView mesh = context->motion->mesh_at(instance, g.meshes[instance.mesh_index], time);
    // A far ray starts elsewhere.
    const auto t = static_cast<float>(static_cast<double>(RTCRayN_tfar(arguments->ray, arguments->N, i)) +
                                      context->embree.far_start.t);
    const PrimitivePlace place{&mesh, at.triangle, at.u, at.v};
    const auto hit_make = [&] { return surface_hit_at(place, instance, context->O, context->D, t); };
    if (material.medium_index >= 0) {
      const SurfaceHit hit = hit_make();
      context->boundaries->push_back(
          {t, static_cast<std::int32_t>(object), at.triangle, dot(context->D, hit.Ng) < 0.0f});
    }
    Vec3f passes;
    if (material.transparency_index >= 0) {
      const SurfaceHit hit = hit_make();
      passes = graph_transparency(g.run_graph, g.graphs[material.transparency_index], g.textures,
                                  shadow_graph_point(*context, place, instance, hit));
    } else if ((material.graph_outputs >> static_cast<int>(GraphOutput::alpha) & 1u) != 0) {
      const SurfaceHit hit = hit_make();
      passes = splat3(1.0f - graph_alpha(material, g.run_graph, g.graphs[material.graph_index], g.textures,
                                         shadow_graph_point(*context, place, instance, hit)));
    } else {
      passes = splat3(1.0f - triangle_alpha(material, g.textures, mesh, at.triangle, at.u, at.v));
    }
    context->visibility *= passes;
    if (!is_zero(context->visibility)) arguments->valid[i] = 0;
  }
}

}  // namespace relief
