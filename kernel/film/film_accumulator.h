// The film while it is being rendered: sums per pixel. film_resolve (integrator/film.h) turns it into a FilmView.
#pragma once

#include "kernel/film/film_layout.h"
#include "kernel/math/vec.h"

namespace relief {

/// Where each sum lies inside a pixel's record of floats; −1: not kept. The beauty, its parts and the squares are always
/// kept, because error estimates and adaptive sampling need them.
struct AccumulatorLayout {
  static constexpr int kBeauty = 0;     ///< R, G, B
  static constexpr int kCoverage = 3;   ///< samples that met geometry
  static constexpr int kEven = 4;       ///< R, G, B of samples 0, 2, 4, …: the first half
  static constexpr int kSquares = 7;    ///< R², G², B²
  static constexpr int kQuarter0 = 10;  ///< R, G, B of samples 0, 4, 8, …: the first quarter of the first half
  static constexpr int kQuarter1 = 13;  ///< R, G, B of samples 1, 5, 9, …: the first quarter of the second half
  static constexpr int kAlways = 16;

  int direct = -1, albedo = -1, normal = -1, depth = -1, position = -1, uv = -1, object_id = -1, material_id = -1,
      displacement_steps = -1, caustic = -1, holdout = -1, mist = -1, emission = -1, environment = -1,
      ambient_occlusion = -1, clear = -1, denoising_albedo = -1, denoising_normal = -1, denoising_depth = -1,
      denoising_half = -1, volume_direct = -1, volume_indirect = -1, light_groups = -1;
  int light_passes[kNumLightPasses] = {-1, -1, -1, -1, -1, -1};
  int event_colors[kNumEventKinds] = {-1, -1, -1};
  int catcher = -1;             ///< CatcherSums: where something is a shadow catcher
  bool shadow_catcher = false;  ///< the layer of that name is kept
  int samples = -1;  ///< that the pixel has had, and whether it rests: where noise ends pixels one by one
  int cryptomatte[kNumCryptomattes] = {-1, -1, -1};  ///< pairs of an id and its weight, the first of weight 0 is free
  int cryptomatte_levels = 0;
  bool light_by_event = false;  ///< any of light_passes or event_colors is kept
  bool denoising = false;       ///< denoising_albedo, denoising_normal or denoising_half is kept
  int num_floats = kAlways;
};

/// Offsets of what a pixel has of shadow catchers: sums over its samples, and over the even-numbered ones.
struct CatcherSums {
  static constexpr int kShare = 0;  ///< see CatcherState::share
  static constexpr int kAll = 1, kEven = 10;
  static constexpr int kCaught = 0;    ///< R, G, B of the light that they send, which is in the beauty as well
  static constexpr int kAlone = 3;     ///< R, G, B of what it would be if there were catchers only
  static constexpr int kBackdrop = 6;  ///< R, G, B of what the camera would see in their place
  static constexpr int kNumFloats = 19;
};

/// Sums of all pixels of the window; each pixel is written by one thread at a time.
struct FilmAccumulatorView {
  float* pixels = nullptr;  ///< width · height records of layout.num_floats
  int width = 0, height = 0;
  AccumulatorLayout layout;
};

/// What the first opaque-enough surface of a path tells the AOVs; world space, metres.
struct FirstHit {
  Vec3f P, N, albedo;
  Vec2f uv;
  float depth = 0;
  float mist = 0;
  float ray_length = 0;
  float cryptomatte_ids[kNumCryptomattes] = {};
  std::uint32_t instance_index = 0, material_index = 0;
  bool is_first_sample = false, is_even_sample = false;
};

RELIEF_KERNEL void film_add3(float* sum, Vec3f value)
{
  sum[0] += value.x;
  sum[1] += value.y;
  sum[2] += value.z;
}

RELIEF_KERNEL float* film_record(const FilmAccumulatorView& film, std::uint32_t pixel)
{
  return film.pixels + static_cast<std::size_t>(pixel) * static_cast<std::size_t>(film.layout.num_floats);
}

/// Counts a sample for an id. One for which no place is left is dropped: its coverage is missing, nobody else has too much.
/// @param pairs  id and weight by level
RELIEF_KERNEL void film_add_cryptomatte(float* pairs, int levels, float id)
{
  for (int i = 0; i < levels; ++i) {
    float* pair = pairs + 2 * i;
    if (pair[1] == 0.0f) pair[0] = id;
    if (pair[0] != id) continue;
    pair[1] += 1.0f;
    return;
  }
}

RELIEF_KERNEL void film_add_first_hit(const FilmAccumulatorView& film, std::uint32_t pixel, const FirstHit& hit)
{
  const AccumulatorLayout& layout = film.layout;
  float* record = film_record(film, pixel);
  record[AccumulatorLayout::kCoverage] += 1.0f;
  if (layout.albedo >= 0) film_add3(record + layout.albedo, hit.albedo);
  if (layout.normal >= 0) film_add3(record + layout.normal, hit.N);
  if (layout.depth >= 0) record[layout.depth] += hit.depth;
  if (layout.position >= 0) film_add3(record + layout.position, hit.P);
  if (layout.uv >= 0) {
    record[layout.uv] += hit.uv.x;
    record[layout.uv + 1] += hit.uv.y;
  }
  if (layout.mist >= 0) record[layout.mist] += 1.0f - hit.mist;
  if (layout.denoising_depth >= 0) record[layout.denoising_depth] += hit.ray_length;
  if (layout.denoising_half >= 0 && hit.is_even_sample) record[layout.denoising_half + 6] += hit.ray_length;
  for (int i = 0; i < kNumCryptomattes; ++i) {
    if (layout.cryptomatte[i] < 0) continue;
    film_add_cryptomatte(record + layout.cryptomatte[i], layout.cryptomatte_levels, hit.cryptomatte_ids[i]);
  }
  if (hit.is_first_sample) {
    if (layout.object_id >= 0) record[layout.object_id] = static_cast<float>(hit.instance_index + 1);
    if (layout.material_id >= 0) record[layout.material_id] = static_cast<float>(hit.material_index + 1);
  }
}

/// Counts a sample that met a holdout, or a share of one, if that is kept.
RELIEF_KERNEL void film_add_holdout(const FilmAccumulatorView& film, std::uint32_t pixel, float share = 1.0f)
{
  if (film.layout.holdout >= 0) film_record(film, pixel)[film.layout.holdout] += share;
}

/// Takes a share of a sample from what the picture's alpha says of it, if that is kept.
/// @param share  negative: gives one
RELIEF_KERNEL void film_add_clear(const FilmAccumulatorView& film, std::uint32_t pixel, float share)
{
  if (film.layout.clear >= 0) film_record(film, pixel)[film.layout.clear] += share;
}

/// Adds what something that the camera sees sends out, if that is kept.
RELIEF_KERNEL void film_add_emission(const FilmAccumulatorView& film, std::uint32_t pixel, Vec3f radiance)
{
  if (film.layout.emission >= 0) film_add3(film_record(film, pixel) + film.layout.emission, radiance);
}

/// Adds the environment that the camera sees, if that is kept.
RELIEF_KERNEL void film_add_environment(const FilmAccumulatorView& film, std::uint32_t pixel, Vec3f radiance)
{
  if (film.layout.environment >= 0) film_add3(film_record(film, pixel) + film.layout.environment, radiance);
}

/// Adds light of a group of lights, if that is kept.
/// @param group  0: none
RELIEF_KERNEL void film_add_light_group(const FilmAccumulatorView& film,
                                        std::uint32_t pixel,
                                        std::uint32_t group,
                                        Vec3f radiance)
{
  if (film.layout.light_groups < 0 || group == 0 || !is_finite(radiance)) return;
  film_add3(film_record(film, pixel) + film.layout.light_groups + 3 * (group - 1), radiance);
}

/// Adds what media scattered to the camera of a sample, where that is kept.
RELIEF_KERNEL void film_add_volume(const FilmAccumulatorView& film, std::uint32_t pixel, Vec3f direct, Vec3f indirect)
{
  const AccumulatorLayout& layout = film.layout;
  float* record = film_record(film, pixel);
  if (layout.volume_direct >= 0) film_add3(record + layout.volume_direct, direct);
  if (layout.volume_indirect >= 0) film_add3(record + layout.volume_indirect, indirect);
}

/// Adds what a sample brought by kinds of its first event, where that is kept.
/// @param light  kNumLightPasses of them
RELIEF_KERNEL void film_add_light_passes(const FilmAccumulatorView& film, std::uint32_t pixel, const Vec3f* light)
{
  for (int i = 0; i < kNumLightPasses; ++i) {
    if (film.layout.light_passes[i] >= 0) film_add3(film_record(film, pixel) + film.layout.light_passes[i], light[i]);
  }
}

/// Adds what a surface that the camera sees scatters of white light by kinds of event, where that is kept.
/// @param colors  kNumEventKinds of them
RELIEF_KERNEL void film_add_event_colors(const FilmAccumulatorView& film, std::uint32_t pixel, const Vec3f* colors)
{
  for (int i = 0; i < kNumEventKinds; ++i) {
    if (film.layout.event_colors[i] >= 0) film_add3(film_record(film, pixel) + film.layout.event_colors[i], colors[i]);
  }
}

/// Adds what a ray for ambient occlusion has found.
/// @param visibility  0 … 1
RELIEF_KERNEL void film_add_ambient(const FilmAccumulatorView& film, std::uint32_t pixel, float visibility)
{
  film_record(film, pixel)[film.layout.ambient_occlusion] += visibility;
}

/// Adds what a denoiser is told of a sample.
/// @param is_even  whether the sample belongs to the pixel's first half
/// @param N        unit, along the camera's axes: see Aov::kDenoisingNormal; zero vector: nothing was met
RELIEF_KERNEL void film_add_denoising(const FilmAccumulatorView& film,
                                      std::uint32_t pixel,
                                      bool is_even,
                                      Vec3f albedo,
                                      Vec3f N)
{
  const AccumulatorLayout& layout = film.layout;
  float* record = film_record(film, pixel);
  if (layout.denoising_albedo >= 0) film_add3(record + layout.denoising_albedo, albedo);
  if (layout.denoising_normal >= 0) film_add3(record + layout.denoising_normal, N);
  if (layout.denoising_half >= 0 && is_even) {
    film_add3(record + layout.denoising_half, albedo);
    film_add3(record + layout.denoising_half + 3, N);
  }
}

/// Adds what a camera ray cost in displaced meshes, if that is kept.
RELIEF_KERNEL void film_add_displacement_steps(const FilmAccumulatorView& film,
                                               std::uint32_t pixel,
                                               std::uint32_t steps)
{
  const AccumulatorLayout& layout = film.layout;
  if (layout.displacement_steps < 0) return;
  float* record = film_record(film, pixel);
  record[layout.displacement_steps] += static_cast<float>(steps);
}

/// Samples that a pixel has had so far, of a film that counts them.
RELIEF_KERNEL std::uint32_t film_pixel_samples(const FilmAccumulatorView& film, std::uint32_t pixel)
{
  return static_cast<std::uint32_t>(film_record(film, pixel)[film.layout.samples]);
}

/// Whether a pixel gets no sample of a batch: its noise is below the threshold.
RELIEF_KERNEL bool film_pixel_rests(const FilmAccumulatorView& film, std::uint32_t pixel)
{
  return film.layout.samples >= 0 && film_record(film, pixel)[film.layout.samples + 1] != 0.0f;
}

/// Adds what a finished sample brought to the beauty, and to what errors are known by.
/// @param sample  of the pixel, counted from 0
/// @return false when the sample is not finite; it then counts as black
RELIEF_KERNEL bool film_add_radiance(const FilmAccumulatorView& film,
                                     std::uint32_t pixel,
                                     std::uint32_t sample,
                                     Vec3f radiance)
{
  const AccumulatorLayout& layout = film.layout;
  float* record = film_record(film, pixel);
  if (layout.samples >= 0) record[layout.samples] += 1.0f;
  if (!is_finite(radiance)) return false;
  film_add3(record + AccumulatorLayout::kBeauty, radiance);
  film_add3(record + AccumulatorLayout::kSquares, radiance * radiance);
  if ((sample & 1u) == 0) film_add3(record + AccumulatorLayout::kEven, radiance);
  if ((sample & 3u) == 0) film_add3(record + AccumulatorLayout::kQuarter0, radiance);
  if ((sample & 3u) == 1) film_add3(record + AccumulatorLayout::kQuarter1, radiance);
  return true;
}

/// Adds a finished sample, as film_add_radiance.
RELIEF_KERNEL bool film_add_sample(const FilmAccumulatorView& film,
                                   std::uint32_t pixel,
                                   std::uint32_t sample,
                                   Vec3f direct,
                                   Vec3f indirect,
                                   Vec3f caustic = {})
{
  const AccumulatorLayout& layout = film.layout;
  float* record = film_record(film, pixel);
  if (!film_add_radiance(film, pixel, sample, direct + indirect + caustic)) return false;
  if (layout.direct >= 0) film_add3(record + layout.direct, direct);
  if (layout.caustic >= 0) film_add3(record + layout.caustic, caustic);
  return true;
}

/// Adds what a finished sample brought from a shadow catcher, which is in no layer of light.
/// @param caught           light that came from there, finite and in the beauty, too
/// @param alone, backdrop  see CatcherState; finite
/// @pre   the film keeps sums of catchers
RELIEF_KERNEL void film_add_caught(const FilmAccumulatorView& film,
                                   std::uint32_t pixel,
                                   std::uint32_t sample,
                                   Vec3f caught,
                                   Vec3f alone,
                                   Vec3f backdrop)
{
  float* sums = film_record(film, pixel) + film.layout.catcher;
  const auto add = [&](float* part) {
    film_add3(part + CatcherSums::kCaught, caught);
    film_add3(part + CatcherSums::kAlone, alone);
    film_add3(part + CatcherSums::kBackdrop, backdrop);
  };
  add(sums + CatcherSums::kAll);
  if ((sample & 1u) == 0) add(sums + CatcherSums::kEven);
}

}  // namespace relief
