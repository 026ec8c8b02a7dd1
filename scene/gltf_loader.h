// From composed glTF documents to a Scene: placed nodes become instances, lights and cameras; meshes and materials are
// converted when the first node needs them, and once only.
#pragma once

#include <array>
#include <compare>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "scene/composition.h"
#include "scene/default_light.h"
#include "scene/gltf_camera.h"
#include "scene/gltf_mesh.h"
#include "scene/gltf_motion.h"
#include "scene/height_graph.h"
#include "scene/light_units.h"
#include "scene/load.h"
#include "scene/memory.h"
#include "scene/texture_table.h"

namespace relief {

class GltfLoader {
 public:
  /// @param faults  outlives the requests for textures, too
  GltfLoader(Warnings& warnings, TextureFaults& faults) : warnings_(warnings), textures_(&faults), height_maps_(&faults)
  {
  }

  /// @return everything but the texture store, features and warnings; without the height maps, unless the camera had to know
  ///         them: the displacements' texture indices are those of take_height_maps then
  /// @error SceneError
  Scene load(const std::filesystem::path& path, const LoadOptions& options);

  /// For default_light_add: meshes of a file that does not say what lights it. It says so by a light, be it one that an
  /// animation has shrunk to nothing, or by an environment, be it a black one; emission is not looked at.
  /// @return all meshes where they stand when no animation moves them; empty for a file that says it
  std::vector<Placement> take_unlit() { return std::exchange(unlit_, {}); }

  /// Textures that the scene refers to, in index order.
  std::vector<TextureRequest> take_textures() { return textures_.take(); }

  /// Graph that a map of the surroundings is to be made of.

  /// Height maps that displacements refer to, in index order; empty once they are loaded.
  std::vector<TextureRequest> take_height_maps() { return height_maps_.take(); }

  /// Maps of height graphs; the displacements with one index these. Empty once the others are loaded.
  std::vector<HeightMap> take_height_graphs() { return height_graphs_.take(); }

 private:
  /// A primitive: a mesh of the scene, which equal primitives share, and its own material.
  struct Primitive {
    int mesh_index = 0, material_index = 0;
  };
  /// What a primitive's mesh is made of.
  struct MeshSource {
    const GltfDocument* document = nullptr;
    std::map<std::string, int> attributes;  ///< accessors
    int indices = -1, mode = 0;
    std::string curves;  ///< their shape, if these are some
    int tangent_uv_set = -1;
    std::vector<std::map<std::string, int>> targets;  ///< accessors
    MorphWeights morph;
    std::vector<std::uint16_t> columns;  ///< that its material's graph reads
    auto operator<=>(const MeshSource&) const = default;
  };

  /// All meshes where they stand; those without a usable transform are left out.
  /// @param time_seconds  of the animations; empty: rest pose
  std::vector<Placement> placements(std::optional<double> time_seconds);
  void set_camera(const LoadOptions& options);
  std::vector<std::optional<double>> framed_times(const LoadOptions& options);
  void set_environment(const LoadOptions& options);
  void place(const PlacedNode& node);
  /// Number of the group of what a node emits; 0: none.
  std::uint32_t light_group_of(const PlacedNode& node);
  bool is_usable(const PlacedNode& node, const Transform& world, const std::string& path);
  static void check_positions(const PlacedNode& node, const std::string& path, Vec3f extent);
  void place_meshes(const PlacedNode& node);
  void place_instance(const PlacedNode& node,
                      const Primitive& primitive,
                      const Transform& copy,
                      const std::string& path);
  std::vector<std::uint16_t> attributes_of(const Material& material) const;
  /// Values by name, as graphs read them, of an instance.
  using InstanceValues = std::map<std::uint16_t, std::array<float, 4>>;
  InstanceValues node_values(const PlacedNode& node) const;
  void set_values(std::size_t instance_index, const InstanceValues& values);
  /// Opens the shutter of the camera that will be used.
  /// @return  the frame that things stand at which do not move: when the shutter is half done
  double open_shutter(const LoadOptions& options);
  /// Motion of the node that is being placed, or of a copy in it.
  /// @return  index into Scene::motions; −1: it stands still
  int motion_of(const PlacedNode& node, const std::string& path, const Transform& copy = {});
  int add_motion(std::vector<Affine3> steps, const GltfDocument& document);
  void move_light(const PlacedNode& node, const std::string& path, Light& light);
  void place_camera(const PlacedNode& node);
  void place_lamp(const PlacedNode& node, Light& light);
  void place_lights(const PlacedNode& node);
  void describe();
  void warn_missing_attributes(const std::string& label, const Mesh& mesh, const Material& material);
  void check_displacement(const PlacedNode& node, const Instance& instance);

  /// @param morph  null: any that the mesh has been placed with
  const std::vector<Primitive>& primitives_of(const GltfDocument& document, int mesh_index, const MorphWeights* morph);
  int mesh_of(const GltfDocument& document,
              int mesh_index,
              const MorphWeights& morph,
              int primitive_index,
              int material_index);
  int material_of(const GltfDocument& document, int material_index);
  /// Value graph and closures of a material.
  /// @param json, path  the material's object
  void read_programs(const GltfDocument& document,
                     const nlohmann::json& json,
                     const std::string& path,
                     Material& material);
  void add_absorption(const std::string& place, Vec3f sigma_a, Material& material);
  /// Of a primitive where it stands, after what references say about it.
  /// @param own  index of its own material
  int placed_material(const PlacedNode& node, int own);
  int material_of_curves(int own);

  Warnings& warnings_;
  Scene scene_;
  const GltfDocument* root_ = nullptr;
  bool says_light_ = false;
  std::vector<Placement> unlit_;
  TextureTable textures_, height_maps_;
  HeightGraphTable height_graphs_{textures_, scene_};
  Bounds world_bounds_;
  float image_aspect_ = 1;
  ShutterNodes shutter_nodes_;
  std::size_t num_visited_ = 0;  ///< nodes, with the one that is being placed
  int num_objects_ = 0;          ///< see Instance::object_index
  std::vector<Bounds> mesh_bounds_;
  std::set<std::pair<int, int>> displaced_;  ///< meshes and displacements that check_displacement has seen
  std::map<std::pair<const GltfDocument*, int>, std::map<MorphWeights, std::vector<Primitive>>> primitives_of_;
  std::map<MeshSource, int> mesh_of_;  ///< −1: a primitive without a triangle
  std::map<std::pair<const GltfDocument*, int>, int> material_of_;
  std::map<int, int> material_of_curves_;  ///< by the material of the file
  std::map<const GltfDocument*, LightUnits> light_units_of_;
  std::map<std::pair<const GltfDocument*, std::string>, int> lamp_graph_of_;  ///< by the path of the graph
  DocumentSet documents_;
  MemoryWatch memory_;
};

}  // namespace relief
