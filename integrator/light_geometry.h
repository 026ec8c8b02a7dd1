// Area lights as user geometry: disks, balls, and whatever moves while the shutter is open. Rays meet them where shading has
// them; a rectangle that stands still is Embree's quad.
#pragma once

#include "displacement/embree.h"
#include "kernel/light/light_sampler.h"
#include "kernel/math/box.h"

namespace relief {

/// User data of a light. Must stay where it is while the geometry is in use.
struct LightGeometry {
  Light light;
  LightsView view;  ///< of the light alone, which lights_at takes to a ray's time
};

/// @param motions  LightsView::motions
LightGeometry light_geometry_prepare(const Light& light, const MotionView* motions);

/// Box of a light, wherever it moves to.
Box3 light_geometry_bounds(const LightGeometry& light);

/// A new geometry of one primitive, not committed.
/// @param light  one that light_is_met; prepared, and not moved since
RTCGeometry light_geometry_make(RTCDevice device, LightGeometry& light);

}  // namespace relief
