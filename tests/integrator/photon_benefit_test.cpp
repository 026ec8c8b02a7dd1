// Whether photons are traced where they pay and nowhere else, and what they cost a picture with a noise threshold.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "integrator/kept_context.h"
#include "integrator/photon_benefit.h"
#include "tests/support/caustic_scene.h"

namespace relief::test {
namespace {

/// A ball over a floor, and a square lamp above.
Scene ball_scene(const Material& material, float lamp_half, float radiance)
{
  Scene scene = empty_scene();
  add_floor(scene, 2);
  Affine3 place;
  place.p = {0, 0.5f, 0};
  add_caster(scene, sphere_mesh(0.4f, 64, 32, true), material, place);
  scene.lights.push_back(square_light({0.3f, 2, 0}, normalize(Vec3f{-0.15f, -1, 0}), lamp_half, radiance));
  look_down(scene, {}, 1, 3);
  return scene;
}

/// As Blender's: half a degree wide.
Light sun_light()
{
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = normalize(Vec3f{0.3f, -1, 0.2f});
  sun.emission = splat3(3);
  sun.cone = 1.05e-5f;
  return sun;
}

Material metal_material(float roughness)
{
  Material metal;
  metal.base_color = {0.9f, 0.7f, 0.3f};
  metal.roughness = roughness;
  return metal;
}

TEST(PhotonBenefit, SmoothGlassUnderASmallLampHasPhotons)
{
  const Scene scene = ball_scene(glass_material(), 0.02f, 3000);
  const Rendered picture = render_scene(scene, caustic_options(scene, CausticsMode::kAuto, 48, 64));
  EXPECT_GT(picture.stats.caustics.photons, 0u) << picture.stats.caustics.reason;
  EXPECT_GT(picture.stats.caustics.error_ratio, picture.stats.caustics.cost_ratio);
}

TEST(PhotonBenefit, RoughMetalUnderASunIsLeftToPaths)
{
  // A lamp over all of the floor has soft shadows, and noise of its own.
  Scene scene = ball_scene(metal_material(0.5f), 1.5f, 1);
  scene.lights.push_back(sun_light());
  const Rendered automatic = render_scene(scene, caustic_options(scene, CausticsMode::kAuto, 160, 4));
  EXPECT_EQ(automatic.stats.caustics.photons, 0u) << automatic.stats.caustics.reason;
  EXPECT_EQ(automatic.stats.caustics.passes, 0u);
  EXPECT_NE(automatic.stats.caustics.reason.find("left to paths: "), std::string::npos);
  EXPECT_LT(automatic.stats.caustics.error_ratio, automatic.stats.caustics.cost_ratio);
  // Not one bit is left of the pass, nor of the pilot.
  const Rendered off = render_scene(scene, caustic_options(scene, CausticsMode::kOff, 160, 4));
  EXPECT_EQ(automatic.image.pixels, off.image.pixels);
  EXPECT_EQ(automatic.stats.counters.camera_rays, off.stats.counters.camera_rays);
}

/// What is chosen for a picture of 256 × 256 pixels, of which no sample is taken.
/// @param samples  planned; of fewer than 32 the pilot has no quarter
PhotonChoice chosen_for(const Scene& scene, int samples)
{
  const RenderOptions options = caustic_options(scene, CausticsMode::kAuto, 256, samples);
  KeptContext kept;
  const SceneContext& context = kept.get(scene, render_context_options(options));
  FilterTable filter;
  pixel_filter_table_make(options.settings.filter, filter);
  KernelGlobals g = render_globals(context, options, filter);
  const std::atomic<bool> stop = false;
  return photon_choice_make(context, options, g, stop);
}

TEST(PhotonBenefit, AQuarterOfThePilotChoosesAsTheWhole)
{
  Scene metal = ball_scene(metal_material(0.5f), 1.5f, 1);
  metal.lights.push_back(sun_light());
  const PhotonChoice none = chosen_for(metal, 32);
  EXPECT_FALSE(none.photons) << none.reason;
  EXPECT_NE(none.reason.find(" at best "), std::string::npos) << none.reason;
  EXPECT_FALSE(chosen_for(metal, 31).photons);
  // What a quarter cannot rule out has the figures of the whole.
  const PhotonChoice glass = chosen_for(ball_scene(glass_material(), 0.02f, 3000), 32);
  EXPECT_TRUE(glass.photons) << glass.reason;
  EXPECT_GT(glass.error_ratio, glass.cost_ratio);
}

TEST(PhotonBenefit, CausticsOutsideThePictureAreNotTraced)
{
  Scene scene = ball_scene(glass_material(), 0.02f, 3000);
  // Another floor, ten metres off.
  add_object(scene, quad_mesh({28, 0, 2}, {4, 0, 0}, {0, 0, -4}), diffuse_material(splat3(0.5f)));
  scene.instances.back().flags |= kCausticReceiver;
  look_down(scene, {30, 0, 0}, 1, 3);
  const Rendered picture = render_scene(scene, caustic_options(scene, CausticsMode::kAuto, 48, 16));
  EXPECT_EQ(picture.stats.caustics.photons, 0u);
  EXPECT_EQ(picture.stats.caustics.reason, "no caustic shows in the picture");
}

TEST(PhotonBenefit, TheChoiceIsTheSameForAnyNumberOfThreadsAndForCrops)
{
  const Scene scene = ball_scene(glass_material(), 0.05f, 500);
  RenderOptions options = caustic_options(scene, CausticsMode::kAuto, 64, 8);
  const auto with_threads = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    return arena.execute([&] { return render_scene(scene, options).stats.caustics; });
  };
  const CausticStatistics one = with_threads(1);
  ASSERT_GT(one.error_ratio, 0);
  EXPECT_EQ(with_threads(3).error_ratio, one.error_ratio);
  EXPECT_EQ(with_threads(3).cost_ratio, one.cost_ratio);
  options.crop_x1 = options.crop_y1 = 16;
  EXPECT_EQ(with_threads(2).error_ratio, one.error_ratio);
}

/// Mean over pixels and channels of a picture's squared error relative to what it should be, as Statistics::error_relmse.
double relative_error(const Scene& scene, CausticsMode mode, int samples, const std::vector<Vec3f>& truth)
{
  constexpr int kSize = 32, kRuns = 6;
  double sum = 0;
  for (int run = 0; run < kRuns; ++run) {
    RenderOptions options = caustic_options(scene, mode, kSize, samples);
    options.settings.caustics.photons = 4096;
    options.settings.seed = 900u + static_cast<std::uint64_t>(run);
    const Rendered picture = render_scene(scene, options);
    for (int i = 0; i < kSize * kSize; ++i) {
      const double t = static_cast<double>(truth[static_cast<std::size_t>(i)].x);
      const double e = static_cast<double>(picture.radiance(i % kSize, i / kSize).x) - t;
      sum += e * e / (t * t + 0.01) / (kSize * kSize * kRuns);
    }
  }
  return sum;
}

TEST(PhotonBenefit, ThePilotPromisesNoMoreThanPhotonsKeep)
{
  // A lamp that paths find now and then, so that their noise can be measured by rendering.
  const Scene scene = ball_scene(glass_material(), 0.1f, 100);
  RenderOptions exact = caustic_options(scene, CausticsMode::kOn, 32, 256);
  const Rendered reference = render_scene(scene, exact);
  std::vector<Vec3f> truth;
  for (int i = 0; i < 32 * 32; ++i) truth.push_back(reference.radiance(i % 32, i / 32));
  const double measured =
      relative_error(scene, CausticsMode::kOff, 8, truth) / relative_error(scene, CausticsMode::kOn, 8, truth);
  const double told =
      render_scene(scene, caustic_options(scene, CausticsMode::kAuto, 32, 8)).stats.caustics.error_ratio;
  std::printf("paths over photons: told %.3f, measured %.3f\n", told, measured);
  EXPECT_GT(told, 2);
  EXPECT_LT(told, measured);
}

TEST(PhotonBenefit, WhatAPathMeetsIsTheLightOrTheLobe)
{
  const Box3 box{{-0.1f, -0.1f, -0.1f}, {0.1f, 0.1f, 0.1f}};
  const auto radiance = [](CausticLight light) { return light.irradiance / light.solid_angle; };
  // By smooth glass a path meets the lamp itself.
  EXPECT_NEAR(radiance(caustic_light(square_light({0, 2, 0}, {0, -1, 0}, 0.05f, 7), box, 0)), 7, 1e-4);
  Light ball = point_light({0, 2, 0}, 5);
  ball.radius = 0.1f;
  EXPECT_NEAR(radiance(caustic_light(ball, box, 0)), 5 / (3.14159265 * 0.01), 1e-3);
  EXPECT_NEAR(caustic_light(ball, box, 0).irradiance, 5.0 / 4, 1e-6);
  // What a wide lobe makes of a light does not depend on the light's size.
  const double wide = radiance(caustic_light(ball, box, 0.3));
  ball.radius = 0.001f;
  EXPECT_NEAR(radiance(caustic_light(ball, box, 0.3)) / wide, 1, 1e-6);
  EXPECT_LT(wide, 5.0 / 4);
}

TEST(PhotonBenefit, ALampShinesOnWhatIsNearIt)
{
  const Box3 box{{-0.1f, -0.2f, -0.3f}, {0.1f, 0.2f, 0.3f}};
  const auto irradiance = [&](Vec3f P) { return caustic_light(point_light(P, 5), box, 0.1).irradiance; };
  // From the middle of a box, at its faces in the mean; above it, a plane's light comes from twice as far.
  EXPECT_NEAR(irradiance({0, 0, 0}), 5 / 0.04, 1e-4);
  EXPECT_NEAR(irradiance({0, 0.25f, 0}), 5 / 0.01, 1e-3);
  EXPECT_NEAR(irradiance({0, 20, 0}), 5.0 / 400, 1e-6);
}

TEST(PhotonBenefit, FacetsOfGlassTurnPathsByWhatSnellSays)
{
  constexpr double kTilt = 1e-4;
  for (const double ior : {1.2, 1.45, 2.4}) {
    const double out = std::asin(ior * std::sin(kTilt)) - kTilt, in = kTilt - std::asin(std::sin(kTilt) / ior);
    EXPECT_NEAR(caster_bending(ior, false), out / (2 * kTilt), 1e-6);
    EXPECT_NEAR(caster_bending(ior, true), in / (2 * kTilt), 1e-6);
  }
  EXPECT_EQ(caster_bending(0, false), 1);
}

TEST(PhotonBenefit, ALampInGlassHasPhotonsThoughPathsBlurWhatTheySee)
{
  // As Blender renders by default. A blurred facet of glass still turns a path little: nearly all of it misses the lamp.
  Scene scene = empty_scene();
  add_floor(scene, 2);
  Affine3 place;
  place.p = {0, 0.5f, 0};
  add_caster(scene, sphere_mesh(0.4f, 64, 32, true), glass_material(), place);
  scene.lights.push_back(point_light({0, 0.5f, 0}, 1));
  scene.lights.back().radius = 0.03f;
  look_down(scene, {}, 1, 3);
  RenderOptions options = caustic_options(scene, CausticsMode::kAuto, 48, 64);
  options.settings.filter_glossy = 1;
  options.settings.clamp_indirect = 10;
  const CausticStatistics told = render_scene(scene, options).stats.caustics;
  EXPECT_GT(told.photons, 0u) << told.reason;
  // What they do to the noise, by two seeds each.
  const auto noise = [&](CausticsMode mode) {
    options.settings.caustics.mode = mode;
    Rendered of_seed[2];
    for (std::uint64_t seed : {0u, 1u}) {
      options.settings.seed = 70 + seed;
      of_seed[seed] = render_scene(scene, options);
    }
    double sum = 0;
    for (int i = 0; i < 48 * 48; ++i) {
      const Vec3f a = of_seed[0].radiance(i % 48, i / 48), b = of_seed[1].radiance(i % 48, i / 48);
      const double mean = static_cast<double>(a.x + b.x) / 2, difference = static_cast<double>(a.x - b.x);
      sum += difference * difference / (mean * mean + 0.01);
    }
    return sum;
  };
  const double measured = noise(CausticsMode::kOff) / noise(CausticsMode::kOn);
  std::printf("a lamp in glass, paths over photons: told %.3f, measured %.3f\n", told.error_ratio, measured);
  EXPECT_GT(measured, told.cost_ratio);
  // Were light spread as by mirrors, half of that would be told.
  EXPECT_GT(told.error_ratio, measured);
}

TEST(PhotonBenefit, ClampedPathsHaveLessNoiseTheBrighterTheLight)
{
  // As often as the light is met, and the square of what is left of it then.
  const double dim = caustic_second_moment({1, 0.5}, 10, 1e9), bright = caustic_second_moment({1, 1e-4}, 10, 1e9);
  EXPECT_NEAR(dim, 1, 1e-9);
  EXPECT_NEAR(bright, 10.0 * 10 / 5000, 1e-9);
  EXPECT_NEAR(caustic_second_moment({1, 1e-4}, 0, 1e9), 5000, 1e-6);
  // What no path meets is finite, and the worse the more samples there are to be.
  EXPECT_NEAR(caustic_second_moment({1, 0}, 10, 64) / caustic_second_moment({1, 0}, 10, 16), 4, 1e-9);
}

TEST(PhotonTurns, NoSampleHasMorePhotonsTracedForItThanWithoutAThreshold)
{
  EXPECT_EQ(photon_turn_samples(1), 1u);
  for (double active = 0.999; active > 1.0 / 8; active *= 0.97) {
    const std::uint32_t samples = photon_turn_samples(active);
    EXPECT_EQ(samples % 2, 0u);
    EXPECT_GE(samples * active, 2) << active;  // two passes
    EXPECT_LE(samples, 16u);
  }
  // A picture of which a corner alone is noisy: photons a sample do not rise, and nothing is lost or counted twice where photons
  // serve several samples.
  Scene scene = ball_scene(glass_material(), 0.05f, 500);
  look_down(scene, {1.5f, 0, 1.5f}, 3, 6);
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 96, 200);
  options.settings.caustics.photons = 4096;
  constexpr int kRuns = 6;
  double mean[2] = {}, squares[2] = {};
  for (int run = 0; run < kRuns; ++run) {
    for (const int adaptive : {0, 1}) {
      options.settings.seed = 40u + static_cast<std::uint64_t>(run);
      options.settings.noise_threshold = adaptive != 0 ? 0.03f : 0.0f;
      options.settings.samples = adaptive != 0 ? 200 : 48;
      const Rendered picture = render_scene(scene, options);
      const double caustic = mean_of(picture, Aov::kCaustic);
      mean[adaptive] += caustic / kRuns;
      squares[adaptive] += caustic * caustic / kRuns;
      if (adaptive == 0) continue;
      EXPECT_LT(picture.stats.samples_per_pixel, 100);
      EXPECT_GT(picture.stats.counters.camera_rays, 20u * 96 * 96);
      EXPECT_LE(static_cast<double>(picture.stats.caustics.photons), (picture.stats.samples_per_pixel + 2) * 4096);
    }
  }
  const auto variance = [&](int i) { return (squares[i] - mean[i] * mean[i]) / (kRuns - 1); };
  EXPECT_NEAR(mean[1] / mean[0], 1, 4 * std::sqrt(variance(0) + variance(1)) / mean[0] + 0.005);
  std::printf("caustics with a threshold over those without: %.4f\n", mean[1] / mean[0]);
}

}  // namespace
}  // namespace relief::test
