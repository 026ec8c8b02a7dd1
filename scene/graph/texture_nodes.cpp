// Nodes that are textures: noise, cells, bricks, images.
#include <algorithm>
#include <array>
#include <cmath>

#include "scene/graph/graph_nodes.h"
#include "scene/graph/graph_vectors.h"

namespace relief {
namespace {

using Op = GraphOp;
using Q = GraphQuantity;
constexpr auto kNumber = GraphType::kNumber;
constexpr auto kVector = GraphType::kVector;
constexpr auto kColor = GraphType::kColor;

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

constexpr GraphNodeKind kKinds[] = {
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
};

}  // namespace

std::span<const GraphNodeKind> graph_texture_nodes() { return kKinds; }

}  // namespace relief
