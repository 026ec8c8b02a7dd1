#include "displacement/traverse_blended.h"

#include "displacement/blended_march.h"

namespace relief {

namespace {

template <class Bounds>
bool traverse(const PrismQuery& q, const Bounds& bounds, DisplacedHit* hit)
{
  const HeightFieldView &fine = *q.mesh.field, &coarse = *q.mesh.blend->coarse;
  const BlendedBounds<Bounds> blended{bounds, *static_cast<const Bounds*>(q.mesh.blend->table),
                                      static_cast<double>(coarse.map.width) / fine.map.width,
                                      static_cast<double>(coarse.map.height) / fine.map.height};
  return traverse_rmip(q, blended, q.rmip_options, hit);
}

}  // namespace

bool RELIEF_ISA::traverse_blended(const PrismQuery& query, const RmipView& bounds, DisplacedHit* hit)
{
  return traverse(query, bounds, hit);
}

bool RELIEF_ISA::traverse_blended(const PrismQuery& query, const MinmaxMipmapView& bounds, DisplacedHit* hit)
{
  return traverse(query, bounds, hit);
}

}  // namespace relief
