// From composed glTF documents to a Scene: placed nodes become instances, lights and cameras; meshes and materials are
// converted when the first node needs them, and once only.
#pragma once

#include <map>
#include <set>
#include <utility>
#include <vector>

#include "scene/composition.h"
#include "scene/gltf_camera.h"
#include "scene/load.h"
#include "scene/texture_table.h"

namespace relief {

class GltfLoader {
 public:
  explicit GltfLoader(Warnings& warnings) : warnings_(warnings) {}

  /// @return everything but the texture store, height maps, features and warnings; the displacements' texture indices
  ///         are those of take_height_maps
  /// @error SceneError
  Scene load(const std::filesystem::path& path, const LoadOptions& options);

  /// Textures that the scene refers to, in index order.
  std::vector<TextureRequest> take_textures() { return textures_.take(); }

  /// Height maps that displacements refer to, in index order.
  std::vector<TextureRequest> take_height_maps() { return height_maps_.take(); }

 private:
  void place(const PlacedNode& node);
  bool is_usable(const PlacedNode& node, const Transform& world, const std::string& path);
  void place_meshes(const PlacedNode& node);
  void place_instance(const PlacedNode& node, int mesh_index, const Transform& world, const std::string& path);
  void place_camera(const PlacedNode& node);
  void place_lights(const PlacedNode& node);
  void add_defaults();
  void warn_missing_attributes(const std::string& label, const Mesh& mesh, const Material& material);
  void check_displacement(const PlacedNode& node, const Instance& instance);

  const std::vector<int>& meshes_of(const GltfDocument& document, int mesh_index);
  int material_of(const GltfDocument& document, int material_index);

  Warnings& warnings_;
  Scene scene_;
  TextureTable textures_, height_maps_;
  Bounds world_bounds_;
  float image_aspect_ = 1;
  std::vector<Bounds> mesh_bounds_;
  std::set<std::pair<int, int>> displaced_;  ///< meshes and displacements that check_displacement has seen
  std::map<std::pair<const GltfDocument*, int>, std::vector<int>> meshes_of_;
  std::map<std::pair<const GltfDocument*, int>, int> material_of_;
  DocumentSet documents_;
};

}  // namespace relief
