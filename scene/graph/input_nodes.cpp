// Nodes that read something of the point that is shaded.
#include "scene/graph/graph_nodes.h"

#include "scene/graph/graph_vectors.h"

namespace relief {
namespace {

using Op = GraphOp;
using Q = GraphQuantity;
constexpr auto kNumber = GraphType::kNumber;
constexpr auto kVector = GraphType::kVector;
constexpr auto kColor = GraphType::kColor;

void lower_texture_coordinate(GraphNode& n)
{
  GraphBuilder& b = n.build;
  n.set("generated", quantities(b, Q::generated_x, Q::generated_y, Q::generated_z), kVector);
  n.set("object", quantities(b, Q::object_x, Q::object_y, Q::object_z), kVector);
  n.set("uv", {b.quantity(Q::uv0_u), b.quantity(Q::uv0_v), b.constant(0)}, kVector);
  n.set("uv1", {b.quantity(Q::uv1_u), b.quantity(Q::uv1_v), b.constant(0)}, kVector);
}

void lower_geometry(GraphNode& n)
{
  GraphBuilder& b = n.build;
  n.set("position", quantities(b, Q::position_x, Q::position_y, Q::position_z), kVector);
  n.set("normal", quantities(b, Q::normal_x, Q::normal_y, Q::normal_z), kVector);
  n.set("trueNormal", quantities(b, Q::true_normal_x, Q::true_normal_y, Q::true_normal_z), kVector);
  n.set("incoming", quantities(b, Q::incoming_x, Q::incoming_y, Q::incoming_z), kVector);
  n.set("backfacing", b.quantity(Q::backfacing));
}

void lower_vertex_color(GraphNode& n)
{
  GraphBuilder& b = n.build;
  n.set("color", quantities(b, Q::color_r, Q::color_g, Q::color_b), kColor);
  n.set("alpha", b.quantity(Q::color_a));
}

/// Cosine between the viewer and the shading normal.
GraphScalar facing_cosine(GraphBuilder& b)
{
  return dot(b, quantities(b, Q::incoming_x, Q::incoming_y, Q::incoming_z),
             quantities(b, Q::normal_x, Q::normal_y, Q::normal_z));
}

/// Index of refraction as the ray meets it.
GraphScalar facing_ior(GraphBuilder& b, GraphScalar ior)
{
  const GraphScalar inside = b(Op::divide, {b.constant(1), ior});
  return b(Op::select, {b.quantity(Q::backfacing), inside, ior});
}

constexpr GraphSocket kFresnelInputs[] = {{"ior", kNumber, {1.45f}}};
void lower_fresnel(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphScalar ior = b(Op::maximum, {n.number("ior"), b.constant(1e-5f)});
  n.set("factor", b(Op::fresnel, {facing_cosine(b), facing_ior(b, ior)}));
}

constexpr GraphSocket kLayerWeightInputs[] = {{"blend", kNumber, {0.5f}}};
void lower_layer_weight(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphScalar blend = n.number("blend");
  const GraphScalar cosine = facing_cosine(b);
  const GraphScalar one = b.constant(1);
  const GraphScalar ior = b(Op::divide, {one, b(Op::maximum, {b(Op::subtract, {one, blend}), b.constant(1e-5f)})});
  n.set("fresnel", b(Op::fresnel, {cosine, facing_ior(b, ior)}));
  // Bent by an exponent: 1 for ½, towards 0 below and towards infinity above.
  const GraphScalar limited = clamped(b, blend, 0.0f, 1.0f - 1e-5f);
  const GraphScalar low = scaled(b, limited, 2);
  const GraphScalar high = b(Op::divide, {b.constant(0.5f), b(Op::subtract, {one, limited})});
  const GraphScalar exponent = b(Op::select, {b(Op::less_than, {limited, b.constant(0.5f)}), low, high});
  n.set("facing", b(Op::subtract, {one, b(Op::power, {b(Op::absolute, {cosine}), exponent})}));
}

constexpr GraphSocket kBumpInputs[] = {
    {"strength", kNumber, {1}}, {"distance", kNumber, {1}}, {"height", kNumber, {1}}, {"normal", kVector}};
/// A normal turned by the slopes of a height, which is asked for at the point and a footprint away from it on two sides.
/// @source Mikkelsen 2010, "Bump Mapping Unparametrized Surfaces on the GPU": the surface gradient
void lower_bump(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphScalar height = n.number("height");
  const auto rise = [&](GraphShift shift) { return b(Op::subtract, {b.shifted(height, shift), height}); };
  GraphVector N = n.vector("normal");
  if (!n.is_given("normal")) N = quantities(b, Q::normal_x, Q::normal_y, Q::normal_z);
  const GraphVector dPdx = quantities(b, Q::dpdx_x, Q::dpdx_y, Q::dpdx_z);
  const GraphVector dPdy = quantities(b, Q::dpdy_x, Q::dpdy_y, Q::dpdy_z);
  const GraphVector Rx = cross(b, dPdy, N), Ry = cross(b, N, dPdx);
  const GraphScalar determinant = dot(b, dPdx, Rx);
  GraphScalar distance = n.number("distance");
  if (n.reader.boolean("invert", false)) distance = scaled(b, distance, -1);
  const GraphScalar slope = b(Op::multiply, {distance, b(Op::sign, {determinant})});
  const GraphScalar along_x = b(Op::multiply, {slope, rise(GraphShift::kAlongX)});
  const GraphScalar along_y = b(Op::multiply, {slope, rise(GraphShift::kAlongY)});
  const GraphScalar size = b(Op::absolute, {determinant});
  GraphVector bent;
  for (std::size_t c = 0; c < 3; ++c) {
    const GraphScalar gradient = b(Op::add, {b(Op::multiply, {along_x, Rx[c]}), b(Op::multiply, {along_y, Ry[c]})});
    bent[c] = b(Op::subtract, {b(Op::multiply, {size, N[c]}), gradient});
  }
  const GraphScalar strength = b(Op::maximum, {n.number("strength"), b.constant(0)});
  n.set("normal", normalized(b, mixed(b, strength, N, normalized(b, bent))), kVector);
}

constexpr GraphNodeKind kKinds[] = {
    {"texture-coordinate", {}, lower_texture_coordinate},
    {"geometry", {}, lower_geometry},
    {"vertex-color", {}, lower_vertex_color},
    {"fresnel", kFresnelInputs, lower_fresnel},
    {"layer-weight", kLayerWeightInputs, lower_layer_weight},
    {"bump", kBumpInputs, lower_bump},
};

}  // namespace

std::span<const GraphNodeKind> graph_input_nodes() { return kKinds; }

}  // namespace relief
