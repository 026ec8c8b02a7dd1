// The caustics example under a lamp so wide that paths find it: photons through displaced glass bring what paths bring.
//
// Of each, the means of sixteen regions over independent runs. They are judged by the standard error of their difference
// at 4 of it (1e-3 for all regions) and by what the density estimate blurs across a region's border.
#include <array>
#include <filesystem>

#include "scene/load.h"
#include "tests/image/render_runs.h"

namespace relief::test {
namespace {

constexpr int kSide = 4, kWidth = 64, kHeight = 36, kRuns = 8;

struct Regions {
  std::array<double, kSide * kSide> mean{}, variance{};
};

Scene wide_lamp_scene(CausticsMode mode)
{
  Scene scene = scene_load(std::filesystem::path(RELIEF_SOURCE_DIR) / "examples" / "caustics" / "caustics.gltf");
  constexpr float kWider = 40;
  for (Light& light : scene.lights) {
    light.edge_u *= kWider;
    light.edge_v *= kWider;
    light.area *= kWider * kWider;
    light.emission *= 1 / (kWider * kWider);
  }
  scene.render.caustics.mode = mode;
  scene.render.caustics.photons = 1 << 15;
  return scene;
}

Regions render_regions(const Scene& scene, int samples, std::uint64_t first_seed)
{
  Regions regions;
  for (int i = 0; i < kRuns; ++i) {
    RunOptions run;
    run.width = kWidth;
    run.height = kHeight;
    run.samples = samples;
    RenderOptions options = run_render_options(scene, run);
    options.settings.seed = first_seed + static_cast<std::uint64_t>(i);
    const std::atomic<bool> stop{false};
    Statistics stats;
    const RenderedImage image = render(scene, options, stop, {}, stats);
    std::array<double, kSide * kSide> mean{};
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double red = double{film_layer(image.view, Aov::kBeauty).channels[0].at(x, y)};
        mean[static_cast<std::size_t>(y / (kHeight / kSide) * kSide + x / (kWidth / kSide))] += red;
      }
    }
    for (std::size_t r = 0; r < mean.size(); ++r) {
      constexpr int kPixels = kWidth * kHeight / (kSide * kSide);
      mean[r] /= kPixels;
      regions.mean[r] += mean[r] / kRuns;
      regions.variance[r] += mean[r] * mean[r] / kRuns;
    }
  }
  for (std::size_t r = 0; r < regions.mean.size(); ++r) {
    regions.variance[r] = std::max(regions.variance[r] - regions.mean[r] * regions.mean[r], 0.0) / (kRuns - 1);
  }
  return regions;
}

TEST(CausticsExample, PhotonsThroughDisplacedGlassBringWhatPathsBring)
{
  const Regions photons = render_regions(wide_lamp_scene(CausticsMode::kOn), 8, 1);
  const Regions paths = render_regions(wide_lamp_scene(CausticsMode::kOff), 96, 100);
  constexpr double kBlur = 0.01;
  for (std::size_t r = 0; r < photons.mean.size(); ++r) {
    const double error = std::sqrt(photons.variance[r] + paths.variance[r]);
    EXPECT_NEAR(photons.mean[r], paths.mean[r], 4 * error + kBlur * paths.mean[r]) << "region " << r;
    std::printf("region %zu: %.4f of paths, standard error %.4f\n", r, photons.mean[r] / paths.mean[r],
                error / paths.mean[r]);
  }
}

}  // namespace
}  // namespace relief::test
