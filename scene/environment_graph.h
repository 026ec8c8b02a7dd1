// Surroundings by a value graph: a lat-long map of what the graph gives for every direction.
#pragma once

#include <span>
#include <vector>

#include "kernel/texture/texture_view.h"
#include "scene/environment_preset.h"
#include "scene/graph/graph_nodes.h"
#include "scene/graph/graph_program.h"

namespace relief {

struct EnvironmentGraph {
  GraphProgram program;        ///< results 0 to 2: radiance
  bool is_backdrop = false;    ///< camera rays look at it
  int width = 0;               ///< of the map, in texels; 0: as many as the graph needs, within limits
  std::vector<GraphSun> suns;  ///< small lights in it
};

inline constexpr int kLeastEnvironmentWidth = 512, kMostEnvironmentWidth = 4096;

/// Evaluates the graph at the texels' centres; where it has suns, and where a texel is much brighter than the mean and than one
/// beside it, at 256 places within the texel instead, so that a disk of any size gives its power. Quantities are those of a direction d, Z up, as Cycles has them for a world:
/// generated coordinates and positions are d, normals and incoming −d; rays are of no kind but a backdrop's, which are the camera's;
/// all else is 0.
///
/// Without a given width the map doubles from the least one until interpolation at the centres of the next finer one differs from
/// its values, as a root mean square over the sphere, by less than 0.2 % of their mean.
/// @param textures  those of the scene
EnvironmentMap environment_graph_bake(const EnvironmentGraph& graph, std::span<const TextureView> textures);

}  // namespace relief
