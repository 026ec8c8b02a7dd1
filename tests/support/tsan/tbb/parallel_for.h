// Stands in for <tbb/parallel_for.h> in builds with ThreadSanitizer. The packaged TBB is not instrumented, so that the
// sanitizer sees neither how it hands work to its threads nor how it waits for them, and reports a race at every
// variable that a loop body shares with its caller. Threads of the standard library it understands; the loops of the
// renderer then run as concurrently as they do with TBB, only slower.
//
// Only what relief uses is here; the partitioner is ignored, a range's grain size is not.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/partitioner.h>

#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace tbb {

namespace tsan {

/// Enough threads for races to show on any machine.
inline constexpr std::size_t kNumThreads = 4;

/// Calls `body(i)` once for every i below `num_tasks`, from several threads in no fixed order, and waits.
/// @error rethrows the first exception that a body throws, after all threads have stopped
template <class Body>
void run(std::size_t num_tasks, const Body& body)
{
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr error;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < num_tasks; i = next++) body(i);
    } catch (...) {
      next = num_tasks;
      const std::scoped_lock lock(mutex);
      if (!error) error = std::current_exception();
    }
  };
  std::vector<std::thread> threads;
  for (std::size_t i = 1; i < kNumThreads && i < num_tasks; ++i) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
  if (error) std::rethrow_exception(error);
}

/// The pieces that splitting `range` until nothing is divisible leaves.
template <class Range>
void split_into(std::vector<Range>& pieces, Range range)
{
  if (!range.is_divisible()) {
    pieces.push_back(range);
    return;
  }
  Range right(range, tbb::split());
  split_into(pieces, range);
  split_into(pieces, right);
}

}  // namespace tsan

template <class Range, class Body, class... Partitioner>
requires requires(const Range& range) { range.is_divisible(); }
void parallel_for(const Range& range, const Body& body, Partitioner&&...)
{
  if (range.empty()) return;
  std::vector<Range> pieces;
  tsan::split_into(pieces, range);
  tsan::run(pieces.size(), [&](std::size_t i) { body(pieces[i]); });
}

template <class Index, class Body, class... Partitioner>
requires requires(const Body& body, Index index) { body(index); }
void parallel_for(Index first, Index last, const Body& body, Partitioner&&...)
{
  if (!(first < last)) return;
  tsan::run(static_cast<std::size_t>(last - first),
            [&](std::size_t i) { body(static_cast<Index>(first + static_cast<Index>(i))); });
}

}  // namespace tbb
