#include "integrator/instance_geometry.h"

#include <cmath>

#include "integrator/scene_motion.h"
#include "kernel/math/rounding.h"

namespace relief {

namespace {

ObjectFromWorld object_from_world_make(const Affine3& world_from_object)
{
  const Vec3d x = to_double(world_from_object.x), y = to_double(world_from_object.y),
              z = to_double(world_from_object.z), p = to_double(world_from_object.p);
  const Vec3d rows[3] = {cross(y, z), cross(z, x), cross(x, y)};
  const double d = 1.0 / dot(x, rows[0]);
  ObjectFromWorld out;
  out.x = d * Vec3d{rows[0].x, rows[1].x, rows[2].x};
  out.y = d * Vec3d{rows[0].y, rows[1].y, rows[2].y};
  out.z = d * Vec3d{rows[0].z, rows[1].z, rows[2].z};
  out.p = -1.0 * (p.x * out.x + p.y * out.y + p.z * out.z);
  return out;
}

/// Box of the scene's box under a transform.
Box3 placed_bounds(const Box3& box, const Affine3& m)
{
  Box3 out = box_empty();
  if (!(box.low.x <= box.high.x)) return out;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3f at{(corner & 1) != 0 ? box.high.x : box.low.x, (corner & 2) != 0 ? box.high.y : box.low.y,
                   (corner & 4) != 0 ? box.high.z : box.low.z};
    const Vec3f P = transform_point(m, at);
    // The rounding of P.
    const Vec3f size = abs(at);
    const Vec3f error = gamma_bound(4) * (abs(m.x) * size.x + abs(m.y) * size.y + abs(m.z) * size.z + abs(m.p));
    out = box_union(out, {P - error, P + error});
  }
  return out;
}

/// Box of a moving instance at one of its keys. What lies straight between this and that of the next key holds the instance
/// meanwhile.
Box3 key_bounds(const InstanceGeometry& instance, std::uint32_t key)
{
  const MotionView& motion = instance.motion;
  const Box3& box = instance.target.box;
  if (!(box.low.x <= box.high.x)) return box_empty();
  const auto reach = static_cast<double>(length(max(abs(box.low), abs(box.high))));
  double stray = 0;
  for (std::uint32_t i = key > 0 ? key - 1 : 0; i <= key && i + 1 < motion.num_keys; ++i) {
    stray = max(stray, motion_stray(motion.keys[i], motion.keys[i + 1], reach));
  }
  const Box3 out =
      placed_bounds(box, motion_at(motion, static_cast<float>(key) / static_cast<float>(motion.num_keys - 1)));
  // Embree's times are rounded, and so is the sum of two boxes.
  const Vec3f margin = splat3(static_cast<float>(stray * 1.001)) +
                       gamma_bound(8 + 2 * static_cast<int>(motion.num_keys)) * max(abs(out.low), abs(out.high));
  return {out.low - margin, out.high + margin};
}

void bounds(const RTCBoundsFunctionArguments* arguments)
{
  const auto& instance = *static_cast<const InstanceGeometry*>(arguments->geometryUserPtr);
  const Box3 box = instance.motion.num_keys > 0 ? key_bounds(instance, arguments->timeStep) : instance_bounds(instance);
  const float pad = *instance.pad;
  RTCBounds* out = arguments->bounds_o;
  out->lower_x = box.low.x - pad;
  out->lower_y = box.low.y - pad;
  out->lower_z = box.low.z - pad;
  out->upper_x = box.high.x + pad;
  out->upper_y = box.high.y + pad;
  out->upper_z = box.high.z + pad;
}

/// A ray of the scene above in an instance: t above = t_start + t_scale · t inside.
struct InstanceRay {
  ObjectRay exact;
  double t_start = 0;  ///< that of `exact` counts from the far origin, where there is one

  /// @param ray  is turned into that of the instance's scene
  /// @return     false: it meets nothing there
  bool enter(const InstanceGeometry& instance, const EmbreeContext& context, RTCRay* ray)
  {
    const Vec3d O = context.far_start.is_far ? context.far_start.O : Vec3d{ray->org_x, ray->org_y, ray->org_z};
    ObjectFromWorld at_time;
    if (instance.motion.num_keys > 0) at_time = object_from_world_make(motion_at(instance.motion, ray->time));
    const ObjectFromWorld& m = instance.motion.num_keys > 0 ? at_time : instance.object_from_world;
    exact.O = O.x * m.x + O.y * m.y + O.z * m.z + m.p;
    exact.D = static_cast<double>(ray->dir_x) * m.x + static_cast<double>(ray->dir_y) * m.y +
              static_cast<double>(ray->dir_z) * m.z;
    double t_min = ray->tnear, t_max = ray->tfar;
    const double size = max(std::abs(exact.D.x), max(std::abs(exact.D.y), std::abs(exact.D.z)));
    // Embree's tests are for directions that are neither tiny nor huge. A power of two rounds nothing.
    if (!(size > 0x1p-20 && size < 0x1p20)) {
      if (!(size > 0)) return false;
      const double scale = std::ldexp(1.0, std::ilogb(size));
      exact.D = exact.D * (1.0 / scale);
      exact.t_scale = 1.0 / scale;
      t_min *= scale;
      t_max *= scale;
    }
    if (!ray_starts_near(instance.target, exact.O)) {
      const double moved = ray_move_near(instance.target, &exact.O, exact.D);
      if (!(moved >= 0 && moved <= t_max)) return false;
      t_start = moved * exact.t_scale;
      t_min = max(t_min - moved, 0.0);
      t_max -= moved;
    }
    exact.t_start = context.far_start.t + t_start;
    ray->org_x = static_cast<float>(exact.O.x);
    ray->org_y = static_cast<float>(exact.O.y);
    ray->org_z = static_cast<float>(exact.O.z);
    ray->dir_x = static_cast<float>(exact.D.x);
    ray->dir_y = static_cast<float>(exact.D.y);
    ray->dir_z = static_cast<float>(exact.D.z);
    ray->tnear = static_cast<float>(t_min);
    ray->tfar = static_cast<float>(t_max);
    return ray->tnear <= ray->tfar;
  }
};

/// Sets what a query inside an instance needs of its context, for as long as it lives.
class InsideInstance {
 public:
  InsideInstance(EmbreeContext& context, unsigned instance, const ObjectRay& ray) : context_(context)
  {
    context_.rtc.instID[0] = instance;
    context_.object_ray = &ray;
  }
  ~InsideInstance()
  {
    context_.rtc.instID[0] = RTC_INVALID_GEOMETRY_ID;
    context_.object_ray = nullptr;
  }
  InsideInstance(const InsideInstance&) = delete;
  InsideInstance& operator=(const InsideInstance&) = delete;

 private:
  EmbreeContext& context_;
};

/// Traces one ray in place.
/// @param id  the instance's geometry number
void intersect1(const InstanceGeometry& instance, EmbreeContext& context, unsigned id, RTCRayHit& query)
{
  const RTCRay outside = query.ray;
  InstanceRay ray;
  if (!ray.enter(instance, context, &query.ray)) {
    query.ray = outside;
    return;
  }
  const unsigned hit_before = query.hit.geomID;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  {
    const InsideInstance inside(context, id, ray.exact);
    embree_intersect1(instance.scene, context, query);
  }
  const double t = ray.t_start + ray.exact.t_scale * static_cast<double>(query.ray.tfar);
  query.ray = outside;
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
    query.hit.geomID = hit_before;
  } else {
    query.ray.tfar = min(outside.tfar, static_cast<float>(t));
  }
}

void intersect(const RTCIntersectFunctionNArguments* arguments)
{
  const auto& instance = *static_cast<const InstanceGeometry*>(arguments->geometryUserPtr);
  auto& context = *reinterpret_cast<EmbreeContext*>(arguments->context);
  const unsigned count = arguments->N;
  if (count == 1) {
    if (arguments->valid[0] == -1)
      intersect1(instance, context, arguments->geomID, *reinterpret_cast<RTCRayHit*>(arguments->rayhit));
    return;
  }
  RTCRayN* rays = RTCRayHitN_RayN(arguments->rayhit, count);
  RTCHitN* hits = RTCRayHitN_HitN(arguments->rayhit, count);
  for (unsigned k = 0; k < count; ++k) {
    if (arguments->valid[k] != -1) continue;
    RTCRayHit query;
    query.ray = rtcGetRayFromRayN(rays, count, k);
    query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    intersect1(instance, context, arguments->geomID, query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
    RTCRayN_tfar(rays, count, k) = query.ray.tfar;
    rtcCopyHitToHitN(hits, &query.hit, count, k);
  }
}

void occluded(const RTCOccludedFunctionNArguments* arguments)
{
  const auto& instance = *static_cast<const InstanceGeometry*>(arguments->geometryUserPtr);
  auto& context = *reinterpret_cast<EmbreeContext*>(arguments->context);
  const unsigned count = arguments->N;
  for (unsigned k = 0; k < count; ++k) {
    if (arguments->valid[k] != -1) continue;
    RTCRay query =
        count == 1 ? *reinterpret_cast<const RTCRay*>(arguments->ray) : rtcGetRayFromRayN(arguments->ray, count, k);
    InstanceRay ray;
    if (!ray.enter(instance, context, &query)) continue;
    const InsideInstance inside(context, arguments->geomID, ray.exact);
    embree_occluded1(instance.scene, context, query);
    if (query.tfar < 0.0f) RTCRayN_tfar(arguments->ray, count, k) = -kInfinity;
  }
}

}  // namespace

InstanceGeometry instance_geometry_prepare(RTCScene scene,
                                           const Box3& box,
                                           const Affine3& world_from_object,
                                           MotionView motion,
                                           const float* pad)
{
  InstanceGeometry out;
  out.scene = scene;
  out.world_from_object = world_from_object;
  out.pad = pad;
  out.object_from_world = object_from_world_make(world_from_object);
  out.motion = motion;
  out.target = ray_target_make(box);
  return out;
}

Vec3f instance_pad(const InstanceGeometry& instance)
{
  const ObjectFromWorld& m = instance.object_from_world;
  return *instance.pad * (abs(to_float(m.x)) + abs(to_float(m.y)) + abs(to_float(m.z)));
}

bool instance_is_accurate_in_single_precision(const InstanceGeometry& instance)
{
  // The pad is several times what rays err by.
  const Box3& box = instance.target.box;
  return max_component(instance_pad(instance)) <= 0x1p-6f * max_component(box.high - box.low);
}

Box3 instance_bounds(const InstanceGeometry& instance)
{
  if (instance.motion.num_keys == 0) return placed_bounds(instance.target.box, instance.world_from_object);
  Box3 out = box_empty();
  for (std::uint32_t key = 0; key < instance.motion.num_keys; ++key) out = box_union(out, key_bounds(instance, key));
  return out;
}

RTCGeometry instance_geometry_make(RTCDevice device, InstanceGeometry& instance)
{
  RTCGeometry out = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(out, 1);
  rtcSetGeometryUserData(out, &instance);
  if (instance.motion.num_keys > 0) rtcSetGeometryTimeStepCount(out, instance.motion.num_keys);
  rtcSetGeometryBoundsFunction(out, bounds, nullptr);
  rtcSetGeometryIntersectFunction(out, intersect);
  rtcSetGeometryOccludedFunction(out, occluded);
  return out;
}

}  // namespace relief
