// The same seed gives the same bits, however the work is spread and however much of the picture is asked for.
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

/// A bit of everything: smooth normals, glass, metal, instances, a blended pane, four kinds of light.
Scene mixed_scene()
{
  Scene scene = empty_scene();
  add_object(scene, quad_mesh({-5, -1, -5}, {0, 0, 10}, {10, 0, 0}), diffuse_material({0.6f, 0.5f, 0.4f}));
  Material metal;
  metal.roughness = 0.3f;
  add_object(scene, sphere_mesh(0.5f, 24, 12, true), metal);
  for (int i = 0; i < 5; ++i) {
    Instance copy = scene.instances.back();
    copy.world_from_object.p = {0.7f * static_cast<float>(i) - 1.4f, 0.3f * static_cast<float>(i % 2), -1};
    scene.instances.push_back(copy);
  }
  Material glass;
  glass.metallic = 0;
  glass.roughness = 0.1f;
  glass.transmission = 1;
  glass.thickness = 1;
  Affine3 place;
  place.p = {0.4f, 0.6f, 0.5f};
  add_object(scene, sphere_mesh(0.4f, 24, 12, true), glass, place);
  Material pane = diffuse_material({0.1f, 0.2f, 0.8f});
  pane.alpha_mode = AlphaMode::kBlend;
  pane.base_alpha = 0.4f;
  add_object(scene, quad_mesh({-1.2f, -0.8f, 0.6f}, {0.8f, 0, 0}, {0, 1.2f, 0}), pane);
  Material emitter = diffuse_material({0, 0, 0});
  emitter.emission = {5, 4, 3};
  place.p = {-1, 1.5f, 0};
  add_object(scene, sphere_mesh(0.1f, 8, 4, false), emitter, place);
  scene.environment.color = {0.2f, 0.25f, 0.3f};
  Light disk;
  disk.kind = LightKind::kDisk;
  disk.P = {0, 2, 0};
  disk.axis = {0, -1, 0};
  disk.edge_u = {0.5f, 0, 0};
  disk.edge_v = {0, 0, 0.5f};
  disk.area = kPi * 0.25f;
  disk.emission = {3, 3, 3};
  scene.lights.push_back(disk);
  return scene;
}

Rendered render_with_threads(const Scene& scene, const RenderOptions& options, int threads)
{
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  tbb::task_arena arena(threads);
  return arena.execute([&] { return render_scene(scene, options); });
}

TEST(Determinism, OneAndManyThreadsGiveTheSameBits)
{
  const Scene scene = mixed_scene();
  const RenderOptions options = render_options(scene, 72, 20);
  const Rendered one = render_with_threads(scene, options, 1);
  for (const int threads : {2, 4}) {
    const Rendered many = render_with_threads(scene, options, threads);
    EXPECT_EQ(one.image.pixels, many.image.pixels) << threads << " threads";
  }
}

TEST(Determinism, TheFirstSampleThatIsNotFiniteIsTheFirstOfThePicture)
{
  // A card of infinite radiance, which no loader would let pass, fills the pixels from (16, 38) on.
  Scene scene = empty_scene();
  Material card = diffuse_material({0, 0, 0});
  card.emission = {kInfinity, kInfinity, kInfinity};
  add_object(scene, quad_mesh({-0.8f, -1.2f, 0}, {1.2f, 0, 0}, {0, 0.9f, 0}), card);
  RenderOptions options = render_options(scene, 64, 20);
  options.aov_mask = 1;
  options.settings.max_bounces = 0;
  options.crop_x0 = 5;
  options.crop_y0 = 7;
  options.crop_x1 = options.crop_y1 = 64;
  for (const int threads : {1, 2, 4}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    const std::atomic<bool> stop{false};
    Statistics stats;
    arena.execute([&] { return render(scene, options, stop, {}, stats); });
    EXPECT_EQ(stats.counters.nonfinite_samples, 24u * 18u * 20u);
    ASSERT_TRUE(stats.first_nonfinite) << threads << " threads";
    EXPECT_EQ(stats.first_nonfinite->x, 16);
    EXPECT_EQ(stats.first_nonfinite->y, 38);
    EXPECT_EQ(stats.first_nonfinite->sample_index, 0u);
  }
}

TEST(Determinism, CropsShowTheWholePicturesPixels)
{
  const Scene scene = mixed_scene();
  RenderOptions options = render_options(scene, 72, 8);
  const Rendered whole = render_scene(scene, options);
  options.crop_x0 = 13;
  options.crop_y0 = 21;
  options.crop_x1 = 50;
  options.crop_y1 = 40;
  const Rendered crop = render_scene(scene, options);
  ASSERT_EQ(crop.image.view.width, 37);
  ASSERT_EQ(crop.image.view.height, 19);
  for (int y = 0; y < 19; ++y) {
    for (int x = 0; x < 37; ++x) {
      const Vec3f a = whole.radiance(x + 13, y + 21);
      const Vec3f b = crop.radiance(x, y);
      ASSERT_TRUE(a == b) << x << "," << y;
    }
  }
}

TEST(Determinism, SeedsGiveDifferentNoise)
{
  const Scene scene = mixed_scene();
  RenderOptions options = render_options(scene, 32, 4);
  const Rendered a = render_scene(scene, options);
  options.settings.seed = 1;
  const Rendered b = render_scene(scene, options);
  EXPECT_NE(a.image.pixels, b.image.pixels);
  EXPECT_NEAR(a.mean(), b.mean(), 0.1 * a.mean());
}

TEST(Determinism, InstructionSetsTakeTheSamePaths)
{
  // Fused multiply-adds change last digits, and through them a path now and then. Other random numbers would change every
  // pixel by its noise, 1.4 times what is compared with.
  const Scene scene = mixed_scene();
  const RenderOptions options = render_options(scene, 32, 64);
  setenv("RELIEF_ISA", "baseline", 1);
  const Rendered baseline = render_scene(scene, options);
  setenv("RELIEF_ISA", "avx2", 1);
  const Rendered avx2 = render_scene(scene, options);
  unsetenv("RELIEF_ISA");
  double squared = 0;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      const Vec3f d = baseline.radiance(x, y) - avx2.radiance(x, y);
      squared += static_cast<double>(dot(d, d));
    }
  }
  EXPECT_LT(std::sqrt(squared / (3 * 32 * 32)), 0.05 * baseline.stats.error_rmse);
}

}  // namespace
}  // namespace relief::test
