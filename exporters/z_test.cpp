#include "exporters/z_test.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "kernel/assert.h"

namespace relief {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Largest relative error of a stored value. A float's own rounding is 2^-24; a mean of many equal samples, summed in another
// order, is a few times that off.
constexpr double kFloatRounding = 0x1p-20;
constexpr double kHalfRounding = 0x1p-11;
constexpr double kHalfSmallest = 0x1p-25;  // half of the spacing of the smallest halves

double rounding_bound(float value, ChannelType type)
{
  const double size = std::abs(double{value});
  return type == ChannelType::kHalf ? std::max(size * kHalfRounding, kHalfSmallest) : size * kFloatRounding;
}

/// One value of both pictures.
struct Difference {
  double difference = 0, variance = 0;
  bool is_certain = false;  ///< differs although nothing varies
  bool is_finite = true;
  double z() const
  {
    return is_certain ? std::copysign(kInfinity, difference) : variance > 0 ? difference / std::sqrt(variance) : 0;
  }
};

Difference difference_at(const ChannelView& a,
                         const ChannelView& variance_a,
                         const ChannelView& b,
                         const ChannelView& variance_b,
                         int x,
                         int y,
                         double variance_floor)
{
  Difference result;
  result.difference = double{a.at(x, y)} - double{b.at(x, y)};
  const double variance = double{variance_a.at(x, y)} + double{variance_b.at(x, y)};
  if (!std::isfinite(result.difference) || !std::isfinite(variance)) {
    result.is_finite = false;
    return result;
  }
  const double bound_a = rounding_bound(a.at(x, y), a.type), bound_b = rounding_bound(b.at(x, y), b.type);
  result.variance = std::max(variance, variance_floor);
  if (!(result.variance > 0)) {
    result.variance = 0;
    result.is_certain = std::abs(result.difference) > bound_a + bound_b;
    if (!result.is_certain) result.difference = 0;
    return result;
  }
  // A rounding error is uniform in ± its bound, which has a third of the bound's square as variance.
  result.variance += (bound_a * bound_a + bound_b * bound_b) / 3;
  return result;
}

void keep_larger(ZExtreme& largest, double z, int x, int y, const std::string& channel)
{
  if (std::abs(z) > std::abs(largest.z)) largest = {z, x, y, channel};
}

/// Chance that the (k+1)-th largest of |z| is as large as it is, if at most k may be anything.
double pixel_p_value(std::vector<double>& sizes, double allowed_outliers)
{
  if (sizes.empty()) return 1;
  const std::size_t num_ignored =
      std::min(static_cast<std::size_t>(allowed_outliers * static_cast<double>(sizes.size())), sizes.size() - 1);
  const auto decisive = sizes.begin() + static_cast<std::ptrdiff_t>(num_ignored);
  std::nth_element(sizes.begin(), decisive, sizes.end(), std::greater<>());
  return sidak_p(normal_two_sided_p(*decisive), static_cast<double>(sizes.size()));
}

}  // namespace

double normal_two_sided_p(double z) { return std::erfc(std::abs(z) / std::sqrt(2.0)); }

double sidak_p(double p, double n) { return p >= 1 ? 1 : -std::expm1(n * std::log1p(-p)); }

double chi2_upper_p(double x, double dof)
{
  if (!(x > 0)) return 1;
  if (std::isinf(x)) return 0;
  // The regularized incomplete gamma function at (s, t): its power series where that converges fast, else its continued
  // fraction by Lentz's method. Both need O(√s) steps near t = s, where they are slowest.
  const double s = dof / 2, t = x / 2;
  const double prefactor = std::exp(s * std::log(t) - t - std::lgamma(s));
  constexpr double kPrecision = 1e-14;
  const int max_steps = 1000 + static_cast<int>(20 * std::sqrt(s));
  if (t < s + 1) {
    double term = 1 / s, sum = term;
    for (int n = 1; n <= max_steps && term > sum * kPrecision; ++n) {
      term *= t / (s + n);
      sum += term;
    }
    return std::clamp(1 - prefactor * sum, 0.0, 1.0);
  }
  constexpr double kTiny = 1e-300;
  double b = t + 1 - s, c = 1 / kTiny, d = 1 / b, fraction = d;
  for (int n = 1; n <= max_steps; ++n) {
    const double numerator = -n * (n - s);
    b += 2;
    d = numerator * d + b;
    if (std::abs(d) < kTiny) d = kTiny;
    c = b + numerator / c;
    if (std::abs(c) < kTiny) c = kTiny;
    d = 1 / d;
    fraction *= d * c;
    if (std::abs(d * c - 1) < kPrecision) break;
  }
  return std::clamp(prefactor * fraction, 0.0, 1.0);
}

ZTestResult z_test(const ImageView& a,
                   const ImageView& variance_a,
                   const ImageView& b,
                   const ImageView& variance_b,
                   const ZTestOptions& options)
{
  RELIEF_ASSERT(a.width == b.width && a.height == b.height && a.channels.size() == b.channels.size());
  RELIEF_ASSERT(options.block >= 1 && options.significance > 0 && options.significance < 1);
  ZTestResult result;
  result.significance = options.significance;
  std::vector<double> pixel_sizes;
  pixel_sizes.reserve(static_cast<std::size_t>(a.width) * static_cast<std::size_t>(a.height) * a.channels.size());
  double num_blocks = 0, num_means = 0, smallest_chi2_p = 1, num_chi2 = 0;
  for (std::size_t c = 0; c < a.channels.size(); ++c) {
    const std::string& name = a.channels[c].name;
    double sum = 0, sum_variance = 0, chi2 = 0, dof = 0;
    for (int y0 = 0; y0 < a.height; y0 += options.block) {
      for (int x0 = 0; x0 < a.width; x0 += options.block) {
        double block_sum = 0, block_variance = 0;
        for (int y = y0; y < std::min(y0 + options.block, a.height); ++y) {
          for (int x = x0; x < std::min(x0 + options.block, a.width); ++x) {
            const Difference value = difference_at(a.channels[c], variance_a.channels[c], b.channels[c],
                                                   variance_b.channels[c], x, y, options.variance_floor);
            if (!value.is_finite) {
              ++result.num_nonfinite;
              continue;
            }
            keep_larger(result.largest_pixel, value.z(), x, y, name);
            pixel_sizes.push_back(std::abs(value.z()));
            result.num_certain += value.is_certain ? 1 : 0;
            // A certain difference has failed already; without a variance it says nothing about a mean.
            if (value.is_certain) continue;
            block_sum += value.difference;
            block_variance += value.variance;
          }
        }
        if (!(block_variance > 0)) continue;
        const double z = block_sum / std::sqrt(block_variance);
        keep_larger(result.largest_block, z, x0, y0, name);
        sum += block_sum;
        sum_variance += block_variance;
        chi2 += z * z;
        ++dof;
      }
    }
    if (!(dof > 0)) continue;
    num_blocks += dof;
    ++num_means;
    keep_larger(result.largest_mean, sum / std::sqrt(sum_variance), 0, 0, name);
    // One sum a channel: the channels of a grey picture are equal, and a sum over all would count each value three times.
    smallest_chi2_p = std::min(smallest_chi2_p, chi2_upper_p(chi2, dof));
    ++num_chi2;
  }
  result.num_tests = pixel_sizes.size();
  result.pixel_p = pixel_p_value(pixel_sizes, options.allowed_outliers);
  result.block_p = sidak_p(normal_two_sided_p(result.largest_block.z), std::max(num_blocks, 1.0));
  result.mean_p = sidak_p(normal_two_sided_p(result.largest_mean.z), std::max(num_means, 1.0));
  result.chi2_p = sidak_p(smallest_chi2_p, std::max(num_chi2, 1.0));
  const double smallest = std::min({result.pixel_p, result.block_p, result.mean_p, result.chi2_p});
  result.p = sidak_p(smallest, 4);
  const bool too_many_certain =
      static_cast<double>(result.num_certain) > options.allowed_outliers * static_cast<double>(result.num_tests);
  if (result.num_nonfinite > 0 || too_many_certain) result.p = 0;
  result.passed = result.p >= options.significance;
  return result;
}

}  // namespace relief
