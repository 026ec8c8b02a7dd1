// Parsing of option values that CLI11 has no type for. All throw CLI::ValidationError (exit code 2) on anything odd.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace relief {

struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  ///< half open; all 0: none given
};

/// "WxH", each 1 … 65536.
void parse_resolution(const std::string& text, int* width, int* height);

/// "X0,Y0,X1,Y1" with X0 < X1, Y0 < Y1, all ≥ 0.
PixelRect parse_crop(const std::string& text);

struct PixelSample {
  int x = 0, y = 0;
  std::uint32_t sample_index = 0;
};

/// "X,Y" or "X,Y,SAMPLE", inside an image of that size.
PixelSample parse_pixel(const std::string& text, int width, int height);

/// "1-10,20,30-60x2": single frames, ranges, ranges with a step; in the order given, each frame once.
std::vector<int> parse_frames(const std::string& text);

/// Names of AOVs separated by commas, or "all"; beauty is always in.
/// @return bit i: enumerator i of Aov
std::uint32_t parse_aovs(const std::string& text);

/// Output path of a frame: a run of '#' in the file name becomes the number, padded to the run's length; without one,
/// ".0001" goes before the extension.
std::filesystem::path frame_path(const std::filesystem::path& pattern, int frame);

}  // namespace relief
