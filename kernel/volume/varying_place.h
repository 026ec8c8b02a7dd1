// Where media that vary are, and what they are there: data alone, for those who make it. varying_medium.h evaluates it.
#pragma once

#include <cstdint>

#include "kernel/graph/graph_program.h"
#include "kernel/math/vec.h"
#include "kernel/volume/rate_grid.h"

namespace relief {

struct VolumeClosureSpec;  // kernel/volume/volume_closure.h

/// Where a medium that varies is.
struct VaryingPlace {
  RateGrid rates;
  Vec3f generated_scale{1, 1, 1}, generated_offset;  ///< take object space to coordinates that graphs call generated
  /// 1/m: more counts as this, in level 0, and as half of it in each one after; light gets no farther through it than through a wall.
  float densest = kInfinity;
};

struct VaryingMedium {
  GraphProgramView program;
  const VolumeClosureSpec* closures = nullptr;
  std::uint32_t num_closures = 0;  ///< 0: the medium is even
  bool shines = false;             ///< it may send out light
  const VaryingPlace* places = nullptr;
  const std::int32_t* place_of_instance = nullptr;  ///< null: it fills the world, in places[0]
};

}  // namespace relief
