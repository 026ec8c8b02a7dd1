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
      displacement_steps = -1, caustic = -1;
  int num_floats = kAlways;
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
  std::uint32_t instance_index = 0, material_index = 0;
  bool is_first_sample = false;
};

RELIEF_KERNEL void film_add3(float* sum, Vec3f value)
{
  sum[0] += value.x;
  sum[1] += value.y;
  sum[2] += value.z;
}

RELIEF_KERNEL void film_add_first_hit(const FilmAccumulatorView& film, std::uint32_t pixel, const FirstHit& hit)
{
  const AccumulatorLayout& layout = film.layout;
  float* record = film.pixels + static_cast<std::size_t>(pixel) * static_cast<std::size_t>(layout.num_floats);
  record[AccumulatorLayout::kCoverage] += 1.0f;
  if (layout.albedo >= 0) film_add3(record + layout.albedo, hit.albedo);
  if (layout.normal >= 0) film_add3(record + layout.normal, hit.N);
  if (layout.depth >= 0) record[layout.depth] += hit.depth;
  if (layout.position >= 0) film_add3(record + layout.position, hit.P);
  if (layout.uv >= 0) {
    record[layout.uv] += hit.uv.x;
    record[layout.uv + 1] += hit.uv.y;
  }
  if (hit.is_first_sample) {
    if (layout.object_id >= 0) record[layout.object_id] = static_cast<float>(hit.instance_index + 1);
    if (layout.material_id >= 0) record[layout.material_id] = static_cast<float>(hit.material_index + 1);
  }
}

/// Adds what a camera ray cost in displaced meshes, if that is kept.
RELIEF_KERNEL void film_add_displacement_steps(const FilmAccumulatorView& film,
                                               std::uint32_t pixel,
                                               std::uint32_t steps)
{
  const AccumulatorLayout& layout = film.layout;
  if (layout.displacement_steps < 0) return;
  float* record = film.pixels + static_cast<std::size_t>(pixel) * static_cast<std::size_t>(layout.num_floats);
  record[layout.displacement_steps] += static_cast<float>(steps);
}

/// Adds a finished sample.
/// @param sample  of the pixel, counted from 0
/// @return false when the sample is not finite; it then counts as black
RELIEF_KERNEL bool film_add_sample(const FilmAccumulatorView& film,
                                   std::uint32_t pixel,
                                   std::uint32_t sample,
                                   Vec3f direct,
                                   Vec3f indirect,
                                   Vec3f caustic = {})
{
  const AccumulatorLayout& layout = film.layout;
  float* record = film.pixels + static_cast<std::size_t>(pixel) * static_cast<std::size_t>(layout.num_floats);
  const Vec3f radiance = direct + indirect + caustic;
  if (!is_finite(radiance)) return false;
  film_add3(record + AccumulatorLayout::kBeauty, radiance);
  film_add3(record + AccumulatorLayout::kSquares, radiance * radiance);
  if ((sample & 1u) == 0) film_add3(record + AccumulatorLayout::kEven, radiance);
  if ((sample & 3u) == 0) film_add3(record + AccumulatorLayout::kQuarter0, radiance);
  if ((sample & 3u) == 1) film_add3(record + AccumulatorLayout::kQuarter1, radiance);
  if (layout.direct >= 0) film_add3(record + layout.direct, direct);
  if (layout.caustic >= 0) film_add3(record + layout.caustic, caustic);
  return true;
}

}  // namespace relief
