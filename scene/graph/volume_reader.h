// Reads RELIEF_volume: the closures that a medium is a weighted list of.
#pragma once

#include "kernel/volume/medium_closures.h"
#include "scene/graph/closure_reader.h"

namespace relief {

/// Reads the closures; their inputs become results of the graph.
/// @param reader  the extension's object
/// @error SceneError: unknown types; inputs of another type; more phase functions than a medium may have
std::vector<VolumeClosureSpec> volume_closures_read(const JsonReader& reader,
                                                    const GraphInputReader& input,
                                                    GraphBuilder& build,
                                                    Warnings& warnings);

/// Whether a medium is the same everywhere.
bool medium_is_even(const VolumeProgram& volume);

/// @pre medium_is_even
Medium medium_of(const VolumeProgram& volume);

}  // namespace relief
