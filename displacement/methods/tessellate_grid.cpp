// Tessellation into Embree's grids, see tessellation.h.
#include "displacement/method.h"

namespace relief {

const DisplacementMethodEntry RELIEF_ISA::tessellate_grid_method{
    .title = "Tessellate to grids",
    .description = "The same in Embree's grids: less memory, slower",
    .tessellation = TessellationKind::kGrids,
    .cost = MethodCost{366, 58, 95},
};

}  // namespace relief
