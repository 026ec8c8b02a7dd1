// Nodes that are textures: noise, cells, bricks, images.
#include <algorithm>
#include <array>
#include <cmath>

#include "kernel/graph/image.h"
#include "kernel/graph/voronoi.h"
#include "scene/graph/graph_nodes.h"
#include "scene/graph/graph_vectors.h"

namespace relief {
namespace {

using Op = GraphOp;
using Q = GraphQuantity;
constexpr auto kNumber = GraphType::kNumber;
constexpr auto kVector = GraphType::kVector;
constexpr auto kColor = GraphType::kColor;

/// Which Blender's numbers a texture has, where later ones changed them.
enum Maths { kMaths34, kMaths43, kMaths52 };
int read_maths(const GraphNode& n)
{
  static constexpr std::string_view kVersions[] = {"3.4", "4.3", "5.2"};
  return n.reader.choice("maths", kVersions, kMaths34);
}

constexpr GraphSocket kNoiseInputs[] = {{"vector", kVector},
                                        {"w", kNumber},
                                        {"scale", kNumber, {5}},
                                        {"detail", kNumber, {2}},
                                        {"roughness", kNumber, {0.5f}},
                                        {"lacunarity", kNumber, {2}},
                                        {"distortion", kNumber},
                                        {"offset", kNumber},
                                        {"gain", kNumber, {1}}};

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
/// @param is_fused  offsets are rounded once, as Cycles 5.2 is compiled
std::vector<GraphScalar> moved(GraphBuilder& b, const std::vector<GraphScalar>& p, float number, bool is_fused)
{
  std::vector<GraphScalar> out;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const GraphScalar hash = p.size() == 1 ? b(Op::hash_1d, {b.constant(number)})
                                           : b(Op::hash_2d, {b.constant(number), b.constant(static_cast<float>(i))});
    GraphScalar offset = b(Op::add, {b.constant(100), scaled(b, hash, 100)});
    if (float known = 0; is_fused && b.is_constant(hash, &known)) offset = b.constant(std::fma(known, 100.0f, 100.0f));
    out.push_back(b(Op::add, {p[i], offset}));
  }
  return out;
}

Op op_of_dimensions(Op first, int dimensions) { return static_cast<Op>(static_cast<int>(first) + dimensions - 1); }

constexpr std::string_view kMusgraveTypes[] = {"multifractal", "fbm", "hybrid-multifractal", "ridged-multifractal",
                                               "hetero-terrain"};
constexpr int kFbm = 1;

void lower_noise(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const int dimensions = static_cast<int>(n.reader.integer("dimensions", 3, 1, 4));
  const bool is_normalized = n.reader.boolean("normalize", true);
  const int type = n.reader.choice("noise", kMusgraveTypes, kFbm);
  const int maths = read_maths(n);
  const std::uint16_t repeats = maths != kMaths34 ? 1 : 0;
  const bool is_fused = maths == kMaths52;
  std::vector<GraphScalar> p = texture_point(n, dimensions);
  for (GraphScalar& x : p) x = b(Op::multiply, {x, n.number("scale")});
  float known = 1;
  float number = 0;
  if (!b.is_constant(n.number("distortion"), &known) || known != 0) {
    std::vector<GraphScalar> bent;
    for (int i = 0; i < dimensions; ++i) {
      const GraphScalar noise = b.apply(op_of_dimensions(Op::signed_noise_1d, dimensions),
                                        moved(b, p, static_cast<float>(i), is_fused), {&repeats, 1})[0];
      bent.push_back(b(Op::add, {p[static_cast<std::size_t>(i)], b(Op::multiply, {noise, n.number("distortion")})}));
    }
    p = bent;
  }
  number = static_cast<float>(dimensions);
  const auto fractal = [&](std::vector<GraphScalar> at) {
    if (type == kFbm) {
      at.insert(at.end(), {n.number("detail"), n.number("roughness"), n.number("lacunarity")});
      const std::uint16_t immediates[] = {is_normalized ? std::uint16_t{1} : std::uint16_t{0}, repeats};
      return b.apply(op_of_dimensions(Op::noise_1d, dimensions), at, immediates)[0];
    }
    // Details are octaves beyond the first.
    const GraphScalar octaves = b(Op::add, {clamped(b, n.number("detail"), 0, 15), b.constant(1)});
    const GraphScalar roughness = b(Op::maximum, {n.number("roughness"), b.constant(0)});
    at.insert(at.end(), {octaves, roughness, n.number("lacunarity"), n.number("offset"), n.number("gain")});
    const std::uint16_t immediates[] = {static_cast<std::uint16_t>(type), repeats};
    return b.apply(op_of_dimensions(Op::musgrave_1d, dimensions), at, immediates)[0];
  };
  const GraphScalar value = fractal(p);
  n.set("factor", value);
  n.set("color", {value, fractal(moved(b, p, number, is_fused)), fractal(moved(b, p, number + 1, is_fused))}, kColor);
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

/// Footprint of texture coordinates. It is known where they are a map's, scaled and turned; the finest level is read elsewhere.
GraphScalar coordinate_width(GraphBuilder& b, GraphScalar u, GraphScalar v)
{
  const std::pair<std::array<Q, 2>, Q> sets[] = {{{Q::uv0_u, Q::uv0_v}, Q::uv0_width},
                                                 {{Q::uv1_u, Q::uv1_v}, Q::uv1_width}};
  for (const auto& [uv, of] : sets) {
    const auto x = b.linear_part(u, b.quantity(uv[0]), b.quantity(uv[1]));
    const auto y = b.linear_part(v, b.quantity(uv[0]), b.quantity(uv[1]));
    if (!x || !y) continue;
    const double area = std::abs((*x)[0] * (*y)[1] - (*x)[1] * (*y)[0]);
    if (area > 0) return scaled(b, b.quantity(of), static_cast<float>(std::sqrt(area)));
  }
  return b.constant(0);
}

/// Longitude and latitude, or longitude and height, of a point around the middle of the unit cube, 0…1.
std::array<GraphScalar, 2> around(GraphBuilder& b, const GraphVector& at, bool is_sphere)
{
  constexpr float kHalfTurn = 3.14159265358979f;
  GraphVector p;
  for (std::size_t i = 0; i < 3; ++i) p[i] = scaled(b, b(Op::subtract, {at[i], b.constant(0.5f)}), 2);
  const GraphScalar zero = b.constant(0), half = b.constant(0.5f);
  const GraphScalar radius_squared = b(Op::add, {b(Op::multiply, {p[0], p[0]}), b(Op::multiply, {p[1], p[1]})});
  const GraphScalar turn = scaled(b, b(Op::arctangent2, {p[0], p[1]}), 0.5f / kHalfTurn);
  const GraphScalar u = b(Op::select, {radius_squared, b(Op::subtract, {half, turn}), zero});
  if (!is_sphere) {
    const GraphScalar height = scaled(b, b(Op::add, {p[2], b.constant(1)}), 0.5f);
    return {u, b(Op::select, {radius_squared, height, zero})};
  }
  const GraphScalar length = b(Op::square_root, {dot(b, p, p)});
  const GraphScalar polar = b(Op::arccosine, {b(Op::divide, {p[2], length})});
  const GraphScalar v = b(Op::subtract, {b.constant(1), scaled(b, polar, 1 / kHalfTurn)});
  return {u, b(Op::select, {length, v, zero})};
}

/// Puts the textures of option "tiles" into a table.
/// @return  its place and rows
std::pair<std::uint32_t, std::uint16_t> read_tiles(GraphNode& n)
{
  constexpr int kFirst = 1001, kRows = 100;
  const nlohmann::json& tiles = n.reader.raw("tiles");
  if (!tiles.is_array()) n.reader.fail("tiles", "an array", json_describe(tiles));
  std::vector<float> table;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const JsonReader tile(tiles[i], n.reader.file(), json_path_join(json_path_join(n.reader.path(), "tiles"), i));
    const auto number = tile.integer("tile", -1, kFirst, kFirst + kImageTileColumns * kRows - 1) - kFirst;
    if (number < 0) tile.fail("tile", "a number from 1001 on");
    const auto rows = static_cast<std::size_t>(number / kImageTileColumns + 1);
    if (table.size() < rows * kImageTileColumns) table.resize(rows * kImageTileColumns, -1.0f);
    float& place = table[static_cast<std::size_t>(number)];
    if (place >= 0) tile.fail("tile", "every number once");
    place = static_cast<float>(n.texture(tile));
  }
  if (table.empty()) n.reader.fail("tiles", "at least one tile");
  return {n.build.add_table(table), static_cast<std::uint16_t>(table.size() / kImageTileColumns)};
}

constexpr GraphSocket kImageInputs[] = {{"vector", kVector}};
void lower_image(GraphNode& n)
{
  static constexpr std::string_view kProjections[] = {"flat", "sphere", "tube", "box"};
  static constexpr std::string_view kFilters[] = {"texture", "cubic"};
  static constexpr std::string_view kAlphas[] = {"separate", "straight", "associated", "opaque"};
  GraphBuilder& b = n.build;
  const int projection = n.reader.choice("projection", kProjections, 0);
  const int alpha = n.reader.choice("alpha", kAlphas, 0);
  unsigned flags = 0;
  if (n.reader.boolean("clip", false)) flags |= kImageClip;
  if (n.reader.choice("filter", kFilters, 0) == 1) flags |= kImageCubic;
  const bool is_divided = n.reader.boolean("unassociate", false);
  // Colours that are not divided afterwards are multiplied when they are read (graph_reader.cpp).
  if (alpha == 1 && is_divided) flags |= kImageMultiply;
  if (alpha == 3) flags |= kImageOpaque;
  if (is_divided) flags |= kImageDivide;
  const auto flag_word = static_cast<std::uint16_t>(flags);
  const GraphVector& at = n.vector("vector");
  const bool is_tiled = n.reader.has("tiles");
  if (is_tiled && projection == 3) n.reader.fail("tiles", "none of a box");
  std::vector<GraphScalar> rgba;
  if (projection == 3) {
    const GraphScalar blend = b.constant(n.reader.number_f("blend", 0, 0, 1));
    const GraphScalar inputs[] = {at[0],
                                  at[1],
                                  at[2],
                                  b.quantity(Q::object_normal_x),
                                  b.quantity(Q::object_normal_y),
                                  b.quantity(Q::object_normal_z),
                                  blend};
    const std::uint16_t immediates[] = {static_cast<std::uint16_t>(n.texture(n.reader)), flag_word};
    rgba = b.apply(Op::image_box, inputs, immediates);
  } else {
    const std::array<GraphScalar, 2> uv = projection == 0 ? std::array{at[0], at[1]} : around(b, at, projection == 1);
    const GraphScalar inputs[] = {uv[0], uv[1], coordinate_width(b, uv[0], uv[1])};
    if (is_tiled) {
      const auto [place, rows] = read_tiles(n);
      const std::uint16_t immediates[] = {flag_word, rows, static_cast<std::uint16_t>(place & 0xffffu),
                                          static_cast<std::uint16_t>(place >> 16)};
      rgba = b.apply(Op::image_tiles, inputs, immediates);
    } else {
      const std::uint16_t immediates[] = {static_cast<std::uint16_t>(n.texture(n.reader)), flag_word};
      rgba = b.apply(Op::image, inputs, immediates);
    }
  }
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
  // Sines of large numbers lose their digits; one turn is as good. Before 5.0 it was one of what is scaled after that.
  const GraphScalar turn = b.constant(static_cast<float>(2 * 3.14159265358979)), scale = n.number("scale");
  const bool scales_first = read_maths(n) == kMaths52;
  for (std::size_t c = 0; c < 3; ++c) {
    const GraphScalar at = n.vector("vector")[c];
    p[c] = scales_first ? b(Op::modulo, {b(Op::multiply, {at, scale}), turn})
                        : b(Op::multiply, {b(Op::modulo, {at, turn}), scale});
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
  const std::uint16_t repeats = read_maths(n) != kMaths34 ? 1 : 0;
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
    const std::uint16_t immediates[] = {1, repeats};
    const GraphScalar noise = b.apply(Op::noise_3d, q, immediates)[0];
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
                                          {"exponent", kNumber, {0.5f}}, {"randomness", kNumber, {1}},
                                          {"detail", kNumber},           {"roughness", kNumber, {0.5f}},
                                          {"lacunarity", kNumber, {2}}};
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
  in.insert(in.end(), {smoothness, n.number("exponent"), clamped(b, n.number("randomness")), n.number("detail"),
                       n.number("roughness"), n.number("lacunarity")});
  const int maths = read_maths(n);
  unsigned flags = 0;
  if (n.reader.boolean("normalize", false)) flags |= kVoronoiNormalize;
  if (maths != kMaths34) flags |= kVoronoiFar;
  if (maths == kMaths52) flags |= kVoronoiPcg;
  const std::uint16_t immediates[] = {static_cast<std::uint16_t>(n.reader.choice("feature", kFeatures, 0)),
                                      static_cast<std::uint16_t>(n.reader.choice("metric", kMetrics, 0)),
                                      static_cast<std::uint16_t>(flags)};
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
  const std::uint16_t immediates[] = {static_cast<std::uint16_t>(n.reader.choice("musgrave", kMusgraveTypes, kFbm)), 0};
  n.set("factor", b.apply(op_of_dimensions(Op::musgrave_1d, dimensions), in, immediates)[0]);
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

constexpr GraphSocket kGaborInputs[] = {{"vector", kVector},
                                        {"scale", kNumber, {5}},
                                        {"frequency", kNumber, {2}},
                                        {"anisotropy", kNumber, {1}},
                                        {"orientation", kNumber, {0.785398163f}},
                                        {"direction", kVector, {1.41421356f, 1.41421356f, 0}}};
void lower_gabor(GraphNode& n)
{
  GraphBuilder& b = n.build;
  constexpr double kTurn = 2 * 3.14159265358979, kSpotsACell = 8;
  const bool is_3d = n.reader.integer("dimensions", 2, 2, 3) == 3;
  const GraphVector p = each(b, Op::multiply, n.vector("vector"), splat(n.number("scale")));
  const GraphScalar isotropy = b(Op::subtract, {b.constant(1), clamped(b, n.number("anisotropy"))});
  std::vector<GraphScalar> in(p.begin(), p.begin() + (is_3d ? 3 : 2));
  in.insert(in.end(), {b(Op::maximum, {n.number("frequency"), b.constant(0.001f)}), isotropy});
  if (is_3d) {
    const GraphVector direction = normalized(b, n.vector("direction"));
    in.insert(in.end(), direction.begin(), direction.end());
  } else {
    in.push_back(scaled(b, n.number("orientation"), static_cast<float>(1 / kTurn)));
  }
  const std::vector<GraphScalar> wave = b.apply(is_3d ? Op::gabor_3d : Op::gabor_2d, in);
  // Six standard deviations of sums of spots of weight ±1.
  const double power = is_3d ? 0.25 / std::sqrt(2.0) : 0.25;
  const auto range = static_cast<float>(6 * std::sqrt(0.5 * kSpotsACell * power));
  const GraphScalar half = b.constant(0.5f);
  n.set("value", b(Op::add, {scaled(b, b(Op::divide, {wave[1], b.constant(range)}), 0.5f), half}));
  const GraphScalar angle =
      b(Op::add, {b(Op::arctangent2, {wave[1], wave[0]}), b.constant(static_cast<float>(kTurn / 2))});
  n.set("phase", b(Op::divide, {angle, b.constant(static_cast<float>(kTurn))}));
  const GraphScalar squared = b(Op::add, {b(Op::multiply, {wave[0], wave[0]}), b(Op::multiply, {wave[1], wave[1]})});
  n.set("intensity", b(Op::divide, {b(Op::square_root, {squared}), b.constant(range)}));
}

constexpr GraphSocket kIesInputs[] = {{"vector", kVector}, {"strength", kNumber, {1}}};
void lower_ies(GraphNode& n)
{
  GraphBuilder& b = n.build;
  GraphVector v = n.vector("vector");
  if (!n.is_given("vector")) v = quantities(b, Q::object_normal_x, Q::object_normal_y, Q::object_normal_z);
  v = normalized(b, v);
  // From straight down; around from −y.
  const GraphScalar vertical = b(Op::arccosine, {scaled(b, v[2], -1)});
  const GraphScalar horizontal = b(Op::add, {b(Op::arctangent2, {v[0], v[1]}), b.constant(3.14159265f)});
  const IesProfile& profile = n.ies(n.reader);
  if (profile.rows.empty()) {
    constexpr float kOfMissing = 100;  // as in Blender
    n.set("factor", scaled(b, n.number("strength"), kOfMissing));
    return;
  }
  const std::uint32_t place = b.add_table(ies_table(profile, static_cast<IesEnds>(read_maths(n))));
  const std::uint16_t immediates[] = {
      static_cast<std::uint16_t>(place & 0xffffu), static_cast<std::uint16_t>(place >> 16),
      static_cast<std::uint16_t>(profile.horizontal.size()), static_cast<std::uint16_t>(profile.vertical.size())};
  const GraphScalar inputs[] = {horizontal, vertical};
  n.set("factor", b(Op::multiply, {n.number("strength"), b.apply(Op::ies, inputs, immediates)[0]}));
}

constexpr GraphSocket kVoxelInputs[] = {{"vector", kVector}};
void lower_voxels(GraphNode& n)
{
  GraphBuilder& b = n.build;
  static constexpr std::string_view kPlaces[] = {"corners", "centers"};
  const int place = n.reader.choice("values", kPlaces, 0);
  GraphVector v = n.vector("vector");
  if (!n.is_given("vector")) v = quantities(b, Q::object_x, Q::object_y, Q::object_z);
  const std::shared_ptr<const Voxels> voxels = n.voxels(n.reader);
  GraphVector color = splat(b.constant(0));
  if (voxels != nullptr) {
    const std::uint16_t number = b.add_voxels(place == 1 ? voxels_centered(voxels->view) : voxels->view, voxels);
    const std::vector<GraphScalar> rgb = b.apply(Op::voxels, v, {&number, 1});
    std::copy(rgb.begin(), rgb.end(), color.begin());
  }
  n.set("color", color, kColor);
  const bool is_number = voxels != nullptr && voxels->view.channels == 1;
  n.set("value", is_number ? color[0] : scaled(b, sum3(b, color[0], color[1], color[2]), 1.0f / 3.0f));
}

constexpr GraphNodeKind kKinds[] = {
    {"ies-texture", kIesInputs, lower_ies},
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
    {"gabor-texture", kGaborInputs, lower_gabor},
    {"voxel-texture", kVoxelInputs, lower_voxels},
};

}  // namespace

std::span<const GraphNodeKind> graph_texture_nodes() { return kKinds; }

}  // namespace relief
