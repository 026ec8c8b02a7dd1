// Light that leaves evenly on the far side: Lambert's lobe, upside down.
#pragma once

#include "kernel/bsdf/diffuse.h"

namespace relief {

/// Has no parameters but its colour.
struct Translucent {};

/// f before the colour. @param wi  unit; z < 0, dark above
RELIEF_KERNEL float translucent_eval(const Translucent&, Vec3f, Vec3f wi, float* pdf)
{
  *pdf = warp_cosine_hemisphere_pdf(-wi.z);
  return wi.z < 0.0f ? kInvPi : 0.0f;
}

RELIEF_KERNEL Vec3f translucent_sample(const Translucent&, Vec3f, Vec2f u)
{
  const Vec3f w = diffuse_sample(u);
  return {w.x, w.y, -w.z};
}

}  // namespace relief
