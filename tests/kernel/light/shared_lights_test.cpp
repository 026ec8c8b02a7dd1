// Lights that instances of one mesh share, against the same lights written out one by one.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <vector>

#include "integrator/light_set.h"
#include "kernel/shape/surface_hit.h"
#include "tests/kernel/light/light_estimates.h"

namespace relief {
namespace {

/// An octahedron of triangles that face outwards, and a square above it whose two make one light.
Mesh lamp_mesh()
{
  Mesh mesh;
  mesh.P = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -0.5f}};
  mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (const Vec3f P : {Vec3f{-0.5f, -0.5f, 1.5f}, {0.5f, -0.5f, 1.5f}, {0.5f, 0.5f, 1.5f}, {-0.5f, 0.5f, 1.5f}}) {
    mesh.P.push_back(P);
  }
  mesh.triangles.push_back({6, 7, 8});
  mesh.triangles.push_back({6, 8, 9});
  return mesh;
}
constexpr std::size_t kLampTriangles = 10;

/// A turned, scaled and moved place; mirrored now and then.
Affine3 random_similarity(Random& random, double spread)
{
  const Vec3f x = random.direction();
  const Vec3f y = normalize(cross(x, random.direction()));
  const float scale = random.between(0.2, 1.5);
  const float mirror = random.next() < 0.3 ? -1.0f : 1.0f;
  return {x * scale, y * scale, cross(x, y) * (scale * mirror), random.in_cube(spread)};
}

/// Lamps of two brightnesses; every third one of the brighter.
/// @param distinct  every lamp has a mesh of its own, so that none shares its lights
Scene lamps(int count, bool distinct, bool double_sided = false)
{
  Random random{77};
  Scene scene;
  scene.meshes.assign(distinct ? static_cast<std::size_t>(count) : 1u, lamp_mesh());
  scene.materials.resize(2);
  scene.materials[0].emission = {1, 2, 3};
  scene.materials[1].emission = {8, 6, 4};
  scene.materials[0].double_sided = double_sided;
  for (int i = 0; i < count; ++i) {
    Instance instance;
    instance.mesh_index = distinct ? i : 0;
    instance.material_index = i % 3 == 0 ? 1 : 0;
    instance.world_from_object = random_similarity(random, 5);
    if (determinant(instance.world_from_object) < 0.0f) instance.flags |= kMirrored;
    scene.instances.push_back(instance);
  }
  return scene;
}

LightRef light_of(const LightSet& set, std::size_t instance, std::size_t triangle)
{
  return {set.first_light_index[instance] + static_cast<std::int32_t>(triangle), set.light_copy_index[instance]};
}

TEST(SharedLights, AreTheInstancesTriangles)
{
  const int count = 30;
  const Scene shared_scene = lamps(count, false);
  const LightSet shared = light_set_make(shared_scene, {});
  const LightSet distinct = light_set_make(lamps(count, true), {});
  ASSERT_EQ(shared.copies.size(), 30u);
  ASSERT_TRUE(distinct.copies.empty());
  EXPECT_EQ(shared.num_emissive_triangles, distinct.num_emissive_triangles);
  EXPECT_EQ(shared.lights.size(), 2 * kLampTriangles);
  EXPECT_EQ(distinct.lights.size(), 30 * kLampTriangles);
  for (std::size_t i = 0; i < 30; ++i) {
    for (std::size_t t = 0; t < kLampTriangles; ++t) {
      Light storage, storage_of_distinct;
      const Light& a = lights_at(shared.view(), light_of(shared, i, t), storage);
      const Light& b = lights_at(distinct.view(), light_of(distinct, i, t), storage_of_distinct);
      EXPECT_EQ(a.kind, b.kind);
      EXPECT_EQ(a.emission, b.emission);
      EXPECT_EQ(a.instance_index, static_cast<std::int32_t>(i));
      EXPECT_EQ(a.triangle_index, b.triangle_index);
      EXPECT_LT(length(a.P - b.P), 2e-6f);
      EXPECT_LT(length(a.edge_u - b.edge_u) + length(a.edge_v - b.edge_v), 2e-6f);
      EXPECT_LT(length(a.axis - b.axis), 2e-6f);
      EXPECT_NEAR(a.area, b.area, 2e-6f * b.area);
      if (a.kind != LightKind::kTriangle) continue;
      // The same as rays that hit the instance see.
      InstanceView view;
      view.world_from_object = shared_scene.instances[i].world_from_object;
      view.object_from_world = inverse(view.world_from_object);
      view.flags = shared_scene.instances[i].flags;
      const SurfaceHit hit =
          surface_hit_make(shared_scene.meshes[0].view(), view, static_cast<std::uint32_t>(t), 0.3f, 0.5f);
      EXPECT_LT(length(hit.Ng - a.axis), 1e-5f);
      EXPECT_LT(length(hit.P - (a.P + a.edge_u * 0.3f + a.edge_v * 0.5f)), 1e-5f);
    }
  }
}

TEST(SharedLights, TakeTheMemoryOfOneMesh)
{
  const std::size_t shared = light_set_make(lamps(3000, false), {}).bytes();
  const std::size_t distinct = light_set_make(lamps(3000, true), {}).bytes();
  EXPECT_LT(shared * 7, distinct) << shared << " bytes, written out " << distinct;
}

TEST(SharedLights, FewLightsAndOtherShapesAreWrittenOut)
{
  EXPECT_TRUE(light_set_make(lamps(3, false), {}).copies.empty());
  Scene scene = lamps(6, false);
  EXPECT_EQ(light_set_make(scene, {}).copies.size(), 6u);
  // One that is squeezed, one that is sheared, and one whose emission starts no photons have lights of their own.
  scene.instances[1].world_from_object.x *= 1.001f;
  scene.instances[2].world_from_object.y += scene.instances[2].world_from_object.z * 0.001f;
  scene.instances[4].flags |= kNoCausticLight;
  const LightSet set = light_set_make(scene, {});
  EXPECT_EQ(set.copies.size(), 2u);  // instances 0 and 3; 5 is left alone
  EXPECT_EQ(set.light_copy_index, (std::vector<std::int32_t>{0, -1, -1, 1, -1, -1}));
  EXPECT_EQ(set.lights.size(), 5 * kLampTriangles);
  EXPECT_FALSE(set.lights[static_cast<std::size_t>(set.first_light_index[4])].casts_caustics);
}

TEST(SharedLights, ProbabilitiesSumToOneAndAreWhatTheWalkFinds)
{
  Random random{12};
  // Hundreds of lamps have a tree above the copies.
  for (const int count : {4, 30, 700}) {
    const LightSet set = light_set_make(lamps(count, false, count == 30), {});
    const LightsView view = set.view();
    for (int k = 0; k < 20; ++k) {
      const Vec3f P = random.in_cube(7), N = k % 2 == 0 ? Vec3f{} : random.direction();
      LightEstimates root;
      light_tree_estimate(view.tree, view.tree.root, P, N, root);
      double sum = 0;
      for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        for (std::size_t t = 0; t < kLampTriangles; ++t) {
          const LightRef ref = light_of(set, i, t);
          sum += static_cast<double>(light_tree_pdf(view.tree, root, P, N, static_cast<std::uint32_t>(ref.light_index),
                                                    view.light_trails[ref.light_index], ref.copy_index));
        }
      }
      EXPECT_LT(sum, 1 + 1e-4);
      // A walk may end at a lamp none of whose triangles turns out to face P: the rest of the walks find a light.
      constexpr int kWalks = 2000;
      int found = 0;
      for (int i = 0; i < kWalks; ++i) {
        const LightChoice choice = light_tree_sample(view.tree, root, P, N, (i + 0.5) / kWalks);
        if (choice.probability == 0) continue;
        ++found;
        ASSERT_GE(choice.copy_index, 0);
        ASSERT_EQ(light_tree_pdf(view.tree, root, P, N, choice.light_index, view.light_trails[choice.light_index],
                                 choice.copy_index),
                  choice.probability);
      }
      EXPECT_NEAR(found / static_cast<double>(kWalks), sum, 0.02);
    }
  }
}

TEST(SharedLights, NoneThatContributesIsLeftOut)
{
  Random random{13};
  int contributing = 0;
  for (const float far : {0.0f, 1.0f, 10000.0f}) {
    const int count = 200;
    const Vec3f centre{far, -far, 2 * far};
    Scene scene = lamps(count, false, far > 0);
    for (Instance& instance : scene.instances) instance.world_from_object.p += centre;
    const LightSet set = light_set_make(scene, {});
    const LightsView view = set.view();
    for (int k = 0; k < 40000; ++k) {
      const auto i = static_cast<std::size_t>(random.next() * count);
      const auto t =
          static_cast<std::size_t>(random.next() * 8);  // the triangles: the square's second part stands for none
      const LightRef ref = light_of(set, i, t);
      Light storage;
      const Light& light = lights_at(view, ref, storage);
      Vec3f P = centre + random.in_cube(k % 2 == 0 ? 7 : 300);
      Vec3f N = random.next() < 0.25 ? Vec3f{} : random.direction();
      // Half of the points see the light or are seen by it at a grazing angle.
      if (k % 4 == 1) P = light.P + cross(light.axis, random.direction()) * 3.0f + light.axis * random.between(0, 1e-3);
      if (k % 4 == 2) N = normalize(cross(light.P - P, random.direction()) + random.direction() * 1e-4f);
      const LightSample sample = light_sample(light, P, {random.unit(), random.unit()});
      if (!(sample.pdf > 0.0f) || !(is_zero(N) || dot(N, sample.wi) > 0.0f)) continue;
      ++contributing;
      ASSERT_GT(lights_pdf(view, P, N, ref, sample.wi, sample.distance), 0.0f) << "lamp " << i << " triangle " << t;
    }
  }
  EXPECT_GT(contributing, 20000);
}

TEST(SharedLights, DensityOfAHitEqualsTheSamples)
{
  Random random{14};
  const LightSet set = light_set_make(lamps(100, false, true), {});
  const LightsView view = set.view();
  int compared = 0, squares = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3f P = random.in_cube(8), N = random.next() < 0.25 ? Vec3f{} : random.direction();
    const LightSample sample = lights_sample(view, P, N, {random.next(), random.unit()});
    if (sample.pdf == 0.0f) continue;
    ++compared;
    LightRef hit = sample.ref;
    if (view.lights[hit.light_index].kind == LightKind::kRectangle) {
      ++squares;
      hit.light_index += i % 2;  // either of its triangles
    }
    ASSERT_NEAR(lights_pdf(view, P, N, hit, sample.wi, sample.distance) / sample.pdf, 1.0f, 1e-4f);
  }
  EXPECT_GT(compared, 9000);
  EXPECT_GT(squares, 500);
}

TEST(SharedLights, EstimateTheirIrradianceAsWellAsWhenWrittenOut)
{
  // 100000 independent samples a point, |z| < 5 (two-sided significance 6e-7, eight points).
  Random random{15};
  const LightSet shared = light_set_make(lamps(120, false), {});
  const LightSet distinct = light_set_make(lamps(120, true), {});
  double relative_shared = 0, relative_distinct = 0;
  for (int k = 0; k < 8; ++k) {
    const Vec3f P = random.direction() * 11.0f, N = normalize(random.direction() - 0.1f * P);
    const double truth = irradiance(distinct.view(), P, N, 256);
    const int n = 100000;
    const Moments found = sampler_moments(shared.view(), P, N, n);
    EXPECT_LT(std::abs(found.mean - truth), 5 * std::sqrt(found.variance / n) + 1e-4 * truth);
    relative_shared += found.variance / (truth * truth);
    relative_distinct += sampler_moments(distinct.view(), P, N, n).variance / (truth * truth);
  }
  std::printf("relative variance of one sample: shared %.3f, written out %.3f\n", relative_shared / 8,
              relative_distinct / 8);
  EXPECT_LT(relative_shared, 1.25 * relative_distinct);
}

TEST(SharedLights, DoNotDependOnThreads)
{
  const LightSet first = light_set_make(lamps(3000, false), {});
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  const LightSet again = light_set_make(lamps(3000, false), {});
  ASSERT_EQ(first.tree_blocks.size(), again.tree_blocks.size());
  for (std::size_t i = 0; i < first.copies.size(); ++i) EXPECT_EQ(first.copies[i].trail, again.copies[i].trail);
  EXPECT_EQ(first.light_trails, again.light_trails);
}

}  // namespace
}  // namespace relief
