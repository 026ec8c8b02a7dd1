// Renders a scene built in code and looks at the result.
#pragma once

#include <gtest/gtest.h>

#include "integrator/render.h"

namespace relief::test {

struct Rendered {
  RenderedImage image;
  Statistics stats;

  /// Floats of an AOV at a pixel.
  const float* at(Aov aov, int x, int y) const
  {
    const FilmView& v = image.view;
    return v.pixels + (y * v.width + x) * v.layout.num_floats + v.layout.offset[static_cast<std::size_t>(aov)];
  }
  Vec3f radiance(int x, int y) const
  {
    const float* p = at(Aov::kBeauty, x, y);
    return {p[0], p[1], p[2]};
  }
  /// Mean of a channel of the beauty over all pixels.
  double mean(int channel = 0) const
  {
    double sum = 0;
    for (int y = 0; y < image.view.height; ++y) {
      for (int x = 0; x < image.view.width; ++x) sum += at(Aov::kBeauty, x, y)[channel];
    }
    return sum / (image.view.width * image.view.height);
  }
};

inline RenderOptions render_options(const Scene& scene, int size, int samples)
{
  RenderOptions options;
  options.settings = scene.render;
  options.settings.width = options.settings.height = size;
  options.settings.samples = samples;
  options.camera = scene.cameras.front().camera;
  options.aov_mask = kAllAovs;
  return options;
}

inline Rendered render_scene(const Scene& scene, const RenderOptions& options)
{
  const std::atomic<bool> stop{false};
  Rendered rendered;
  rendered.image = render(scene, options, stop, {}, rendered.stats);
  EXPECT_EQ(rendered.stats.counters.nonfinite_samples, 0u);
  return rendered;
}

/// Standard error of the picture's mean over `num_runs` seeds, and that mean: what a closed form is compared with.
struct Estimate {
  double mean = 0, standard_error = 0;
};

inline Estimate estimate_mean(const Scene& scene, RenderOptions options, int num_runs, int channel = 0)
{
  double sum = 0;
  double squares = 0;
  for (int run = 0; run < num_runs; ++run) {
    options.settings.seed = 1000u + static_cast<std::uint64_t>(run);
    const double mean = render_scene(scene, options).mean(channel);
    sum += mean;
    squares += mean * mean;
  }
  const double mean = sum / num_runs;
  return {mean, std::sqrt(std::max(squares / num_runs - mean * mean, 0.0) / (num_runs - 1))};
}

}  // namespace relief::test
