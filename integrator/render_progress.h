// What is told of a render while it is under way.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>

#include "integrator/photon_pass.h"
#include "integrator/render.h"

namespace relief {

/// How fast work was done lately: what a render begins with is slower or faster than what follows.
class RecentSpeed {
 public:
  void note(double seconds, double work)
  {
    if (seconds < 2 * later_.seconds) return;
    earlier_ = later_;
    later_ = {seconds, work};
  }
  /// Work a second since a time between a quarter and half of all ago; 0: there was none.
  double get(double seconds, double work) const
  {
    const double passed = seconds - earlier_.seconds;
    return passed > 0 ? std::max(work - earlier_.work, 0.0) / passed : 0;
  }

 private:
  struct Moment {
    double seconds = 0, work = 0;
  };
  Moment earlier_, later_;
};

/// Tells how far a render is, from whichever thread, a few times a second.
class ProgressReporter {
 public:
  ProgressReporter(const RenderOptions& options,
                   const std::function<void(const RenderProgress&)>& progress,
                   double num_pixels,
                   std::chrono::steady_clock::time_point start);
  bool is_watched() const { return static_cast<bool>(progress_); }
  void add(std::uint64_t samples, std::uint64_t rays)
  {
    samples_ += samples;
    rays_ += rays;
  }
  void set_photon_share(double share) { photon_share_ = share; }
  /// @param wanted  samples that the mean pixel will have had at the end
  void set_wanted(double wanted) { wanted_ = wanted; }

  /// @param now      however short ago the last report was
  /// @param photons  null: there is no photon pass
  void report(bool now, const PhotonPass* photons);

 private:
  const RenderOptions& options_;
  const std::function<void(const RenderProgress&)>& progress_;
  double num_pixels_;
  std::chrono::steady_clock::time_point start_, last_ = std::chrono::steady_clock::now();
  std::atomic<std::uint64_t> samples_{0}, rays_{0};
  std::mutex mutex_;
  double wanted_, last_fraction_ = 0;
  RecentSpeed speed_;
  /// Part of the time that photons take. Until the first pass has been timed, the middle of the 0.26 to 0.73 that they take on
  /// the scenes of benchmarks/caustics.
  double photon_share_ = 0.5;
};

/// When previews are shown: they get a hundredth of the time, and a little more for the first ones, which change the most.
class PreviewSchedule {
 public:
  bool is_due(double seconds) const
  {
    constexpr double kShare = 0.01, kFirstSeconds = 0.2;
    return seconds >= next_ && spent_ <= kFirstSeconds + kShare * seconds;
  }
  void note(double before, double after)
  {
    constexpr double kInterval = 0.5;
    spent_ += after - before;
    next_ = after + kInterval;
  }

 private:
  double spent_ = 0, next_ = 0;
};

}  // namespace relief
