// How large scenes may be.
#pragma once

namespace relief {

/// Positions and sizes, metres: a tenth of a light-year. Squares still fit single precision. Double, since the nearest float is
/// below it: a scene may say 1e15 itself.
inline constexpr double kFarthest = 1e15;

/// Positions on displaced surfaces, of which only a loose bound is known. What is within kFarthest before it is displaced
/// must not be refused for the looseness.
inline constexpr double kFarthestDisplaced = 2 * kFarthest;

}  // namespace relief
