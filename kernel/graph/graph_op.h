// The opcodes of value graphs. Apart from graph_program.h, so that a new one leaves the stages alone.
#pragma once

#include <cstdint>

namespace relief {

enum class GraphOp : std::uint16_t {
#define X(name, outputs, inputs, immediates) name,
#include "kernel/graph/graph_ops.inc"
#undef X
};

/// Without the name: data that points to something is not the same for every instruction set.
struct GraphOpShape {
  int num_outputs, num_inputs, num_immediates;
};
inline constexpr GraphOpShape kGraphOpShapes[] = {
#define X(name, outputs, inputs, immediates) {outputs, inputs, immediates},
#include "kernel/graph/graph_ops.inc"
#undef X
};

}  // namespace relief
