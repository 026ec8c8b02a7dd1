// Reads RELIEF_graph and RELIEF_surface of a material: checks nodes, types and references, and compiles them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "scene/gltf_document.h"
#include "scene/graph/graph_nodes.h"
#include "scene/graph/graph_program.h"
#include "scene/graph/volume_reader.h"
#include "scene/texture_table.h"

namespace relief {

/// The programs of a material.
struct GraphPrograms {
  std::optional<GraphProgram> surface;       ///< none: there is neither RELIEF_surface nor an output of the graph
  std::optional<GraphProgram> emission;      ///< of its emission closures alone, for lights; none: it has none
  std::optional<GraphProgram> transparency;  ///< of its transparent closures alone, for shadow rays; none: it has none
  std::optional<VolumeProgram> volume;       ///< none: there is no RELIEF_volume
};

/// @param graph     RELIEF_graph's object; null: no nodes
/// @param surface   RELIEF_surface's object; null: the graph gives factors of glTF's material alone, if any
/// @param volume    RELIEF_volume's object; null: there is none
/// @param textures  gets the images that the graph reads; their indices stand in the program
/// @param attribute_names  likewise, the names of attributes
/// @error SceneError: a node of unknown type, a reference to none, a cycle, a value of another type; a graph too large
GraphPrograms graph_read(const GltfDocument& document,
                         const JsonReader* graph,
                         const JsonReader* surface,
                         const JsonReader* volume,
                         TextureTable& textures,
                         std::vector<std::string>& attribute_names,
                         Warnings& warnings);

/// Reads a medium that no material has.
/// @param volume  its object, with `closures` and, if they refer to some, `nodes`
/// @error         likewise
VolumeProgram volume_read(const GltfDocument& document,
                          const JsonReader& volume,
                          TextureTable& textures,
                          Warnings& warnings);

/// Reads the graph of an environment: its output `color` becomes the program's results 0 to 2.
/// @param graph  its object, with `nodes` and `outputs`
/// @param suns   gets the small lights that it has
/// @error        likewise
GraphProgram graph_read_color(const GltfDocument& document,
                              const JsonReader& graph,
                              TextureTable& textures,
                              std::vector<GraphSun>& suns,
                              Warnings& warnings);

/// The graph of a light that is no mesh: its output `emission` becomes the program's results 0 to 2.
/// @error SceneError: as graph_read
GraphProgram graph_read_lamp(const GltfDocument& document,
                             const JsonReader& graph,
                             TextureTable& textures,
                             Warnings& warnings);

/// The graph of a displacement's height: its nodes and their output `height`, which is the program's only result.
/// @param attribute_names  as graph_read
/// @error SceneError: as graph_read
GraphProgram height_graph_read(const GltfDocument& document,
                               const JsonReader& graph,
                               TextureTable& textures,
                               std::vector<std::string>& attribute_names,
                               Warnings& warnings);

/// What a displacement by vectors says: its vectorTexture, or its vectorGraph with the output `vector`, with `space`, `scale` and
/// `midlevel`. The results are where points go, metres, object space.
/// @param displacement     the extension's object, which has one of the two
/// @param attribute_names  as graph_read
/// @error SceneError: as graph_read; a graph whose output is a number; a bad texture
GraphProgram vector_graph_read(const GltfDocument& document,
                               const JsonReader& displacement,
                               TextureTable& textures,
                               std::vector<std::string>& attribute_names,
                               Warnings& warnings);

}  // namespace relief
