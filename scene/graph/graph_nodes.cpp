#include "scene/graph/graph_nodes.h"

#include "scene/graph/graph_vectors.h"

namespace relief {

GraphValue graph_convert(GraphBuilder& build, const GraphValue& value, GraphType type)
{
  if (type != GraphType::kNumber || value.type == GraphType::kNumber) return {type, value.v};
  GraphScalar number;
  if (value.type == GraphType::kColor) {
    // Luminance of linear Rec.709, ITU-R BT.709-6.
    number = sum3(build, scaled(build, value.v[0], 0.2126729f), scaled(build, value.v[1], 0.7151522f),
                  scaled(build, value.v[2], 0.0721750f));
  } else {
    number = scaled(build, sum3(build, value.v[0], value.v[1], value.v[2]), 1.0f / 3.0f);
  }
  return {type, splat(number)};
}

const GraphNodeKind* graph_node_kind(std::string_view name)
{
  for (const auto kinds :
       {graph_input_nodes(), graph_texture_nodes(), graph_color_nodes(), graph_math_nodes(), graph_sky_nodes()}) {
    for (const GraphNodeKind& kind : kinds) {
      if (kind.name == name) return &kind;
    }
  }
  return nullptr;
}

}  // namespace relief
