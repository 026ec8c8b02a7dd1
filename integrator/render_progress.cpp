#include "integrator/render_progress.h"

#include <algorithm>

#include "integrator/pass_plan.h"

namespace relief {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

}  // namespace

ProgressReporter::ProgressReporter(const RenderOptions& options,
                                   const std::function<void(const RenderProgress&)>& progress,
                                   double num_pixels,
                                   Clock::time_point start)
    : options_(options), progress_(progress), num_pixels_(num_pixels), start_(start), wanted_(samples_wanted(options))
{
  // Most pictures with a noise threshold end long before the most samples that there may be: a guess, until noise has been seen.
  const std::uint32_t most = samples_wanted(options);
  if (options.settings.noise_threshold > 0) {
    wanted_ = std::min<double>(most, 2.0 * judging_after(options.settings, 0, most).next);
  }
}

void ProgressReporter::report(bool now, const PhotonPass* photons)
{
  if (!progress_) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock() || (!now && seconds_since(last_) < 0.2)) return;
  last_ = Clock::now();
  RenderProgress p;
  p.seconds = seconds_since(start_);
  p.samples_per_pixel = static_cast<double>(samples_.load()) / num_pixels_;
  double work = p.samples_per_pixel;
  if (photons != nullptr) {
    p.photons = photons->photons();
    work += photon_share_ * (photons->passes() - p.samples_per_pixel);
  }
  p.fraction = work / wanted_;
  const double speed = speed_.get(p.seconds, work);
  speed_.note(p.seconds, work);
  p.seconds_left = speed > 0 ? std::max(wanted_ - work, 0.0) / speed : 0;
  if (options_.time_limit_seconds > 0) {
    p.fraction = std::max(p.fraction, p.seconds / options_.time_limit_seconds);
    const double most_left = std::max(options_.time_limit_seconds - p.seconds, 0.0);
    p.seconds_left = speed > 0 ? std::min(p.seconds_left, most_left) : most_left;
  }
  p.fraction = std::clamp(p.fraction, last_fraction_, 1.0);
  last_fraction_ = p.fraction;
  p.rays_per_second = p.seconds > 0 ? static_cast<double>(rays_.load()) / p.seconds : 0;
  progress_(p);
}

}  // namespace relief
