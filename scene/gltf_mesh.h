// From a glTF primitive to a triangle mesh, or to curves: topology, attributes, repairs that are safe to make.
#pragma once

#include <compare>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "scene/gltf_document.h"
#include "scene/scene.h"

namespace relief {

/// Tangents of uv set i as an attribute that graphs read: no name of a file's begins so.
inline std::string tangent_attribute_name(int uv_set) { return "tangent:" + std::to_string(uv_set); }

/// Likewise: normals of a mesh as it is before it is displaced.
inline constexpr const char* kBaseNormalAttribute = "normal:";

/// Weights of a mesh's morph targets. Those that are missing are 0.
struct MorphWeights {
  std::vector<double> weights;
  std::vector<std::vector<double>> steps;  ///< while the shutter is open, see Mesh::steps; empty: they stay the same
  auto operator<=>(const MorphWeights&) const = default;
};

/// Reads one primitive.
/// @param tangent_uv_set  texture coordinates that a normal map needs tangents for; −1: none needed
/// @param columns         names of the attributes to keep for graphs, with their places; those that are missing are warned about
/// @return empty, with a warning, for points, for lines that are no curves (RELIEF_curves), and when no triangle has an area or no
///         curve a length and a width
/// @error  SceneError: missing positions, wrong accessor types, counts that differ, indices out of range or equal to the
///         restart value, NaN or infinity
/// @post   unit normals, indices in range, no triangle of zero area; only vertices between the lowest and the highest
///         index, so that primitives that share one large accessor do not copy all of it. `material_index` is not set
std::optional<Mesh> gltf_mesh_load(const GltfDocument& document,
                                   int mesh_index,
                                   int primitive_index,
                                   const MorphWeights& morph,
                                   int tangent_uv_set,
                                   const std::map<std::string, std::uint16_t>& columns,
                                   Warnings& warnings);

}  // namespace relief
