// The rough interface that the lobes of a surface's base share: reflection, thin wall, glass, and what lies beneath it.
//
// Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks" [KC].
#pragma once

#include "kernel/bsdf/energy_tables.h"

namespace relief {

/// Density of directions of what leaves the microfacets after several bounces: of a rough surface nearly the cosine's; of a
/// smooth one, which loses light only at µ below about alpha and like (alpha/µ)² above, uniform in log(µ + alpha). A
/// cosine alone gave factors of up to 200 on the throughput.
struct MultipleScattering {
  float alpha = 1;
  float log_range = 1;  ///< log(1 + 1/alpha)
};

RELIEF_KERNEL MultipleScattering multiple_scattering_make(float alpha)
{
  return {alpha, std::log(1.0f + 1.0f / alpha)};
}

/// @return unit, z >= 0
RELIEF_KERNEL Vec3f multiple_scattering_sample(const MultipleScattering& m, Vec2f u)
{
  if (u.x < m.alpha) return warp_cosine_hemisphere({u.x / m.alpha, u.y});
  const float v = (u.x - m.alpha) / (1.0f - m.alpha);
  return direction_from_z(min(1.0f, m.alpha * (std::exp(v * m.log_range) - 1.0f)), u.y);
}

/// @param cos_i  |cosine|
/// @return       solid angle, on one hemisphere
RELIEF_KERNEL float multiple_scattering_pdf(const MultipleScattering& m, float cos_i)
{
  const float logarithmic = 0.5f * kInvPi / ((cos_i + m.alpha) * m.log_range);
  return lerp(m.alpha, logarithmic, warp_cosine_hemisphere_pdf(cos_i));
}

struct BaseInterface {
  Vec3f wo{};                         ///< unit, z > 0
  GgxCoordinate ggx;                  ///< its microfacets
  float under_F0 = 0, under_F90 = 0;  ///< of what lies over diffuse base and thin wall; both 0: nothing does
  MultipleScattering scattering;
  Vec3f transmission_color{};  ///< tint of all that crosses the surface
};

}  // namespace relief
