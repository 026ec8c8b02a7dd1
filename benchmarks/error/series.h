// Error against time: what was measured, and what lies between.
#pragma once

#include <string>
#include <vector>

namespace relief {

/// One render.
struct ErrorMeasurement {
  double samples = 0;  ///< a pixel
  double seconds = 0;  ///< of sampling
  double rmse = 0, relmse = 0;
};

/// Renders of one scene in one way, of rising samples.
struct ErrorSeries {
  std::string name;
  double preparation_seconds = 0;  ///< of building for rays, or what another renderer calls so; of the last render
  std::vector<ErrorMeasurement> points;
};

/// RMSE after a time, along straight lines between the points on logarithmic axes. @return NaN beyond the points
double error_at_time(const ErrorSeries& series, double seconds);

/// Seconds to an RMSE likewise; the first time, if there are several.
double time_to_error(const ErrorSeries& series, double rmse);

/// The smallest RMSE that all series come down to: the largest of their least ones. @return NaN if there are no points
double common_error(const std::vector<ErrorSeries>& all);

}  // namespace relief
