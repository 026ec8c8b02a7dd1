// The order in which a program runs its operations, and which of them it may leave out.
//
// Sethi and Ullman 1970, "The Generation of Optimal Code for Arithmetic Expressions": the order. It is optimal for trees;
// graphs share values, and for these it is a heuristic.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernel/graph/graph_op.h"

namespace relief {

struct ScheduleOperation {
  GraphOp op;
  std::vector<std::int32_t> needs;  ///< operations that inputs come from; −1: from none. All are before this one
  std::int32_t group = -1;          ///< of guards: those of one factor stand side by side
};

struct ScheduleStep {
  enum class Kind : std::uint8_t {
    kRun,   ///< an operation
    kSkip,  ///< up to the group's guards, where their factor is 0 at all points
    kEnd,   ///< of what kSkip leaves out
  } kind;
  std::int32_t index;  ///< of the operation, or the group
};

struct GraphSchedule {
  std::vector<ScheduleStep> steps;
  std::vector<char> is_guarded;  ///< by group; guards of others are not run: their value is that of their first input
};

/// @param wanted      operations whose outputs the program gives, in the order in which they are to come
/// @param num_groups  of guards; 0: none is heeded
GraphSchedule graph_schedule(std::span<const ScheduleOperation> operations,
                             std::span<const std::int32_t> wanted,
                             std::size_t num_groups);

}  // namespace relief
