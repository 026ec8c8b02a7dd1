#include "exporters/sample_range.h"

#include <charconv>
#include <system_error>

namespace relief {

std::string sample_range_text(const SampleRange& range)
{
  return std::to_string(range.first) + "-" + std::to_string(range.end) + "/" + std::to_string(range.of);
}

std::optional<SampleRange> sample_range_parse(std::string_view text)
{
  const std::size_t dash = text.find('-'), slash = text.find('/');
  if (dash == std::string_view::npos || slash == std::string_view::npos || slash < dash) return std::nullopt;
  const auto read = [](std::string_view digits, std::uint32_t& number) {
    const auto result = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    return result.ec == std::errc() && result.ptr == digits.data() + digits.size();
  };
  SampleRange range;
  const bool is_read = read(text.substr(0, dash), range.first) &&
                       read(text.substr(dash + 1, slash - dash - 1), range.end) &&
                       read(text.substr(slash + 1), range.of);
  if (!is_read || range.first >= range.end || range.end > range.of) return std::nullopt;
  return range;
}

}  // namespace relief
