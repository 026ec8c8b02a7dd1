// RMIP as published: its traversal over its table.
#include "displacement/rmip.h"
#include "displacement/method.h"
#include "displacement/traverse_blended.h"
#include "displacement/traverse_rmip.h"

namespace relief {

namespace {

bool traverse(const PrismQuery& query, const void* table, DisplacedHit* hit)
{
  const auto& bounds = *static_cast<const RmipView*>(table);
  if (query.mesh.blend != nullptr) return RELIEF_ISA::traverse_blended(query, bounds, hit);
  return traverse_rmip(query, bounds, query.rmip_options, hit);
}

}  // namespace

const DisplacementMethodEntry RELIEF_ISA::rmip_method{
    .title = "RMIP",
    .description = "Ranges of oblong windows of the map (Thonat and others 2023)",
    .traverse = traverse,
    .table_make = rmip_table_make,
    .rmip_options = RmipOptionsUse::kAll,
};

}  // namespace relief
