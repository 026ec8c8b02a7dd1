#include "integrator/shadow_stage.h"

#include "integrator/intersect_stage.h"
#include "integrator/media.h"
#include "integrator/path_lod.h"
#include "integrator/ray_surface.h"
#include "integrator/shadow_passages.h"
#include "kernel/math/rounding.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/shape/material_lookup.h"
#include "kernel/stage/path_access.h"

namespace relief {

namespace {

/// Surfaces of a ray that wait for their graphs. (Leaves of half a tree: with 1, 2, 4 and 8 of them 12.0, 10.6, 9.6 and 9.2 seconds.)
constexpr std::size_t kMostWaiting = 8;

/// Context of one shadow query: Embree's part first, then what the filter needs and gathers.
struct ShadowContext {
  EmbreeContext embree;
  const KernelGlobals* globals = nullptr;
  const Accel* accel = nullptr;
  const DisplacementSet* displacements = nullptr;
  const SceneMotion* motion = nullptr;
  const PathState* state = nullptr;
  const ShadowQueue* shadow = nullptr;
  std::uint32_t ray = 0;                           ///< of the queue
  Vec3f* visibility = nullptr;                     ///< by ray: of what has been asked so far
  std::vector<ShadowPassage>* passages = nullptr;  ///< gets those of graphs
  std::size_t first_passage = 0;                   ///< of the ray
  std::uint32_t num_open = 0;                      ///< surfaces of triangles that the ray may still pass, as in Cycles
  std::vector<ShadowBoundary>* boundaries = nullptr;  ///< gets those that it passes; null where there are no media
};

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
  context.state = &state;
  context.shadow = &shadow;
  context.visibility = visibility;
  std::vector<ShadowPassage> passages;
  context.passages = &passages;
  std::vector<ShadowBoundary> boundaries;
  if (state.media != nullptr) context.boundaries = &boundaries;
  const bool has_levels = accel.displacements().has_levels();
  std::uint32_t steps = 0;
  if (accel.displacements().size() > 0) context.embree.steps = &steps;
  for (std::uint32_t i = 0; i < shadow.size; ++i) {
    const Vec3f O = shadow.O[i], D = shadow.D[i];
    context.ray = i;
    context.first_passage = passages.size();
    const std::uint32_t passed = shadow_ray_passed(shadow, i);
    const auto most = static_cast<std::uint32_t>(g.limits.transparent);
    context.num_open = passed < most ? most - passed : 0u;
    visibility[i] = {1, 1, 1};
    if (state.facets != nullptr) {
      const FacetState& f = state.facets[shadow.path[i]];
      if (is_over_facets(f, D)) {
        const float chance = facets_leave_chance(f.height, facet_lambda(f.moments, f.side * D));
        if (!(chance > 0.0f)) {
          visibility[i] = {};
          continue;
        }
        visibility[i] = splat3(chance);
      }
    }
    RTCRay ray;
    ray.org_x = O.x;
    ray.org_y = O.y;
    ray.org_z = O.z;
    ray.dir_x = D.x;
    ray.dir_y = D.y;
    ray.dir_z = D.z;
    ray.tnear = kLeastDistance;
    ray.tfar = shadow.t_max[i];
    ray.time = path_time(state, shadow.path[i]);
    ray.mask = g.catchers_alone ? kRayShadow << kRayCatchersShift : std::uint32_t{kRayShadow};
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
    if (ray.tfar < 0.0f) {
      visibility[i] = {};
      passages.resize(context.first_passage);
    }
    if (state.media != nullptr) {
      const MediumState& around = state.media[shadow.path[i]];
      const bool may_be_within = around.size > 0 || around.hit_inside != kWholeWorld || !boundaries.empty();
      if (may_be_within && !is_zero(visibility[i]) && shadow.scatterings[i] != kAmbientRay) {
        MediumState inside = around;
        if (start == ShadowStart::kAtHit && inside.hit_inside != kWholeWorld && medium_is_behind(inside, O)) {
          medium_cross(inside, inside.hit_inside, inside.hit_front);
        }
        GraphRay told = shadow_graph_ray(state, shadow, i);
        told.time = path_time(state, shadow.path[i]);
        const ShadowWay way{O, D, shadow.t_max[i], shadow_seed(state, shadow, i), told};
        visibility[i] *= shadow_transmittance(g, inside, boundaries, way);
      }
      boundaries.clear();
    }
  }
  shadow_passages_apply(g, accel.motion(), state, shadow, passages, visibility);
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
    if ((centre.flags & kCurves) == 0) {
      if (context->num_open == 0) continue;
      --context->num_open;
    }
    DisplacedPoint at{RTCHitN_primID(arguments->hit, arguments->N, i), RTCHitN_u(arguments->hit, arguments->N, i),
                      RTCHitN_v(arguments->hit, arguments->N, i)};
    if ((centre.flags & kDisplaced) != 0) {
      at = context->displacements->locate(object, at.triangle,
                                          {at.u, at.v, RTCHitN_Ng_x(arguments->hit, arguments->N, i), time});
    } else {
      context->accel->to_triangle(object, &at.triangle, &at.u, &at.v);
    }
    // A far ray starts elsewhere.
    const auto t = static_cast<float>(static_cast<double>(RTCRayN_tfar(arguments->ray, arguments->N, i)) +
                                      context->embree.far_start.t);
    const std::uint32_t ray = context->ray;
    const Material& material = g.materials[centre.material_index];
    if (material.medium_index >= 0) {
      const Vec3f D = context->shadow->D[ray];
      const InstanceView instance = context->motion->instance_at(centre, time);
      const MeshView mesh = context->motion->mesh_at(centre, g.meshes[centre.mesh_index], time);
      const SurfaceHit hit = surface_hit_at({&mesh, at.triangle, at.u, at.v}, instance, context->shadow->O[ray], D, t);
      context->boundaries->push_back({t, static_cast<std::int32_t>(object), at.triangle, dot(D, hit.Ng) < 0.0f});
    }
    Vec3f& visibility = context->visibility[ray];
    const bool has_graph =
        material.transparency_index >= 0 || (material.graph_outputs >> static_cast<int>(GraphOutput::alpha) & 1u) != 0;
    if (has_graph) {
      std::vector<ShadowPassage>& passages = *context->passages;
      passages.push_back({ray, object, at.triangle, at.u, at.v, t});
      if (passages.size() - context->first_passage >= kMostWaiting) {
        shadow_passages_apply(g, *context->motion, *context->state, *context->shadow,
                              std::span(passages).subspan(context->first_passage), context->visibility);
        passages.resize(context->first_passage);
      }
    } else {
      visibility *=
          splat3(1.0f - triangle_alpha(material, g.textures, g.meshes[centre.mesh_index], at.triangle, at.u, at.v));
    }
    if (!is_zero(visibility)) arguments->valid[i] = 0;
  }
}

}  // namespace relief
