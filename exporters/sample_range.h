// Which samples of a sequence a picture has, as OpenEXR files say it in the attribute relief:sample_ranges.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace relief {

/// Samples first … end − 1 of the `of` that were planned. How many those are decides their order.
struct SampleRange {
  std::uint32_t first = 0, end = 0, of = 0;

  bool is_all() const { return first == 0 && end == of; }
};

/// "16-32/64"
std::string sample_range_text(const SampleRange& range);

/// @return nothing if it is no text of a range
std::optional<SampleRange> sample_range_parse(std::string_view text);

}  // namespace relief
