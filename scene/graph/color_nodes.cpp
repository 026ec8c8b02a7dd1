// Nodes of colours: ramps, curves, mixes, spaces.
#include <algorithm>
#include <array>

#include "kernel/math/cie_1931.h"
#include "scene/graph/graph_nodes.h"
#include "scene/graph/graph_vectors.h"

namespace relief {
namespace {

using Op = GraphOp;
constexpr auto kNumber = GraphType::kNumber;
constexpr auto kVector = GraphType::kVector;
constexpr auto kColor = GraphType::kColor;

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
  const auto guarded = [&b](const GraphVector& v, GraphScalar factor) {
    const std::vector<GraphScalar> out = b.guarded(v, factor);
    return GraphVector{out[0], out[1], out[2]};
  };
  // Of a factor of 0 the other colour does not matter in any way of mixing, of one of 1 the first does in most.
  const GraphScalar rest = b(Op::subtract, {b.constant(1), t});
  const GraphVector x = blend == "mix" ? guarded(n.vector("a"), rest) : n.vector("a");
  // A known factor of 0 leaves colours alone, also those that a way of mixing would cut off or send through hues; but for three,
  // as Cycles does it.
  constexpr std::string_view kAlways[] = {"lighten", "dodge", "burn"};
  float known = 1;
  const bool is_off = b.is_constant(t, &known) && known == 0 && std::ranges::find(kAlways, blend) == std::end(kAlways);
  GraphVector out = is_off ? x : blend_colors(b, blend, t, x, guarded(n.vector("b"), t));
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
  const auto guarded = [&b](GraphScalar a, GraphScalar factor) { return b.guarded({&a, 1}, factor)[0]; };
  const GraphScalar rest = b(Op::subtract, {b.constant(1), t});
  n.set("value", mixed(b, t, guarded(n.number("a"), rest), guarded(n.number("b"), t)));
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
    const GraphScalar bent =
        b(Op::select, {b(Op::greater_than, {c, b.constant(0)}), b(Op::power, {c, n.number("gamma")}), c});
    // What is not above 0 stays as it is, but of a gamma of 0 all is 1.
    out[i] = b(Op::select, {n.number("gamma"), bent, b.constant(1)});
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
  // Blender before 4 cuts off whole turns towards 0, so that hues below 0 stay below: no colour wheel has them.
  const bool goes_round = n.reader.boolean("hueGoesRound", false);
  float known = -1;
  const bool is_above = b.is_constant(n.number("hue"), &known) && known >= -0.5f;
  GraphScalar turns = b(Op::floor, {hue});
  if (!goes_round && !is_above) {
    turns = b(Op::select, {b(Op::less_than, {hue, b.constant(0)}), b(Op::ceil, {hue}), turns});
  }
  hsv[0] = b(Op::subtract, {hue, turns});
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

constexpr GraphSocket kBlackbodyInputs[] = {{"temperature", kNumber, {1500}}};
void lower_blackbody(GraphNode& n)
{
  GraphBuilder& b = n.build;
  const GraphScalar kelvins[] = {n.number("temperature")};
  const std::vector<GraphScalar> c = b.apply(Op::blackbody, kelvins);
  n.set("color", each(b, Op::maximum, {c[0], c[1], c[2]}, splat(b.constant(0))), kColor);
}

constexpr GraphSocket kWavelengthInputs[] = {{"wavelength", kNumber, {500}}};
void lower_wavelength(GraphNode& n)
{
  GraphBuilder& b = n.build;
  constexpr float kFirst = kFirstCieNanometres, kStep = kCieStepNanometres, kLast = kNumCieMatches - 1;
  const GraphScalar steps =
      b(Op::divide, {b(Op::subtract, {n.number("wavelength"), b.constant(kFirst)}), b.constant(kStep)});
  const GraphScalar at = b(Op::divide, {steps, b.constant(kLast)});
  GraphVector xyz;
  for (std::size_t c = 0; c < 3; ++c) {
    const std::uint32_t place = b.add_table(kCieMatches[c]);
    const std::uint16_t immediates[] = {static_cast<std::uint16_t>(place & 0xffffu),
                                        static_cast<std::uint16_t>(place >> 16), kNumCieMatches, 1, 1};
    xyz[c] = b.apply(Op::table, {&at, 1}, immediates)[0];
  }
  // Rec. 709; divided by what keeps all wavelengths below 1.
  const GraphScalar is_visible =
      b(Op::multiply, {b(Op::greater_than, {steps, b.constant(-1)}), b(Op::less_than, {steps, b.constant(kLast)})});
  GraphVector rgb;
  for (std::size_t c = 0; c < 3; ++c) {
    const Vec3f row = kRec709FromXyz[c];
    const GraphScalar sum = sum3(b, scaled(b, xyz[0], row.x), scaled(b, xyz[1], row.y), scaled(b, xyz[2], row.z));
    rgb[c] = b(Op::multiply, {is_visible, b(Op::maximum, {scaled(b, sum, 1 / 2.52f), b.constant(0)})});
  }
  n.set("color", rgb, kColor);
}

constexpr GraphNodeKind kKinds[] = {
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
    {"blackbody", kBlackbodyInputs, lower_blackbody},
    {"wavelength", kWavelengthInputs, lower_wavelength},
};

}  // namespace

std::span<const GraphNodeKind> graph_color_nodes() { return kKinds; }

}  // namespace relief
