// Instances of a scene as user geometry of the scene above. Embree's own instances bring rays to object space in single
// precision, with errors in proportion to all coordinates of the world; these do it in double precision, and move the ray
// to the instance, so that what its boxes are tested with errs by ulps of the instance, wherever the ray comes from.
#pragma once

#include "displacement/embree.h"
#include "displacement/far_ray.h"
#include "kernel/math/affine.h"

namespace relief {

/// User data of an instance. Must stay where it is while the geometry is in use.
struct InstanceGeometry {
  RTCScene scene = nullptr;
  Affine3 world_from_object;
  Vec3d x, y, z, p;            ///< object_from_world: images of the unit axes and of the origin
  RayTarget target;            ///< the scene's box
  const float* pad = nullptr;  ///< by which boxes of the scene above are enlarged, metres; read while that is built
};

/// @param scene  committed; its geometry takes EmbreeContext
InstanceGeometry instance_geometry_prepare(RTCScene scene, const Affine3& world_from_object, const float* pad);

/// Box of an instance, not enlarged, world.
Box3 instance_bounds(const InstanceGeometry& instance);

/// A new geometry of one primitive, not committed. Hits have the instance's geometry number as instID.
RTCGeometry instance_geometry_make(RTCDevice device, InstanceGeometry& instance);

}  // namespace relief
