#include "integrator/error_history.h"

#include <algorithm>
#include <utility>

namespace relief {

bool ErrorHistory::is_due() const
{
  return film_.mean_samples() >= (points_.empty() ? 2.0 : 2.0 * points_.back().samples);
}

void ErrorHistory::add(double seconds)
{
  const ImageError error = film_.estimate_error();
  const auto exposure = static_cast<double>(options_.settings.film_exposure);
  add({seconds, film_.mean_samples(), error.rmse * exposure, error.relmse, {}, {}});
}

std::vector<ErrorPoint> ErrorHistory::finish(const Statistics& stats) &&
{
  // The last pass may have been a doubling.
  if (!points_.empty() && points_.back().samples >= stats.samples_per_pixel) points_.pop_back();
  if (stats.samples_per_pixel > 0) {
    add({stats.render_seconds, stats.samples_per_pixel, stats.error_rmse, stats.error_relmse, {}, {}});
  }
  return std::move(points_);
}

void ErrorHistory::add(ErrorPoint point)
{
  if (options_.reference_error) {
    const RenderSettings& s = options_.settings;
    const ImageError error =
        options_.reference_error(film_.beauty(window_.x0, window_.y0, s.width, s.height, s.film_exposure).view);
    point.reference_rmse = error.rmse;
    point.reference_relmse = error.relmse;
  }
  points_.push_back(point);
}

}  // namespace relief
