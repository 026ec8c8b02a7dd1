// Instances of a scene as user geometry of the scene above. Embree's own instances bring rays to object space in single
// precision, with errors in proportion to all coordinates of the world; these do it in double precision, and move the ray
// to the instance, so that what its boxes are tested with errs by ulps of the instance, wherever the ray comes from. They
// are for displaced geometry and for what is small in its world: Embree's own take three quarters of the time.
#pragma once

#include "displacement/embree.h"
#include "displacement/far_ray.h"
#include "kernel/math/affine.h"
#include "kernel/math/motion.h"

namespace relief {

/// A transform's inverse: images of the unit axes and of the origin.
struct ObjectFromWorld {
  Vec3d x, y, z, p;
};

/// User data of an instance. Must stay where it is while the geometry is in use.
struct InstanceGeometry {
  RTCScene scene = nullptr;
  Affine3 world_from_object;
  ObjectFromWorld object_from_world;
  MotionView motion;           ///< keys: the transforms count at the rays' times instead of the two above
  RayTarget target;            ///< the scene's box, object space
  const float* pad = nullptr;  ///< by which boxes of the scene above are enlarged, metres; read while that is built
};

/// @param scene  its geometry takes EmbreeContext
/// @param box    that the scene's geometry is in, object space
/// @param motion without keys: it stands still
InstanceGeometry instance_geometry_prepare(RTCScene scene,
                                           const Box3& box,
                                           const Affine3& world_from_object,
                                           MotionView motion,
                                           const float* pad);

/// By how much the scene's box is to be enlarged, object space, for that of the instance to be enlarged by its pad.
Vec3f instance_pad(const InstanceGeometry& instance);

/// Whether single precision errs by little to the instance's size where it brings rays of the world to object space.
bool instance_is_accurate_in_single_precision(const InstanceGeometry& instance);

/// Box of an instance, wherever it moves to, not enlarged, world.
Box3 instance_bounds(const InstanceGeometry& instance);

/// A new geometry of one primitive, not committed. Hits have the instance's geometry number as instID.
RTCGeometry instance_geometry_make(RTCDevice device, InstanceGeometry& instance);

}  // namespace relief
