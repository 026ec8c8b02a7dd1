// What closures of volumes are made of: their inputs at a point or bounds on these, and what they add to.
#pragma once

#include "kernel/bsdf/closure_kinds.h"
#include "kernel/graph/graph_registers.h"
#include "kernel/volume/medium.h"
#include "kernel/volume/volume_closure.h"

namespace relief {

/// A closure's inputs at a point, one after the other.
struct VolumeNumbers {
  const GraphLane& at;
  int place;  ///< among the program's results

  [[gnu::always_inline]] float number() { return closure_input(graph_result(at, place++)); }
  [[gnu::always_inline]] Vec3f color()
  {
    const float r = number(), g = number();
    return Vec3f{r, g, number()};
  }
};

/// An anisotropy that phase functions can have.
RELIEF_KERNEL float limited_anisotropy(float g) { return clamp(g, -kMostAnisotropy, kMostAnisotropy); }

/// Adds what scatters.
/// @param sigma_s  1/m
RELIEF_KERNEL void medium_add_phase(Medium& medium, Vec3f sigma_s, float anisotropy)
{
  medium.phases[medium.num_phases++] = {sigma_s, limited_anisotropy(anisotropy)};
}

/// Reads the color and the density of what scatters and does nothing else, and adds that to what light is taken away.
/// @return  1/m
RELIEF_KERNEL Vec3f medium_add_scattering(float weight, VolumeNumbers& in, Medium& medium)
{
  const Vec3f color = in.color();
  const Vec3f sigma_s = max(color, Vec3f{}) * (weight * max(in.number(), 0.0f));
  medium.sigma_t += sigma_s;
  return sigma_s;
}

/// Bounds on a number, or on all of a colour's.
struct ValueBounds {
  float low, high;
};

/// Whether something may be other than 0.
RELIEF_KERNEL bool counts(ValueBounds a) { return a.low < 0.0f || a.high > 0.0f; }

/// Of bounds on what is at least 0; there is none below.
RELIEF_KERNEL float bounds_product(float a, float b) { return a > 0.0f && b > 0.0f ? a * b : 0.0f; }

/// What a medium may come to somewhere.
struct MediumRate {
  float sigma_t = 0;  ///< 1/m: the largest channel is not more
  bool emits = false;
};

/// A bound on what medium_add_scattering adds.
template <typename Bounds>
RELIEF_KERNEL void rate_add_scattering(float weight, Bounds& in, MediumRate& rate)
{
  const ValueBounds color = in.color();
  rate.sigma_t += bounds_product(color.high, bounds_product(weight, in.number().high));
}

}  // namespace relief
