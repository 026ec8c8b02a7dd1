// What one ray did: a record of every prism whose box it entered, in the order of the tracer, and what to say of it.
// Recording costs a pointer test a prism while nobody asks.
#pragma once

#include <cstddef>

#include "displacement/embree_geometry.h"

namespace relief {

/// One call of a traversal for one triangle.
struct PrismVisit {
  const DisplacedGeometry* geometry = nullptr;
  std::uint32_t instance = 0, triangle = 0;
  float time = 0;
  ObjectRay ray;                ///< all t of the visit are its own
  double t_min = 0, t_max = 0;  ///< what was searched; t_max falls with every hit
  TraversalCounters counters;   ///< of this call
  bool found = false;
  DisplacedHit hit;
};

/// A ray's origin and direction in the geometry's space, before it was moved.
struct ExplainedRay {
  Vec3f O, D;
};

/// Where a traversal puts its visits: room of the caller's.
struct PrismVisits {
  PrismVisit* visits = nullptr;
  std::size_t capacity = 0;
  std::size_t size = 0;  ///< of all visits; those beyond the capacity are counted only
};

RELIEF_KERNEL void prism_visits_add(PrismVisits& visits, const PrismVisit& visit)
{
  if (visits.size < visits.capacity) visits.visits[visits.size] = visit;
  ++visits.size;
}

/// A stretch of a ray inside a prism.
struct PrismStretch {
  double t0 = 0, t1 = 0;  ///< of the ray that was asked about
  double s0 = 0, s1 = 0;  ///< d/|N| where it begins and ends
};

/// The geometry behind a visit.
struct PrismExplanation {
  ExplainedRay ray;
  double t_min = 0, t_max = 0, t = 0;         ///< of the visit and its hit, of the ray that was asked about
  PrismStretch stretches[kMaxCurveSegments];  ///< in the order of t
  int num_stretches = 0;                      ///< 0: the ray enters the box and misses the prism
  bool folded = false;                        ///< displacement lines may cross: every stretch is searched to its end
  std::uint32_t triangle = 0;                 ///< of the mesh
  double b1 = 0, b2 = 0;                      ///< of the hit, its weights
  bool has_map = true;                        ///< else heights are computed, and cells the lattice's
  double u = 0, v = 0;                        ///< in the height map, whole periods taken off
  std::int64_t i = 0, j = 0;                  ///< its cell, likewise
  double h = 0, d = 0;                        ///< its height, and the displacement in metres of object space
};

/// @param t_unit  what one unit of t of the ray that was traced is in that of the ray that was asked about, a power of two: the
///                two differ in the lengths of their directions
PrismExplanation prism_explain(const PrismVisit& visit, double t_unit = 1);

}  // namespace relief
