#include "integrator/film.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "kernel/assert.h"
#include "scene/memory.h"

namespace relief {

namespace {

AccumulatorLayout layout_make(AovMask aov_mask,
                              int cryptomatte_levels,
                              bool keeps_clear,
                              bool counts_samples,
                              bool keeps_catchers,
                              int num_light_groups)
{
  AccumulatorLayout layout;
  layout.cryptomatte_levels = cryptomatte_levels;
  const auto keep = [&](Aov aov, int channels, int& offset) {
    if (!aov_is_in(aov, aov_mask)) return;
    offset = layout.num_floats;
    layout.num_floats += channels;
  };
  if (aov_is_in(Aov::kIndirect, aov_mask)) aov_mask |= aov_bit(Aov::kDirect);
  keep(Aov::kDirect, 3, layout.direct);
  keep(Aov::kAlbedo, 3, layout.albedo);
  keep(Aov::kNormal, 3, layout.normal);
  keep(Aov::kDepth, 1, layout.depth);
  keep(Aov::kPosition, 3, layout.position);
  keep(Aov::kUv, 2, layout.uv);
  keep(Aov::kObjectId, 1, layout.object_id);
  keep(Aov::kMaterialId, 1, layout.material_id);
  keep(Aov::kDisplacementSteps, 1, layout.displacement_steps);
  keep(Aov::kCaustic, 3, layout.caustic);
  keep(Aov::kHoldout, 1, layout.holdout);
  keep(Aov::kMist, 1, layout.mist);
  keep(Aov::kEmission, 3, layout.emission);
  keep(Aov::kEnvironment, 3, layout.environment);
  keep(Aov::kAmbientOcclusion, 1, layout.ambient_occlusion);
  keep(Aov::kDenoisingAlbedo, 3, layout.denoising_albedo);
  keep(Aov::kDenoisingNormal, 3, layout.denoising_normal);
  keep(Aov::kDenoisingDepth, 1, layout.denoising_depth);
  keep(Aov::kDenoisingHalf, 7, layout.denoising_half);
  keep(Aov::kVolumeDirect, 3, layout.volume_direct);
  keep(Aov::kVolumeIndirect, 3, layout.volume_indirect);
  keep(Aov::kLightGroups, 3 * num_light_groups, layout.light_groups);
  for (int i = 0; i < kNumLightPasses; ++i) keep(light_pass_aov(i), 3, layout.light_passes[i]);
  for (int i = 0; i < kNumEventKinds; ++i) keep(event_color_aov(i), 3, layout.event_colors[i]);
  const auto is_kept = [](int offset) { return offset >= 0; };
  layout.light_by_event =
      std::ranges::any_of(layout.light_passes, is_kept) || std::ranges::any_of(layout.event_colors, is_kept);
  if (keeps_clear) layout.clear = layout.num_floats++;
  if (keeps_catchers) {
    layout.catcher = layout.num_floats;
    layout.num_floats += CatcherSums::kNumFloats;
  }
  layout.shadow_catcher = aov_is_in(Aov::kShadowCatcher, aov_mask);
  if (counts_samples) {
    layout.samples = layout.num_floats;
    layout.num_floats += 2;
  }
  layout.denoising = layout.denoising_albedo >= 0 || layout.denoising_normal >= 0 || layout.denoising_half >= 0;
  for (int i = 0; i < kNumCryptomattes; ++i) {
    keep(static_cast<Aov>(kFirstCryptomatte + i), 2 * cryptomatte_levels, layout.cryptomatte[i]);
  }
  // The finished planes take the place of the sums.
  layout.num_floats =
      std::max(layout.num_floats, film_layout_make(aov_mask, cryptomatte_levels, num_light_groups).num_floats);
  return layout;
}

/// Writes one pixel's pairs of id and coverage as Cryptomatte wants them: by falling coverage.
/// @param sums  as AccumulatorLayout::cryptomatte has them
/// @param to    room for cryptomatte_num_channels(levels), all 0
void put_cryptomatte(const float* sums, int levels, float inverse_n, float* to)
{
  struct Pair {
    float id, weight;
  };
  std::array<Pair, kMostCryptomatteLevels> pairs{};
  const auto count = static_cast<std::size_t>(levels);
  for (std::size_t i = 0; i < count; ++i) pairs[i] = {sums[2 * i], sums[2 * i + 1]};
  std::stable_sort(pairs.begin(), pairs.begin() + levels,
                   [](const Pair& a, const Pair& b) { return a.weight > b.weight; });
  for (std::size_t i = 0; i < count; ++i) {
    to[2 * i] = pairs[i].id;
    to[2 * i + 1] = pairs[i].weight * inverse_n;
  }
}

Vec3f load3(const float* p) { return {p[0], p[1], p[2]}; }

/// What is left of light on catchers. Where a channel has none to begin with it is as the others are, and where all have none
/// nothing is taken.
/// @param sums  of CatcherSums::kAll or kEven
Vec3f light_left(const float* sums)
{
  float left[3];
  float sum = 0, count = 0;
  for (int c = 0; c < 3; ++c) {
    left[c] = sums[CatcherSums::kCaught + c] / sums[CatcherSums::kAlone + c];
    if (!std::isfinite(left[c])) continue;
    sum += left[c];
    count += 1;
  }
  const float others = count > 0 ? sum / count : 1.0f;
  for (float& c : left) c = std::isfinite(c) ? c : others;
  return load3(left);
}

/// The part of light on catchers that is not in shadow: what a picture's alpha and what is behind can show, as in Cycles.
/// @param sums  as for light_left
float unshadowed(const float* sums)
{
  const Vec3f left = light_left(sums);
  return std::clamp((left.x + left.y + left.z) / 3.0f, 0.0f, 1.0f);
}

/// Where catchers are as good as dark, their noise says nothing of that of the picture.
constexpr float kMostVarianceScale = 1e4f;

/// What a pixel's sums say: means, the differences that error_extrapolate wants (D₁, D₂), and the variance of the mean
/// as if the samples were independent.
struct PixelEstimate {
  Vec3f mean, even, d1, d2, sample_variance;
};

/// Squared difference of the means of two parts of a whole, times their shares: the variance of the whole's mean if the
/// parts are independent, whatever their sizes (Var(A − B) = σ²(1/n_a + 1/n_b), Var(mean) = σ²/(n_a + n_b)).
Vec3f split_variance(Vec3f sum_a, float n_a, Vec3f sum_b, float n_b)
{
  const Vec3f difference = sum_a / n_a - sum_b / n_b;
  const float n = n_a + n_b;
  return difference * difference * (n_a * n_b / (n * n));
}

PixelEstimate pixel_estimate(const float* record, std::uint32_t samples)
{
  PixelEstimate estimate;
  if (samples == 0) return estimate;
  const auto count = [samples](std::uint32_t first, std::uint32_t step) {
    const std::uint32_t whole = (samples + step - 1 - first) / step;
    return static_cast<float>(whole);
  };
  const auto n = static_cast<float>(samples);
  const Vec3f sum = load3(record + AccumulatorLayout::kBeauty);
  const Vec3f even = load3(record + AccumulatorLayout::kEven);
  estimate.mean = sum / n;
  estimate.even = even / count(0, 2);
  if (samples < 2) return estimate;
  const Vec3f odd = sum - even;
  estimate.d1 = split_variance(even, count(0, 2), odd, count(1, 2));
  const Vec3f squares = load3(record + AccumulatorLayout::kSquares);
  estimate.sample_variance = max((squares - sum * estimate.mean) / ((n - 1.0f) * n), Vec3f{});
  if (samples < 4) {
    // No quarters yet: as independent samples have it.
    estimate.d2 = 2.0f * estimate.d1;
    return estimate;
  }
  const Vec3f quarter0 = load3(record + AccumulatorLayout::kQuarter0);
  const Vec3f quarter1 = load3(record + AccumulatorLayout::kQuarter1);
  estimate.d2 = 0.5f * (split_variance(quarter0, count(0, 4), even - quarter0, count(2, 4)) +
                        split_variance(quarter1, count(1, 4), odd - quarter1, count(3, 4)));
  return estimate;
}

constexpr std::size_t kNumSpreads = 128;

/// Class of a PixelEstimate::sample_variance, ≥ 0: one for each power of two.
std::size_t spread_class(float sample_variance)
{
  constexpr int kLeastExponent = -80;
  constexpr int kGreatestExponent = kLeastExponent + static_cast<int>(kNumSpreads) - 1;
  return static_cast<std::size_t>(std::clamp(std::ilogb(sample_variance), kLeastExponent, kGreatestExponent) -
                                  kLeastExponent);
}

/// Sums of one channel over pixels, of what PixelEstimate has of them.
struct SpreadSums {
  float num_pixels = 0, sample_variance = 0, d1 = 0, d2 = 0;

  void add(const SpreadSums& other)
  {
    num_pixels += other.num_pixels;
    sample_variance += other.sample_variance;
    d1 += other.d1;
    d2 += other.d2;
  }
};

}  // namespace

/// Of each channel, the pixels by spread_class; those whose samples are all the same are left out.
struct Film::TileSpreads {
  std::array<std::array<SpreadSums, kNumSpreads>, 3> channels;
};

/// Of each channel, by spread_class: what a pixel's sample_variance is multiplied by.
struct Film::TileLevels {
  std::array<std::array<float, kNumSpreads>, 3> channels;
};

/// Number of floats of all pixels. @error OutOfMemory
static std::size_t sums_size(int width, int height, const AccumulatorLayout& layout)
{
  const std::size_t size =
      static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * static_cast<std::size_t>(layout.num_floats);
  memory_require(size * sizeof(float),
                 "a picture of " + std::to_string(width) + " x " + std::to_string(height) + " pixels");
  return size;
}

Film::Film(int width,
           int height,
           AovMask aov_mask,
           int cryptomatte_levels,
           bool keeps_clear,
           bool counts_samples,
           bool keeps_catchers,
           int num_light_groups)
    : width_(width),
      height_(height),
      tiles_x_((width + kTileSize - 1) / kTileSize),
      tiles_y_((height + kTileSize - 1) / kTileSize),
      aov_mask_(aov_mask | aov_bit(Aov::kBeauty)),
      num_light_groups_(num_light_groups),
      layout_(
          layout_make(aov_mask_, cryptomatte_levels, keeps_clear, counts_samples, keeps_catchers, num_light_groups)),
      sums_(sums_size(width, height, layout_)),
      samples_(static_cast<std::size_t>(tiles_x_) * static_cast<std::size_t>(tiles_y_))
{
}

double error_extrapolate(double d1, double d2) { return std::max((5.0 * d1 - d2) / 3.0, d1 / 3.0); }

FilmAccumulatorView Film::accumulator() { return {sums_.data(), width_, height_, layout_}; }

void Film::restore(std::vector<float> sums, const std::vector<std::uint32_t>& samples)
{
  sums_ = std::move(sums);
  samples_ = samples;
}

const float* Film::record(int x, int y) const
{
  return sums_.data() + (static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)) *
                            static_cast<std::size_t>(layout_.num_floats);
}

void Film::tile_rect(int tile, int* x0, int* y0, int* w, int* h) const
{
  *x0 = tile % tiles_x_ * kTileSize;
  *y0 = tile / tiles_x_ * kTileSize;
  *w = std::min(kTileSize, width_ - *x0);
  *h = std::min(kTileSize, height_ - *y0);
}

double Film::mean_samples() const
{
  double sum = 0;
  for (int tile = 0; tile < num_tiles(); ++tile) {
    int x0, y0, w, h;
    tile_rect(tile, &x0, &y0, &w, &h);
    if (layout_.samples < 0) {
      sum += static_cast<double>(tile_samples(tile)) * w * h;
      continue;
    }
    for (int y = y0; y < y0 + h; ++y) {
      for (int x = x0; x < x0 + w; ++x) sum += pixel_samples(record(x, y), tile);
    }
  }
  return sum / (static_cast<double>(width_) * height_);
}

double Film::empty_part() const
{
  double sum = 0;
  for (int tile = 0; tile < num_tiles(); ++tile) {
    int x0, y0, w, h;
    tile_rect(tile, &x0, &y0, &w, &h);
    if (tile_samples(tile) == 0) sum += static_cast<double>(w) * h;
  }
  return sum / static_cast<double>(num_pixels());
}

std::vector<float> Film::tile_sums(int tile) const
{
  int x0, y0, w, h;
  tile_rect(tile, &x0, &y0, &w, &h);
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(w) * layout_.num_floats;
  std::vector<float> sums;
  sums.reserve(static_cast<std::size_t>(row * h));
  for (int y = y0; y < y0 + h; ++y) sums.insert(sums.end(), record(x0, y), record(x0, y) + row);
  return sums;
}

void Film::put_back_tile_sums(int tile, const std::vector<float>& sums)
{
  int x0, y0, w, h;
  tile_rect(tile, &x0, &y0, &w, &h);
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(w) * layout_.num_floats;
  for (int y = 0; y < h; ++y)
    std::copy_n(sums.begin() + y * row, row, sums_.begin() + (record(x0, y0 + y) - sums_.data()));
}

std::uint32_t Film::pixel_samples(const float* record, int tile) const
{
  return layout_.samples >= 0 ? static_cast<std::uint32_t>(record[layout_.samples]) : tile_samples(tile);
}

float Film::noise(const float* record, int tile, const NoiseRule& rule) const
{
  // Beside the root of the light, or the light itself, so that black is not divided by.
  constexpr float kLeast = 1e-4f;
  // What the halves differ by is that much more than the error that a threshold of that number was found to mean.
  constexpr float kScale = 5.0f;
  const auto sum = [](Vec3f v) { return v.x + v.y + v.z; };
  const PixelEstimate pixel = pixel_estimate(record, pixel_samples(record, tile));
  const bool is_linear = rule.maths == NoiseMaths::k43;
  const float exposure = is_linear ? rule.exposure : 1.0f;
  const float light = std::max(sum(pixel.mean) * exposure, 0.0f);
  const float normal = is_linear && light >= 1.0f ? light : std::sqrt(light);
  return sum(abs(pixel.mean - pixel.even)) * exposure / ((kLeast + normal) * kScale * rule.threshold);
}

std::vector<int> Film::judge(const NoiseRule& rule, std::uint32_t passed)
{
  RELIEF_ASSERT(layout_.samples >= 0);
  const auto width = static_cast<std::size_t>(width_), num_floats = static_cast<std::size_t>(layout_.num_floats);
  const auto rests = [&](std::size_t pixel) -> float& {
    return sums_[pixel * num_floats + static_cast<std::size_t>(layout_.samples) + 1];
  };
  std::vector<std::uint8_t> noisy(num_pixels());
  tbb::parallel_for(0, height_, [&](int y) {
    for (int x = 0; x < width_; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
      noisy[pixel] = rests(pixel) == 0.0f && !(noise(record(x, y), tile_at(x, y), rule) < 1.0f);
    }
  });
  std::vector<std::uint8_t> goes_on(static_cast<std::size_t>(num_tiles()));
  tbb::parallel_for(0, tiles_y_, [&](int tile_y) {
    for (int y = tile_y * kTileSize; y < std::min((tile_y + 1) * kTileSize, height_); ++y) {
      for (int x = 0; x < width_; ++x) {
        bool is_near_noise = false;
        for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height_ - 1); ++v) {
          for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width_ - 1); ++u) {
            is_near_noise =
                is_near_noise || noisy[static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u)] != 0;
          }
        }
        rests(static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)) = is_near_noise ? 0.0f : 1.0f;
        if (is_near_noise) goes_on[static_cast<std::size_t>(tile_at(x, y))] = 1;
      }
    }
  });
  std::vector<int> tiles;
  for (int tile = 0; tile < num_tiles(); ++tile) {
    if (goes_on[static_cast<std::size_t>(tile)] == 0) continue;
    tiles.push_back(tile);
    // Tiles that had come to rest may go on for their neighbours' sake.
    samples_[static_cast<std::size_t>(tile)] = passed;
  }
  return tiles;
}

double Film::samples_to_come(const NoiseRule& rule, const NoiseJudging& judging, std::uint32_t done) const
{
  // A pixel rests once its noise and that of its eight neighbours are below the threshold together. The square of the largest of
  // nine differences of equal spread is below 3.2 times their variance with even chances. Chosen on nine scenes of the benchmark
  // with thresholds of .05 and .01: with 2.8 what was to come was told as .6 to 1.32 of it, at the first look after a tenth of
  // the samples.
  constexpr double kLargestOfNine = 2.8;
  // What two halves of one pixel differ by says little; of the pixels around there are enough, and they are alike.
  constexpr int kBlock = 4;
  const auto goes_on = [&](int x, int y) { return record(x, y)[layout_.samples + 1] == 0.0f; };
  const auto blocks_of = [](int side) { return (side + kBlock - 1) / kBlock; };
  std::vector<double> rows(static_cast<std::size_t>(blocks_of(height_)));
  tbb::parallel_for(0, blocks_of(height_), [&](int row) {
    const int y0 = row * kBlock, y1 = std::min(y0 + kBlock, height_);
    for (int x0 = 0; x0 < width_; x0 += kBlock) {
      const int x1 = std::min(x0 + kBlock, width_);
      double squares = 0;
      int count = 0;
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) {
          if (!goes_on(x, y)) continue;
          const double beside = noise(record(x, y), tile_at(x, y), rule);
          squares += beside * beside;
          ++count;
        }
      }
      if (count == 0) continue;
      // The mean is over all: those that rest make the others' chances better.
      const double needed = done * kLargestOfNine * squares / ((x1 - x0) * (y1 - y0));
      const double judged = std::ceil(needed / judging.step) * judging.step;
      const double most = judging.most;
      const double total =
          judged < most ? std::clamp<double>(judged, std::min<double>(judging.next, most), most) : most;
      rows[static_cast<std::size_t>(row)] += count * (total - done);
    }
  });
  return std::accumulate(rows.begin(), rows.end(), 0.0) / static_cast<double>(num_pixels());
}

ImageError Film::estimate_error() const
{
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  if (std::any_of(samples_.begin(), samples_.end(), [](std::uint32_t n) { return n < 2; })) return {kUnknown, kUnknown};
  struct Sums {
    double d1 = 0, d2 = 0, relative_d1 = 0, relative_d2 = 0;
  };
  const auto sum = [](Vec3f v) { return static_cast<double>(v.x) + v.y + v.z; };
  std::vector<Sums> tiles(samples_.size());
  tbb::parallel_for(0, num_tiles(), [&](int tile) {
    Sums& of_tile = tiles[static_cast<std::size_t>(tile)];
    int x0, y0, w, h;
    tile_rect(tile, &x0, &y0, &w, &h);
    for (int y = y0; y < y0 + h; ++y) {
      for (int x = x0; x < x0 + w; ++x) {
        const PixelEstimate pixel = pixel_estimate(record(x, y), pixel_samples(record(x, y), tile));
        const Vec3f denominator = pixel.mean * pixel.mean + splat3(0.01f);
        of_tile.d1 += sum(pixel.d1);
        of_tile.d2 += sum(pixel.d2);
        of_tile.relative_d1 += sum(pixel.d1 / denominator);
        of_tile.relative_d2 += sum(pixel.d2 / denominator);
      }
    }
  });
  Sums all;
  for (const Sums& tile : tiles) {
    all.d1 += tile.d1;
    all.d2 += tile.d2;
    all.relative_d1 += tile.relative_d1;
    all.relative_d2 += tile.relative_d2;
  }
  const double count = 3.0 * width_ * height_;
  return {std::sqrt(error_extrapolate(all.d1, all.d2) / count),
          error_extrapolate(all.relative_d1, all.relative_d2) / count};
}

Film::TileSpreads Film::tile_spreads(int tile) const
{
  int x0, y0, w, h;
  tile_rect(tile, &x0, &y0, &w, &h);
  TileSpreads spreads;
  for (int y = y0; y < y0 + h; ++y) {
    for (int x = x0; x < x0 + w; ++x) {
      const PixelEstimate pixel = pixel_estimate(record(x, y), pixel_samples(record(x, y), tile));
      const auto add = [&](std::size_t channel, float sample_variance, float d1, float d2) {
        if (!(sample_variance > 0.0f)) return;
        spreads.channels[channel][spread_class(sample_variance)].add({1.0f, sample_variance, d1, d2});
      };
      add(0, pixel.sample_variance.x, pixel.d1.x, pixel.d2.x);
      add(1, pixel.sample_variance.y, pixel.d1.y, pixel.d2.y);
      add(2, pixel.sample_variance.z, pixel.d1.z, pixel.d2.z);
    }
  }
  return spreads;
}

Film::TileLevels Film::tile_levels(const std::array<std::vector<TileSpreads>, 3>& rows, int tile) const
{
  // Fewer pixels leave the level too unsure, and the z of pixels with too long tails.
  constexpr float kEnoughPixels = 64;
  const int tile_x = tile % tiles_x_;
  TileSpreads around{};
  for (std::size_t row = 0; row < rows.size(); ++row) {
    if (rows[row].empty()) continue;
    for (int x = std::max(tile_x - 1, 0); x <= std::min(tile_x + 1, tiles_x_ - 1); ++x) {
      // The level depends on the number of samples.
      const int neighbour = tile + (static_cast<int>(row) - 1) * tiles_x_ + x - tile_x;
      if (tile_samples(neighbour) != tile_samples(tile)) continue;
      for (std::size_t channel = 0; channel < 3; ++channel) {
        for (std::size_t i = 0; i < kNumSpreads; ++i) {
          around.channels[channel][i].add(rows[row][static_cast<std::size_t>(x)].channels[channel][i]);
        }
      }
    }
  }
  const TileSpreads& own = rows[1][static_cast<std::size_t>(tile_x)];
  TileLevels levels{};
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const std::array<SpreadSums, kNumSpreads>& classes = around.channels[channel];
    for (std::size_t i = 0; i < kNumSpreads; ++i) {
      if (!(own.channels[channel][i].num_pixels > 0)) continue;
      SpreadSums like = classes[i];
      for (std::size_t reach = 1; reach < kNumSpreads && (reach == 1 || like.num_pixels < kEnoughPixels); ++reach) {
        if (i >= reach) like.add(classes[i - reach]);
        if (i + reach < kNumSpreads) like.add(classes[i + reach]);
      }
      levels.channels[channel][i] = static_cast<float>(error_extrapolate(like.d1, like.d2)) / like.sample_variance;
    }
  }
  return levels;
}

void Film::resolve_pixel(const float* in,
                         std::uint32_t samples,
                         const TileLevels& levels,
                         const FilmLayout& out,
                         float exposure,
                         float* to) const
{
  const PixelEstimate pixel = pixel_estimate(in, samples);
  const auto plane = [&](Aov aov) -> float* {
    const int offset = out.offset[static_cast<std::size_t>(aov)];
    return offset < 0 ? nullptr : to + offset;
  };
  const auto put3 = [](float* p, Vec3f v) {
    p[0] = v.x;
    p[1] = v.y;
    p[2] = v.z;
  };
  const auto count = static_cast<float>(samples);
  const float inverse_n = 1.0f / count;
  const float light = exposure * inverse_n;
  const float hits = in[AccumulatorLayout::kCoverage];
  const float inverse_hits = hits > 0.0f ? 1.0f / hits : 0.0f;
  if (float* p = plane(Aov::kBeauty)) {
    put3(p, shown(in, pixel.mean, count, CatcherSums::kAll) * exposure);
    p[3] = alpha(in, samples);
  }
  if (float* p = plane(Aov::kDirect)) put3(p, load3(in + layout_.direct) * light);
  if (float* p = plane(Aov::kIndirect)) {
    put3(p, without_catchers(in, pixel.mean, count, CatcherSums::kAll) * exposure - load3(in + layout_.direct) * light);
  }
  if (float* p = plane(Aov::kAlbedo)) put3(p, load3(in + layout_.albedo) * inverse_n);
  if (float* p = plane(Aov::kNormal)) put3(p, load3(in + layout_.normal) * inverse_n);
  if (float* p = plane(Aov::kDepth)) p[0] = hits > 0.0f ? in[layout_.depth] * inverse_hits : kInfinity;
  if (float* p = plane(Aov::kPosition)) put3(p, load3(in + layout_.position) * inverse_hits);
  if (float* p = plane(Aov::kUv)) {
    p[0] = in[layout_.uv] * inverse_hits;
    p[1] = in[layout_.uv + 1] * inverse_hits;
  }
  if (float* p = plane(Aov::kObjectId)) p[0] = in[layout_.object_id];
  if (float* p = plane(Aov::kMaterialId)) p[0] = in[layout_.material_id];
  if (float* p = plane(Aov::kSampleCount)) p[0] = static_cast<float>(samples);
  if (float* p = plane(Aov::kVariance)) {
    const Vec3f spread = pixel.sample_variance;
    const auto level = [&](std::size_t channel, float v) { return levels.channels[channel][spread_class(v)]; };
    const Vec3f variance = spread * Vec3f{level(0, spread.x), level(1, spread.y), level(2, spread.z)} * sqr(exposure);
    put3(p, variance * variance_shown(in, samples));
  }
  if (float* p = plane(Aov::kHalf)) {
    const auto half = static_cast<float>((samples + 1) / 2);
    put3(p, shown(in, pixel.even, half, CatcherSums::kEven) * exposure);
  }
  if (float* p = plane(Aov::kDisplacementSteps)) p[0] = in[layout_.displacement_steps] * inverse_n;
  if (float* p = plane(Aov::kCaustic)) put3(p, load3(in + layout_.caustic) * light);
  if (float* p = plane(Aov::kHoldout)) p[0] = in[layout_.holdout] * inverse_n;
  if (float* p = plane(Aov::kShadowCatcher)) put3(p, shadow_catcher(in, samples));
  if (float* p = plane(Aov::kMist)) p[0] = 1.0f - in[layout_.mist] * inverse_n;
  if (float* p = plane(Aov::kEmission)) put3(p, load3(in + layout_.emission) * light);
  if (float* p = plane(Aov::kEnvironment)) put3(p, load3(in + layout_.environment) * light);
  if (float* p = plane(Aov::kAmbientOcclusion)) p[0] = in[layout_.ambient_occlusion] * inverse_n;
  if (float* p = plane(Aov::kDenoisingAlbedo)) put3(p, load3(in + layout_.denoising_albedo) * inverse_n);
  if (float* p = plane(Aov::kDenoisingNormal)) put3(p, load3(in + layout_.denoising_normal) * inverse_n);
  if (float* p = plane(Aov::kDenoisingDepth)) p[0] = in[layout_.denoising_depth] * inverse_n;
  if (float* p = plane(Aov::kDenoisingHalf)) {
    const float inverse_half = 1.0f / static_cast<float>((samples + 1) / 2);
    for (int i = 0; i < 7; ++i) p[i] = in[layout_.denoising_half + i] * inverse_half;
  }
  if (float* p = plane(Aov::kVolumeDirect)) put3(p, load3(in + layout_.volume_direct) * light);
  if (float* p = plane(Aov::kVolumeIndirect)) put3(p, load3(in + layout_.volume_indirect) * light);
  if (float* p = plane(Aov::kLightGroups)) {
    for (int i = 0; i < 3 * num_light_groups_; ++i) p[i] = in[layout_.light_groups + i] * light;
  }
  for (int i = 0; i < kNumLightPasses; ++i) {
    if (float* p = plane(light_pass_aov(i))) put3(p, load3(in + layout_.light_passes[i]) * light);
  }
  for (int i = 0; i < kNumEventKinds; ++i) {
    if (float* p = plane(event_color_aov(i))) put3(p, load3(in + layout_.event_colors[i]) * inverse_n);
  }
  for (int i = 0; i < kNumCryptomattes; ++i) {
    float* p = plane(static_cast<Aov>(kFirstCryptomatte + i));
    if (p != nullptr) put_cryptomatte(in + layout_.cryptomatte[i], layout_.cryptomatte_levels, inverse_n, p);
  }
}

float Film::coverage(const float* record, std::uint32_t samples) const
{
  const float clear = layout_.clear >= 0 ? record[layout_.clear] : 0.0f;
  return std::clamp((record[AccumulatorLayout::kCoverage] - clear) / static_cast<float>(samples), 0.0f, 1.0f);
}

float Film::alpha(const float* record, std::uint32_t samples) const
{
  const float covered = coverage(record, samples);
  if (layout_.catcher < 0 || layout_.shadow_catcher) return covered;
  const float* sums = record + layout_.catcher;
  const float shadow = 1.0f - unshadowed(sums + CatcherSums::kAll);
  return std::min(covered + sums[CatcherSums::kShare] * shadow / static_cast<float>(samples), 1.0f);
}

Vec3f Film::without_catchers(const float* record, Vec3f mean, float count, int part) const
{
  if (layout_.catcher < 0 || record[layout_.catcher + CatcherSums::kShare] == 0.0f) return mean;
  // Where catchers are all that is seen the two sums are of the same numbers in the same order: nothing is left.
  return max(mean - load3(record + layout_.catcher + part + CatcherSums::kCaught) / count, Vec3f{});
}

Vec3f Film::shown(const float* record, Vec3f mean, float count, int part) const
{
  const Vec3f light = without_catchers(record, mean, count, part);
  if (layout_.catcher < 0 || layout_.shadow_catcher) return light;
  const float* sums = record + layout_.catcher + part;
  return light + load3(sums + CatcherSums::kBackdrop) * (unshadowed(sums) / count);
}

Vec3f Film::shadow_catcher(const float* record, std::uint32_t samples) const
{
  if (layout_.catcher < 0) return splat3(1.0f);
  const float* sums = record + layout_.catcher;
  const float share = sums[CatcherSums::kShare] / static_cast<float>(samples);
  if (!(share > 0.0f)) return splat3(1.0f);
  const float nothing = std::max(1.0f - coverage(record, samples) - share, 0.0f);
  return (share * light_left(sums + CatcherSums::kAll) + splat3(nothing)) / (share + nothing);
}

Vec3f Film::variance_shown(const float* record, std::uint32_t samples) const
{
  if (layout_.catcher < 0) return splat3(1.0f);
  const float* sums = record + layout_.catcher;
  const float share = std::min(sums[CatcherSums::kShare] / static_cast<float>(samples), 1.0f);
  const Vec3f alone = load3(sums + CatcherSums::kAll + CatcherSums::kAlone);
  const Vec3f backdrop = layout_.shadow_catcher ? Vec3f{} : load3(sums + CatcherSums::kAll + CatcherSums::kBackdrop);
  const auto scale = [&](float behind, float light) {
    return 1.0f - share + (light > 0.0f ? share * std::min(sqr(behind / light), kMostVarianceScale) : 0.0f);
  };
  return {scale(backdrop.x, alone.x), scale(backdrop.y, alone.y), scale(backdrop.z, alone.z)};
}

FilmView Film::window(AovMask aov_mask, int crop_x, int crop_y, int full_width, int full_height) const
{
  FilmView view;
  view.layout = film_layout_make(aov_mask, layout_.cryptomatte_levels, num_light_groups_);
  view.width = width_;
  view.height = height_;
  view.crop_x = crop_x;
  view.crop_y = crop_y;
  view.full_width = full_width;
  view.full_height = full_height;
  return view;
}

RenderedImage Film::beauty(int crop_x, int crop_y, int full_width, int full_height, float exposure) const
{
  RenderedImage picture;
  picture.view = window(aov_bit(Aov::kBeauty), crop_x, crop_y, full_width, full_height);
  picture.pixels.resize(num_pixels() * 4);
  picture.view.pixels = picture.pixels.data();
  tbb::parallel_for(0, height_, [&](int y) {
    float* to = picture.pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) * 4;
    for (int x = 0; x < width_; ++x, to += 4) {
      const float* sums = record(x, y);
      const std::uint32_t samples = pixel_samples(sums, tile_at(x, y));
      if (samples == 0) continue;
      const float inverse_n = 1.0f / static_cast<float>(samples);
      const Vec3f sum = shown(sums, load3(sums + AccumulatorLayout::kBeauty), 1.0f, CatcherSums::kAll);
      to[0] = sum.x * (exposure * inverse_n);
      to[1] = sum.y * (exposure * inverse_n);
      to[2] = sum.z * (exposure * inverse_n);
      to[3] = alpha(sums, samples);
    }
  });
  return picture;
}

RenderedImage Film::resolve(int crop_x, int crop_y, int full_width, int full_height, float exposure) &&
{
  RenderedImage picture;
  picture.view = window(aov_mask_, crop_x, crop_y, full_width, full_height);
  const FilmLayout& out = picture.view.layout;
  const auto num_in = static_cast<std::size_t>(layout_.num_floats), num_out = static_cast<std::size_t>(out.num_floats);
  const bool has_variance = out.offset[static_cast<std::size_t>(Aov::kVariance)] >= 0;
  const auto row_spreads = [&](int tile_y) {
    std::vector<TileSpreads> row(has_variance && tile_y < tiles_y_ ? static_cast<std::size_t>(tiles_x_) : 0u);
    tbb::parallel_for(std::size_t{0}, row.size(),
                      [&](std::size_t x) { row[x] = tile_spreads(tile_y * tiles_x_ + static_cast<int>(x)); });
    return row;
  };
  // Above, at and below the row of tiles that is written.
  std::array<std::vector<TileSpreads>, 3> rows{{{}, {}, row_spreads(0)}};
  std::vector<TileLevels> levels(static_cast<std::size_t>(tiles_x_));
  std::vector<float> sums(num_in);
  for (int tile_y = 0; tile_y < tiles_y_; ++tile_y) {
    rows[0] = std::move(rows[1]);
    rows[1] = std::move(rows[2]);
    rows[2] = row_spreads(tile_y + 1);
    tbb::parallel_for(std::size_t{0}, rows[1].size(),
                      [&](std::size_t x) { levels[x] = tile_levels(rows, tile_y * tiles_x_ + static_cast<int>(x)); });
    // A pixel's planes are no more floats than its sums, so pixel after pixel is written where sums have been read.
    for (int y = tile_y * kTileSize; y < std::min((tile_y + 1) * kTileSize, height_); ++y) {
      for (int x = 0; x < width_; ++x) {
        const std::size_t pixel =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
        const int tile_x = x / kTileSize;
        const auto from = sums_.begin() + static_cast<std::ptrdiff_t>(pixel * num_in);
        std::copy(from, from + layout_.num_floats, sums.begin());
        const std::uint32_t samples = pixel_samples(sums.data(), tile_y * tiles_x_ + tile_x);
        float* to = sums_.data() + pixel * num_out;
        std::fill(to, to + num_out, 0.0f);
        if (samples == 0) continue;
        resolve_pixel(sums.data(), samples, levels[static_cast<std::size_t>(tile_x)], out, exposure, to);
      }
    }
  }
  sums_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_) * num_out);
  picture.pixels = std::move(sums_);
  picture.view.pixels = picture.pixels.data();
  return picture;
}

}  // namespace relief
