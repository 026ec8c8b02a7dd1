// Rays that start far from what they are to meet.
//
// Single precision errs in proportion to the distance of a ray's origin: from a thousand sizes away Embree's tests of boxes
// are off by more than any pad, and beyond 1.8e18 it refuses the ray. So a ray is moved ahead, in double precision, to
// before it enters the box of all that it may meet; what is left of its errors are ulps of the box.
#pragma once

#include "displacement/vec3d.h"
#include "kernel/math/box.h"
#include "kernel/math/rounding.h"

namespace relief {

/// A box that rays are traced in, and the larger one around it from which they need not be moved.
struct RayTarget {
  Box3 box = box_empty();
  Box3 near_box = box_empty();  ///< larger on all sides by as many lengths of the box as are near
};

/// @param lengths  that are near
RELIEF_KERNEL RayTarget ray_target_make(const Box3& box, float lengths = 1.0f)
{
  const float reach = lengths * length(box.high - box.low);
  return {box, {box.low - splat3(reach), box.high + splat3(reach)}};
}

/// A bound on what single precision errs by, metres, while a ray that starts near is tested against boxes: roundings of its
/// origin and direction (1 + 2 units of the farthest coordinate), of Embree's reciprocal direction (8) and of its products
/// and differences (4), twice over. Embree's tests of boxes around user geometry are not robust, whatever the scene's flag.
RELIEF_KERNEL float ray_target_pad(const RayTarget& target)
{
  const float farthest = max_component(max(abs(target.near_box.low), abs(target.near_box.high)));
  return 32.0f * kUnitRoundoff * farthest;
}

/// False for NaN.
RELIEF_KERNEL bool ray_starts_near(const RayTarget& target, Vec3d O)
{
  const Box3& b = target.near_box;
  return O.x >= b.low.x && O.x <= b.high.x && O.y >= b.low.y && O.y <= b.high.y && O.z >= b.low.z && O.z <= b.high.z;
}

/// Moves the origin of a ray that does not start near along the ray, to a little before it enters the box.
/// @param O  finite; on the ray to about an ulp of what it is after the call
/// @param D  finite
/// @return   how far it was moved, in lengths of D; negative: it misses the box
RELIEF_KERNEL double ray_move_near(const RayTarget& target, Vec3d* O, Vec3d D)
{
  const double low[3] = {target.box.low.x, target.box.low.y, target.box.low.z};
  const double high[3] = {target.box.high.x, target.box.high.y, target.box.high.z};
  const double d[3] = {D.x, D.y, D.z};
  // What a step may leave of its rounding: less than what single precision tells apart of the box.
  const double length = max(high[0] - low[0], max(high[1] - low[1], high[2] - low[2]));
  const double size = max(__builtin_fabs(d[0]), max(__builtin_fabs(d[1]), __builtin_fabs(d[2])));
  double moved = 0;
  // Where the box is little to the distance's ulp, the first steps end beside it, before or behind.
  constexpr int kMostSteps = 8;
  for (int step = 0; step < kMostSteps; ++step) {
    const double o[3] = {O->x, O->y, O->z};
    double enter = -__builtin_huge_val(), leave = __builtin_huge_val();
    for (int k = 0; k < 3; ++k) {
      if (d[k] == 0) {
        if (!(o[k] >= low[k] && o[k] <= high[k])) return -1;
        continue;
      }
      const double a = (low[k] - o[k]) / d[k], b = (high[k] - o[k]) / d[k];
      enter = max(enter, min(a, b));
      leave = min(leave, max(a, b));
    }
    // The quotients err by a few ulps each.
    const double slack = 0x1p-50 * (__builtin_fabs(enter) + __builtin_fabs(leave));
    if (!(enter - leave <= slack && moved + leave + slack >= 0)) return -1;
    *O = {__builtin_fma(enter, d[0], o[0]), __builtin_fma(enter, d[1], o[1]), __builtin_fma(enter, d[2], o[2])};
    moved += enter;
    if (__builtin_fabs(enter) * size <= 0x1p24 * length) break;
  }
  // Not onto the box itself, in which surfaces may lie: half its length before it is still near.
  const double back = 0.5 * length / size;
  *O = {__builtin_fma(-back, d[0], O->x), __builtin_fma(-back, d[1], O->y), __builtin_fma(-back, d[2], O->z)};
  moved -= back;
  return ray_starts_near(target, *O) && moved >= 0 ? moved : -1;
}

}  // namespace relief
