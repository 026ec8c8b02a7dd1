// A square whose material has a value graph, and the values of compiled graphs at single points.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>

#include "kernel/graph/graph_eval.h"
#include "scene/graph/graph_program.h"
#include "scene/load.h"
#include "tests/support/gltf_builder.h"

namespace relief::test {

/// A luminaire beside the scene.
inline constexpr const char* kSmallProfile = "TILT=NONE\n1 1 1 3 2 1 2 0 0 0 1 1 1\n0 90 180\n0 90\n3 2 1\n6 5 4\n";

/// A scene with one grey pixel as its only texture.
/// @param graph  RELIEF_graph of its only material
inline GltfBuilder graph_scene(const nlohmann::json& graph)
{
  GltfBuilder b = square_scene();
  b.json["images"] = {{{"uri", kGreyPixelPng}}};
  b.json["textures"] = {{{"source", 0}}};
  b.json["materials"] = {{{"extensions", {{"RELIEF_graph", graph}}}}};
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  return b;
}

inline Scene graph_load(const nlohmann::json& graph)
{
  const TemporaryFolder folder;
  folder.write("profile.ies", kSmallProfile);
  return scene_load(folder.write("scene.gltf", graph_scene(graph).gltf()));
}

/// @param quantity  what is known of the point
inline GraphValues graph_at(const GraphProgram& program, const std::function<float(GraphQuantity)>& quantity)
{
  GraphRegisters registers;
  for (const GraphInput& input : program.inputs) {
    registers.lanes[input.register_index] = splat8(quantity(input.quantity));
  }
  const GraphProgramView view = program.view();
  graph_run(view, nullptr, registers);
  return graph_values({&view, &registers, 0});
}

}  // namespace relief::test
