// RMIP's traversal over a min-max mipmap in place of its table: Fig. 10 of its paper.
#include "displacement/method.h"
#include "displacement/traverse_blended.h"
#include "displacement/traverse_rmip.h"

namespace relief {

namespace {

bool traverse(const PrismQuery& query, const void* table, DisplacedHit* hit)
{
  const auto& bounds = *static_cast<const MinmaxMipmapView*>(table);
  if (query.mesh.blend != nullptr) return RELIEF_ISA::traverse_blended(query, bounds, hit);
  return traverse_rmip(query, bounds, query.rmip_options, hit);
}

}  // namespace

const DisplacementMethodEntry RELIEF_ISA::rmip_minmax_method{
    .title = "RMIP over min-max",
    .description = "RMIP's traversal over a min-max mipmap, for comparisons",
    .traverse = traverse,
    .table_make = minmax_table_make,
    .rmip_options = RmipOptionsUse::kAll,
};

}  // namespace relief
