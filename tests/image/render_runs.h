// Independent renders of one scene as one estimate with its variance: both sides of a z-test.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "exporters/picture.h"
#include "exporters/z_test.h"
#include "integrator/render.h"

namespace relief::test {

struct RunOptions {
  int width = 64, height = 48;
  int samples = 16;  ///< of each run, a pixel
  int num_runs = 16;
  std::uint64_t first_seed = 1;
  LightTechnique technique = LightTechnique::kMis;
};

/// Options of a render of the scene's first camera. Pixels are box filtered, so that a picture does not depend on how a
/// renderer cuts its filter off.
inline RenderOptions run_render_options(const Scene& scene, const RunOptions& run)
{
  RenderOptions options;
  options.settings = scene.render;
  options.settings.width = run.width;
  options.settings.height = run.height;
  options.settings.samples = run.samples;
  options.settings.filter = PixelFilter::kBox;
  options.settings.filter_width = 1;
  options.camera = scene.cameras.front().camera;
  options.camera.half_width =
      options.camera.half_height * static_cast<float>(run.width) / static_cast<float>(run.height);
  options.light_technique = run.technique;
  return options;
}

/// Mean of the runs and the variance of that mean, as channels R, G, B and variance.R, variance.G, variance.B.
///
/// The variance comes from the spread of runs with different seeds, which assumes nothing about how samples of one run
/// depend on one another.
/// @pre num_runs ≥ 2
inline Picture render_runs(const Scene& scene, const RunOptions& run)
{
  RenderOptions options = run_render_options(scene, run);
  const std::size_t num_values = 3 * static_cast<std::size_t>(run.width) * static_cast<std::size_t>(run.height);
  std::vector<double> sum(num_values), squares(num_values);
  const std::atomic<bool> stop{false};
  for (int i = 0; i < run.num_runs; ++i) {
    options.settings.seed = run.first_seed + static_cast<std::uint64_t>(i);
    Statistics stats;
    const RenderedImage image = render(scene, options, stop, {}, stats);
    EXPECT_EQ(stats.counters.nonfinite_samples, 0u);
    const ImageView beauty = film_layer(image.view, Aov::kBeauty);
    for (std::size_t k = 0; k < num_values; ++k) {
      const int pixel = static_cast<int>(k / 3);
      const double value = double{beauty.channels[k % 3].at(pixel % run.width, pixel / run.width)};
      sum[k] += value;
      squares[k] += value * value;
    }
  }
  Picture picture;
  picture.width = picture.full_width = run.width;
  picture.height = picture.full_height = run.height;
  for (const char* name : {"R", "G", "B", "variance.R", "variance.G", "variance.B"}) {
    picture.channels.push_back({name, ChannelType::kFloat, {}});
  }
  const double n = run.num_runs;
  for (std::size_t k = 0; k < num_values; ++k) {
    const double mean = sum[k] / n;
    const double variance = std::max(squares[k] / n - mean * mean, 0.0) / (n - 1);
    picture.channels[k % 3].values.push_back(static_cast<float>(mean));
    picture.channels[3 + k % 3].values.push_back(static_cast<float>(variance));
  }
  return picture;
}

/// Tests whether two pictures have the same expected value, with options that suit few samples.
///
/// A variance of N runs has N − 1 degrees of freedom, so that a single pixel's z follows Student's distribution and not
/// the normal one; blocks of 64 pixels and the image's mean average that out, single pixels may fail by themselves.
/// A part of a pixel that none of its samples met, a sliver of shadow say, leaves no variance either: every pixel is at
/// least as uncertain as one sample of the picture's mean radiance, in or out, makes it.
/// @param num_samples       a pixel, of all runs of `a`
/// @param allowed_outliers  share of single pixels that may fail: the more, the rarer the bright samples are
inline ZTestResult z_test_pictures(const Picture& a,
                                   const Picture& b,
                                   int num_samples,
                                   double significance,
                                   double allowed_outliers = 0.02)
{
  double mean = 0;
  for (const char* name : {"R", "G", "B"}) {
    for (const float value : b.find(name)->values) mean += double{value};
  }
  mean /= 3.0 * b.width * b.height;
  ZTestOptions options;
  options.significance = significance;
  options.allowed_outliers = allowed_outliers;
  options.variance_floor = mean / num_samples * (mean / num_samples);
  return z_test(picture_layer(a, ""), picture_layer(a, "variance"), picture_layer(b, ""), picture_layer(b, "variance"),
                options);
}

/// What failed where, for messages.
inline std::string z_text(const ZTestResult& r)
{
  const auto extreme = [](const ZExtreme& e) {
    return "z " + std::to_string(e.z) + " at " + std::to_string(e.x) + "," + std::to_string(e.y) + " in " + e.channel;
  };
  return "p " + std::to_string(r.p) + " (pixels " + std::to_string(r.pixel_p) + ", blocks " +
         std::to_string(r.block_p) + ", mean " + std::to_string(r.mean_p) + ", chi2 " + std::to_string(r.chi2_p) +
         "); pixel " + extreme(r.largest_pixel) + "; block " + extreme(r.largest_block) + "; mean z " +
         std::to_string(r.largest_mean.z) + " in " + r.largest_mean.channel + "; certain " +
         std::to_string(r.num_certain);
}

/// Pictures by MIS, by sampling lights and by following the BSDF; a failure unless each two agree.
///
/// A BSDF sample finds a small lamp by luck alone, a light sample a sharp highlight: a pixel that was never lucky in sixteen
/// runs looks certain. In the Cornell box that is one pixel in fifty; blocks and the mean carry the test.
/// @param run  technique and seeds are set here; seeds are independent of one another
inline std::array<Picture, 3> expect_techniques_agree(const Scene& scene, RunOptions run, const char* name)
{
  constexpr std::array kTechniques = {LightTechnique::kMis, LightTechnique::kLightSampling,
                                      LightTechnique::kBsdfSampling};
  constexpr std::array kNames = {"mis", "light", "bsdf"};
  constexpr double kSignificance = 0.001, kAllowedOutliers = 0.05;  // of one pair
  std::array<Picture, 3> pictures;
  for (std::size_t i = 0; i < kTechniques.size(); ++i) {
    run.technique = kTechniques[i];
    run.first_seed = 100 * (i + 1);
    pictures[i] = render_runs(scene, run);
  }
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    for (std::size_t k = i + 1; k < pictures.size(); ++k) {
      const ZTestResult result =
          z_test_pictures(pictures[i], pictures[k], run.samples * run.num_runs, kSignificance, kAllowedOutliers);
      const std::string text = std::string(kNames[i]) + " and " + kNames[k] + ": " + z_text(result);
      EXPECT_TRUE(result.passed) << text;
      std::printf("%s: %s\n", name, text.c_str());
    }
  }
  return pictures;
}

}  // namespace relief::test
