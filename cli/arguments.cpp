#include "cli/arguments.h"

#include <algorithm>
#include <charconv>
#include <set>
#include <string_view>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "kernel/film/film_layout.h"

namespace relief {

namespace {

[[noreturn]] void refuse(const char* option, const char* expected, const std::string& found)
{
  throw CLI::ValidationError(option, fmt::format("expected {}, found '{}'", expected, found));
}

/// A whole text as a number; false on anything else.
bool to_int(std::string_view text, int* value)
{
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end;
}

std::vector<std::string_view> split(std::string_view text, char separator)
{
  std::vector<std::string_view> parts;
  while (true) {
    const std::size_t at = text.find(separator);
    parts.push_back(text.substr(0, at));
    if (at == std::string_view::npos) return parts;
    text.remove_prefix(at + 1);
  }
}

}  // namespace

void parse_resolution(const std::string& text, int* width, int* height)
{
  const auto parts = split(text, 'x');
  const auto fits = [](int v) { return v >= 1 && v <= 65536; };
  if (parts.size() != 2 || !to_int(parts[0], width) || !to_int(parts[1], height) || !fits(*width) || !fits(*height)) {
    refuse("--resolution", "WIDTHxHEIGHT, each from 1 to 65536", text);
  }
}

PixelRect parse_crop(const std::string& text)
{
  PixelRect rect;
  const auto parts = split(text, ',');
  if (parts.size() != 4 || !to_int(parts[0], &rect.x0) || !to_int(parts[1], &rect.y0) || !to_int(parts[2], &rect.x1) ||
      !to_int(parts[3], &rect.y1) || rect.x0 < 0 || rect.y0 < 0 || rect.x1 <= rect.x0 || rect.y1 <= rect.y0) {
    refuse("--crop", "X0,Y0,X1,Y1 in pixels with X0 < X1 and Y0 < Y1", text);
  }
  return rect;
}

PixelSample parse_pixel(const std::string& text, int width, int height)
{
  PixelSample pixel;
  int sample = 0;
  const auto parts = split(text, ',');
  if (parts.size() < 2 || parts.size() > 3 || !to_int(parts[0], &pixel.x) || !to_int(parts[1], &pixel.y) ||
      (parts.size() == 3 && !to_int(parts[2], &sample)) || pixel.x < 0 || pixel.y < 0 || pixel.x >= width ||
      pixel.y >= height || sample < 0) {
    refuse("--pixel", fmt::format("X,Y or X,Y,SAMPLE inside the image of {}x{}", width, height).c_str(), text);
  }
  pixel.sample_index = static_cast<std::uint32_t>(sample);
  return pixel;
}

std::vector<int> parse_frames(const std::string& text)
{
  constexpr const char* kExpected = "frames such as 1-10,20,30-60x2, from 0 to 1000000";
  constexpr int kLastFrame = 1'000'000;
  std::vector<int> frames;
  std::set<int> seen;
  for (std::string_view part : split(text, ',')) {
    int first = 0;
    int step = 1;
    const std::size_t times = part.find('x');
    if (times != std::string_view::npos) {
      if (!to_int(part.substr(times + 1), &step) || step < 1) refuse("--frames", kExpected, text);
      part = part.substr(0, times);
    }
    const std::size_t dash = part.find('-');
    if (!to_int(part.substr(0, dash), &first)) refuse("--frames", kExpected, text);
    int last = first;
    if (dash != std::string_view::npos && !to_int(part.substr(dash + 1), &last)) refuse("--frames", kExpected, text);
    if (dash == std::string_view::npos && times != std::string_view::npos) refuse("--frames", kExpected, text);
    if (first < 0 || last < first || last > kLastFrame) refuse("--frames", kExpected, text);
    for (int frame = first; frame <= last; frame += step) {
      if (seen.insert(frame).second) frames.push_back(frame);
    }
  }
  return frames;
}

std::uint32_t parse_aovs(const std::string& text)
{
  std::uint32_t mask = 1u << static_cast<int>(Aov::kBeauty);
  for (const std::string_view name : split(text, ',')) {
    if (name == "all") return (1u << kNumAovs) - 1u;
    const auto* info = std::find_if(kAovInfo.begin(), kAovInfo.end(), [&](const AovInfo& i) { return i.name == name; });
    if (info == kAovInfo.end()) {
      std::string names = "all";
      for (const AovInfo& i : kAovInfo) names += fmt::format(", {}", i.name);
      refuse("--aov", names.c_str(), std::string(name));
    }
    mask |= 1u << static_cast<int>(info->aov);
  }
  return mask;
}

std::filesystem::path frame_path(const std::filesystem::path& pattern, int frame)
{
  std::string name = pattern.filename().string();
  const std::size_t last = name.rfind('#');
  if (last == std::string::npos) {
    return pattern.parent_path() /
           fmt::format("{}.{:04}{}", pattern.stem().string(), frame, pattern.extension().string());
  }
  std::size_t first = last;
  while (first > 0 && name[first - 1] == '#') --first;
  name.replace(first, last + 1 - first, fmt::format("{:0{}}", frame, last + 1 - first));
  return pattern.parent_path() / name;
}

}  // namespace relief
