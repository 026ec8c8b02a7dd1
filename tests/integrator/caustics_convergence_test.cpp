// How the photon pass approaches the truth: its bias against a closed form, and what stays the same between frames.
#include <cmath>
#include <cstdio>

#include "kernel/photon/photon.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

constexpr double kPi_d = 3.14159265358979323846;

/// A floor at y = 0 under a square mirror of half a side 0.2 at y = 0.4 and a lamp of 1 W/sr between the two, at y = 0.2: the
/// mirror throws the light of the lamp's image at y = 0.6 on the floor, E(r) = 0.6 / (r² + 0.36)^1.5, up to 0.6 away.
Scene mirror_scene()
{
  Scene scene = empty_scene();
  add_object(scene, quad_mesh({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}), diffuse_material(splat3(0.5f)));
  scene.instances.back().flags |= kCausticReceiver;
  Material mirror;
  mirror.roughness = 0;
  add_object(scene, quad_mesh({-0.2f, 0.4f, -0.2f}, {0.4f, 0, 0}, {0, 0, 0.4f}), mirror);
  scene.instances.back().flags |= kCausticCaster | kCausticReceiver;
  Light lamp;
  lamp.kind = LightKind::kPoint;
  lamp.P = {0, 0.2f, 0};
  lamp.emission = splat3(1);
  scene.lights.push_back(lamp);
  // Below the lamp, looking down at a square of a millimetre about the origin, on which E differs by less than 1e-6.
  Camera& camera = scene.cameras.front().camera;
  camera.world_from_camera.x = {1, 0, 0};
  camera.world_from_camera.y = {0, 0, -1};
  camera.world_from_camera.z = {0, 1, 0};
  camera.world_from_camera.p = {0, 0.1f, 0};
  camera.half_width = camera.half_height = 0.005f;
  return scene;
}

double irradiance(double r) { return 0.6 / std::pow(r * r + 0.36, 1.5); }

/// What Epanechnikov's kernel of a radius makes of it at the origin.
double blurred(double radius)
{
  constexpr int kSteps = 2000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double r = radius * (i + 0.5) / kSteps;
    sum += irradiance(r) * 2 * (1 - r * r / (radius * radius)) / (kPi_d * radius * radius) * 2 * kPi_d * r;
  }
  return sum * radius / kSteps;
}

double mean_caustic(const Scene& scene, const RenderOptions& options)
{
  const Rendered picture = render_scene(scene, options);
  double sum = 0;
  const int size = options.settings.width;
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) sum += static_cast<double>(*picture.at(Aov::kCaustic, x, y));
  }
  return sum / (size * size);
}

TEST(CausticConvergence, BiasIsThatOfTheShrinkingKernel)
{
  // The mean over seeds is compared with the closed form blurred by the radius of every pass (Knaus and Zwicker 2011):
  // 10.8 % of the light is missing from the peak after one pass and 4.6 % after 64. Significance: 5 standard errors (of 16 seeds and
  // more, 2e-4 a case), which are to be a fiftieth of the bias at most, so that it is found to fall, and to fall so fast.
  const Scene scene = mirror_scene();
  constexpr double kRadius = 0.3;
  constexpr double kAlpha = 2.0 / 3.0;
  RenderOptions options = render_options(scene, 2, 1);
  options.settings.caustics.mode = CausticsMode::kOn;
  // Of the light seen directly: what the mirror shows of the floor is left out.
  options.settings.diffuse_bounces = 1;
  options.settings.caustics.photons = 1 << 11;
  options.settings.caustics.radius = static_cast<float>(kRadius);
  options.settings.caustics.alpha = static_cast<float>(kAlpha);
  struct Case {
    int passes, seeds;
  };
  for (const Case& c : {Case{1, 32}, Case{8, 24}, Case{64, 16}}) {
    options.settings.samples = c.passes;
    double sum = 0, squares = 0;
    for (int seed = 0; seed < c.seeds; ++seed) {
      options.settings.seed = 300u + static_cast<std::uint64_t>(seed);
      const double found = mean_caustic(scene, options) * kPi_d / 0.5 / irradiance(0);
      sum += found;
      squares += found * found;
    }
    const double mean = sum / c.seeds;
    const double error = std::sqrt(std::max(squares / c.seeds - mean * mean, 0.0) / (c.seeds - 1));
    double expected = 0;
    for (int pass = 0; pass < c.passes; ++pass) {
      const double factor = photon_radius_factor(static_cast<std::uint32_t>(pass), kAlpha);
      expected += blurred(kRadius * factor) / irradiance(0) / c.passes;
    }
    std::printf("%d passes: bias %.5f, predicted %.5f, standard error %.5f\n", c.passes, mean - 1, expected - 1, error);
    EXPECT_NEAR(mean, expected, 5 * error) << c.passes;
    EXPECT_LT(error, 0.02 * (1 - expected)) << c.passes;
  }
}

TEST(CausticConvergence, PhotonsDoNotKnowTheCamera)
{
  // A camera that moves through an animation sees a caustic that stands still, with the same pattern.
  Scene scene = mirror_scene();
  RenderOptions options = render_options(scene, 8, 2);
  options.settings.caustics.mode = CausticsMode::kOn;
  const Rendered here = render_scene(scene, options);
  scene.cameras.front().camera.world_from_camera.p += Vec3f{0.03f, 0.05f, -0.02f};
  RenderOptions moved = render_options(scene, 8, 2);
  moved.settings.caustics.mode = CausticsMode::kOn;
  const Rendered there = render_scene(scene, moved);
  EXPECT_NE(here.image.pixels, there.image.pixels);
  EXPECT_GT(here.stats.caustics.stored, 0u);
  EXPECT_EQ(here.stats.caustics.stored, there.stats.caustics.stored);
  EXPECT_EQ(here.stats.caustics.first_radius, there.stats.caustics.first_radius);
}

}  // namespace
}  // namespace relief::test
