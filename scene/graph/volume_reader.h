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

/// The medium of closures that depend on nothing.
/// @param program  without inputs
Medium medium_of(const GraphProgram& program, std::span<const VolumeClosureSpec> closures);

}  // namespace relief
