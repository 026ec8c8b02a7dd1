// When a render has to end in the middle of a pass.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace relief {

/// Says when sampling has to end although a pass is under way: when it is interrupted, or when the time is up and no
/// tile of the pass gets done any more. A thread of its own, because those that sample may be in one long search.
class SamplingEnd {
 public:
  /// @param time_limit  seconds from now; 0: none
  SamplingEnd(const std::atomic<bool>& interrupted, double time_limit)
      : interrupted_(interrupted), start_(Clock::now()), time_limit_(time_limit), thread_([this] { watch(); })
  {
  }
  ~SamplingEnd();
  SamplingEnd(const SamplingEnd&) = delete;
  SamplingEnd& operator=(const SamplingEnd&) = delete;

  const std::atomic<bool>& reached() const { return reached_; }
  /// Called by any thread that has finished a tile, or as much.
  void note_progress() { last_progress_ = seconds_since_start(); }

 private:
  using Clock = std::chrono::steady_clock;
  double seconds_since_start() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  void watch();

  const std::atomic<bool>& interrupted_;
  const Clock::time_point start_;
  const double time_limit_;
  std::atomic<double> last_progress_{0};  ///< seconds from the start
  std::atomic<bool> reached_{false};
  std::mutex mutex_;
  std::condition_variable wake_;
  bool done_ = false;
  std::thread thread_;  ///< the last member: it uses all others
};

}  // namespace relief
