#include "cli/darkness.h"

#include <algorithm>
#include <atomic>

#include "exporters/picture.h"
#include "integrator/render.h"

namespace relief {

Darkness darkness_of(const FilmView& film)
{
  constexpr double kDim = 2e-3;
  const ImageView beauty = film_layer(film, Aov::kBeauty);
  Darkness found;
  for (int y = 0; y < film.height; ++y) {
    for (int x = 0; x < film.width; ++x) {
      const double coverage = static_cast<double>(beauty.channels[3].at(x, y));
      if (coverage <= 0) continue;
      double most = 0;
      for (std::size_t c = 0; c < 3; ++c) most = std::max(most, static_cast<double>(beauty.channels[c].at(x, y)));
      found.covered += coverage;
      found.dim += most < kDim ? coverage : 0;
      found.brightest = std::max(found.brightest, most);
    }
  }
  return found;
}

bool emission_shows(const Scene& scene, std::size_t camera)
{
  constexpr int kSide = 64, kSamples = 16;
  RenderOptions options;
  options.settings = scene.render;
  const double larger = std::max(scene.render.width, scene.render.height);
  const auto side = [&](int pixels) { return std::max(1, static_cast<int>(pixels * kSide / larger)); };
  options.settings.width = side(scene.render.width);
  options.settings.height = side(scene.render.height);
  options.settings.samples = kSamples;
  options.settings.noise_threshold = 0;
  options.settings.caustics.mode = CausticsMode::kOff;
  options.camera = scene.cameras[camera].camera;
  camera_fit(options.camera, static_cast<float>(options.settings.width), static_cast<float>(options.settings.height));
  const std::atomic<bool> stop{false};
  Statistics stats;
  const Darkness darkness = darkness_of(render(scene, options, stop, {}, stats).view);
  return !darkness.is_mostly_dim();
}

}  // namespace relief
