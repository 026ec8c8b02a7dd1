// What a ray meets next, one hit after the other: for questions of where a point is.
#pragma once

#include <optional>

#include "integrator/scene_context.h"

namespace relief {

struct InstanceHit {
  float t;            ///< metres
  unsigned instance;  ///< or, from num_instances on, a light
  Vec3f Ng;           ///< geometric normal on the front side, world; of lights (0, 0, 0)
};

/// @param from, to  metres: how far from P it is looked
/// @param mask  bits RayMask
std::optional<InstanceHit>
instance_hit_next(const SceneContext& context, Vec3f P, Vec3f D, float time, float from, float to, std::uint32_t mask);

}  // namespace relief
