#include "benchmarks/procedural/worlds.h"

#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "kernel/graph/noise.h"
#include "scene/graph/graph_builder.h"
#include "scene/texture_store.h"

namespace relief {

namespace {

constexpr WorldSpec::Case kPotCases[] = {{{64, 0}, 1, 1}, {{128, 0}, 1, 1}, {{0, 0}, 1, 1}};
// With N = 4096 everywhere nearly every ray needs tiles of its own, and takes a millisecond.
constexpr WorldSpec::Case kTerrainCases[] = {{{0, 0.01}, 1, 1},
                                             {{0, 0}, 1, 1},
                                             {{0, 0}, 1, 1, 4},
                                             {{0, 0}, 2, 1},
                                             {{4096, 0}, 1, 12}};
constexpr WorldSpec::Case kPlanetCases[] = {{{0, 0}, 1, 1}, {{0, 0}, 2, 1}, {{4096, 0}, 1, 12}, {{4096, 0}, 2, 12}};

constexpr WorldSpec kWorlds[] = {
    {"pot", "Pot", 640, 480, {24, 256, 4, 640, 480, "80", "not said"}, kPotCases},
    {"terrain", "Terrain", 1200, 900, {43, 36, 2, 1200, 900, "up to 3162", "about 10 MB"}, kTerrainCases},
    {"planet", "Planet", 1920, 1080, {}, kPlanetCases},
};

/// Puts graphs of heights over object space together.
class Heights {
 public:
  GraphScalar number(float a) { return build_.constant(a); }
  GraphScalar add(GraphScalar a, GraphScalar b) { return build_(GraphOp::add, {a, b}); }
  GraphScalar multiply(GraphScalar a, GraphScalar b) { return build_(GraphOp::multiply, {a, b}); }
  GraphScalar scaled(GraphScalar a, float s) { return multiply(a, number(s)); }
  GraphScalar sine(GraphScalar a) { return build_(GraphOp::sine, {a}); }
  GraphScalar absolute(GraphScalar a) { return build_(GraphOp::absolute, {a}); }
  GraphScalar coordinate(int axis)
  {
    constexpr GraphQuantity kAxes[] = {GraphQuantity::object_x, GraphQuantity::object_y, GraphQuantity::object_z};
    return build_.quantity(kAxes[axis]);
  }
  /// Octaves of noise in 0…1.
  /// @param size  metres of the first
  GraphScalar noise(float size, int octaves, float roughness)
  {
    std::vector<GraphScalar> in;
    for (int axis = 0; axis < 3; ++axis) in.push_back(scaled(coordinate(axis), 1 / size));
    in.insert(in.end(), {number(static_cast<float>(octaves - 1)), number(roughness), number(2)});
    constexpr std::uint16_t kNormalized[] = {1, 1};
    return build_.apply(GraphOp::noise_3d, in, kNormalized)[0];
  }
  GraphProgram program(GraphScalar height)
  {
    build_.add_result(height);
    return build_.compile();
  }

 private:
  GraphBuilder build_;
};

/// Grooves around, of a wavering hand, in rough clay.
GraphProgram pot_heights()
{
  Heights h;
  // Of object space Y is up, here as in files; graphs have Z up.
  const GraphScalar up = h.add(h.scaled(h.coordinate(2), 60), h.scaled(h.noise(0.4f, 3, 0.5f), 12));
  const GraphScalar grooves = h.add(h.scaled(h.sine(up), 0.5f), h.number(0.5f));
  return h.program(h.add(h.scaled(grooves, 0.6f), h.scaled(h.noise(0.06f, 8, 0.6f), 0.4f)));
}

/// Several uses of noise, metres: bumps of the ground, ridges of rock in places, and grit.
GraphProgram terrain_heights()
{
  Heights h;
  const GraphScalar ground = h.scaled(h.noise(40, 10, 0.5f), 8);
  const GraphScalar signed_noise = h.add(h.scaled(h.noise(7, 8, 0.55f), 2), h.number(-1));
  const GraphScalar ridges = h.add(h.number(1), h.scaled(h.absolute(signed_noise), -1));
  const GraphScalar rock = h.multiply(h.scaled(ridges, 2), h.noise(90, 3, 0.5f));
  return h.program(h.add(h.add(ground, rock), h.scaled(h.noise(0.5f, 6, 0.55f), 0.08f)));
}

GraphProgram planet_heights()
{
  Heights h;
  return h.program(h.noise(0.7f, 12, 0.55f));
}

/// Points in rows; neighbours make two triangles.
/// @param closed  the last column is the first
template <class Point>
Mesh grid(int columns, int rows, bool closed, const Point& point)
{
  Mesh mesh;
  const int num_across = closed ? columns : columns + 1;
  for (int r = 0; r <= rows; ++r) {
    for (int c = 0; c < num_across; ++c) {
      const auto [P, N] = point(c, r);
      mesh.P.push_back(P);
      mesh.N.push_back(as_normal(normalize(N)));
    }
  }
  const auto at = [&](int c, int r) { return static_cast<std::uint32_t>(r * num_across + c % num_across); };
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      mesh.triangles.push_back({at(c, r), at(c, r + 1), at(c + 1, r)});
      mesh.triangles.push_back({at(c + 1, r), at(c, r + 1), at(c + 1, r + 1)});
    }
  }
  return mesh;
}

struct PointAndNormal {
  Vec3f P, N;
};

Vec3f around(float radius, float height, float angle)
{
  return {radius * std::cos(angle), height, -radius * std::sin(angle)};
}

/// Turned on a wheel: up on the outside, over the lip and down inside. 4,680 triangles.
Mesh pot_mesh()
{
  constexpr int kColumns = 60, kRows = 39;
  constexpr float kProfile[][2] = {{0.30f, 0},    {0.36f, 0.02f}, {0.62f, 0.35f}, {0.86f, 0.75f}, {0.92f, 1.1f},
                                   {0.78f, 1.5f}, {0.5f, 1.75f},  {0.43f, 1.9f},  {0.55f, 2.08f}, {0.62f, 2.12f},
                                   {0.56f, 2.1f}, {0.36f, 1.9f},  {0.42f, 1.72f}, {0.68f, 1.45f}, {0.8f, 1.1f},
                                   {0.7f, 0.75f}, {0.4f, 0.3f},   {0.05f, 0.12f}};
  constexpr int kLast = static_cast<int>(std::size(kProfile)) - 1;
  // Catmull and Rom's spline.
  const auto profile = [&](double t, int axis) {
    const int k = std::clamp(static_cast<int>(std::floor(t)), 0, kLast - 1);
    const auto at = [&](int i) { return static_cast<double>(kProfile[std::clamp(k + i, 0, kLast)][axis]); };
    const double x = t - k, m1 = 0.5 * (at(1) - at(-1)), m2 = 0.5 * (at(2) - at(0));
    return at(0) + x * (m1 + x * (3 * (at(1) - at(0)) - 2 * m1 - m2 + x * (2 * (at(0) - at(1)) + m1 + m2)));
  };
  Mesh mesh = grid(kColumns, kRows, true, [&](int c, int r) -> PointAndNormal {
    const double t = static_cast<double>(r) * kLast / kRows, step = 0.05;
    const double dr = profile(std::min<double>(t + step, kLast), 0) - profile(std::max(t - step, 0.0), 0);
    const double dy = profile(std::min<double>(t + step, kLast), 1) - profile(std::max(t - step, 0.0), 1);
    const auto angle = static_cast<float>(2 * M_PI * c / kColumns);
    const Vec3f P = around(static_cast<float>(profile(t, 0)), static_cast<float>(profile(t, 1)), angle);
    return {P, around(static_cast<float>(dy), static_cast<float>(-dr), angle)};
  });
  for (TriangleIndices& t : mesh.triangles) std::swap(t.v1, t.v2);
  return mesh;
}

/// Mountains of 30 metre cells, as in the paper 110,000 triangles.
Mesh terrain_mesh(int divisor)
{
  const int columns = 235 / divisor, rows = 234 / divisor;
  constexpr float kCell = 30;
  const auto height = [](float x, float z) {
    const F8 p[2] = {splat8(x / 2500), splat8(z / 2500)};
    const NoiseOctaves octaves{splat8(6.0f), splat8(0.45f), splat8(2.0f)};
    return 1400 * noise_fractal<2>(p, octaves, true, true)[0];
  };
  return grid(columns, rows, false, [&](int c, int r) -> PointAndNormal {
    const float x = kCell * static_cast<float>(c - columns / 2), z = kCell * static_cast<float>(r - rows / 2);
    const float dx = height(x + kCell, z) - height(x - kCell, z), dz = height(x, z + kCell) - height(x, z - kCell);
    return {{x, height(x, z), z}, {-dx, 2 * kCell, -dz}};
  });
}

/// A ball of 960 triangles.
Mesh planet_mesh()
{
  constexpr int kColumns = 32, kRows = 16;
  Mesh mesh = grid(kColumns, kRows, true, [](int c, int r) -> PointAndNormal {
    const auto theta = static_cast<float>(M_PI * r / kRows), angle = static_cast<float>(2 * M_PI * c / kColumns);
    // The poles are points.
    const float radius = r == 0 || r == kRows ? 0.0f : std::sin(theta);
    const Vec3f P = around(radius, r == kRows ? -1.0f : std::cos(theta), angle);
    return {P, P};
  });
  std::erase_if(mesh.triangles, [&](const TriangleIndices& t) {
    const Vec3f a = mesh.P[t.v0], b = mesh.P[t.v1], c = mesh.P[t.v2];
    return a == b || b == c || c == a;
  });
  return mesh;
}

}  // namespace

std::span<const WorldSpec> world_specs() { return kWorlds; }

Camera world_camera(Vec3f eye, Vec3f at, float half_height, double aspect)
{
  Camera camera;
  const Vec3f z = normalize(eye - at), x = normalize(cross(Vec3f{0, 1, 0}, z));
  camera.world_from_camera = {x, cross(z, x), z, eye};
  camera.half_height = half_height;
  camera.half_width = static_cast<float>(half_height * aspect);
  return camera;
}

World world_make(const WorldSpec& spec, int mesh_divisor)
{
  World world;
  world.spec = &spec;
  Scene& scene = world.scene;
  scene.file = spec.name;
  DisplacementSettings settings;
  settings.graph_index = 0;
  settings.has_graph = true;
  const double aspect = static_cast<double>(spec.width) / spec.height;
  SceneCamera camera;
  if (spec.name == "pot") {
    scene.meshes.push_back(pot_mesh());
    scene.graphs.push_back(pot_heights());
    settings.scale = 0.05f;
    camera.camera = world_camera({0, 3.6f, 5.2f}, {0, 1.08f, 0}, 0.225f, aspect);
  } else if (spec.name == "terrain") {
    scene.meshes.push_back(terrain_mesh(mesh_divisor));
    scene.graphs.push_back(terrain_heights());
    settings.midlevel = 5;
    world.eye_height = 1.7f;
    camera.camera = world_camera({0, 0, 0}, {0.35f, -0.25f, -1}, 0.5f, aspect);
  } else {
    scene.meshes.push_back(planet_mesh());
    scene.graphs.push_back(planet_heights());
    settings.scale = 0.3f;
    camera.camera = world_camera({0.6f, 0.9f, 2.9f}, {0, 0, 0}, 0.38f, aspect);
  }
  scene.displacements.push_back(settings);
  Material material;
  material.displacement_index = 0;
  scene.materials.push_back(material);
  scene.material_names.emplace_back(spec.name);
  scene.instances.emplace_back();
  scene.cameras.push_back(camera);
  scene.render.width = spec.width;
  scene.render.height = spec.height;
  Warnings warnings;
  scene.textures = std::make_shared<TextureStore>(std::vector<TextureRequest>{}, 0, warnings);
  return world;
}

}  // namespace relief
