// Stands in for <tbb/parallel_invoke.h> in builds with ThreadSanitizer; parallel_for.h beside it says why.
#pragma once

#include <tbb/parallel_for.h>

namespace tbb {

template <class First, class Second>
void parallel_invoke(const First& first, const Second& second)
{
  tsan::run(2, [&](std::size_t i) { i == 0 ? first() : second(); });
}

}  // namespace tbb
