// What the stages that ask Embree count of displaced meshes.
#pragma once

#include <cstdint>

#include "integrator/accel.h"

namespace relief {

/// What the rays of a worker did in displaced meshes.
struct DisplacementWork {
  TraversalCounters total;
  std::uint32_t most_steps = 0;  ///< bounds and texels, of any single ray
};

/// Notes the steps of one ray and clears them for the next.
inline void note_steps(std::uint32_t& steps, DisplacementWork& work)
{
  if (steps > work.most_steps) work.most_steps = steps;
  steps = 0;
}

}  // namespace relief
