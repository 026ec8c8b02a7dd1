#include "benchmarks/displacement/maps.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

namespace relief {

namespace {

constexpr double kTwoPi = 6.283185307179586;

/// Bits that look random, of a lattice point.
std::uint32_t hash(std::uint32_t x, std::uint32_t y, std::uint32_t seed)
{
  std::uint32_t h = x * 0x9e3779b1u ^ (y * 0x85ebca77u + seed * 0xc2b2ae3du);
  h = (h ^ h >> 15) * 0x2c1b3c6du;
  h = (h ^ h >> 12) * 0x297a2d39u;
  return h ^ h >> 15;
}

/// In [0, 1).
double hash_unit(std::uint32_t x, std::uint32_t y, std::uint32_t seed) { return hash(x, y, seed) * 0x1p-32; }

std::uint32_t wrapped(int i, int period) { return static_cast<std::uint32_t>((i % period + period) % period); }

double smooth_step(double low, double high, double x)
{
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// Smooth noise in [0, 1] on a lattice of `period` points a side that repeats with the map.
double value_noise(double u, double v, int period, std::uint32_t seed)
{
  const double x = u * period, y = v * period;
  const double i = std::floor(x), j = std::floor(y);
  const double fx = smooth_step(0, 1, x - i), fy = smooth_step(0, 1, y - j);
  const auto at = [&](int di, int dj) {
    return hash_unit(wrapped(static_cast<int>(i) + di, period), wrapped(static_cast<int>(j) + dj, period), seed);
  };
  const double low = at(0, 0) + fx * (at(1, 0) - at(0, 0)), high = at(0, 1) + fx * (at(1, 1) - at(0, 1));
  return low + fy * (high - low);
}

/// Octaves of noise, each twice as fine as the one before and `gain` times as high; in [0, 1].
double octaves(double u, double v, int period, int count, double gain, std::uint32_t seed)
{
  double sum = 0, weight = 1, whole = 0;
  for (int k = 0; k < count; ++k) {
    sum += weight * value_noise(u, v, period << k, seed + static_cast<std::uint32_t>(k));
    whole += weight;
    weight *= gain;
  }
  return sum / whole;
}

/// Distances to the nearest and the second nearest of random points, one a lattice cell, in cells.
struct Cellular {
  double nearest = 9, second = 9;
  double random = 0;  ///< of the nearest point
};

Cellular cellular(double u, double v, int period, std::uint32_t seed)
{
  const double x = u * period, y = v * period;
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  Cellular result;
  for (int dj = -1; dj <= 1; ++dj) {
    for (int di = -1; di <= 1; ++di) {
      const std::uint32_t a = wrapped(i + di, period), b = wrapped(j + dj, period);
      const double px = i + di + hash_unit(a, b, seed), py = j + dj + hash_unit(a, b, seed + 1);
      const double distance = std::hypot(px - x, py - y);
      if (distance < result.nearest) {
        result.second = result.nearest;
        result.nearest = distance;
        result.random = hash_unit(a, b, seed + 2);
      } else {
        result.second = std::min(result.second, distance);
      }
    }
  }
  return result;
}

double dome(double distance, double radius)
{
  return std::sqrt(std::max(0.0, 1 - distance * distance / (radius * radius)));
}

double domes(double u, double v)
{
  const Cellular large = cellular(u, v, 6, 1), small = cellular(u, v, 22, 9);
  const double base = dome(large.nearest, 0.35 + 0.35 * large.random);
  return 0.6 * base + 0.25 * dome(small.nearest, 0.5) + 0.15 * octaves(u, v, 32, 5, 0.5, 3);
}

double woven(double u, double v)
{
  constexpr int kStrands = 8;
  // Over and under alternate like the fields of a chess board; each strand is a half tube of fibres.
  const double x = u * kStrands, y = v * kStrands;
  const double across_x = x - std::floor(x) - 0.5, across_y = y - std::floor(y) - 0.5;
  const bool odd = (static_cast<int>(std::floor(x)) + static_cast<int>(std::floor(y))) % 2 != 0;
  const double along = 0.5 + 0.5 * std::cos(kTwoPi * 0.5 * (odd ? across_y : across_x) * 2);
  const double over = dome(odd ? across_x : across_y, 0.46) * (0.6 + 0.4 * along);
  const double under = dome(odd ? across_y : across_x, 0.46) * 0.35;
  const double fibre = value_noise(u, v, odd ? 512 : 256, 5) * 0.06 + 0.05 * std::sin(kTwoPi * 12 * (odd ? x : y));
  return std::max(over, under) + fibre;
}

double hide(double u, double v)
{
  const double folds = std::abs(octaves(u, v, 5, 3, 0.5, 11) - 0.5) * 2;
  const Cellular scales = cellular(u + 0.01 * octaves(u, v, 16, 2, 0.5, 17), v, 90, 13);
  return 0.55 * std::sqrt(folds) + 0.25 * smooth_step(0.02, 0.4, scales.second - scales.nearest) +
         0.2 * octaves(u, v, 128, 4, 0.6, 19);
}

double panels(double u, double v)
{
  const Cellular plates = cellular(u, v, 5, 23);
  const double plate = smooth_step(0.02, 0.06, plates.second - plates.nearest) * (0.5 + 0.3 * plates.random);
  const double rx = u * 40 - std::floor(u * 40) - 0.5, ry = v * 40 - std::floor(v * 40) - 0.5;
  const bool rivet = plates.second - plates.nearest > 0.1 && plates.second - plates.nearest < 0.3;
  return plate + (rivet ? 0.2 * dome(std::hypot(rx, ry), 0.25) : 0.0) + 0.04 * octaves(u, v, 128, 4, 0.6, 29);
}

double hammered(double u, double v)
{
  const Cellular dents = cellular(u, v, 18, 31);
  return 0.6 * dents.nearest * dents.nearest + 0.3 * octaves(u, v, 4, 4, 0.5, 37) +
         0.1 * octaves(u, v, 200, 3, 0.6, 41);
}

double engraved(double u, double v)
{
  const double bend = 0.08 * (octaves(u, v, 3, 3, 0.5, 43) - 0.5);
  const double a = std::sin(kTwoPi * (7 * u + 3 * std::sin(kTwoPi * (v + bend)))) *
                   std::sin(kTwoPi * (6 * v + 2 * std::sin(kTwoPi * 2 * (u + bend))));
  return 0.8 * smooth_step(-0.15, 0.15, a) + 0.2 * octaves(u, v, 100, 5, 0.55, 47);
}

double rock(double u, double v)
{
  double sum = 0, weight = 1, whole = 0;
  for (int k = 0; k < 8; ++k) {
    const double n = value_noise(u, v, 4 << k, 53 + static_cast<std::uint32_t>(k));
    sum += weight * (1 - std::abs(2 * n - 1));
    whole += weight;
    weight *= 0.52;
  }
  return sum / whole;
}

double roof(double u, double v)
{
  constexpr int kColumns = 10, kRows = 8;
  const double y = v * kRows;
  const double row = std::floor(y), ramp = y - row;
  const double x = u * kColumns + (static_cast<int>(row) % 2 != 0 ? 0.5 : 0.0);
  const auto tile = static_cast<int>(std::floor(x));
  const double age = hash_unit(wrapped(tile, kColumns), wrapped(static_cast<int>(row), kRows), 61);
  const double barrel = dome(x - std::floor(x) - 0.5, 0.52);
  return 0.45 * ramp + 0.4 * barrel + 0.08 * age + 0.07 * octaves(u, v, 64, 5, 0.6, 67);
}

double dunes(double u, double v)
{
  const double bend = octaves(u, v, 4, 4, 0.5, 71);
  const double ripples = 0.5 + 0.5 * std::sin(kTwoPi * (24 * u + 2.5 * bend));
  const Cellular pebbles = cellular(u, v, 60, 73);
  const double pebble = pebbles.random > 0.6 ? dome(pebbles.nearest, 0.3 * pebbles.random) : 0.0;
  return 0.45 * bend + 0.25 * ripples * ripples + 0.2 * pebble + 0.1 * octaves(u, v, 256, 3, 0.6, 79);
}

double waves(double u, double v)
{
  return 0.4 + 0.2 * std::sin(kTwoPi * (5 * u + 2 * v)) + 0.15 * std::sin(kTwoPi * (11 * v - 3 * u)) +
         0.25 * octaves(u, v, 12, 4, 0.45, 83);
}

double height(BenchMap kind, double u, double v)
{
  switch (kind) {
    case BenchMap::kDomes:
      return domes(u, v);
    case BenchMap::kWoven:
      return woven(u, v);
    case BenchMap::kHide:
      return hide(u, v);
    case BenchMap::kPanels:
      return panels(u, v);
    case BenchMap::kHammered:
      return hammered(u, v);
    case BenchMap::kEngraved:
      return engraved(u, v);
    case BenchMap::kRock:
      return rock(u, v);
    case BenchMap::kRoof:
      return roof(u, v);
    case BenchMap::kDunes:
      return dunes(u, v);
    case BenchMap::kWaves:
      break;
  }
  return waves(u, v);
}

}  // namespace

std::vector<std::uint16_t> bench_map_make(BenchMap kind, int size)
{
  const auto side = static_cast<std::size_t>(size);
  std::vector<std::uint16_t> texels(side * side);
  tbb::parallel_for(std::size_t{0}, side, [&](std::size_t y) {
    const double v = (static_cast<double>(y) + 0.5) / size;
    for (std::size_t x = 0; x < side; ++x) {
      const double h = height(kind, (static_cast<double>(x) + 0.5) / size, v);
      texels[y * side + x] = static_cast<std::uint16_t>(std::lround(65535 * std::clamp(h, 0.0, 1.0)));
    }
  });
  return texels;
}

}  // namespace relief
