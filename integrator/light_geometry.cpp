#include "integrator/light_geometry.h"

#include "kernel/light/spot.h"
#include "kernel/math/rounding.h"

namespace relief {

namespace {

Box3 still_bounds(const Light& light)
{
  if (light_is_ball(light)) {
    const float reach = light.radius * (1.0f + 8.0f * kUnitRoundoff);
    const Vec3f half = Vec3f{reach, reach, reach} + 4.0f * kUnitRoundoff * abs(light.P);
    return {light.P - half, light.P + half};
  }
  const float rounded_up = 1.0f + 8.0f * kUnitRoundoff;
  Vec3f half = (abs(light.edge_u) + abs(light.edge_v)) * rounded_up;
  if (light.kind == LightKind::kDisk) {
    // Extent of an ellipse c + a·cos φ + b·sin φ along an axis: √(a² + b²); a relative pad covers the rounding.
    const auto extent = [&](float a, float b) { return __builtin_sqrtf(a * a + b * b) * rounded_up; };
    half = {extent(light.edge_u.x, light.edge_v.x), extent(light.edge_u.y, light.edge_v.y),
            extent(light.edge_u.z, light.edge_v.z)};
  }
  const Vec3f pad = 4.0f * kUnitRoundoff * (abs(light.P) + half);
  return {light.P - half - pad, light.P + half + pad};
}

/// Ray against the plane of a rectangle or ellipse; coordinates within it by the dual basis of its half axes.
/// @return  distance; negative: beside it
float flat_distance(const Light& light, Vec3f O, Vec3f D)
{
  const Vec3f normal = cross(light.edge_u, light.edge_v);
  const float normal_squared = length_squared(normal);
  const Vec3f dual_u = cross(light.edge_v, normal) / normal_squared;
  const Vec3f dual_v = cross(normal, light.edge_u) / normal_squared;
  const float t = dot(light.P - O, normal) / dot(D, normal);
  const Vec3f from_center = O + D * t - light.P;
  const float u = dot(from_center, dual_u), v = dot(from_center, dual_v);
  const bool inside = light.kind == LightKind::kDisk ? sqr(u) + sqr(v) <= 1.0f
                                                     : __builtin_fabsf(u) <= 1.0f && __builtin_fabsf(v) <= 1.0f;
  return inside ? t : -1.0f;
}

void bounds(const RTCBoundsFunctionArguments* arguments)
{
  const Box3 box = light_geometry_bounds(*static_cast<const LightGeometry*>(arguments->geometryUserPtr));
  RTCBounds* out = arguments->bounds_o;
  out->lower_x = box.low.x;
  out->lower_y = box.low.y;
  out->lower_z = box.low.z;
  out->upper_x = box.high.x;
  out->upper_y = box.high.y;
  out->upper_z = box.high.z;
}

void intersect(const RTCIntersectFunctionNArguments* arguments)
{
  const auto& geometry = *static_cast<const LightGeometry*>(arguments->geometryUserPtr);
  RTCRayHitN* rays = arguments->rayhit;
  const unsigned count = arguments->N;
  RTCRayN* ray = RTCRayHitN_RayN(rays, count);
  RTCHitN* hit = RTCRayHitN_HitN(rays, count);
  for (unsigned i = 0; i < count; ++i) {
    if (arguments->valid[i] != -1) continue;
    const Vec3f O{RTCRayN_org_x(ray, count, i), RTCRayN_org_y(ray, count, i), RTCRayN_org_z(ray, count, i)};
    const Vec3f D{RTCRayN_dir_x(ray, count, i), RTCRayN_dir_y(ray, count, i), RTCRayN_dir_z(ray, count, i)};
    Light storage;
    const Light& light = lights_at(geometry.view, {0}, storage, RTCRayN_time(ray, count, i));
    // A ray meets a ball once: where it enters, or, started inside, where it leaves.
    const float t = light_is_ball(light) ? ball_light_distance(light, light.P - O, D) : flat_distance(light, O, D);
    if (!(t > RTCRayN_tnear(ray, count, i) && t < RTCRayN_tfar(ray, count, i))) continue;
    RTCRayN_tfar(ray, count, i) = t;
    RTCHitN_geomID(hit, count, i) = arguments->geomID;
    RTCHitN_primID(hit, count, i) = 0;
    RTCHitN_instID(hit, count, i, 0) = RTC_INVALID_GEOMETRY_ID;
  }
}

/// Area lights cast no shadows: their mask keeps shadow rays away, so this is never reached with work to do.
void occluded(const RTCOccludedFunctionNArguments*) {}

}  // namespace

LightGeometry light_geometry_prepare(const Light& light, const MotionView* motions)
{
  LightGeometry out;
  out.light = light;
  out.view.motions = motions;
  return out;
}

Box3 light_geometry_bounds(const LightGeometry& light)
{
  if (light.light.motion_index < 0) return still_bounds(light.light);
  LightsView view = light.view;
  view.lights = &light.light;
  // What lies between two of these times is covered by what they differ by.
  constexpr int kTimes = 64;
  Box3 all = box_empty(), before = box_empty();
  float farthest = 0;
  for (int i = 0; i <= kTimes; ++i) {
    Light storage;
    const Box3 one = still_bounds(lights_at(view, {0}, storage, static_cast<float>(i) / kTimes));
    if (i > 0) farthest = max(farthest, max(length(one.low - before.low), length(one.high - before.high)));
    all = box_union(all, one);
    before = one;
  }
  return {all.low - splat3(farthest), all.high + splat3(farthest)};
}

RTCGeometry light_geometry_make(RTCDevice device, LightGeometry& light)
{
  light.view.lights = &light.light;
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(geometry, 1);
  rtcSetGeometryUserData(geometry, &light);
  rtcSetGeometryBoundsFunction(geometry, bounds, nullptr);
  rtcSetGeometryIntersectFunction(geometry, intersect);
  rtcSetGeometryOccludedFunction(geometry, occluded);
  return geometry;
}

}  // namespace relief
