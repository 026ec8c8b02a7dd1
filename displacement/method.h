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

}  // namespace relief
