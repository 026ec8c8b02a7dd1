// Where rays pass a lens.
#pragma once

#include "kernel/camera/camera.h"
#include "kernel/sample/warp.h"

namespace relief {

/// Uniform point of a camera's aperture, for a radius of 1.
/// @return  x to the right, y up, seen from behind the camera
RELIEF_KERNEL Vec2f aperture_sample(const Camera& camera, Vec2f u)
{
  Vec2f lens;
  if (camera.aperture_blades < 3) {
    lens = warp_disk(u);
  } else {
    const Vec2f p = warp_polygon(u, camera.aperture_blades);
    const SinCos turn = sin_cos_turn(camera.aperture_rotation * (0.5f * kInvPi));
    lens = {turn.cos * p.x - turn.sin * p.y, turn.sin * p.x + turn.cos * p.y};
  }
  return {lens.x / camera.aperture_ratio, lens.y};
}

}  // namespace relief
