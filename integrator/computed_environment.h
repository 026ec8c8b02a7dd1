// Surroundings by a value graph: what it gives for a direction, asked for wherever a ray leaves the scene, and a coarse map of it
// by which directions are chosen.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernel/graph/graph_registers.h"
#include "kernel/light/environment.h"
#include "scene/environment_graph.h"

namespace relief {

/// Radiance at places of a grid, and where between them it may be interpolated.
struct SmoothGrid {
  int columns = 0, rows = 0;       ///< of places; the first column follows on the last
  std::vector<Vec3f> values;       ///< row after row
  /// Of each four places, by the upper left one, whether between them interpolation is as good as the graph.
  std::vector<std::uint8_t> is_smooth;
};

/// A square about a sun's disk, as the grid has it: evenly spaced on a plane across the direction to its middle.
struct SmoothSun {
  Frame frame;      ///< its n towards the middle; world space
  float scale = 0;  ///< of places to the tangent of the angle from the middle
  SmoothGrid grid;
};

/// What a graph is evaluated with; what it points to must outlive it.
struct ComputedEnvironment {
  GraphProgramView program;
  GraphRun run = nullptr;
  const TextureView* textures = nullptr;
  bool is_backdrop = false;
  float cos_rotation = 1, sin_rotation = 0;  ///< of the surroundings about +Y
  SmoothGrid map;  ///< of the middles of ComputedCells' cells; empty: the graph has textures, between whose values nothing can be told
  std::vector<SmoothSun> suns;  ///< likewise
};

/// Looks where a graph of arithmetic alone is smooth: there, interpolation takes the place of running it, which takes several
/// times as long.
/// @param suns  in world space: looked at by themselves
void computed_environment_smooth(ComputedEnvironment& computed, std::span<const EnvironmentSun> suns);

/// @param rotation  radians about +Y
ComputedEnvironment computed_environment_make(const EnvironmentGraph& graph,
                                              float rotation,
                                              GraphRun run,
                                              const TextureView* textures);

/// A direction in world space of one before the surroundings are turned.
Vec3f computed_environment_world(const ComputedEnvironment& environment, Vec3f map);

/// As EnvironmentRadiance, of a ComputedEnvironment. What is no radiance is 0. Quantities are those of a direction d, Z up, as
/// Cycles has them for a world: generated coordinates and positions are d, normals and incoming −d; rays are of no kind but a
/// backdrop's, which are the camera's; all else is 0.
Vec3f computed_environment_radiance(const void* computed, Vec3f wi);

/// How bright the cells of a coarse map are, as the view's directions have them.
struct ComputedCells {
  static constexpr int kColumns = 512, kRows = 256;
  std::vector<float> luminance;  ///< means, row after row, without suns
  std::vector<float> suns;       ///< mean luminance of each
};

/// Evaluates a graph at the middles of the cells; where it reads images, as often as their texels ask for; and where something
/// is bright and small, at 64 places within the cell, of as many cells as that may take a while for.
/// @param suns       in world space
/// @param color      radiance factor
/// @param most_side  of images that the graph reads, texels across; 0: none
ComputedCells computed_environment_cells(const ComputedEnvironment& computed,
                                         std::span<const EnvironmentSun> suns,
                                         Vec3f color,
                                         int most_side);

/// Most texels across of the images that a graph reads; 0: it reads none.
int environment_graph_image_side(const EnvironmentGraph& graph, std::span<const TextureView> textures);

}  // namespace relief
