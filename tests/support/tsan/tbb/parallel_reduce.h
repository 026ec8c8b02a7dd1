// Stands in for <tbb/parallel_reduce.h> in builds with ThreadSanitizer; parallel_for.h beside it says why.
#pragma once

#include <tbb/parallel_for.h>

namespace tbb {

template <class Range, class Value, class Body, class Join>
Value parallel_reduce(const Range& range, const Value& identity, const Body& body, const Join& join)
{
  if (range.empty()) return identity;
  std::vector<Range> pieces;
  tsan::split_into(pieces, range);
  std::vector<Value> values(pieces.size(), identity);
  tsan::run(pieces.size(), [&](std::size_t i) { values[i] = body(pieces[i], identity); });
  Value sum = identity;
  for (const Value& value : values) sum = join(sum, value);
  return sum;
}

}  // namespace tbb
