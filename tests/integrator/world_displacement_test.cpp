// Displacement that is measured in the world: along the world's normal, by the world's metres, whatever the transform.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "scene/load.h"
#include "scene/world_displacement.h"
#include "tests/support/displacement_methods.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

using Vec = std::array<double, 3>;

Vec vec(Vec3f v) { return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)}; }

/// Solves [x y z]ᵀ n' = n by Cramer's rule: the inverse transpose of a map applied to a normal, then of length one.
Vec world_normal(const Affine3& m, Vec n)
{
  const Vec rows[3] = {vec(m.x), vec(m.y), vec(m.z)};
  const auto det = [](Vec a, Vec b, Vec c) {
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  };
  const Vec columns[3] = {
      {rows[0][0], rows[1][0], rows[2][0]}, {rows[0][1], rows[1][1], rows[2][1]}, {rows[0][2], rows[1][2], rows[2][2]}};
  const double d = det(columns[0], columns[1], columns[2]);
  Vec out{det(n, columns[1], columns[2]) / d, det(columns[0], n, columns[2]) / d, det(columns[0], columns[1], n) / d};
  const double length = std::hypot(out[0], out[1], out[2]);
  for (double& c : out) c /= length;
  return out;
}

/// A sphere displaced by 0.2 m of the world everywhere.
Scene sphere_in_world_space(const Affine3& placed, DisplacementMethod method)
{
  constexpr int kSize = 8;
  Scene scene = empty_scene();
  Mesh sphere = sphere_mesh(1, 24, 12, true);
  sphere.uv[0].assign(sphere.P.size(), {});
  for (std::size_t i = 0; i < sphere.P.size(); ++i) sphere.uv[0][i] = {sphere.P[i].x, sphere.P[i].y};
  Material material = diffuse_material({0.6f, 0.6f, 0.6f});
  material.displacement_index = 0;
  add_object(scene, sphere, material, placed);
  DisplacementSettings& settings =
      add_displacement(scene, kSize, std::vector<std::uint16_t>(kSize * kSize, 65535), 0.4f);
  settings.method = method;
  settings.space = DisplacementSpace::kWorld;
  world_displacement_bake(scene);
  return scene;
}

std::vector<Affine3> random_maps(int count)
{
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  const auto axis = [&] { return Vec3f{normal(random), normal(random), normal(random)}; };
  std::vector<Affine3> maps;
  while (static_cast<int>(maps.size()) < count) {
    const Affine3 m{axis(), axis(), axis(), axis()};
    if (std::abs(determinant(m)) > 0.2f) maps.push_back(m);
  }
  return maps;
}

class WorldDisplacement : public testing::TestWithParam<DisplacementMethod> {};

TEST_P(WorldDisplacement, MovesAlongTheWorldsNormalByItsMetres)
{
  std::vector<Affine3> maps = random_maps(6);
  maps.push_back({{1, 0, 0}, {0, 1, 0}, {0, 0, 0.1f}, {}});       // flattened
  maps.push_back({{-3, 0, 0}, {0, 1, 0}, {0, 0, 1}, {5, 0, 0}});  // mirrored
  maps.push_back({{0, 2, 0}, {-2, 0, 0}, {0, 0, 2}, {0, 1, 0}});  // a similarity
  maps.push_back({{1, 0, 0}, {0, -1, 0}, {0, 0, 1}, {0, 1, 0}});  // one that mirrors
  for (const Affine3& m : maps) {
    const Scene scene = sphere_in_world_space(m, GetParam());
    const SceneContext context(scene, {});
    const Mesh& original = scene.meshes[0];
    std::mt19937 random(5);
    std::uniform_real_distribution<float> uniform(-1, 1);
    std::vector<TraceRay> rays;
    for (int k = 0; k < 2000; ++k) {
      const Vec3f away{uniform(random), uniform(random), uniform(random)};
      const Vec3f O = m.p + 20.0f * normalize(away);
      const Vec3f target = transform_point(m, 0.5f * Vec3f{uniform(random), uniform(random), uniform(random)});
      rays.push_back({O, target - O, 0, kInfinity});
    }
    const std::vector<TraceHit> hits = trace_rays(context, rays);
    for (const TraceHit& hit : hits) {
      // They are aimed at the inside.
      ASSERT_TRUE(hit.hit);
      EXPECT_EQ(hit.mesh_index, 0) << "the file's mesh";
      const TriangleIndices tri = original.triangles[hit.triangle_index];
      const double w[3] = {1.0 - static_cast<double>(hit.u) - static_cast<double>(hit.v), static_cast<double>(hit.u),
                           static_cast<double>(hit.v)};
      const std::uint32_t corners[3] = {tri.v0, tri.v1, tri.v2};
      Vec P{}, N{};
      for (int k = 0; k < 3; ++k) {
        const Vec p = vec(original.P[corners[k]]), n = vec(as_vector(original.N[corners[k]]));
        for (std::size_t axis = 0; axis < 3; ++axis) {
          P[axis] += w[k] * p[axis];
          N[axis] += w[k] * n[axis];
        }
      }
      const Vec x = vec(m.x), y = vec(m.y), z = vec(m.z), p = vec(m.p), along = world_normal(m, N), found = vec(hit.P);
      double error = 0, side = 0;
      const Vec Ng = vec(hit.Ng);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double expected = x[axis] * P[0] + y[axis] * P[1] + z[axis] * P[2] + p[axis] + 0.2 * along[axis];
        error = std::max(error, std::abs(found[axis] - expected));
        side += Ng[axis] * along[axis];
      }
      EXPECT_LT(error, 2e-5);
      EXPECT_GT(side, 0.3) << "the normal is on the side of the displacement";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, WorldDisplacement, testing::ValuesIn(traversing_methods()), method_test_name);

TEST(WorldDisplacementMeshes, AreSharedUnderOneMapAndUnderSimilarities)
{
  Scene scene = sphere_in_world_space({{1, 0, 0}, {0, 1, 0}, {0, 0, 3}, {}}, DisplacementMethod::chord);
  ASSERT_EQ(scene.meshes.size(), 2u);
  const Instance placed = scene.instances[0];
  EXPECT_EQ(placed.mesh_index, 1);
  for (const float at : {3.0f, 6.0f, 9.0f}) {
    for (const bool uneven : {true, false}) {
      Instance copy = placed;
      copy.mesh_index = 0;
      copy.world_from_object = {{1, 0, 0}, {0, 1, 0}, {0, 0, uneven ? 3.0f : 1.0f}, {at, 0, 0}};
      scene.instances.push_back(copy);
    }
  }
  world_displacement_bake(scene);
  EXPECT_EQ(scene.meshes.size(), 3u) << "one more: the mesh of the first was made before";
  EXPECT_EQ(scene.instances[1].mesh_index, 2);
  EXPECT_EQ(scene.instances[3].mesh_index, 2);
  EXPECT_EQ(scene.instances[2].mesh_index, 0);
}

/// Scales whose squares single precision does not hold, along one axis or all: normals point where the map says.
TEST(WorldDisplacementMeshes, NormalsOfTheFlattestMapsAreFinite)
{
  const std::array<Affine3, 5> maps{{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1e-24f}, {}},
                                     {{1, 0, 0}, {0, 1, 0}, {0, 0, -1e-24f}, {}},
                                     {{1e-24f, 0, 0}, {0, 1e-24f, 0}, {0, 0, 1}, {}},
                                     {{-1e-14f, 0, 0}, {0, 1e-14f, 0}, {0, 0, 2e-14f}, {}},
                                     {{1e18f, 0, 0}, {0, 2e18f, 0}, {0, 0, 3e18f}, {}}}};
  for (const Affine3& m : maps) {
    SCOPED_TRACE(testing::Message() << m.x.x << ' ' << m.y.y << ' ' << m.z.z);
    const Scene scene = sphere_in_world_space(m, DisplacementMethod::chord);
    const Instance& instance = scene.instances[0];
    ASSERT_EQ(instance.mesh_index, 1);
    const float sign = instance.world_from_object.x.x;
    for (std::size_t i = 0; i < scene.meshes[0].N.size(); ++i) {
      const Vec expected = world_normal(m, vec(as_vector(scene.meshes[0].N[i])));
      const Vec N = vec(as_vector(scene.meshes[1].N[i]));
      const double length = std::hypot(N[0], N[1], N[2]);
      ASSERT_TRUE(std::isfinite(length));
      ASSERT_GT(length, 0);
      for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_NEAR(sign * N[axis] / length, expected[axis], 1e-6);
    }
  }
}

/// A sphere the size of nothing, whose volume single precision does not hold: what is seen is the displacement.
TEST(WorldDisplacementOfTheSmallest, IsItsMetres)
{
  constexpr float kScale = 1e-15f;
  const Scene scene =
      sphere_in_world_space({{kScale, 0, 0}, {0, kScale, 0}, {0, 0, kScale}, {}}, DisplacementMethod::chord);
  const SceneContext context(scene, {});
  const TraceRay ray{{0.1f, 0.05f, 5}, {-0.1f, -0.05f, -5}, 0, kInfinity};
  const std::vector<TraceHit> hits = trace_rays(context, {&ray, 1});
  ASSERT_TRUE(hits[0].hit);
  EXPECT_NEAR(length(hits[0].P), 0.2, 0.2 * 1e-5);
}

/// A file's square of one metre under a scale of (1, 1, 4): half a metre is half a metre.
TEST(WorldDisplacementOfAFile, IsHalfAMetreUnderAnUnevenScale)
{
  GltfBuilder b = square_scene();
  b.json["images"] = {{{"uri", kGreyPixelPng}}};
  b.json["textures"] = {{{"source", 0}}};
  b.json["materials"] = {
      {{"extensions",
        {{"RELIEF_displacement",
          {{"heightTexture", {{"index", 0}}}, {"scale", 0.5}, {"midlevel", 128.0 / 255 - 1}, {"space", "world"}}}}}}};
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  b.json["nodes"][0]["scale"] = {1, 1, 4};
  const TemporaryFolder folder;
  const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
  const SceneContext context(scene, {});
  const TraceRay ray{{0.3f, 0.2f, 5}, {0, 0, -1}, 0, kInfinity};
  const std::vector<TraceHit> hits = trace_rays(context, {&ray, 1});
  ASSERT_TRUE(hits[0].hit);
  EXPECT_NEAR(hits[0].P.z, 0.5, 1e-6);
}

}  // namespace
}  // namespace relief::test
