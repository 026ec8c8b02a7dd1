#include "integrator/sampling_end.h"

namespace relief {

SamplingEnd::~SamplingEnd()
{
  {
    const std::lock_guard lock(mutex_);
    done_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void SamplingEnd::watch()
{
  // A signal is answered within the one, a pass that no longer moves ended after the other.
  constexpr auto kInterval = std::chrono::milliseconds(50);
  constexpr double kPatience = 0.5;
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, kInterval, [this] { return done_; })) {
    const double now = seconds_since_start();
    const bool is_stuck = time_limit_ > 0 && now >= time_limit_ && now - last_progress_ >= kPatience;
    if (interrupted_ || is_stuck) reached_ = true;
  }
}

}  // namespace relief
