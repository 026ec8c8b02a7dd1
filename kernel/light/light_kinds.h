// Asks the functions of a light's kind, which light_sample.h lists.
#pragma once

#include "kernel/light/disk.h"
#include "kernel/light/mesh_light.h"
#include "kernel/light/point.h"
#include "kernel/light/rectangle.h"
#include "kernel/light/spot.h"
#include "kernel/light/sun.h"

namespace relief {

/// What a function gives that is called with the type of a light's kind.
template <typename Function>
RELIEF_KERNEL auto light_visit(const Light& light, const Function& function)
{
  switch (light.kind) {
#define LIGHT_KIND(name, Type) \
  case LightKind::name:        \
    return function(Type{});
#include "kernel/light/light_kinds.inc"
  }
  __builtin_unreachable();
}

/// Samples a light; see light_sample.h.
RELIEF_KERNEL LightSample light_sample(const Light& light, Vec3f P, Vec2f u)
{
  return light_visit(light, [&](auto kind) { return light_sample(kind, light, P, u); });
}

/// Solid-angle density of light_sample for a ray that hit the light; 0 for one without a size.
/// @param wi        unit, from P to the light
/// @param distance  metres, of the hit
RELIEF_KERNEL float light_pdf(const Light& light, Vec3f P, Vec3f wi, float distance)
{
  return light_visit(light, [&](auto kind) { return light_pdf(kind, light, P, wi, distance); });
}

/// @param emission  light_scalar of what the light sends, as an uneven one does on average
RELIEF_KERNEL LightBounds light_bounds(const Light& light, float emission)
{
  return light_visit(light, [&](auto kind) { return light_bounds(kind, light, emission); });
}

/// Whether rays meet the light itself, as a shape that lets them pass.
RELIEF_KERNEL bool light_is_met(const Light& light)
{
  return light_visit(light, [&](auto kind) {
    if constexpr (kind.kBody == LightBody::kOwn) {
      return light.instance_index < 0 && (light.multiple_importance || light.visible_to_camera) &&
             light_is_met(kind, light);
    } else {
      return false;
    }
  });
}

/// Radiance that a light sends against a ray that arrives at its body.
/// @param wi  unit, direction of travel of the ray, towards the light
RELIEF_KERNEL Vec3f light_emitted(const Light& light, Vec3f wi)
{
  return light_visit(light, [&](auto kind) {
    if constexpr (kind.kBody != LightBody::kNone) {
      return light_emitted(kind, light, wi);
    } else {
      return Vec3f{};
    }
  });
}

/// Half the size of the box around the P of a light which light_is_met.
RELIEF_KERNEL Vec3f light_half_extent(const Light& light)
{
  return light_visit(light, [&](auto kind) {
    if constexpr (kind.kBody == LightBody::kOwn) {
      return light_half_extent(kind, light);
    } else {
      return Vec3f{};
    }
  });
}

/// Distance along a ray to a light which light_is_met.
/// @return negative or no number: the ray misses
RELIEF_KERNEL float light_distance(const Light& light, Vec3f O, Vec3f D)
{
  return light_visit(light, [&](auto kind) {
    if constexpr (kind.kBody == LightBody::kOwn) {
      return light_distance(kind, light, O, D);
    } else {
      return -1.0f;
    }
  });
}

/// Whether a light's shape is a parallelogram, which is known to Embree.
RELIEF_KERNEL bool light_is_quad(const Light& light)
{
  return light_visit(light, [](auto kind) { return kind.kIsQuad; });
}

/// Where a value graph sees a lamp shine.
/// @param P   world, on it; of suns any
/// @param wo  unit, from there
RELIEF_KERNEL LightPlace light_place(const Light& light, Vec3f P, Vec3f wo)
{
  return light_visit(light, [&](auto kind) {
    if constexpr (kind.kBody != LightBody::kMesh) {
      return light_place(kind, light, P, wo);
    } else {
      return LightPlace{};
    }
  });
}

/// Texture coordinates at a place of a lamp.
/// @param wo  unit, from there
RELIEF_KERNEL Vec2f light_uv(const Light& light, const Affine3& object_from_world, LightPlace at, Vec3f wo)
{
  return light_visit(light, [&](auto kind) {
    if constexpr (kind.kBody != LightBody::kMesh) {
      return light_uv(kind, light, object_from_world, at, wo);
    } else {
      return Vec2f{};
    }
  });
}

/// Some point of a lamp and a direction from there.
/// @param u     [0, 1)²: place of flat ones, direction of the others
/// @param v     [0, 1)²: direction of flat ones
/// @param back  of two sides, the other one
RELIEF_KERNEL LightRay light_emit(const Light& light, Vec2f u, Vec2f v, bool back)
{
  return light_visit(light, [&](auto kind) {
    if constexpr (kind.kBody != LightBody::kMesh) {
      return light_emit(kind, light, u, v, back);
    } else {
      return LightRay{};
    }
  });
}

}  // namespace relief
