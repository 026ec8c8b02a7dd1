// What the film is told of the surface that a path meets first, and denoisers of the first that is not seen through.
#pragma once

#include <type_traits>

#include "kernel/bsdf/mixture_colors.h"
#include "kernel/sample/dimensions.h"
#include "kernel/stage/surface_interaction.h"

namespace relief {

/// Shading normal of all that scatters at a surface: of a mixture the mean of its lobes', each of which may be bumped, by
/// what they weigh, as in Cycles.
/// @return  at most unit length; shorter where lobes disagree
template <unsigned kFeatures, typename Lobes>
RELIEF_KERNEL Vec3f surface_mean_normal(const SurfaceInteraction& at, const Lobes& lobes)
{
  return has_mixture<kFeatures>(at) ? lobes_normal(lobes, at.side.Ns) : at.side.Ns;
}

/// Queues a ray that sees whether the surroundings of a first hit are open.
RELIEF_KERNEL void shade_surface_ambient(const KernelGlobals& g,
                                         const PathState& state,
                                         std::uint32_t path,
                                         const SurfaceInteraction& at,
                                         ShadowQueue& shadow)
{
  const Vec2f u = sample_2d(state.pixel_hash[path], state.sample_index[path], kAmbientDimension);
  const Vec3f D = from_local(frame_from_normal(at.side.Ns), warp_cosine_hemisphere(u));
  if (!(dot(D, at.side.Ng) > 0.0f)) return;
  const Vec3f O = surface_ray_origin(at, D);
  shadow_queue_push(shadow, path, O, D, g.occlusion_distance, ray_cone_scatter(at.cone, 1.0f), {}, kAmbientRay);
}

/// Writes what the film keeps of a path's first hit.
/// @param N  see surface_mean_normal
template <unsigned kFeatures>
RELIEF_KERNEL void shade_surface_first_hit(const KernelGlobals& g,
                                           const PathState& state,
                                           std::uint32_t path,
                                           const SurfaceInteraction& at,
                                           Vec3f N,
                                           ShadowQueue& shadow)
{
  const AccumulatorLayout& layout = g.film.layout;
  FirstHit first;
  first.P = at.hit.P;
  first.N = normalize(N);
  first.albedo = surface_summary<kFeatures>(at).albedo;
  first.uv = at.hit.uv[0];
  const Vec3f from_camera = at.hit.P - g.camera.world_from_camera.p;
  const Projection projection = g.camera.projection;
  first.depth = __builtin_expect(projection == Projection::kPanoramic, 0) ? length(from_camera)
                                                                          : dot(from_camera, g.camera_forward);
  const bool by_distance = projection != Projection::kOrthographic;
  if (layout.mist >= 0) first.mist = mist_eval(g.mist, by_distance ? length(from_camera) : first.depth);
  first.ray_length = state.hit_t[path];
  first.instance_index = state.hit_object[path];
  first.material_index = static_cast<std::uint32_t>(at.instance->material_index);
  for (int i = 0; i < kNumCryptomattes; ++i) {
    const bool by_material = kFirstCryptomatte + i == static_cast<int>(Aov::kCryptoMaterial);
    if (layout.cryptomatte[i] >= 0)
      first.cryptomatte_ids[i] = g.cryptomatte_ids[i][by_material ? first.material_index : first.instance_index];
  }
  first.is_first_sample = state.sample_index[path] == 0;
  first.is_even_sample = sample_is_even(state.sample_index[path], g.log2_stream);
  film_add_first_hit(g.film, state.pixel[path], first);
  if (layout.ambient_occlusion >= 0) shade_surface_ambient(g, state, path, at, shadow);
}

/// What the surface scatters of white light by kinds of event, seen straight on.
/// @param colors  gets kNumEventKinds of them
RELIEF_KERNEL void surface_event_colors(const SurfaceParams& p, Vec3f* colors)
{
  const float rest = 1.0f - p.metallic;
  const Vec3f interface = min(fresnel_F0(p.ior) * p.specular_color, splat3(1.0f)) * p.specular;
  constexpr float kCoatF0 = 0.04f;
  colors[static_cast<int>(EventKind::kDiffuse)] = rest * (1.0f - p.transmission) * p.base_color + p.sheen_color;
  colors[static_cast<int>(EventKind::kGlossy)] =
      p.metallic * p.base_color + rest * interface + splat3(p.clearcoat * kCoatF0);
  colors[static_cast<int>(EventKind::kTransmission)] = rest * p.transmission * p.base_color;
}

/// Writes what a surface that the camera sees scatters of white light, by kinds of event.
/// @param throughput  up to the surface
template <unsigned kFeatures, typename Lobes>
[[gnu::noinline]] RELIEF_KERNEL void shade_surface_event_colors(const KernelGlobals& g,
                                                                const PathState& state,
                                                                std::uint32_t path,
                                                                const SurfaceInteraction& at,
                                                                const Lobes& lobes,
                                                                Vec3f throughput)
{
  if (path_bounces(state.bounces[path], BounceKind::kAll) > 0) return;
  Vec3f colors[kNumEventKinds];
  if (has_mixture<kFeatures>(at)) {
    if constexpr (std::is_same_v<Lobes, MixtureLobes>) {
      mixture_event_colors(mixture_of(lobes, at.side.frame, at.side.Ng), *g.bsdf_tables, colors);
    }
  } else if (!at.params.unlit) {
    surface_event_colors(at.params, colors);
  }
  for (Vec3f& color : colors) color *= throughput;
  film_add_event_colors(g.film, state.pixel[path], colors);
}

/// Writes what a denoiser is told of a path, unless that is to be found further on.
/// @param throughput  up to the surface
/// @param N           see surface_mean_normal
template <unsigned kFeatures>
[[gnu::noinline]] RELIEF_KERNEL void shade_surface_denoising(const KernelGlobals& g,
                                                             PathState& state,
                                                             std::uint32_t path,
                                                             const SurfaceInteraction& at,
                                                             Vec3f throughput,
                                                             Vec3f N)
{
  const SurfaceSummary summary = surface_summary<kFeatures>(at);
  if (summary.is_seen_through) return;
  state.flags[path] |= kPathSawFeature;
  const Affine3& camera = g.camera.world_from_camera;
  const Vec3f N_camera{dot(N, normalize(camera.x)), dot(N, normalize(camera.y)), dot(N, g.camera_forward)};
  film_add_denoising(g.film, state.pixel[path], sample_is_even(state.sample_index[path], g.log2_stream),
                     throughput * summary.albedo, N_camera);
}

}  // namespace relief
