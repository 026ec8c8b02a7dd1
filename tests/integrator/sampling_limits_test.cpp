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
  options.settings.noise_threshold = 0.004f;
  const Rendered r = render_scene(scene, options);
  EXPECT_EQ(r.stats.stop_reason, "noise_threshold");
  const float flat = *r.at(Aov::kSampleCount, 2, 2);
  const float noisy = *r.at(Aov::kSampleCount, 55, 32);
  EXPECT_EQ(flat, 16);
  EXPECT_GT(noisy, 4 * flat);
}

TEST(SamplingLimits, NoiseThresholdIsMet)
{
  // The threshold is an error relative to the tile's mean; the true one is found from a long reference.
  const Scene scene = half_noisy_scene();
  RenderOptions options = render_options(scene, 64, 4096);
  options.settings.noise_threshold = 0.02f;
  const Rendered r = render_scene(scene, options);
  options.settings.noise_threshold = 0;
  options.settings.samples = 4096;
  options.settings.seed = 5;
  const Rendered reference = render_scene(scene, options);
  int late = 0;
  for (int tile = 0; tile < 16; ++tile) {
    double squared = 0;
    double mean = 0;
    for (int i = 0; i < 256; ++i) {
      const int x = tile % 4 * 16 + i % 16;
      const int y = tile / 4 * 16 + i / 16;
      squared += sqr(luminance(r.radiance(x, y) - reference.radiance(x, y)));
      mean += luminance(reference.radiance(x, y));
    }
    if (std::sqrt(squared / 256) / (mean / 256) > 0.02 * 1.25) ++late;
  }
  // A tile stops when its estimate is low, so some are a little over; none may be far over.
  EXPECT_EQ(late, 0);
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
