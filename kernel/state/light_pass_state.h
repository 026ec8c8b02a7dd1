// What a path keeps for the layers that tell light apart by what the surface that the camera sees does to it.
#pragma once

#include "kernel/film/film_layout.h"
#include "kernel/math/vec.h"

namespace relief {

/// Shares of a path's light by the kind of its first event.
struct EventShares {
  Vec3f of[kNumEventKinds];
};

struct LightPassState {
  EventShares found;             ///< of what the path brings that has left its first surface
  EventShares asked;             ///< of the light that was asked for at the first surface
  Vec3f light[kNumLightPasses];  ///< so far, by light_pass
};

/// Adds light to those that its shares name.
RELIEF_KERNEL void light_passes_add(LightPassState& s, const EventShares& shares, bool is_indirect, Vec3f light)
{
  for (int kind = 0; kind < kNumEventKinds; ++kind) {
    s.light[light_pass(static_cast<EventKind>(kind), is_indirect)] += shares.of[kind] * light;
  }
}

}  // namespace relief
