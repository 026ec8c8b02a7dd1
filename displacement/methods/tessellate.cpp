// Tessellation into Embree's quadrilaterals, see tessellation.h.
#include "displacement/method.h"

namespace relief {

const DisplacementMethodEntry RELIEF_ISA::tessellate_method{
    .title = "Tessellate",
    .description = "Triangles of a texel's size: an approximation that needs much memory",
    .tessellation = TessellationKind::kQuads,
    .cost = MethodCost{283, 39, 285},
};

}  // namespace relief
