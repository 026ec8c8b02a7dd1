// A coarser level of a height map, for displaced surfaces with less detail.
#pragma once

#include <cstddef>
#include <vector>

#include "kernel/shape/height_map_view.h"

namespace relief {

/// Owns the texels of one level. Sides are those of a mip chain: halved `level` times, rounded up.
class HeightLevel {
 public:
  HeightLevel() = default;
  /// A texel is the mean over the area it covers in the map; along a side that is no multiple it covers parts of texels,
  /// with their share. Means of integers are rounded to 16 bits, those of floats to floats.
  /// @param level  > 0; sides end at one texel
  /// @cost   one pass over the map; parallel over rows
  HeightLevel(const HeightMapView& map, int level);

  HeightMapView view() const;
  std::size_t bytes() const { return words_.size() * sizeof(std::uint16_t) + floats_.size() * sizeof(float); }

 private:
  HeightMapView shape_;  ///< all but the texels
  std::vector<std::uint16_t> words_;
  std::vector<float> floats_;
};

/// What a surface loses when it shows one level instead of a finer one.
struct LevelLoss {
  double height = 0;                ///< largest difference at the centres of the finer level's texels, unit of the map
  double slope_u = 0, slope_v = 0;  ///< difference of slopes along u and v, unit of the map a side of it: root of the
                                    ///< mean square, in that of 8 × 8 parts of the map where it is largest
};

/// By the triangle inequality no more than this is lost over both steps.
inline LevelLoss operator+(const LevelLoss& a, const LevelLoss& b)
{
  return {a.height + b.height, a.slope_u + b.slope_u, a.slope_v + b.slope_v};
}

/// @param fine, coarse  levels of one map
/// @cost  one pass over the finer level; parallel over the parts
LevelLoss level_loss(const HeightMapView& fine, const HeightMapView& coarse);

}  // namespace relief
