// Tessellated displacement in the renderer: the same scene as by the exact method, within what tessellation leaves out.
#include <random>
#include <string>
#include <utility>

#include "displacement/cost_model.h"
#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "kernel/shape/surface_hit.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

constexpr float kScale = 0.15f;

/// A displaced sphere with a smooth map, tiled, over a large floor, under an even sky; placed by a shear that mirrors.
Scene displaced_scene(AlphaMode alpha_mode)
{
  constexpr int kSize = 64;
  Scene scene = empty_scene();
  Mesh sphere = sphere_mesh(1, 24, 12, true);
  for (int r = 0; r <= 12; ++r) {
    for (int c = 0; c <= 24; ++c) {
      sphere.uv[0].push_back({static_cast<float>(c) / 6.0f, static_cast<float>(r) / 6.0f});
    }
  }
  Material material = diffuse_material({0.6f, 0.6f, 0.6f});
  material.displacement_index = 0;
  material.alpha_mode = alpha_mode;
  material.base_alpha = alpha_mode == AlphaMode::kOpaque ? 1.0f : 0.5f;
  add_object(scene, sphere, material, {{1, 0, 0}, {0.2f, 1, 0}, {0, 0, -1.2f}, {0, 0, 0}});
  add_object(scene, quad_mesh({-9, -1.4f, 9}, {18, 0, 0}, {0, 0, -18}), diffuse_material({0.5f, 0.5f, 0.5f}));

  std::vector<std::uint16_t> texels;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double h = 0.5 + 0.4 * std::sin(2 * 3.14159265 * x / kSize) * std::sin(2 * 3.14159265 * y / kSize);
      texels.push_back(static_cast<std::uint16_t>(65535 * h));
    }
  }
  add_displacement(scene, kSize, std::move(texels), kScale);
  scene.environment.color = {1, 1, 1};
  return scene;
}

std::vector<TraceRay> random_rays(int count)
{
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<TraceRay> rays;
  for (int i = 0; i < count; ++i) {
    const Vec3f O{3 * uniform(random), 3 * uniform(random), 3.5f};
    rays.push_back({O, normalize(Vec3f{uniform(random), uniform(random), uniform(random)} - O), 0, kInfinity});
  }
  return rays;
}

DisplacementOptions options_of(DisplacementMethod method, double rate)
{
  DisplacementOptions options;
  options.method = method;
  options.tessellation_rate = rate;
  return options;
}

class TessellatedBy : public testing::TestWithParam<DisplacementMethod> {};
INSTANTIATE_TEST_SUITE_P(Methods,
                         TessellatedBy,
                         testing::Values(DisplacementMethod::tessellate, DisplacementMethod::tessellate_grid),
                         [](const auto& method) {
                           return method.param == DisplacementMethod::tessellate_grid ? "Grids" : "Triangles";
                         });

TEST_P(TessellatedBy, HitsAreThoseOfTheExactMethod)
{
  const Scene scene = displaced_scene(AlphaMode::kOpaque);
  const SceneContext exact(scene, options_of(DisplacementMethod::chord, 1));
  const SceneContext tessellated(scene, options_of(GetParam(), 4));
  const std::vector<TraceRay> rays = random_rays(20'000);
  const std::vector<TraceHit> expected = trace_rays(exact, rays), found = trace_rays(tessellated, rays);
  int hits = 0, silhouettes = 0, creases = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!expected[i].hit || expected[i].instance_index != 0) continue;
    ++hits;
    const TraceHit &a = expected[i], &b = found[i];
    // A facet is at most this far from the surface: a quarter of a texel long, on waves of 64 texels.
    constexpr float kFacetError = 1e-4f;
    // t differs by the facet's error over the cosine; a ray that passes close to a ridge may meet either slope.
    const float cosine = std::abs(dot(a.Ng, rays[i].D));
    if (b.instance_index != 0 || std::abs(a.t - b.t) * cosine > 2 * kFacetError) {
      ++silhouettes;
      continue;
    }
    // Facets across a crease of the surface have a normal between its two.
    if (dot(a.Ng, b.Ng) < 0.99f) ++creases;
    if (a.triangle_index == b.triangle_index) {
      EXPECT_NEAR(a.u, b.u, 0.01f);
      EXPECT_NEAR(a.v, b.v, 0.01f);
    }
    // Embree's t has the error of its height over the facet, seen along the ray.
    EXPECT_LT(length(rays[i].O + b.t * rays[i].D - b.P) * cosine, 1e-5f);
  }
  EXPECT_GT(hits, 10'000);
  EXPECT_LT(silhouettes, hits / 200);
  EXPECT_LT(creases, hits / 200);
}

/// Shadows and bounces start at the facets: no ray meets the facet that it leaves.
TEST_P(TessellatedBy, LeavingRaysDoNotComeBack)
{
  const Scene scene = displaced_scene(AlphaMode::kOpaque);
  const SceneContext context(scene, options_of(GetParam(), 1));
  std::vector<TraceRay> leaving;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (const TraceHit& h : trace_rays(context, random_rays(20'000))) {
    if (!h.hit || h.instance_index != 0) continue;
    const Affine3& inverse = context.instances[0].object_from_world;
    const SurfaceHit surface = surface_hit_displaced(context.meshes[0], context.instances[0], h.triangle_index, h.u,
                                                     h.v, {transform_point(inverse, h.P), {0, 0, 1}, {0, 0, 1}, {}});
    // A facet is a fortieth of a unit long; what lies nearer than a fiftieth of that is the facet itself.
    const Vec3f D = normalize(h.Ng + 0.7f * Vec3f{uniform(random), uniform(random), uniform(random)});
    if (dot(D, h.Ng) <= 0) continue;
    leaving.push_back({offset_ray_origin(surface.P, surface.P_error, h.Ng), D, kLeastDistance, 5e-4f});
  }
  ASSERT_GT(leaving.size(), 10'000u);
  int self_hits = 0;
  for (const TraceHit& h : trace_rays(context, leaving)) self_hits += h.hit ? 1 : 0;
  EXPECT_EQ(self_hits, 0);
}

/// Means of whole images agree within 5 standard errors, shadows through half transparent surfaces included.
TEST_P(TessellatedBy, RendersTheSameImage)
{
  for (const AlphaMode alpha_mode : {AlphaMode::kOpaque, AlphaMode::kBlend}) {
    Scene scene = displaced_scene(alpha_mode);
    scene.displacements[0].method = DisplacementMethod::chord;
    const Estimate exact = estimate_mean(scene, render_options(scene, 64, 16), 6);
    scene.displacements[0].method = GetParam();
    const Estimate tessellated = estimate_mean(scene, render_options(scene, 64, 16), 6);
    EXPECT_NEAR(exact.mean, tessellated.mean,
                5 * std::hypot(exact.standard_error, tessellated.standard_error) + 1e-4 * exact.mean);
    EXPECT_LT(exact.standard_error, 2e-3 * exact.mean);
  }
}

TEST_P(TessellatedBy, RefusesWhatDoesNotFitAndSaysHowMuchItWouldTake)
{
  const Scene scene = displaced_scene(AlphaMode::kOpaque);
  DisplacementOptions options = options_of(GetParam(), 100);
  options.tessellation_bytes = 1 << 28;
  try {
    const SceneContext context(scene, options);
    FAIL() << "was built";
  } catch (const std::runtime_error& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("GiB"), std::string::npos) << text;
    EXPECT_NE(text.find("0.2 GiB"), std::string::npos) << text;
    EXPECT_NE(text.find("million triangles"), std::string::npos) << text;
  }
}

TEST(AutomaticDisplacement, TessellatesWhereThatSavesTimeWithinItsAllowance)
{
  const Scene scene = displaced_scene(AlphaMode::kOpaque);
  constexpr std::uint64_t kAmple = std::uint64_t{1} << 31;
  const auto method = [&](double num_rays, std::uint64_t allowance) {
    DisplacementOptions options;
    options.num_rays = num_rays;
    options.auto_bytes = allowance;
    const SceneContext context(scene, options);
    EXPECT_EQ(context.displacements.reasons().size(), allowance > 0 ? 1u : 0u);
    return context.displacements.method_names();
  };
  EXPECT_EQ(method(1e9, kAmple), "tessellate");
  // A few rays are traced before a tree is built.
  EXPECT_EQ(method(1000, kAmple), "chord");
  // Without an allowance nothing is built, and one too small for triangles may do for grids.
  EXPECT_EQ(method(1e9, 0), "chord");
  SceneContext context(scene, options_of(DisplacementMethod::chord, 1));
  const DisplacedMeshView mesh = context.displacements.geometry(0).mesh;
  const auto peak = [&](TessellationKind kind) {
    return tessellation_peak_bytes(tessellation_layout_make(mesh, kind, 1), kRenderTessellation);
  };
  const std::uint64_t grids = peak(TessellationKind::kGrids), triangles = peak(TessellationKind::kQuads);
  ASSERT_LT(grids, triangles);
  EXPECT_EQ(method(1e9, triangles), "tessellate");
  EXPECT_EQ(method(1e9, triangles - 1), "tessellate-grid");
  EXPECT_EQ(method(1e9, grids - 1), "chord");
}

TEST(AutomaticDisplacement, ChoosesTheLeastOfTheSumsThatItNames)
{
  constexpr std::uint64_t kCount = 4u << 20, kBytes = 1u << 20, kAmple = std::uint64_t{1} << 40;
  using M = DisplacementMethod;
  const MethodOffer offers[] = {{M::chord, {1000, 0, 0}, 0, 0},
                                {M::tessellate, {300, 50, 500}, kCount, kBytes},
                                {M::tessellate_grid, {400, 50, 100}, kCount, kBytes}};
  // 4 Mi micro-triangles: (300 + 2·50) ns a ray and 2.1 s, or 500 ns and 0.42 s, against 1000 ns.
  EXPECT_NEAR(method_seconds(offers[0].cost, 0, 1e6), 1, 1e-9);
  EXPECT_NEAR(method_seconds(offers[1].cost, kCount, 1e6), 0.4 + 2.097152, 1e-9);
  EXPECT_NEAR(method_seconds(offers[2].cost, kCount, 1e6), 0.5 + 0.4194304, 1e-9);
  const DisplacementChoice few = displacement_choose(offers, 5e5, kAmple);
  EXPECT_EQ(few.method, M::chord);
  EXPECT_EQ(few.reason, "0.5 s by chord against 2.3 s by tessellate (1 MiB) against 0.67 s by tessellate-grid (1 MiB)");
  EXPECT_EQ(displacement_choose(offers, 1e6, kAmple).method, M::tessellate_grid);
  // From 17 million rays on triangles repay their tree.
  EXPECT_EQ(displacement_choose(offers, 1.6e7, kAmple).method, M::tessellate_grid);
  EXPECT_EQ(displacement_choose(offers, 1.8e7, kAmple).method, M::tessellate);
  EXPECT_EQ(displacement_choose(offers, 1e9, 1000).method, M::chord);
  // What is to be done before it is built counts.
  const MethodOffer prepared[] = {offers[0], {M::tessellate, {300, 50, 500}, kCount, kBytes, 4.0}};
  EXPECT_EQ(displacement_choose(prepared, 1e7, kAmple).method, M::chord);
  EXPECT_EQ(displacement_choose(prepared, 1.1e7, kAmple).method, M::tessellate);
  EXPECT_NE(displacement_choose(offers, 1e9, 1000).reason.find("too large"), std::string::npos);
}

}  // namespace
}  // namespace relief::test
