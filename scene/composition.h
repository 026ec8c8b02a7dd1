// The node tree: transforms, inherited settings, animation, and RELIEF_reference, which grafts one file's nodes into
// another's tree with overrides. What comes out is a flat list of placed nodes.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

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

  /// Scene files, each with its buffers and images, in the order they were read.
  std::vector<FileStamp> files_read() const;

  /// In the order they were read.
  const std::vector<std::unique_ptr<GltfDocument>>& all() const { return documents_; }

 private:
  std::vector<std::unique_ptr<GltfDocument>> documents_;
  std::map<std::filesystem::path, const GltfDocument*> by_path_;
};

/// A material that one file puts in the place of others.
struct MaterialChoice {
  const GltfDocument* document = nullptr;
  int index = -1;
};

/// What one reference says about materials: of one node, or of all that have a name, "*" standing for any.
struct MaterialRule {
  MaterialChoice of_node;
  std::map<std::string, MaterialChoice> by_name;
  mutable std::set<std::string> used_names;  ///< written while the scene is built, to warn about the others
};

/// A node at its place in the world.
struct PlacedNode {
  const GltfDocument* document = nullptr;
  int node_index = 0;
  Transform world;
  ObjectSettings object;
  /// Of the references that lead here, the innermost first: the last one that says something counts.
  std::vector<std::shared_ptr<const MaterialRule>> material_rules;
  std::vector<double> weights;  ///< of its mesh's morph targets at the time asked for; empty: all 0
  bool animated = false;        ///< the node or one above it is animated at the time asked for
  std::string defect_path;      ///< JSON path of the topmost node here that has a singular transform; empty: none
};

/// What stands in the place of a primitive's material; nothing: that one itself.
/// @param name  the material's
std::optional<MaterialChoice> material_choice(const PlacedNode& node, const std::string& name);

/// Visits every node of the root file's default scene and of what it refers to, parents before children, in file order.
/// @param time_seconds  animation time; empty: rest pose
/// @error SceneError: a cycle of references, a reference that leads nowhere, bad overrides, an absurd number of nodes
void composition_traverse(DocumentSet& documents,
                          const GltfDocument& root,
                          std::optional<double> time_seconds,
                          Warnings& warnings,
                          const std::function<void(const PlacedNode&)>& visit);

}  // namespace relief
