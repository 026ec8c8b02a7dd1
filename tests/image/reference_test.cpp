// Renders small scenes and compares them with pictures of another origin: closed forms, Cycles, another estimator. What
// made each reference stands in tests/references/README.md; scripts/update_references remakes them.
#include <array>
#include <filesystem>
#include <functional>

#include "exporters/exr.h"
#include "scene/load.h"
#include "tests/image/render_runs.h"

namespace relief::test {

namespace {

/// Chance that a correct renderer fails one of these tests under another seed.
constexpr double kSignificance = 0.001;
constexpr int kNumRuns = 16;

struct Reference {
  const char* name;
  const char* scene;  ///< from the project's root
  int samples;        ///< a pixel and run
};

/// For GoogleTest's messages, which would print the bytes.
void PrintTo(const Reference& reference, std::ostream* out) { *out << reference.name; }

// Samples give each scene a second or two on two cores, photons four; setting a scene up sixteen times is part of that.
constexpr std::array kReferences = {
    Reference{"rectangle_floor", "tests/references/rectangle_floor.gltf", 16},
    Reference{"punctual_floor", "tests/references/punctual_floor.gltf", 16},
    Reference{"environment_polyhedron", "tests/references/environment_polyhedron.gltf", 32},
    Reference{"glass_gem", "tests/references/glass_gem.gltf", 16},
    Reference{"cornell", "examples/cornell/cornell.gltf", 16},
    Reference{"instances", "examples/instances/instances.gltf", 4},
    Reference{"many_lights", "examples/many_lights/many_lights.gltf", 8},
    Reference{"spheres", "examples/spheres/spheres.gltf", 8},
    Reference{"product", "examples/product/product.gltf", 32},
    Reference{"glass", "examples/glass/glass.gltf", 8},
    Reference{"displaced_bumps", "tests/references/displaced_bumps.gltf", 32},
    Reference{"displaced_pits", "tests/references/displaced_pits.gltf", 32},
    Reference{"displaced_sphere", "tests/references/displaced_sphere.gltf", 32},
    Reference{"displaced_seam", "tests/references/displaced_seam.gltf", 32},
    Reference{"displaced_cliff", "tests/references/displaced_cliff.gltf", 32},
    Reference{"displaced_slab", "tests/references/displaced_slab.gltf", 32},
    Reference{"displaced_graph", "tests/references/displaced_graph.gltf", 32},
    Reference{"displaced_curved", "tests/references/displaced_curved.gltf", 16},
    Reference{"displaced_instances", "tests/references/displaced_instances.gltf", 32},
    Reference{"displaced_mirror", "tests/references/displaced_mirror.gltf", 32},
    Reference{"caustic_ball", "tests/references/caustic_ball.gltf", 32},
    Reference{"caustic_slab", "tests/references/caustic_slab.gltf", 8},
};

const std::filesystem::path kRoot = RELIEF_SOURCE_DIR;

Reference reference_named(const std::string& name)
{
  for (const Reference& reference : kReferences) {
    if (reference.name == name) return reference;
  }
  throw std::runtime_error("no reference is called " + name);
}

Picture reference_load(const Reference& reference)
{
  return exr_load(kRoot / "tests" / "references" / (std::string(reference.name) + "_reference.exr"));
}

/// Renders a scene, changed if `change` is given, and compares it with its reference.
/// @param share  of the reference's samples, one in so many: what is found with fewer is found with all
ZTestResult compare_with_reference(const Reference& reference,
                                   const std::function<void(Scene&)>& change = {},
                                   int share = 1)
{
  const Picture expected = reference_load(reference);
  Scene scene = scene_load(kRoot / reference.scene);
  if (change) change(scene);
  RunOptions run;
  run.width = expected.width;
  run.height = expected.height;
  run.samples = reference.samples / share;
  run.num_runs = kNumRuns;
  return z_test_pictures(render_runs(scene, run), expected, run.samples * run.num_runs, kSignificance);
}

class ReferenceImage : public testing::TestWithParam<Reference> {};

TEST_P(ReferenceImage, IsWhatTheRendererConvergesTo)
{
  const ZTestResult result = compare_with_reference(GetParam());
  EXPECT_TRUE(result.passed) << z_text(result);
  std::printf("%s: %s\n", GetParam().name, z_text(result).c_str());
}

INSTANTIATE_TEST_SUITE_P(All, ReferenceImage, testing::ValuesIn(kReferences), [](const auto& test) {
  return std::string(test.param.name);
});

// A test that cannot fail says nothing: small faults of a renderer, one a test, must be found at the same significance.

TEST(ReferencePower, TwoPercentMoreLightIsSeen)
{
  const auto brighter = [](Scene& scene) {
    for (Light& light : scene.lights) light.emission *= 1.02f;
    for (Material& material : scene.materials) material.emission *= 1.02f;
    scene.environment.color *= 1.02f;
  };
  for (const char* name : {"rectangle_floor", "environment_polyhedron", "cornell"}) {
    const ZTestResult result = compare_with_reference(reference_named(name), brighter);
    EXPECT_FALSE(result.passed) << name << ": " << z_text(result);
  }
}

TEST(ReferencePower, ATurnedEnvironmentIsSeen)
{
  const auto turn = [](Scene& scene) { scene.environment.rotation += 0.05f; };
  const ZTestResult result = compare_with_reference(reference_named("environment_polyhedron"), turn);
  EXPECT_FALSE(result.passed) << z_text(result);
}

TEST(ReferencePower, HalfAPixelOfShiftIsSeen)
{
  for (const char* name : {"punctual_floor", "cornell", "product"}) {
    const Picture expected = reference_load(reference_named(name));
    const auto shift = [&expected](Scene& scene) {
      scene.cameras.front().camera.shift_x += 0.5f / static_cast<float>(expected.width);
    };
    const ZTestResult result = compare_with_reference(reference_named(name), shift);
    EXPECT_FALSE(result.passed) << name << ": " << z_text(result);
  }
}

TEST(ReferencePower, DisplacementTwoPercentTallerIsSeen)
{
  const auto taller = [](Scene& scene) {
    for (DisplacementSettings& displacement : scene.displacements) displacement.scale *= 1.02f;
  };
  for (const char* name : {"displaced_bumps", "displaced_sphere", "displaced_mirror"}) {
    const ZTestResult result = compare_with_reference(reference_named(name), taller, 2);
    EXPECT_FALSE(result.passed) << name << ": " << z_text(result);
  }
}

TEST(ReferencePower, AMapAQuarterOfATexelOffIsSeen)
{
  const auto shift = [](Scene& scene) {
    for (DisplacementSettings& displacement : scene.displacements) {
      const HeightMap& map = scene.height_maps[static_cast<std::size_t>(displacement.height.texture_index)];
      displacement.height.m02 += 0.25f / static_cast<float>(map.width);
    }
  };
  for (const char* name : {"displaced_pits", "displaced_cliff"}) {
    const ZTestResult result = compare_with_reference(reference_named(name), shift, 4);
    EXPECT_FALSE(result.passed) << name << ": " << z_text(result);
  }
}

TEST(ReferencePower, TheBiasOfWidePhotonsIsSeen)
{
  const auto widen = [](Scene& scene) { scene.render.caustics.radius = 0.3f; };
  const ZTestResult result = compare_with_reference(reference_named("caustic_ball"), widen, 8);
  EXPECT_FALSE(result.passed) << z_text(result);
}

TEST(ReferencePower, ALightTwoPercentOffIsSeenAmongOthers)
{
  const auto change = [](Scene& scene) { scene.lights.back().emission *= 0.98f; };
  const ZTestResult result = compare_with_reference(reference_named("punctual_floor"), change);
  EXPECT_FALSE(result.passed) << z_text(result);
}

}  // namespace

}  // namespace relief::test
