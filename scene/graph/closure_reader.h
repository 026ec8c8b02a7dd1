// Reads RELIEF_surface of a material: the closures that it is a weighted list of, with inputs from its value graph.
#pragma once

#include <functional>

#include "scene/graph/graph_nodes.h"

namespace relief {

/// An input that may be a number, three numbers or a reference to a node; index −1: it is not given.
using GraphInputReader = std::function<GraphValue(const JsonReader& parent, std::string_view name, GraphType type)>;

/// Reads the closures; their inputs become results of the graph.
/// @param reader  the extension's object
/// @error SceneError: unknown types and options; inputs of another type; more lobes than a surface may have
std::vector<SurfaceClosureSpec> closures_read(const JsonReader& reader,
                                              const GraphInputReader& input,
                                              GraphBuilder& build,
                                              Warnings& warnings);

/// What is known of closures before any point is met, as decisions about caustics ask for it.
struct ClosureSummary {
  float transmission = 0;  ///< 1: something refracts
  float metallic = 0;      ///< 1: something reflects as metal does
  float roughness = 1;     ///< perceptual, the least of these; 0 where it varies
  bool scatters_below = false;  ///< paths may go below the surface
};
ClosureSummary closures_summarize(const GraphProgram& program);

}  // namespace relief
