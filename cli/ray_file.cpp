#include "cli/ray_file.h"

#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>

#include <fmt/format.h>

#include "cli/memory_option.h"
#include "exporters/errors.h"
#include "scene/memory.h"

namespace relief {

namespace {

/// Words of a line, separated by blanks.
std::vector<std::string_view> split_words(std::string_view line)
{
  constexpr std::string_view kBlanks = " \t\r";
  std::vector<std::string_view> words;
  while (true) {
    const std::size_t first = line.find_first_not_of(kBlanks);
    if (first == std::string_view::npos) return words;
    line.remove_prefix(first);
    words.push_back(line.substr(0, line.find_first_of(kBlanks)));
    line.remove_prefix(words.back().size());
  }
}

/// The ray in a line's words: 'ox oy oz dx dy dz [tmin tmax]', perhaps after the kind that --pixel prints.
std::optional<TraceRay> parse_ray(std::span<const std::string_view> words)
{
  if (!words.empty() && (words[0] == kPathRay || words[0] == kShadowRay)) words = words.subspan(1);
  if (words.size() != 6 && words.size() != 8) return {};
  // In double precision, so that numbers too small for a float become zero instead of an error.
  std::array<double, 8> v = {0, 0, 0, 0, 0, 0, 0, HUGE_VAL};
  for (std::size_t i = 0; i < words.size(); ++i) {
    const char* end = words[i].data() + words[i].size();
    const auto result = std::from_chars(words[i].data(), end, v[i]);
    if (result.ec != std::errc() || result.ptr != end) return {};
  }
  const auto f = [&](std::size_t i) { return static_cast<float>(v[i]); };
  const TraceRay ray{{f(0), f(1), f(2)}, {f(3), f(4), f(5)}, f(6), f(7)};
  // Written so that NaN is refused.
  const bool is_valid = is_finite(ray.O) && is_finite(ray.D) && !is_zero(ray.D) && ray.t_min >= 0 && ray.t_max >= 0;
  return is_valid ? std::optional(ray) : std::nullopt;
}

/// Reads a line, which ends: a device or a picture given for a file of rays may have none.
/// @return  false at the end of the file
/// @error   InputError
bool get_line(std::istream& in, const std::string& file, int number, std::string& line)
{
  constexpr std::size_t kLongest = 4096;
  line.clear();
  for (int c = in.get(); c != std::char_traits<char>::eof(); c = in.get()) {
    if (c == '\n') return true;
    line += static_cast<char>(c);
    if (line.size() > kLongest) {
      throw InputError(file, fmt::format("line {}: expected at most {} characters, found more", number, kLongest));
    }
  }
  return !line.empty();
}

}  // namespace

std::vector<TraceRay> read_rays(const std::string& file)
{
  std::error_code ignored;
  std::ifstream in(file);
  if (!in || std::filesystem::is_directory(file, ignored)) {
    throw InputError(file, "expected a readable file of rays, found none");
  }
  std::vector<TraceRay> rays;
  std::string line;
  MemoryWatch memory;
  for (int number = 1; get_line(in, file, number, line); ++number) {
    const std::vector<std::string_view> words = split_words(line);
    if (words.empty() || words[0].front() == '#') continue;
    const std::optional<TraceRay> ray = parse_ray(words);
    if (!ray) {
      throw InputError(file, fmt::format("line {}: expected 'ox oy oz dx dy dz [tmin tmax]', finite, with a direction "
                                         "that is not zero and tmin, tmax >= 0, found '{}'",
                                         number, line.substr(0, 200)));
    }
    rays.push_back(*ray);
    memory.add(2 * sizeof(TraceRay), file);
  }
  // Each has a hit, and a line is written of that, in a text that grows by doubling.
  constexpr std::size_t kLineBytes = 200;
  memory_require(rays.size() * (sizeof(TraceHit) + 2 * kLineBytes), file);
  if (in.bad()) throw InputError(file, "expected a readable file of rays, found an error while reading");
  return rays;
}

}  // namespace relief
