// Intensities of a luminaire by two angles, as IESNA's files tabulate them.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// Floats of a table: horizontal angles, vertical angles, then the values, one row a horizontal angle. Rows and values begin and
/// end with one that lies beyond the angles, for interpolation.
RELIEF_KERNEL constexpr int ies_table_size(int num_horizontal, int num_vertical)
{
  return num_horizontal + num_vertical + (num_horizontal + 2) * (num_vertical + 2);
}

/// Value between four, at `x` in [0, 1] from the second to the third.
/// @source Catmull and Rom 1974, "A Class of Local Interpolating Splines"
RELIEF_KERNEL float ies_cubic(const float v[4], float x)
{
  const float rise = 3.0f * (v[1] - v[2]) + v[3] - v[0];
  const float bend = 2.0f * v[0] - 5.0f * v[1] + 4.0f * v[2] - v[3];
  return v[1] + 0.5f * x * (v[2] - v[0] + x * (bend + x * rise));
}

/// Where an angle lies: the last of the tabulated ones that is less, and how far on the way to the next.
/// @param angles  ascending; num >= 2
/// @pre           angle is within them
RELIEF_KERNEL int ies_cell(const float* angles, int num, float angle, float* rest)
{
  int low = 0, high = num - 1;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (angles[middle] < angle ? low : high) = middle;
  }
  *rest = (angle - angles[low]) / (angles[high] - angles[low]);
  return low;
}

/// @param table       see ies_table_size
/// @param horizontal  radians, 0 to 2π
/// @param vertical    radians, 0 to π; 0: along the luminaire's axis
/// @return            never negative; 0 outside of the angles, and where one is no number
RELIEF_KERNEL float ies_eval(const float* table, int num_horizontal, int num_vertical, float horizontal, float vertical)
{
  const float* h = table;
  const float* v = h + num_horizontal;
  const float* values = v + num_vertical;
  if (!(horizontal >= h[0] && horizontal <= h[num_horizontal - 1])) return 0.0f;
  if (!(vertical >= v[0] && vertical < v[num_vertical - 1])) return 0.0f;
  float x, y;
  const int row = ies_cell(h, num_horizontal, horizontal, &x), column = ies_cell(v, num_vertical, vertical, &y);
  float along[4];
  for (int i = 0; i < 4; ++i) along[i] = ies_cubic(values + (row + i) * (num_vertical + 2) + column, y);
  return max(0.0f, ies_cubic(along, x));
}

}  // namespace relief
