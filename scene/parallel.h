// Parallel loading of independent files.
#pragma once

#include <tbb/parallel_for.h>

#include <cstddef>
#include <exception>
#include <new>
#include <vector>

namespace relief {

/// Runs a task for each of n things in parallel. If several throw, the error of the first thing is the one reported,
/// so that the message does not depend on the threads. What memory did not suffice for side by side is done again, one after
/// the other.
/// @param task  callable with the index of the thing, also a second time
template <class Task>
void for_each_in_parallel(std::size_t n, const Task& task)
{
  std::vector<std::exception_ptr> errors(n);
  tbb::parallel_for(std::size_t{0}, n, [&](std::size_t i) {
    try {
      task(i);
    } catch (...) {
      errors[i] = std::current_exception();
    }
  });
  for (std::size_t i = 0; i < n; ++i) {
    if (!errors[i]) continue;
    try {
      std::rethrow_exception(errors[i]);
    } catch (const std::bad_alloc&) {
      task(i);
    }
  }
}

}  // namespace relief
