// Heights that materials give as value graphs over texture coordinates: each graph is evaluated once, into a height map that
// is traced like any other.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "kernel/texture/texture_view.h"
#include "scene/gltf_document.h"
#include "scene/height_map.h"

namespace relief {

/// The maps of a scene's height graphs. Equal graphs share one.
class HeightGraphTable {
 public:
  /// Evaluates the heightGraph of a RELIEF_displacement.
  /// @param displacement  the extension's object, which has a heightGraph
  /// @param material      as warnings name it
  /// @return              where the map lies under the mesh; texture_index is into maps(). Empty: the graph reads more
  ///                      than texture coordinates, and a warning says so
  /// @error SceneError: see graph_read; a bad texCoord, uvRange or resolution
  /// @error OutOfMemory
  /// @cost  parallel; up to 17 million evaluations
  std::optional<TextureRef> add(const GltfDocument& document,
                                const JsonReader& displacement,
                                const std::string& material,
                                Warnings& warnings);

  const std::vector<HeightMap>& maps() const { return maps_; }

  /// The maps, in index order; the table is empty afterwards.
  std::vector<HeightMap> take() { return std::exchange(maps_, {}); }

 private:
  std::vector<HeightMap> maps_;
  std::map<std::string, TextureRef> known_;  ///< by the graph's JSON
};

}  // namespace relief
