// RMIP through a surface between two levels: compiled once an instruction set, in a file of its own, so that the code for
// whole levels stays as it is.
#pragma once

#include "displacement/minmax_mipmap.h"
#include "displacement/prism_query.h"
#include "displacement/rmip_query.h"

namespace relief {

// As traverse_rmip, of a mesh with a blend, whose table is of the same kind. `bounds` are of the mesh's field.
namespace baseline {
bool traverse_blended(const PrismQuery& query, const RmipView& bounds, DisplacedHit* hit);
bool traverse_blended(const PrismQuery& query, const MinmaxMipmapView& bounds, DisplacedHit* hit);
}  // namespace baseline
namespace avx2 {
bool traverse_blended(const PrismQuery& query, const RmipView& bounds, DisplacedHit* hit);
bool traverse_blended(const PrismQuery& query, const MinmaxMipmapView& bounds, DisplacedHit* hit);
}  // namespace avx2

}  // namespace relief
