// The displaced example is the same picture by every method. The same seed gives the same paths, so methods that trace
// the same surface differ by nothing but paths that graze an edge; triangles differ by what they approximate.
#include <filesystem>

#include "scene/load.h"
#include "tests/image/render_runs.h"
#include "tests/support/displacement_methods.h"

namespace relief::test {
namespace {

struct Rendered {
  RenderedImage image;
  Statistics stats;
};

Rendered render_displaced(const Scene& scene,
                          DisplacementMethod method,
                          float lod,
                          Aov also = Aov::kBeauty,
                          int samples = 16)
{
  RunOptions run;
  run.width = 128;
  run.height = 72;
  run.samples = samples;
  RenderOptions options = run_render_options(scene, run);
  options.aov_mask = aov_bit(Aov::kBeauty) | aov_bit(Aov::kNormal) | aov_bit(Aov::kDepth) |
                     aov_bit(Aov::kDisplacementSteps) | 1u << static_cast<int>(also);
  options.displacement.method = method;
  options.displacement.lod = lod;
  const std::atomic<bool> stop{false};
  Rendered rendered;
  rendered.image = render(scene, options, stop, {}, rendered.stats);
  return rendered;
}

struct LayerDifference {
  double mean = 0;        ///< of the second image, over all channels
  double mean_error = 0;  ///< of the absolute differences
  double bias = 0;        ///< mean of the differences
};

LayerDifference layer_difference(const Rendered& a, const Rendered& b, Aov aov)
{
  const ImageView layer_a = film_layer(a.image.view, aov), layer_b = film_layer(b.image.view, aov);
  LayerDifference d;
  double count = 0;
  for (std::size_t c = 0; c < layer_a.channels.size(); ++c) {
    for (int y = 0; y < layer_a.height; ++y) {
      for (int x = 0; x < layer_a.width; ++x) {
        const double value_a = double{layer_a.channels[c].at(x, y)}, value_b = double{layer_b.channels[c].at(x, y)};
        if (!std::isfinite(value_a) || !std::isfinite(value_b)) continue;  // depth where nothing was hit
        d.mean += std::abs(value_b);
        d.mean_error += std::abs(value_a - value_b);
        d.bias += value_a - value_b;
        ++count;
      }
    }
  }
  return {d.mean / count, d.mean_error / count, d.bias / count};
}

Scene displaced_example(const std::string& name = "displaced")
{
  return scene_load(std::filesystem::path(RELIEF_SOURCE_DIR) / "examples" / name / (name + ".gltf"));
}

/// Both have two meshes, each with a map and a tiling of its own.
class DisplacementMethodsOnScene : public testing::TestWithParam<std::string> {};

TEST_P(DisplacementMethodsOnScene, OfOneSurfaceGiveOnePicture)
{
  const Scene scene = displaced_example(GetParam());
  const Rendered chord = render_displaced(scene, DisplacementMethod::chord, 0);
  EXPECT_EQ(chord.stats.displacement.method, "chord");
  for (const DisplacementMethod method : traversing_methods()) {
    if (method == DisplacementMethod::chord) continue;
    const Rendered other = render_displaced(scene, method, 0);
    const std::string name(displacement_method_label(method));
    EXPECT_EQ(other.stats.displacement.method, name);
    const LayerDifference depth = layer_difference(other, chord, Aov::kDepth);
    EXPECT_LT(depth.mean_error, 1e-6 * depth.mean) << name;
    EXPECT_LT(layer_difference(other, chord, Aov::kNormal).mean_error, 1e-4) << name;
    const LayerDifference beauty = layer_difference(other, chord, Aov::kBeauty);
    std::printf("%s: mean difference %.2g of the mean\n", name.c_str(), beauty.mean_error / beauty.mean);
    // A hundredth of the noise of 16 samples.
    EXPECT_LT(beauty.mean_error, 1e-3 * beauty.mean) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(Displacement,
                         DisplacementMethodsOnScene,
                         testing::Values("displaced", "desert_tire"),
                         [](const auto& each) { return each.param; });

TEST(DisplacementMethods, ThrowTheSameCaustic)
{
  // The same seed gives the same photons; those that graze an edge may go elsewhere. Triangles in place of the surface
  // send all a little astray: of their caustic the mean is compared, by four standard errors of 14,000 photons in each.
  const Scene scene = scene_load(std::filesystem::path(RELIEF_SOURCE_DIR) / "examples" / "caustics" / "caustics.gltf");
  const auto caustic_by = [&](DisplacementMethod method) {
    return render_displaced(scene, method, 0, Aov::kCaustic, 4);
  };
  const Rendered chord = caustic_by(DisplacementMethod::chord);
  EXPECT_GT(chord.stats.caustics.stored, 0u);
  for (const DisplacementMethod method : kDisplacementMethods) {
    if (method == DisplacementMethod::chord || method == DisplacementMethod::tessellate_grid) continue;
    const LayerDifference caustic = layer_difference(caustic_by(method), chord, Aov::kCaustic);
    const std::string name(displacement_method_label(method));
    std::printf("%s: caustic differs by %.2g of its mean, its mean by %.2g\n", name.c_str(),
                caustic.mean_error / caustic.mean, caustic.bias / caustic.mean);
    ASSERT_GT(caustic.mean, 0.0);
    const bool same_surface = method != DisplacementMethod::tessellate;
    EXPECT_LT(caustic.mean_error, (same_surface ? 1e-3 : 0.5) * caustic.mean) << name;
    EXPECT_LT(std::abs(caustic.bias), 0.05 * caustic.mean) << name;
  }
}

TEST(DisplacementMethods, TessellationApproachesTheSurface)
{
  // At level 2 a map has 64 × 64 texels: 1.4 million triangles in all. A texel is then 3 cm on the ground and 1 cm on
  // the ball, seen from 6 m and more; at the horizon a pixel is many of them.
  const Scene scene = displaced_example();
  const Rendered chord = render_displaced(scene, DisplacementMethod::chord, 2);
  for (const DisplacementMethod method : {DisplacementMethod::tessellate, DisplacementMethod::tessellate_grid}) {
    const Rendered triangles = render_displaced(scene, method, 2);
    const LayerDifference depth = layer_difference(triangles, chord, Aov::kDepth);
    const LayerDifference beauty = layer_difference(triangles, chord, Aov::kBeauty);
    const LayerDifference normal = layer_difference(triangles, chord, Aov::kNormal);
    std::printf("%s: depth differs by %.2g of it, normals by %.2g, radiance by %.2g of the mean, its mean by %.2g\n",
                displacement_method_label(method).data(), depth.mean_error / depth.mean, normal.mean_error,
                beauty.mean_error / beauty.mean, beauty.bias / beauty.mean);
    EXPECT_LT(depth.mean_error, 3e-3 * depth.mean);
    // Two facets a texel for one bilinear patch.
    EXPECT_LT(normal.mean_error, 0.03);
    EXPECT_LT(std::abs(beauty.bias), 0.01 * beauty.mean);
    EXPECT_EQ(triangles.stats.counters.displaced_prisms, 0u);
  }
}

TEST(DisplacementMethods, DetailThatPixelsCannotShowIsHardlyMissed)
{
  // As deep as they are, rivets and cobbles are their slopes, and no level but the finest looks like them.
  Scene scene = displaced_example();
  for (DisplacementSettings& displacement : scene.displacements) displacement.scale *= 0.1f;
  constexpr float kAuto = -1;
  const Rendered finest = render_displaced(scene, DisplacementMethod::chord, 0);
  for (const DisplacementMethod method : {DisplacementMethod::chord, DisplacementMethod::rmip}) {
    const Rendered seen = render_displaced(scene, method, kAuto);
    const LayerDifference depth = layer_difference(seen, finest, Aov::kDepth);
    const LayerDifference beauty = layer_difference(seen, finest, Aov::kBeauty);
    std::printf("%s: depth differs by %.2g of it, radiance by %.2g of the mean, its mean by %.2g\n",
                displacement_method_label(method).data(), depth.mean_error / depth.mean,
                beauty.mean_error / beauty.mean, beauty.bias / beauty.mean);
    EXPECT_GT(depth.mean_error, 0.0);
    EXPECT_LT(depth.mean_error, 3e-3 * depth.mean);
    EXPECT_LT(std::abs(beauty.bias), 0.01 * beauty.mean);
  }
}

TEST(DisplacementMethods, AFractionalLevelIsAMixtureOfTwo)
{
  const Scene scene = displaced_example();
  const Rendered fine = render_displaced(scene, DisplacementMethod::chord, 4);
  const Rendered coarse = render_displaced(scene, DisplacementMethod::chord, 5);
  const Rendered between = render_displaced(scene, DisplacementMethod::chord, 4.25f);
  // Of 16 samples a pixel exactly a quarter takes the coarser level (the dither is stratified), so first hits are
  // those of the one or the other.
  const double to_fine = layer_difference(between, fine, Aov::kDepth).mean_error;
  const double to_coarse = layer_difference(between, coarse, Aov::kDepth).mean_error;
  const double whole = layer_difference(fine, coarse, Aov::kDepth).mean_error;
  EXPECT_NEAR(to_fine, 0.25 * whole, 0.05 * whole);
  EXPECT_NEAR(to_coarse, 0.75 * whole, 0.05 * whole);
}

TEST(DisplacementMethods, StepsOfCameraRaysAreAPartOfAll)
{
  const Scene scene = displaced_example();
  const Rendered chord = render_displaced(scene, DisplacementMethod::chord, 0);
  const ImageView steps = film_layer(chord.image.view, Aov::kDisplacementSteps);
  double sum = 0;
  for (int y = 0; y < steps.height; ++y) {
    for (int x = 0; x < steps.width; ++x) sum += double{steps.channels[0].at(x, y)};
  }
  const Counters& counters = chord.stats.counters;
  EXPECT_GT(sum, 0);
  EXPECT_LT(sum * 16, static_cast<double>(counters.displaced_bounds + counters.displaced_texels));
  // The sky at the top costs nothing, the ball something.
  EXPECT_EQ(steps.channels[0].at(2, 2), 0.0f);
  EXPECT_GT(steps.channels[0].at(64, 36), 1.0f);
}

}  // namespace
}  // namespace relief::test
