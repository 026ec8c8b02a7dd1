// Heights that materials give as value graphs. Of those over texture coordinates alone each is evaluated once, into a height
// map that is traced like any other; others are kept, to be evaluated at the points that rays ask for.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "kernel/texture/texture_view.h"
#include "scene/gltf_document.h"
#include "scene/height_map.h"
#include "scene/scene.h"
#include "scene/texture_table.h"

namespace relief {

/// What became of a heightGraph.
struct HeightGraph {
  TextureRef map;        ///< where its map lies under the mesh; texture_index is into HeightGraphTable::maps
  int graph_index = -1;  ///< into Scene::graphs; −1: it has a map
};

/// The maps of a scene's height graphs. Equal graphs share one.
class HeightGraphTable {
 public:
  /// @param textures  gets the images of graphs that are kept
  /// @param scene     gets these graphs, and the names of attributes that they read
  HeightGraphTable(TextureTable& textures, Scene& scene) : textures_(textures), scene_(scene) {}

  /// @param run  evaluates graphs of which maps are made
  void run_by(GraphRun run) { run_ = run; }

  /// Evaluates the heightGraph of a RELIEF_displacement, or keeps it.
  /// @param displacement  the extension's object, which has a heightGraph
  /// @param material      as warnings name it
  /// @error SceneError: see graph_read; a bad texCoord, uvRange, resolution, or evaluate
  /// @error OutOfMemory
  /// @cost  parallel; up to 17 million evaluations
  HeightGraph add(const GltfDocument& document,
                  const JsonReader& displacement,
                  const std::string& material,
                  Warnings& warnings);

  /// Keeps what a displacement by vectors says, its vectorTexture or vectorGraph.
  /// @return index into Scene::graphs
  /// @error  SceneError: see vector_graph_read
  int add_vectors(const GltfDocument& document, const JsonReader& displacement, Warnings& warnings);

  const std::vector<HeightMap>& maps() const { return maps_; }

  /// The maps, in index order; the table is empty afterwards.
  std::vector<HeightMap> take() { return std::exchange(maps_, {}); }

 private:
  int keep(GraphProgram program);
  HeightGraph keep(const GltfDocument& document, const JsonReader& graph, Warnings& warnings);

  TextureTable& textures_;
  Scene& scene_;
  GraphRun run_ = graph_program_run;
  std::vector<HeightMap> maps_;
  std::map<std::string, HeightGraph> known_;  ///< by the graph's JSON
};

}  // namespace relief
