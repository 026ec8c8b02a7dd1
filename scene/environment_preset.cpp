#include "scene/environment_preset.h"

#include <cmath>

#include "kernel/math/vec.h"
#include "scene/parallel.h"

namespace relief {
namespace {

constexpr float kPiAngle = 3.14159265f;

/// 0 below the first number, 1 above the second, smooth in between.
float smooth_step(float low, float high, float x)
{
  const float t = clamp((x - low) / (high - low), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

Vec3f mix(Vec3f a, Vec3f b, float t) { return a + (b - a) * t; }

/// A rectangle of light with soft edges, at infinity.
struct SoftBox {
  Vec3f towards;                  ///< unit
  float half_width, half_height;  ///< tangents of angles
  Vec3f radiance;

  Vec3f at(Vec3f d) const
  {
    constexpr float kSoftness = 0.12f;
    const float depth = dot(d, towards);
    if (!(depth > 0)) return {};
    const Vec3f right = normalize(cross(Vec3f{0, 1, 0}, towards));
    const Vec3f up = cross(towards, right);
    const float x = std::fabs(dot(d, right)) / depth, y = std::fabs(dot(d, up)) / depth;
    return radiance * ((1 - smooth_step(half_width - kSoftness, half_width + kSoftness, x)) *
                       (1 - smooth_step(half_height - kSoftness, half_height + kSoftness, y)));
  }
};

/// @param d  unit, towards the surroundings
Vec3f studio_radiance(Vec3f d)
{
  static const SoftBox kBoxes[] = {
      {normalize(Vec3f{-0.65f, 0.6f, 0.75f}), 0.6f, 0.45f, {2.5f, 2.4f, 2.25f}},
      {normalize(Vec3f{0.9f, 0.2f, 0.4f}), 0.35f, 0.6f, {0.7f, 0.75f, 0.8f}},
      {normalize(Vec3f{0.5f, 0.45f, -0.9f}), 0.6f, 0.25f, {2.2f, 2.35f, 2.5f}},
  };
  const Vec3f above{0.38f, 0.385f, 0.4f}, level{0.2f, 0.2f, 0.205f}, below{0.13f, 0.127f, 0.124f};
  Vec3f radiance =
      d.y > 0 ? mix(level, above, smooth_step(0, 0.9f, d.y)) : mix(level, below, smooth_step(0, 0.5f, -d.y));
  for (const SoftBox& box : kBoxes) radiance += box.at(d);
  return radiance;
}

/// @param d  unit, towards the surroundings
Vec3f sky_radiance(Vec3f d)
{
  static const Vec3f kSun = normalize(Vec3f{-0.5f, 0.93f, 0.6f});
  const Vec3f zenith{0.15f, 0.24f, 0.43f}, horizon{0.54f, 0.59f, 0.65f}, ground{0.24f, 0.225f, 0.2f};
  const Vec3f sun_color{1.0f, 0.94f, 0.85f};
  const float up = max(d.y, 0.0f);
  const float cosine = clamp(dot(d, kSun), -1.0f, 1.0f);
  Vec3f sky = mix(zenith, horizon, std::pow(1 - up, 3.5f));
  sky += sun_color * (0.25f * std::pow(max(cosine, 0.0f), 24.0f) + 1.5f * std::pow(max(cosine, 0.0f), 600.0f));
  // Radiance by which the disk gives a surface that faces it an irradiance of 2.8: nearly π, that of white paper.
  constexpr float kInner = 1.0f * kPiAngle / 180, kOuter = 1.4f * kPiAngle / 180, kRadiance = 2000;
  sky += sun_color * (kRadiance * (1 - smooth_step(kInner, kOuter, std::acos(cosine))));
  constexpr float kHaze = 0.015f;
  return mix(sky, ground, smooth_step(0, kHaze, -d.y));
}

}  // namespace

EnvironmentMap environment_preset_make(EnvironmentSource source)
{
  const bool is_sky = source == EnvironmentSource::kSky;
  EnvironmentMap map;
  // Seven texels across the sun; the studio has nothing as sharp.
  map.width = is_sky ? 1024 : 512;
  map.height = map.width / 2;
  const auto width = static_cast<std::size_t>(map.width), height = static_cast<std::size_t>(map.height);
  map.rgb.resize(width * height * 3);
  for_each_in_parallel(height, [&](std::size_t y) {
    const float theta = (static_cast<float>(y) + 0.5f) * kPiAngle / static_cast<float>(height);
    for (std::size_t x = 0; x < width; ++x) {
      const float phi = ((static_cast<float>(x) + 0.5f) / static_cast<float>(width) - 0.5f) * 2 * kPiAngle;
      const Vec3f d{std::sin(theta) * std::sin(phi), std::cos(theta), -std::sin(theta) * std::cos(phi)};
      const Vec3f radiance = is_sky ? sky_radiance(d) : studio_radiance(d);
      float* texel = &map.rgb[(y * width + x) * 3];
      texel[0] = radiance.x, texel[1] = radiance.y, texel[2] = radiance.z;
    }
  });
  return map;
}

}  // namespace relief
