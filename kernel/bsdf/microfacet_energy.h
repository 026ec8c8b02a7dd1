// What Blender's "multiscatter" microfacets give back of the light that bounces more than once, as a factor on the single
// bounce.
//
// Turquin 2019, "Practical Multiple Scattering Compensation for Microfacet Models" [T]; Kulla and Conty 2017, "Revisiting
// Physically Based Shading at Imageworks" [KC].
#pragma once

#include "kernel/bsdf/energy_tables.h"

namespace relief {

/// Whose bounces the factor stands for.
enum class EnergyModel {
  kTable,  ///< Cycles from 4.0 on: this very factor
  kWalk,   ///< Cycles up to 3.6, which follows the bounces at random after Heitz et al. 2016
};

/// Factor on f of a lobe that reflects E of what comes from wo when its reflectance is 1. Not reciprocal.
/// @param F_mean  mean reflectance of one bounce: 1 for white, the colour where a colour multiplies every bounce
/// @param E       directional albedo with reflectance 1, (0, 1]
/// @param E_later  share of the light that leaves at each later bounce
/// @source        [T] Eq. 16 with the series of later bounces from [KC]
RELIEF_KERNEL Vec3f microfacet_energy_factor(Vec3f F_mean, float E, float E_later)
{
  const Vec3f later = F_mean * E_later / (splat3(1.0f) - F_mean * (1.0f - E_later));
  return splat3(1.0f) + later * ((1.0f - E) / E);
}

/// The same for GGX with height-correlated masking: Multiscatter GGX of Glossy (F_mean 1 where the colour is white), metal
/// (fresnel_f82_mean) and specular.
///
/// The tables are our own, within 0.0016 of those of Cycles 4.3. For kWalk the albedo is within 0.011 of Cycles 3.4.1
/// in a furnace (roughness 0.2 to 1, colours 0.2 to 1), except for wo.z > 0.9999, where Cycles has no second bounce; the
/// shape of the later bounces is broader than the factor makes it.
/// @param roughness  (alpha_x alpha_y)^(1/4)
/// @param cos_o      (0, 1]
RELIEF_KERNEL Vec3f
ggx_energy_factor(const BsdfTables& tables, EnergyModel model, Vec3f F_mean, float roughness, float cos_o)
{
  const GgxCoordinate at = ggx_coordinate(min(roughness, 1.0f));
  const float E = 1.0f - ggx_albedo(tables, at, cos_o).lost;
  const float lost_mean = ggx_albedo_mean(tables, at).lost;
  // Light that bounces among microfacets does not start from outside: more of it leaves. The figure is a fit to furnaces
  // of Cycles 3.4.1.
  const float lost_later = model == EnergyModel::kWalk ? 0.6f * lost_mean : lost_mean;
  return microfacet_energy_factor(F_mean, max(E, 1e-3f), 1.0f - lost_later);
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
