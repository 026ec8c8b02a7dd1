// Distances along a ray through an even medium: by how light is weakened, and by how near a light is. Each has a sampler and a
// density.
//
// Source: Kulla and Fajardo 2012, "Importance Sampling Techniques for Path Tracing in Participating Media" (equiangular);
// Chiang, Kutz and Burley 2016, "Practical and Controllable Subsurface Scattering for Production Path Tracing" (chances of
// channels).
#pragma once

#include <cmath>

#include "kernel/math/trigonometry.h"
#include "kernel/math/vec.h"

namespace relief {

/// Share of light that is left after a distance.
/// @param sigma_t   1/m
/// @param distance  metres, may be infinite
RELIEF_KERNEL Vec3f medium_transmittance(Vec3f sigma_t, float distance)
{
  const auto axis = [distance](float sigma) { return sigma > 0.0f ? std::exp(-sigma * distance) : 1.0f; };
  return {axis(sigma_t.x), axis(sigma_t.y), axis(sigma_t.z)};
}

/// Integral of the transmittance over a distance, metres; infinite where nothing weakens light on an infinite way.
RELIEF_KERNEL Vec3f medium_transmittance_integral(Vec3f sigma_t, float distance)
{
  const auto axis = [distance](float sigma) {
    const float depth = sigma * distance;
    // There the next term is below a rounding.
    return depth > 1e-7f ? -std::expm1(-depth) / sigma : distance;
  };
  return {axis(sigma_t.x), axis(sigma_t.y), axis(sigma_t.z)};
}

/// Chances with which each channel decides on distances: what they carry of what is scattered.
/// @param weights  not negative
RELIEF_KERNEL Vec3f channel_chances(Vec3f weights)
{
  const float sum = weights.x + weights.y + weights.z;
  return sum > 0.0f ? weights / sum : splat3(1.0f / 3.0f);
}

/// @param u  [0, 1)
RELIEF_KERNEL float channel_choose(Vec3f values, Vec3f chances, float u)
{
  return u < chances.x ? values.x : u < chances.x + chances.y || !(chances.z > 0.0f) ? values.y : values.z;
}

/// Distance to where light is next met by the medium.
/// @return  metres; infinite: nowhere
RELIEF_KERNEL float free_distance_sample(float sigma_t, float u)
{
  return sigma_t > 0.0f ? -std::log1p(-u) / sigma_t : kInfinity;
}

/// The same, where it is known to be within some length.
RELIEF_KERNEL float free_distance_sample_within(float sigma_t, float length, float u)
{
  if (!(sigma_t > 0.0f)) return u * length;
  return min(-std::log1p(u * std::expm1(-sigma_t * length)) / sigma_t, length);
}

/// Density of the latter over the channels.
/// @pre  a channel with a chance has sigma_t > 0, or the length is finite
RELIEF_KERNEL float free_distance_pdf_within(Vec3f sigma_t, Vec3f chances, float length, float distance)
{
  const auto axis = [=](float sigma, float chance) {
    if (!(chance > 0.0f)) return 0.0f;
    if (!(sigma > 0.0f)) return chance / length;
    return chance * sigma * std::exp(-sigma * distance) / -std::expm1(-sigma * length);
  };
  return axis(sigma_t.x, chances.x) + axis(sigma_t.y, chances.y) + axis(sigma_t.z, chances.z);
}

/// A stretch of a ray as it is seen from a point.
struct Equiangular {
  float nearest = 0;   ///< on the ray: where it is nearest to the point; metres from the stretch's start
  float distance = 0;  ///< of the ray to the point, metres; 0: the point is on the ray, which has no such density
  float first = 0, last = 0;  ///< angles of the stretch's ends
};

/// @param O       start of the stretch
/// @param length  metres; may be infinite
RELIEF_KERNEL Equiangular equiangular_make(Vec3f O, Vec3f D, float length, Vec3f point)
{
  Equiangular e;
  e.nearest = dot(point - O, D);
  e.distance = relief::length(point - (O + D * e.nearest));
  if (!(e.distance > 1e-6f * (1.0f + __builtin_fabsf(e.nearest)))) {
    e.distance = 0.0f;
    return e;
  }
  e.first = std::atan(-e.nearest / e.distance);
  e.last = length < kInfinity ? std::atan((length - e.nearest) / e.distance) : 0.5f * kPi;
  if (!(e.last > e.first)) e.distance = 0.0f;
  return e;
}

/// @return  metres from the start of the stretch
RELIEF_KERNEL float equiangular_sample(const Equiangular& e, float u)
{
  return max(0.0f, e.nearest + e.distance * std::tan(e.first + u * (e.last - e.first)));
}

RELIEF_KERNEL float equiangular_pdf(const Equiangular& e, float distance)
{
  const float along = distance - e.nearest;
  return e.distance / ((e.last - e.first) * (e.distance * e.distance + along * along));
}

}  // namespace relief
