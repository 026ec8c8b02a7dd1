#include "benchmarks/error/series.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace relief {

namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// y at x on the first piece of a line whose ends are on both sides of it; all on logarithmic axes.
double interpolated(const ErrorSeries& series, double ErrorMeasurement::*x_of, double ErrorMeasurement::*y_of, double x)
{
  for (std::size_t i = 0; i < series.points.size(); ++i) {
    const ErrorMeasurement &a = series.points[i], &b = series.points[std::min(i + 1, series.points.size() - 1)];
    const double x0 = a.*x_of, x1 = b.*x_of, y0 = a.*y_of, y1 = b.*y_of;
    if (x == x0) return y0;
    if (!((x0 < x && x <= x1) || (x1 <= x && x < x0)) || !(std::min({x0, x1, y0, y1}) > 0)) continue;
    return y0 * std::pow(y1 / y0, std::log(x / x0) / std::log(x1 / x0));
  }
  return kUnknown;
}

}  // namespace

double error_at_time(const ErrorSeries& series, double seconds)
{
  return interpolated(series, &ErrorMeasurement::seconds, &ErrorMeasurement::rmse, seconds);
}

double time_to_error(const ErrorSeries& series, double rmse)
{
  return interpolated(series, &ErrorMeasurement::rmse, &ErrorMeasurement::seconds, rmse);
}

double common_error(const std::vector<ErrorSeries>& all)
{
  double largest = kUnknown;
  for (const ErrorSeries& series : all) {
    if (series.points.empty()) continue;
    const auto least = std::min_element(series.points.begin(), series.points.end(),
                                        [](const auto& a, const auto& b) { return a.rmse < b.rmse; });
    // Written so that the first one counts.
    if (!(largest >= least->rmse)) largest = least->rmse;
  }
  return largest;
}

}  // namespace relief
