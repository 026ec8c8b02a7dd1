// Stands in for <tbb/parallel_sort.h> in builds with ThreadSanitizer; parallel_for.h beside it says why.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <functional>

namespace tbb {

template <class Iterator, class Less>
void parallel_sort(Iterator first, Iterator last, const Less& less)
{
  const auto size = static_cast<std::size_t>(last - first);
  const auto part = [&](std::size_t i) { return first + static_cast<std::ptrdiff_t>(size * i / tsan::kNumThreads); };
  tsan::run(tsan::kNumThreads, [&](std::size_t i) { std::sort(part(i), part(i + 1), less); });
  for (std::size_t i = 1; i < tsan::kNumThreads; ++i) std::inplace_merge(first, part(i), part(i + 1), less);
}

template <class Iterator>
void parallel_sort(Iterator first, Iterator last)
{
  parallel_sort(first, last, std::less<>());
}

}  // namespace tbb
