// Closed intervals of doubles whose arithmetic rounds outward: the result holds every result of members.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace relief::oracle {

/// More than the rounding error of one operation: half a unit in the last place is at most 2^-53 of the value. The
/// second term is for results below the normal range.
inline double rounding_bound(double value) { return std::abs(value) * 0x1.8p-52 + 1e-300; }
inline double round_down(double value) { return value - rounding_bound(value); }
inline double round_up(double value) { return value + rounding_bound(value); }

struct Interval {
  double low = 0, high = 0;

  double mid() const { return low + .5 * (high - low); }
  double width() const { return high - low; }
  /// Largest absolute value of a member.
  double magnitude() const { return std::max(std::abs(low), std::abs(high)); }
  /// Smallest absolute value of a member.
  double mignitude() const { return low > 0 ? low : high < 0 ? -high : 0; }
  bool contains(double value) const { return low <= value && value <= high; }
  bool contains(const Interval& other) const { return low <= other.low && other.high <= high; }
  bool holds_strictly(const Interval& other) const { return low < other.low && other.high < high; }
  /// False if one of the four numbers is NaN.
  bool overlaps(const Interval& other) const { return low <= other.high && other.low <= high; }
};

inline Interval hull(const Interval& a, const Interval& b)
{
  return {std::min(a.low, b.low), std::max(a.high, b.high)};
}
/// @pre  a.overlaps(b)
inline Interval intersection(const Interval& a, const Interval& b)
{
  return {std::max(a.low, b.low), std::min(a.high, b.high)};
}
inline Interval widened(const Interval& a, double by) { return {round_down(a.low - by), round_up(a.high + by)}; }
inline Interval thin(double value) { return {value, value}; }

inline Interval operator-(const Interval& a) { return {-a.high, -a.low}; }
inline Interval operator+(const Interval& a, const Interval& b)
{
  return {round_down(a.low + b.low), round_up(a.high + b.high)};
}
inline Interval operator-(const Interval& a, const Interval& b)
{
  return {round_down(a.low - b.high), round_up(a.high - b.low)};
}
inline Interval operator*(double a, const Interval& b)
{
  const double first = a * b.low, second = a * b.high;
  return {round_down(std::min(first, second)), round_up(std::max(first, second))};
}
inline Interval operator*(const Interval& a, const Interval& b)
{
  const double w = a.low * b.low, x = a.low * b.high, y = a.high * b.low, z = a.high * b.high;
  return {round_down(std::min(std::min(w, x), std::min(y, z))), round_up(std::max(std::max(w, x), std::max(y, z)))};
}
/// @pre  0 is not in b
inline Interval operator/(const Interval& a, const Interval& b)
{
  return a * Interval{round_down(1 / b.high), round_up(1 / b.low)};
}
inline Interval square(const Interval& a)
{
  const double low = a.mignitude(), high = a.magnitude();
  return {std::max(0., round_down(low * low)), round_up(high * high)};
}
/// @pre  a.low >= 0
inline Interval square_root(const Interval& a)
{
  return {std::max(0., round_down(std::sqrt(a.low))), round_up(std::sqrt(a.high))};
}

}  // namespace relief::oracle
