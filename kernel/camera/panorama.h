// Pictures of more than a plane can show: which way a point of the picture looks, and back.
//
// Points of the picture are x and y from −1 to 1, to the right and up, over the whole of it, whatever its shape. Directions are in
// the camera's space: +X right, +Y up, −Z ahead.
#pragma once

#include "kernel/math/trigonometry.h"

namespace relief {

enum class PanoramaKind : std::uint8_t {
  kEquirectangular,
  kCylindrical,
  kEquidistant,
  kEquisolid,
  kPolynomial,
  kMirrorBall,
  kCubeFace,
};

struct Panorama {
  PanoramaKind kind = PanoramaKind::kEquirectangular;
  float longitude_min = -kPi, longitude_max = kPi;              ///< radians to the right of ahead
  float latitude_min = -0.5f * kPi, latitude_max = 0.5f * kPi;  ///< radians above the horizon
  float height_min = -1, height_max = 1;                        ///< on a cylinder of radius 1 around the camera
  float half_field = 0.5f * kPi;                                ///< of fisheyes: radians from ahead that they show
  float half_sensor_width = 18, half_sensor_height = 12;        ///< millimetres
  float focal_length = 10.5f;                                   ///< of equisolid fisheyes, millimetres
  float k[5] = {};  ///< angle from ahead by powers of the distance from the sensor's middle: radians, millimetres
};

/// A way that a point of the picture looks.
struct PanoramaPoint {
  Vec3f D;            ///< unit; zero: outside of what the lens shows
  float solid_angle;  ///< for a unit of area of the picture, x times y
};

/// A direction by its angle from ahead and that of the picture's point.
RELIEF_KERNEL Vec3f panorama_radial(float x, float y, float radius, SinCos angle)
{
  const float across = radius > 0.0f ? angle.sin / radius : 0.0f;
  return {x * across, y * across, -angle.cos};
}

RELIEF_KERNEL SinCos sin_cos_radians(float angle) { return sin_cos_turn(angle * (0.5f * kInvPi)); }

RELIEF_KERNEL PanoramaPoint panorama_equirectangular(const Panorama& p, float x, float y)
{
  const float wide = 0.5f * (p.longitude_max - p.longitude_min), high = 0.5f * (p.latitude_max - p.latitude_min);
  const SinCos longitude = sin_cos_radians(p.longitude_min + wide * (x + 1.0f));
  const SinCos latitude = sin_cos_radians(p.latitude_min + high * (y + 1.0f));
  return {{latitude.cos * longitude.sin, latitude.sin, -latitude.cos * longitude.cos},
          __builtin_fabsf(wide * high * latitude.cos)};
}

RELIEF_KERNEL PanoramaPoint panorama_cylindrical(const Panorama& p, float x, float y)
{
  const float wide = 0.5f * (p.longitude_max - p.longitude_min), high = 0.5f * (p.height_max - p.height_min);
  const SinCos longitude = sin_cos_radians(p.longitude_min + wide * (x + 1.0f));
  const float height = p.height_min + high * (y + 1.0f);
  const float scale = 1.0f / __builtin_sqrtf(1.0f + height * height);
  return {{longitude.sin * scale, height * scale, -longitude.cos * scale},
          __builtin_fabsf(wide * high) * scale * sqr(scale)};
}

/// sin(angle) / radius times what the angle grows by with the radius, which is what one area becomes as the other.
RELIEF_KERNEL PanoramaPoint panorama_equidistant(const Panorama& p, float x, float y)
{
  const float radius = __builtin_sqrtf(x * x + y * y);
  if (!(radius <= 1.0f)) return {};
  const SinCos angle = sin_cos_radians(radius * p.half_field);
  const float stretch = radius > 0.0f ? __builtin_fabsf(angle.sin) / radius : p.half_field;
  return {panorama_radial(x, y, radius, angle), stretch * p.half_field};
}

RELIEF_KERNEL PanoramaPoint panorama_equisolid(const Panorama& p, float x, float y)
{
  const float at_x = x * p.half_sensor_width, at_y = y * p.half_sensor_height;
  const float radius = __builtin_sqrtf(at_x * at_x + at_y * at_y);
  // radius = 2 f sin(angle / 2), which has the same area everywhere.
  const float half_sine = radius / (2.0f * p.focal_length);
  if (!(half_sine <= sin_cos_radians(0.5f * p.half_field).sin)) return {};
  const SinCos angle{2.0f * half_sine * safe_sqrt(1.0f - half_sine * half_sine), 1.0f - 2.0f * half_sine * half_sine};
  return {panorama_radial(at_x, at_y, radius, angle), p.half_sensor_width * p.half_sensor_height / sqr(p.focal_length)};
}

RELIEF_KERNEL float panorama_polynomial_angle(const Panorama& p, float radius)
{
  return p.k[0] + radius * (p.k[1] + radius * (p.k[2] + radius * (p.k[3] + radius * p.k[4])));
}

RELIEF_KERNEL float panorama_polynomial_slope(const Panorama& p, float radius)
{
  return p.k[1] + radius * (2.0f * p.k[2] + radius * (3.0f * p.k[3] + radius * 4.0f * p.k[4]));
}

RELIEF_KERNEL PanoramaPoint panorama_polynomial(const Panorama& p, float x, float y)
{
  const float at_x = x * p.half_sensor_width, at_y = y * p.half_sensor_height;
  const float radius = __builtin_sqrtf(at_x * at_x + at_y * at_y);
  const float away = panorama_polynomial_angle(p, radius);
  if (!(__builtin_fabsf(away) <= p.half_field)) return {};
  const SinCos angle = sin_cos_radians(away);
  const float slope = panorama_polynomial_slope(p, radius);
  // A lens whose middle is not ahead shows a circle of the world there in a point.
  constexpr float kSmallest = 1e-6f;
  const float stretch = radius > kSmallest ? angle.sin / radius : slope;
  return {panorama_radial(at_x, at_y, radius, angle),
          __builtin_fabsf(stretch * slope) * p.half_sensor_width * p.half_sensor_height};
}

/// What a ball shows that is looked at from afar: the point whose normal is halfway.
RELIEF_KERNEL PanoramaPoint panorama_mirror_ball(float x, float y)
{
  const float squared = x * x + y * y;
  if (!(squared <= 1.0f)) return {};
  const float twice = 2.0f * __builtin_sqrtf(1.0f - squared);
  return {{twice * x, twice * y, 2.0f * squared - 1.0f}, 4.0f};
}

/// A side of a cube around the camera, with even angles along both axes.
RELIEF_KERNEL PanoramaPoint panorama_cube_face(float x, float y)
{
  const SinCos across = sin_cos_turn(0.125f * x), up = sin_cos_turn(0.125f * y);
  const float a = across.sin / across.cos, b = up.sin / up.cos;
  const float scale = 1.0f / __builtin_sqrtf(1.0f + a * a + b * b);
  constexpr float kAngles = sqr(0.25f * kPi);
  return {{a * scale, b * scale, -scale}, kAngles * (1.0f + a * a) * (1.0f + b * b) * scale * sqr(scale)};
}

/// Where a point of the picture looks.
/// @param x, y  −1…1; beyond, where that means something
RELIEF_KERNEL PanoramaPoint panorama_point(const Panorama& p, float x, float y)
{
  switch (p.kind) {
    case PanoramaKind::kEquirectangular:
      return panorama_equirectangular(p, x, y);
    case PanoramaKind::kCylindrical:
      return panorama_cylindrical(p, x, y);
    case PanoramaKind::kEquidistant:
      return panorama_equidistant(p, x, y);
    case PanoramaKind::kEquisolid:
      return panorama_equisolid(p, x, y);
    case PanoramaKind::kPolynomial:
      return panorama_polynomial(p, x, y);
    case PanoramaKind::kMirrorBall:
      return panorama_mirror_ball(x, y);
    case PanoramaKind::kCubeFace:
      return panorama_cube_face(x, y);
  }
  return {};
}

/// Distance from a sensor's middle at which a polynomial has an angle, by Newton's steps from what its first two terms say.
RELIEF_KERNEL float panorama_polynomial_radius(const Panorama& p, float angle)
{
  float radius = p.k[1] != 0.0f ? (angle - p.k[0]) / p.k[1] : 0.0f;
  constexpr int kSteps = 20;
  for (int step = 0; step < kSteps; ++step) {
    const float slope = panorama_polynomial_slope(p, radius);
    if (!(__builtin_fabsf(slope) > 0.0f)) break;
    radius -= (panorama_polynomial_angle(p, radius) - angle) / slope;
  }
  return radius;
}

/// The point of the picture that looks some way, or would if the picture went on there.
/// @param D  the camera's space, any length
/// @return   as of panorama_point
RELIEF_KERNEL Vec2f panorama_project(const Panorama& p, Vec3f D)
{
  const float across = __builtin_sqrtf(D.x * D.x + D.y * D.y);
  const float angle = angle_of(across, -D.z);
  // What is straight behind is at the side, not in the middle.
  const Vec2f towards = across > 0.0f ? Vec2f{D.x / across, D.y / across} : Vec2f{1, 0};
  const auto on_sensor = [&](float radius) {
    return Vec2f{towards.x * radius / p.half_sensor_width, towards.y * radius / p.half_sensor_height};
  };
  switch (p.kind) {
    case PanoramaKind::kEquirectangular:
    case PanoramaKind::kCylindrical: {
      const auto part = [](float at, float low, float high) { return 2.0f * (at - low) / (high - low) - 1.0f; };
      const float longitude = __builtin_copysignf(angle_of(__builtin_fabsf(D.x), -D.z), D.x);
      const float level = __builtin_sqrtf(D.x * D.x + D.z * D.z);
      const float x = part(longitude, p.longitude_min, p.longitude_max);
      if (p.kind == PanoramaKind::kCylindrical) return {x, part(D.y / level, p.height_min, p.height_max)};
      const float latitude = __builtin_copysignf(angle_of(__builtin_fabsf(D.y), level), D.y);
      return {x, part(latitude, p.latitude_min, p.latitude_max)};
    }
    case PanoramaKind::kEquidistant:
      return towards * (angle / p.half_field);
    case PanoramaKind::kEquisolid:
      return on_sensor(2.0f * p.focal_length * sin_cos_radians(0.5f * angle).sin);
    case PanoramaKind::kPolynomial:
      return on_sensor(panorama_polynomial_radius(p, angle));
    case PanoramaKind::kMirrorBall:
      return towards * sin_cos_radians(0.5f * angle).sin;
    case PanoramaKind::kCubeFace: {
      const float depth = -D.z;
      return {__builtin_copysignf(angle_of(__builtin_fabsf(D.x), depth), D.x) * (4.0f * kInvPi),
              __builtin_copysignf(angle_of(__builtin_fabsf(D.y), depth), D.y) * (4.0f * kInvPi)};
    }
  }
  return {};
}

}  // namespace relief
