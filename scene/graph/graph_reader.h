// Reads RELIEF_graph of a material: checks its nodes, types and references, and compiles it.
#pragma once

#include "scene/gltf_document.h"
#include "scene/graph/graph_program.h"
#include "scene/texture_table.h"

namespace relief {

/// @param reader    the extension's object
/// @param textures  gets the images that the graph reads; their indices stand in the program
/// @error SceneError: a node of unknown type, a reference to none, a cycle, a value of another type; a graph too large
GraphProgram graph_read(const GltfDocument& document,
                        const JsonReader& reader,
                        TextureTable& textures,
                        Warnings& warnings);

}  // namespace relief
