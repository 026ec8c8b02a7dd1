// Tables by which kernel/light/environment.h chooses directions: the cells' probabilities as cumulative distributions.
// Cells follow pbrt-v4 §14.3.7 in kind (piecewise constant, marginal rows and conditional columns), with two
// differences: the map is integrated exactly as it is interpolated, and probabilities are integers (see the source).
#pragma once

#include <cstddef>
#include <vector>

#include "kernel/light/environment.h"

namespace relief {

/// Owner of an environment's sampling tables.
struct EnvironmentTables {
  EnvironmentView environment;  ///< everything but the pointers into the vectors
  std::vector<float> row_cdf, column_cdf, row_edges;

  /// The environment with its pointers set; valid while this object is neither changed nor moved.
  EnvironmentView view() const;
  std::size_t bytes() const;
};

/// Most cells along u; half as many along v: 2 MiB, about what a core's second-level cache holds; a cell is a third of a
/// degree wide, less than the sun's disk.
inline constexpr int kMaxEnvironmentColumns = 1024;

/// Builds the sampling tables, in parallel.
/// @param map       lat-long image in memory or in a tile cache; null: constant environment, no tables
/// @param color     radiance factor, strength included
/// @param rotation  radians about +Y
/// @return          a map without any light yields tables without cells
/// @pre             the map's texture repeats in u (the loader's default)
/// @cost            2 MiB at most; reads the mip level with about twice the cells' resolution once
EnvironmentTables environment_tables_make(const TextureView* map, Vec3f color, float rotation);

}  // namespace relief
