#include "scene/environment_graph.h"

#include <algorithm>
#include <cmath>

#include "kernel/graph/graph_eval.h"
#include "kernel/graph/graph_scene.h"
#include "scene/parallel.h"

namespace relief {
namespace {

constexpr float kPiAngle = 3.14159265f;

/// A direction with Z up.
Vec3f direction_at(const EnvironmentMap& map, float x, float y)
{
  const float theta = y * kPiAngle / static_cast<float>(map.height);
  const float phi = (x / static_cast<float>(map.width) - 0.5f) * 2 * kPiAngle;
  return {std::sin(theta) * std::sin(phi), std::sin(theta) * std::cos(phi), std::cos(theta)};
}

float component(Vec3f v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

/// What a graph reads of a direction.
float quantity_of(const EnvironmentGraph& graph, const GraphInput& input, Vec3f d)
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
    case Q::incoming_x:
    case Q::incoming_y:
    case Q::incoming_z:
      return -component(d, axis_of(Q::incoming_x));
    case Q::world_from_object:
    case Q::object_from_world:
      // Three rows of four: there is no object, so that its space is the world's.
      return input.index % 5 == 0 ? 1.0f : 0.0f;
    case Q::ray_kind:
      return graph.is_backdrop && input.index == static_cast<int>(GraphRayKind::kCamera) ? 1.0f : 0.0f;
    default:
      return 0.0f;
  }
}

/// Radiance towards eight directions. What is no radiance is 0.
void evaluate(const EnvironmentGraph& graph,
              const TextureView* textures,
              const Vec3f (&directions)[8],
              Vec3f (&radiance)[8])
{
  const GraphProgramView program = graph.program.view();
  GraphRegisters registers;
  for (std::uint32_t i = 0; i < program.num_inputs; ++i) {
    const GraphInput& input = program.inputs[i];
    F8& lanes = registers.lanes[input.register_index];
    for (int k = 0; k < 8; ++k) lanes[k] = quantity_of(graph, input, directions[k]);
  }
  graph_run(program, textures, registers);
  for (int k = 0; k < 8; ++k) {
    const auto result = [&](int c) {
      const float value = graph_result({&program, &registers, k}, c);
      return std::isfinite(value) && value > 0.0f ? value : 0.0f;
    };
    radiance[k] = {result(0), result(1), result(2)};
  }
}

EnvironmentMap bake(const EnvironmentGraph& graph, std::span<const TextureView> textures, int width)
{
  EnvironmentMap map;
  map.width = width;
  map.height = std::max(1, width / 2);
  map.rgb.resize(static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height) * 3);
  for_each_in_parallel(static_cast<std::size_t>(map.height), [&](std::size_t y) {
    float* row = &map.rgb[y * static_cast<std::size_t>(map.width) * 3];
    for (int x = 0; x < map.width; x += 8) {
      Vec3f directions[8], radiance[8];
      for (int k = 0; k < 8; ++k) {
        directions[k] = direction_at(map, static_cast<float>(x + k) + 0.5f, static_cast<float>(y) + 0.5f);
      }
      evaluate(graph, textures.data(), directions, radiance);
      for (int k = 0; k < std::min(8, map.width - x); ++k) {
        float* texel = row + (x + k) * 3;
        texel[0] = radiance[k].x, texel[1] = radiance[k].y, texel[2] = radiance[k].z;
      }
    }
  });
  return map;
}

/// Root mean square over the sphere by which a map, interpolated, differs from one of twice its width, as part of that one's
/// mean.
float difference(const EnvironmentMap& coarse, const EnvironmentMap& fine)
{
  std::vector<double> squares(static_cast<std::size_t>(fine.height)), sums(squares.size()), weights(squares.size());
  for_each_in_parallel(squares.size(), [&](std::size_t y) {
    // A finer texel's centre lies a quarter from the nearest coarse centre.
    const int y_near = static_cast<int>(y / 2);
    const int y_far = std::clamp(y_near + (y % 2 == 0 ? -1 : 1), 0, coarse.height - 1);
    double square = 0, sum = 0;
    for (int x = 0; x < fine.width; ++x) {
      const int x_near = x / 2;
      const int x_far = (x_near + (x % 2 == 0 ? -1 : 1) + coarse.width) % coarse.width;
      const auto at = [&](int column, int line, int c) {
        return coarse.rgb[(static_cast<std::size_t>(line) * static_cast<std::size_t>(coarse.width) +
                           static_cast<std::size_t>(column)) *
                              3 +
                          static_cast<std::size_t>(c)];
      };
      for (int c = 0; c < 3; ++c) {
        const float near = 0.75f * at(x_near, y_near, c) + 0.25f * at(x_far, y_near, c);
        const float far = 0.75f * at(x_near, y_far, c) + 0.25f * at(x_far, y_far, c);
        const double value = fine.rgb[(y * static_cast<std::size_t>(fine.width) + static_cast<std::size_t>(x)) * 3 +
                                      static_cast<std::size_t>(c)];
        const double error = 0.75 * static_cast<double>(near) + 0.25 * static_cast<double>(far) - value;
        square += error * error;
        sum += value;
      }
    }
    const double weight = std::sin((static_cast<double>(y) + 0.5) * 3.141592653589793 / fine.height);
    squares[y] = weight * square;
    sums[y] = weight * sum;
    weights[y] = weight * 3 * fine.width;
  });
  double square = 0, sum = 0, weight = 0;
  for (std::size_t y = 0; y < squares.size(); ++y) {
    square += squares[y];
    sum += sums[y];
    weight += weights[y];
  }
  return sum > 0 ? static_cast<float>(std::sqrt(square / weight) / (sum / weight)) : 0.0f;
}

float luminance_of(const float* texel) { return 0.2126f * texel[0] + 0.7152f * texel[1] + 0.0722f * texel[2]; }

/// What of a texel a sun is looked for in, besides its radius.
float sun_margin(const EnvironmentMap& map) { return 2 * kPiAngle / static_cast<float>(map.height); }

/// Samples on each axis that a texel's mean takes: a dozen along the radius of a sun, and 16 where there is none.
int samples_within(const EnvironmentGraph& graph, const EnvironmentMap& map, int x, int y)
{
  constexpr int kLeast = 16, kMost = 512;
  const float texel = kPiAngle / static_cast<float>(map.height);
  const Vec3f d = direction_at(map, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
  int side = kLeast;
  for (const GraphSun& sun : graph.suns) {
    if (!(length(d - sun.towards) < sun.radius + sun_margin(map))) continue;
    side = std::max(side, static_cast<int>(std::fmin(12 * texel / sun.radius, static_cast<float>(kMost))));
  }
  return (side + 7) / 8 * 8;
}

/// Mean radiance over a texel.
/// @param side  samples on each axis, a multiple of 8
Vec3f mean_within(const EnvironmentGraph& graph,
                  const TextureView* textures,
                  const EnvironmentMap& map,
                  int x,
                  int y,
                  int side)
{
  const auto samples = static_cast<float>(side);
  Vec3f sum;
  float weights = 0;
  for (int row = 0; row < side; ++row) {
    const float v = static_cast<float>(y) + (static_cast<float>(row) + 0.5f) / samples;
    const float weight = std::sin(v * kPiAngle / static_cast<float>(map.height));
    for (int column = 0; column < side; column += 8) {
      Vec3f directions[8], radiance[8];
      for (int k = 0; k < 8; ++k) {
        directions[k] = direction_at(map, static_cast<float>(x) + (static_cast<float>(column + k) + 0.5f) / samples, v);
      }
      evaluate(graph, textures, directions, radiance);
      for (const Vec3f& r : radiance) sum += r * weight;
      weights += 8 * weight;
    }
  }
  return sum * (1 / weights);
}

/// Texels whose centres do not tell what they hold: at a sun, and at the rims of whatever is bright and small.
std::vector<std::size_t> coarse_texels(const EnvironmentGraph& graph, const EnvironmentMap& map)
{
  constexpr float kBright = 8, kContrast = 2;  // times the mean, and times a neighbour
  const auto width = static_cast<std::size_t>(map.width), height = static_cast<std::size_t>(map.height);
  std::vector<float> bright(width * height);
  std::vector<double> sums(height), weights(height);
  for_each_in_parallel(height, [&](std::size_t y) {
    for (std::size_t x = 0; x < width; ++x) {
      bright[y * width + x] = luminance_of(&map.rgb[(y * width + x) * 3]);
      sums[y] += bright[y * width + x];
    }
    weights[y] = std::sin((static_cast<double>(y) + 0.5) * 3.141592653589793 / map.height);
    sums[y] *= weights[y];
  });
  double sum = 0, weight = 0;
  for (std::size_t y = 0; y < height; ++y) {
    sum += sums[y];
    weight += weights[y] * map.width;
  }
  const float enough = kBright * static_cast<float>(sum / weight);
  const float margin = sun_margin(map);
  std::vector<std::vector<std::size_t>> found(height);
  for_each_in_parallel(height, [&](std::size_t y) {
    for (std::size_t x = 0; x < width; ++x) {
      float low = bright[y * width + x], high = low;
      for (std::size_t line = y > 0 ? y - 1 : 0; line <= std::min(y + 1, height - 1); ++line) {
        for (const std::size_t column : {(x + width - 1) % width, x, (x + 1) % width}) {
          low = std::min(low, bright[line * width + column]);
          high = std::max(high, bright[line * width + column]);
        }
      }
      bool is_coarse = high > enough && high > kContrast * low;
      for (const GraphSun& sun : graph.suns) {
        const Vec3f d = direction_at(map, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
        is_coarse = is_coarse || length(d - sun.towards) < sun.radius + margin;
      }
      if (is_coarse) found[y].push_back(y * width + x);
    }
  });
  std::vector<std::size_t> all;
  for (const auto& row : found) all.insert(all.end(), row.begin(), row.end());
  return all;
}

void refine(const EnvironmentGraph& graph, std::span<const TextureView> textures, EnvironmentMap& map)
{
  const std::vector<std::size_t> texels = coarse_texels(graph, map);
  for_each_in_parallel(texels.size(), [&](std::size_t i) {
    const int x = static_cast<int>(texels[i]) % map.width, y = static_cast<int>(texels[i]) / map.width;
    const Vec3f mean = mean_within(graph, textures.data(), map, x, y, samples_within(graph, map, x, y));
    float* texel = &map.rgb[texels[i] * 3];
    texel[0] = mean.x, texel[1] = mean.y, texel[2] = mean.z;
  });
}

/// The map before suns are looked for.
EnvironmentMap bake_plainly(const EnvironmentGraph& graph, std::span<const TextureView> textures)
{
  if (graph.width > 0) return bake(graph, textures, graph.width);
  constexpr float kTolerance = 0.002f;
  // A sun is sharp, whether or not the texels' centres meet it.
  if (!graph.suns.empty()) return bake(graph, textures, kMostEnvironmentWidth);
  EnvironmentMap map = bake(graph, textures, kLeastEnvironmentWidth);
  while (map.width < kMostEnvironmentWidth) {
    EnvironmentMap finer = bake(graph, textures, 2 * map.width);
    if (difference(map, finer) < kTolerance) break;
    map = std::move(finer);
  }
  return map;
}

}  // namespace

EnvironmentMap environment_graph_bake(const EnvironmentGraph& graph, std::span<const TextureView> textures)
{
  EnvironmentMap map = bake_plainly(graph, textures);
  refine(graph, textures, map);
  return map;
}

}  // namespace relief
