// The node tree: transforms, inherited settings, animation, and RELIEF_reference, which grafts one file's nodes into
// another's tree with overrides. What comes out is a flat list of placed nodes.
#pragma once

#include <functional>
#include <map>
#include <optional>

#include "scene/animation.h"
#include "scene/gltf_document.h"
#include "scene/relief_extensions.h"
#include "scene/transform.h"

namespace relief {

/// All files of a scene, each loaded once.
class DocumentSet {
 public:
  /// @error SceneError
  const GltfDocument& load(const std::filesystem::path& path, Warnings& warnings);

  /// Scene files and buffers, in the order they were read.
  std::vector<std::string> files_read() const;

 private:
  std::vector<std::unique_ptr<GltfDocument>> documents_;
  std::map<std::filesystem::path, const GltfDocument*> by_path_;
};

/// A node at its place in the world.
struct PlacedNode {
  const GltfDocument* document = nullptr;
  int node_index = 0;
  Transform world;
  ObjectSettings object;
  const GltfDocument* material_document = nullptr;  ///< null: the primitives' own materials
  int material_index = -1;                          ///< override, in material_document
  bool animated = false;                            ///< the node or one above it is animated at the time asked for
  std::string defect_path;  ///< JSON path of the topmost node here that has a singular transform; empty: none
};

/// Visits every node of the root file's default scene and of what it refers to, parents before children, in file order.
/// @param time_seconds  animation time; empty: rest pose
/// @error SceneError: a cycle of references, a reference that leads nowhere, bad overrides, an absurd number of nodes
void composition_traverse(DocumentSet& documents,
                          const GltfDocument& root,
                          std::optional<double> time_seconds,
                          Warnings& warnings,
                          const std::function<void(const PlacedNode&)>& visit);

}  // namespace relief
