// Noise, cells and terrain in double precision, one point at a time and as their definitions say it: what the kernel's
// eight lanes are compared with. Shares no code with them.
#pragma once

#include <array>
#include <vector>

namespace relief::oracle {

/// Bob Jenkins' lookup3 of numbers' bits, in [0, 1].
/// @param key  1 to 4 numbers
double hash_unit(const std::vector<float>& key);

/// Perlin's gradient noise over 1 to 4 coordinates, signed.
double noise_signed(const std::vector<double>& p);

/// Octaves of it.
double noise_fractal(const std::vector<double>& p, double detail, double roughness, double lacunarity, bool normalize);

enum class Terrain { kMultifractal, kFbm, kHybrid, kRidged, kHetero };
double terrain(Terrain kind,
               const std::vector<double>& p,
               double octaves,
               double falloff,
               double lacunarity,
               double offset,
               double gain);

enum class Cells { kNearest, kSecond, kSmooth, kEdge, kRadius };
enum class Metric { kEuclidean, kManhattan, kChebychev, kMinkowski };
struct CellSettings {
  Cells cells;
  Metric metric;
  double smoothness, exponent, randomness;
};
struct Cell {
  double distance = 0;               ///< or radius
  std::array<double, 3> color{};     ///< of kNearest, kSecond and kSmooth, as position is
  std::array<double, 4> position{};  ///< as many as there are coordinates
  double margin = 1;  ///< how much further away the next candidate is: where it is little, rounding decides
};
Cell cells(const std::vector<double>& p, const CellSettings& settings);

}  // namespace relief::oracle
