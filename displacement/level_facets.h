// What a coarser level of a height map has lost: the facets of the map's own texels around a point of it.
//
// A ray that meets a level meets one of them, chosen by what of them it can see, and is shaded by it: so a level keeps the
// light of the slopes that it has not. What leaves a facet gets out, or meets another one, by Smith's model of masking: the
// facets' heights and slopes are independent of each other. Facets are taken from the map instead of a distribution, and
// are as wide as texels; what masks them is as if their slopes were normally distributed.
//
// Heitz, Hanika, d'Eon, Dachsbacher 2016, "Multiple-Scattering Microfacet BSDFs with the Smith Model"; Dupuy, Heitz,
// Iehl, Poulin, Neyret, Ostromoukhov 2013, "Linear Efficient Antialiased Displacement and Reflectance Mapping".
#pragma once

#include "displacement/embree_geometry.h"
#include "kernel/shape/facet_masking.h"

namespace relief {

/// Facets that stand for those around a point.
inline constexpr int kLevelFacets = 16;

/// Facets around a point, as area vectors: normals as long as the facets' areas are large, all of them of the same area on
/// the level. Their mean is the level's own normal.
struct LevelFacets {
  Vec3f normal;                            ///< of the level, unit, world, on the side of the displacement normal
  Vec3f per_x, per_y;                      ///< by what it changes with the map's slope along a lattice axis, world
  float x[kLevelFacets], y[kLevelFacets];  ///< slopes less the level's
};

/// A place on a level of a displaced surface.
struct LevelPlace {
  const InstanceView& placement;
  std::uint32_t triangle;
  float b1, b2;    ///< weights of its vertices 1 and 2
  float level;     ///< of the map, above 0
  Vec3f P, Ng;     ///< object space, of the surface that is traced; Ng unit, on the side of the displacement normal
  float time = 0;  ///< of the ray
};

/// @param jitter  [0, 1)²: where between the facets' places
/// @return        false where the surface has no normals
bool level_facets_make(const DisplacedGeometry& geometry, const LevelPlace& at, Vec2f jitter, LevelFacets* out);

/// How much more the facets of a surface differ from it than slopes around a point of the map differ from their mean, along
/// both axes, so that surface and facets together have the second moments of the map's slopes. (Of a smooth map they differ
/// as much, of noise by more: what is between two texels of a level averages more than what is around it.) Measured at some
/// places.
/// @param level    whose heights the surface has
/// @param spacing  texels of the level from one vertex to the next, which are anywhere; 0: the surface is the level itself
/// @param window   width of what is around a point, texels of the map
/// @param smooth   slopes are those that the map is shaded with
Vec2f facet_spread(const HeightFieldView& map,
                   const HeightFieldView& level,
                   double spacing,
                   double window,
                   bool smooth);

FacetMoments facet_moments(const LevelFacets& facets);

/// A facet that is seen from a direction, by the area that it shows.
/// @param w       unit, world
/// @param u       [0, 1)
/// @param normal  unit, world, on the side of the displacement normal
/// @return        false if all face away
bool facet_choose(const LevelFacets& facets, Vec3f w, float u, Vec3f* normal);

}  // namespace relief
