// Aiming at an axis-aligned box: directions from a point, and points across a direction.
#pragma once

#include "kernel/light/rectangle.h"
#include "kernel/math/box.h"
#include "kernel/sample/warp.h"

namespace relief {

/// A direction towards a box.
struct BoxDirection {
  Vec3f D{};      ///< unit
  float pdf = 0;  ///< solid angle; 0: none
};

/// A face of a box as a rectangle light.
/// @param axis  0, 1, 2
RELIEF_KERNEL Light box_face(const Box3& box, int axis, bool upper)
{
  const Vec3f centre = 0.5f * (box.low + box.high);
  const Vec3f half = 0.5f * (box.high - box.low);
  Light face;
  face.two_sided = true;
  face.P = centre;
  if (axis == 0) {
    face.P.x = upper ? box.high.x : box.low.x;
    face.axis = {1, 0, 0};
    face.edge_u = {0, half.y, 0};
    face.edge_v = {0, 0, half.z};
  } else if (axis == 1) {
    face.P.y = upper ? box.high.y : box.low.y;
    face.axis = {0, 1, 0};
    face.edge_u = {0, 0, half.z};
    face.edge_v = {half.x, 0, 0};
  } else {
    face.P.z = upper ? box.high.z : box.low.z;
    face.axis = {0, 0, 1};
    face.edge_u = {half.x, 0, 0};
    face.edge_v = {0, half.y, 0};
  }
  face.area = 4.0f * length(face.edge_u) * length(face.edge_v);
  return face;
}

/// Solid angle of a rectangle light, whatever its size.
RELIEF_KERNEL float box_face_solid_angle(const Light& face, Vec3f P)
{
  const Vec3f centre = face.P - P;
  const float det = dot(centre, face.axis) * face.area;
  const Vec3f c00 = centre - face.edge_u - face.edge_v, c11 = centre + face.edge_u + face.edge_v;
  return triangle_solid_angle(c00, centre + face.edge_u - face.edge_v, c11, det) +
         triangle_solid_angle(c00, c11, centre - face.edge_u + face.edge_v, det);
}

/// Uniform (within a few per cent, which the pdf knows) in the solid angle of a box seen from outside. A ray that meets the
/// box enters through exactly one of the up to three faces that show, so the density needs no sum.
/// @param P  outside the box
/// @param u  [0, 1)²
RELIEF_KERNEL BoxDirection box_aim_from(const Box3& box, Vec3f P, Vec2f u)
{
  const float p[3] = {P.x, P.y, P.z};
  const float low[3] = {box.low.x, box.low.y, box.low.z};
  const float high[3] = {box.high.x, box.high.y, box.high.z};
  float omega[3] = {0, 0, 0};
  for (int axis = 0; axis < 3; ++axis) {
    if (p[axis] >= low[axis] && p[axis] <= high[axis]) continue;
    omega[axis] = box_face_solid_angle(box_face(box, axis, p[axis] > high[axis]), P);
  }
  const float sum = omega[0] + omega[1] + omega[2];
  if (!(sum > 0.0f)) return {};
  float target = u.x * sum;
  int axis = 0;
  while (axis < 2 && !(target < omega[axis] && omega[axis] > 0.0f)) target -= omega[axis++];
  if (!(omega[axis] > 0.0f)) return {};
  u.x = clamp(target / omega[axis], 0.0f, 0x1.fffffep-1f);
  const LightSample sample = light_sample(RectangleLight{}, box_face(box, axis, p[axis] > high[axis]), P, u);
  return {sample.wi, sample.pdf * (omega[axis] / sum)};
}

/// Area of a box's shadow.
/// @param D  unit, the direction of light
RELIEF_KERNEL float box_shadow_area(const Box3& box, Vec3f D)
{
  const Vec3f size = box.high - box.low;
  return __builtin_fabsf(D.x) * size.y * size.z + __builtin_fabsf(D.y) * size.z * size.x +
         __builtin_fabsf(D.z) * size.x * size.y;
}

/// A point of the faces that light along D falls on, uniform over the area across D (box_shadow_area).
/// @param u  [0, 1)²
RELIEF_KERNEL Vec3f box_aim_along(const Box3& box, Vec3f D, Vec2f u)
{
  const Vec3f size = box.high - box.low;
  const float d[3] = {D.x, D.y, D.z};
  const float shadow[3] = {__builtin_fabsf(D.x) * size.y * size.z, __builtin_fabsf(D.y) * size.z * size.x,
                           __builtin_fabsf(D.z) * size.x * size.y};
  float target = u.x * (shadow[0] + shadow[1] + shadow[2]);
  int axis = 0;
  while (axis < 2 && !(target < shadow[axis])) target -= shadow[axis++];
  const float x = shadow[axis] > 0.0f ? clamp(target / shadow[axis], 0.0f, 1.0f) : 0.5f;
  const Light face = box_face(box, axis, d[axis] < 0.0f);
  return face.P + face.edge_u * (2.0f * x - 1.0f) + face.edge_v * (2.0f * u.y - 1.0f);
}

/// Distance along a ray to where it has left a box that it starts in, a little more rather than less.
/// @param D  unit
RELIEF_KERNEL float box_distance_out(const Box3& box, Vec3f P, Vec3f D)
{
  const float p[3] = {P.x, P.y, P.z}, d[3] = {D.x, D.y, D.z};
  const float low[3] = {box.low.x, box.low.y, box.low.z}, high[3] = {box.high.x, box.high.y, box.high.z};
  float distance = kInfinity;
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == 0.0f) continue;
    distance = min(distance, ((d[axis] > 0.0f ? high[axis] : low[axis]) - p[axis]) / d[axis]);
  }
  constexpr float kMore = 1e-3f;
  return max(distance, 0.0f) * (1.0f + kMore) + kMore * length(box.high - box.low) * 1e-3f;
}

RELIEF_KERNEL bool box_contains(const Box3& box, Vec3f P)
{
  return P.x >= box.low.x && P.x <= box.high.x && P.y >= box.low.y && P.y <= box.high.y && P.z >= box.low.z &&
         P.z <= box.high.z;
}

}  // namespace relief
