// χ² test of a sampler of directions against its density, as in Nori and Mitsuba: directions are counted in a grid over
// the sphere, the density is integrated over each cell, and the difference is judged by Pearson's statistic.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

namespace relief {

/// Regularized upper incomplete gamma function Q(a, x): probability that a Poisson-like tail exceeds x.
/// Series below a + 1, Lentz's continued fraction above.
inline double incomplete_gamma_q(double a, double x)
{
  if (!(x > 0.0)) return 1.0;
  const double scale = std::exp(-x + a * std::log(x) - std::lgamma(a));
  if (x < a + 1.0) {
    double term = 1.0 / a;
    double sum = term;
    for (double n = a + 1.0; term > sum * 1e-16; n += 1.0) {
      term *= x / n;
      sum += term;
    }
    return 1.0 - scale * sum;
  }
  double b = x + 1.0 - a;
  double c = 1e300;
  double d = 1.0 / b;
  double h = d;
  for (int n = 1; n < 10000; ++n) {
    const double an = -n * (n - a);
    b += 2.0;
    d = 1.0 / (an * d + b);
    c = b + an / c;
    h *= d * c;
    if (std::abs(d * c - 1.0) < 1e-15) break;
  }
  return scale * h;
}

struct Chi2Result {
  double p_value = 1;
  double statistic = 0;
  int degrees_of_freedom = 0;
  std::string failure;  ///< why no statistic could be formed: samples where the density is zero
};

/// Grid over the sphere, uniform in z and azimuth, plus one cell for samples that were absorbed.
class Chi2Histogram {
 public:
  Chi2Histogram(int num_z, int num_phi) : num_z_(num_z), num_phi_(num_phi), counts_(cells() + 1, 0.0) {}

  void add(double x, double y, double z)
  {
    const double phi = std::atan2(y, x);
    const double turn = phi < 0.0 ? phi / kTurn + 1.0 : phi / kTurn;
    const int i = std::clamp(static_cast<int>((z + 1.0) * 0.5 * num_z_), 0, num_z_ - 1);
    const int j = std::clamp(static_cast<int>(turn * num_phi_), 0, num_phi_ - 1);
    counts_[static_cast<std::size_t>(i * num_phi_ + j)] += 1.0;
    num_samples_ += 1.0;
  }

  void add_absorbed()
  {
    counts_.back() += 1.0;
    num_samples_ += 1.0;
  }

  /// Pearson's test against a density over directions.
  /// @param pdf  (x, y, z) → solid angle density; what it lacks of 1 is the probability of absorption
  Chi2Result test(const std::function<double(double, double, double)>& pdf) const
  {
    std::vector<double> expected(cells() + 1, 0.0);
    for (int i = 0; i < num_z_; ++i) {
      for (int j = 0; j < num_phi_; ++j) {
        const double z0 = 2.0 * i / num_z_ - 1.0, z1 = 2.0 * (i + 1) / num_z_ - 1.0;
        const double phi0 = kTurn * j / num_phi_, phi1 = kTurn * (j + 1) / num_phi_;
        const auto f = [&](double z, double phi) {
          const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
          return pdf(r * std::cos(phi), r * std::sin(phi), z);
        };
        expected[static_cast<std::size_t>(i * num_phi_ + j)] =
            num_samples_ * integrate(f, z0, z1, phi0, phi1, gauss(f, z0, z1, phi0, phi1), kMaxDepth);
      }
    }
    const double total = std::accumulate(expected.begin(), expected.end(), 0.0);
    expected.back() = std::max(0.0, num_samples_ - total);

    Chi2Result result;
    // Cells that expect fewer than five samples are pooled, so that the statistic is close to χ².
    std::vector<std::size_t> order(expected.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return expected[a] < expected[b]; });
    double pooled_expected = 0, pooled_count = 0;
    int num_terms = 0;
    const auto add_term = [&](double count, double expectation) {
      result.statistic += (count - expectation) * (count - expectation) / expectation;
      ++num_terms;
    };
    for (const std::size_t cell : order) {
      if (expected[cell] < 5.0 || (pooled_expected > 0.0 && pooled_expected < 5.0)) {
        pooled_expected += expected[cell];
        pooled_count += counts_[cell];
      } else {
        add_term(counts_[cell], expected[cell]);
      }
    }
    if (pooled_expected > 0.0) {
      add_term(pooled_count, pooled_expected);
    } else if (pooled_count > 0.0) {
      result.failure = "samples where the density is zero";
      result.p_value = 0.0;
      return result;
    }
    result.degrees_of_freedom = num_terms - 1;
    if (result.degrees_of_freedom > 0) {
      result.p_value = incomplete_gamma_q(0.5 * result.degrees_of_freedom, 0.5 * result.statistic);
    }
    return result;
  }

 private:
  static constexpr double kTurn = 6.283185307179586;

  /// Levels of subdivision; the first ones are unconditional, so that a density's narrow edge is not overlooked.
  static constexpr int kMaxDepth = 7, kMinDepth = 3;

  std::size_t cells() const { return static_cast<std::size_t>(num_z_ * num_phi_); }

  /// Gauss–Legendre with 4 × 4 points.
  template <typename F>
  static double gauss(const F& f, double x0, double x1, double y0, double y1)
  {
    constexpr double kNode[4] = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629};
    constexpr double kWeight[4] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693};
    double sum = 0;
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        sum += kWeight[i] * kWeight[j] * f(x0 + (x1 - x0) * kNode[i], y0 + (y1 - y0) * kNode[j]);
      }
    }
    return sum * (x1 - x0) * (y1 - y0);
  }

  /// Halves the cell both ways until the estimate settles to a tenth of what a million samples can tell.
  template <typename F>
  static double integrate(const F& f, double x0, double x1, double y0, double y1, double whole, int depth)
  {
    const double xm = 0.5 * (x0 + x1), ym = 0.5 * (y0 + y1);
    const double a = gauss(f, x0, xm, y0, ym), b = gauss(f, xm, x1, y0, ym);
    const double c = gauss(f, x0, xm, ym, y1), d = gauss(f, xm, x1, ym, y1);
    const double sum = a + b + c + d;
    const bool settled = depth <= kMaxDepth - kMinDepth && std::abs(sum - whole) < 1e-7 + 1e-4 * std::abs(sum);
    if (depth == 0 || settled) return sum;
    return integrate(f, x0, xm, y0, ym, a, depth - 1) + integrate(f, xm, x1, y0, ym, b, depth - 1) +
           integrate(f, x0, xm, ym, y1, c, depth - 1) + integrate(f, xm, x1, ym, y1, d, depth - 1);
  }

  int num_z_, num_phi_;
  std::vector<double> counts_;
  double num_samples_ = 0;
};

/// Smallest p-value to accept in each of `num_tests` tests so that all of them together reject a correct sampler with
/// probability `significance` (Šidák).
inline double sidak_threshold(double significance, int num_tests)
{
  return 1.0 - std::pow(1.0 - significance, 1.0 / num_tests);
}

/// Uniform random numbers with a fixed seed (SplitMix64).
class TestRandom {
 public:
  explicit TestRandom(std::uint64_t seed) : state_(seed) {}

  /// @return [0, 1), 24 bits
  float next()
  {
    std::uint64_t x = state_ += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return static_cast<float>((x ^ (x >> 31)) >> 40) * 0x1p-24f;
  }

 private:
  std::uint64_t state_;
};

}  // namespace relief
