// A path that is followed once more is the path of the picture: its rays, its photons, its forks, its worth.
#include <gtest/gtest.h>

#include <cmath>

#include "integrator/trace.h"
#include "tests/support/caustic_scene.h"

namespace relief::test {
namespace {

/// The mean of a pixel's replayed samples is the pixel, up to the rounding of sums in another order.
void expect_replays(const Scene& scene, const RenderOptions& options, int x, int y)
{
  const Rendered picture = render_scene(scene, options);
  const FilmWindow window = render_window(options);
  Vec3f sum;
  for (int s = 0; s < options.settings.samples; ++s) {
    sum += trace_path(scene, options, {x, y, static_cast<std::uint32_t>(s)}).radiance;
  }
  const Vec3f mean = sum / static_cast<float>(options.settings.samples);
  const Vec3f expected = picture.radiance(x - window.x0, y - window.y0);
  ASSERT_GT(max_component(expected), 0.0f);
  for (const auto& [found, wanted] : {std::pair{mean.x, expected.x}, {mean.y, expected.y}, {mean.z, expected.z}}) {
    EXPECT_NEAR(found, wanted, 2e-6f * max_component(expected)) << x << ',' << y;
  }
}

/// A glass ball over a floor, in a room with a lamp.
Scene ball_scene(float roughness)
{
  Scene scene = empty_scene();
  add_object(scene, quad_mesh({-2, -0.6f, 2}, {4, 0, 0}, {0, 0, -4}), diffuse_material({0.7f, 0.6f, 0.5f}));
  scene.instances.back().flags |= kCausticReceiver;
  add_object(scene, quad_mesh({-2, -1, -1.5f}, {4, 0, 0}, {0, 3, 0}), diffuse_material({0.4f, 0.6f, 0.7f}));
  add_caster(scene, sphere_mesh(0.5f, 32, 16, true), glass_material(roughness));
  Material lamp = diffuse_material({0, 0, 0});
  lamp.emission = {20, 18, 15};
  add_object(scene, quad_mesh({-0.3f, 1.4f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}), lamp);
  scene.environment.color = {0.1f, 0.1f, 0.15f};
  return scene;
}

TEST(Replay, OfAPathIsThePath)
{
  const Scene scene = ball_scene(0.1f);
  RenderOptions options = caustic_options(scene, CausticsMode::kOff, 40, 7);
  options.settings.filter = PixelFilter::kBlackmanHarris;
  options.settings.filter_width = 1.5f;
  expect_replays(scene, options, 20, 20);
  options.settings.max_bounces = options.settings.transmission_bounces = 2;
  expect_replays(scene, options, 17, 23);
}

TEST(Replay, HasThePhotonsAndForksOfItsSample)
{
  for (const float roughness : {0.0f, 0.1f}) {
    const Scene scene = ball_scene(roughness);
    RenderOptions options = caustic_options(scene, CausticsMode::kOn, 40, 5);
    options.settings.caustics.photons = 1 << 13;
    expect_replays(scene, options, 20, 20);
    expect_replays(scene, options, 19, 33);
    options.crop_x0 = 7;
    options.crop_y0 = 9;
    options.crop_x1 = options.crop_y1 = 38;
    expect_replays(scene, options, 22, 24);
  }
}

TEST(Replay, TellsWhatIsNotFinite)
{
  Scene scene = empty_scene();
  Material card = diffuse_material({0, 0, 0});
  card.emission = {kInfinity, 1, 1};
  add_object(scene, quad_mesh({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), card);
  const RenderOptions options = render_options(scene, 16, 4);
  const PathReplay path = trace_path(scene, options, {8, 8, 3});
  EXPECT_EQ(path.radiance.x, kInfinity);
  EXPECT_EQ(path.radiance.y, 1.0f);
  EXPECT_EQ(path.rays.size(), 1u);
}

}  // namespace
}  // namespace relief::test
