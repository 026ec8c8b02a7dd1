// What facets of a level of a height map hide of each other, by Smith's model with heights: their heights and slopes are
// independent of each other, and what masks them is as if their slopes were normally distributed.
//
// Heitz, Hanika, d'Eon, Dachsbacher 2016, "Multiple-Scattering Microfacet BSDFs with the Smith Model".
#pragma once

#include <cmath>

#include "kernel/state/facet_state.h"

namespace relief {

/// φ(a) − a·Q(a) of the normal distribution: the mean of what a normal number exceeds a by.
/// @source Abramowitz and Stegun 1964, 7.1.26, off by 1e-7
RELIEF_KERNEL float mean_excess(float a)
{
  const float size = std::abs(a);
  const float t = 1.0f / (1.0f + 0.23164189f * size);
  const float tail =
      t * (0.254829592f + t * (-0.284496736f + t * (1.421413741f + t * (-1.453152027f + t * 1.061405429f))));
  const float excess = std::exp(-0.5f * a * a) * (0.39894228f - 0.5f * size * tail);
  return max(a < 0.0f ? excess - a : excess, 0.0f);
}

/// Smith's Λ of a direction: the mean area of the facets that face away from it over that of all, as it sees them.
/// Directions above the level have a positive one, those below it one of at most −1, as a ray on its way down meets
/// facets.
/// @param w  world
RELIEF_KERNEL float facet_lambda(const FacetMoments& m, Vec3f w)
{
  const float mean = dot(w, m.mean);
  const float along[2] = {dot(w, m.deviation[0]), dot(w, m.deviation[1])};
  const float deviation = std::sqrt(along[0] * along[0] + along[1] * along[1]);
  if (!(deviation > 0.0f)) return mean >= 0.0f ? 0.0f : -1.0f;
  return deviation * mean_excess(mean / deviation) / mean;
}

/// The height at which a ray that comes from outside meets a facet, as a part of all facets that are lower.
/// @param lambda  of the direction that it comes from
/// @param u       [0, 1)
RELIEF_KERNEL float facet_height(float lambda, float u)
{
  return std::pow(1.0f - u, 1.0f / (1.0f + max(lambda, 0.0f)));
}

/// Part of the rays from a facet that get out.
/// @param lambda  of their direction
RELIEF_KERNEL float facets_leave_chance(float height, float lambda)
{
  return lambda >= 0.0f ? std::pow(height, lambda) : 0.0f;
}

/// The height at which a ray that does not get out meets the next facet.
/// @param u  [0, 1), of those numbers that are not below facets_leave_chance
RELIEF_KERNEL float facet_next_height(float height, float lambda, float u)
{
  constexpr float kLeast = 0x1p-20f;  // 0 stands for no facet
  return clamp(height * std::pow(u, -1.0f / lambda), kLeast, 1.0f);
}

/// Whether a direction leads from the facet that a path is on over those around it: not through it.
RELIEF_KERNEL bool is_over_facets(const FacetState& f, Vec3f w)
{
  return f.height > 0.0f && f.side * dot(w, f.normal) > 0.0f;
}

/// Whether a direction leads through the facet that a path is on and yet above the level. What goes there meets the level
/// from below at once; nothing that comes from there goes the same way back.
RELIEF_KERNEL bool is_across_facets(const FacetState& f, Vec3f w)
{
  return f.height > 0.0f && f.side * dot(w, f.normal) <= 0.0f && f.side * dot(w, f.moments.mean) > 0.0f;
}

/// Irradiance of a facet over that of the level, whose area photons are counted by: 0 where the facets around hide the light.
/// @param f   of a hit on a facet
/// @param wi  unit, world, towards the light
RELIEF_KERNEL float facet_irradiance_factor(const FacetState& f, Vec3f wi)
{
  if (is_across_facets(f, wi)) return 0.0f;
  constexpr float kLeastCosine = 0.01f;  // keeps single photons that graze the level from shining
  const float by_area =
      __builtin_fabsf(dot(wi, f.normal)) / max(__builtin_fabsf(dot(wi, f.moments.mean)), kLeastCosine);
  return is_over_facets(f, wi) ? by_area * facets_leave_chance(f.height, facet_lambda(f.moments, f.side * wi))
                               : by_area;
}

}  // namespace relief
