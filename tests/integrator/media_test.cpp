// Media whose light is known in closed form or by a quadrature in double precision.
#include <cmath>

#include "tests/support/medium_scenes.h"

namespace relief::test {
namespace {

TEST(Media, AbsorbByBeersLaw)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  add_medium(scene, box_mesh({1, 1, 1}), absorbing({0.5f, 1, 2}));
  for (int channel = 0; channel < 3; ++channel) {
    expect_mean(scene, 4, std::exp(-(0.5 * (1 << channel)) * 2), 1e-5, channel);
  }
}

TEST(Media, ThatOverlapAddUp)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  add_medium(scene, box_mesh({1, 1, 1}), absorbing({0.5f, 0, 0}));
  add_medium(scene, box_mesh({1, 1, 1}), absorbing({0.25f, 0.5f, 0}), {0, 0, 1});
  add_medium(scene, box_mesh({0.5f, 0.5f, 0.25f}), absorbing({0, 0, 1}));
  expect_mean(scene, 4, std::exp(-1.0 - 0.5), 1e-5, 0);
  expect_mean(scene, 4, std::exp(-1.0), 1e-5, 1);
  expect_mean(scene, 4, std::exp(-0.5), 1e-5, 2);
}

TEST(Media, CoverTheFilmByWhatTheyDoNotLetThrough)
{
  for (const bool environment_is_seen : {false, true}) {
    for (const int bounces : {0, 4}) {
      Scene scene = view();
      scene.environment.color = {1, 1, 1};
      scene.environment.visible_to_camera = environment_is_seen;
      scene.render.max_bounces = scene.render.volume_bounces = bounces;
      const Vec3f grey{0.3f, 0.3f, 0.3f};
      add_medium(scene, box_mesh({1, 1, 1}), scattering(grey, 0.2f, 0.5f * grey));
      expect_mean(scene, 16, 1 - std::exp(-0.45 * 2), 1e-5, 3);
      // Some of what is scattered meets it, too, and is no more than covered.
      add_object(scene, quad_mesh({-9, -9, -2}, {18, 0, 0}, {0, 18, 0}), diffuse_material({0.6f, 0.6f, 0.6f}));
      expect_mean(scene, 16, 1, 1e-5, 3);
    }
  }
}

TEST(Media, HideSurfacesFromTheLayersOfWhatIsSeen)
{
  Scene scene = view();
  scene.render.max_bounces = scene.render.volume_bounces = 4;
  const Vec3f white{1, 1, 1};
  add_medium(scene, box_mesh({1, 1, 1}), scattering(white, 0));
  // Paths that were scattered meet these at other depths.
  add_object(scene, quad_mesh({-9, -9, -2}, {18, 0, 0}, {0, 18, 0}), diffuse_material({0.6f, 0.6f, 0.6f}));
  add_object(scene, quad_mesh({2, -9, -9}, {0, 18, 0}, {0, 0, 18}), diffuse_material({0.6f, 0.6f, 0.6f}));
  const Rendered rendered = render_scene(scene, render_options(scene, 8, 64));
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      EXPECT_NEAR(rendered.at(Aov::kDepth, x, y)[0], 6, 1e-4);
      EXPECT_NEAR(rendered.at(Aov::kPosition, x, y)[0], 0.1, 1e-3);
    }
  }
}

TEST(Media, AreAroundACameraThatStandsInThem)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  add_medium(scene, box_mesh({1, 1, 1}), absorbing({0.5f, 0, 0}), {0.2f, 0, 4});
  add_medium(scene, box_mesh({3, 3, 3}), absorbing({0, 0.25f, 0}), {0.2f, 0, 4});
  expect_mean(scene, 4, std::exp(-0.5), 1e-5, 0);
  expect_mean(scene, 4, std::exp(-0.75), 1e-5, 1);
}

TEST(Media, BeforeTheNearClippingPlaneDoNotCount)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  scene.cameras[0].camera.clip_start = 3.5f;
  // One that is entered before, and left behind; one that is around the camera, and left before.
  add_medium(scene, box_mesh({1, 1, 1}), absorbing({0.5f, 0, 0}));
  add_medium(scene, box_mesh({1, 1, 1}), absorbing({0, 0.5f, 0}), {0, 0, 4});
  expect_mean(scene, 4, std::exp(-0.5 * 1.5), 1e-5, 0);
  expect_mean(scene, 4, 1, 1e-5, 1);
}

TEST(Media, ShineAsFarAsTheyLetLightThrough)
{
  Scene scene = view();
  Medium medium = absorbing({0, 0.5f, 3});
  medium.emission = {0.7f, 0.7f, 0.7f};
  add_medium(scene, box_mesh({1, 1, 1}), medium);
  expect_mean(scene, 4, 0.7 * 2, 1e-5, 0);
  expect_mean(scene, 4, 0.7 * (1 - std::exp(-0.5 * 2)) / 0.5, 1e-5, 1);
  expect_mean(scene, 4, 0.7 * (1 - std::exp(-3.0 * 2)) / 3, 1e-5, 2);
}

TEST(Media, DimASunThatShinesThroughThem)
{
  Scene scene = view();
  add_object(scene, quad_mesh({-40, -50, -3}, {100, 0, 0}, {0, 100, 0}), diffuse_material({0.6f, 0.6f, 0.6f}));
  add_medium(scene, box_mesh({9, 9, 0.5f}), absorbing({0.5f, 0.5f, 0.5f}), {14, 0, 0});
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = normalize(Vec3f{-3, 0, -1});
  sun.emission = {3, 3, 3};
  scene.lights.push_back(sun);
  // The ray from the floor meets the slab at x from 7.6 on, and leaves it at its top.
  const double slant = std::sqrt(10.0), cosine = 1 / slant;
  expect_mean(scene, 4, 3 * cosine * 0.6 / M_PI * std::exp(-0.5 * slant), 1e-5);
}

TEST(Media, ScatterASunOnce)
{
  Scene scene = view();
  add_medium(scene, box_mesh({50, 50, 1}), scattering({0.4f, 0.4f, 0.4f}, 0.5f, {0.2f, 0.2f, 0.2f}));
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = {0, 0, -1};
  sun.emission = {3, 3, 3};
  scene.lights.push_back(sun);
  // Light turns back: cosine −1.
  const double phase = (1 - 0.25) / std::pow(1 + 0.25 + 1, 1.5) / (4 * M_PI);
  expect_mean(scene, 64, 0.4 * 3 * phase * (1 - std::exp(-2 * 0.6 * 2)) / (2 * 0.6), 1e-6);
}

/// Radiance along the view of view() in an endless medium that scatters evenly, with a lamp of intensity 1 at a point: by the
/// substitution that makes the lamp's part even.
double lamp_in_fog(double sigma_s, double sigma_t, double along, double beside)
{
  const auto at = [&](double angle) {
    const double t = along + beside * std::tan(angle), r = beside / std::cos(angle);
    return sigma_s / (4 * M_PI) * std::exp(-sigma_t * (t + r)) / beside;
  };
  const double first = std::atan(-along / beside), last = M_PI / 2 - 1e-9;
  constexpr int kSteps = 20000;
  const double h = (last - first) / kSteps;
  double sum = at(first) + at(last);
  for (int i = 1; i < kSteps; ++i) sum += (i % 2 == 1 ? 4 : 2) * at(first + h * i);
  return sum * h / 3;
}

TEST(Media, GlowAroundALampFarAndNear)
{
  for (const float beside : {0.02f, 0.5f, 4.0f}) {
    for (const float sigma : {1e-3f, 0.3f}) {
      Scene scene = view();
      scene.environment.medium = scattering(splat3(0.8f * sigma), 0, splat3(0.2f * sigma));
      Light lamp;
      lamp.P = {0.1f + beside, 0.03f, 1};
      lamp.emission = {1, 1, 1};
      scene.lights.push_back(lamp);
      expect_mean(scene, 64, lamp_in_fog(0.8 * double(sigma), double(sigma), 3, double(beside)), 1e-9);
    }
  }
}

TEST(Media, ThatTakeNothingVanishInAWhiteFurnace)
{
  for (const float g : {-0.6f, 0.0f, 0.8f}) {
    Scene scene = view();
    scene.environment.color = {1, 1, 1};
    scene.render.max_bounces = scene.render.volume_bounces = 200;
    add_medium(scene, sphere_mesh(1, 32, 16, false), scattering({1, 2, 4}, g));
    add_medium(scene, sphere_mesh(0.7f, 32, 16, false), scattering({3, 0.5f, 1}, -g), {0.5f, 0, 0});
    for (int channel = 0; channel < 3; ++channel) expect_mean(scene, 16, 1.0, 1e-3, channel);
  }
}

TEST(Media, WhoseLimitIsReachedAreStillSeenThrough)
{
  // Two bounds by which nothing is scattered twice: what is left is the single event, and what passes.
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  scene.render.max_bounces = 8;
  scene.render.volume_bounces = 0;
  add_medium(scene, box_mesh({50, 50, 0.01f}), scattering({1, 1, 1}, 0));
  // Thin: twice scattered light is a part of 1e-3.
  expect_mean(scene, 16, 1.0, 4e-3);
}

TEST(Media, OfAnyCoefficientsHaveAFinitePicture)
{
  for (const float sigma : {0.0f, 1e-30f, 1e8f, 1e16f}) {
    Scene scene = view();
    scene.environment.color = {1, 1, 1};
    scene.render.max_bounces = scene.render.volume_bounces = 4;
    Medium medium = scattering(splat3(sigma), 0.999f, splat3(sigma));
    medium.emission = {1, 1, 1};
    add_medium(scene, box_mesh({1, 1, 1}), medium);
    scene.environment.medium = scattering(splat3(1e-3f), 0);
    EXPECT_TRUE(std::isfinite(render_scene(scene, render_options(scene, 4, 4)).mean()));
  }
}

TEST(Media, InOpenOrTurnedMeshesAreWarnedAbout)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  add_medium(scene, quad_mesh({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), absorbing({1, 1, 1}));
  scene.instances.back().name = "sheet";
  Mesh turned = box_mesh({1, 1, 1});
  for (TriangleIndices& t : turned.triangles) std::swap(t.v1, t.v2);
  add_medium(scene, std::move(turned), absorbing({1, 1, 1}));
  scene.instances.back().name = "turned";
  const Rendered rendered = render_scene(scene, render_options(scene, 4, 4));
  const auto is_told = [&](const char* name, const char* what) {
    for (const std::string& text : rendered.stats.warnings) {
      if (text.find(name) != std::string::npos && text.find(what) != std::string::npos) return true;
    }
    return false;
  };
  EXPECT_TRUE(is_told("sheet", "not closed"));
  EXPECT_TRUE(is_told("turned", "inside out"));
  // From the sheet to the box's far side; what meets nothing more has left all.
  EXPECT_NEAR(rendered.mean(), std::exp(-1.0), 1e-5);
}

}  // namespace
}  // namespace relief::test
