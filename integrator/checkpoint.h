// Keeping a render's state while it is under way, and putting it back.
#pragma once

#include <chrono>
#include <functional>
#include <span>

#include <tbb/enumerable_thread_specific.h>

#include "integrator/film.h"
#include "integrator/wavefront.h"
#include "kernel/render_state.h"

namespace relief {

/// Samples of a pass that fills a batch: no pass has more.
inline constexpr std::uint32_t kMostPassSamples = kBatchPaths / (kTileSize * kTileSize);

using Workers = tbb::enumerable_thread_specific<Wavefront>;

/// Adds what the workers have done.
void state_add_work(RenderState& state, const Workers& workers);

/// Puts a saved film back, and the work that it cost onto a worker.
/// @param saved   its sums are taken
/// @param wanted  samples of the whole render
/// @return false, and nothing is changed, if it is not of this film or cannot have been saved
bool state_restore(SavedRender& saved, Film& film, Wavefront& worker, std::uint32_t wanted);

/// When a state is to be saved: so that no more than the interval is lost, whenever the process is killed.
class CheckpointSchedule {
 public:
  using Clock = std::chrono::steady_clock;
  /// @param interval  seconds; 0: never
  explicit CheckpointSchedule(double interval) : interval_(interval), next_(Clock::now() + duration(interval)) {}

  bool is_on() const { return interval_ > 0; }

  /// Asked by any thread.
  bool is_due() const { return is_on() && Clock::now() >= next_; }

  /// Saves, while nobody asks.
  void run(const std::function<void()>& save);

 private:
  static Clock::duration duration(double seconds)
  {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  }

  double interval_;
  Clock::time_point next_;
};

}  // namespace relief
