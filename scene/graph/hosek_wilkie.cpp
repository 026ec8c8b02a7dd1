#include "scene/graph/hosek_wilkie.h"

#include <algorithm>
#include <cmath>

namespace relief {
namespace {

constexpr int kTurbidities = 10, kKnots = 6, kNumbers = 9;
constexpr double kDistribution[3][2 * kTurbidities * kKnots * kNumbers] = {
#define DISTRIBUTION
#include "scene/graph/hosek_wilkie.inc"
#undef DISTRIBUTION
};
constexpr double kRadiance[3][2 * kTurbidities * kKnots] = {
#define RADIANCE
#include "scene/graph/hosek_wilkie.inc"
#undef RADIANCE
};

/// What the tables say of one number, of which there are `count` at each knot.
double interpolated(const double* table, int count, int number, double turbidity, double albedo, double x)
{
  const double y = 1 - x;
  const double bernstein[kKnots] = {y * y * y * y * y,      5 * y * y * y * y * x, 10 * y * y * y * x * x,
                                    10 * y * y * x * x * x, 5 * y * x * x * x * x, x * x * x * x * x};
  const auto at = [&](int white, int row) {
    double sum = 0;
    for (int k = 0; k < kKnots; ++k) {
      sum += bernstein[k] * table[((white * kTurbidities + row) * kKnots + k) * count + number];
    }
    return sum;
  };
  const int row = std::min(static_cast<int>(turbidity) - 1, kTurbidities - 2);
  const double rest = turbidity - 1 - row;
  const auto with_ground = [&](int r) { return (1 - albedo) * at(0, r) + albedo * at(1, r); };
  return (1 - rest) * with_ground(row) + rest * with_ground(row + 1);
}

}  // namespace

HosekWilkieSky hosek_wilkie_make(float turbidity, float albedo, float elevation)
{
  const double t = std::clamp(turbidity, 1.0f, 10.0f), ground = std::clamp(albedo, 0.0f, 1.0f);
  const double x = std::cbrt(std::max(0.0, static_cast<double>(elevation)) / (3.141592653589793 / 2));
  HosekWilkieSky sky;
  for (int c = 0; c < 3; ++c) {
    const auto number = [&](int n) {
      return static_cast<float>(interpolated(kDistribution[c], kNumbers, n, t, ground, x));
    };
    sky.xyz[c] = {
        number(0), number(1), number(2), number(3), number(4),
        number(5), number(6), number(7), number(8), static_cast<float>(interpolated(kRadiance[c], 1, 0, t, ground, x))};
  }
  return sky;
}

}  // namespace relief
