// Which level of its height map a displaced surface shows to a ray, and where along the ray the level changes.
//
// A level is a function of the distance along the ray alone, for all triangles of a geometry, so neighbours never
// disagree. Levels are whole; what lies between two of them is a mixture: each path draws one number, `dither`, and its
// rays take the coarser level as often as the fraction asks. The mean image is the interpolation of the two images, and
// every ray meets a surface that exists. (RMIP can interpolate fixed levels instead, see level_blend.h.)
#pragma once

#include "displacement/displaced_triangle.h"

namespace relief {

/// The detail that one ray asks for: a texel may be as wide as width + spread·t at distance t.
struct LodCone {
  float width = 0;   ///< metres, world; 2^dither included
  float spread = 0;  ///< growth a metre, >= 0; 2^dither included
  float dither = 0;  ///< [0, 1), one for a path
};

/// Most levels a geometry can have.
inline constexpr int kMaxLodLevels = 31;

/// How a geometry chooses among its levels.
struct LodRule {
  int num_levels = 1;
  bool by_cone = false;  ///< otherwise `fixed`, and a fraction by dither
  float fixed = 0;       ///< counted from the geometry's finest level
  float texel = 0;       ///< width of a texel of the finest level, metres of object space
};

/// Width of a texel of a level.
RELIEF_KERNEL float lod_texel(float finest_texel, int level) { return finest_texel * static_cast<float>(1 << level); }

/// Level at a distance.
/// @param texel  width of a texel of the finest level, metres, world
/// @param t      metres, world
RELIEF_KERNEL int lod_level(const LodRule& rule, const LodCone& cone, float texel, double t)
{
  const int last = rule.num_levels - 1;
  if (!rule.by_cone) {
    const auto level = static_cast<int>(rule.fixed + cone.dither);
    return level < last ? level : last;
  }
  const double width = static_cast<double>(cone.width) + static_cast<double>(cone.spread) * t;
  int level = 0;
  while (level < last && width >= static_cast<double>(lod_texel(texel, level + 1))) ++level;
  return level;
}

/// Distance at which a level gives way to the next coarser one; infinity if it does not.
/// @param from  where the level is met
RELIEF_KERNEL double lod_level_end(const LodRule& rule, const LodCone& cone, float texel, int level, double from)
{
  if (!rule.by_cone || level + 1 >= rule.num_levels || !(cone.spread > 0.0f)) return __builtin_huge_val();
  const double end = (static_cast<double>(lod_texel(texel, level + 1)) - static_cast<double>(cone.width)) /
                     static_cast<double>(cone.spread);
  return end > from ? end : from;
}

/// Width a cone must have for a ray that leaves a surface of some level to meet it at that level again: a little over
/// the level's texel. Otherwise a ray would start above or below the surface that it sees.
RELIEF_KERNEL float lod_width_of_level(float texel, int level)
{
  constexpr float kOver = 1.0f + 0x1p-16f;
  return lod_texel(texel, level) * kOver;
}

/// A lattice coordinate as another level of the map has it.
/// @param finest_size, size  texels along its axis
RELIEF_KERNEL double lattice_on_level(double x, int finest_size, int size)
{
  return (x + 0.5) * (static_cast<double>(size) / finest_size) - 0.5;
}

/// A triangle as another level of the map has it.
RELIEF_KERNEL DisplacedTriangle triangle_on_level(const DisplacedTriangle& tri,
                                                  const HeightFieldView& finest,
                                                  const HeightFieldView& level)
{
  DisplacedTriangle out = tri;
  for (int k = 0; k < 3; ++k) {
    out.x[k] = lattice_on_level(tri.x[k], finest.map.width, level.map.width);
    out.y[k] = lattice_on_level(tri.y[k], finest.map.height, level.map.height);
  }
  return out;
}

}  // namespace relief
