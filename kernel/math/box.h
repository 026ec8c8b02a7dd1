// Axis-aligned boxes.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

struct Box3 {
  Vec3f low{}, high{};
};

/// The box of nothing: its union with any other is the other.
RELIEF_KERNEL Box3 box_empty() { return {splat3(kInfinity), splat3(-kInfinity)}; }

RELIEF_KERNEL Box3 box_union(const Box3& a, const Box3& b) { return {min(a.low, b.low), max(a.high, b.high)}; }

RELIEF_KERNEL bool boxes_overlap(const Box3& a, const Box3& b)
{
  return a.low.x <= b.high.x && a.low.y <= b.high.y && a.low.z <= b.high.z && b.low.x <= a.high.x &&
         b.low.y <= a.high.y && b.low.z <= a.high.z;
}

}  // namespace relief
