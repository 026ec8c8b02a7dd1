// When a render stops: samples, noise threshold, time limit, interruption.
#include <chrono>

#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

/// Left half: a flat sky. Right half: a metal ball under a small light, noisy.
Scene half_noisy_scene()
{
  Scene scene = empty_scene();
  Material material = diffuse_material({0.8f, 0.8f, 0.8f});
  Affine3 place;
  place.p = {1.0f, 0, 0};
  add_object(scene, sphere_mesh(0.6f, 32, 16, true), material, place);
  scene.environment.color = {0.5f, 0.5f, 0.5f};
  Light disk;
  disk.kind = LightKind::kDisk;
  disk.P = {2, 2, 2};
  disk.axis = normalize(Vec3f{-1, -2, -2});
  disk.edge_u = from_local(frame_from_normal(disk.axis), {0.4f, 0, 0});
  disk.edge_v = from_local(frame_from_normal(disk.axis), {0, 0.4f, 0});
  disk.area = kPi * 0.16f;
  disk.emission = {8, 8, 8};
  scene.lights.push_back(disk);
  return scene;
}

TEST(SamplingLimits, NoiseThresholdSpendsSamplesWhereTheNoiseIs)
{
  const Scene scene = half_noisy_scene();
  RenderOptions options = render_options(scene, 64, 4096);
  // Cycles' numbers: 16 / threshold^.3 samples at least, of a multiple of 16 the first that is more than one larger.
  const struct {
    float threshold;
    int min_samples;
    float flat;
  } kCases[] = {{0.004f, 0, 96}, {0.004f, 20, 32}, {0.004f, 31, 48}, {0.004f, 1, 16}, {0.1f, 0, 48}, {0.01f, 0, 80}};
  for (const auto& [threshold, min_samples, flat] : kCases) {
    options.settings.noise_threshold = threshold;
    options.settings.min_samples = min_samples;
    const Rendered r = render_scene(scene, options);
    EXPECT_EQ(r.stats.stop_reason, "noise_threshold");
    EXPECT_EQ(*r.at(Aov::kSampleCount, 2, 2), flat) << threshold << ' ' << min_samples;
    double sum = 0;
    float most = 0;
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 64; ++x) {
        sum += static_cast<double>(*r.at(Aov::kSampleCount, x, y));
        most = std::max(most, *r.at(Aov::kSampleCount, x, y));
      }
    }
    if (threshold < 0.01f) {
      EXPECT_GT(most, flat);
    }
    EXPECT_DOUBLE_EQ(sum / (64 * 64), r.stats.samples_per_pixel);
  }
}

/// What Cycles compares with five times the threshold, of a pixel of a finished picture.
double cycles_error(const Rendered& r, int x, int y, bool is_linear, double exposure)
{
  const float* all = r.at(Aov::kBeauty, x, y);
  const float* half = r.at(Aov::kHalf, x, y);
  double difference = 0, light = 0;
  for (int c = 0; c < 3; ++c) {
    // The layers are exposed.
    difference += std::abs(static_cast<double>(all[c]) - static_cast<double>(half[c])) / exposure;
    light += static_cast<double>(all[c]) / exposure;
  }
  if (is_linear) {
    difference *= exposure;
    light *= exposure;
  }
  return difference / (1e-4 + (is_linear && light >= 1 ? light : std::sqrt(light)));
}

TEST(SamplingLimits, PixelsRestByTheRuleOfCycles)
{
  const Scene scene = half_noisy_scene();
  for (const NoiseMaths maths : {NoiseMaths::k34, NoiseMaths::k43}) {
    const bool is_linear = maths == NoiseMaths::k43;
    for (const float exposure : {1.0f, 4.0f}) {
      RenderOptions options = render_options(scene, 64, 1024);
      options.settings.noise_threshold = 0.01f;
      options.settings.min_samples = 4;
      options.settings.noise_maths = maths;
      options.settings.film_exposure = exposure;
      const Rendered r = render_scene(scene, options);
      int resting = 0;
      double most = 0;
      for (int y = 0; y < 64; ++y) {
        for (int x = 0; x < 64; ++x) {
          // A pixel and all around it were found good when it came to rest, and have had no sample since unless they go on for others.
          if (*r.at(Aov::kSampleCount, x, y) == 1024) continue;
          ++resting;
          const double error = cycles_error(r, x, y, is_linear, exposure);
          EXPECT_LT(error, 0.05 * 1.001) << x << ' ' << y;
          most = std::max(most, error);
        }
      }
      EXPECT_GT(resting, 64 * 32);
      // A stricter rule would leave none so near the bound.
      EXPECT_GT(most, 0.9 * 0.05);
    }
  }
}

TEST(SamplingLimits, ThreadsAndPassesDoNotChangeWhereSamplesGo)
{
  const Scene scene = half_noisy_scene();
  RenderOptions options = render_options(scene, 50, 512);
  options.settings.noise_threshold = 0.02f;
  const Rendered whole = render_scene(scene, options);
  // Watched pictures have smaller passes.
  options.preview = [](const FilmView&, double) {};
  const Rendered watched = render_scene(scene, options);
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 50; ++x) {
      ASSERT_EQ(*whole.at(Aov::kSampleCount, x, y), *watched.at(Aov::kSampleCount, x, y));
      ASSERT_EQ(whole.radiance(x, y), watched.radiance(x, y));
    }
  }
}

TEST(SamplingLimits, TimeLimitEndsTheRender)
{
  const Scene scene = half_noisy_scene();
  RenderOptions options = render_options(scene, 64, 1 << 24);
  options.time_limit_seconds = 0.2;
  const Rendered r = render_scene(scene, options);
  EXPECT_EQ(r.stats.stop_reason, "time_limit");
  EXPECT_GE(r.stats.samples_per_pixel, 1);
  EXPECT_LT(r.stats.samples_per_pixel, 1 << 24);
}

TEST(SamplingLimits, AnInterruptedRenderKeepsWhatItHas)
{
  const Scene scene = half_noisy_scene();
  const RenderOptions options = render_options(scene, 64, 1 << 24);
  std::atomic<bool> stop{false};
  Statistics stats;
  const RenderedImage image = render(
      scene, options, stop, [&](const RenderProgress& p) { stop = p.samples_per_pixel > 8; }, stats);
  EXPECT_EQ(stats.stop_reason, "interrupted");
  EXPECT_GE(stats.samples_per_pixel, 8);
  const float* first = image.view.pixels;
  EXPECT_NEAR(static_cast<double>(first[0]), 0.5, 1e-3);
}

TEST(SamplingLimits, BouncesAreCutWhereAsked)
{
  // Inside a closed emitter with albedo ½ and emission ½, n bounces gather 1 − 2^−(n+2).
  Scene scene = empty_scene();
  Material material = diffuse_material({0.5f, 0.5f, 0.5f});
  material.emission = {0.5f, 0.5f, 0.5f};
  material.double_sided = true;
  add_object(scene, sphere_mesh(10, 32, 16, false), material);
  for (const int bounces : {0, 1, 2, 5}) {
    scene.render.max_bounces = bounces;
    const Rendered r = render_scene(scene, render_options(scene, 16, 64));
    EXPECT_NEAR(r.mean(), 1 - std::pow(0.5, bounces + 2), 0.01) << bounces << " bounces";
  }
}

}  // namespace
}  // namespace relief::test
