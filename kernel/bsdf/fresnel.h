// Reflectance of an interface as a function of the angle.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// (1 − cosine)⁵, Schlick's interpolation weight between normal and grazing reflectance.
RELIEF_KERNEL float schlick_weight(float cos_theta)
{
  const float x = clamp(1.0f - cos_theta, 0.0f, 1.0f);
  return sqr(sqr(x)) * x;
}

/// @source Schlick 1994, Eq. 15
RELIEF_KERNEL Vec3f fresnel_schlick(Vec3f F0, float F90, float cos_theta)
{
  const float w = schlick_weight(cos_theta);
  return F0 * (1.0f - w) + splat3(F90 * w);
}

/// Reflectance at normal incidence. Works for infinite-like indices without overflow.
RELIEF_KERNEL float fresnel_F0(float ior) { return sqr((ior - 1.0f) / (ior + 1.0f)); }

/// Cosine on the far side of an interface (Snell).
/// @param cos_i  in [0, 1]
/// @param eta    index transmitted / index incident
/// @return       in [0, 1]; 0 at and beyond total internal reflection
RELIEF_KERNEL float refracted_cosine(float cos_i, float eta)
{
  return safe_sqrt(1.0f - (1.0f - cos_i * cos_i) / (eta * eta));
}

/// Unpolarised reflectance of a dielectric interface.
/// @param cos_i  in [0, 1]
/// @param cos_t  refracted_cosine(cos_i, eta)
/// @return       [0, 1]; 1 at total internal reflection
RELIEF_KERNEL float fresnel_dielectric(float cos_i, float cos_t, float eta)
{
  if (!(cos_t > 0.0f)) return 1.0f;
  const float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  const float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  return 0.5f * (sqr(parallel) + sqr(perpendicular));
}

/// Mean of a Schlick reflectance over the cosine-weighted hemisphere: 2∫ F(µ) µ dµ.
RELIEF_KERNEL Vec3f fresnel_schlick_mean(Vec3f F0, float F90) { return F0 * (20.0f / 21.0f) + splat3(F90 / 21.0f); }

/// Mean of the dielectric reflectance over the cosine-weighted hemisphere, from the thin side.
/// @param ior  dense over thin, >= 1
/// @source     fit of Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks"; within 0.01 for ior
///             <= 3 (tested)
RELIEF_KERNEL float fresnel_dielectric_mean(float ior) { return (ior - 1.0f) / (4.08567f + 1.00071f * ior); }

}  // namespace relief
