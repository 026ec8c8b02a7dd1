// Ways to trace displaced triangles, and their names on the command line, in scenes and in reports.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace relief {

enum class TraversalMethod : std::uint8_t { kChord, kRmip, kRmipOnMinmax, kTfdm };

struct TraversalMethodLabel {
  TraversalMethod method;
  std::string_view name;
};

inline constexpr std::array<TraversalMethodLabel, 4> kTraversalMethods{{
    {TraversalMethod::kChord, "chord"},
    {TraversalMethod::kRmip, "rmip"},
    {TraversalMethod::kRmipOnMinmax, "rmip-minmax"},
    {TraversalMethod::kTfdm, "tfdm"},
}};

/// What RMIP's authors studied in their Figs. 10 and 12.
struct RmipOptions {
  double marching_scale = 16;       ///< texels; rectangles whose sides are no longer are marched through
  bool reduce_by_inversion = true;  ///< bounds are tightened by inverting the displacement at the ends of a 3D box
};

}  // namespace relief
