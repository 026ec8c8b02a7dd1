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

/// Notes the steps of one ray and clears them for the next.
void note_steps(std::uint32_t& steps, DisplacementWork& work)
{
  if (steps > work.most_steps) work.most_steps = steps;
  steps = 0;
}

Vec3f normal_to_object(const InstanceView& instance, Vec3f n)
{
  return normalize(transform_normal(instance.world_from_object, as_normal(n)));
}

/// Lets a path meet one of the facets around its hit, as seen from where it comes.
/// @return  false if no facet is seen from there
bool meet_facet(PathState& state,
                std::uint32_t path,
                const InstanceView& instance,
                const LevelFacets& facets,
                float choice)
{
  FacetState& f = state.facets[path];
  if (!facet_choose(facets, -f.side * path_direction(state, path), choice, &f.normal)) return false;
  state.hit_Ng[path] = state.hit_Ns[path] = normal_to_object(instance, f.normal);
  return true;
}

Vec2f facet_sample(const PathState& state, std::uint32_t path, FacetDimension use)
{
  return sample_2d(state.pixel_hash[path], state.sample_index[path], dimension_facet(path_surface(state, path), use));
}

/// Facets around the place that a path has hit.
/// @param Ng  of the level, object space
bool facets_at_hit(const Accel& accel,
                   const PathState& state,
                   std::uint32_t path,
                   const InstanceView& instance,
                   Vec3f Ng,
                   LevelFacets* facets)
{
  return accel.displacements().facets(state.hit_object[path],
                                      {instance, state.hit_triangle[path], state.hit_u[path], state.hit_v[path],
                                       state.facets[path].level, state.hit_P[path], Ng, path_time(state, path)},
                                      facet_sample(state, path, FacetDimension::kJitter), facets);
}

/// A hit on a level of a height map becomes one on a facet.
void enter_facets(const Accel& accel, PathState& state, std::uint32_t path, const InstanceView& instance, float level)
{
  FacetState& f = state.facets[path];
  f.height = 0.0f;
  if (!(level > 0.0f)) return;
  f.level = level;
  LevelFacets facets;
  if (!facets_at_hit(accel, state, path, instance, state.hit_Ng[path], &facets)) return;
  f.moments = facet_moments(facets);
  const Vec3f wo = -path_direction(state, path);
  f.side = dot(wo, facets.normal) < 0.0f ? -1.0f : 1.0f;
  const Vec2f choice = facet_sample(state, path, FacetDimension::kChoice);
  if (!meet_facet(state, path, instance, facets, choice.x)) return;
  f.height = facet_height(facet_lambda(f.moments, f.side * wo), choice.y);
}

/// Whether a path's ray meets another facet right where it is; then that is its hit.
bool stays_among_facets(const KernelGlobals& g, const Accel& accel, PathState& state, std::uint32_t path)
{
  FacetState& f = state.facets[path];
  const Vec3f wi = path_direction(state, path);
  // A ray that has passed through a surface goes on from there.
  if (state.t_min[path] != kLeastDistance || !is_over_facets(f, wi)) return false;
  const float lambda = facet_lambda(f.moments, f.side * wi);
  const float u = sample_1d(state.pixel_hash[path], state.sample_index[path],
                            dimension_facet(path_surface(state, path), FacetDimension::kLeave));
  if (u < facets_leave_chance(f.height, lambda)) return false;
  const InstanceView& instance = path_instance(g, state, path);
  LevelFacets facets;
  const Vec2f choice = facet_sample(state, path, FacetDimension::kChoice);
  if (!facets_at_hit(accel, state, path, instance, normal_to_object(instance, f.moments.mean), &facets) ||
      !meet_facet(state, path, instance, facets, choice.x)) {
    return false;
  }
  f.height = facet_next_height(f.height, lambda, u);
  state.hit_t[path] = 0.0f;
  // No photon is kept that came from a facet beside.
  std::uint32_t& flags = state.flags[path];
  if ((flags & (kPathPhoton | kPathAfterSoft)) == kPathAfterSoft) flags = path_flags_left_to_paths(flags);
  return true;
}

/// Puts a path into the queue of the stage that its hit asks for; displaced hits get their position and normal.
void classify(const KernelGlobals& g,
              const Accel& accel,
              PathState& state,
              std::uint32_t path,
              unsigned object,
              float Ng_x,
              const std::uint8_t* surface_kernel,
              QueueView* surfaces,
              QueueView& lights,
              QueueView& background)
{
  if (object == RTC_INVALID_GEOMETRY_ID) {
    queue_push(background, path);
    return;
  }
  state.hit_object[path] = object;
  if (state.facets != nullptr) state.facets[path].height = 0.0f;
  if (object >= g.num_instances) {
    queue_push(lights, path);
    return;
  }
  path_resolve_hit(g, accel, state, path, Ng_x);
  queue_push(surfaces[surface_kernel[g.instances[object].material_index]], path);
}

/// RTCRay::flags of a ray that leaves a path's last hit.
unsigned curve_left(const KernelGlobals& g, const PathState& state, std::uint32_t path)
{
  const std::uint32_t object = state.hit_object[path];
  if (object >= g.num_instances || (g.instances[object].flags & kCurves) == 0) return 0;
  const MeshView& mesh = g.meshes[g.instances[object].mesh_index];
  const std::uint32_t segment = state.hit_triangle[path];
  RELIEF_ASSERT(segment < mesh.num_triangles);
  return curve_name(object, segment, mesh.triangles[segment].v0);
}

std::uint32_t mask_of(const PathState& state, std::uint32_t path)
{
  return state.bounces[path] == 0 ? kRayCamera : kRayBounce;
}

void intersect_packet(const KernelGlobals& g,
                      const Accel& accel,
                      PathState& state,
                      const std::uint32_t* paths,
                      EmbreeContext& context,
                      const std::uint8_t* surface_kernel,
                      QueueView* surfaces,
                      QueueView& lights,
                      QueueView& background,
                      DisplacementWork& displacement)
{
  RTCRayHit8 packet;
  for (int i = 0; i < 8; ++i) {
    const std::uint32_t path = paths[i];
    packet.ray.org_x[i] = state.O.x[path];
    packet.ray.org_y[i] = state.O.y[path];
    packet.ray.org_z[i] = state.O.z[path];
    packet.ray.dir_x[i] = state.D.x[path];
    packet.ray.dir_y[i] = state.D.y[path];
    packet.ray.dir_z[i] = state.D.z[path];
    packet.ray.tnear[i] = state.t_min[path];
    packet.ray.tfar[i] = state.t_max[path];
    packet.ray.time[i] = path_time(state, path);
    packet.ray.mask[i] = kRayCamera;
    packet.ray.id[i] = static_cast<unsigned>(i);
    packet.ray.flags[i] = 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  LodCone cones[8];
  if (accel.displacements().has_levels()) {
    for (int i = 0; i < 8; ++i)
      cones[i] = PathLod(state, paths[i]).cone(state.cone_width[paths[i]], state.cone_spread[paths[i]]);
    context.cones = cones;
  }
  accel.intersect8(context, packet);
  for (int i = 0; i < 8; ++i) {
    const std::uint32_t path = paths[i];
    state.hit_t[path] = packet.ray.tfar[i];
    state.hit_u[path] = packet.hit.u[i];
    state.hit_v[path] = packet.hit.v[i];
    state.hit_triangle[path] = packet.hit.primID[i];
    const unsigned instance = packet.hit.instID[0][i];
    const unsigned object = instance != RTC_INVALID_GEOMETRY_ID ? instance : packet.hit.geomID[i];
    if (context.steps != nullptr) {
      film_add_displacement_steps(g.film, state.pixel[path], context.steps[i]);
      note_steps(context.steps[i], displacement);
    }
    classify(g, accel, state, path, object, packet.hit.Ng_x[i], surface_kernel, surfaces, lights, background);
  }
}

/// Context of one shadow query: Embree's part first, then what the filter needs and gathers.
struct ShadowContext {
  EmbreeContext embree;
  const KernelGlobals* globals = nullptr;
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
                              const MeshView& mesh,
                              const InstanceView& instance,
                              const DisplacedPoint& at,
                              const SurfaceHit& hit)
{
  const GraphRay ray{1u << static_cast<int>(GraphRayKind::kShadow), context.depths, context.transparent,
                     length(hit.P - context.O)};
  return {&mesh, &instance,  at.triangle,  at.u, at.v,
          &hit,  -context.D, {0.0f, 0.0f}, 0.0f, &context.globals->graph_scene,
          ray};
}

}  // namespace

void path_resolve_hit(const KernelGlobals& g, const Accel& accel, PathState& state, std::uint32_t path, float Ng_x)
{
  const std::uint32_t object = state.hit_object[path];
  const InstanceView& centre = g.instances[object];
  if ((centre.flags & (kMoves | kDeforms)) != 0) {
    const float time = path_time(state, path);
    state.motion.instances[path] = accel.motion().instance_at(centre, time);
    if ((centre.flags & kDeforms) != 0) {
      state.motion.meshes[path] = accel.motion().mesh_at(centre, g.meshes[centre.mesh_index], time);
    }
  }
  const InstanceView& instance = path_instance(g, state, path);
  if ((instance.flags & kDisplaced) != 0) {
    const DisplacedPoint point =
        accel.displacements().resolve(object, instance, state.hit_triangle[path],
                                      {state.hit_u[path], state.hit_v[path], Ng_x, path_time(state, path)});
    state.hit_triangle[path] = point.triangle;
    state.hit_u[path] = point.u;
    state.hit_v[path] = point.v;
    state.hit_P[path] = point.P;
    state.hit_Ng[path] = point.Ng;
    state.hit_Ns[path] = point.Ns;
    state.hit_leave[path] = point.leave;
    state.hit_width[path] = point.width < kInfinity ? point.width / PathLod(state, path).factor : kInfinity;
    if (state.facets != nullptr) enter_facets(accel, state, path, instance, point.level);
  }
}

void intersect_closest(const KernelGlobals& g,
                       const Accel& accel,
                       PathState& state,
                       const QueueView& queue,
                       bool coherent,
                       const std::uint8_t* surface_kernel,
                       QueueView* surfaces,
                       QueueView& lights,
                       QueueView& background,
                       DisplacementWork& displacement)
{
  EmbreeContext context;
  embree_context_init(context, coherent);
  context.displacement = &displacement.total;
  const bool has_levels = accel.displacements().has_levels();
  std::uint32_t steps[8] = {};
  context.texels = accel.displacements().texels();
  if (accel.displacements().size() > 0) context.steps = steps;
  std::uint32_t i = 0;
  if (coherent) {
    for (; i + 8 <= queue.size; i += 8) {
      intersect_packet(g, accel, state, queue.paths + i, context, surface_kernel, surfaces, lights, background,
                       displacement);
    }
  }
  for (; i < queue.size; ++i) {
    const std::uint32_t path = queue.paths[i];
    if (state.facets != nullptr && !coherent && stays_among_facets(g, accel, state, path)) {
      queue_push(surfaces[surface_kernel[path_instance(g, state, path).material_index]], path);
      continue;
    }
    RTCRayHit ray;
    ray.ray.org_x = state.O.x[path];
    ray.ray.org_y = state.O.y[path];
    ray.ray.org_z = state.O.z[path];
    ray.ray.dir_x = state.D.x[path];
    ray.ray.dir_y = state.D.y[path];
    ray.ray.dir_z = state.D.z[path];
    ray.ray.tnear = state.t_min[path];
    ray.ray.tfar = state.t_max[path];
    ray.ray.time = path_time(state, path);
    ray.ray.mask = mask_of(state, path);
    ray.ray.id = 0;
    ray.ray.flags = 0;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    LodCone cone;
    if (has_levels) {
      cone = PathLod(state, path).cone(state.cone_width[path], state.cone_spread[path]);
      context.cones = &cone;
    }
    if (accel.has_curves() && state.bounces[path] != 0 && (state.flags[path] & kPathScattered) == 0) {
      ray.ray.flags = curve_left(g, state, path);
    }
    accel.intersect(context, ray);
    if (context.steps != nullptr) {
      if (state.bounces[path] == 0) film_add_displacement_steps(g.film, state.pixel[path], steps[0]);
      note_steps(steps[0], displacement);
    }
    state.hit_t[path] = ray.ray.tfar;
    state.hit_u[path] = ray.hit.u;
    state.hit_v[path] = ray.hit.v;
    state.hit_triangle[path] = ray.hit.primID;
    const unsigned object = ray.hit.instID[0] != RTC_INVALID_GEOMETRY_ID ? ray.hit.instID[0] : ray.hit.geomID;
    classify(g, accel, state, path, object, ray.hit.Ng_x, surface_kernel, surfaces, lights, background);
  }
}

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
      if (!is_zero(visibility[i]) && shadow.scatterings[i] != kAmbientRay) {
        MediumState inside = state.media[shadow.path[i]];
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
      const unsigned segment = RTCHitN_primID(arguments->hit, arguments->N, i);
      const std::uint32_t first = g.meshes[centre.mesh_index].triangles[segment].v0;
      if (!curve_is_met(arguments, i, first, (centre.flags & kRibbons) == 0)) {
        arguments->valid[i] = 0;
        continue;
      }
    }
    const bool moves = (centre.flags & (kMoves | kDeforms)) != 0;
    const InstanceView instance = moves ? context->motion->instance_at(centre, time) : centre;
    DisplacedPoint at{RTCHitN_primID(arguments->hit, arguments->N, i), RTCHitN_u(arguments->hit, arguments->N, i),
                      RTCHitN_v(arguments->hit, arguments->N, i)};
    if ((instance.flags & kDisplaced) != 0) at = context->displacements->locate(object, at.triangle, at.u, at.v);
    const Material& material = g.materials[instance.material_index];
    const MeshView mesh = context->motion->mesh_at(instance, g.meshes[instance.mesh_index], time);
    // A far ray starts elsewhere.
    const auto t = static_cast<float>(static_cast<double>(RTCRayN_tfar(arguments->ray, arguments->N, i)) +
                                      context->embree.far_start.t);
    const auto hit_make = [&] {
      return surface_hit_at(mesh, instance, at.triangle, at.u, at.v, context->O, context->D, t);
    };
    if (material.medium_index >= 0) {
      const SurfaceHit hit = hit_make();
      context->boundaries->push_back(
          {t, static_cast<std::int32_t>(object), at.triangle, dot(context->D, hit.Ng) < 0.0f});
    }
    Vec3f passes;
    if (material.transparency_index >= 0) {
      const SurfaceHit hit = hit_make();
      passes = graph_transparency(g.run_graph, g.graphs[material.transparency_index], g.textures,
                                  shadow_graph_point(*context, mesh, instance, at, hit));
    } else if ((material.graph_outputs >> static_cast<int>(GraphOutput::alpha) & 1u) != 0) {
      const SurfaceHit hit = hit_make();
      passes = splat3(1.0f - graph_alpha(material, g.run_graph, g.graphs[material.graph_index], g.textures,
                                         shadow_graph_point(*context, mesh, instance, at, hit)));
    } else {
      passes = splat3(1.0f - triangle_alpha(material, g.textures, mesh, at.triangle, at.u, at.v));
    }
    context->visibility *= passes;
    if (!is_zero(context->visibility)) arguments->valid[i] = 0;
  }
}

}  // namespace relief
