// Light of the sky that media scatter once, which is asked for besides other lights (shade_medium.h).
#include <cmath>

#include "tests/support/varying_scenes.h"

namespace relief::test {
namespace {

/// What a slab from z = −1 to 1 of a density that grows linearly, of which nothing is taken away, shows of an even sky and of a sun above it,
/// each scattered once at most.
/// @param middle, slope  of the density
double slab_under_sky(double middle, double slope, double sun)
{
  const auto below = [=](double z) { return middle * (z + 1) + 0.5 * slope * (z * z - 1); };
  const double total = below(1);
  // What gets through of half a sky: the second exponential integral.
  const auto sky = [](double depth) { return depth > 0 ? std::exp(-depth) + depth * std::expint(-depth) : 1.0; };
  return std::exp(-total) + integral(-1, 1, [=](double z) {
           const double above = total - below(z), density = middle + slope * z;
           const double from_sky = 0.5 * (sky(above) + sky(below(z)));
           return density * std::exp(-above) * (from_sky + sun / (4 * M_PI) * std::exp(-above));
         });
}

/// A sun of so much irradiance, straight above.
void add_sun(Scene& scene, double irradiance)
{
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = {0, 0, -1};
  const auto emission = static_cast<float>(irradiance);
  sun.emission = {emission, emission, emission};
  scene.lights.push_back(sun);
}

/// Under a sky alone, which is always asked for; with a sun beside which it sometimes is; and with one beside which it never is.
constexpr double kSuns[] = {0, 4 * M_PI * 3, 4 * M_PI * 5};

TEST(MediaSky, IsScatteredOnceByEvenMedia)
{
  for (const double sun : kSuns) {
    Scene scene = view();
    scene.environment.color = {1, 1, 1};
    if (sun > 0) add_sun(scene, sun);
    add_medium(scene, box_mesh({500, 500, 1}), scattering({0.2f, 0.7f, 1.5f}, 0));
    expect_mean(scene, 256, slab_under_sky(0.2, 0, sun), 1e-4, 0);
    expect_mean(scene, 256, slab_under_sky(0.7, 0, sun), 1e-4, 1);
    expect_mean(scene, 256, slab_under_sky(1.5, 0, sun), 1e-4, 2);
  }
}

TEST(MediaSky, IsScatteredOnceByMediaThatVaryThinOrThick)
{
  for (const double density : {0.3, 1.7}) {
    for (const double sun : kSuns) {
      Scene scene = view();
      scene.environment.color = {1, 1, 1};
      if (sun > 0) add_sun(scene, sun);
      Varying v;
      const GraphScalar one = v.number(1);
      v.add(VolumeClosureKind::kScatter, {one, one, one, v.z(0.5 * density, density), v.number(0)});
      add_varying(scene, box_mesh({500, 500, 1}), v.program());
      expect_mean(scene, 256, slab_under_sky(density, 0.5 * density, sun), 2e-4);
    }
  }
}

/// How bright a scene is, and by how much that is uncertain.
Estimate brightness(const Scene& scene) { return estimate_mean(scene, render_options(scene, 8, 256), kRuns, 1); }

// A thing that a kind of rays does not see leaves the sky to paths, wherever it is.
TEST(MediaSky, IsTheSameAskedForAndFoundBesideALampAndBehindThings)
{
  for (const bool varies : {false, true}) {
    Estimate of[2];
    for (const bool found : {false, true}) {
      Scene scene = view();
      scene.environment.color = {1, 1, 1};
      Varying v;
      const GraphScalar one = v.number(1);
      v.add(VolumeClosureKind::kScatter, {one, one, one, v.z(0.2, 0.4), v.number(0.6)});
      if (varies) {
        add_varying(scene, box_mesh({1, 1, 1}), v.program());
      } else {
        add_medium(scene, box_mesh({1, 1, 1}), scattering({0.2f, 0.4f, 1}, 0.6f));
      }
      Light lamp;
      lamp.P = {0.3f, 0.2f, 0.4f};
      lamp.emission = {3, 3, 3};
      scene.lights.push_back(lamp);
      add_medium(scene, box_mesh({0.4f, 0.1f, 0.1f}), absorbing({1, 3, 9}), {0.2f, 0.5f, 0.1f});
      add_medium(scene, box_mesh({1, 1, 1}), absorbing({1, 1, 1}), {900, 0, 0});
      if (found) scene.instances.back().flags &= ~static_cast<std::uint32_t>(kCastsShadow);
      of[found ? 1 : 0] = brightness(scene);
    }
    const double error = std::hypot(of[0].standard_error, of[1].standard_error);
    EXPECT_NEAR(of[0].mean, of[1].mean, kQuantile * error);
    EXPECT_LT(error, 0.01 * of[0].mean);
  }
}

}  // namespace
}  // namespace relief::test
