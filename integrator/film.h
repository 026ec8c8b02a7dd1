// The picture while it is rendered: sums, sample counts per tile, error estimates, and the finished planes.
#pragma once

#include <cstdint>
#include <vector>

#include "kernel/film/film_accumulator.h"
#include "kernel/film/film_layout.h"

namespace relief {

/// Side of the square tiles that are sampled, judged by adaptive sampling and handed to threads as one, pixels.
/// 16 × 16 pixels × 16 samples fill a batch of 4,096 paths.
inline constexpr int kTileSize = 16;

/// A finished picture that owns its pixels.
struct RenderedImage {
  std::vector<float> pixels;
  FilmView view;  ///< into `pixels`
};

/// Root mean square errors of the whole image, estimated from its independent halves.
struct ImageError {
  double rmse = 0, relmse = 0;
};

class Film {
 public:
  /// @param aov_mask  bit i keeps enumerator i of Aov; beauty is always kept
  Film(int width, int height, std::uint32_t aov_mask);

  FilmAccumulatorView accumulator();
  int width() const { return width_; }
  int height() const { return height_; }
  int num_tiles() const { return tiles_x_ * tiles_y_; }
  /// Pixels of a tile, clipped to the window.
  void tile_rect(int tile, int* x0, int* y0, int* w, int* h) const;

  std::uint32_t tile_samples(int tile) const { return samples_[static_cast<std::size_t>(tile)]; }
  /// Called by the one thread that renders the tile.
  void add_tile_samples(int tile, std::uint32_t count) { samples_[static_cast<std::size_t>(tile)] += count; }
  double mean_samples() const;

  /// Estimated root mean square error of a tile's pixels relative to its mean radiance (Rec.709 luminance); tiles darker
  /// than `floor` are judged relative to that.
  double tile_error(int tile, double floor) const;
  double mean_luminance() const;

  /// Expected error of the mean of two independent halves A and B of equal weight: |A − B|²/4 is an unbiased estimate of
  /// its squared error, whatever the sampler does inside each half.
  ImageError estimate_error() const;

  /// Averages, normalizes and fills in the variance. See docs/usage.md for each plane's meaning.
  RenderedImage resolve(int crop_x, int crop_y, int full_width, int full_height) const;
  std::size_t bytes() const { return sums_.size() * sizeof(float) + samples_.size() * sizeof(std::uint32_t); }

 private:
  const float* record(int x, int y) const;
  /// Luminance of the squared half difference and of the sample variance of the mean, summed over a tile's pixels.
  void tile_variances(int tile, Vec3f* halves, Vec3f* samples) const;

  int width_, height_, tiles_x_, tiles_y_;
  std::uint32_t aov_mask_;
  AccumulatorLayout layout_;
  std::vector<float> sums_;
  std::vector<std::uint32_t> samples_;
};

}  // namespace relief
