// Spaces in which an OpenEXR may hold its colours. In memory they are always linear Rec.709: files are converted as they are
// written and read.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace relief {

enum class ColorSpace : std::uint8_t { kRec709, kAcescg };

/// Names in enumerator order, for options and messages.
inline constexpr std::array<std::string_view, 2> kColorSpaceNames = {"rec709", "acescg"};

/// CIE xy of the primaries and of white.
struct Chromaticities {
  std::array<double, 2> red, green, blue, white;
};

/// @source Rec. ITU-R BT.709; Academy S-2014-004 (ACEScg)
inline constexpr std::array<Chromaticities, 2> kChromaticities = {
    Chromaticities{{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, {0.3127, 0.3290}},
    Chromaticities{{0.713, 0.293}, {0.165, 0.830}, {0.128, 0.044}, {0.32168, 0.33767}}};

/// Rows of a matrix from linear colours of one space to those of another, whose white looks white there.
using ColorMatrix = std::array<std::array<double, 3>, 3>;
/// @source white is adapted as by Lam's cones (Bradford), as in ACES
ColorMatrix color_matrix(ColorSpace from, ColorSpace to);

/// Which of red, green and blue a channel of a file is, of a layer that holds radiance or reflectance. Others, variances and
/// normals among them, are numbers that stay as they are. @return 0 to 2; nothing for those
std::optional<std::size_t> color_component(std::string_view channel);

}  // namespace relief
