// How large scenes may be.
#pragma once

namespace relief {

/// Positions and sizes, metres: a tenth of a light-year. Squares still fit single precision.
inline constexpr float kFarthest = 1e15f;

}  // namespace relief
