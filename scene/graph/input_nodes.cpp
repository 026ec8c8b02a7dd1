// Nodes that read something of the point that is shaded.
#include <string>
#include <string_view>
#include <vector>

#include "kernel/graph/graph_scene.h"
#include "scene/gltf_mesh.h"
#include "scene/graph/graph_nodes.h"
#include "scene/graph/graph_vectors.h"

namespace relief {
namespace {

using Op = GraphOp;
using Q = GraphQuantity;
constexpr auto kNumber = GraphType::kNumber;
constexpr auto kVector = GraphType::kVector;
constexpr auto kColor = GraphType::kColor;

GraphVector shading_normal(GraphBuilder& b) { return quantities(b, Q::normal_x, Q::normal_y, Q::normal_z); }
GraphVector incoming(GraphBuilder& b) { return quantities(b, Q::incoming_x, Q::incoming_y, Q::incoming_z); }
GraphVector position(GraphBuilder& b) { return quantities(b, Q::position_x, Q::position_y, Q::position_z); }
GraphVector generated(GraphBuilder& b) { return quantities(b, Q::generated_x, Q::generated_y, Q::generated_z); }

GraphScalar negative(GraphBuilder& b, GraphScalar a) { return b(Op::subtract, {b.constant(0), a}); }
GraphVector sum(GraphBuilder& b, const GraphVector& x, const GraphVector& y) { return each(b, Op::add, x, y); }
GraphVector difference(GraphBuilder& b, const GraphVector& x, const GraphVector& y)
{
  return each(b, Op::subtract, x, y);
}
GraphVector product(GraphBuilder& b, const GraphVector& x, GraphScalar a) { return each(b, Op::multiply, x, splat(a)); }
GraphVector selected(GraphBuilder& b, GraphScalar which, const GraphVector& x, const GraphVector& y)
{
  return {b(Op::select, {which, x[0], y[0]}), b(Op::select, {which, x[1], y[1]}), b(Op::select, {which, x[2], y[2]})};
}

/// A normal of object space in the world, unit.
GraphVector normal_to_world(GraphBuilder& b, const GraphVector& v)
{
  GraphVector out;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto element = [&](std::size_t r) {
      return b.quantity(Q::object_from_world, static_cast<std::uint16_t>(4 * r + c));
    };
    out[c] = dot(b, {element(0), element(1), element(2)}, v);
  }
  return normalized(b, out);
}

/// The part of a tangent of object space that lies in the surface, unit, world.
GraphVector tangent_to_world(GraphBuilder& b, const GraphVector& tangent)
{
  const GraphVector normal = shading_normal(b);
  return cross(b, normal, normalized(b, cross(b, normal_to_world(b, tangent), normal)));
}

/// Around an axis of the box of generated coordinates.
GraphVector radial_tangent(GraphBuilder& b, std::size_t axis)
{
  const GraphVector at = generated(b);
  const std::size_t first = axis == 0 ? 1 : 0, second = axis == 2 ? 1 : 2;
  const auto centred = [&](std::size_t c) { return b(Op::subtract, {at[c], b.constant(0.5f)}); };
  GraphVector tangent = splat(b.constant(0));
  tangent[first] = negative(b, centred(second));
  tangent[second] = centred(first);
  return tangent_to_world(b, tangent);
}

/// A named attribute: three components, and the fourth.
struct Attribute {
  GraphVector xyz;
  GraphScalar w;
};
Attribute attribute(GraphBuilder& b, std::uint16_t place)
{
  return {{b.quantity(Q::attribute_x, place), b.quantity(Q::attribute_y, place), b.quantity(Q::attribute_z, place)},
          b.quantity(Q::attribute_alpha, place)};
}

/// Numbers of an option that must be there.
std::vector<double> numbers(const GraphNode& n, std::string_view name, std::size_t count)
{
  if (!n.reader.has(name)) n.reader.fail(name, std::to_string(count) + " numbers");
  return n.reader.numbers(name, count, count, -1e30, 1e30);
}

/// Tangents of the uv set that an option names, and their handedness.
Attribute uv_tangent(GraphNode& n)
{
  const int set = static_cast<int>(n.reader.integer("uvSet", 0, 0, 1));
  return attribute(n.build, n.attribute(n.reader, tangent_attribute_name(set)));
}

void lower_texture_coordinate(GraphNode& n)
{
  GraphBuilder& b = n.build;
  n.set("normal", quantities(b, Q::object_normal_x, Q::object_normal_y, Q::object_normal_z), kVector);
  n.set("camera", transformed(b, Q::camera_from_world, position(b), true), kVector);
  n.set("window", {b.quantity(Q::window_x), b.quantity(Q::window_y), b.constant(0)}, kVector);
  const GraphVector normal = shading_normal(b);
  const GraphScalar twice = scaled(b, dot(b, normal, incoming(b)), 2);
  n.set("reflection", difference(b, product(b, normal, twice), incoming(b)), kVector);
  n.set("generated", generated(b), kVector);
  n.set("object", quantities(b, Q::object_x, Q::object_y, Q::object_z), kVector);
  n.set("uv", {b.quantity(Q::uv0_u), b.quantity(Q::uv0_v), b.constant(0)}, kVector);
  n.set("uv1", {b.quantity(Q::uv1_u), b.quantity(Q::uv1_v), b.constant(0)}, kVector);
}

void lower_geometry(GraphNode& n)
{
  GraphBuilder& b = n.build;
  n.set("position", position(b), kVector);
  n.set("normal", shading_normal(b), kVector);
  n.set("trueNormal", quantities(b, Q::true_normal_x, Q::true_normal_y, Q::true_normal_z), kVector);
  n.set("incoming", incoming(b), kVector);
  n.set("backfacing", b.quantity(Q::backfacing));
  n.set("tangent", radial_tangent(b, 2), kVector);
  n.set("tangentNormal", quantities(b, Q::tangent_normal_x, Q::tangent_normal_y, Q::tangent_normal_z), kVector);
  n.set("parametric", {b.quantity(Q::parametric_x), b.quantity(Q::parametric_y), b.constant(0)}, kVector);
}

void lower_object_info(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const auto element = [&](std::uint16_t i) { return b.quantity(Q::world_from_object, i); };
  n.set("location", {element(3), element(7), element(11)}, kVector);
}

void lower_attribute(GraphNode& n)
{
  const std::string name = n.reader.string("name", "");
  if (!name.starts_with('_')) n.reader.fail("name", "a name that begins with _", '"' + name + '"');
  const std::uint16_t place = n.attribute(n.reader, name);
  const auto [xyz, w] = attribute(n.build, place);
  n.set("value", n.build.quantity(Q::attribute_value, place));
  n.set("vector", xyz, kVector);
  n.set("color", xyz, kColor);
  n.set("alpha", w);
}

void lower_light_path(GraphNode& n)
{
  GraphBuilder& b = n.build;
  struct Kind {
    std::string_view name;
    GraphRayKind kind;
  };
  constexpr Kind kKinds[] = {
      {"camera", GraphRayKind::kCamera},
      {"shadow", GraphRayKind::kShadow},
      {"diffuse", GraphRayKind::kDiffuse},
      {"glossy", GraphRayKind::kGlossy},
      {"singular", GraphRayKind::kSingular},
      {"reflection", GraphRayKind::kReflection},
      {"transmission", GraphRayKind::kTransmission},
  };
  for (const auto& [name, kind] : kKinds) n.set(name, b.quantity(Q::ray_kind, static_cast<std::uint16_t>(kind)));
  struct Depth {
    std::string_view name;
    GraphRayDepth depth;
  };
  constexpr Depth kDepths[] = {
      {"depth", GraphRayDepth::kAll},
      {"diffuseDepth", GraphRayDepth::kDiffuse},
      {"glossyDepth", GraphRayDepth::kGlossy},
      {"transmissionDepth", GraphRayDepth::kTransmission},
      {"transparentDepth", GraphRayDepth::kTransparent},
  };
  for (const auto& [name, depth] : kDepths) n.set(name, b.quantity(Q::ray_depth, static_cast<std::uint16_t>(depth)));
  n.set("length", b.quantity(Q::ray_length));
}

void lower_camera_data(GraphNode& n)
{
  GraphBuilder& b = n.build;
  // As in Cycles, heights of a bump see the depth of the point itself.
  const GraphVector here = {b.quantity_here(Q::position_x), b.quantity_here(Q::position_y),
                            b.quantity_here(Q::position_z)};
  const GraphVector seen = transformed(b, Q::camera_from_world, here, true);
  n.set("vector", normalized(b, seen), kVector);
  n.set("depth", seen[2]);
  n.set("distance", b(Op::square_root, {dot(b, seen, seen)}));
}

void lower_tangent(GraphNode& n)
{
  static constexpr std::string_view kDirections[] = {"radial-x", "radial-y", "radial-z", "uv"};
  const int direction = n.reader.choice("direction", kDirections, 2);
  if (direction < 3) {
    n.set("tangent", radial_tangent(n.build, static_cast<std::size_t>(direction)), kVector);
    return;
  }
  n.set("tangent", tangent_to_world(n.build, uv_tangent(n).xyz), kVector);
}

/// Normals of the mesh before it is displaced; 0 of flat ones.
GraphVector base_normal(GraphNode& n) { return attribute(n.build, n.attribute(n.reader, kBaseNormalAttribute)).xyz; }

/// A tangent of the mesh moved into a displaced surface: along the normal that points were moved along, unit. As it is without one.
GraphVector displaced_tangent(GraphBuilder& b,
                              const GraphVector& tangent,
                              const GraphVector& base,
                              const GraphVector& normal)
{
  const GraphScalar along = dot(b, base, normal);
  const GraphScalar by = b(Op::divide, {dot(b, tangent, normal), along});
  const GraphVector moved = normalized(b, difference(b, tangent, product(b, base, by)));
  return selected(b, b(Op::less_than, {b.constant(0), along}), moved, tangent);
}

constexpr GraphSocket kNormalMapInputs[] = {{"strength", kNumber, {1}}, {"color", kColor, {0.5f, 0.5f, 1}}};
void lower_normal_map(GraphNode& n)
{
  static constexpr std::string_view kSpaces[] = {"tangent", "object", "world", "blender-object", "blender-world"};
  GraphBuilder& b = n.build;
  const int space = n.reader.choice("space", kSpaces, 0);
  const GraphVector own = shading_normal(b);
  GraphVector color = n.vector("color");
  for (GraphScalar& c : color) c = scaled(b, b(Op::subtract, {b.unfiltered(c), b.constant(0.5f)}), 2);
  GraphVector normal;
  GraphScalar is_given = b.constant(1);
  if (space == 0) {
    auto [tangent, handedness] = uv_tangent(n);
    GraphVector below = quantities(b, Q::smooth_normal_x, Q::smooth_normal_y, Q::smooth_normal_z);
    static constexpr std::string_view kBases[] = {"displaced", "original"};
    const bool is_original = n.reader.choice("base", kBases, 0) == 1;
    if (n.reader.boolean("displacedTangents", false) && !is_original) {
      tangent = displaced_tangent(b, tangent, base_normal(n), below);
    }
    if (is_original) {
      const GraphVector base = base_normal(n);
      below = selected(b, b(Op::less_than, {b.constant(0), dot(b, base, base)}), base, below);
    }
    if (n.reader.boolean("unitNormals", false)) below = normalized(b, below);
    const GraphVector bitangent = product(b, cross(b, below, tangent), handedness);
    normal =
        sum(b, sum(b, product(b, tangent, color[0]), product(b, bitangent, color[1])), product(b, below, color[2]));
    normal = normal_to_world(b, normal);
    is_given = b(Op::less_than, {b.constant(0), dot(b, tangent, tangent)});
  } else {
    if (space > 2) color = {color[0], negative(b, color[1]), negative(b, color[2])};
    normal = space % 2 == 1 ? normal_to_world(b, color) : normalized(b, color);
  }
  const GraphVector back = {negative(b, normal[0]), negative(b, normal[1]), negative(b, normal[2])};
  normal = selected(b, b.quantity(Q::backfacing), back, normal);
  const GraphScalar strength = b(Op::maximum, {n.number("strength"), b.constant(0)});
  if (float known = 0; !b.is_constant(strength, &known) || known != 1) {
    normal = normalized(b, sum(b, own, product(b, difference(b, normal, own), strength)));
  }
  is_given = b(Op::multiply, {is_given, b(Op::less_than, {b.constant(0), dot(b, normal, normal)})});
  n.set("normal", selected(b, is_given, normal, own), kVector);
}

constexpr GraphSocket kWireframeInputs[] = {{"size", kNumber, {0.01f}}};
void lower_wireframe(GraphNode& n)
{
  GraphBuilder& b = n.build;
  // Half of it: the face beyond the edge shows the other half.
  GraphScalar half = scaled(b, n.number("size"), 0.5f);
  if (n.reader.boolean("pixels", false)) {
    // A pixel is as wide as the footprint is across the view, in the mean of two axes.
    const auto width = [&](const GraphVector& along) {
      const GraphVector across = difference(b, along, product(b, incoming(b), dot(b, along, incoming(b))));
      return b(Op::square_root, {dot(b, across, across)});
    };
    const GraphScalar both = b(Op::add, {width(quantities(b, Q::dpdx_x, Q::dpdx_y, Q::dpdx_z)),
                                         width(quantities(b, Q::dpdy_x, Q::dpdy_y, Q::dpdy_z))});
    half = b(Op::multiply, {half, scaled(b, both, 0.5f)});
  }
  n.set("factor", b(Op::less_than, {b.quantity(Q::edge_distance), b(Op::absolute, {half})}));
}

constexpr GraphSocket kOcclusionInputs[] = {{"color", kColor, {1, 1, 1}},
                                            {"distance", kNumber, {1}},
                                            {"normal", kVector, {}, true}};
void lower_ambient_occlusion(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const auto rays = static_cast<std::uint16_t>(n.reader.integer("samples", 16, 1, 128));
  const bool is_inside = n.reader.boolean("inside", false);
  const bool is_local = n.reader.boolean("onlyLocal", false);
  GraphVector normal = n.vector("normal");
  if (is_inside) normal = {negative(b, normal[0]), negative(b, normal[1]), negative(b, normal[2])};
  std::vector<GraphScalar> in;
  for (const std::uint16_t side : {std::uint16_t{0}, std::uint16_t{1}}) {
    // As in Cycles, heights of a bump see what is open over the point itself.
    for (const Q q : {Q::ray_origin_x, Q::ray_origin_y, Q::ray_origin_z}) in.push_back(b.quantity_here(q, side));
  }
  const GraphVector true_normal = quantities(b, Q::true_normal_x, Q::true_normal_y, Q::true_normal_z);
  for (const GraphVector& v : {true_normal, normal, incoming(b)}) in.insert(in.end(), v.begin(), v.end());
  in.push_back(n.number("distance"));
  in.push_back(is_local ? b.quantity(Q::instance) : b.constant(-1));
  in.push_back(b.quantity(Q::shutter_time));
  const GraphScalar open = b.apply(Op::open_share, in, {&rays, 1}).front();
  n.set("factor", open);
  n.set("color", product(b, n.vector("color"), open), kColor);
}

constexpr GraphSocket kBevelInputs[] = {{"radius", kNumber, {0.05f}}, {"normal", kVector, {}, true}};
void lower_bevel(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const auto rays = static_cast<std::uint16_t>(n.reader.integer("samples", 4, 1, 128));
  // As in Cycles, what is seen blurred has its edges as they are.
  const GraphScalar is_blurred = b.quantity(Q::ray_kind, static_cast<std::uint16_t>(GraphRayKind::kBlurred));
  const GraphScalar radius = b(Op::select, {is_blurred, b.constant(0), n.number("radius")});
  std::vector<GraphScalar> in;
  for (const Q q : {Q::position_x, Q::position_y, Q::position_z}) in.push_back(b.quantity_here(q));
  const GraphVector true_normal = quantities(b, Q::true_normal_x, Q::true_normal_y, Q::true_normal_z);
  for (const GraphVector& v : {true_normal, incoming(b)}) in.insert(in.end(), v.begin(), v.end());
  in.insert(in.end(), {radius, b.quantity(Q::instance), b.quantity(Q::shutter_time)});
  const std::vector<GraphScalar> met = b.apply(Op::bevel, in, {&rays, 1});
  const GraphVector front = {met[0], met[1], met[2]}, own = shading_normal(b);
  const GraphVector back = {negative(b, front[0]), negative(b, front[1]), negative(b, front[2])};
  const GraphScalar is_round = b(Op::less_than, {b.constant(0), dot(b, front, front)});
  GraphVector normal = selected(b, is_round, selected(b, b.quantity(Q::backfacing), back, front), own);
  // A normal that is given is turned as the surface's own one is.
  if (n.is_given("normal")) normal = normalized(b, sum(b, n.vector("normal"), difference(b, normal, own)));
  n.set("normal", normal, kVector);
}

constexpr GraphSocket kLightFalloffInputs[] = {{"strength", kNumber, {100}}, {"smooth", kNumber}};
void lower_light_falloff(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphScalar length = b.quantity(Q::ray_length), smooth = n.number("smooth");
  const GraphScalar squared = b(Op::multiply, {length, length});
  const GraphScalar smoothed = b(Op::divide, {squared, b(Op::add, {smooth, squared})});
  const GraphScalar is_smooth = b(Op::less_than, {b.constant(0), smooth});
  const GraphScalar factor = b(Op::select, {is_smooth, smoothed, b.constant(1)});
  const GraphScalar quadratic = b(Op::multiply, {n.number("strength"), factor});
  n.set("quadratic", quadratic);
  n.set("linear", b(Op::multiply, {quadratic, length}));
  n.set("constant", b(Op::multiply, {quadratic, squared}));
}

constexpr GraphSocket kTransformInputs[] = {{"vector", kVector}};
void lower_transform(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const std::vector<double> matrix = numbers(n, "matrix", 12);
  GraphVector out;
  for (std::size_t row = 0; row < 3; ++row) {
    const auto element = [&](std::size_t c) { return b.constant(static_cast<float>(matrix[4 * row + c])); };
    out[row] = b(Op::add, {dot(b, {element(0), element(1), element(2)}, n.vector("vector")), element(3)});
  }
  n.set("vector", out, kVector);
}

void lower_vector_transform(GraphNode& n)
{
  static constexpr std::string_view kTypes[] = {"point", "vector", "normal"};
  static constexpr std::string_view kSpaces[] = {"world", "object", "camera"};
  constexpr Q kToWorld[] = {Q::kCount, Q::world_from_object, Q::world_from_camera};
  constexpr Q kFromWorld[] = {Q::kCount, Q::object_from_world, Q::camera_from_world};
  GraphBuilder& b = n.build;
  const int type = n.reader.choice("transform", kTypes, 1);
  const int from = n.reader.choice("from", kSpaces, 0), to = n.reader.choice("to", kSpaces, 1);
  GraphVector v = n.vector("vector");
  if (from != to && from != 0) v = transformed(b, kToWorld[from], v, type == 0);
  if (from != to && to != 0) v = transformed(b, kFromWorld[to], v, type == 0);
  n.set("vector", type == 2 ? normalized(b, v) : v, kVector);
}

constexpr GraphSocket kVectorDisplacementInputs[] = {{"vector", kVector},
                                                     {"midlevel", kNumber},
                                                     {"scale", kNumber, {1}}};
void lower_vector_displacement(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const auto space = static_cast<VectorSpace>(n.reader.choice("space", kVectorSpaceLabels, 0));
  const GraphVector moved =
      product(b, difference(b, n.vector("vector"), splat(n.number("midlevel"))), n.number("scale"));
  const auto [tangent, handedness] = space == VectorSpace::kTangent ? uv_tangent(n) : Attribute{};
  n.set("vector", vector_in_object(b, space, moved, tangent, handedness), kVector);
}

constexpr GraphSocket kVectorRotateInputs[] = {{"vector", kVector},
                                               {"center", kVector},
                                               {"axis", kVector, {0, 0, 1}},
                                               {"angle", kNumber},
                                               {"rotation", kVector}};
void lower_vector_rotate(GraphNode& n)
{
  static constexpr std::string_view kKinds[] = {"axis", "x", "y", "z", "euler"};
  GraphBuilder& b = n.build;
  const int kind = n.reader.choice("rotate", kKinds, 0);
  const bool is_inverse = n.reader.boolean("invert", false);
  const GraphVector v = difference(b, n.vector("vector"), n.vector("center"));
  if (kind == 4) {
    n.set("vector", sum(b, rotated(b, v, n.vector("rotation"), is_inverse), n.vector("center")), kVector);
    return;
  }
  GraphVector axis = n.vector("axis");
  if (kind > 0) {
    axis = splat(b.constant(0));
    axis[static_cast<std::size_t>(kind - 1)] = b.constant(1);
  }
  const GraphScalar size = dot(b, axis, axis);
  axis = normalized(b, axis);
  const GraphScalar angle = is_inverse ? negative(b, n.number("angle")) : n.number("angle");
  const GraphScalar c = b(Op::cosine, {angle}), s = b(Op::sine, {angle});
  // Rodrigues: what lies along the axis stays.
  const GraphScalar along = b(Op::multiply, {dot(b, axis, v), b(Op::subtract, {b.constant(1), c})});
  const GraphVector turned =
      sum(b, sum(b, product(b, v, c), product(b, cross(b, axis, v), s)), product(b, axis, along));
  const GraphScalar has_axis = b(Op::less_than, {b.constant(0), size});
  n.set("vector", selected(b, has_axis, sum(b, turned, n.vector("center")), n.vector("vector")), kVector);
}

constexpr GraphSocket kNormalInputs[] = {{"normal", kVector, {0, 0, 1}}};
void lower_normal(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const std::vector<double> given = numbers(n, "direction", 3);
  GraphVector direction;
  for (std::size_t c = 0; c < 3; ++c) direction[c] = b.constant(static_cast<float>(given[c]));
  direction = normalized(b, direction);
  n.set("normal", direction, kVector);
  n.set("dot", dot(b, direction, normalized(b, n.vector("normal"))));
}

void lower_vertex_color(GraphNode& n)
{
  GraphBuilder& b = n.build;
  n.set("color", quantities(b, Q::color_r, Q::color_g, Q::color_b), kColor);
  n.set("alpha", b.quantity(Q::color_a));
}

/// Cosine between the viewer and the normal.
GraphScalar facing_cosine(GraphNode& n) { return dot(n.build, incoming(n.build), n.vector("normal")); }

/// Index of refraction as the ray meets it.
GraphScalar facing_ior(GraphBuilder& b, GraphScalar ior)
{
  const GraphScalar inside = b(Op::divide, {b.constant(1), ior});
  return b(Op::select, {b.quantity(Q::backfacing), inside, ior});
}

constexpr GraphSocket kFresnelInputs[] = {{"ior", kNumber, {1.45f}}, {"normal", kVector, {}, true}};
void lower_fresnel(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphScalar ior = b(Op::maximum, {n.number("ior"), b.constant(1e-5f)});
  n.set("factor", b(Op::fresnel, {facing_cosine(n), facing_ior(b, ior)}));
}

constexpr GraphSocket kLayerWeightInputs[] = {{"blend", kNumber, {0.5f}}, {"normal", kVector, {}, true}};
void lower_layer_weight(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphScalar blend = n.number("blend");
  const GraphScalar cosine = facing_cosine(n);
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

/// A normal turned towards the true one, in the plane of both, until a mirror reflects the viewer's direction above the surface.
///
/// In that plane mirroring adds angles: the normal lies half way between the viewer's projection and the reflected direction's.
GraphVector reflecting_above(GraphBuilder& b, const GraphVector& normal)
{
  const GraphVector Ng = quantities(b, Q::true_normal_x, Q::true_normal_y, Q::true_normal_z), wo = incoming(b);
  const GraphScalar height_o = dot(b, Ng, wo), along = dot(b, normal, Ng), one = b.constant(1);
  // Rays may always leave as shallow as they come.
  const GraphScalar least = b(Op::minimum, {scaled(b, height_o, 0.9f), b.constant(0.01f)});
  const GraphScalar height = b(Op::subtract, {scaled(b, b(Op::multiply, {dot(b, normal, wo), along}), 2), height_o});
  const GraphVector X = normalized(b, difference(b, normal, product(b, Ng, along)));
  const GraphScalar x = dot(b, wo, X);
  const GraphScalar squared = b(Op::add, {b(Op::multiply, {x, x}), b(Op::multiply, {height_o, height_o})});
  const GraphScalar length = b(Op::square_root, {squared});
  const GraphScalar reflected_z = b(Op::divide, {least, length});
  const GraphScalar rest = b(Op::subtract, {one, b(Op::multiply, {reflected_z, reflected_z})});
  const GraphScalar reflected_x = b(Op::square_root, {rest});
  const GraphVector middle = sum(b, product(b, X, b(Op::add, {b(Op::divide, {x, length}), reflected_x})),
                                 product(b, Ng, b(Op::add, {b(Op::divide, {height_o, length}), reflected_z})));
  return selected(b, b(Op::less_than, {height, least}), normalized(b, middle), normal);
}

constexpr GraphSocket kBumpInputs[] = {{"strength", kNumber, {1}},
                                       {"distance", kNumber, {1}},
                                       {"height", kNumber, {1}},
                                       {"normal", kVector}};
/// A normal turned by the slopes of a height, which is asked for at the point and some footprints away from it on two sides.
/// @source Mikkelsen 2010, "Bump Mapping Unparametrized Surfaces on the GPU": the surface gradient
void lower_bump(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphScalar height = b.unfiltered(n.number("height"));
  const float width = n.reader.number_f("filterWidth", 1, 1e-3, 1e3);
  const auto rise = [&](GraphShift shift) { return b(Op::subtract, {b.shifted(height, shift, width), height}); };
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
  GraphScalar size = b(Op::absolute, {determinant});
  if (width != 1) size = scaled(b, size, width);
  GraphVector bent;
  for (std::size_t c = 0; c < 3; ++c) {
    const GraphScalar gradient = b(Op::add, {b(Op::multiply, {along_x, Rx[c]}), b(Op::multiply, {along_y, Ry[c]})});
    bent[c] = b(Op::subtract, {b(Op::multiply, {size, N[c]}), gradient});
  }
  const GraphScalar strength = b(Op::maximum, {n.number("strength"), b.constant(0)});
  const GraphVector normal = normalized(b, mixed(b, strength, N, normalized(b, bent)));
  n.set("normal", n.reader.boolean("reflectsAbove", false) ? reflecting_above(b, normal) : normal, kVector);
}

constexpr GraphNodeKind kKinds[] = {
    {"texture-coordinate", {}, lower_texture_coordinate},
    {"geometry", {}, lower_geometry},
    {"vertex-color", {}, lower_vertex_color},
    {"fresnel", kFresnelInputs, lower_fresnel},
    {"layer-weight", kLayerWeightInputs, lower_layer_weight},
    {"bump", kBumpInputs, lower_bump},
    {"object-info", {}, lower_object_info},
    {"attribute", {}, lower_attribute},
    {"light-path", {}, lower_light_path},
    {"camera-data", {}, lower_camera_data},
    {"tangent", {}, lower_tangent},
    {"normal-map", kNormalMapInputs, lower_normal_map},
    {"wireframe", kWireframeInputs, lower_wireframe},
    {"ambient-occlusion", kOcclusionInputs, lower_ambient_occlusion},
    {"bevel", kBevelInputs, lower_bevel},
    {"light-falloff", kLightFalloffInputs, lower_light_falloff},
    {"transform", kTransformInputs, lower_transform},
    {"vector-transform", kTransformInputs, lower_vector_transform},
    {"vector-displacement", kVectorDisplacementInputs, lower_vector_displacement},
    {"vector-rotate", kVectorRotateInputs, lower_vector_rotate},
    {"normal", kNormalInputs, lower_normal},
};

}  // namespace

std::span<const GraphNodeKind> graph_input_nodes() { return kKinds; }

}  // namespace relief
