#include "integrator/light_geometry.h"

#include "kernel/math/rounding.h"

namespace relief {

namespace {

/// With a pad that covers rounding.
Box3 still_bounds(const Light& light)
{
  const Vec3f half = light_half_extent(light) * (1.0f + 8.0f * kUnitRoundoff);
  const Vec3f pad = 4.0f * kUnitRoundoff * (abs(light.P) + half);
  return {light.P - half - pad, light.P + half + pad};
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
    const float t = light_distance(light, O, D);
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
