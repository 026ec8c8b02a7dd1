#include "integrator/emitter_graph.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "kernel/graph/graph_material.h"
#include "kernel/shape/material_lookup.h"

namespace relief {
namespace {

/// The ray that means are of: direct light from a metre away.
constexpr GraphRay kSomeRay{0, 1, 0, 1.0f};

/// A point of an emitter and what a graph reads there.
struct MeshPoint {
  MeshPoint(const KernelGlobals& g, const InstanceView& at, std::uint32_t at_triangle, Vec2f barycentric)
      : mesh(g.meshes[at.mesh_index]),
        instance(at),
        triangle(at_triangle),
        b(barycentric),
        hit(surface_hit_make(mesh, at, at_triangle, barycentric.x, barycentric.y))
  {
  }

  /// @param wo  unit, from the emitter
  GraphPoint graph_point(const KernelGlobals& g, Vec3f wo, const GraphRay& ray) const
  {
    return {{&mesh, triangle, b.x, b.y}, &instance, &hit, wo, {0.0f, 0.0f}, 0.0f, &g.graph_scene, ray};
  }

  const MeshView& mesh;
  const InstanceView& instance;
  std::uint32_t triangle;
  Vec2f b;
  SurfaceHit hit;
};

/// What a graph may read at a point of a lamp.
struct LampPoint {
  LampPoint(const KernelGlobals& g, const Light& light, const EmitterPoint& at)
      : lamp(g.lamps[light.lamp_index]), scene(&g.graph_scene), wo(at.wo), ray(at.ray)
  {
    // The square of a sun's distance has to be a number.
    constexpr float kFarthest = 1e18f;
    ray.length = min(ray.length, kFarthest);
    const LightPlace place = light_place(light, at.P, wo);
    hit.P = place.P;
    hit.Ng = hit.Ns = place.N;
    const Vec2f uv = light_uv(light, lamp.node.object_from_world, place, wo);
    hit.uv[0] = hit.uv[1] = {uv.x, 1.0f - uv.y};
    hit.color = {0, 0, 0, 1};
  }

  /// Writes a lane of a program's inputs. What would be read a footprint away is read here: bumps are flat.
  void load(const GraphProgramView& program, int lane, GraphRegisters& registers) const
  {
    GraphPoint point{{}, &lamp.node, &hit, wo, {0.0f, 0.0f}, 0.0f, scene, ray};
    point.P_object = transform_point(lamp.node.object_from_world, hit.P);
    for (std::uint32_t i = 0; i < program.num_inputs; ++i) {
      const GraphInput& input = program.inputs[i];
      registers.lanes[input.register_index][lane] = graph_quantity(point, input.quantity, input.index);
    }
  }

  const Lamp& lamp;
  const GraphScene* scene;
  Vec3f wo;
  GraphRay ray;
  SurfaceHit hit;
};

/// What a lamp's program, which has run, gives; what is no number is 0.
Vec3f lamp_factor(const GraphLane& lane)
{
  const auto result = [&lane](int i) {
    const float value = graph_result(lane, i);
    return is_finite(value) ? value : 0.0f;
  };
  return {result(0), result(1), result(2)};
}

/// @param lane  of the material's emission program, which has run
Vec3f radiance_of(const KernelGlobals& g, const Material& material, const GraphLane& lane, const MeshPoint& point)
{
  if (material.has_closures) {
    return triangle_emission(material, g.textures, point.mesh, point.triangle, point.b) + closures_emission(lane);
  }
  constexpr float kFinest[2] = {0.0f, 0.0f};
  const SurfaceParams p = graph_surface_params<kFeatureTextures | kFeatureTransparency>(material, graph_values(lane),
                                                                                        g.textures, point.hit, kFinest);
  return p.emission * p.alpha;
}

}  // namespace

bool emitter_graph_asks_for_path(const GraphProgramView& program)
{
  return std::any_of(program.inputs, program.inputs + program.num_inputs, [](const GraphInput& input) {
    return input.quantity == GraphQuantity::ray_length || input.quantity == GraphQuantity::ray_depth;
  });
}

Vec3f emitter_graph_radiance(const KernelGlobals& g, const Light& emitter, const EmitterPoint& at)
{
  if (emitter.instance_index < 0) {
    const GraphProgramView& program = g.graphs[g.lamps[emitter.lamp_index].graph_index];
    GraphRegisters registers;
    const LampPoint point(g, emitter, at);
    point.load(program, 0, registers);
    registers.used = 1;
    g.run_graph(program, g.textures, registers);
    return lamp_factor({&program, &registers, 0}) * emitter.lamp_scale;
  }
  const InstanceView& instance = g.instances[emitter.instance_index];
  const Material& material = g.materials[instance.material_index];
  const MeshPoint point(g, instance, static_cast<std::uint32_t>(emitter.triangle_index), at.barycentric);
  GraphRegisters registers;
  const GraphLane lane = graph_at_point(g.run_graph, g.graphs[material.emission_index], g.textures,
                                        point.graph_point(g, at.wo, at.ray), registers);
  return radiance_of(g, material, lane, point);
}

void emitter_graph_means(const KernelGlobals& g, std::size_t instance_index, std::span<Vec3f> means)
{
  constexpr int kPoints = 8;
  // The middles of the triangle, of its quarters and of some of theirs.
  constexpr float kPlaces[kPoints][2] = {{1 / 3.0f, 1 / 3.0f},   {2 / 3.0f, 1 / 6.0f},   {1 / 6.0f, 2 / 3.0f},
                                         {1 / 6.0f, 1 / 6.0f},   {1 / 12.0f, 5 / 12.0f}, {5 / 12.0f, 1 / 12.0f},
                                         {5 / 12.0f, 5 / 12.0f}, {5 / 6.0f, 1 / 12.0f}};
  const InstanceView& instance = g.instances[instance_index];
  const Material& material = g.materials[instance.material_index];
  const GraphProgramView& program = g.graphs[material.emission_index];
  tbb::parallel_for(std::size_t{0}, means.size(), [&](std::size_t triangle) {
    GraphRegisters registers;
    const auto point_of = [&](int i) {
      return MeshPoint(g, instance, static_cast<std::uint32_t>(triangle), {kPlaces[i][0], kPlaces[i][1]});
    };
    for (int i = 0; i < kPoints; ++i) {
      const MeshPoint point = point_of(i);
      graph_load_point(program, point.graph_point(g, point.hit.Ng, kSomeRay), i, registers);
    }
    g.run_graph(program, g.textures, registers);
    Vec3f sum;
    for (int i = 0; i < kPoints; ++i) sum += abs(radiance_of(g, material, {&program, &registers, i}, point_of(i)));
    means[triangle] = is_finite(sum) ? sum * (1.0f / kPoints) : Vec3f{};
  });
  Vec3f all;
  for (const Vec3f& mean : means) all += mean * (1.0f / static_cast<float>(means.size()));
  for (Vec3f& mean : means) {
    if (is_zero(mean)) mean = all * 0.01f;
  }
}

float emitter_graph_lamp_mean(const KernelGlobals& g, const Light& light)
{
  constexpr std::uint32_t kSamples = 512;
  const GraphProgramView& program = g.graphs[g.lamps[light.lamp_index].graph_index];
  GraphRegisters registers;
  double sum = 0, weights = 0;
  for (std::uint32_t i = 0; i < kSamples; i += 8) {
    float weight[8];
    for (int k = 0; k < 8; ++k) {
      const std::uint32_t index = i + static_cast<std::uint32_t>(k);
      const LightRay ray = light_emit(light, sample_2d(0, index, 0), sample_2d(0, index, 2), (index & 1u) != 0);
      weight[k] = ray.weight;
      LampPoint(g, light, {ray.P, {}, ray.wo, kSomeRay}).load(program, k, registers);
    }
    g.run_graph(program, g.textures, registers);
    for (int k = 0; k < 8; ++k) {
      sum += static_cast<double>(weight[k] * light_scalar(lamp_factor({&program, &registers, k})));
      weights += static_cast<double>(weight[k]);
    }
  }
  return weights > 0 ? static_cast<float>(sum / weights) : 0.0f;
}

}  // namespace relief
