// Where a time lies among evenly spaced steps of a mesh that deforms while the shutter is open. The tracer and shading have it
// from here, so that both mean the same shape.
#pragma once

#include <cstdint>

#include "kernel/math/vec.h"

namespace relief {

/// Place of a time between two of a mesh's steps.
struct StepPlace {
  std::uint32_t step;  ///< the one before
  float part;          ///< of the way to the next, 0…1
};

/// As Embree has it, in single precision.
/// @param time       0…1
/// @param num_steps  at least 2
RELIEF_KERNEL StepPlace step_place(float time, std::uint32_t num_steps)
{
  const float along = time * static_cast<float>(num_steps - 1);
  const auto before = static_cast<std::uint32_t>(along);
  const std::uint32_t step = before < num_steps - 2 ? before : num_steps - 2;
  return {step, along - static_cast<float>(step)};
}

}  // namespace relief
