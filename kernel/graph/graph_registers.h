// What a run of a value graph reads and leaves: eight points' registers.
#pragma once

#include "kernel/graph/graph_program.h"
#include "kernel/math/lanes.h"
#include "kernel/texture/texture_view.h"

namespace relief {

/// A question of how much of a hemisphere is open, world with Z up.
struct GraphOpenShare {
  Vec3f O[2];      ///< where rays leave: on the side of the viewer, on the other
  Vec3f Ng;        ///< geometric normal on the side of the viewer
  Vec3f N;         ///< whose hemisphere it is; of any length
  Vec3f wo;        ///< with O what is told apart by
  float distance;  ///< metres that are looked
  int num_rays;
  std::int32_t instance;  ///< whose object alone counts; −1: all do
  float time;             ///< of the ray, see motion.h
};

/// A question of what the normal would be if edges were rounded, world with Z up.
struct GraphBevel {
  Vec3f P;
  Vec3f Ng;      ///< unit geometric normal, on either side
  Vec3f wo;      ///< with P what is told apart by
  float radius;  ///< metres that are looked
  int num_rays;
  std::int32_t instance;  ///< whose object it is
  float time;             ///< of the ray, see motion.h
};

/// What looks around in the scene for graphs. Null where there is none yet: all is open then, and edges are as they are.
struct GraphRays {
  float (*open_share)(const void* scene, const GraphOpenShare& question) = nullptr;
  /// @return  unit, on the front side; (0, 0, 0): nothing was met
  Vec3f (*bevel)(const void* scene, const GraphBevel& question) = nullptr;
  const void* scene = nullptr;
};

/// Registers of one run; its inputs are written before, its outputs read after.
struct GraphRegisters {
  F8 lanes[kMostGraphRegisters];
  unsigned used = 0xff;  ///< lanes that mean something, bit by bit
  GraphRays rays = {};
};

RELIEF_KERNEL F8 graph_operand(const GraphProgramView& program, const GraphRegisters& registers, std::uint16_t operand)
{
  return operand < kMostGraphRegisters ? registers.lanes[operand]
                                       : splat8(program.constants[operand - kMostGraphRegisters]);
}

/// One point's lane of a program that has run.
struct GraphLane {
  const GraphProgramView* program;
  const GraphRegisters* registers;
  int lane;
};

/// A number that closures ask for.
/// @param result  into the program's results
RELIEF_KERNEL float graph_result(const GraphLane& at, int result)
{
  const std::uint16_t operand = at.program->results[result];
  if (operand == kNoGraphOperand) return 0.0f;
  return operand < kMostGraphRegisters ? at.registers->lanes[operand][at.lane]
                                       : at.program->constants[operand - kMostGraphRegisters];
}

/// What a program that has run gives at one lane's point.
RELIEF_KERNEL GraphValues graph_values(const GraphLane& at)
{
  GraphValues values;
  for (int i = 0; i < kNumGraphOutputs; ++i) {
    const std::uint16_t* operands = at.program->outputs[i];
    if (operands[0] == kNoGraphOperand) continue;
    const auto number = [&](int c) { return graph_operand(*at.program, *at.registers, operands[c])[at.lane]; };
    values.of[i] = {number(0), number(1), number(2)};
    values.given |= 1u << i;
  }
  return values;
}

}  // namespace relief
