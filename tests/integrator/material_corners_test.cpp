// Materials at the corners of their ranges, where terms vanish and densities meet their limits: every sample is finite.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "tests/support/caustic_scene.h"

namespace relief::test {
namespace {

/// Each parameter is at an end of its range, just off it, or somewhere between.
Material random_material(Scene& scene, std::mt19937& random)
{
  std::uniform_real_distribution<float> uniform;
  const auto share = [&] {
    constexpr std::array kCorners{0.0f, 0.0f, 1.0f, 1.0f, 1e-7f, 1.0f - 1e-6f, 0.5f};
    const std::size_t k = random() % (kCorners.size() + 2);
    return k < kCorners.size() ? kCorners[k] : uniform(random);
  };
  const auto color = [&] { return random() % 3 == 0 ? Vec3f{share(), share(), share()} : splat3(share()); };
  Material m;
  m.base_color = color();
  m.metallic = share();
  m.roughness = share();
  m.transmission = share();
  constexpr std::array kIors{1.0f, 1.0f + 1e-6f, 1.45f, 1.5f, 3.0f, 50.0f};
  m.ior = kIors[random() % kIors.size()];
  m.thickness = random() % 2 == 0 ? 1.0f : 0.0f;
  const Vec3f inside = color();
  constexpr std::array kDistances{kInfinity, 1.0f, 1e-6f, 1e6f};
  set_absorption(scene, m, volume_sigma_a(inside, kDistances[random() % kDistances.size()]));
  if (random() % 2 == 0) {
    m.clearcoat = share();
    m.clearcoat_roughness = share();
  }
  if (random() % 2 == 0) {
    m.sheen_color = color();
    m.sheen_roughness = share();
  }
  if (random() % 2 == 0) {
    m.specular = share();
    m.specular_color = color();
  }
  return m;
}

/// A hundred small balls over a floor, each of its own material, under a lamp, a bright shape and a sky.
Scene balls(unsigned seed)
{
  std::mt19937 random(seed);
  Scene scene = empty_scene();
  add_floor(scene, 6);
  for (int k = 0; k < 100; ++k) {
    const Vec3f at{static_cast<float>(k % 10) - 4.5f, 0.5f, static_cast<float>(k / 10) - 4.5f};
    add_caster(scene, sphere_mesh(0.45f, 8, 6, k % 2 == 0), random_material(scene, random),
               {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, at});
  }
  Material bright = diffuse_material({0, 0, 0});
  bright.emission = {20, 15, 10};
  add_object(scene, quad_mesh({-5, 3, -5}, {0.5f, 0, 0}, {0, 0, 0.5f}), bright);
  scene.lights.push_back(square_light({2, 5, 1}, {0, -1, 0}, 0.3f, 200));
  scene.environment.color = {0.1f, 0.2f, 0.3f};
  look_down(scene, {0, 0, 0}, 5.5f, 12);
  return scene;
}

/// For a picture of such balls: the test helper asserts that no sample was dropped.
TEST(MaterialCorners, EverySampleIsFinite)
{
  for (unsigned seed = 0; seed < 6; ++seed) {
    SCOPED_TRACE(seed);
    const Scene scene = balls(seed);
    for (const CausticsMode mode : {CausticsMode::kOff, CausticsMode::kOn}) {
      const Rendered picture = render_scene(scene, caustic_options(scene, mode, 80, 8));
      EXPECT_GT(mean_of(picture, Aov::kBeauty), 0.01);
    }
  }
}

/// Rough black metal, a tenth of it glass: no light passes, yet the glass is there to be sampled.
TEST(MaterialCorners, GlassThatPassesNoLightIsFinite)
{
  Scene scene = empty_scene();
  add_floor(scene, 6);
  Material m;
  m.base_color = {0, 0, 0};
  m.metallic = 0.9f;
  m.transmission = 1;
  m.roughness = 0.5f;
  m.ior = 1.45f;
  m.thickness = 1;
  add_caster(scene, sphere_mesh(1, 24, 12, true), m, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 1, 0}});
  scene.lights.push_back(square_light({1, 5, 1}, {0, -1, 0}, 0.25f, 100));
  look_down(scene, {0, 0, 0}, 2, 8);
  render_scene(scene, caustic_options(scene, CausticsMode::kOn, 64, 64));
}

}  // namespace
}  // namespace relief::test
