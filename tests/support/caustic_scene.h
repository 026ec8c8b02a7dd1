// Small scenes with caustics, and whether photons and paths bring the same light to them.
//
// Comparisons of pictures use independent runs: of each, the mean over a region. The difference of the means is judged by
// its standard error at 4 of it (6e-5 for a single region, 1e-3 for the sixteen of a picture); seeds are fixed. The bias
// of the density estimate is kept below that by a radius that is small against the region.
#pragma once

#include <algorithm>
#include <cmath>

#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {

inline Material glass_material(float roughness = 0)
{
  Material m;
  m.metallic = 0;
  m.roughness = roughness;
  m.transmission = 1;
  m.thickness = 1;
  return m;
}

inline Material mirror_material()
{
  Material m;
  m.roughness = 0;
  return m;
}

inline void add_caster(Scene& scene, Mesh mesh, const Material& material, const Affine3& place = {})
{
  add_object(scene, std::move(mesh), material, place);
  scene.instances.back().flags |= kCausticCaster | kCausticReceiver;
}

/// A floor of albedo one half at y = 0 that receives caustics.
inline void add_floor(Scene& scene, float half)
{
  add_object(scene, quad_mesh({-half, 0, half}, {2 * half, 0, 0}, {0, 0, -2 * half}), diffuse_material(splat3(0.5f)));
  scene.instances.back().flags |= kCausticReceiver;
}

inline Light point_light(Vec3f P, float intensity)
{
  Light light;
  light.kind = LightKind::kPoint;
  light.P = P;
  light.emission = splat3(intensity);
  return light;
}

inline Light square_light(Vec3f P, Vec3f axis, float half, float radiance)
{
  Light light;
  light.kind = LightKind::kRectangle;
  light.P = P;
  light.axis = axis;
  const Frame frame = frame_from_normal(axis);
  light.edge_u = half * frame.s;
  light.edge_v = half * frame.t;
  light.area = 4 * half * half;
  light.emission = splat3(radiance);
  return light;
}

/// A camera above, looking down at a square of the floor about `centre`.
inline void look_down(Scene& scene, Vec3f centre, float half, float height)
{
  Camera& camera = scene.cameras.front().camera;
  camera.world_from_camera.x = {1, 0, 0};
  camera.world_from_camera.y = {0, 0, -1};
  camera.world_from_camera.z = {0, 1, 0};
  camera.world_from_camera.p = centre + Vec3f{0, height, 0};
  camera.half_width = camera.half_height = half / height;
}

inline RenderOptions caustic_options(const Scene& scene, CausticsMode mode, int size, int samples)
{
  RenderOptions options = render_options(scene, size, samples);
  options.settings.caustics.mode = mode;
  return options;
}

inline double mean_of(const Rendered& picture, Aov aov, int channel = 0)
{
  double sum = 0;
  for (int y = 0; y < picture.image.view.height; ++y) {
    for (int x = 0; x < picture.image.view.width; ++x) sum += static_cast<double>(picture.at(aov, x, y)[channel]);
  }
  return sum / (picture.image.view.width * picture.image.view.height);
}

/// Means of a picture's quarters of each side, over runs, and the variance of these means.
struct Regions {
  static constexpr int kSide = 4;
  double mean[kSide * kSide] = {}, variance[kSide * kSide] = {};

  /// Few runs may agree by chance: no region's variance is taken for less than what all regions together say.
  double cautious_variance(int r) const
  {
    double variances = 0, squares = 0;
    for (int k = 0; k < kSide * kSide; ++k) {
      variances += variance[k];
      squares += mean[k] * mean[k];
    }
    return std::max(variance[r], variances / squares * mean[r] * mean[r]);
  }
};

inline Regions render_regions(const Scene& scene, RenderOptions options, int runs)
{
  Regions regions;
  double squares[Regions::kSide * Regions::kSide] = {};
  const int size = options.settings.width;
  for (int run = 0; run < runs; ++run) {
    options.settings.seed = 500u + static_cast<std::uint64_t>(run);
    const Rendered picture = render_scene(scene, options);
    for (int r = 0; r < Regions::kSide * Regions::kSide; ++r) {
      const int w = size / Regions::kSide;
      double sum = 0;
      for (int y = 0; y < w; ++y) {
        for (int x = 0; x < w; ++x) {
          sum += static_cast<double>(picture.radiance(r % Regions::kSide * w + x, r / Regions::kSide * w + y).x);
        }
      }
      const double mean = sum / (w * w);
      regions.mean[r] += mean / runs;
      squares[r] += mean * mean / runs;
    }
  }
  for (int r = 0; r < Regions::kSide * Regions::kSide; ++r) {
    regions.variance[r] = std::max(squares[r] - regions.mean[r] * regions.mean[r], 0.0) / (runs - 1);
  }
  return regions;
}

/// How pictures with photons are made: `size` pixels a side, and photons of each sample of a pixel.
struct PhotonPictures {
  int size = 32, photons = 1 << 15;
};

/// Photons take most of the time, and samples most of the noise where much light is direct: more of these and fewer of those have
/// as little noise in half of the time. Where a sharp lobe meets bright photons, it is the photons that are noisy.
inline constexpr PhotonPictures kFewPhotons{64, 1 << 13};

/// Expects the same picture with photons and without.
/// @param bias  of the density estimate, of a region's mean
inline void expect_same(const Scene& scene,
                        int samples_off,
                        int samples_on,
                        double bias,
                        const char* what,
                        LightTechnique technique = LightTechnique::kMis,
                        PhotonPictures with_photons = {})
{
  constexpr int kPictures = 8;
  RenderOptions options = caustic_options(scene, CausticsMode::kOff, 32, samples_off);
  options.light_technique = technique;
  const Regions off = render_regions(scene, options, kPictures);
  options = caustic_options(scene, CausticsMode::kOn, with_photons.size, samples_on);
  options.light_technique = technique;
  options.settings.caustics.photons = with_photons.photons;
  const Regions on = render_regions(scene, options, kPictures);
  for (int r = 0; r < Regions::kSide * Regions::kSide; ++r) {
    const double error = std::sqrt(off.cautious_variance(r) + on.cautious_variance(r));
    EXPECT_NEAR(on.mean[r], off.mean[r], 4 * error + bias * off.mean[r])
        << what << ", region " << r << ", standard error " << error;
  }
}

}  // namespace relief::test
