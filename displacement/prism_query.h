// What methods are asked: a ray's curve in the prism of one displaced triangle; and the test of one cell that they end in.
#pragma once

#include "displacement/leaf.h"
#include "displacement/method_table.h"

namespace relief {

/// A ray's curve in one triangle of a mesh, object space.
struct PrismQuery {
  const DisplacedMeshView& mesh;
  std::uint32_t triangle;
  const RayCurve& curve;  ///< of this ray and triangle
  double t_min, t_max;    ///< hits count within; in units of the ray's direction
  bool any_hit;           ///< whichever is found first will do
  const RmipOptions& rmip_options;
  TraversalCounters& counters;
};

RELIEF_KERNEL PrismSearch prism_search_make(const PrismQuery& q, DisplacedHit* hit)
{
  return {q.mesh,
          q.mesh.triangles[q.triangle],
          q.curve,
          q.counters,
          *hit,
          q.t_min,
          q.t_max,
          q.mesh.unfolded[q.triangle] != 0,
          q.any_hit,
          false,
          q.counters.bounds + kBoundsAPoll};
}

/// The leaf test of one cell, in which all traversals end; keeps the nearest hit.
/// @param g           segment of the curve
/// @param place       the cell, see leaf_intersect
/// @param tau0, tau1  contains every τ at which the curve is in the cell; may reach beyond [0, 1]
/// @return            true if there was one
template <class Cell>
RELIEF_KERNEL bool cell_intersect(PrismSearch& c, const CurveSegment& g, const Cell& place, double tau0, double tau1)
{
  ++c.counters.texels;
  const bool found = leaf_intersect(c, g, place, {max(tau0, 0.0), min(tau1, 1.0)});
  c.found |= found;
  return found;
}

/// The same where the mesh has the heights of its field.
/// @param i, j  the cell, lattice coordinates
RELIEF_KERNEL bool cell_intersect(PrismSearch& c,
                                  const CurveSegment& g,
                                  std::int64_t i,
                                  std::int64_t j,
                                  double tau0,
                                  double tau1)
{
  return cell_intersect(c, g, LatticeCell{i, j}, tau0, tau1);
}

}  // namespace relief
