// The medium that the closures of RELIEF_volume come to.
#pragma once

#include <span>

#include "kernel/volume/absorption_volume.h"
#include "kernel/volume/draine_volume.h"
#include "kernel/volume/emission_volume.h"
#include "kernel/volume/fournier_forand_volume.h"
#include "kernel/volume/mie_volume.h"
#include "kernel/volume/principled_volume.h"
#include "kernel/volume/rayleigh_volume.h"
#include "kernel/volume/scatter_volume.h"

namespace relief {

/// What a function gives that is called with the type of a closure's kind.
template <typename Function>
RELIEF_KERNEL auto volume_closure_visit(VolumeClosureKind kind, const Function& function)
{
  switch (kind) {
#define VOLUME_CLOSURE(name, Type) \
  case VolumeClosureKind::name:    \
    return function(Type{});
#include "kernel/volume/volume_closures.inc"
  }
  __builtin_unreachable();
}

/// What a medium's closures come to at one point.
/// @param at  of the medium's program, which has run
RELIEF_KERNEL Medium medium_resolve(std::span<const VolumeClosureSpec> closures, const GraphLane& at)
{
  Medium medium;
  for (const VolumeClosureSpec& closure : closures) {
    VolumeNumbers in{at, closure.first_result};
    const float weight = max(in.number(), 0.0f);
    if (!(weight > 0.0f)) continue;
    volume_closure_visit(closure.kind, [&](auto kind) { medium_add(kind, weight, in, medium); });
  }
  return medium;
}

}  // namespace relief
