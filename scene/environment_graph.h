// Surroundings by a value graph, evaluated for the direction in which a ray leaves (integrator/computed_environment.h).
#pragma once

#include <vector>

#include "scene/graph/graph_program.h"

namespace relief {

struct EnvironmentGraph {
  GraphProgram program;        ///< results 0 to 2: radiance
  bool is_backdrop = false;    ///< camera rays look at it
  std::vector<GraphSun> suns;  ///< small lights in it
};

}  // namespace relief
