// Stage: one camera path from (pixel, sample).
#pragma once

#include "kernel/camera/aperture.h"
#include "kernel/camera/camera_ray.h"
#include "kernel/counters.h"
#include "kernel/globals.h"
#include "kernel/sample/dimensions.h"
#include "kernel/sample/sobol.h"
#include "kernel/state/path_state.h"

namespace relief {

/// When a sample of a pixel is. A photon map knows of one time only, so where there is a photon pass all samples of the pass
/// are then.
RELIEF_KERNEL float path_time_sample(const KernelGlobals& g, std::uint32_t pixel_hash, std::uint32_t sample_index)
{
  return g.caustics.enabled ? g.caustics.time : sample_1d(pixel_hash, sample_index, kTimeDimension);
}

/// Starts `path` at a sample of a pixel. Writes every column but the hit's and the scatter normal.
/// Next: intersect closest.
/// @param pixel_x, pixel_y  in the film window
/// @param sample            of the pixel, counted from 0
RELIEF_KERNEL void generate_camera_path(const KernelGlobals& g,
                                        PathState& state,
                                        std::uint32_t path,
                                        int pixel_x,
                                        int pixel_y,
                                        std::uint32_t sample)
{
  const std::uint32_t sample_index = sample_sequence_index(sample, g.log2_stream);
  const int image_x = g.crop_x + pixel_x;
  const int image_y = g.crop_y + pixel_y;
  // The hash is of the pixel's place in the whole image, so that a crop shows the same noise.
  const std::uint32_t hash = sample_pixel_hash(g.seed, image_x, image_y);
  const Vec2f u = sample_2d(hash, sample_index, dimension_camera(CameraDimension::kFilm));
  const auto filter_offset = [&](float v) {
    return (g.filter != nullptr ? filter_sample(*g.filter, v) : v - 0.5f) * g.filter_width;
  };
  const float film_x = (static_cast<float>(image_x) + 0.5f + filter_offset(u.x)) / static_cast<float>(g.full_width);
  const float film_y = (static_cast<float>(image_y) + 0.5f + filter_offset(u.y)) / static_cast<float>(g.full_height);
  Vec2f lens{};
  if (g.camera.aperture_radius > 0.0f) {
    lens = aperture_sample(g.camera, sample_2d(hash, sample_index, dimension_camera(CameraDimension::kLens)));
  }
  CameraRay ray;
  if (state.motion.time != nullptr) {
    const float time = path_time_sample(g, hash, sample_index);
    state.motion.time[path] = time;
    const Affine3 place = g.camera_motion.num_keys > 0 ? motion_at(g.camera_motion, time) : g.camera.world_from_camera;
    ray = camera_ray_make(g.camera, place, film_x, film_y, lens, g.pixel_size);
  } else {
    ray = camera_ray_make(g.camera, g.camera.world_from_camera, film_x, film_y, lens, g.pixel_size);
  }

  state.O[path] = ray.O;
  state.D[path] = ray.D;
  state.t_min[path] = ray.t_min;
  state.t_max[path] = ray.t_max;
  state.throughput[path] = Vec3f{1, 1, 1};
  state.direct[path] = Vec3f{};
  state.indirect[path] = Vec3f{};
  state.least_pdf[path] = kInfinity;
  state.pdf[path] = 0.0f;
  state.pixel[path] = static_cast<std::uint32_t>(pixel_y * g.film.width + pixel_x);
  state.sample_index[path] = sample_index;
  state.pixel_hash[path] = hash;
  state.bounces[path] = 0;
  state.flags[path] = 0;
  if (__builtin_expect(state.light_passes != nullptr, 0)) state.light_passes[path] = {};
  state.first_throughput[path] = 1.0f;
  state.cone_width[path] = ray.cone_width;
  state.cone_spread[path] = ray.cone_spread;
}

}  // namespace relief
