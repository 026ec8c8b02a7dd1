// Instances of displaced meshes: they share one structure, and are met where their transforms put them.
#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "integrator/scene_context.h"
#include "integrator/scene_displacement.h"
#include "integrator/trace.h"
#include "tests/support/displacement_methods.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

/// Instances of one displaced sphere.
Scene instances_of_a_sphere(const std::vector<Affine3>& transforms, DisplacementMethod method)
{
  constexpr int kColumns = 24, kRows = 12, kSize = 64;
  Scene scene = empty_scene();
  Mesh sphere = sphere_mesh(1, kColumns, kRows, true);
  for (int r = 0; r <= kRows; ++r) {
    for (int c = 0; c <= kColumns; ++c) sphere.uv[0].push_back({static_cast<float>(c) / 6, static_cast<float>(r) / 6});
  }
  Material material = diffuse_material({0.6f, 0.6f, 0.6f});
  material.displacement_index = 0;
  add_object(scene, sphere, material, transforms[0]);
  for (std::size_t k = 1; k < transforms.size(); ++k) {
    Instance instance = scene.instances[0];
    instance.world_from_object = transforms[k];
    instance.flags &= ~std::uint32_t{kMirrored};
    if (determinant(transforms[k]) < 0) instance.flags |= kMirrored;
    scene.instances.push_back(instance);
  }
  add_displacement(scene, kSize, noise_texels(kSize, 5), 0.1f).method = method;
  return scene;
}

TEST(DisplacedInstance, SharesOneStructureWithAThousandOthers)
{
  std::vector<Affine3> transforms;
  transforms.reserve(1000);
  for (int k = 0; k < 1000; ++k)
    transforms.push_back({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {3.0f * static_cast<float>(k), 0, 0}});
  const Scene one = instances_of_a_sphere({transforms[0]}, DisplacementMethod::chord);
  const Scene thousand = instances_of_a_sphere(transforms, DisplacementMethod::chord);
  const DisplacementSet set_of_one = scene_displacement(one, {}), set_of_thousand = scene_displacement(thousand, {});
  EXPECT_EQ(set_of_thousand.size(), 1u);
  EXPECT_EQ(set_of_thousand.bytes(), set_of_one.bytes());
  EXPECT_EQ(set_of_thousand.num_triangles(), set_of_one.num_triangles());
}

class DisplacedInstances : public testing::TestWithParam<DisplacementMethod> {};

TEST_P(DisplacedInstances, AreMetWhereTheirTransformsPutThem)
{
  const Affine3 placed{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
  // Shears that mirror, flatten, and make small or large.
  const Affine3 others[] = {{{1, 0, 0}, {0.7f, 1, 0}, {0, 0, -1.2f}, {5, -2, 1}},
                            {{-0.5f, 0.1f, 0}, {0, -2, 0.3f}, {0.4f, 0, -1}, {0, 3, 0}},
                            {{0, 1e-3f, 0}, {2e-3f, 0, 0}, {0, 5e-4f, 1e-3f}, {0, 0, 0}},
                            {{1e3f, 0, 200}, {0, -1e3f, 0}, {0, 0, 700}, {1e3f, 0, 0}}};
  const Scene scene = instances_of_a_sphere({placed}, GetParam());
  const SceneContext context(scene, {});
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<TraceRay> rays;
  for (int k = 0; k < 20'000; ++k) {
    const Vec3f O = 3.0f * normalize(Vec3f{uniform(random), uniform(random), uniform(random)});
    rays.push_back({O, Vec3f{uniform(random), uniform(random), uniform(random)} - O, 0, kInfinity});
  }
  const std::vector<TraceHit> expected = trace_rays(context, rays);
  for (const Affine3& transform : others) {
    const Scene moved = instances_of_a_sphere({transform}, GetParam());
    const SceneContext moved_context(moved, {});
    std::vector<TraceRay> moved_rays = rays;
    for (TraceRay& ray : moved_rays) {
      ray.O = transform_point(transform, ray.O);
      ray.D = transform_vector(transform, ray.D);
    }
    const std::vector<TraceHit> found = trace_rays(moved_context, moved_rays);
    int hits = 0, others_hit = 0;
    for (std::size_t k = 0; k < rays.size(); ++k) {
      hits += expected[k].hit ? 1 : 0;
      // Rounding of the transformed ray moves t by this, unless the ray grazes the surface.
      if (expected[k].hit != found[k].hit || (found[k].hit && std::abs(expected[k].t - found[k].t) > 1e-4f)) {
        ++others_hit;
        continue;
      }
      if (!found[k].hit) continue;
      // Normals go with the transform of the surface, to the side that the ray comes from.
      const Vec3f Ng = found[k].Ng, along = transform_vector(transform, frame_from_normal(expected[k].Ng).s);
      if (std::abs(dot(Ng, along)) > 0.01f * length(along)) ++others_hit;
    }
    EXPECT_GT(hits, 10'000);
    EXPECT_LT(others_hit, hits / 200);
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, DisplacedInstances, testing::ValuesIn(traversing_methods()), method_test_name);

}  // namespace
}  // namespace relief::test
