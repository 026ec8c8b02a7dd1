// What the tests of the surface model share: tables, named surfaces, directions, and a low-discrepancy estimate of
// albedo.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "kernel/bsdf/layered.h"

namespace relief {

/// Tables with everything in them, made once a process.
inline const BsdfTables& full_tables()
{
  static const BsdfTables* tables = [] {
    auto* made = new BsdfTables;
    bsdf_tables_make(*made);
    return made;
  }();
  return *tables;
}

struct NamedSurface {
  std::string name;
  SurfaceParams params;
};

inline SurfaceParams lambert(Vec3f color)
{
  SurfaceParams p;
  p.base_color = color;
  p.specular = 0;
  return p;
}

inline SurfaceParams metal(Vec3f color, float roughness)
{
  SurfaceParams p;
  p.base_color = color;
  p.metallic = 1;
  p.roughness = roughness;
  return p;
}

inline SurfaceParams plastic(Vec3f color, float roughness)
{
  SurfaceParams p;
  p.base_color = color;
  p.roughness = roughness;
  return p;
}

inline SurfaceParams glass(float ior, float roughness)
{
  SurfaceParams p;
  p.transmission = 1;
  p.thin = false;
  p.ior = ior;
  p.roughness = roughness;
  return p;
}

inline SurfaceParams thin_wall(Vec3f color, float roughness)
{
  SurfaceParams p;
  p.base_color = color;
  p.transmission = 1;
  p.roughness = roughness;
  return p;
}

inline SurfaceParams with_coat(SurfaceParams p, float coat, float roughness)
{
  p.clearcoat = coat;
  p.clearcoat_roughness = roughness;
  return p;
}

inline SurfaceParams with_sheen(SurfaceParams p, Vec3f color, float roughness)
{
  p.sheen_color = color;
  p.sheen_roughness = roughness;
  return p;
}

/// Something of everything.
inline SurfaceParams mixture(float roughness, bool thin)
{
  SurfaceParams p =
      with_sheen(with_coat(plastic({0.7f, 0.4f, 0.2f}, roughness), 0.6f, 0.35f), {0.3f, 0.2f, 0.4f}, 0.5f);
  p.metallic = 0.3f;
  p.transmission = 0.4f;
  p.thin = thin;
  return p;
}

/// Unit direction of a given height (negative: below) and azimuth in radians.
inline Vec3f direction(float z, float phi = 0.7f)
{
  const float r = std::sqrt(std::fmax(0.0f, 1.0f - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

/// Point i of a three-dimensional additive recurrence (Roberts 2018): low discrepancy, no state.
struct Point3 {
  float lobe;
  Vec2f u;
};
inline Point3 sequence_point(std::uint32_t i)
{
  const auto coordinate = [i](double a) {
    const double x = 0.5 + a * static_cast<double>(i + 1);
    return std::fmin(static_cast<float>(x - std::floor(x)), 0x1.fffffep-1f);
  };
  return {coordinate(0.8191725133961645), {coordinate(0.6710436067037893), coordinate(0.5497004779019703)}};
}

/// Directional albedo and the largest factor on the throughput, by surface_sample.
struct SampledAlbedo {
  double r = 0, g = 0, b = 0;
  double largest_weight = 0;
};

inline SampledAlbedo sampled_albedo(const SurfaceParams& p, Vec3f wo, std::uint32_t num_samples)
{
  SampledAlbedo a;
  const SurfaceClosure closure = surface_closure_make<kFeatureAll>(p, full_tables(), wo);
  for (std::uint32_t i = 0; i < num_samples; ++i) {
    const Point3 point = sequence_point(i);
    const BsdfSample s = closure_sample<kFeatureAll>(closure, full_tables(), point.lobe, point.u);
    if (!(s.pdf > 0.0f)) continue;
    const Vec3f weight = s.f * (std::fabs(s.wi.z) / s.pdf);
    a.r += static_cast<double>(weight.x);
    a.g += static_cast<double>(weight.y);
    a.b += static_cast<double>(weight.z);
    a.largest_weight = std::fmax(a.largest_weight, static_cast<double>(max_component(weight)));
  }
  a.r /= num_samples;
  a.g /= num_samples;
  a.b /= num_samples;
  return a;
}

}  // namespace relief
