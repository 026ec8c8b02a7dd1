// Facets (level_facets.h) as paths meet them: the column PathState::facets, and the normals of their hits.
#pragma once

#include <cstdint>

#include "displacement/displacement_set.h"
#include "kernel/globals.h"
#include "kernel/state/path_state.h"

namespace relief {

/// A hit on a level of a height map becomes one on a facet.
/// @param level  of the hit; 0: the map itself, which has none
void path_enter_facets(const DisplacementSet& displacements,
                       PathState& state,
                       std::uint32_t path,
                       const InstanceView& instance,
                       float level);

/// Whether a path's ray meets another facet right where it is; then that is its hit.
bool path_stays_among_facets(const KernelGlobals& g,
                             const DisplacementSet& displacements,
                             PathState& state,
                             std::uint32_t path);

}  // namespace relief
