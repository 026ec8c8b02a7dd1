// Surfaces that shadow rays may pass: what they let through is said by graphs, which run for eight points at a time. So they wait
// until there are eight of one material, or no ray is left.
#pragma once

#include <cstdint>
#include <span>

#include "kernel/globals.h"
#include "kernel/graph/graph_scene.h"
#include "kernel/state/path_state.h"

namespace relief {

class SceneMotion;

/// One of them, where a ray has met it.
struct ShadowPassage {
  std::uint32_t ray;     ///< of the queue
  std::uint32_t object;  ///< of KernelGlobals::instances
  std::uint32_t triangle;
  float u, v, t;
};

/// What graphs are told of a shadow ray. Its length is left open.
GraphRay shadow_graph_ray(const PathState& state, const ShadowQueue& shadow, std::uint32_t ray);

/// Multiplies light by what surfaces let through of it.
/// @param passages    of materials that a graph says it of; are put in the order of these
/// @param visibility  by ray
void shadow_passages_apply(const KernelGlobals& g,
                           const SceneMotion& motion,
                           const PathState& state,
                           const ShadowQueue& shadow,
                           std::span<ShadowPassage> passages,
                           Vec3f* visibility);

}  // namespace relief
