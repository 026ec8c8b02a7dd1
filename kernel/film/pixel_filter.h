// Pixel filters by importance sampling: a sample belongs to one pixel, and its position follows the filter.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// As long as Cycles': what is between two entries is spread evenly, and the outermost of a Gaussian are far apart.
inline constexpr int kFilterTableSize = 1024;

/// Inverse of the filter's cumulative distribution on [−½, ½], at i / kFilterTableSize.
struct FilterTable {
  float inverse_cdf[kFilterTableSize + 1] = {};
};

/// 4-term Blackman–Harris window over [−½, ½].
/// @source Harris 1978, "On the use of windows for harmonic analysis with the discrete Fourier transform", Table 1
RELIEF_KERNEL double blackman_harris(double x)
{
  const double a = 6.283185307179586 * (x + 0.5);
  return 0.35875 - 0.48829 * std::cos(a) + 0.14128 * std::cos(2 * a) - 0.01168 * std::cos(3 * a);
}

/// Gaussian over [−½, ½], which ends at six standard deviations.
RELIEF_KERNEL double gaussian(double x) { return std::exp(-72 * x * x); }

/// @param filter  positive inside of (−½, ½)
template <typename Filter>
RELIEF_KERNEL void filter_table_make(Filter filter, FilterTable& table)
{
  constexpr int kSteps = 1 << 14;
  double total = 0;
  for (int i = 0; i < kSteps; ++i) total += filter((i + 0.5) / kSteps - 0.5);
  double sum = 0;
  int entry = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double next = sum + filter((i + 0.5) / kSteps - 0.5) / total;
    while (entry <= kFilterTableSize && static_cast<double>(entry) / kFilterTableSize <= next) {
      const double within = (static_cast<double>(entry) / kFilterTableSize - sum) / (next - sum);
      table.inverse_cdf[entry++] = static_cast<float>((i + within) / kSteps - 0.5);
    }
    sum = next;
  }
  while (entry <= kFilterTableSize) table.inverse_cdf[entry++] = 0.5f;
}

/// Offset from the pixel's centre in filter widths.
/// @param u  uniform in [0, 1)
RELIEF_KERNEL float filter_sample(const FilterTable& table, float u)
{
  const float x = u * static_cast<float>(kFilterTableSize);
  const int i = static_cast<int>(x);
  return lerp(x - static_cast<float>(i), table.inverse_cdf[i], table.inverse_cdf[i + 1]);
}

}  // namespace relief
