// Tables by which kernel/light/environment.h chooses directions: the cells' probabilities as cumulative distributions.
// Cells follow pbrt-v4 §14.3.7 in kind (piecewise constant, marginal rows and conditional columns), with two
// differences: the map is integrated exactly as it is interpolated, and probabilities are integers (see the source).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "integrator/computed_environment.h"
#include "kernel/light/environment.h"

namespace relief {

/// What directions are chosen in proportion to.
enum class EnvironmentDensity : std::uint8_t {
  kRadiance,  ///< all of the light, for those who have no other way to find it
  /// What exceeds the mean over the sphere; nothing elsewhere. For next-event estimation beside paths that follow the
  /// BSDF, which find the even part of the light by themselves (Karlík et al. 2019, "MIS Compensation", §5.1): with 16
  /// samples a pixel, 15 to 40 % less variance in five scenes under five maps.
  kExcess
};

/// Owner of an environment's sampling tables.
struct EnvironmentTables {
  EnvironmentView environment;  ///< everything but the pointers into the vectors
  float base_luminance = 0;     ///< of the map times its factor: what kExcess takes off; 0 for kRadiance
  std::vector<float> row_cdf, column_cdf, row_edges;
  std::shared_ptr<const ComputedEnvironment> computed;  ///< null: there is a map, or nothing
  std::vector<EnvironmentSun> suns;

  /// The environment with its pointers set; valid while this object is neither changed nor moved.
  EnvironmentView view() const;
  std::size_t bytes() const;
};

/// Most cells along u; half as many along v: 2 MiB, about what a core's second-level cache holds; a cell is a third of a
/// degree wide, less than the sun's disk.
inline constexpr int kMaxEnvironmentColumns = 1024;

/// An environment without tables: for rays that look at it.
EnvironmentView environment_view_make(const TextureView* map, Vec3f color, float rotation);
/// @param computed  made with the same rotation
EnvironmentView environment_view_make(const ComputedEnvironment& computed, Vec3f color, float rotation);

/// Builds the sampling tables, in parallel.
/// @param map       lat-long image in memory or in a tile cache; null: constant environment, no tables
/// @param color     radiance factor, strength included
/// @param rotation  radians about +Y
/// @return  a map without any light yields tables without cells, with kExcess an even one too
/// @pre     the map's texture repeats in u (the loader's default)
/// @cost    2 MiB at most; reads the mip level with about twice the cells' resolution once
EnvironmentTables environment_tables_make(const TextureView* map,
                                          Vec3f color,
                                          float rotation,
                                          EnvironmentDensity density = EnvironmentDensity::kRadiance);

/// Likewise of computed surroundings, see computed_environment_cells and computed_environment_smooth. With kRadiance no cell has less than a twentieth of the
/// mean: middles of cells do not see all that is in them.
/// @param image_side  of images that they are computed from, texels; 0: none
EnvironmentTables environment_tables_make(std::shared_ptr<ComputedEnvironment> computed,
                                          Vec3f color,
                                          float rotation,
                                          std::span<const GraphSun> suns,
                                          int image_side,
                                          EnvironmentDensity density);

}  // namespace relief
