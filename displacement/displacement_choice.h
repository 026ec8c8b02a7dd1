// How a use of a displacement is traced: what its settings and the options ask for, what the picture shows of it, and what memory
// allows. DisplacementSet's functions of that are beside these; what it builds by them is in displacement_moves.cpp (vertices and
// tiles), displacement_dicing.cpp (tessellations), displacement_borders.cpp and displacement_set.cpp (what is traced as it is), and
// what becomes of hits in displacement_resolve.cpp.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "displacement/displacement_set.h"

namespace relief {

DisplacementMethod asked_method(const DisplacementSettings& settings, const DisplacementOptions& options);
float lod_of(const DisplacementSettings& settings, const DisplacementOptions& options);

/// What a method tessellates into; empty: it does not, or it is not known yet.
std::optional<TessellationKind> tessellation_kind(DisplacementMethod method);

/// Whether a surface between two levels is traced instead of either by chance. A level that rays choose by their cones would
/// change along them: a surface that is bilinear nowhere.
bool blends_levels(const DisplacementSettings& settings, const DisplacementOptions& options);

/// What meshes that are diced or divided may take, all together, bytes.
std::uint64_t dicing_allowance(const DisplacementOptions& options);

std::uint64_t memory_of_machine();  ///< bytes

/// "1.5 GiB"
std::string gibibytes(std::uint64_t bytes);

/// Whether a mesh under a map may have been divided to be displaced, so that its vertices are moved in pictures that show it small.
bool map_may_move_vertices(const DisplacementSettings& settings, std::size_t num_triangles);

}  // namespace relief
