#include "benchmarks/displacement/scenes.h"

#include "displacement/vec3d.h"

#include <algorithm>
#include <cmath>
#include <memory>

namespace relief {

namespace {

constexpr double kHalfTurn = 3.141592653589793;

// Quads are about square in texels, so that an even tessellation wastes little. Columns and rows make the paper's
// number of triangles. One line a scene, so that they can be compared:
// clang-format off
constexpr BenchSceneSpec kSpecs[] = {
    {"sphere", "Alien Sphere", BenchShape::kSphere, 19, 25, BenchMap::kDomes, 2048, 6, 8, 0.08,
     {1.2, 0.9, 2.4}, 25, {123, 16, 1.5, 2.0, 1.6, 124, 0.048, 1.3, 30}},
    {"basket", "Basket", BenchShape::kTorus, 49, 49, BenchMap::kWoven, 2048, 5, 5, 0.09,
     {0.3, 2.1, 2.2}, 25, {155, 18, 1.9, 2.5, 2.0, 157, 0.048, 1.3, 30}},
    {"creature", "Creature", BenchShape::kBlob, 163, 163, BenchMap::kHide, 4096, 1, 1, 0.05,
     {1.0, 0.6, 2.6}, 25, {131, 21, 1.9, 3.5, 3.8, 27, 0.012, 1.6, 7.6}},
    {"diving-helmet", "Diving Helmet", BenchShape::kSphere, 36, 36, BenchMap::kPanels, 4096, 1, 1, 0.06,
     {-1.3, 0.7, 2.3}, 25, {43, 11, 1.3, 1.6, 1.7, 21, 0.012, 1.6, 7.6}},
    {"medieval-helmet", "Medieval Helmet", BenchShape::kBlob, 34, 35, BenchMap::kHammered, 2048, 5, 5, 0.05,
     {0.2, 0.5, 2.7}, 25, {45, 11, 1.2, 1.6, 1.3, 74, 0.048, 1.3, 30}},
    {"armor", "Elven Armor", BenchShape::kPlate, 20, 20, BenchMap::kEngraved, 4096, 2, 2, 0.06,
     {0.4, 0.3, 2.4}, 25, {79, 15, 1.1, 1.4, 1.5, 25, 0.012, 1.6, 7.6}},
    {"ninja-head", "Ninja Head", BenchShape::kBlob, 66, 67, BenchMap::kRock, 2048, 5, 5, 0.06,
     {-0.7, 0.4, 2.5}, 25, {226, 39, 2.2, 3.6, 2.7, 70, 0.048, 1.3, 30}},
    {"roof", "Terracotta Roof", BenchShape::kPlane, 8, 8, BenchMap::kRoof, 2048, 2, 2, 0.12,
     {0.4, 1.0, 2.2}, 25, {46, 10, 1.1, 1.6, 1.2, 66, 0.048, 1.3, 30}},
    {"desert-tire", "Desert Tire", BenchShape::kTorus, 67, 67, BenchMap::kDunes, 4096, 25, 25, 0.03,
     {0.6, 1.2, 2.4}, 25, {2948, 284, 5.4, 8.4, 8.8, 6.5, 0.012, 1.6, 7.6}},
    {"glass", "Glass", BenchShape::kGoblet, 33, 34, BenchMap::kWaves, 2048, 1, 1, 0.05,
     {0.5, 0.8, 2.8}, 25, {}},
};
// clang-format on

/// Whether all of the first row is one point, and all of the last.
bool has_poles(BenchShape shape) { return shape == BenchShape::kSphere || shape == BenchShape::kBlob; }

/// A point of a shape; a and b in [0, 1], a around it.
Vec3d shape_point(BenchShape shape, double a, double b)
{
  const double phi = 2 * kHalfTurn * a, theta = kHalfTurn * b;
  switch (shape) {
    case BenchShape::kSphere:
      return {0.9 * std::sin(theta) * std::cos(phi), 0.9 * std::cos(theta), -0.9 * std::sin(theta) * std::sin(phi)};
    case BenchShape::kTorus: {
      const double tube = 2 * kHalfTurn * b, r = 0.72 + 0.32 * std::cos(tube);
      return {r * std::cos(phi), -0.32 * std::sin(tube), -r * std::sin(phi)};
    }
    case BenchShape::kPlane:
      return {2 * a - 1, 0, 2 * b - 1};
    case BenchShape::kPlate: {
      const double bulge = 0.9 - 0.25 * (2 * b - 1) * (2 * b - 1), turn = kHalfTurn * (a - 0.5);
      return {bulge * std::sin(turn), 0.9 * (1 - 2 * b), bulge * std::cos(turn) - 0.4};
    }
    case BenchShape::kBlob: {
      const double r = 0.85 + 0.1 * std::sin(theta) * std::sin(3 * phi) * std::sin(2 * theta) +
                       0.07 * std::sin(theta) * std::cos(2 * phi);
      return {r * std::sin(theta) * std::cos(phi), r * std::cos(theta), -r * std::sin(theta) * std::sin(phi)};
    }
    case BenchShape::kGoblet:
      break;
  }
  const double r = 0.12 + 0.38 * b * b + 0.25 * std::pow(1 - b, 6) + 0.08 * std::sin(3 * kHalfTurn * b);
  return {r * std::cos(phi), 1.8 * b - 0.9, r * std::sin(phi)};
}

Vec3d shape_normal(BenchShape shape, double a, double b)
{
  // A pole has the normal of its surroundings.
  constexpr double kStep = 1e-4;
  if (has_poles(shape) && (b == 0 || b == 1)) return {0, b == 0 ? 1.0 : -1.0, 0};
  const Vec3d da = shape_point(shape, a + kStep, b) - shape_point(shape, a - kStep, b);
  const Vec3d db = shape_point(shape, a, b + kStep) - shape_point(shape, a, b - kStep);
  const Vec3d n = cross(db, da);
  return n * (1 / length(n));
}

bool is_closed_around(BenchShape shape) { return shape != BenchShape::kPlane && shape != BenchShape::kPlate; }

}  // namespace

std::span<const BenchSceneSpec> bench_scene_specs() { return kSpecs; }

MeshView BenchScene::mesh() const
{
  MeshView view;
  view.P = P.data();
  view.N = N.data();
  view.uv[0] = uv.data();
  view.triangles = triangles.data();
  view.num_vertices = static_cast<std::uint32_t>(P.size());
  view.num_triangles = static_cast<std::uint32_t>(triangles.size());
  return view;
}

int BenchScene::map_size() const
{
  return static_cast<int>(std::lround(std::sqrt(static_cast<double>(height_map.width) * height_map.height)));
}

void bench_scene_measure_texels(BenchScene& scene)
{
  double area = 0, texels = 0;
  for (const TriangleIndices& t : scene.triangles) {
    area += length(to_double(cross(scene.P[t.v1] - scene.P[t.v0], scene.P[t.v2] - scene.P[t.v0])));
    const Vec2f u = scene.uv[t.v1] - scene.uv[t.v0], v = scene.uv[t.v2] - scene.uv[t.v0];
    texels += std::abs(static_cast<double>(u.x) * v.y - static_cast<double>(u.y) * v.x) * scene.height_map.width *
              scene.height_map.height;
  }
  scene.texel_metres = std::sqrt(area / texels);
}

BenchScene bench_scene_make(const BenchSceneSpec& spec, const BenchSceneChange& change)
{
  BenchScene scene;
  scene.spec = &spec;
  const int map_size = std::max(4, static_cast<int>(std::lround(spec.map_size * change.map)));
  const auto texels = std::make_shared<const std::vector<std::uint16_t>>(bench_map_make(spec.map, map_size));
  scene.height_map.label = spec.name;
  scene.height_map.width = scene.height_map.height = map_size;
  scene.height_map.texels = std::shared_ptr<const void>(texels, texels->data());
  scene.tiles_u = spec.tiles_u * change.tiling;
  scene.tiles_v = spec.tiles_v * change.tiling;
  scene.scale = spec.scale * change.scale;

  const bool poles = has_poles(spec.shape);
  const bool around = is_closed_around(spec.shape), tube = spec.shape == BenchShape::kTorus;
  // Half a texel, so that vertices on whole texels are at texel centres: what suits a tessellation best.
  const double half_texel = 0.5 / map_size;
  for (int r = 0; r <= spec.rows; ++r) {
    for (int c = 0; c <= spec.columns; ++c) {
      // The ends of a closed surface are the same points, to the last bit.
      const double a = static_cast<double>(around ? c % spec.columns : c) / spec.columns;
      const double b = static_cast<double>(tube ? r % spec.rows : r) / spec.rows;
      const Vec3f N = to_float(shape_normal(spec.shape, a, b));
      scene.P.push_back(to_float(shape_point(spec.shape, poles && (b == 0 || b == 1) ? 0 : a, b)));
      scene.N.push_back({N.x, N.y, N.z});
      scene.uv.push_back({static_cast<float>(scene.tiles_u * c / spec.columns + half_texel),
                          static_cast<float>(scene.tiles_v * r / spec.rows + half_texel)});
    }
  }
  const auto at = [&](int r, int c) { return static_cast<std::uint32_t>(r * (spec.columns + 1) + c); };
  for (int r = 0; r < spec.rows; ++r) {
    for (int c = 0; c < spec.columns; ++c) {
      if (!poles || r > 0) scene.triangles.push_back({at(r, c), at(r + 1, c), at(r, c + 1)});
      if (!poles || r + 1 < spec.rows) scene.triangles.push_back({at(r, c + 1), at(r + 1, c), at(r + 1, c + 1)});
    }
  }
  bench_scene_measure_texels(scene);
  return scene;
}

}  // namespace relief
