// The kinds of nodes that value graphs are made of: what they are called, what goes in and out, and which operations they
// become. docs/graphs.md is the user's list.
#pragma once

#include <functional>
#include <map>
#include <set>
#include <span>
#include <string_view>

#include "scene/graph/graph_builder.h"
#include "scene/graph/ies_file.h"
#include "scene/json_reader.h"
#include "scene/voxels.h"

namespace relief {

enum class GraphType : std::uint8_t { kNumber, kVector, kColor };

/// A value on its way between nodes; numbers stand in all three components.
struct GraphValue {
  GraphType type = GraphType::kNumber;
  GraphVector v;
};

/// A value as another type: colours become numbers by their luminance, vectors by their mean.
GraphValue graph_convert(GraphBuilder& build, const GraphValue& value, GraphType type);

struct GraphSocket {
  std::string_view name;
  GraphType type;
  float value[3] = {0, 0, 0};  ///< of an input that is not given
  bool is_normal = false;      ///< that value is the shading normal instead
};

/// One node while it is turned into operations.
struct GraphNode {
  GraphBuilder& build;
  const JsonReader& reader;                              ///< its object, for options
  const std::map<std::string_view, GraphValue>& inputs;  ///< all of its kind's, converted
  std::map<std::string_view, GraphValue>& outputs;
  const std::set<std::string_view>& given;  ///< inputs that the file gives
  /// Texture that an option names, as an index into the scene's.
  const std::function<int(const JsonReader&)>& texture;
  /// The luminaire that an option names.
  const std::function<const IesProfile&(const JsonReader&)>& ies;
  /// The grid that options name; null: it is missing.
  const std::function<std::shared_ptr<const Voxels>(const JsonReader&)>& voxels;
  /// Place of an attribute's name, for quantities.
  const std::function<std::uint16_t(const JsonReader&, const std::string&)>& attribute;
  std::vector<GraphSun>& suns;  ///< gets those of directions that are looked into as they are

  GraphScalar number(std::string_view name) const { return inputs.at(name).v[0]; }
  const GraphVector& vector(std::string_view name) const { return inputs.at(name).v; }
  bool is_given(std::string_view name) const { return given.contains(name); }
  void set(std::string_view name, GraphScalar a) { outputs[name] = {GraphType::kNumber, {a, a, a}}; }
  void set(std::string_view name, const GraphVector& v, GraphType type) { outputs[name] = {type, v}; }
};

struct GraphNodeKind {
  std::string_view name;
  std::span<const GraphSocket> inputs;
  void (*lower)(GraphNode&);  ///< sets every output
};

/// All kinds, by what they are about: input_nodes.cpp and so on.
std::span<const GraphNodeKind> graph_input_nodes();
std::span<const GraphNodeKind> graph_texture_nodes();
std::span<const GraphNodeKind> graph_color_nodes();
std::span<const GraphNodeKind> graph_math_nodes();
std::span<const GraphNodeKind> graph_sky_nodes();

/// @return null: there is none of that name
const GraphNodeKind* graph_node_kind(std::string_view name);

}  // namespace relief
