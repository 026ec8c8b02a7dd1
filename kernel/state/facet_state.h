// What a path keeps of a hit among the facets that a level of a height map stands for (displacement/level_facets.h).
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// Facets as area vectors: their mean, and their deviation in its two directions. World space.
struct FacetMoments {
  Vec3f mean, deviation[2];
};

struct FacetState {
  float height;  ///< of the hit: part of the facets that are lower; 0: it is on no facet
  float level;   ///< of the map
  float side;    ///< 1: the path is on the side of the displacement normal; −1: on the other
  FacetMoments moments;
  Vec3f normal;  ///< of the facet, unit, world, on the side of the displacement normal
};

}  // namespace relief
