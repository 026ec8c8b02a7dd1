// A shadow ray, as media along it ask.
#pragma once

#include <cstdint>

#include "kernel/graph/graph_scene.h"
#include "kernel/math/vec.h"

namespace relief {

struct ShadowWay {
  Vec3f O, D;          ///< world, unit
  float t_max = 0;     ///< metres
  std::uint32_t seed;  ///< of the random numbers by which media that vary are asked
  GraphRay ray;        ///< what their graphs may read of it
};

}  // namespace relief
