// Nodes of numbers and vectors.
#include <array>
#include <limits>
#include <tuple>

#include "scene/graph/graph_nodes.h"
#include "scene/graph/graph_vectors.h"

namespace relief {
namespace {

using Op = GraphOp;
constexpr auto kNumber = GraphType::kNumber;
constexpr auto kVector = GraphType::kVector;

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
/// @param of_nothing  what a range without width gives
GraphScalar mapped(GraphBuilder& b,
                   int kind,
                   GraphScalar value,
                   const std::array<GraphScalar, 4>& range,
                   GraphScalar steps,
                   bool clamp,
                   GraphScalar of_nothing)
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
  out = b(Op::select, {width, out, of_nothing});
  if (!clamp) return out;
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
                        n.number("steps"), n.reader.boolean("clamp", true), n.build.constant(0)));
}

constexpr GraphSocket kMapVectorInputs[] = {
    {"vector", kVector}, {"fromMin", kVector},          {"fromMax", kVector, {1, 1, 1}},
    {"toMin", kVector},  {"toMax", kVector, {1, 1, 1}}, {"steps", kVector, {4, 4, 4}}};
void lower_map_vector(GraphNode& n)
{
  const int kind = n.reader.choice("interpolation", kMapKinds, 0);
  // What is smoothed stays within anyway.
  const bool clamp = n.reader.boolean("clamp", true) && kind < 2;
  GraphVector out;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = mapped(n.build, kind, n.vector("vector")[i],
                    {n.vector("fromMin")[i], n.vector("fromMax")[i], n.vector("toMin")[i], n.vector("toMax")[i]},
                    n.vector("steps")[i], clamp, n.vector("toMin")[i]);
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
    const GraphScalar tolerance = b(Op::maximum, {z, b.constant(std::numeric_limits<float>::epsilon())});
    // Equal infinities have no distance.
    return b(Op::select, {b(Op::greater_than, {distance, tolerance}), b(Op::equal, {x, y}), one});
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
    "add",     "subtract",    "multiply", "divide",   "multiply-add", "cross",    "project",   "reflect",
    "refract", "faceforward", "dot",      "distance", "length",       "scale",    "normalize", "wrap",
    "snap",    "floor",       "ceil",     "modulo",   "fraction",     "absolute", "minimum",   "maximum",
    "sine",    "cosine",      "tangent",  "power",    "sign",         "round"};

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

std::span<const GraphNodeKind> graph_math_nodes() { return kKinds; }

}  // namespace relief
