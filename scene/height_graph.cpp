#include "scene/height_graph.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <string_view>
#include <tuple>

#include "kernel/graph/graph_op.h"
#include "kernel/graph/graph_registers.h"
#include "kernel/graph/image.h"
#include "scene/graph/graph_reader.h"
#include "scene/memory.h"
#include "scene/parallel.h"

namespace relief {
namespace {

constexpr int kLanes = 8;
constexpr int kFirstSize = 256, kLargestSize = 4096, kLargestGivenSize = 16384;
/// Shares of the range of heights: how near the map is to come, and from where on it is said how near it came.
constexpr float kWantedError = 1.0f / 512, kLargeError = 0.01f;
/// Share of the range by which heights a tile apart may differ.
constexpr float kPeriodError = 1e-4f;

using Lanes = std::array<double, kLanes>;

bool is_height(float h) { return std::abs(h) <= kHighestHeight; }

/// Evenly distributed over 0…1, the same for the same number.
double random_number(std::uint64_t index)
{
  // splitmix64
  std::uint64_t z = index * 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/// A graph of heights over the mesh's texture coordinates, whose v points down.
class Height {
 public:
  Height(const GraphProgram& program, int uv_set, GraphRun run) : view_(program.view()), uv_set_(uv_set), run_(run) {}

  F8 operator()(const Lanes& u, const Lanes& v) const
  {
    GraphRegisters registers;
    for (std::uint32_t i = 0; i < view_.num_inputs; ++i) {
      const GraphInput& input = view_.inputs[i];
      F8& lanes = registers.lanes[input.register_index];
      lanes = F8{};
      const bool is_u = input.quantity == (uv_set_ == 0 ? GraphQuantity::uv0_u : GraphQuantity::uv1_u);
      const bool is_v = input.quantity == (uv_set_ == 0 ? GraphQuantity::uv0_v : GraphQuantity::uv1_v);
      for (std::size_t k = 0; k < kLanes && (is_u || is_v); ++k) {
        lanes[static_cast<int>(k)] = static_cast<float>(is_u ? u[k] : 1 - v[k]);
      }
    }
    run_(view_, nullptr, registers);
    const std::uint16_t result = view_.results[0];
    return result == kNoGraphOperand ? F8{} : graph_operand(view_, registers, result);
  }

 private:
  GraphProgramView view_;
  int uv_set_;
  GraphRun run_;
};

/// Texels along one direction of a map.
struct Axis {
  Wrap wrap = Wrap::kRepeat;
  double low = 0, high = 1;  ///< of the mesh's coordinates; of a clamped axis outer texels are centred there
  int size = 1;

  bool repeats() const { return wrap == Wrap::kRepeat; }
  double step() const { return (high - low) / (repeats() ? size : size - 1); }
  /// @param at  in texels from the first one's centre
  double coordinate(double at) const { return low + (at + (repeats() ? 0.5 : 0)) * step(); }
  int num_cells() const { return repeats() ? size : size - 1; }
  /// Coordinate of the map by that of the mesh: factor and summand.
  std::pair<float, float> mapping() const
  {
    if (repeats()) return {1.0f, 0.0f};
    return {static_cast<float>(1 / (step() * size)), static_cast<float>((0.5 - low / step()) / size)};
  }
};

struct Layout {
  Axis u, v;
};

/// Lowest and highest of some heights, and how far a map of them is from the graph.
struct Findings {
  float low = std::numeric_limits<float>::max(), high = std::numeric_limits<float>::lowest(), error = 0;

  float range() const { return high > low ? high - low : 0; }
  void add(float h)
  {
    if (!is_height(h)) return;
    low = std::min(low, h);
    high = std::max(high, h);
  }
  void add(const Findings& other)
  {
    low = std::min(low, other.low);
    high = std::max(high, other.high);
    error = std::max(error, other.error);
  }
};

/// Compares the graph with what is interpolated between a map's texels: in the middle and at a random place of one cell in each
/// of 256 × 256 parts of the map.
Findings measure(const Height& height, const Layout& layout)
{
  constexpr int kParts = 256;
  std::vector<Findings> rows(kParts);
  for_each_in_parallel(kParts, [&](std::size_t row) {
    const auto part = [](const Axis& axis, int n, double random) {
      const double at = (n + random) / kParts * axis.num_cells();
      return std::min(std::floor(at), axis.num_cells() - 1.0);
    };
    Findings& found = rows[row] = {};
    for (int column = 0; column < kParts; column += kLanes) {
      Lanes i, j, s, t;
      for (int k = 0; k < kLanes; ++k) {
        const auto n = static_cast<std::size_t>(k);
        const std::uint64_t seed = 4 * (row * kParts + static_cast<std::uint64_t>(column + k));
        i[n] = part(layout.u, column + k, random_number(seed));
        j[n] = part(layout.v, static_cast<int>(row), random_number(seed + 1));
        s[n] = random_number(seed + 2);
        t[n] = random_number(seed + 3);
      }
      const auto at = [&](const auto& du, const auto& dv) {
        Lanes u, v;
        for (std::size_t k = 0; k < kLanes; ++k) {
          u[k] = layout.u.coordinate(i[k] + du(k));
          v[k] = layout.v.coordinate(j[k] + dv(k));
        }
        return height(u, v);
      };
      const auto zero = [](std::size_t) { return 0.0; };
      const auto half = [](std::size_t) { return 0.5; };
      const auto one = [](std::size_t) { return 1.0; };
      const auto at_s = [&](std::size_t k) { return s[k]; };
      const auto at_t = [&](std::size_t k) { return t[k]; };
      const F8 h00 = at(zero, zero), h10 = at(one, zero), h01 = at(zero, one), h11 = at(one, one);
      const F8 middle = at(half, half), random = at(at_s, at_t);
      for (int k = 0; k < kLanes; ++k) {
        for (const F8* h : {&h00, &h10, &h01, &h11, &middle, &random}) found.add((*h)[k]);
        const auto n = static_cast<std::size_t>(k);
        const auto x = static_cast<float>(s[n]), y = static_cast<float>(t[n]);
        const float bilinear = (h00[k] * (1 - x) + h10[k] * x) * (1 - y) + (h01[k] * (1 - x) + h11[k] * x) * y;
        const float differences[] = {middle[k] - 0.25f * (h00[k] + h10[k] + h01[k] + h11[k]), random[k] - bilinear};
        for (const float d : differences) {
          if (is_height(d)) found.error = std::max(found.error, std::abs(d));
        }
      }
    }
  });
  Findings all;
  for (const Findings& row : rows) all.add(row);
  return all;
}

/// Whether heights a tile apart are equal: across the unit square's borders, and at random points.
bool is_periodic(const Height& height, float range, bool along_u)
{
  constexpr int kPoints = 2048;
  constexpr double kFarthestTile = 8;
  for (int n = 0; n < kPoints; n += kLanes) {
    Lanes u, v;
    for (std::size_t k = 0; k < kLanes; ++k) {
      const std::uint64_t seed = 2 * (static_cast<std::uint64_t>(n) + k) + (std::uint64_t{1} << 32);
      const double x = random_number(seed), y = random_number(seed + 1);
      // A quarter on the border, a quarter within the unit square, and the others around it.
      const bool is_wide = n >= kPoints / 2;
      u[k] = n < kPoints / 4 ? 0 : is_wide ? (2 * x - 1) * kFarthestTile : x;
      v[k] = is_wide ? (2 * y - 1) * kFarthestTile : y;
      if (!along_u) std::swap(u[k], v[k]);
    }
    const F8 here = height(u, v);
    for (double& x : along_u ? u : v) x += 1;
    const F8 there = height(u, v);
    for (int k = 0; k < kLanes; ++k) {
      if (!(std::abs(there[k] - here[k]) <= kPeriodError * range)) return false;
    }
  }
  return true;
}

/// Doubles a map until it is near enough to its graph.
Findings refine(const Height& height, Layout& layout, int size)
{
  for (layout.u.size = layout.v.size = size;; layout.u.size = layout.v.size *= 2) {
    const Findings found = measure(height, layout);
    if (found.error <= kWantedError * found.range() || layout.u.size >= kLargestSize) return found;
  }
}

HeightMap evaluate(const Height& height, const Layout& layout, const std::string& label, Warnings& warnings)
{
  HeightMap map;
  map.label = label;
  map.width = layout.u.size;
  map.height = layout.v.size;
  map.format = HeightFormat::kFloat;
  map.wrap_u = layout.u.wrap;
  map.wrap_v = layout.v.wrap;
  const MemoryReservation room(2 * map.bytes(), label);
  const std::shared_ptr<void> texels = height_texels_allocate(map.bytes());
  auto* heights = static_cast<float*>(texels.get());
  const auto width = static_cast<std::size_t>(map.width);
  for_each_in_parallel(static_cast<std::size_t>(map.height), [&](std::size_t row) {
    Lanes u, v;
    v.fill(layout.v.coordinate(static_cast<double>(row)));
    for (std::size_t column = 0; column < width; column += kLanes) {
      for (std::size_t k = 0; k < kLanes; ++k) u[k] = layout.u.coordinate(static_cast<double>(column + k));
      const F8 h = height(u, v);
      for (std::size_t k = 0; k < std::min<std::size_t>(kLanes, width - column); ++k) {
        heights[row * width + column + k] = h[static_cast<int>(k)];
      }
    }
  });
  height_texels_repair({heights, width * static_cast<std::size_t>(map.height)}, map.width, label, warnings);
  map.texels = texels;
  return map;
}

/// Whether a program reads nothing but one set of texture coordinates.
bool reads_coordinates_alone(const GraphProgram& program, int uv_set)
{
  using Q = GraphQuantity;
  for (const GraphInput& input : program.inputs) {
    const Q q = input.quantity;
    if (uv_set == 0 ? q != Q::uv0_u && q != Q::uv0_v && q != Q::uv0_width
                    : q != Q::uv1_u && q != Q::uv1_v && q != Q::uv1_width) {
      return false;
    }
  }
  for (std::size_t word = 0; word < program.code.size();) {
    const auto op = static_cast<GraphOp>(program.code[word]);
    if (graph_op_reads_images(op)) return false;
    const GraphOpShape& shape = kGraphOpShapes[static_cast<std::size_t>(op)];
    word += 1 + static_cast<std::size_t>(shape.num_immediates + shape.num_outputs + shape.num_inputs);
  }
  return true;
}

/// Low and high of an axis that does not repeat, from uvRange.
void set_range(const JsonReader& graph, Layout& layout)
{
  constexpr double kFarthest = 1e6, kSmallest = 1e-6;
  const std::vector<double> range = graph.numbers("uvRange", 4, 4, -kFarthest, kFarthest);
  if (range.empty()) return;
  if (!(range[2] - range[0] >= kSmallest && range[3] - range[1] >= kSmallest)) {
    graph.fail("uvRange", "[u low, v low, u high, v high] with highs at least 1e-6 above the lows");
  }
  layout.u.low = range[0], layout.v.low = range[1];
  layout.u.high = range[2], layout.v.high = range[3];
}

}  // namespace

/// Keeps a graph that is evaluated at points.
HeightGraph HeightGraphTable::keep(const GltfDocument& document, const JsonReader& graph, Warnings& warnings)
{
  for (const char* name : {"uvRange", "resolution"}) {
    if (!graph.has(name)) continue;
    warnings.add(graph.file() + ": " + json_path_join(graph.path(), name) + ": of maps; these heights have none");
  }
  HeightGraph kept;
  kept.graph_index = keep(height_graph_read(document, graph, textures_, scene_.attribute_names, warnings));
  return kept;
}

/// Index of a program that is evaluated at points.
int HeightGraphTable::keep(GraphProgram program)
{
  for (const int texture : graph_textures(program)) textures_.use_for_heights(texture);
  scene_.graphs.push_back(std::move(program));
  return static_cast<int>(scene_.graphs.size()) - 1;
}

int HeightGraphTable::add_vectors(const GltfDocument& document, const JsonReader& displacement, Warnings& warnings)
{
  return keep(vector_graph_read(document, displacement, textures_, scene_.attribute_names, warnings));
}

HeightGraph HeightGraphTable::add(const GltfDocument& document,
                                  const JsonReader& displacement,
                                  const std::string& material,
                                  Warnings& warnings)
{
  static constexpr std::string_view kEvaluations[] = {"auto", "points"};
  const JsonReader graph = displacement.object("heightGraph");
  const std::string label = graph.file() + ": " + graph.path();
  TextureRef ref;
  ref.uv_set = static_cast<int>(graph.integer("texCoord", 0, 0, 1));
  Layout layout;
  layout.u.wrap = layout.v.wrap = Wrap::kClamp;
  set_range(graph, layout);
  const int given_size = static_cast<int>(graph.integer("resolution", 0, 2, kLargestGivenSize));
  const bool at_points = graph.choice("evaluate", kEvaluations, 0) == 1;
  const auto [known, is_new] = known_.try_emplace(
      displacement.raw("heightGraph").dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  if (!is_new) return known->second;
  // Images are not to be read twice.
  TextureTable images(textures_.faults());
  std::vector<std::string> attribute_names;
  Warnings unheard;
  const GraphProgram program = height_graph_read(document, graph, images, attribute_names, unheard);
  if (at_points || !reads_coordinates_alone(program, ref.uv_set))
    return known->second = keep(document, graph, warnings);
  static_cast<void>(height_graph_read(document, graph, images, attribute_names, warnings));

  const Height height(program, ref.uv_set, run_);
  Findings found;
  if (program.inputs.empty()) {
    layout = {};
  } else {
    layout.u.size = layout.v.size = kFirstSize;
    const float range = measure(height, layout).range();
    for (Axis* axis : {&layout.u, &layout.v}) {
      // A tile says more than its part, unless the part is smaller.
      if (axis->high - axis->low < 1 || !is_periodic(height, range, axis == &layout.u)) continue;
      *axis = {};
    }
    if (given_size > 0) {
      layout.u.size = layout.v.size = given_size;
      found = measure(height, layout);
    } else {
      found = refine(height, layout, kFirstSize);
    }
  }
  if (const float error = found.range() > 0 ? found.error / found.range() : 0; error > kLargeError) {
    char text[16];
    std::snprintf(text, sizeof(text), "%.2g", 100.0 * static_cast<double>(error));
    warnings.add(label + ": the height of " + material + " is known to " + text +
                 " % of its range: it jumps, or has detail finer than " + std::to_string(layout.u.size) +
                 " texels a side show");
  }
  ref.texture_index = static_cast<int>(maps_.size());
  maps_.push_back(evaluate(height, layout, label, warnings));
  std::tie(ref.m00, ref.m02) = layout.u.mapping();
  std::tie(ref.m11, ref.m12) = layout.v.mapping();
  return known->second = {.map = ref};
}

}  // namespace relief
