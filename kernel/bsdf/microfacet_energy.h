// What Blender's "multiscatter" microfacets give back of the light that bounces more than once, as a factor on the single
// bounce.
//
// Turquin 2019, "Practical Multiple Scattering Compensation for Microfacet Models" [T]; Kulla and Conty 2017, "Revisiting
// Physically Based Shading at Imageworks" [KC].
#pragma once

#include "kernel/bsdf/energy_tables.h"

namespace relief {

/// Factor on f of a lobe that reflects E of what comes from wo when its reflectance is 1. Not reciprocal.
/// @param F_mean  mean reflectance of one bounce: 1 for white, the colour where a colour multiplies every bounce
/// @param E       directional albedo with reflectance 1, (0, 1]
/// @param E_mean  its mean over the cosine-weighted hemisphere
/// @source        [T] Eq. 16 with the share of later bounces from [KC], as Cycles from 4.0 on
RELIEF_KERNEL Vec3f microfacet_energy_factor(Vec3f F_mean, float E, float E_mean)
{
  const float lost_mean = 1.0f - E_mean;
  const Vec3f later = F_mean * E_mean / (splat3(1.0f) - F_mean * lost_mean);
  return splat3(1.0f) + later * ((1.0f - E) / E);
}

/// The same for GGX with height-correlated masking.
///
/// Cycles from 4.0 on has this factor on Multiscatter GGX of Glossy (F_mean 1 or the colour), metal (fresnel_f82_mean) and
/// specular. Cycles 3.4 follows the bounces at random, by Heitz et al. 2016: the factor meets its albedo (figures in the
/// report of BlenderLobe tests), not the shape of the later bounces.
/// @param roughness  (alpha_x alpha_y)^(1/4)
/// @param cos_o      (0, 1]
RELIEF_KERNEL Vec3f ggx_energy_factor(const BsdfTables& tables, Vec3f F_mean, float roughness, float cos_o)
{
  const GgxCoordinate at = ggx_coordinate(min(roughness, 1.0f));
  const float E = 1.0f - ggx_albedo(tables, at, cos_o).lost;
  return microfacet_energy_factor(F_mean, max(E, 1e-3f), 1.0f - ggx_albedo_mean(tables, at).lost);
}

/// Mean of fresnel_interpolated over the cosine-weighted hemisphere.
/// @source fits of [KC]; eta < 1 is seen from the dense side
RELIEF_KERNEL Vec3f fresnel_interpolated_mean(Vec3f F0, Vec3f F90, float eta)
{
  const float mean =
      eta < 1.0f ? 0.997118f + eta * (0.1014f - eta * (0.965241f + eta * 0.130607f)) : fresnel_dielectric_mean(eta);
  const float at_normal = fresnel_F0(eta);
  return lerp(clamp((mean - at_normal) / (1.0f - at_normal), 0.0f, 1.0f), F0, F90);
}

}  // namespace relief
