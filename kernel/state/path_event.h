// What a path's present ray started from: which rays see something may depend on it.
#pragma once

#include <cstdint>

namespace relief {

/// What a path's present ray started from.
enum class PathEvent : std::uint32_t { kCamera, kDiffuse, kGlossy, kTransmission };

/// In sets of rays that do not see something, bits PathEvent, in place of the camera's: those that media have scattered.
inline constexpr std::uint32_t kHiddenFromScattered = 1u << 0;

}  // namespace relief
