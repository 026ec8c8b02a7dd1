#include "scene/graph/graph_nodes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>

namespace relief {
namespace {

using Op = GraphOp;
using Q = GraphQuantity;
constexpr auto kNumber = GraphType::kNumber;
constexpr auto kVector = GraphType::kVector;
constexpr auto kColor = GraphType::kColor;

/// Applies an operation to each component.
GraphVector each(GraphBuilder& b, Op op, const GraphVector& x, const GraphVector& y)
{
  return {b(op, {x[0], y[0]}), b(op, {x[1], y[1]}), b(op, {x[2], y[2]})};
}

GraphVector splat(GraphScalar a) { return {a, a, a}; }

GraphScalar scaled(GraphBuilder& b, GraphScalar a, float by) { return b(Op::multiply, {a, b.constant(by)}); }

GraphScalar dot(GraphBuilder& b, const GraphVector& x, const GraphVector& y)
{
  const GraphVector p = each(b, Op::multiply, x, y);
  return b(Op::add, {b(Op::add, {p[0], p[1]}), p[2]});
}

GraphScalar clamped(GraphBuilder& b, GraphScalar a, float low = 0, float high = 1)
{
  return b(Op::minimum, {b(Op::maximum, {a, b.constant(low)}), b.constant(high)});
}

GraphVector clamped(GraphBuilder& b, const GraphVector& v)
{
  return {clamped(b, v[0]), clamped(b, v[1]), clamped(b, v[2])};
}

/// (1 − t) a + t b.
GraphScalar mixed(GraphBuilder& b, GraphScalar t, GraphScalar x, GraphScalar y)
{
  const GraphScalar rest = b(Op::subtract, {b.constant(1), t});
  return b(Op::add, {b(Op::multiply, {rest, x}), b(Op::multiply, {t, y})});
}

GraphVector mixed(GraphBuilder& b, GraphScalar t, const GraphVector& x, const GraphVector& y)
{
  return {mixed(b, t, x[0], y[0]), mixed(b, t, x[1], y[1]), mixed(b, t, x[2], y[2])};
}

/// A vector of unit length; one without length stays.
GraphVector normalized(GraphBuilder& b, const GraphVector& v)
{
  const GraphScalar length = b(Op::square_root, {dot(b, v, v)});
  return each(b, Op::divide, v, splat(length));
}

GraphVector cross(GraphBuilder& b, const GraphVector& x, const GraphVector& y)
{
  const auto minor = [&](int i, int j) {
    const auto n = [](int k) { return static_cast<std::size_t>(k); };
    return b(Op::subtract, {b(Op::multiply, {x[n(i)], y[n(j)]}), b(Op::multiply, {x[n(j)], y[n(i)]})});
  };
  return {minor(1, 2), minor(2, 0), minor(0, 1)};
}

GraphVector colors(GraphBuilder& b, Op op, const GraphVector& v)
{
  const std::vector<GraphScalar> out = b.apply(op, v);
  return {out[0], out[1], out[2]};
}

GraphVector quantities(GraphBuilder& b, Q x, Q y, Q z) { return {b.quantity(x), b.quantity(y), b.quantity(z)}; }

/// v turned by Euler's angles, about x first, then y, then z.
GraphVector rotated(GraphBuilder& b, const GraphVector& v, const GraphVector& angles, bool back)
{
  const auto turn = [&](GraphVector w, std::size_t axis) {
    const std::size_t i = (axis + 1) % 3, j = (axis + 2) % 3;
    const GraphScalar c = b(Op::cosine, {angles[axis]}), s = b(Op::sine, {angles[axis]});
    const GraphScalar ci = b(Op::multiply, {c, w[i]}), sj = b(Op::multiply, {s, w[j]});
    const GraphScalar cj = b(Op::multiply, {c, w[j]}), si = b(Op::multiply, {s, w[i]});
    w[i] = b(back ? Op::add : Op::subtract, {ci, sj});
    w[j] = b(back ? Op::subtract : Op::add, {cj, si});
    return w;
  };
  return back ? turn(turn(turn(v, 2), 1), 0) : turn(turn(turn(v, 0), 1), 2);
}

// ---- inputs

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

// ---- textures

constexpr GraphSocket kNoiseInputs[] = {{"vector", kVector},
                                        {"w", kNumber},
                                        {"scale", kNumber, {5}},
                                        {"detail", kNumber, {2}},
                                        {"roughness", kNumber, {0.5f}},
                                        {"lacunarity", kNumber, {2}},
                                        {"distortion", kNumber}};

/// Point that a texture of some dimensions looks at: 1: w; 2: x, y; 3: all; 4: all and w.
std::vector<GraphScalar> texture_point(GraphNode& n, int dimensions)
{
  const GraphVector& v = n.vector("vector");
  if (dimensions == 1) return {n.number("w")};
  std::vector<GraphScalar> p(v.begin(), v.begin() + std::min(dimensions, 3));
  if (dimensions == 4) p.push_back(n.number("w"));
  return p;
}

/// A point far from another: what decorrelates noises of one point, by hashes of a number and of the axis.
std::vector<GraphScalar> moved(GraphBuilder& b, const std::vector<GraphScalar>& p, float number)
{
  std::vector<GraphScalar> out;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const GraphScalar hash = p.size() == 1 ? b(Op::hash_1d, {b.constant(number)})
                                           : b(Op::hash_2d, {b.constant(number), b.constant(static_cast<float>(i))});
    const GraphScalar offset = b(Op::add, {b.constant(100), scaled(b, hash, 100)});
    out.push_back(b(Op::add, {p[i], offset}));
  }
  return out;
}

Op op_of_dimensions(Op first, int dimensions) { return static_cast<Op>(static_cast<int>(first) + dimensions - 1); }

void lower_noise(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const int dimensions = static_cast<int>(n.reader.integer("dimensions", 3, 1, 4));
  const bool is_normalized = n.reader.boolean("normalize", true);
  std::vector<GraphScalar> p = texture_point(n, dimensions);
  for (GraphScalar& x : p) x = b(Op::multiply, {x, n.number("scale")});
  float known = 1;
  float number = 0;
  if (!b.is_constant(n.number("distortion"), &known) || known != 0) {
    std::vector<GraphScalar> bent;
    for (int i = 0; i < dimensions; ++i) {
      const GraphScalar noise =
          b.apply(op_of_dimensions(Op::signed_noise_1d, dimensions), moved(b, p, static_cast<float>(i)))[0];
      bent.push_back(b(Op::add, {p[static_cast<std::size_t>(i)], b(Op::multiply, {noise, n.number("distortion")})}));
    }
    p = bent;
  }
  number = static_cast<float>(dimensions);
  const auto fractal = [&](std::vector<GraphScalar> at) {
    at.insert(at.end(), {n.number("detail"), n.number("roughness"), n.number("lacunarity")});
    const std::uint16_t normalize = is_normalized ? 1 : 0;
    return b.apply(op_of_dimensions(Op::noise_1d, dimensions), at, {&normalize, 1})[0];
  };
  const GraphScalar value = fractal(p);
  n.set("factor", value);
  n.set("color", {value, fractal(moved(b, p, number)), fractal(moved(b, p, number + 1))}, kColor);
}

constexpr GraphSocket kWhiteNoiseInputs[] = {{"vector", kVector}, {"w", kNumber}};
void lower_white_noise(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const int dimensions = static_cast<int>(n.reader.integer("dimensions", 3, 1, 4));
  const std::vector<GraphScalar> p = texture_point(n, dimensions);
  const auto hash = [&](const std::vector<GraphScalar>& key) {
    return b.apply(op_of_dimensions(Op::hash_1d, static_cast<int>(key.size())), key)[0];
  };
  const GraphScalar value = hash(p);
  n.set("value", value);
  GraphVector color = splat(value);
  if (dimensions == 4) {
    color[1] = hash({p[2], p[0], p[3], p[1]});
    color[2] = hash({p[3], p[2], p[1], p[0]});
  } else {
    for (std::size_t c = 1; c < 3; ++c) {
      std::vector<GraphScalar> key = p;
      key.push_back(b.constant(static_cast<float>(c)));
      color[c] = hash(key);
    }
  }
  n.set("color", color, kColor);
}

constexpr GraphSocket kImageInputs[] = {{"vector", kVector}};
void lower_image(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const int texture = n.texture(n.reader);
  const GraphVector& at = n.vector("vector");
  // The footprint is known where the coordinates are a map's, scaled and turned; the finest level is read elsewhere.
  GraphScalar width = b.constant(0);
  const std::pair<std::array<Q, 2>, Q> sets[] = {{{Q::uv0_u, Q::uv0_v}, Q::uv0_width},
                                                 {{Q::uv1_u, Q::uv1_v}, Q::uv1_width}};
  for (const auto& [uv, of] : sets) {
    const auto x = b.linear_part(at[0], b.quantity(uv[0]), b.quantity(uv[1]));
    const auto y = b.linear_part(at[1], b.quantity(uv[0]), b.quantity(uv[1]));
    if (!x || !y) continue;
    const double area = std::abs((*x)[0] * (*y)[1] - (*x)[1] * (*y)[0]);
    if (area > 0) {
      width = scaled(b, b.quantity(of), static_cast<float>(std::sqrt(area)));
      break;
    }
  }
  const GraphScalar inputs[] = {at[0], at[1], width};
  const auto immediate = static_cast<std::uint16_t>(texture);
  const std::vector<GraphScalar> rgba = b.apply(Op::image, inputs, {&immediate, 1});
  n.set("color", {rgba[0], rgba[1], rgba[2]}, kColor);
  n.set("alpha", rgba[3]);
}

constexpr GraphSocket kGradientInputs[] = {{"vector", kVector}};
void lower_gradient(GraphNode& n)
{
  static constexpr std::string_view kKinds[] = {"linear", "quadratic",        "easing",   "diagonal",
                                                "radial", "quadratic-sphere", "spherical"};
  GraphBuilder& b = n.build;
  const GraphVector& p = n.vector("vector");
  const GraphScalar zero = b.constant(0);
  const int kind = n.reader.choice("gradient", kKinds, 0);
  GraphScalar value;
  switch (kind) {
    case 0:
      value = p[0];
      break;
    case 1: {
      const GraphScalar r = b(Op::maximum, {p[0], zero});
      value = b(Op::multiply, {r, r});
      break;
    }
    case 2: {
      const GraphScalar r = clamped(b, p[0]);
      const GraphScalar t = b(Op::multiply, {r, r});
      value = b(Op::subtract, {scaled(b, t, 3), scaled(b, b(Op::multiply, {t, r}), 2)});
      break;
    }
    case 3:
      value = scaled(b, b(Op::add, {p[0], p[1]}), 0.5f);
      break;
    case 4:
      value =
          b(Op::add,
            {b(Op::divide, {b(Op::arctangent2, {p[1], p[0]}), b.constant(static_cast<float>(2 * 3.14159265358979))}),
             b.constant(0.5f)});
      break;
    default: {
      // A little below 1, so that its square does not jump.
      const GraphScalar length = b(Op::square_root, {dot(b, p, p)});
      const GraphScalar r = b(Op::maximum, {b(Op::subtract, {b.constant(0.999999f), length}), zero});
      value = kind == 5 ? b(Op::multiply, {r, r}) : r;
    }
  }
  value = clamped(b, value);
  n.set("factor", value);
  n.set("color", splat(value), kColor);
}

constexpr GraphSocket kCheckerInputs[] = {{"vector", kVector},
                                          {"color1", kColor, {0.8f, 0.8f, 0.8f}},
                                          {"color2", kColor, {0.2f, 0.2f, 0.2f}},
                                          {"scale", kNumber, {5}}};
void lower_checker(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphVector p = each(b, Op::multiply, n.vector("vector"), splat(n.number("scale")));
  const GraphScalar factor = b(Op::checker, {p[0], p[1], p[2]});
  n.set("factor", factor);
  GraphVector color;
  for (std::size_t c = 0; c < 3; ++c) color[c] = b(Op::select, {factor, n.vector("color1")[c], n.vector("color2")[c]});
  n.set("color", color, kColor);
}

constexpr GraphSocket kMagicInputs[] = {{"vector", kVector}, {"scale", kNumber, {5}}, {"distortion", kNumber, {1}}};
void lower_magic(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const int depth = static_cast<int>(n.reader.integer("depth", 2, 0, 10));
  GraphVector p;
  // Sines of large numbers lose their digits; one turn is as good.
  const GraphScalar turn = b.constant(static_cast<float>(2 * 3.14159265358979));
  for (std::size_t c = 0; c < 3; ++c) {
    p[c] = b(Op::modulo, {b(Op::multiply, {n.vector("vector")[c], n.number("scale")}), turn});
  }
  const auto sum = [&](float sx, float sy, float sz) {
    return b(Op::add, {b(Op::add, {scaled(b, p[0], sx), scaled(b, p[1], sy)}), scaled(b, p[2], sz)});
  };
  const auto five = [&](GraphScalar a) { return scaled(b, a, 5); };
  GraphScalar x = b(Op::sine, {five(sum(1, 1, 1))});
  GraphScalar y = b(Op::cosine, {five(sum(-1, 1, -1))});
  GraphScalar z = scaled(b, b(Op::cosine, {five(sum(-1, -1, 1))}), -1);
  GraphScalar amount = n.number("distortion");
  const auto times = [&](GraphScalar a) { return b(Op::multiply, {a, amount}); };
  const auto minus = [&](GraphScalar a, GraphScalar c) { return b(Op::subtract, {a, c}); };
  const auto plus = [&](GraphScalar a, GraphScalar c) { return b(Op::add, {a, c}); };
  const auto cosine = [&](GraphScalar a) { return b(Op::cosine, {a}); };
  const auto negated_sine = [&](GraphScalar a) { return scaled(b, b(Op::sine, {a}), -1); };
  const auto negated_cosine = [&](GraphScalar a) { return scaled(b, cosine(a), -1); };
  if (depth > 0) {
    x = times(x), y = times(y), z = times(z);
    y = times(negated_cosine(plus(minus(x, y), z)));
    if (depth > 1) x = times(cosine(minus(minus(x, y), z)));
    if (depth > 2) z = times(b(Op::sine, {minus(minus(scaled(b, x, -1), y), z)}));
    if (depth > 3) x = times(negated_cosine(minus(plus(scaled(b, x, -1), y), z)));
    if (depth > 4) y = times(negated_sine(plus(plus(scaled(b, x, -1), y), z)));
    if (depth > 5) y = times(negated_cosine(plus(plus(scaled(b, x, -1), y), z)));
    if (depth > 6) x = times(cosine(plus(plus(x, y), z)));
    if (depth > 7) z = times(b(Op::sine, {minus(plus(x, y), z)}));
    if (depth > 8) x = times(negated_cosine(plus(minus(scaled(b, x, -1), y), z)));
    if (depth > 9) y = times(negated_sine(plus(minus(x, y), z)));
  }
  const GraphScalar halved = scaled(b, amount, 2);
  const GraphVector raw = each(b, Op::divide, GraphVector{x, y, z}, splat(halved));
  GraphVector color;
  for (std::size_t c = 0; c < 3; ++c) {
    const GraphScalar one = b(Op::select, {amount, raw[c], GraphVector{x, y, z}[c]});
    color[c] = b(Op::subtract, {b.constant(0.5f), one});
  }
  n.set("color", color, kColor);
  n.set("factor", b(Op::divide, {b(Op::add, {b(Op::add, {color[0], color[1]}), color[2]}), b.constant(3)}));
}

constexpr GraphSocket kWaveInputs[] = {{"vector", kVector},           {"scale", kNumber, {5}},
                                       {"distortion", kNumber},       {"detail", kNumber, {2}},
                                       {"detailScale", kNumber, {1}}, {"detailRoughness", kNumber, {0.5f}},
                                       {"phaseOffset", kNumber}};
void lower_wave(GraphNode& n)
{
  static constexpr std::string_view kKinds[] = {"bands", "rings"};
  static constexpr std::string_view kDirections[] = {"x", "y", "z", "diagonal", "spherical"};
  static constexpr std::string_view kProfiles[] = {"sine", "saw", "triangle"};
  GraphBuilder& b = n.build;
  const bool are_rings = n.reader.choice("wave", kKinds, 0) == 1;
  const int direction = n.reader.choice("direction", kDirections, 0);
  const int profile = n.reader.choice("profile", kProfiles, 0);
  GraphVector p = each(b, Op::multiply, n.vector("vector"), splat(n.number("scale")));
  // Keeps borders of unit cells from flickering.
  for (GraphScalar& x : p) x = b(Op::multiply, {b(Op::add, {x, b.constant(1e-6f)}), b.constant(0.999999f)});
  GraphScalar at;
  if (are_rings) {
    GraphVector r = p;
    if (direction < 3) r[static_cast<std::size_t>(direction)] = b.constant(0);
    at = scaled(b, b(Op::square_root, {dot(b, r, r)}), 20);
  } else if (direction < 3) {
    at = scaled(b, p[static_cast<std::size_t>(direction)], 20);
  } else {
    at = scaled(b, b(Op::add, {b(Op::add, {p[0], p[1]}), p[2]}), 10);
  }
  at = b(Op::add, {at, n.number("phaseOffset")});
  float known = 1;
  if (!b.is_constant(n.number("distortion"), &known) || known != 0) {
    std::vector<GraphScalar> q;
    for (const GraphScalar x : p) q.push_back(b(Op::multiply, {x, n.number("detailScale")}));
    q.insert(q.end(), {n.number("detail"), n.number("detailRoughness"), b.constant(2)});
    const std::uint16_t normalize = 1;
    const GraphScalar noise = b.apply(Op::noise_3d, q, {&normalize, 1})[0];
    const GraphScalar around_zero = b(Op::subtract, {scaled(b, noise, 2), b.constant(1)});
    at = b(Op::add, {at, b(Op::multiply, {n.number("distortion"), around_zero})});
  }
  GraphScalar value;
  constexpr float kTurn = static_cast<float>(2 * 3.14159265358979);
  if (profile == 0) {
    const GraphScalar sine = b(Op::sine, {b(Op::subtract, {at, b.constant(kTurn / 4)})});
    value = b(Op::add, {b.constant(0.5f), scaled(b, sine, 0.5f)});
  } else {
    const GraphScalar turns = b(Op::divide, {at, b.constant(kTurn)});
    if (profile == 1) {
      value = b(Op::subtract, {turns, b(Op::floor, {turns})});
    } else {
      const GraphScalar nearest = b(Op::floor, {b(Op::add, {turns, b.constant(0.5f)})});
      value = scaled(b, b(Op::absolute, {b(Op::subtract, {turns, nearest})}), 2);
    }
  }
  n.set("factor", value);
  n.set("color", splat(value), kColor);
}

constexpr GraphSocket kVoronoiInputs[] = {{"vector", kVector},           {"w", kNumber},
                                          {"scale", kNumber, {5}},       {"smoothness", kNumber, {1}},
                                          {"exponent", kNumber, {0.5f}}, {"randomness", kNumber, {1}}};
void lower_voronoi(GraphNode& n)
{
  static constexpr std::string_view kFeatures[] = {"f1", "f2", "smooth-f1", "distance-to-edge", "n-sphere-radius"};
  static constexpr std::string_view kMetrics[] = {"euclidean", "manhattan", "chebychev", "minkowski"};
  GraphBuilder& b = n.build;
  const int dimensions = static_cast<int>(n.reader.integer("dimensions", 3, 1, 4));
  std::vector<GraphScalar> in = texture_point(n, dimensions);
  for (GraphScalar& x : in) x = b(Op::multiply, {x, n.number("scale")});
  // Of no smoothness nothing can be divided by.
  const GraphScalar smoothness = clamped(b, scaled(b, n.number("smoothness"), 0.5f), 1e-6f, 0.5f);
  in.insert(in.end(), {smoothness, n.number("exponent"), clamped(b, n.number("randomness"))});
  const std::uint16_t immediates[] = {static_cast<std::uint16_t>(n.reader.choice("feature", kFeatures, 0)),
                                      static_cast<std::uint16_t>(n.reader.choice("metric", kMetrics, 0))};
  const std::vector<GraphScalar> out = b.apply(op_of_dimensions(Op::voronoi_1d, dimensions), in, immediates);
  n.set("distance", out[0]);
  n.set("color", {out[1], out[2], out[3]}, kColor);
  n.set("position", each(b, Op::divide, GraphVector{out[4], out[5], out[6]}, splat(n.number("scale"))), kVector);
  n.set("w", b(Op::divide, {out[7], n.number("scale")}));
  n.set("radius", out[8]);
}

constexpr GraphSocket kMusgraveInputs[] = {{"vector", kVector},         {"w", kNumber},
                                           {"scale", kNumber, {5}},     {"detail", kNumber, {2}},
                                           {"dimension", kNumber, {2}}, {"lacunarity", kNumber, {2}},
                                           {"offset", kNumber},         {"gain", kNumber, {1}}};
void lower_musgrave(GraphNode& n)
{
  static constexpr std::string_view kTypes[] = {"multifractal", "fbm", "hybrid-multifractal", "ridged-multifractal",
                                                "hetero-terrain"};
  GraphBuilder& b = n.build;
  const int dimensions = static_cast<int>(n.reader.integer("dimensions", 3, 1, 4));
  std::vector<GraphScalar> in = texture_point(n, dimensions);
  for (GraphScalar& x : in) x = b(Op::multiply, {x, n.number("scale")});
  const GraphScalar least = b.constant(1e-5f);
  const GraphScalar lacunarity = b(Op::maximum, {n.number("lacunarity"), least});
  const GraphScalar dimension = b(Op::maximum, {n.number("dimension"), least});
  const GraphScalar falloff = b(Op::power, {lacunarity, scaled(b, dimension, -1)});
  in.insert(in.end(),
            {clamped(b, n.number("detail"), 0, 15), falloff, lacunarity, n.number("offset"), n.number("gain")});
  const auto type = static_cast<std::uint16_t>(n.reader.choice("musgrave", kTypes, 1));
  n.set("factor", b.apply(op_of_dimensions(Op::musgrave_1d, dimensions), in, {&type, 1})[0]);
}

constexpr GraphSocket kBrickInputs[] = {{"vector", kVector},
                                        {"color1", kColor, {0.8f, 0.8f, 0.8f}},
                                        {"color2", kColor, {0.2f, 0.2f, 0.2f}},
                                        {"mortar", kColor, {0, 0, 0}},
                                        {"scale", kNumber, {5}},
                                        {"mortarSize", kNumber, {0.02f}},
                                        {"mortarSmooth", kNumber, {0.1f}},
                                        {"bias", kNumber},
                                        {"brickWidth", kNumber, {0.5f}},
                                        {"rowHeight", kNumber, {0.25f}}};
void lower_brick(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const auto option = [&](std::string_view name, float fallback) {
    return b.constant(n.reader.number_f(name, fallback, -1e6, 1e6));
  };
  const GraphVector p = each(b, Op::multiply, n.vector("vector"), splat(n.number("scale")));
  const GraphScalar in[] = {p[0],
                            p[1],
                            n.number("mortarSize"),
                            n.number("mortarSmooth"),
                            n.number("bias"),
                            n.number("brickWidth"),
                            n.number("rowHeight"),
                            option("offset", 0.5f),
                            option("squash", 1)};
  const auto rows = [&](std::string_view name) {
    return static_cast<std::uint16_t>(n.reader.integer(name, 2, 0, 1000));
  };
  const std::uint16_t immediates[] = {rows("offsetFrequency"), rows("squashFrequency")};
  const std::vector<GraphScalar> out = b.apply(Op::brick, in, immediates);
  const GraphVector bricks = mixed(b, out[0], n.vector("color1"), n.vector("color2"));
  n.set("color", mixed(b, out[1], bricks, n.vector("mortar")), kColor);
  n.set("factor", out[1]);
}

// ---- colour

/// The tables of an option, interleaved: `channels` numbers an entry.
/// @return  for each channel a function of the number that it is looked up by, 0…1 from the first entry to the last
std::vector<std::function<GraphScalar(GraphScalar)>> read_tables(GraphNode& n,
                                                                 std::size_t channels,
                                                                 bool interpolate,
                                                                 bool extrapolate)
{
  GraphBuilder& b = n.build;
  constexpr std::size_t kMostEntries = 4096;
  const std::vector<double> table = n.reader.numbers("table", channels, channels * kMostEntries, -1e30, 1e30);
  if (table.empty() || table.size() % channels != 0) {
    n.reader.fail("table", std::to_string(channels) + " numbers for every entry",
                  std::to_string(table.size()) + " numbers");
  }
  const std::size_t num_entries = table.size() / channels;
  std::vector<std::function<GraphScalar(GraphScalar)>> out;
  for (std::size_t c = 0; c < channels; ++c) {
    std::vector<float> row(num_entries);
    for (std::size_t i = 0; i < num_entries; ++i) row[i] = static_cast<float>(table[channels * i + c]);
    const std::uint32_t place = b.add_table(row);
    const std::array<std::uint16_t, 5> immediates = {
        static_cast<std::uint16_t>(place & 0xffffu), static_cast<std::uint16_t>(place >> 16),
        static_cast<std::uint16_t>(num_entries), interpolate ? std::uint16_t{1} : std::uint16_t{0},
        extrapolate ? std::uint16_t{1} : std::uint16_t{0}};
    out.emplace_back([&b, immediates](GraphScalar at) { return b.apply(Op::table, {&at, 1}, immediates)[0]; });
  }
  return out;
}

constexpr GraphSocket kRampInputs[] = {{"factor", kNumber, {0.5f}}};
void lower_color_ramp(GraphNode& n)
{
  const auto channels = read_tables(n, 4, n.reader.boolean("interpolate", true), false);
  const GraphScalar at = n.number("factor");
  n.set("color", {channels[0](at), channels[1](at), channels[2](at)}, kColor);
  n.set("alpha", channels[3](at));
}

/// Values through curves, mixed with what they were.
GraphVector through_curves(GraphNode& n, std::size_t channels, GraphScalar factor, const GraphVector& values)
{
  GraphBuilder& b = n.build;
  const auto curves = read_tables(n, channels, true, n.reader.boolean("extrapolate", true));
  const float low = n.reader.number_f("min", 0, -1e6, 1e6), high = n.reader.number_f("max", 1, -1e6, 1e6);
  if (!(high > low)) n.reader.fail("max", "a number > min");
  GraphVector out;
  for (std::size_t c = 0; c < 3; ++c) {
    const GraphScalar at = b(Op::divide, {b(Op::subtract, {values[c], b.constant(low)}), b.constant(high - low)});
    out[c] = mixed(b, factor, values[c], curves[channels == 1 ? 0 : c](at));
  }
  return out;
}

constexpr GraphSocket kColorCurvesInputs[] = {{"factor", kNumber, {1}}, {"color", kColor, {1, 1, 1}}};
void lower_color_curves(GraphNode& n)
{
  n.set("color", through_curves(n, 3, n.number("factor"), n.vector("color")), kColor);
}

constexpr GraphSocket kVectorCurvesInputs[] = {{"factor", kNumber, {1}}, {"vector", kVector}};
void lower_vector_curves(GraphNode& n)
{
  n.set("vector", through_curves(n, 3, n.number("factor"), n.vector("vector")), kVector);
}

constexpr GraphSocket kNumberCurveInputs[] = {{"factor", kNumber, {1}}, {"value", kNumber, {1}}};
void lower_number_curve(GraphNode& n)
{
  n.set("value", through_curves(n, 1, n.number("factor"), splat(n.number("value")))[0]);
}

GraphScalar sum3(GraphBuilder& b, GraphScalar x, GraphScalar y, GraphScalar z)
{
  return b(Op::add, {b(Op::add, {x, y}), z});
}

/// One channel of a mix of colours by a way that treats channels alike.
GraphScalar blend_channel(GraphBuilder& b, std::string_view blend, GraphScalar t, GraphScalar x, GraphScalar y)
{
  const GraphScalar one = b.constant(1), zero = b.constant(0);
  const GraphScalar rest = b(Op::subtract, {one, t});
  const auto add = [&](GraphScalar p, GraphScalar q) { return b(Op::add, {p, q}); };
  const auto sub = [&](GraphScalar p, GraphScalar q) { return b(Op::subtract, {p, q}); };
  const auto mul = [&](GraphScalar p, GraphScalar q) { return b(Op::multiply, {p, q}); };
  const auto select = [&](GraphScalar is, GraphScalar p, GraphScalar q) { return b(Op::select, {is, p, q}); };
  const auto less = [&](GraphScalar p, GraphScalar q) { return b(Op::less_than, {p, q}); };
  const auto screen = [&] { return sub(one, mul(add(rest, mul(t, sub(one, y))), sub(one, x))); };
  if (blend == "add") return mixed(b, t, x, add(x, y));
  if (blend == "multiply") return mixed(b, t, x, mul(x, y));
  if (blend == "subtract") return mixed(b, t, x, sub(x, y));
  if (blend == "screen") return screen();
  if (blend == "divide") return select(y, add(mul(rest, x), mul(t, b(Op::divide, {x, y}))), x);
  if (blend == "difference") return mixed(b, t, x, b(Op::absolute, {sub(x, y)}));
  if (blend == "exclusion") return b(Op::maximum, {mixed(b, t, x, sub(add(x, y), scaled(b, mul(x, y), 2))), zero});
  if (blend == "darken") return mixed(b, t, x, b(Op::minimum, {x, y}));
  if (blend == "lighten") return mixed(b, t, x, b(Op::maximum, {x, y}));
  if (blend == "overlay") {
    const GraphScalar dark = mul(x, add(rest, scaled(b, mul(t, y), 2)));
    const GraphScalar light = sub(one, mul(add(rest, scaled(b, mul(t, sub(one, y)), 2)), sub(one, x)));
    return select(less(x, b.constant(0.5f)), dark, light);
  }
  if (blend == "dodge") {
    const GraphScalar left = sub(one, mul(t, y));
    const GraphScalar quotient = b(Op::minimum, {b(Op::divide, {x, left}), one});
    return select(x, select(b(Op::greater_than, {left, zero}), quotient, one), x);
  }
  if (blend == "burn") {
    const GraphScalar left = add(rest, mul(t, y));
    const GraphScalar quotient = clamped(b, sub(one, b(Op::divide, {sub(one, x), left})));
    return select(b(Op::greater_than, {left, zero}), quotient, zero);
  }
  if (blend == "soft-light") {
    const GraphScalar both = sub(one, mul(sub(one, y), sub(one, x)));
    return add(mul(rest, x), mul(t, add(mul(mul(sub(one, x), y), x), mul(x, both))));
  }
  if (blend == "linear-light") return add(x, mul(t, sub(scaled(b, y, 2), one)));
  return mixed(b, t, x, y);
}

GraphVector blend_colors(GraphBuilder& b,
                         std::string_view blend,
                         GraphScalar t,
                         const GraphVector& x,
                         const GraphVector& y)
{
  const bool is_hue = blend == "hue", is_color = blend == "color", is_saturation = blend == "saturation",
             is_value = blend == "value";
  if (!is_hue && !is_color && !is_saturation && !is_value) {
    return {blend_channel(b, blend, t, x[0], y[0]), blend_channel(b, blend, t, x[1], y[1]),
            blend_channel(b, blend, t, x[2], y[2])};
  }
  const GraphVector xh = colors(b, Op::rgb_to_hsv, x), yh = colors(b, Op::rgb_to_hsv, y);
  if (is_saturation || is_value) {
    GraphVector h = xh;
    const std::size_t c = is_saturation ? 1 : 2;
    h[c] = mixed(b, t, xh[c], yh[c]);
    const GraphVector out = colors(b, Op::hsv_to_rgb, h);
    if (is_value) return out;
    GraphVector kept;
    for (std::size_t i = 0; i < 3; ++i) kept[i] = b(Op::select, {xh[1], out[i], x[i]});
    return kept;
  }
  const GraphVector tinted =
      colors(b, Op::hsv_to_rgb, is_hue ? GraphVector{yh[0], xh[1], xh[2]} : GraphVector{yh[0], yh[1], xh[2]});
  GraphVector out;
  for (std::size_t i = 0; i < 3; ++i) out[i] = b(Op::select, {yh[1], mixed(b, t, x[i], tinted[i]), x[i]});
  return out;
}

constexpr std::string_view kBlends[] = {"mix",          "darken",     "multiply",  "burn",     "lighten",
                                        "screen",       "dodge",      "add",       "overlay",  "soft-light",
                                        "linear-light", "difference", "exclusion", "subtract", "divide",
                                        "hue",          "saturation", "color",     "value"};

constexpr GraphSocket kMixColorInputs[] = {{"factor", kNumber, {0.5f}},
                                           {"a", kColor, {0.5f, 0.5f, 0.5f}},
                                           {"b", kColor, {0.5f, 0.5f, 0.5f}}};
void lower_mix_color(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const std::string_view blend = kBlends[n.reader.choice("blend", kBlends, 0)];
  const GraphScalar t = n.reader.boolean("clampFactor", true) ? clamped(b, n.number("factor")) : n.number("factor");
  GraphVector out = blend_colors(b, blend, t, n.vector("a"), n.vector("b"));
  if (n.reader.boolean("clampResult", false)) out = clamped(b, out);
  n.set("color", out, kColor);
}

constexpr GraphSocket kMixVectorInputs[] = {{"factor", kVector, {0.5f, 0.5f, 0.5f}}, {"a", kVector}, {"b", kVector}};
void lower_mix_vector(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphVector t = n.reader.boolean("clampFactor", true) ? clamped(b, n.vector("factor")) : n.vector("factor");
  GraphVector out;
  for (std::size_t i = 0; i < 3; ++i) out[i] = mixed(b, t[i], n.vector("a")[i], n.vector("b")[i]);
  n.set("vector", out, kVector);
}

constexpr GraphSocket kMixNumberInputs[] = {{"factor", kNumber, {0.5f}}, {"a", kNumber}, {"b", kNumber}};
void lower_mix_number(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphScalar t = n.reader.boolean("clampFactor", true) ? clamped(b, n.number("factor")) : n.number("factor");
  n.set("value", mixed(b, t, n.number("a"), n.number("b")));
}

constexpr GraphSocket kInvertInputs[] = {{"factor", kNumber, {1}}, {"color", kColor, {0, 0, 0}}};
void lower_invert(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphVector inverse = each(b, Op::subtract, splat(b.constant(1)), n.vector("color"));
  n.set("color", mixed(b, n.number("factor"), n.vector("color"), inverse), kColor);
}

constexpr GraphSocket kGammaInputs[] = {{"color", kColor, {1, 1, 1}}, {"gamma", kNumber, {1}}};
void lower_gamma(GraphNode& n)
{
  GraphBuilder& b = n.build;
  GraphVector out;
  for (std::size_t i = 0; i < 3; ++i) {
    const GraphScalar c = n.vector("color")[i];
    out[i] = b(Op::select, {b(Op::greater_than, {c, b.constant(0)}), b(Op::power, {c, n.number("gamma")}), c});
  }
  n.set("color", out, kColor);
}

constexpr GraphSocket kBrightContrastInputs[] = {{"color", kColor, {1, 1, 1}},
                                                 {"bright", kNumber},
                                                 {"contrast", kNumber}};
void lower_bright_contrast(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphScalar slope = b(Op::add, {b.constant(1), n.number("contrast")});
  const GraphScalar offset = b(Op::subtract, {n.number("bright"), scaled(b, n.number("contrast"), 0.5f)});
  GraphVector out;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = b(Op::maximum, {b(Op::multiply_add, {n.vector("color")[i], slope, offset}), b.constant(0)});
  }
  n.set("color", out, kColor);
}

constexpr GraphSocket kHueInputs[] = {{"hue", kNumber, {0.5f}},
                                      {"saturation", kNumber, {1}},
                                      {"value", kNumber, {1}},
                                      {"factor", kNumber, {1}},
                                      {"color", kColor, {0.8f, 0.8f, 0.8f}}};
void lower_hue_saturation(GraphNode& n)
{
  GraphBuilder& b = n.build;
  GraphVector hsv = colors(b, Op::rgb_to_hsv, n.vector("color"));
  const GraphScalar hue = b(Op::add, {b(Op::add, {hsv[0], n.number("hue")}), b.constant(0.5f)});
  hsv[0] = b(Op::subtract, {hue, b(Op::floor, {hue})});
  hsv[1] = clamped(b, b(Op::multiply, {hsv[1], n.number("saturation")}));
  hsv[2] = b(Op::multiply, {hsv[2], n.number("value")});
  const GraphVector out = mixed(b, n.number("factor"), n.vector("color"), colors(b, Op::hsv_to_rgb, hsv));
  n.set("color", each(b, Op::maximum, out, splat(b.constant(0))), kColor);
}

constexpr std::string_view kColorSpaces[] = {"rgb", "hsv", "hsl"};

constexpr GraphSocket kSeparateColorInputs[] = {{"color", kColor, {0.8f, 0.8f, 0.8f}}};
void lower_separate_color(GraphNode& n)
{
  const int space = n.reader.choice("space", kColorSpaces, 0);
  const GraphVector& c = n.vector("color");
  const GraphVector out = space == 0 ? c : colors(n.build, space == 1 ? Op::rgb_to_hsv : Op::rgb_to_hsl, c);
  n.set("red", out[0]);
  n.set("green", out[1]);
  n.set("blue", out[2]);
}

constexpr GraphSocket kCombineColorInputs[] = {{"red", kNumber}, {"green", kNumber}, {"blue", kNumber}};
void lower_combine_color(GraphNode& n)
{
  const int space = n.reader.choice("space", kColorSpaces, 0);
  const GraphVector c{n.number("red"), n.number("green"), n.number("blue")};
  n.set("color", space == 0 ? c : colors(n.build, space == 1 ? Op::hsv_to_rgb : Op::hsl_to_rgb, c), kColor);
}

constexpr GraphSocket kRgbToBwInputs[] = {{"color", kColor, {0.5f, 0.5f, 0.5f}}};
void lower_rgb_to_bw(GraphNode& n)
{
  n.set("value", graph_convert(n.build, {kColor, n.vector("color")}, kNumber).v[0]);
}

// ---- numbers and vectors

constexpr GraphSocket kSeparateInputs[] = {{"vector", kVector}};
void lower_separate(GraphNode& n)
{
  n.set("x", n.vector("vector")[0]);
  n.set("y", n.vector("vector")[1]);
  n.set("z", n.vector("vector")[2]);
}

constexpr GraphSocket kCombineInputs[] = {{"x", kNumber}, {"y", kNumber}, {"z", kNumber}};
void lower_combine(GraphNode& n) { n.set("vector", {n.number("x"), n.number("y"), n.number("z")}, kVector); }

constexpr GraphSocket kClampInputs[] = {{"value", kNumber, {1}}, {"min", kNumber}, {"max", kNumber, {1}}};
void lower_clamp(GraphNode& n)
{
  static constexpr std::string_view kKinds[] = {"min-max", "range"};
  GraphBuilder& b = n.build;
  GraphScalar low = n.number("min"), high = n.number("max");
  if (n.reader.choice("clamp", kKinds, 0) == 1) {
    std::tie(low, high) = std::pair(b(Op::minimum, {low, high}), b(Op::maximum, {low, high}));
  }
  n.set("value", b(Op::minimum, {b(Op::maximum, {n.number("value"), low}), high}));
}

GraphScalar smooth_step(GraphBuilder& b, GraphScalar t)
{
  const GraphScalar square = b(Op::multiply, {t, t});
  return b(Op::multiply, {square, b(Op::subtract, {b.constant(3), scaled(b, t, 2)})});
}

GraphScalar smoother_step(GraphBuilder& b, GraphScalar t)
{
  const GraphScalar cube = b(Op::multiply, {b(Op::multiply, {t, t}), t});
  const GraphScalar inner =
      b(Op::add, {b(Op::multiply, {t, b(Op::subtract, {scaled(b, t, 6), b.constant(15)})}), b.constant(10)});
  return b(Op::multiply, {cube, inner});
}

/// A number from one range as one of another.
GraphScalar mapped(GraphBuilder& b,
                   int kind,
                   GraphScalar value,
                   const std::array<GraphScalar, 4>& range,
                   GraphScalar steps,
                   bool clamp)
{
  const auto [from_low, from_high, to_low, to_high] = range;
  GraphScalar t = b(Op::divide, {b(Op::subtract, {value, from_low}), b(Op::subtract, {from_high, from_low})});
  if (kind == 1) {
    const GraphScalar count = b(Op::add, {steps, b.constant(1)});
    const GraphScalar stepped = b(Op::divide, {b(Op::floor, {b(Op::multiply, {t, count})}), steps});
    t = b(Op::select, {b(Op::greater_than, {steps, b.constant(0)}), stepped, b.constant(0)});
  } else if (kind > 1) {
    t = kind == 2 ? smooth_step(b, clamped(b, t)) : smoother_step(b, clamped(b, t));
  }
  GraphScalar out = b(Op::add, {to_low, b(Op::multiply, {t, b(Op::subtract, {to_high, to_low})})});
  const GraphScalar width = b(Op::subtract, {from_high, from_low});
  out = b(Op::select, {width, out, b.constant(0)});
  if (!clamp || kind > 1) return out;
  return b(Op::minimum, {b(Op::maximum, {out, b(Op::minimum, {to_low, to_high})}), b(Op::maximum, {to_low, to_high})});
}

constexpr std::string_view kMapKinds[] = {"linear", "stepped", "smoothstep", "smootherstep"};

constexpr GraphSocket kMapRangeInputs[] = {{"value", kNumber, {1}}, {"fromMin", kNumber},    {"fromMax", kNumber, {1}},
                                           {"toMin", kNumber},      {"toMax", kNumber, {1}}, {"steps", kNumber, {4}}};
void lower_map_range(GraphNode& n)
{
  const int kind = n.reader.choice("interpolation", kMapKinds, 0);
  n.set("value", mapped(n.build, kind, n.number("value"),
                        {n.number("fromMin"), n.number("fromMax"), n.number("toMin"), n.number("toMax")},
                        n.number("steps"), n.reader.boolean("clamp", true)));
}

constexpr GraphSocket kMapVectorInputs[] = {
    {"vector", kVector}, {"fromMin", kVector},          {"fromMax", kVector, {1, 1, 1}},
    {"toMin", kVector},  {"toMax", kVector, {1, 1, 1}}, {"steps", kVector, {4, 4, 4}}};
void lower_map_vector(GraphNode& n)
{
  const int kind = n.reader.choice("interpolation", kMapKinds, 0);
  const bool clamp = n.reader.boolean("clamp", true);
  GraphVector out;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = mapped(n.build, kind, n.vector("vector")[i],
                    {n.vector("fromMin")[i], n.vector("fromMax")[i], n.vector("toMin")[i], n.vector("toMax")[i]},
                    n.vector("steps")[i], clamp);
  }
  n.set("vector", out, kVector);
}

constexpr GraphSocket kMappingInputs[] = {{"vector", kVector},
                                          {"location", kVector},
                                          {"rotation", kVector},
                                          {"scale", kVector, {1, 1, 1}}};
void lower_mapping(GraphNode& n)
{
  static constexpr std::string_view kKinds[] = {"point", "texture", "vector", "normal"};
  GraphBuilder& b = n.build;
  const GraphVector &v = n.vector("vector"), &location = n.vector("location"), &rotation = n.vector("rotation"),
                    &scale = n.vector("scale");
  GraphVector out;
  switch (n.reader.choice("mapping", kKinds, 0)) {
    case 0:
      out = each(b, Op::add, rotated(b, each(b, Op::multiply, v, scale), rotation, false), location);
      break;
    case 1:
      out = each(b, Op::divide, rotated(b, each(b, Op::subtract, v, location), rotation, true), scale);
      break;
    case 2:
      out = rotated(b, each(b, Op::multiply, v, scale), rotation, false);
      break;
    default:
      out = normalized(b, rotated(b, each(b, Op::divide, v, scale), rotation, false));
  }
  n.set("vector", out, kVector);
}

constexpr std::string_view kMathLabels[] = {"add",
                                            "subtract",
                                            "multiply",
                                            "divide",
                                            "multiply-add",
                                            "power",
                                            "logarithm",
                                            "square-root",
                                            "inverse-square-root",
                                            "absolute",
                                            "exponent",
                                            "minimum",
                                            "maximum",
                                            "less-than",
                                            "greater-than",
                                            "sign",
                                            "compare",
                                            "smooth-minimum",
                                            "smooth-maximum",
                                            "round",
                                            "floor",
                                            "ceil",
                                            "truncate",
                                            "fraction",
                                            "modulo",
                                            "floored-modulo",
                                            "wrap",
                                            "snap",
                                            "ping-pong",
                                            "sine",
                                            "cosine",
                                            "tangent",
                                            "arcsine",
                                            "arccosine",
                                            "arctangent",
                                            "arctangent2",
                                            "sinh",
                                            "cosh",
                                            "tanh",
                                            "radians",
                                            "degrees"};

GraphScalar fraction(GraphBuilder& b, GraphScalar x) { return b(Op::subtract, {x, b(Op::floor, {x})}); }

GraphScalar truncated(GraphBuilder& b, GraphScalar x)
{
  return b(Op::select, {b(Op::less_than, {x, b.constant(0)}), b(Op::ceil, {x}), b(Op::floor, {x})});
}

GraphScalar smooth_minimum(GraphBuilder& b, GraphScalar x, GraphScalar y, GraphScalar k)
{
  const GraphScalar distance = b(Op::absolute, {b(Op::subtract, {x, y})});
  const GraphScalar h = b(Op::divide, {b(Op::maximum, {b(Op::subtract, {k, distance}), b.constant(0)}), k});
  const GraphScalar cube = b(Op::multiply, {b(Op::multiply, {h, h}), h});
  const GraphScalar lowered = b(Op::multiply, {b(Op::multiply, {cube, k}), b.constant(1.0f / 6.0f)});
  return b(Op::subtract, {b(Op::minimum, {x, y}), lowered});
}

/// Between two limits, again and again.
GraphScalar wrapped(GraphBuilder& b, GraphScalar x, GraphScalar high, GraphScalar low)
{
  const GraphScalar range = b(Op::subtract, {high, low});
  const GraphScalar turns = b(Op::floor, {b(Op::divide, {b(Op::subtract, {x, low}), range})});
  return b(Op::select, {range, b(Op::subtract, {x, b(Op::multiply, {range, turns})}), low});
}

GraphScalar math(GraphBuilder& b, std::string_view op, GraphScalar x, GraphScalar y, GraphScalar z)
{
  // Operations of one, two or three numbers that are opcodes.
  static constexpr std::pair<std::string_view, Op> kOne[] = {{"square-root", Op::square_root},
                                                             {"absolute", Op::absolute},
                                                             {"exponent", Op::exponent},
                                                             {"sign", Op::sign},
                                                             {"floor", Op::floor},
                                                             {"ceil", Op::ceil},
                                                             {"sine", Op::sine},
                                                             {"cosine", Op::cosine},
                                                             {"tangent", Op::tangent},
                                                             {"arcsine", Op::arcsine},
                                                             {"arccosine", Op::arccosine},
                                                             {"arctangent", Op::arctangent},
                                                             {"sinh", Op::sinh},
                                                             {"cosh", Op::cosh},
                                                             {"tanh", Op::tanh}};
  static constexpr std::pair<std::string_view, Op> kTwo[] = {{"add", Op::add},
                                                             {"subtract", Op::subtract},
                                                             {"multiply", Op::multiply},
                                                             {"divide", Op::divide},
                                                             {"power", Op::power},
                                                             {"logarithm", Op::logarithm},
                                                             {"minimum", Op::minimum},
                                                             {"maximum", Op::maximum},
                                                             {"less-than", Op::less_than},
                                                             {"greater-than", Op::greater_than},
                                                             {"modulo", Op::modulo},
                                                             {"arctangent2", Op::arctangent2}};
  for (const auto& [name, opcode] : kOne) {
    if (name == op) return b(opcode, {x});
  }
  for (const auto& [name, opcode] : kTwo) {
    if (name == op) return b(opcode, {x, y});
  }
  const GraphScalar zero = b.constant(0), one = b.constant(1);
  constexpr float kPi = 3.14159265358979f;
  if (op == "multiply-add") return b(Op::multiply_add, {x, y, z});
  if (op == "inverse-square-root") return b(Op::divide, {one, b(Op::square_root, {x})});
  if (op == "compare") {
    const GraphScalar distance = b(Op::absolute, {b(Op::subtract, {x, y})});
    const GraphScalar tolerance = b(Op::maximum, {z, b.constant(1e-5f)});
    return b(Op::subtract, {one, b(Op::greater_than, {distance, tolerance})});
  }
  if (op == "smooth-minimum") return b(Op::select, {z, smooth_minimum(b, x, y, z), b(Op::minimum, {x, y})});
  if (op == "smooth-maximum") {
    const auto negated = [&](GraphScalar a) { return scaled(b, a, -1); };
    return b(Op::select, {z, negated(smooth_minimum(b, negated(x), negated(y), z)), b(Op::maximum, {x, y})});
  }
  if (op == "round") return b(Op::floor, {b(Op::add, {x, b.constant(0.5f)})});
  if (op == "truncate") return truncated(b, x);
  if (op == "fraction") return fraction(b, x);
  if (op == "floored-modulo") {
    const GraphScalar turns = b(Op::floor, {b(Op::divide, {x, y})});
    return b(Op::select, {y, b(Op::subtract, {x, b(Op::multiply, {turns, y})}), zero});
  }
  if (op == "wrap") return wrapped(b, x, y, z);
  if (op == "snap") return b(Op::multiply, {b(Op::floor, {b(Op::divide, {x, y})}), y});
  if (op == "ping-pong") {
    const GraphScalar twice = scaled(b, y, 2);
    const GraphScalar folded = b(Op::multiply, {fraction(b, b(Op::divide, {b(Op::subtract, {x, y}), twice})), twice});
    return b(Op::select, {y, b(Op::absolute, {b(Op::subtract, {folded, y})}), zero});
  }
  if (op == "radians") return scaled(b, x, kPi / 180);
  return scaled(b, x, 180 / kPi);  // degrees
}

constexpr GraphSocket kMathInputs[] = {{"a", kNumber, {0.5f}}, {"b", kNumber, {0.5f}}, {"c", kNumber, {0.5f}}};
void lower_math(GraphNode& n)
{
  const int operation = n.reader.choice("operation", kMathLabels, 0);
  const GraphScalar value = math(n.build, kMathLabels[operation], n.number("a"), n.number("b"), n.number("c"));
  n.set("value", n.reader.boolean("clamp", false) ? clamped(n.build, value) : value);
}

constexpr std::string_view kVectorMathLabels[] = {
    "add",         "subtract", "multiply", "divide",   "multiply-add", "cross",     "project", "reflect", "refract",
    "faceforward", "dot",      "distance", "length",   "scale",        "normalize", "wrap",    "snap",    "floor",
    "ceil",        "modulo",   "fraction", "absolute", "minimum",      "maximum",   "sine",    "cosine",  "tangent"};

constexpr GraphSocket kVectorMathInputs[] = {{"a", kVector}, {"b", kVector}, {"c", kVector}, {"scale", kNumber, {1}}};
void lower_vector_math(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const std::string_view op = kVectorMathLabels[n.reader.choice("operation", kVectorMathLabels, 0)];
  const GraphVector &x = n.vector("a"), &y = n.vector("b"), &z = n.vector("c");
  GraphVector out = splat(b.constant(0));
  GraphScalar value = b.constant(0);
  const auto length = [&](const GraphVector& v) { return b(Op::square_root, {dot(b, v, v)}); };
  const auto times = [&](const GraphVector& v, GraphScalar s) { return each(b, Op::multiply, v, splat(s)); };
  if (op == "cross") {
    out = cross(b, x, y);
  } else if (op == "project") {
    out = times(y, b(Op::divide, {dot(b, x, y), dot(b, y, y)}));
  } else if (op == "reflect") {
    const GraphVector N = normalized(b, y);
    out = each(b, Op::subtract, x, times(N, scaled(b, dot(b, N, x), 2)));
  } else if (op == "refract") {
    const GraphVector N = normalized(b, y);
    const GraphScalar eta = n.number("scale"), cosine = dot(b, N, x), one = b.constant(1);
    const GraphScalar k =
        b(Op::subtract, {one, b(Op::multiply, {b(Op::multiply, {eta, eta}),
                                               b(Op::subtract, {one, b(Op::multiply, {cosine, cosine})})})});
    const GraphScalar along = b(Op::add, {b(Op::multiply, {eta, cosine}), b(Op::square_root, {k})});
    const GraphVector bent = each(b, Op::subtract, times(x, eta), times(N, along));
    for (std::size_t i = 0; i < 3; ++i)
      out[i] = b(Op::select, {b(Op::less_than, {k, b.constant(0)}), b.constant(0), bent[i]});
  } else if (op == "faceforward") {
    const GraphScalar is_against = b(Op::less_than, {dot(b, z, y), b.constant(0)});
    for (std::size_t i = 0; i < 3; ++i) out[i] = b(Op::select, {is_against, x[i], scaled(b, x[i], -1)});
  } else if (op == "dot") {
    value = dot(b, x, y);
  } else if (op == "distance") {
    value = length(each(b, Op::subtract, x, y));
  } else if (op == "length") {
    value = length(x);
  } else if (op == "scale") {
    out = times(x, n.number("scale"));
  } else if (op == "normalize") {
    out = normalized(b, x);
  } else {
    for (std::size_t i = 0; i < 3; ++i) out[i] = math(b, op, x[i], y[i], z[i]);
  }
  n.set("vector", out, kVector);
  n.set("value", value);
}

constexpr GraphNodeKind kKinds[] = {
    {"texture-coordinate", {}, lower_texture_coordinate},
    {"geometry", {}, lower_geometry},
    {"vertex-color", {}, lower_vertex_color},
    {"fresnel", kFresnelInputs, lower_fresnel},
    {"layer-weight", kLayerWeightInputs, lower_layer_weight},
    {"noise-texture", kNoiseInputs, lower_noise},
    {"white-noise-texture", kWhiteNoiseInputs, lower_white_noise},
    {"image-texture", kImageInputs, lower_image},
    {"gradient-texture", kGradientInputs, lower_gradient},
    {"checker-texture", kCheckerInputs, lower_checker},
    {"magic-texture", kMagicInputs, lower_magic},
    {"wave-texture", kWaveInputs, lower_wave},
    {"voronoi-texture", kVoronoiInputs, lower_voronoi},
    {"musgrave-texture", kMusgraveInputs, lower_musgrave},
    {"brick-texture", kBrickInputs, lower_brick},
    {"color-ramp", kRampInputs, lower_color_ramp},
    {"color-curves", kColorCurvesInputs, lower_color_curves},
    {"vector-curves", kVectorCurvesInputs, lower_vector_curves},
    {"number-curve", kNumberCurveInputs, lower_number_curve},
    {"mix-color", kMixColorInputs, lower_mix_color},
    {"mix-vector", kMixVectorInputs, lower_mix_vector},
    {"mix-number", kMixNumberInputs, lower_mix_number},
    {"invert", kInvertInputs, lower_invert},
    {"gamma", kGammaInputs, lower_gamma},
    {"bright-contrast", kBrightContrastInputs, lower_bright_contrast},
    {"hue-saturation", kHueInputs, lower_hue_saturation},
    {"separate-color", kSeparateColorInputs, lower_separate_color},
    {"combine-color", kCombineColorInputs, lower_combine_color},
    {"rgb-to-bw", kRgbToBwInputs, lower_rgb_to_bw},
    {"separate", kSeparateInputs, lower_separate},
    {"combine", kCombineInputs, lower_combine},
    {"clamp", kClampInputs, lower_clamp},
    {"map-range", kMapRangeInputs, lower_map_range},
    {"map-range-vector", kMapVectorInputs, lower_map_vector},
    {"mapping", kMappingInputs, lower_mapping},
    {"math", kMathInputs, lower_math},
    {"vector-math", kVectorMathInputs, lower_vector_math},
};

}  // namespace

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
  const auto* it =
      std::find_if(std::begin(kKinds), std::end(kKinds), [&](const GraphNodeKind& k) { return k.name == name; });
  return it == std::end(kKinds) ? nullptr : it;
}

}  // namespace relief
