// The picture while it is rendered: sums, sample counts per tile, error estimates, and the finished planes.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "kernel/film/film_accumulator.h"
#include "kernel/film/film_layout.h"
#include "kernel/render_state.h"
#include "scene/render_settings.h"

namespace relief {

/// Side of the square tiles that are sampled, judged by adaptive sampling and handed to threads as one, pixels.
/// 16 × 16 pixels × 16 samples fill a batch of 4,096 paths.
inline constexpr int kTileSize = 16;

/// When a pixel's noise is low enough: what the two halves of its samples differ by is at most the threshold, times five, of the
/// root of its light, summed over channels.
/// @source  the halves: Dammertz et al. 2010, "A hierarchical automatic stopping condition for Monte Carlo global illumination";
///          the numbers are those of Cycles
struct NoiseRule {
  float threshold = 0;
  NoiseMaths maths = NoiseMaths::k43;
  float exposure = 1;  ///< factor on all light
};

/// When noise is judged.
struct NoiseJudging {
  std::uint32_t next = 0;  ///< samples after which it will be for the next time
  std::uint32_t step = 0;  ///< samples between that time and each further one
  std::uint32_t most = 0;  ///< samples with which all ends
};

/// A finished picture that owns its pixels.
struct RenderedImage {
  std::vector<float> pixels;
  FilmView view;                     ///< into `pixels`
  std::optional<SavedRender> saved;  ///< what goes on from here; only if it was interrupted, and asked for
};

/// Root mean square errors of the whole image, estimated from its halves and quarters. NaN where a pixel has less than two
/// samples: nothing can be known from one.
struct ImageError {
  double rmse = 0, relmse = 0;
};

/// Squared error of a mean of n samples from what halves and quarters of them tell.
///
/// Let v(n) be the squared error of n samples. Half of them and the other half differ by what
///   D₁ = |A − B|²/4   estimates:  v(n/2) − v(n),
/// whether the halves are independent or complete each other; quarters give D₂ for v(n/4) − v(n/2). If v(n) = a/n + b/n²
/// (random samples; stratified ones where the integrand is smooth), v(n) = 5/3 D₁ − 1/3 D₂ exactly. For edges, where v
/// falls as n^−1.5, that is a third too much, for very smooth integrands (n^−3) up to twice: the error is overstated, by
/// 15 % and 50 %.
/// Where a few pixels are most of the error, as those of a sharp highlight, the claim is as unsure as any from so few: in
/// one such picture of 32 × 32 pixels squared errors were claimed as .7 to 1.4 of the truth, by chance alone; without the
/// highlight as .95 to 1.09.
/// Linear, so sums over pixels may be put in; single pixels are too noisy.
/// @param d1, d2  sums of D₁ and D₂; d2 is the mean over both halves
/// @return        at least d1 / 3, its value for v = b/n²
double error_extrapolate(double d1, double d2);

class Film {
 public:
  /// @param aov_mask            bit i keeps enumerator i of Aov; beauty is always kept
  /// @param cryptomatte_levels  ids that a Cryptomatte keeps of a pixel
  /// @param keeps_clear         alpha is not coverage by surfaces alone, see film_add_clear
  /// @param counts_samples      each pixel has a number of its own, see judge
  /// @param keeps_catchers      there are shadow catchers; if so, keeps_clear
  /// @param num_light_groups    of the scene
  Film(int width,
       int height,
       AovMask aov_mask,
       int cryptomatte_levels = 6,
       bool keeps_clear = false,
       bool counts_samples = false,
       bool keeps_catchers = false,
       int num_light_groups = 0);

  FilmAccumulatorView accumulator();
  int width() const { return width_; }
  int height() const { return height_; }
  std::size_t num_pixels() const { return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); }
  int num_tiles() const { return tiles_x_ * tiles_y_; }
  /// Pixels of a tile, clipped to the window.
  void tile_rect(int tile, int* x0, int* y0, int* w, int* h) const;
  /// The tile of a pixel of the window.
  int tile_at(int x, int y) const { return y / kTileSize * tiles_x_ + x / kTileSize; }

  /// Samples that the tile has been given; those of its pixels that rest have had fewer.
  std::uint32_t tile_samples(int tile) const { return samples_[static_cast<std::size_t>(tile)]; }
  /// Called by the one thread that renders the tile.
  void add_tile_samples(int tile, std::uint32_t count) { samples_[static_cast<std::size_t>(tile)] += count; }
  const std::vector<std::uint32_t>& samples() const { return samples_; }
  std::span<const float> sums() const { return sums_; }
  /// Puts back what the two above gave of a film of the same size and layers.
  void restore(std::vector<float> sums, const std::vector<std::uint32_t>& samples);
  double mean_samples() const;
  /// Part of the picture that has no sample.
  double empty_part() const;

  /// A tile's sums, to be put back if what is added to them must not count.
  std::vector<float> tile_sums(int tile) const;
  /// @param sums  of the same tile, from tile_sums
  void put_back_tile_sums(int tile, const std::vector<float>& sums);

  /// Lets pixels rest whose noise is below a threshold, and which have no neighbour of which that is not true: Cycles' rule.
  /// One that rests is not judged again; it goes on when a neighbour turns out to be noisy.
  /// @param passed  samples that tiles which go on count as given
  /// @return        tiles with pixels that go on, in rising order
  /// @pre           the film counts_samples, and nobody is adding any
  std::vector<int> judge(const NoiseRule& rule, std::uint32_t passed);

  /// Samples that are still to be taken until all pixels rest, as far as noise tells that falls with the root of their number.
  /// @param done  samples that pixels which go on have had, at least two
  /// @return      of the mean pixel
  /// @pre         the film counts_samples, and nobody is adding any
  double samples_to_come(const NoiseRule& rule, const NoiseJudging& judging, std::uint32_t done) const;

  /// Errors of the image's mean, estimated by error_extrapolate from sums over all pixels.
  ImageError estimate_error() const;

  /// The beauty so far. Nobody may be adding samples.
  RenderedImage beauty(int crop_x, int crop_y, int full_width, int full_height, float exposure = 1) const;

  /// Averages, normalizes and fills in the variance, in place of the sums: they are a third of the memory of a large
  /// frame, which is not wanted twice. See docs/usage.md for each plane's meaning.
  /// @param exposure  factor on all that is light
  RenderedImage resolve(int crop_x, int crop_y, int full_width, int full_height, float exposure = 1) &&;
  std::size_t bytes() const { return sums_.size() * sizeof(float) + samples_.size() * sizeof(std::uint32_t); }

 private:
  const float* record(int x, int y) const;
  /// Coverage by all but catchers.
  float coverage(const float* record, std::uint32_t samples) const;
  float alpha(const float* record, std::uint32_t samples) const;
  /// A pixel's light without that of catchers.
  /// @param mean   of count samples, theirs included
  /// @param part   CatcherSums::kAll; of even-numbered samples kEven
  Vec3f without_catchers(const float* record, Vec3f mean, float count, int part) const;
  /// What the picture shows: in place of catchers the shadow on what is behind. Arguments as for without_catchers.
  Vec3f shown(const float* record, Vec3f mean, float count, int part) const;
  /// Factors on the variance of a pixel's light that make that of what is shown: that of its catchers by as much as what is behind
  /// is brighter than they. As it moves with the light that they have alone, shadow has less.
  Vec3f variance_shown(const float* record, std::uint32_t samples) const;
  /// The layer of what is left of light on catchers.
  Vec3f shadow_catcher(const float* record, std::uint32_t samples) const;
  /// View of a finished picture, without its pixels.
  FilmView window(AovMask aov_mask, int crop_x, int crop_y, int full_width, int full_height) const;
  /// Samples of a pixel of a tile.
  std::uint32_t pixel_samples(const float* record, int tile) const;
  /// Noise of a pixel beside what the rule allows: not below 1, and it is noisy.
  float noise(const float* record, int tile, const NoiseRule& rule) const;
  struct TileSpreads;
  struct TileLevels;
  TileSpreads tile_spreads(int tile) const;
  /// What a tile's pixels' variances are multiplied by. Their shape comes from each pixel's own samples, their level from
  /// the halves and quarters of pixels around whose samples spread alike: the former alone is blind to stratification, the
  /// latter alone are too noisy in a pixel. Alike, because edges gain far more from stratification than what lies between
  /// them: a lamp's rim that set the level of the wall behind it would make that look a hundred times too sure.
  /// @param rows  of tiles, above, with and below the tile's
  TileLevels tile_levels(const std::array<std::vector<TileSpreads>, 3>& rows, int tile) const;
  /// One pixel's planes.
  /// @param in       its sums
  /// @param samples  that it has, at least one
  /// @param levels   its tile's
  /// @param exposure as of resolve
  /// @param to       room for out.num_floats
  void resolve_pixel(const float* in,
                     std::uint32_t samples,
                     const TileLevels& levels,
                     const FilmLayout& out,
                     float exposure,
                     float* to) const;

  int width_, height_, tiles_x_, tiles_y_;
  AovMask aov_mask_;
  int num_light_groups_;
  AccumulatorLayout layout_;
  std::vector<float> sums_;
  std::vector<std::uint32_t> samples_;
};

}  // namespace relief
