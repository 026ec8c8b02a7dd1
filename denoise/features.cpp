#include "denoise/features.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "denoise/plane.h"

namespace relief {

namespace {

constexpr int kTile = 32, kReach = 3, kPatch = 1, kSide = kTile + 2 * kPatch;

/// Features that are filtered together.
struct Group {
  std::size_t first, count;
};
constexpr Group kGroups[] = {{0, 3}, {3, 3}, {6, 1}};

struct GroupPlanes {
  GroupPlanes(std::size_t count, int width, int height)
  {
    for (std::vector<Plane>* planes : {&half[0], &half[1], &variance, &emission[0], &emission[1]}) {
      planes->assign(count, Plane(width, height));
    }
  }
  std::array<std::vector<Plane>, 2> half;
  std::vector<Plane> variance;  ///< of a half
  /// What is not filtered: the part of an albedo above 1, which is an emitter's light. It is in the colour as it is in the
  /// feature, noise and all, so that it tells the colour exactly; filtered, small lamps became blobs.
  std::array<std::vector<Plane>, 2> emission;
};

float finite_or_0(float x) { return std::isfinite(x) ? x : 0.0f; }

GroupPlanes group_load(const DenoiseInput& input, Group group)
{
  GroupPlanes planes(group.count, input.width, input.height);
  for (std::size_t i = 0; i < group.count; ++i) {
    const PlaneView mean = input.features[group.first + i], half = input.features_half[group.first + i];
    tbb::parallel_for(0, input.height, [&](int y) {
      for (int x = 0; x < input.width; ++x) {
        const float all = finite_or_0(mean.at(x, y)), even_share = even_share_of(input.samples.at(x, y));
        const bool has_halves = even_share < 1;
        const float even = half.first == nullptr || !has_halves ? all : finite_or_0(half.at(x, y));
        const float odd = has_halves ? (all - even_share * even) / (1.0f - even_share) : all;
        const std::array<float, 2> values = {even, odd};
        for (std::size_t of = 0; of < 2; ++of) {
          const float emission = group.first == 0 ? std::max(values[of] - 1.0f, 0.0f) : 0.0f;
          planes.emission[of][i].row(y)[x] = emission;
          planes.half[of][i].row(y)[x] = values[of] - emission;
        }
        const float difference = planes.half[0][i].row(y)[x] - planes.half[1][i].row(y)[x];
        planes.variance[i].row(y)[x] = 0.5f * difference * difference;
      }
    });
    box_filter(planes.variance[i], 1);
    for (Plane* plane : {&planes.half[0][i], &planes.half[1][i], &planes.variance[i]}) plane->extend();
  }
  return planes;
}

/// Whether nothing is to be filtered in a tile.
bool is_certain(const GroupPlanes& planes, int x0, int y0)
{
  for (const Plane& variance : planes.variance) {
    for (int y = y0; y < y0 + kTile; ++y) {
      const float* row = variance.row(y) + x0;
      if (std::any_of(row, row + kTile, [](float v) { return v > 0; })) return false;
    }
  }
  return true;
}

/// Filters a tile of one half by weights from the other.
/// @param to  the tile's pixels, row by row, of feature after feature
void filter_tile(const GroupPlanes& planes, std::size_t half, int x0, int y0, float* to)
{
  const std::size_t count = planes.variance.size();
  const std::vector<Plane>& guide = planes.half[1 - half];
  std::array<std::array<float, kSide>, kSide> difference;
  std::array<float, kTile * kTile> weights{};
  std::fill_n(to, count * kTile * kTile, 0.0f);
  for (int dy = -kReach; dy <= kReach; ++dy) {
    for (int dx = -kReach; dx <= kReach; ++dx) {
      for (auto& row : difference) row.fill(0);
      for (std::size_t i = 0; i < count; ++i) {
        for (int y = 0; y < kSide; ++y) {
          const int at = y0 + y - kPatch;
          const float *a = guide[i].row(at) + x0 - kPatch, *b = guide[i].row(at + dy) + x0 - kPatch + dx;
          const float *v = planes.variance[i].row(at) + x0 - kPatch,
                      *w = planes.variance[i].row(at + dy) + x0 - kPatch + dx;
          float* sum = difference[static_cast<std::size_t>(y)].data();
          for (int x = 0; x < kSide; ++x) {
            constexpr float kLeastVariance = 1e-8f;
            const float d = a[x] - b[x];
            sum[x] += std::min((d * d - (v[x] + std::min(v[x], w[x]))) / (v[x] + w[x] + kLeastVariance), 1000.0f);
          }
        }
      }
      for (int y = 0; y < kTile; ++y) {
        std::array<float, kTile> weight;
        const auto row = static_cast<std::size_t>(y);
        for (std::size_t x = 0; x < kTile; ++x) {
          float sum = 0;
          for (std::size_t i = 0; i <= 2 * kPatch; ++i) {
            for (std::size_t j = 0; j <= 2 * kPatch; ++j) sum += difference[row + i][x + j];
          }
          const float d = sum / static_cast<float>(count * (2 * kPatch + 1) * (2 * kPatch + 1));
          const float a = std::clamp(1.0f - 0.125f * d, 0.0f, 1.0f), a2 = a * a, a4 = a2 * a2;
          weight[x] = a4 * a4;
          weights[row * kTile + x] += weight[x];
        }
        for (std::size_t i = 0; i < count; ++i) {
          const float* from = planes.half[half][i].row(y0 + y + dy) + x0 + dx;
          float* sum = to + (i * kTile + row) * kTile;
          for (std::size_t x = 0; x < kTile; ++x) sum[x] += weight[x] * from[x];
        }
      }
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < weights.size(); ++k) to[i * weights.size() + k] /= weights[k];
  }
}

/// Puts the columns of one group into place.
void group_filter(const DenoiseInput& input, Group group, std::array<FeatureColumns, 2>& columns)
{
  const GroupPlanes planes = group_load(input, group);
  const int tiles_x = (input.width + kTile - 1) / kTile, tiles_y = (input.height + kTile - 1) / kTile;
  tbb::parallel_for(0, tiles_x * tiles_y, [&](int tile) {
    denoise_check_stop(input);
    const int x0 = tile % tiles_x * kTile, y0 = tile / tiles_x * kTile;
    std::array<std::array<float, 3 * kTile * kTile>, 2> filtered;
    const bool is_filtered = !is_certain(planes, x0, y0);
    if (is_filtered) {
      for (std::size_t half = 0; half < 2; ++half) filter_tile(planes, half, x0, y0, filtered[half].data());
    }
    for (int y = y0; y < std::min(y0 + kTile, input.height); ++y) {
      for (int x = x0; x < std::min(x0 + kTile, input.width); ++x) {
        const std::size_t pixel =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(input.width) + static_cast<std::size_t>(x);
        for (std::size_t i = 0; i < group.count; ++i) {
          const auto at = (i * kTile + static_cast<std::size_t>(y - y0)) * kTile + static_cast<std::size_t>(x - x0);
          const auto value = [&](std::size_t half) {
            return planes.emission[half][i].row(y)[x] +
                   (is_filtered ? filtered[half][at] : planes.half[half][i].row(y)[x]);
          };
          const float even = value(0), odd = value(1);
          const std::size_t to = pixel * 8 + 1 + group.first + i;
          columns[0].value[to] = even;
          columns[1].value[to] = odd;
          for (FeatureColumns& of_half : columns) of_half.noise[to] = 0.5f * (even - odd) * (even - odd);
        }
      }
    }
  });
}

/// Variance of feature i that means nothing: of differences below a thousandth of what it is in the whole picture.
float least_noise(const std::vector<float>& values, std::size_t i)
{
  constexpr double kLeastNoise = 1e-6;
  double squares = 0;
  for (std::size_t at = i; at < values.size(); at += 8) {
    squares += static_cast<double>(values[at]) * static_cast<double>(values[at]);
  }
  return static_cast<float>(8 * kLeastNoise * squares / static_cast<double>(values.size()) + 1e-30);
}

}  // namespace

std::array<FeatureColumns, 2> features_filter(const DenoiseInput& input)
{
  const std::size_t num_pixels = static_cast<std::size_t>(input.width) * static_cast<std::size_t>(input.height);
  std::array<FeatureColumns, 2> columns;
  for (FeatureColumns& of_half : columns) {
    of_half.value.resize(8 * num_pixels);
    of_half.noise.resize(8 * num_pixels);
    for (std::size_t pixel = 0; pixel < num_pixels; ++pixel) of_half.value[8 * pixel] = 1;
  }
  for (const Group group : kGroups) group_filter(input, group, columns);
  for (FeatureColumns& of_half : columns) {
    for (std::size_t i = 1; i <= kNumFeatures; ++i) {
      const float least = least_noise(of_half.value, i);
      for (std::size_t at = i; at < of_half.noise.size(); at += 8) of_half.noise[at] += least;
    }
  }
  return columns;
}

}  // namespace relief
