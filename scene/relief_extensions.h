// relief's own extensions, as docs/scene_format.md defines them: one function each, in the order of that page.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "scene/height_graph.h"
#include "scene/khronos_extensions.h"
#include "scene/scene.h"

namespace relief {

/// RELIEF_render of a document; defaults where it is absent.
RenderSettings relief_render(const GltfDocument& document, Warnings& warnings);

/// RELIEF_camera: lens, window and shutter of a camera; `camera` has its glTF part already.
void relief_camera(const GltfDocument& document,
                   int camera_index,
                   Camera& camera,
                   Shutter& shutter,
                   Warnings& warnings);

/// Number of a group of lights by its name; 0: none.
/// @param names       those that there are; gets a new one
/// @param file, path  of the object that names it in its property lightGroup
/// @error SceneError: there are more than kMostLightGroups
std::uint32_t light_group_number(std::vector<std::string>& names,
                                 const std::string& name,
                                 const std::string& file,
                                 const std::string& path);

/// RELIEF_environment; empty if the document has none.
/// @param light_groups  as for light_group_number
std::optional<Environment> relief_environment(const GltfDocument& document,
                                              TextureTable& textures,
                                              std::vector<std::string>& light_groups,
                                              Warnings& warnings);

/// Reads RELIEF_light of a punctual light into it.
/// @param value  the light's object, at `path`
/// @param read_graph  what it returns becomes the light's lamp_index, for the caller to put a Lamp in place of
void relief_light(const GltfDocument& document,
                  const nlohmann::json& value,
                  const std::string& path,
                  const LampGraphReader& read_graph,
                  Light& light,
                  Warnings& warnings);

/// RELIEF_area_light of a node, placed by its transform.
/// @param read_graph  as for relief_light
/// @return 0 or 1 lights
std::vector<Light> relief_area_light(const GltfDocument& document,
                                     int node_index,
                                     const Transform& world,
                                     const LampGraphReader& read_graph,
                                     Warnings& warnings);

enum class CausticCaster : std::uint8_t { kAuto, kYes, kNo };

/// RELIEF_object as inherited along the node tree.
struct ObjectSettings {
  bool visible_to_camera = true;
  bool casts_shadow = true;
  CausticCaster caustic_caster = CausticCaster::kAuto;
  bool caustic_receiver = true;
  bool caustic_light = true;
  bool multiple_importance = true;  ///< of lights: see Light::multiple_importance
  bool holdout = false;
  bool shadow_catcher = false;
  std::string light_group;        ///< empty: none
  bool lights_footage = true;     ///< of lights: see Light::in_footage
  std::uint32_t hidden_from = 0;  ///< as Light::hidden_from
  std::string asset;              ///< empty: none is named
  /// Values by name that graphs read as attributes: three components and alpha. Null: none.
  std::shared_ptr<const std::map<std::string, std::array<float, 4>>> values;
};

/// @param inherited  the parent's settings
ObjectSettings relief_object(const GltfDocument& document,
                             int node_index,
                             ObjectSettings inherited,
                             Warnings& warnings);

/// RELIEF_displacement of a material, or the unofficial KHR_materials_displacement.
/// @param height_maps    gets the height map: the settings' texture index is a request's in this table
/// @param height_graphs  gets a heightGraph: if it has a map then the index is into this table
/// @return               empty: none
std::optional<DisplacementSettings> relief_displacement(const GltfDocument& document,
                                                        int material_index,
                                                        TextureTable& height_maps,
                                                        HeightGraphTable& height_graphs,
                                                        Warnings& warnings);

}  // namespace relief
