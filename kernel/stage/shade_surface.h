// Stage: a path met a surface. Emission, next-event estimation, continuation: the heart of the path tracer.
#pragma once

#include "kernel/bsdf/layered.h"
#include "kernel/bsdf/surface_params.h"
#include "kernel/counters.h"
#include "kernel/feature_mask.h"
#include "kernel/globals.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/shape/material_lookup.h"
#include "kernel/shape/surface_hit.h"
#include "kernel/stage/path_access.h"
#include "kernel/texture/ray_cone.h"

namespace relief {

/// The side of a surface that a path is on, and the frame its BSDF is evaluated in.
struct ShadingSide {
  Vec3f Ng;     ///< geometric normal on the side of wo
  Frame frame;  ///< local +z: for a solid dielectric the outward normal, otherwise the shading normal on wo's side
  Vec3f Ns;     ///< shading normal on wo's side
  bool front;   ///< wo is on the front side of the triangle
};

/// Turns the shading normal to wo's side and bends it until wo is above its horizon.
/// Interpolated normals can face away from a viewer who sees the facet; leaving them so makes dark rims.
RELIEF_KERNEL Vec3f shading_normal_towards(Vec3f Ns, Vec3f Ng_side, Vec3f wo)
{
  if (dot(Ns, Ng_side) < 0.0f) Ns = -Ns;
  const float cos_o = dot(Ns, wo);
  // The least cosine keeps the local frame's arithmetic away from zero; 1e-3 is 0.06° and cannot be seen.
  constexpr float kLeastCosine = 1e-3f;
  if (cos_o >= kLeastCosine) return Ns;
  return normalize(Ns + (kLeastCosine - cos_o) * wo);
}

/// Queues a shadow ray towards a light sample taken at the hit.
template <unsigned kFeatures>
RELIEF_KERNEL void shade_surface_light(const KernelGlobals& g,
                                       const PathStateView& state,
                                       std::uint32_t path,
                                       const SurfaceHit& hit,
                                       const SurfaceClosure& closure,
                                       const ShadingSide& side,
                                       Vec3f light_N,
                                       RayCone cone,
                                       ShadowQueueView& shadow)
{
  const int bounce = path_bounces(state.bounces[path], BounceKind::kAll);
  const int surface = path_surface(state, path);
  const std::uint32_t hash = state.pixel_hash[path];
  const std::uint32_t sample = state.sample_index[path];
  const LightSample light = lights_sample(
      g.lights, hit.P, light_N, sample_1d(hash, sample, dimension_bounce(surface, BounceDimension::kLightChoice)),
      sample_2d(hash, sample, dimension_bounce(surface, BounceDimension::kLightUv)));
  if (!(light.pdf > 0.0f)) return;
  Vec3f radiance = light.radiance;
  const bool is_triangle = light.light_index >= 0 && g.lights.lights[light.light_index].kind == LightKind::kTriangle;
  if (is_triangle) {
    // Any kernel may sample a textured emitter, so this is not a feature of the surface that is lit.
    const Light& emitter = g.lights.lights[light.light_index];
    const InstanceView& emitting = g.instances[emitter.instance_index];
    const Material& material = g.materials[emitting.material_index];
    if (material.emission_texture.texture_index >= 0) {
      radiance = triangle_emission(material, g.textures, g.meshes[emitting.mesh_index],
                                   static_cast<std::uint32_t>(emitter.triangle_index), light.barycentric);
    }
  }
  if (is_zero(radiance)) return;
  const BsdfEval bsdf = closure_eval<kFeatures>(closure, *g.bsdf_tables, to_local(side.frame, light.wi));
  if (is_zero(bsdf.f)) return;
  const float cos_i = __builtin_fabsf(dot(light.wi, side.frame.n));
  const float weight = path_light_weight(g.light_technique, light.pdf, bsdf.pdf, light.delta);
  const Vec3f gain = path_throughput(state, path) * bsdf.f * radiance * (cos_i * weight / light.pdf);
  if (is_zero(gain)) return;

  // Above the surface the ray starts on the lifted side, below it on the other.
  const bool above = dot(light.wi, side.Ns) > 0.0f;
  const Vec3f Ng_leave = above ? side.Ng : -side.Ng;
  Vec3f P = hit.P;
  if (above && side.front) P += hit.P_lift * terminator_lift_weight(dot(light.wi, side.Ng));
  const Vec3f O = offset_ray_origin(P, hit.P_error, Ng_leave);
  Vec3f D = light.wi;
  float t_max = light.distance;
  if (t_max < kInfinity) {
    Vec3f target = hit.P + light.wi * light.distance;
    if (is_triangle) {
      // Stop short of the emitter itself by the error bound of a point on it.
      const Light& emitter = g.lights.lights[light.light_index];
      const Vec3f error = gamma_bound(8) * (abs(emitter.P) + abs(emitter.edge_u) + abs(emitter.edge_v) + abs(hit.P));
      target = offset_ray_origin(target, error, dot(emitter.axis, light.wi) < 0.0f ? emitter.axis : -emitter.axis);
    }
    const Vec3f to_target = target - O;
    t_max = length(to_target);
    D = to_target / t_max;
  }
  const std::uint32_t ray = shadow.size++;
  shadow.O_x[ray] = O.x;
  shadow.O_y[ray] = O.y;
  shadow.O_z[ray] = O.z;
  shadow.D_x[ray] = D.x;
  shadow.D_y[ray] = D.y;
  shadow.D_z[ray] = D.z;
  shadow.t_max[ray] = t_max;
  shadow.cone_width[ray] = cone.width;
  shadow.cone_spread[ray] = cone.spread;
  shadow.gain_r[ray] = gain.x;
  shadow.gain_g[ray] = gain.y;
  shadow.gain_b[ray] = gain.z;
  shadow.path[ray] = path;
  shadow.scatterings[ray] = static_cast<std::uint32_t>(bounce + 1);
}

/// Shades one path. Reads and writes every column but the hit's.
/// Next: intersect closest (pushed on `next`), or the path ends. At most one ray is added to `shadow`.
template <unsigned kFeatures>
[[gnu::flatten]] RELIEF_KERNEL void shade_surface(const KernelGlobals& g,
                                                  const PathStateView& state,
                                                  std::uint32_t path,
                                                  QueueView& next,
                                                  ShadowQueueView& shadow,
                                                  Counters& counters)
{
  ++counters.surface_hits;
  const InstanceView& instance = g.instances[state.hit_object[path]];
  const MeshView& mesh = g.meshes[instance.mesh_index];
  const Material& material = g.materials[instance.material_index];
  const std::uint32_t triangle = state.hit_triangle[path];
  const float t = state.hit_t[path];
  const Vec3f wo = -path_direction(state, path);
  const std::uint32_t hash = state.pixel_hash[path];
  const std::uint32_t sample = state.sample_index[path];
  const std::uint32_t bounces = state.bounces[path];
  const int bounce = path_bounces(bounces, BounceKind::kAll);
  const int surface = path_surface(state, path);

  SurfaceHit hit = surface_hit_make(mesh, instance, triangle, state.hit_u[path], state.hit_v[path]);
  if ((instance.flags & kDisplaced) != 0) {
    surface_hit_displace(&hit, instance, {state.hit_P_x[path], state.hit_P_y[path], state.hit_P_z[path]},
                         {state.hit_Ng_x[path], state.hit_Ng_y[path], state.hit_Ng_z[path]},
                         {state.hit_Ns_x[path], state.hit_Ns_y[path], state.hit_Ns_z[path]});
  }

  ShadingSide side;
  side.front = dot(wo, hit.Ng) >= 0.0f;
  side.Ng = side.front ? hit.Ng : -hit.Ng;

  RayCone cone = ray_cone_propagate({state.cone_width[path], state.cone_spread[path]}, t);
  float uv_width[2] = {0, 0};
  if constexpr ((kFeatures & kFeatureTextures) != 0) {
    const float footprint = ray_cone_footprint_world(cone, dot(wo, side.Ng));
    uv_width[0] = footprint * hit.area_ratio[0];
    uv_width[1] = footprint * hit.area_ratio[1];
  }
  SurfaceParams params = surface_params_eval<kFeatures>(material, g.textures, hit.uv, hit.color, uv_width);

  if constexpr ((kFeatures & kFeatureTransparency) != 0) {
    if (params.alpha < 1.0f) {
      const float u = sample_1d(hash, sample, dimension_bounce(surface, BounceDimension::kTransparency));
      if (u >= params.alpha) {
        ++counters.transparent_hits;
        state.flags[path] += 1u << kPathTransparentShift;
        if ((state.flags[path] >> kPathTransparentShift) > static_cast<std::uint32_t>(g.limits.transparent)) return;
        state.t_min[path] = next_float_up(t);
        queue_push(next, path);
        return;
      }
    }
  }

  const Vec3f sigma_a = path_sigma_a(state, path);
  Vec3f throughput = path_throughput(state, path);
  if constexpr ((kFeatures & kFeatureTransmission) != 0) {
    if (!is_zero(sigma_a)) {
      throughput *= path_transmittance(sigma_a, t);
      state.throughput_r[path] = throughput.x;
      state.throughput_g[path] = throughput.y;
      state.throughput_b[path] = throughput.z;
    }
  }

  side.Ns = shading_normal_towards(hit.Ns, side.Ng, wo);
  Frame tangent_frame;
  bool has_tangents = false;
  if constexpr ((kFeatures & kFeatureNormalMaps) != 0) {
    if (material.normal_texture.texture_index >= 0 || material.clearcoat_normal_texture.texture_index >= 0) {
      has_tangents = surface_hit_tangent_frame(mesh, instance, triangle, state.hit_u[path], state.hit_v[path], hit.Ns,
                                               &tangent_frame);
    }
    if (has_tangents && material.normal_texture.texture_index >= 0) {
      const Vec3f N = normalize(from_local(tangent_frame, normal_map_eval(material, g.textures, hit.uv, uv_width)));
      side.Ns = shading_normal_consistent(side.Ng, side.front ? N : -N, wo);
    }
  }
  const bool solid = params.transmission > 0.0f && !params.thin;
  side.frame = frame_from_normal(solid && !side.front ? -side.Ns : side.Ns);
  const Vec3f wo_local = to_local(side.frame, wo);
  if constexpr ((kFeatures & kFeatureLayers) != 0 && (kFeatures & kFeatureNormalMaps) != 0) {
    if (has_tangents && params.clearcoat > 0.0f) {
      // The coat lies smoothly over the base's normal map unless it has one of its own (KHR_materials_clearcoat).
      Vec3f N = hit.Ns;
      if (material.clearcoat_normal_texture.texture_index >= 0) {
        N = normalize(from_local(tangent_frame, clearcoat_normal_map_eval(material, g.textures, hit.uv, uv_width)));
      }
      params.clearcoat_N = to_local(side.frame, shading_normal_consistent(side.Ng, side.front ? N : -N, wo));
    }
  }

  if ((state.flags[path] & kPathSawSurface) == 0) {
    state.flags[path] |= kPathSawSurface;
    FirstHit first;
    first.P = hit.P;
    first.N = side.Ns;
    first.albedo = surface_albedo(params);
    first.uv = hit.uv[0];
    first.depth = dot(hit.P - g.camera.world_from_camera.p, g.camera_forward);
    first.instance_index = state.hit_object[path];
    first.material_index = static_cast<std::uint32_t>(instance.material_index);
    first.is_first_sample = sample == 0;
    film_add_first_hit(g.film, state.pixel[path], first);
  }

  if (!is_zero(params.emission) && (side.front || material.double_sided || params.unlit)) {
    Vec3f radiance = params.emission;
    const float pdf = state.pdf[path];
    if (pdf > 0.0f && instance.first_light_index >= 0) {
      const float pdf_light = lights_pdf(g.lights, path_origin(state, path), path_scatter_N(state, path),
                                         static_cast<std::uint32_t>(instance.first_light_index) + triangle, -wo, t);
      radiance *= path_bsdf_weight(g.light_technique, pdf, pdf_light);
    }
    path_add_radiance(state, path, bounce, throughput * radiance, g.clamp_indirect);
  }
  const bool last = bounce > g.limits.total || path_bounces(bounces, BounceKind::kDiffuse) > g.limits.diffuse ||
                    path_bounces(bounces, BounceKind::kGlossy) > g.limits.glossy ||
                    path_bounces(bounces, BounceKind::kTransmission) > g.limits.transmission;
  if (params.unlit || last) return;

  if ((instance.flags & kDisplaced) != 0) cone.width = min(cone.width, state.hit_width[path]);
  const SurfaceClosure closure = surface_closure_make<kFeatures>(params, *g.bsdf_tables, wo_local);
  const Vec3f light_N = params.transmission > 0.0f ? Vec3f{} : side.Ns;
  if (g.has_lights && !surface_is_delta(params)) {
    shade_surface_light<kFeatures>(g, state, path, hit, closure, side, light_N, cone, shadow);
  }

  const BsdfSample bsdf = closure_sample<kFeatures>(
      closure, *g.bsdf_tables, sample_1d(hash, sample, dimension_bounce(surface, BounceDimension::kBsdfLobe)),
      sample_2d(hash, sample, dimension_bounce(surface, BounceDimension::kBsdfUv)));
  if (!(bsdf.pdf > 0.0f)) return;
  throughput *= bsdf.f * (__builtin_fabsf(bsdf.wi.z) / bsdf.pdf);

  float eta_scale = 1.0f;
  if constexpr ((kFeatures & kFeatureTransmission) != 0) {
    eta_scale = state.eta_scale[path] * sqr(bsdf.eta);
    state.eta_scale[path] = eta_scale;
  }

  // Russian roulette with the square root of the throughput: a gentler rate than the throughput itself, which measured
  // less noise at equal time (as Cycles and others found). What refraction takes on entering glass is not a loss: it
  // comes back on leaving (pbrt-v4 §14.5.4). The first indirect ray is spared: what it finds, a lamp in a mirror say, is
  // most of the noise of many pictures (19 % more variance with an environment, for 9 % less time).
  if (bounce > 1) {
    const float survival = min(1.0f, __builtin_sqrtf(max_component(throughput) * eta_scale));
    if (!(sample_1d(hash, sample, dimension_bounce(surface, BounceDimension::kRoulette)) < survival)) return;
    throughput *= 1.0f / survival;
  }
  if (is_zero(throughput)) return;

  const Vec3f wi = from_local(side.frame, bsdf.wi);
  const bool above = dot(wi, side.Ns) > 0.0f;
  const Vec3f Ng_leave = above ? side.Ng : -side.Ng;
  Vec3f P = hit.P;
  if (above && side.front) P += hit.P_lift * terminator_lift_weight(dot(wi, side.Ng));
  const Vec3f O = offset_ray_origin(P, hit.P_error, Ng_leave);
  state.O_x[path] = O.x;
  state.O_y[path] = O.y;
  state.O_z[path] = O.z;
  state.D_x[path] = wi.x;
  state.D_y[path] = wi.y;
  state.D_z[path] = wi.z;
  state.t_min[path] = kLeastDistance;
  state.t_max[path] = kInfinity;
  state.throughput_r[path] = throughput.x;
  state.throughput_g[path] = throughput.y;
  state.throughput_b[path] = throughput.z;
  const bool delta = (bsdf.lobe & kLobeDelta) != 0;
  state.pdf[path] = delta ? 0.0f : bsdf.pdf;
  state.scatter_Nx[path] = light_N.x;
  state.scatter_Ny[path] = light_N.y;
  state.scatter_Nz[path] = light_N.z;
  const bool transmitted = (bsdf.lobe & kLobeTransmit) != 0;
  const BounceKind kind = transmitted                       ? BounceKind::kTransmission
                          : (bsdf.lobe & kLobeDiffuse) != 0 ? BounceKind::kDiffuse
                                                            : BounceKind::kGlossy;
  state.bounces[path] = bounces + 1u + (1u << static_cast<int>(kind));
  if constexpr ((kFeatures & kFeatureTransmission) != 0) {
    if (transmitted && solid) {
      const Vec3f inside = side.front ? params.sigma_a : Vec3f{};
      state.sigma_a_r[path] = inside.x;
      state.sigma_a_g[path] = inside.y;
      state.sigma_a_b[path] = inside.z;
    }
  }
  cone = ray_cone_scatter(cone, bsdf.roughness);
  state.cone_width[path] = cone.width;
  state.cone_spread[path] = cone.spread;
  queue_push(next, path);
}

}  // namespace relief
