// Where rays leave from coarse smooth meshes, so that facets do not shadow themselves along the terminator.
#pragma once

#include "kernel/math/lanes.h"
#include "kernel/math/vec.h"

namespace relief {

/// Where a smooth surface lies that a triangle's normals suggest, seen from one of its points: along a vector, world, metres.
struct TriangleLift {
  Vec3f N{};  ///< mean of the vertices' normals, not unit
  float front = 0.0f,
        back = 0.0f;  ///< how far along it, for rays on the side of N (0 or more) and on the other (0 or less)
};

/// See TriangleLift. @tparam F  float, or lanes of it
template <typename F>
struct LiftHeights {
  F front, back;
};

/// How far from a point of a triangle a smooth surface lies that its normals suggest. Towards the side that bulges that is as far
/// as the lowest of the planes of its vertices, on which neighbours lie that stand above them: so what a ring of facets curves
/// inwards is cleared, too. On the other side it is half of what a paraboloid with these normals has between them.
/// @tparam V, F         Vec3f and float, or lanes of them
/// @param w, u, v       barycentric weights of the vertices
/// @param edge1, edge2  from vertex 0 to vertices 1 and 2
/// @param n0, n1, n2    unit
/// @return              see TriangleLift
/// @source as Cycles moves the origins of shadow rays
template <typename V, typename F>
RELIEF_KERNEL LiftHeights<F> triangle_lift(F w, F u, F v, V edge1, V edge2, V n0, V n1, V n2)
{
  const F zero{};
  const V edge12 = edge2 - edge1;
  // Heights of each vertex over the planes of the others, and of the point over all three.
  const F up01 = dot(edge1, n0), up02 = dot(edge2, n0), up10 = -dot(edge1, n1), up12 = dot(edge12, n1);
  const F up20 = -dot(edge2, n2), up21 = -dot(edge12, n2);
  const F up0 = u * up01 + v * up02, up1 = w * up10 + v * up12, up2 = w * up20 + u * up21;
  const F above =
      min(min(max(max(up01, up02) - up0, -up0), max(max(up10, up12) - up1, -up1)), max(max(up20, up21) - up2, -up2));
  const F below =
      min(min(max(up0 - min(up01, up02), up0), max(up1 - min(up10, up12), up1)), max(up2 - min(up20, up21), up2));
  const F half_bulge = -0.5f * (w * u * (up01 + up10) + u * v * (up12 + up21) + v * w * (up20 + up02));
  return {max(max(above, zero), half_bulge), min(-max(below, zero), half_bulge)};
}

/// What a ray's origin is moved by onto the smooth surface: nothing where it is well above the facet (its shadows are right
/// already), all where it is below, where a facet would shadow itself along the terminator.
/// @param wi  unit, its direction
/// @param Ng  unit, of the facet, on the side that it leaves by its shading normal
/// @param Ns  unit shading normal on that side
/// @source as Cycles does by its default, an offset of 0.1: the sine of the largest angle between facet and smooth normal on
///         meshes that look smooth (about 6°)
RELIEF_KERNEL Vec3f terminator_lift(const TriangleLift& lift, Vec3f wi, Vec3f Ng, Vec3f Ns)
{
  constexpr float kLiftedBelow = 0.1f;
  const float cos_g = dot(wi, Ng), cos_s = dot(wi, Ns);
  const float share = cos_s < kLiftedBelow ? 2.0f - (cos_g + cos_s) / kLiftedBelow : 1.0f - cos_g / kLiftedBelow;
  return lift.N * ((dot(lift.N, Ng) > 0.0f ? lift.front : lift.back) * clamp(share, 0.0f, 1.0f));
}

}  // namespace relief
