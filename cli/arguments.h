// Parsing and checking of option values. Everything odd throws CLI::ValidationError (exit code 2) that says what was
// expected and what was found; all of it runs while the command line is parsed, before any file is touched.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/App.hpp>

#include "displacement/method_table.h"
#include "kernel/math/vec.h"
#include "kernel/statistics.h"
#include "scene/environment_preset.h"
#include "scene/render_settings.h"

namespace relief {

struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  ///< half open; all 0: none given
};

struct Resolution {
  int width = 0, height = 0;  ///< pixels; 0: none given
};

/// "WxH", each in the range of the setting `resolution`.
Resolution parse_resolution(const std::string& text);

/// "X0,Y0,X1,Y1" with X0 < X1, Y0 < Y1, all ≥ 0.
PixelRect parse_crop(const std::string& text);

/// "X,Y" or "X,Y,SAMPLE", none negative.
PixelSample parse_pixel(const std::string& text);

/// One of several parts of the samples of a pixel; each part has other ones of the same sequence.
struct SamplePart {
  int number = 1, count = 1;  ///< 1 … count
};

/// "I/N".
SamplePart parse_part(const std::string& text);

/// First sample of a part, and the one after its last. Parts begin at multiples of four (RenderOptions::first_sample).
/// @error CLI::ValidationError if there are not four samples for each part
std::pair<std::uint32_t, std::uint32_t> part_samples(const SamplePart& part, int samples);

struct FrameList {
  bool all = false;          ///< those of the scene
  std::vector<int> numbers;  ///< each 0 … kLastFrame; empty only if `all`
};
inline constexpr auto kLastFrame = static_cast<int>(setting_info("frameRange").range.high);

/// "all", or "1-10,20,30-60x2": single frames, ranges, ranges with a step; in the order given, each frame once.
FrameList parse_frames(const std::string& text);

/// Frames as parse_frames takes them, runs of consecutive ones short: "1-10,20".
std::string frames_text(const std::vector<int>& frames);

/// "X,Y,Z" in metres, within 1e15 of the origin.
Vec3f parse_point(const char* option, const std::string& text);

/// A whole number of 64 bits without sign.
std::uint64_t parse_seed(const std::string& text);

/// Names of AOVs separated by commas, or "all"; beauty is always in.
/// @return bit i: enumerator i of Aov
AovMask parse_aovs(const std::string& text);

/// What parse_aovs knows.
std::vector<std::string> aov_words();

/// "studio", "sky", "none" or the name of an image, perhaps with ",STRENGTH". What follows a name's last comma is a strength
/// if it is a number; "./a,1.hdr,1" is a file "a,1.hdr".
EnvironmentChoice parse_environment(const std::string& text);

/// A level of detail of height maps, or "auto": −1.
float parse_lod(const std::string& text);

/// "KEY=VALUE,…" with the keys scale, resolution, inversion, split, leaf and levels, each at most once; what is left out stays as
/// RMIP has it by default.
RmipOptions parse_rmip(const std::string& text);

/// Refuses an output whose name does not end in `suffix` (upper or lower case), so that no format hides under the
/// name of another. Devices and pipes may have any name.
/// @param suffix  lower case, with its dot
std::string parse_output(const char* option, const std::string& text, const char* suffix);

/// Checks of numbers for CLI::Option::check; NaN, infinity and trailing text are refused.
CLI::Validator whole_number(int least, int most);
CLI::Validator number(double least, double most);

/// Likewise for a choice among words.
CLI::Validator one_of(std::vector<std::string> words);

/// For an option in place of one of the scene's settings, a number or a choice: refuses what the scene may not say either.
CLI::Validator setting_check(const SettingInfo& info);

/// What --help says of such an option.
std::string setting_help(const SettingInfo& info);

/// An argument as a shell would have to be given it again.
std::string shell_quoted(std::string_view argument);

/// A text option that is parsed into `value` while the command line is read.
template <class Value, class Parse>
CLI::Option* add_parsed(CLI::App& command, const char* name, Value& value, Parse parse, const char* description)
{
  return command.add_option_function<std::string>(
      name, [&value, parse](const std::string& text) { value = parse(text); }, description);
}

/// An option in place of a choice of the scene's settings. Without it `value` stays as it is.
template <class Value>
CLI::Option* add_choice(CLI::App& command, const char* name, std::optional<Value>& value, const SettingInfo& info)
{
  const auto labels = info.range.labels;
  const auto set = [&value, labels](const std::string& text) {
    value = static_cast<Value>(std::find(labels.begin(), labels.end(), text) - labels.begin());
  };
  return command.add_option_function<std::string>(name, set, setting_help(info))->check(setting_check(info));
}

/// Output path of a frame: a run of '#' in the file name becomes the number, padded to the run's length; without one,
/// ".0001" goes before the extension.
std::filesystem::path frame_path(const std::filesystem::path& pattern, int frame);

}  // namespace relief
