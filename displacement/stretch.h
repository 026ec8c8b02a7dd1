// How much a transform stretches.
#pragma once

#include "kernel/math/affine.h"

namespace relief {

/// The most and the least that a transform stretches any direction.
struct Stretch {
  double most = 1, least = 1;
};

Stretch stretch_of(const Affine3& m);

}  // namespace relief
