#include "cli/arguments.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <iterator>
#include <limits>
#include <set>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "cli/value_hint.h"
#include "kernel/film/film_layout.h"
#include "scene/limits.h"

namespace relief {

namespace {

[[noreturn]] void refuse(const char* option, const std::string& expected, const std::string& found)
{
  throw CLI::ValidationError(option, fmt::format("expected {}, found '{}'", expected, found));
}

/// A whole text as a number; false on anything else.
template <class Number>
bool to_number(std::string_view text, Number* value)
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

Resolution parse_resolution(const std::string& text)
{
  Resolution size;
  const auto parts = split(text, 'x');
  const auto [low, high, labels] = setting_info("resolution").range;
  const auto fits = [low = low, high = high](int v) { return v >= low && v <= high; };
  if (parts.size() != 2 || !to_number(parts[0], &size.width) || !to_number(parts[1], &size.height) ||
      !fits(size.width) || !fits(size.height)) {
    refuse("--resolution", fmt::format("WIDTHxHEIGHT, each from {:g} to {:.0f}", low, high), text);
  }
  return size;
}

PixelRect parse_crop(const std::string& text)
{
  PixelRect rect;
  const auto parts = split(text, ',');
  if (parts.size() != 4 || !to_number(parts[0], &rect.x0) || !to_number(parts[1], &rect.y0) ||
      !to_number(parts[2], &rect.x1) || !to_number(parts[3], &rect.y1) || rect.x0 < 0 || rect.y0 < 0 ||
      rect.x1 <= rect.x0 || rect.y1 <= rect.y0) {
    refuse("--crop", "X0,Y0,X1,Y1 in pixels with X0 < X1 and Y0 < Y1", text);
  }
  return rect;
}

PixelSample parse_pixel(const std::string& text)
{
  PixelSample pixel;
  const auto parts = split(text, ',');
  if (parts.size() < 2 || parts.size() > 3 || !to_number(parts[0], &pixel.x) || !to_number(parts[1], &pixel.y) ||
      (parts.size() == 3 && !to_number(parts[2], &pixel.sample_index)) || pixel.x < 0 || pixel.y < 0) {
    refuse("--pixel", "X,Y or X,Y,SAMPLE, counted from 0", text);
  }
  return pixel;
}

SamplePart parse_part(const std::string& text)
{
  constexpr int kMost = 1'000'000;
  SamplePart part;
  const auto words = split(text, '/');
  if (words.size() != 2 || !to_number(words[0], &part.number) || !to_number(words[1], &part.count) || part.number < 1 ||
      part.number > part.count || part.count > kMost) {
    refuse("--part", "I/N with I from 1 to N", text);
  }
  return part;
}

std::pair<std::uint32_t, std::uint32_t> part_samples(const SamplePart& part, int samples)
{
  if (part.count == 1) return {0, static_cast<std::uint32_t>(samples)};
  constexpr std::int64_t kAligned = 4;
  if (samples / kAligned < part.count) {
    refuse("--part",
           fmt::format("at most {} parts of {} samples a pixel, four samples or more in each", samples / kAligned,
                       samples),
           fmt::format("{}/{}", part.number, part.count));
  }
  const auto start_of = [&](std::int64_t index) {
    return static_cast<std::uint32_t>(samples / kAligned * index / part.count * kAligned);
  };
  const auto end = part.number == part.count ? static_cast<std::uint32_t>(samples) : start_of(part.number);
  return {start_of(part.number - 1), end};
}

FrameList parse_frames(const std::string& text)
{
  const std::string expected = fmt::format("frames such as 1-10,20,30-60x2, from 0 to {}, or all", kLastFrame);
  if (text == "all") return {true, {}};
  std::vector<int> frames;
  std::set<int> seen;
  for (std::string_view part : split(text, ',')) {
    int first = 0;
    int step = 1;
    const std::size_t times = part.find('x');
    if (times != std::string_view::npos) {
      if (!to_number(part.substr(times + 1), &step) || step < 1) refuse("--frames", expected, text);
      part = part.substr(0, times);
    }
    const std::size_t dash = part.find('-');
    if (!to_number(part.substr(0, dash), &first)) refuse("--frames", expected, text);
    int last = first;
    if (dash != std::string_view::npos && !to_number(part.substr(dash + 1), &last)) refuse("--frames", expected, text);
    if (dash == std::string_view::npos && times != std::string_view::npos) refuse("--frames", expected, text);
    if (first < 0 || last < first || last > kLastFrame) refuse("--frames", expected, text);
    // A step beyond the last frame must not overflow.
    step = std::min(step, kLastFrame);
    for (int frame = first; frame <= last; frame += step) {
      if (seen.insert(frame).second) frames.push_back(frame);
    }
  }
  return {false, std::move(frames)};
}

std::string frames_text(const std::vector<int>& frames)
{
  std::string text;
  for (std::size_t i = 0; i < frames.size();) {
    std::size_t end = i + 1;
    while (end < frames.size() && frames[end] == frames[end - 1] + 1) ++end;
    text += fmt::format("{}{}", text.empty() ? "" : ",", frames[i]);
    if (end - i > 1) text += fmt::format("-{}", frames[end - 1]);
    i = end;
  }
  return text;
}

Vec3f parse_point(const char* option, const std::string& text)
{
  Vec3f point;
  const auto parts = split(text, ',');
  const bool is_point = parts.size() == 3 && to_number(parts[0], &point.x) && to_number(parts[1], &point.y) &&
                        to_number(parts[2], &point.z) && is_finite(point);
  if (!is_point || max_component(max(point, -point)) > kFarthest) {
    refuse(option, "X,Y,Z in metres, each within 1e15 of 0", text);
  }
  return point;
}

std::uint64_t parse_seed(const std::string& text)
{
  std::uint64_t seed = 0;
  if (!to_number(text, &seed)) refuse("--seed", "a whole number from 0 to 18446744073709551615", text);
  return seed;
}

std::vector<std::string> aov_words()
{
  std::vector<std::string> words = {"all"};
  for (const AovInfo& info : kAovInfo) words.emplace_back(info.name);
  return words;
}

AovMask parse_aovs(const std::string& text)
{
  AovMask mask = aov_bit(Aov::kBeauty);
  for (const std::string_view name : split(text, ',')) {
    if (name == "all") {
      mask = kAllAovs;
      continue;
    }
    const auto* info = std::find_if(kAovInfo.begin(), kAovInfo.end(), [&](const AovInfo& i) { return i.name == name; });
    if (info == kAovInfo.end()) {
      refuse("--aov", "names among " + words_text(aov_words()), std::string(name));
    }
    mask |= aov_bit(info->aov);
  }
  return mask;
}

EnvironmentChoice parse_environment(const std::string& text)
{
  EnvironmentChoice choice;
  choice.file = text;
  const std::size_t comma = text.rfind(',');
  if (comma != std::string::npos && to_number(std::string_view(text).substr(comma + 1), &choice.strength)) {
    choice.file = text.substr(0, comma);
  }
  constexpr float kGreatest = 1e6f;
  if (choice.file.empty() || !(choice.strength >= 0 && choice.strength <= kGreatest)) {
    refuse("--environment", "studio, sky, none or an image, and perhaps a strength from 0 to 1e6 after a comma", text);
  }
  const auto* found = std::find(std::begin(kEnvironmentPresetLabels), std::end(kEnvironmentPresetLabels), choice.file);
  choice.source = found == std::end(kEnvironmentPresetLabels)
                      ? EnvironmentSource::kFile
                      : static_cast<EnvironmentSource>(found - std::begin(kEnvironmentPresetLabels));
  return choice;
}

float parse_lod(const std::string& text)
{
  constexpr float kCoarsest = 30;
  float level = -1;
  if (text != "auto" && (!to_number(text, &level) || !(level >= 0 && level <= kCoarsest))) {
    refuse("--lod", "auto or a level from 0 to 30", text);
  }
  return level;
}

RmipOptions parse_rmip(const std::string& text)
{
  constexpr double kLeastScale = 1.0 / 1024, kMostScale = 1e6;
  constexpr int kMostBlocks = 2048;  // of each axis: 2.3 GiB
  constexpr std::string_view kSwitchLabels[] = {"off", "on"};
  RmipOptions options;
  std::vector<std::string_view> given;
  const auto choice = [&](std::string_view key, std::string_view value, std::span<const std::string_view> labels) {
    const auto found = std::find(labels.begin(), labels.end(), value);
    if (found != labels.end()) return found - labels.begin();
    refuse("--rmip", fmt::format("{0}={1} or {0}={2}", key, labels[0], labels[1]), text);
  };
  for (const std::string_view word : split(text, ',')) {
    const std::size_t sign = std::min(word.find('='), word.size());
    const std::string_view key = word.substr(0, sign), value = word.substr(std::min(sign + 1, word.size()));
    if (std::find(given.begin(), given.end(), key) != given.end())
      refuse("--rmip", fmt::format("'{}' once", key), text);
    given.push_back(key);
    if (key == "scale") {
      if (!to_number(value, &options.marching_scale) ||
          !(options.marching_scale >= kLeastScale && options.marching_scale <= kMostScale))
        refuse("--rmip", fmt::format("scale={}…{:.0f} texels", kLeastScale, kMostScale), text);
    } else if (key == "resolution") {
      if (!to_number(value, &options.resolution) || options.resolution < 1 || options.resolution > kMostBlocks)
        refuse("--rmip", fmt::format("resolution=1…{}", kMostBlocks), text);
    } else if (key == "inversion") {
      options.reduce_by_inversion = choice(key, value, kSwitchLabels) == 1;
    } else if (key == "split") {
      options.split = static_cast<RmipSplit>(choice(key, value, kRmipSplitLabels));
    } else if (key == "leaf") {
      options.leaf = static_cast<RmipLeaf>(choice(key, value, kRmipLeafLabels));
    } else if (key == "levels") {
      options.levels = static_cast<RmipLevels>(choice(key, value, kRmipLevelsLabels));
    } else if (key == "bounds") {
      options.bounds = static_cast<SpaceBounds>(choice(key, value, kSpaceBoundsLabels));
    } else {
      refuse("--rmip", "KEY=VALUE,… with the keys scale, resolution, inversion, split, leaf, levels, bounds", text);
    }
  }
  if (options.levels == RmipLevels::kInterpolated && options.leaf == RmipLeaf::kTriangles)
    refuse("--rmip", "levels=interpolated with leaf=bilinear", text);
  return options;
}

std::string parse_output(const char* option, const std::string& text, const char* suffix)
{
  std::string found = std::filesystem::path(text).extension().string();
  for (char& c : found) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  std::error_code ignored;
  const auto status = std::filesystem::status(text, ignored);
  const bool is_device = std::filesystem::exists(status) && !std::filesystem::is_regular_file(status) &&
                         !std::filesystem::is_directory(status);
  if (found != suffix && !is_device) {
    // The other option that writes pictures.
    const std::string hint = suffix == std::string(".exr") && found == ".png"
                                 ? " (--png NAME.png writes a PNG beside the OpenEXR)"
                                 : std::string();
    refuse(option, fmt::format("a name that ends in {}{}", suffix, hint), text);
  }
  return text;
}

CLI::Validator whole_number(int least, int most)
{
  const auto check = [=](const std::string& text) -> std::string {
    int value = 0;
    if (to_number(text, &value) && value >= least && value <= most) return {};
    return fmt::format("expected a whole number from {} to {}, found '{}'", least, most, text);
  };
  return {check, fmt::format("{}..{}", least, most), kRangeCheck};
}

CLI::Validator number(double least, double most)
{
  const auto check = [=](const std::string& text) -> std::string {
    double value = 0;
    // Written so that NaN is refused.
    if (to_number(text, &value) && value >= least && value <= most) return {};
    return fmt::format("expected a number from {:g} to {:g}, found '{}'", least, most, text);
  };
  return {check, fmt::format("{:g}..{:g}", least, most), kRangeCheck};
}

CLI::Validator one_of(std::vector<std::string> words)
{
  const std::string list = words_text(words);
  const auto check = [words = std::move(words), list](const std::string& text) -> std::string {
    if (std::find(words.begin(), words.end(), text) != words.end()) return {};
    return fmt::format("expected one of {}, found '{}'", list, text);
  };
  return {check, list, kOneOfCheck};
}

CLI::Validator setting_check(const SettingInfo& info)
{
  const auto [low, high, labels] = info.range;
  if (info.type == SettingType::kChoice) return one_of({labels.begin(), labels.end()});
  if (info.type == SettingType::kInteger) return whole_number(static_cast<int>(low), static_cast<int>(high));
  constexpr double kLargest = std::numeric_limits<float>::max();
  return number(std::max(low, -kLargest), std::min(high, kLargest));
}

std::string setting_help(const SettingInfo& info) { return fmt::format("{} (default: the scene's)", info.description); }

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

std::string shell_quoted(std::string_view argument)
{
  constexpr std::string_view kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=.,:/#@%";
  // A # begins a comment only where a word begins.
  if (!argument.empty() && argument.front() != '#' && argument.find_first_not_of(kPlain) == std::string_view::npos) {
    return std::string(argument);
  }
  std::string text = "'";
  for (const char c : argument) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

}  // namespace relief
