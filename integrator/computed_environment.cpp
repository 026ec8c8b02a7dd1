#include "integrator/computed_environment.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "kernel/graph/graph_op.h"
#include "kernel/graph/graph_scene.h"
#include "kernel/math/trigonometry.h"

namespace relief {
namespace {

constexpr int kLanes = 8;
constexpr int kColumns = ComputedCells::kColumns, kRows = ComputedCells::kRows;
constexpr std::size_t kNumCells = std::size_t{kColumns} * kRows;

float component(Vec3f v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

/// What a graph reads of a direction, Z up.
float quantity_of(const ComputedEnvironment& environment, const GraphInput& input, Vec3f d)
{
  using Q = GraphQuantity;
  const auto axis_of = [&input](Q first) { return static_cast<int>(input.quantity) - static_cast<int>(first); };
  switch (input.quantity) {
    case Q::object_x:
    case Q::object_y:
    case Q::object_z:
      return component(d, axis_of(Q::object_x));
    case Q::generated_x:
    case Q::generated_y:
    case Q::generated_z:
      return component(d, axis_of(Q::generated_x));
    case Q::position_x:
    case Q::position_y:
    case Q::position_z:
      return component(d, axis_of(Q::position_x));
    case Q::normal_x:
    case Q::normal_y:
    case Q::normal_z:
      return -component(d, axis_of(Q::normal_x));
    case Q::true_normal_x:
    case Q::true_normal_y:
    case Q::true_normal_z:
      return -component(d, axis_of(Q::true_normal_x));
    case Q::object_normal_x:
    case Q::object_normal_y:
    case Q::object_normal_z:
      return -component(d, axis_of(Q::object_normal_x));
    case Q::vertex_normal_x:
    case Q::vertex_normal_y:
    case Q::vertex_normal_z:
      return -component(d, axis_of(Q::vertex_normal_x));
    case Q::smooth_normal_x:
    case Q::smooth_normal_y:
    case Q::smooth_normal_z:
      return -component(d, axis_of(Q::smooth_normal_x));
    case Q::incoming_x:
    case Q::incoming_y:
    case Q::incoming_z:
      return -component(d, axis_of(Q::incoming_x));
    case Q::world_from_object:
    case Q::object_from_world:
      // Three rows of four: there is no object, so that its space is the world's.
      return input.index % 5 == 0 ? 1.0f : 0.0f;
    case Q::ray_kind:
      return environment.is_backdrop && input.index == static_cast<int>(GraphRayKind::kCamera) ? 1.0f : 0.0f;
    default:
      return 0.0f;
  }
}

/// Radiance towards the first `count` of eight directions in world space.
void evaluate(const ComputedEnvironment& environment, const Vec3f* directions, int count, Vec3f* radiance)
{
  GraphRegisters registers;
  registers.used = (1u << count) - 1;
  Vec3f turned[kLanes];
  for (int k = 0; k < count; ++k) {
    // Turned as the map would be; and Y up as in glTF is Z up for graphs.
    const Vec3f wi = directions[k];
    turned[k] = {wi.x * environment.cos_rotation - wi.z * environment.sin_rotation,
                 -wi.z * environment.cos_rotation - wi.x * environment.sin_rotation, wi.y};
  }
  for (std::uint32_t i = 0; i < environment.program.num_inputs; ++i) {
    const GraphInput& input = environment.program.inputs[i];
    F8& lanes = registers.lanes[input.register_index];
    for (int k = 0; k < count; ++k) lanes[k] = quantity_of(environment, input, turned[k]);
  }
  environment.run(environment.program, environment.textures, registers);
  for (int k = 0; k < count; ++k) {
    const auto result = [&](int c) {
      const float value = graph_result({&environment.program, &registers, k}, c);
      return std::isfinite(value) ? value : 0.0f;
    };
    radiance[k] = {result(0), result(1), result(2)};
  }
}

/// Whether a program has operations whose values vary without end: patterns and images.
bool graph_has_textures(const GraphProgramView& program)
{
  for (std::uint32_t word = 0; word < program.num_words;) {
    const auto op = static_cast<GraphOp>(program.code[word]);
    const bool is_plain = op < GraphOp::noise_1d || op == GraphOp::table || op == GraphOp::grid || op == GraphOp::blackbody;
    if (!is_plain) return true;
    const GraphOpShape& shape = kGraphOpShapes[static_cast<std::size_t>(op)];
    word += 1 + static_cast<std::uint32_t>(shape.num_immediates + shape.num_outputs + shape.num_inputs);
  }
  return false;
}

/// A place between four of a grid's.
struct GridPlace {
  int column = 0, row = 0;  ///< of the upper left one
  float x = 0, y = 0;       ///< to the right one, and down: 0 to 1
};

/// Of a world direction, in the map; near the poles a place that is not smooth.
GridPlace map_place(const ComputedEnvironment& environment, Vec3f wi)
{
  const float x = wi.x * environment.cos_rotation - wi.z * environment.sin_rotation;
  const float z = wi.x * environment.sin_rotation + wi.z * environment.cos_rotation;
  const float v = angle_of(std::sqrt(x * x + z * z), wi.y) * kInvPi;
  const float turn = std::copysign(angle_of(std::fabs(x), -z) * (0.5f * kInvPi), x);
  const float column = (turn + 0.5f) * kColumns + (kColumns - 0.5f), row = v * kRows - 0.5f;
  if (!(row >= 0)) return {};
  const int left = static_cast<int>(column), up = static_cast<int>(row);
  return {left % kColumns, up, column - static_cast<float>(left), row - static_cast<float>(up)};
}

/// Places to a side of a sun's square. More than half of the disk is to lie where limb darkening is told well enough.
constexpr int kSunSide = 64;

/// Of a world direction, in a sun's square; outside of it a place that is not smooth.
GridPlace sun_place(const SmoothSun& sun, Vec3f wi)
{
  const Vec3f d = to_local(sun.frame, wi);
  constexpr float kMiddle = 0.5f * (kSunSide - 1);
  const float x = kMiddle + d.x / d.z * sun.scale, y = kMiddle + d.y / d.z * sun.scale;
  if (!(d.z > 0.0f && x >= 0.0f && x < kSunSide - 1 && y >= 0.0f && y < kSunSide - 1)) return {};
  const int left = static_cast<int>(x), up = static_cast<int>(y);
  return {left, up, x - static_cast<float>(left), y - static_cast<float>(up)};
}

bool is_smooth_at(const SmoothGrid& grid, const GridPlace& at)
{
  return grid.is_smooth[static_cast<std::size_t>(at.row * grid.columns + at.column)] != 0;
}

/// Linear along rows and, as skies change most by height, cubic across them (Bessel's formula): of a sky by day six tenths of all
/// directions below the horizon would else be left to the graph.
/// @param at  its row neither one of the first nor of the last two
Vec3f interpolated(const SmoothGrid& grid, const GridPlace& at)
{
  const int right = (at.column + 1) % grid.columns;
  const auto on_row = [&](int row) {
    const Vec3f* const values = &grid.values[static_cast<std::size_t>(row * grid.columns)];
    return values[at.column] * (1 - at.x) + values[right] * at.x;
  };
  const Vec3f up = on_row(at.row), down = on_row(at.row + 1);
  const Vec3f bend = on_row(at.row - 1) - up - down + on_row(at.row + 2);
  return up * (1 - at.y) + down * at.y - bend * (0.25f * at.y * (1 - at.y));
}

/// Finds where a grid is smooth: between four places, and all that surround these, interpolation gives what is there. What a
/// place in the middle does not see of an edge, one beside it does.
/// @param between  radiance in the middle of each four places, by the upper left one
/// @param least    error that may be everywhere
void grid_find_smooth(SmoothGrid& grid, const std::vector<Vec3f>& between, float least)
{
  // A quarter of what pictures are to agree by.
  constexpr float kTolerance = 1e-3f;
  const int columns = grid.columns, rows = grid.rows;
  std::vector<std::uint8_t> agrees(grid.values.size());
  tbb::parallel_for(1, rows - 2, [&](int row) {
    for (int column = 0; column < columns; ++column) {
      const auto at = static_cast<std::size_t>(row * columns + column);
      const Vec3f value = between[at], error = abs(interpolated(grid, {column, row, 0.5f, 0.5f}) - value);
      agrees[at] = max_component(error) <= kTolerance * max_component(abs(value)) + least;
    }
  });
  grid.is_smooth.assign(grid.values.size(), 0);
  tbb::parallel_for(1, rows - 2, [&](int row) {
    for (int column = 0; column < columns; ++column) {
      bool is_smooth = true;
      for (int y = row - 1; y <= row + 1; ++y) {
        for (int x = column + columns - 1; x <= column + columns + 1; ++x) {
          is_smooth = is_smooth && agrees[static_cast<std::size_t>(y * columns + x % columns)] != 0;
        }
      }
      grid.is_smooth[static_cast<std::size_t>(row * columns + column)] = is_smooth;
    }
  });
}

SmoothSun sun_smooth(const ComputedEnvironment& environment, const EnvironmentSun& sun)
{
  constexpr float kMargin = 1.1f;
  const float tangent = std::sqrt(sun.cone * (2.0f - sun.cone)) / (1.0f - sun.cone);
  SmoothSun out;
  out.frame = frame_from_normal(sun.towards);
  out.scale = 0.5f * (kSunSide - 1) / (kMargin * tangent);
  out.grid.columns = out.grid.rows = kSunSide;
  std::vector<Vec3f> between(std::size_t{kSunSide} * kSunSide);
  out.grid.values.resize(between.size());
  const auto fill = [&](int row, float place, Vec3f* values) {
    for (int column = 0; column < kSunSide; column += kLanes) {
      Vec3f directions[kLanes];
      for (int k = 0; k < kLanes; ++k) {
        const float x = static_cast<float>(column + k) + place - 0.5f * (kSunSide - 1);
        const float y = static_cast<float>(row) + place - 0.5f * (kSunSide - 1);
        directions[k] = from_local(out.frame, normalize(Vec3f{x / out.scale, y / out.scale, 1.0f}));
      }
      evaluate(environment, directions, kLanes, values + column);
    }
  };
  tbb::parallel_for(0, kSunSide, [&](int row) {
    fill(row, 0.0f, &out.grid.values[static_cast<std::size_t>(row * kSunSide)]);
    fill(row, 0.5f, &between[static_cast<std::size_t>(row * kSunSide)]);
  });
  grid_find_smooth(out.grid, between, 0.0f);
  // Nothing follows on the last column.
  for (int row = 0; row < kSunSide; ++row) {
    for (const int column : {0, kSunSide - 2, kSunSide - 1}) {
      out.grid.is_smooth[static_cast<std::size_t>(row * kSunSide + column)] = 0;
    }
  }
  return out;
}

/// Makes the map: cells as EnvironmentView has them before it is rotated, whose directions are turned back here.
class CellMap {
 public:
  CellMap(const ComputedEnvironment& environment, std::span<const EnvironmentSun> suns, Vec3f color)
      : environment_(environment), suns_(suns), color_(color)
  {
  }

  /// Mean luminance of a cell, whether it gives light or takes it away, by side² places.
  float mean_at(int column, int row, int side) const
  {
    Vec3f directions[kLanes];
    float sum = 0;
    int waiting = 0;
    const auto add = [&] {
      Vec3f radiance[kLanes];
      evaluate(environment_, directions, waiting, radiance);
      for (int k = 0; k < waiting; ++k) sum += luminance(abs(color_ * radiance[k]));
      waiting = 0;
    };
    for (int i = 0; i < side * side; ++i) {
      directions[waiting++] = direction_at(column, row, side, i);
      if (waiting == kLanes) add();
    }
    if (waiting > 0) add();
    return sum / static_cast<float>(side * side);
  }

  /// Radiance along a row, a place a cell.
  /// @param place  in the cells, to the right and down: 0 to 1
  void row(int row, float place, Vec3f* out) const
  {
    for (int column = 0; column < kColumns; column += kLanes) {
      Vec3f directions[kLanes];
      for (int k = 0; k < kLanes; ++k) {
        directions[k] = direction(static_cast<float>(column + k) + place, static_cast<float>(row) + place);
      }
      evaluate(environment_, directions, kLanes, out + column);
    }
  }

  /// World direction of a place of the map, in cells.
  Vec3f direction(float x, float y) const
  {
    const float theta = y * (kPi / kRows);
    const SinCos phi = sin_cos_turn(x / kColumns - 0.5f);
    const float sine = std::sin(theta);
    return computed_environment_world(environment_, {sine * phi.sin, std::cos(theta), -sine * phi.cos});
  }

  /// Luminance of a row of cells by their middles.
  void row_by_middles(int row, float* out) const
  {
    for (int column = 0; column < ComputedCells::kColumns; column += kLanes) {
      Vec3f directions[kLanes], radiance[kLanes];
      for (int k = 0; k < kLanes; ++k) directions[k] = direction_at(column + k, row, 1, 0);
      evaluate(environment_, directions, kLanes, radiance);
      for (int k = 0; k < kLanes; ++k) out[column + k] = luminance(abs(color_ * radiance[k]));
    }
  }

  /// Mean luminance of a sun's disk.
  float sun_mean(const EnvironmentSun& sun) const
  {
    constexpr int kSide = 8;
    const Frame frame = frame_from_normal(sun.towards);
    float sum = 0;
    for (int i = 0; i < kSide; ++i) {
      Vec3f directions[kLanes], radiance[kLanes];
      for (int k = 0; k < kLanes; ++k) {
        const Vec2f u{(static_cast<float>(i) + 0.5f) / kSide, (static_cast<float>(k) + 0.5f) / kLanes};
        directions[k] = from_local(frame, warp_cone(sun.cone, u));
      }
      evaluate(environment_, directions, kLanes, radiance);
      for (const Vec3f& r : radiance) sum += luminance(abs(color_ * r));
    }
    return sum / (kSide * kLanes);
  }

 private:
  /// A place of a cell, in world space; beside the suns, not in them.
  Vec3f direction_at(int column, int row, int side, int place) const
  {
    const float x = static_cast<float>(column) + (static_cast<float>(place % side) + 0.5f) / static_cast<float>(side);
    const float y = static_cast<float>(row) + (static_cast<float>(place / side) + 0.5f) / static_cast<float>(side);
    Vec3f d = direction(x, y);
    for (const EnvironmentSun& sun : suns_) {
      if (!(length_squared(d - sun.towards) <= 2.0f * sun.cone)) continue;
      const Frame frame = frame_from_normal(sun.towards);
      const float t = 1.05f * std::sqrt(2.0f * sun.cone);
      const Vec3f away = d - sun.towards * dot(d, sun.towards);
      d = normalize(sun.towards + (is_zero(away) ? frame.s : normalize(away)) * t);
    }
    return d;
  }

  const ComputedEnvironment& environment_;
  std::span<const EnvironmentSun> suns_;
  Vec3f color_;
};

/// Cells whose middles do not tell what they hold, where something bright is small: the brightest neighbourhoods first.
std::vector<std::size_t> cells_to_refine(const std::vector<float>& cells)
{
  constexpr float kBright = 8, kContrast = 2;  // times the mean, and times a neighbour
  constexpr std::size_t kMost = 4096;
  double sum = 0, weights = 0;
  for (int y = 0; y < kRows; ++y) {
    const double weight = std::sin((y + 0.5) * std::numbers::pi / kRows);
    double row = 0;
    for (int x = 0; x < kColumns; ++x) row += static_cast<double>(cells[static_cast<std::size_t>(y * kColumns + x)]);
    sum += weight * row;
    weights += weight * kColumns;
  }
  const float enough = kBright * static_cast<float>(sum / weights);
  std::vector<std::pair<float, std::size_t>> found;
  for (int y = 0; y < kRows; ++y) {
    for (int x = 0; x < kColumns; ++x) {
      float low = kInfinity, high = 0;
      for (int line = std::max(y - 1, 0); line <= std::min(y + 1, kRows - 1); ++line) {
        for (int step = -1; step <= 1; ++step) {
          const int column = (x + step + kColumns) % kColumns;
          const float value = cells[static_cast<std::size_t>(line * kColumns + column)];
          low = std::min(low, value);
          high = std::max(high, value);
        }
      }
      if (high > enough && high > kContrast * low) found.push_back({-high, static_cast<std::size_t>(y * kColumns + x)});
    }
  }
  std::sort(found.begin(), found.end());
  found.resize(std::min(found.size(), kMost));
  std::vector<std::size_t> out;
  for (const auto& [bright, cell] : found) out.push_back(cell);
  return out;
}

}  // namespace

ComputedEnvironment computed_environment_make(const EnvironmentGraph& graph,
                                              float rotation,
                                              GraphRun run,
                                              const TextureView* textures)
{
  ComputedEnvironment environment;
  environment.program = graph.program.view();
  environment.run = run;
  environment.textures = textures;
  environment.is_backdrop = graph.is_backdrop;
  environment.cos_rotation = std::cos(rotation);
  environment.sin_rotation = std::sin(rotation);
  return environment;
}

Vec3f computed_environment_world(const ComputedEnvironment& environment, Vec3f map)
{
  return {map.x * environment.cos_rotation + map.z * environment.sin_rotation, map.y,
          map.z * environment.cos_rotation - map.x * environment.sin_rotation};
}

Vec3f computed_environment_radiance(const void* computed, Vec3f wi)
{
  const auto& environment = *static_cast<const ComputedEnvironment*>(computed);
  if (!environment.map.is_smooth.empty()) {
    const GridPlace at = map_place(environment, wi);
    if (is_smooth_at(environment.map, at)) return interpolated(environment.map, at);
    for (const SmoothSun& sun : environment.suns) {
      const GridPlace in_square = sun_place(sun, wi);
      if (is_smooth_at(sun.grid, in_square)) return interpolated(sun.grid, in_square);
    }
  }
  Vec3f radiance;
  evaluate(environment, &wi, 1, &radiance);
  return radiance;
}

void computed_environment_smooth(ComputedEnvironment& environment, std::span<const EnvironmentSun> suns)
{
  if (graph_has_textures(environment.program)) return;
  const CellMap cells(environment, {}, {1, 1, 1});
  SmoothGrid map{kColumns, kRows, std::vector<Vec3f>(kNumCells), {}};
  std::vector<Vec3f> between(kNumCells);
  tbb::parallel_for(0, kRows, [&](int row) {
    cells.row(row, 0.5f, &map.values[static_cast<std::size_t>(row * kColumns)]);
    if (row + 1 < kRows) cells.row(row, 1.0f, &between[static_cast<std::size_t>(row * kColumns)]);
  });
  double sum = 0;
  for (std::size_t i = 0; i < kNumCells; ++i) {
    const auto column = static_cast<float>(i % kColumns) + 0.5f, row = static_cast<float>(i / kColumns) + 0.5f;
    const bool is_sun = std::any_of(suns.begin(), suns.end(), [&](const EnvironmentSun& sun) {
      return length_squared(cells.direction(column, row) - sun.towards) <= 2.0f * sun.cone;
    });
    if (!is_sun) sum += static_cast<double>(max_component(abs(map.values[i])));
  }
  grid_find_smooth(map, between, 1e-4f * static_cast<float>(sum / static_cast<double>(kNumCells)));
  // A sun's disk may lie between all places.
  constexpr float kReach = 3 * std::numbers::pi_v<float> / kRows;
  tbb::parallel_for(0, kRows, [&](int row) {
    for (int column = 0; column < kColumns; ++column) {
      const Vec3f d = cells.direction(static_cast<float>(column + 1), static_cast<float>(row + 1));
      for (const EnvironmentSun& sun : suns) {
        if (length(d - sun.towards) > std::sqrt(2.0f * sun.cone) + kReach) continue;
        map.is_smooth[static_cast<std::size_t>(row * kColumns + column)] = 0;
      }
    }
  });
  // The square is on a plane, which disks near a half circle have no place on.
  constexpr float kWidest = 0.3f;
  for (const EnvironmentSun& sun : suns) {
    if (sun.cone < kWidest) environment.suns.push_back(sun_smooth(environment, sun));
  }
  environment.map = std::move(map);
}

ComputedCells computed_environment_cells(const ComputedEnvironment& computed,
                                         std::span<const EnvironmentSun> suns,
                                         Vec3f color,
                                         int most_side)
{
  constexpr int kMostSide = 8, kFineSide = 8;
  constexpr auto kWidth = static_cast<std::size_t>(kColumns);
  const CellMap map(computed, suns, color);
  const int side = std::clamp((most_side + kColumns - 1) / kColumns, 1, kMostSide);
  ComputedCells cells;
  cells.luminance.resize(kNumCells);
  tbb::parallel_for(0, kRows, [&](int row) {
    float* const out = &cells.luminance[static_cast<std::size_t>(row) * kWidth];
    if (side == 1) {
      map.row_by_middles(row, out);
    } else {
      for (int column = 0; column < kColumns; ++column) out[column] = map.mean_at(column, row, side);
    }
  });
  if (side < kFineSide) {
    const std::vector<std::size_t> fine = cells_to_refine(cells.luminance);
    tbb::parallel_for(std::size_t{0}, fine.size(), [&](std::size_t i) {
      const auto column = static_cast<int>(fine[i] % kWidth), row = static_cast<int>(fine[i] / kWidth);
      cells.luminance[fine[i]] = map.mean_at(column, row, kFineSide);
    });
  }
  for (const EnvironmentSun& sun : suns) cells.suns.push_back(map.sun_mean(sun));
  return cells;
}

int environment_graph_image_side(const EnvironmentGraph& graph, std::span<const TextureView> textures)
{
  int most = 0;
  for (const int texture : graph_textures(graph.program)) {
    const TextureView& view = textures[static_cast<std::size_t>(texture)];
    most = std::max({most, view.width, view.height});
  }
  return most;
}

}  // namespace relief
