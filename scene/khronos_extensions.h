// Materials, lights, texture transforms and instancing as glTF and its Khronos extensions define them.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "kernel/bsdf/material.h"
#include "kernel/light/light.h"
#include "scene/gltf_document.h"
#include "scene/light_units.h"
#include "scene/texture_table.h"
#include "scene/transform.h"

namespace relief {

/// Reads a textureInfo object with its KHR_texture_transform.
/// @param parent  has the property `name`, or not: then the reference is empty
/// @error SceneError: texCoord other than 0 or 1, bad index, bad image
TextureRef khronos_texture_ref(const GltfDocument& document,
                               const JsonReader& parent,
                               std::string_view name,
                               TextureColor color,
                               TextureTable& textures,
                               Warnings& warnings);

/// KHR_texture_transform as the 2×3 matrix translation · rotation · scale.
/// @param rotation  radians, counter-clockwise as seen on the image, whose v points down
void khronos_texture_transform(TextureRef& ref,
                               double offset_u,
                               double offset_v,
                               double rotation,
                               double scale_u,
                               double scale_v);

/// Same, from the extension's JSON; also its texCoord.
void khronos_texture_transform(TextureRef& ref, const JsonReader& extension, Warnings& warnings);

/// A material as glTF has it.
struct KhronosMaterial {
  Material material;
  Vec3f sigma_a;  ///< what KHR_materials_volume absorbs, where light gets into a mesh through glass, 1/m
};

/// Material `index` of a document: core and KHR_materials_*; RELIEF_displacement is read by relief_displacement.
KhronosMaterial khronos_material(const GltfDocument& document, int index, TextureTable& textures, Warnings& warnings);

/// Makes a program of the graph of a light; returns its place in Scene::graphs.
using LampGraphReader = std::function<int(const JsonReader& graph)>;

/// The light that a node carries through KHR_lights_punctual, placed by the node's transform.
/// @param read_graph  see relief_light
/// @return            0 or 1 lights
std::vector<Light> khronos_node_light(const GltfDocument& document,
                                      int node_index,
                                      const Transform& world,
                                      const LightUnits& units,
                                      const LampGraphReader& read_graph,
                                      Warnings& warnings);

/// EXT_mesh_gpu_instancing of a node: transforms relative to the node.
/// @return empty if the node has no such extension
std::vector<Transform> khronos_instances(const GltfDocument& document, int node_index, Warnings& warnings);

/// An attribute of a node's instances that graphs read: three components and alpha.
/// @param count  of its instances
/// @return       empty if they have none of that name
std::vector<std::array<float, 4>> khronos_instance_values(const GltfDocument& document,
                                                          int node_index,
                                                          const std::string& name,
                                                          std::size_t count);

}  // namespace relief
