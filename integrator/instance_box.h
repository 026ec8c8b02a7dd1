// Where an instance may be met.
#pragma once

#include <cstddef>

#include "integrator/scene_context.h"
#include "kernel/math/box.h"

namespace relief {

/// Box of an instance in the world, a little wider than what rays can meet of it: displaced, and over all time.
Box3 instance_box(const SceneContext& context, std::size_t index);

}  // namespace relief
