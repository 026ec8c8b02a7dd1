// Are two Monte Carlo pictures estimates of the same image? Both come with the variance of every pixel's mean, so that
// the question has an answer with a stated rate of false alarms.
//
// Four tests share that rate: single pixels (a wrong pixel), block means (a wrong region), the image's mean (a lost
// fraction of the energy) and the sum of squares of the blocks' z (many small errors). Each result is corrected for
// the number of values it looked at.
//
// @source Z. Šidák 1967, "Rectangular confidence regions for the means of multivariate normal distributions", for the
//         correction; the use of z-tests on pixels follows the test suite of Mitsuba 3 (Jakob et al. 2022).
#pragma once

#include <cstdint>
#include <string>

#include "exporters/picture.h"

namespace relief {

struct ZTestOptions {
  double significance = 0.01;  ///< chance that two correct pictures fail
  int block = 8;               ///< side of a block, in pixels
  /// Smallest variance of a difference of two pixels. A pixel whose few samples were all equal claims to be certain; where
  /// that can happen (few samples, rare bright ones), state how uncertain it is at least.
  double variance_floor = 0;
  /// Fraction of pixels' values that may fail, in [0, 1). Noise of few samples has heavier tails than a normal distribution;
  /// the other three tests average it out, single pixels do not.
  double allowed_outliers = 0;
};

/// The value furthest from what chance explains. z is signed: a − b; infinite for a difference where both are certain.
struct ZExtreme {
  double z = 0;
  int x = 0, y = 0;  ///< of the pixel, or of the block's first pixel, in the stored window
  std::string channel;
};

struct ZTestResult {
  bool passed = false;
  double significance = 0;
  double p = 1;  ///< chance of differences like these in two correct pictures; at least `significance` if passed
  double pixel_p = 1, block_p = 1, mean_p = 1, chi2_p = 1;  ///< of each test alone, corrected for its number of values
  ZExtreme largest_pixel, largest_block, largest_mean;
  std::uint64_t num_tests = 0;      ///< pixels' values compared
  std::uint64_t num_certain = 0;    ///< of these, differences where neither side has any variance: always a failure
  std::uint64_t num_nonfinite = 0;  ///< NaN or infinite means or variances: always a failure
};

/// Tests whether a and b have the same expected value. Rounding of the stored values (halves included) counts as noise.
/// @param variance_a, variance_b  variance of the values' means, per channel
/// @pre equal sizes and numbers of channels in all four; block ≥ 1; significance in (0, 1)
/// @cost one double a value
ZTestResult z_test(const ImageView& a,
                   const ImageView& variance_a,
                   const ImageView& b,
                   const ImageView& variance_b,
                   const ZTestOptions& options = {});

/// Chance that a standard normal variable lies at least |z| from 0.
double normal_two_sided_p(double z);

/// Chance that the smallest of n independent p-values is at most p.
double sidak_p(double p, double n);

/// Chance that a χ² variable of `dof` degrees of freedom is at least x. @pre dof > 0
double chi2_upper_p(double x, double dof);

}  // namespace relief
