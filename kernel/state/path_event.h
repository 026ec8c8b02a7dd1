// What a path's present ray started from: which rays see something may depend on it.
#pragma once

#include <cstdint>

namespace relief {

/// What a path's present ray started from.
enum class PathEvent : std::uint32_t { kCamera, kDiffuse, kGlossy, kTransmission };

}  // namespace relief
