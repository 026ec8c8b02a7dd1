// Photons in media: their search against brute force, light through glass against closed forms, and photons against paths that find
// the same light. Comparisons as in medium_scenes.h and caustic_scene.h.
#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "integrator/medium_photon_map.h"
#include "kernel/photon/medium_photons.h"
#include "kernel/sample/sobol.h"
#include "kernel/sample/warp.h"
#include "tests/support/caustic_scene.h"
#include "tests/support/varying_scenes.h"

namespace relief::test {
namespace {

TEST(MediumPhotons, AreFoundAlongRaysAsByBruteForce)
{
  for (const std::uint32_t count : {1u, 7u, 8u, 9u, 64u, 65u, 513u, 5000u}) {
    // Most lie dense in a corner.
    std::vector<std::vector<Photon>> chunks(3);
    std::vector<float> radii;
    std::vector<Photon> all;
    for (std::uint32_t i = 0; i < count; ++i) {
      const Vec2f u = sample_2d(7, i, 0), v = sample_2d(7, i, 1);
      const float size = i % 8 == 0 ? 10.0f : 0.5f;
      all.push_back({size * Vec3f{u.x, u.y, v.x}, {splat3(1), 0, 0, i}});
      radii.push_back(size * (0.02f + 0.1f * v.y));
    }
    for (std::uint32_t i = 0; i < count; ++i) chunks[3 * i / count].push_back(all[i]);
    MediumPhotonMap map;
    map.build(chunks, radii);
    const MediumPhotonsView view = map.view();
    std::uint64_t found = 0;
    for (std::uint32_t q = 0; q < 400; ++q) {
      const Vec2f u = sample_2d(8, q, 0), v = sample_2d(8, q, 1);
      const Vec3f O = 10.0f * Vec3f{u.x, u.y, v.x} - splat3(2);
      Vec3f D = normalize(all[q % count].P + 0.3f * (Vec3f{v.x, v.y, u.x} - splat3(0.5f)) - O);
      if (q % 5 == 0) D = {0, q % 2 == 0 ? 1.0f : -1.0f, 0};
      const float length = q % 3 == 0 ? kInfinity : 6.0f * v.y;
      std::vector<int> visits(count, 0);
      photons_along(view, O, D, length, [&](std::uint32_t i, float t, float squared) {
        const std::uint32_t number = view.arrivals[i].bounces;
        ++visits[number];
        EXPECT_NEAR(t, dot(all[number].P - O, D), 1e-4);
        EXPECT_GE(squared, 0.0f);
      });
      for (std::uint32_t i = 0; i < count; ++i) {
        const double x[3] = {double(all[i].P.x) - double(O.x), double(all[i].P.y) - double(O.y),
                             double(all[i].P.z) - double(O.z)};
        const double d[3] = {double(D.x), double(D.y), double(D.z)};
        const double t = x[0] * d[0] + x[1] * d[1] + x[2] * d[2];
        double squared = 0;
        for (int a = 0; a < 3; ++a) squared += (x[a] - t * d[a]) * (x[a] - t * d[a]);
        const double radius = double(radii[i]);
        // Rounding decides what lies on the rim, or at an end.
        const bool is_certain =
            std::abs(squared - radius * radius) > 1e-4 && std::abs(t) > 1e-4 && std::abs(t - double(length)) > 1e-4;
        const bool is_within = squared < radius * radius && t >= 0 && t <= double(length);
        found += is_within ? 1 : 0;
        const int least = is_certain && is_within ? 1 : 0, most = is_certain && !is_within ? 0 : 1;
        ASSERT_GE(visits[i], least) << count << " photons, ray " << q << ", photon " << i;
        ASSERT_LE(visits[i], most) << count << " photons, ray " << q << ", photon " << i;
      }
    }
    EXPECT_GT(found, 20u);
  }
}

Light sun_from(Vec3f axis, float irradiance)
{
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = axis;
  sun.emission = splat3(irradiance);
  return sun;
}

/// Share of light that smooth glass of two parallel faces lets through, however often it is reflected between them.
double slab_transmittance(double ior)
{
  const double F = (ior - 1) / (ior + 1) * ((ior - 1) / (ior + 1));
  return (1 - F) / (1 + F);
}

/// A slab of glass above what view() looks at.
void add_slab(Scene& scene)
{
  Affine3 above;
  above.p = {0, 1.5f, 0};
  add_caster(scene, box_mesh({2, 0.05f, 2}), glass_material(), above);
  scene.render.max_bounces = scene.render.transmission_bounces = scene.render.glossy_bounces = 8;
}

/// @param truth  of each channel
void expect_mean_by_photons(const Scene& scene, int samples, const std::array<double, 3>& truth)
{
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 8, samples);
  std::array<double, 3> sum{}, squares{};
  for (int run = 0; run < kRuns; ++run) {
    options.settings.seed = 1000u + static_cast<std::uint64_t>(run);
    const Rendered picture = render_scene(scene, options);
    for (std::size_t c = 0; c < 3; ++c) {
      const double mean = picture.mean(static_cast<int>(c));
      sum[c] += mean / kRuns;
      squares[c] += mean * mean / kRuns;
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    const double error = std::sqrt(std::max(squares[c] - sum[c] * sum[c], 0.0) / (kRuns - 1));
    // Beside noise the bias of a radius: r²/12 of the second derivative.
    EXPECT_NEAR(sum[c], truth[c], kQuantile * error + 2e-3 * truth[c])
        << "channel " << c << ", standard error " << error;
    // Else the comparison would tell nothing.
    EXPECT_LT(error, 0.02 * truth[c]);
  }
}

TEST(MediaCaustics, ShowASunThroughGlassAsTheClosedFormHasIt)
{
  Scene scene = view();
  add_slab(scene);
  // Once: what is scattered twice is left out.
  scene.render.volume_bounces = 1;
  add_medium(scene, box_mesh({1, 1, 1}), scattering({0.5f, 0.2f, 1.0f}, 0.7f, {0.1f, 0.4f, 0}));
  scene.lights.push_back(sun_from({0, -1, 0}, 3));
  const double s[3] = {0.5, 0.2, 1}, t[3] = {0.6, 0.6, 1}, phase = (1 - 0.49) / std::pow(1 + 0.49, 1.5) / (4 * M_PI);
  std::array<double, 3> truth{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double lit = 3 * slab_transmittance(1.5) * std::exp(-t[c] * 0.97);
    truth[c] = lit * s[c] * phase * (1 - std::exp(-2 * t[c])) / t[c];
  }
  expect_mean_by_photons(scene, 12, truth);
  // No path finds a sun without width.
  EXPECT_EQ(estimate_mean(scene, caustic_options(scene, CausticsMode::kOff, 8, 4), 2).mean, 0.0);
}

TEST(MediaCaustics, ShowInMediaThatVaryAsTheQuadratureHasIt)
{
  Scene scene = view();
  add_slab(scene);
  scene.render.volume_bounces = 1;
  // Denser towards the camera; within an even one, to which it adds up.
  Varying v;
  const GraphScalar white = v.number(1), grey = v.number(0.5);
  v.add(VolumeClosureKind::kScatter, {white, white, white, v.z(0.4, 0.6), v.number(0.3)});
  v.add(VolumeClosureKind::kAbsorption, {grey, grey, grey, v.number(0.2)});
  add_varying(scene, box_mesh({1, 1, 1}), v.program());
  add_medium(scene, box_mesh({1.1f, 1.2f, 1.4f}), scattering({0.2f, 0.2f, 0.2f}, 0.0f));
  scene.varying_media.resize(scene.media.size());
  scene.lights.push_back(sun_from({0, -1, 0}, 3));
  const double phase = (1 - 0.09) / std::pow(1 + 0.09, 1.5) / (4 * M_PI);
  const auto density = [](double z) { return 0.4 * z + 0.6; };
  const auto even = [&](double z, double depth) {
    return 0.2 / (4 * M_PI) * std::exp(-0.2 * (1.17 + 1.4 - z) - depth);
  };
  const auto both = [&](double z) {
    const double depth = 0.2 * (1 - z * z) + 0.7 * (1 - z), above = 0.97 * (density(z) + 0.1);
    return even(z, depth + above) * (1 + density(z) * phase / (0.2 / (4 * M_PI)));
  };
  // What varies takes 1.4 of its whole way.
  const double seen = integral(1, 1.4, [&](double z) { return even(z, 0); }) + integral(-1, 1, both) +
                      integral(-1.4, -1, [&](double z) { return even(z, 1.4); });
  const double truth = 3 * slab_transmittance(1.5) * seen;
  expect_mean_by_photons(scene, 8, {truth, truth, truth});
}

TEST(MediaCaustics, LieOnSurfacesBehindMediaAsBeersLawSays)
{
  Scene scene = view();
  Affine3 above;
  above.p = {0, 0, 1.5f};
  // The view looks along −z through a medium at a floor; the sun comes from the side of the camera, through glass and the same medium.
  above.x = {1, 0, 0};
  above.y = {0, 0, 1};
  above.z = {0, -1, 0};
  add_caster(scene, box_mesh({4, 0.05f, 4}), glass_material(), above);
  scene.render.max_bounces = scene.render.transmission_bounces = scene.render.glossy_bounces = 8;
  scene.render.diffuse_bounces = 1;
  add_medium(scene, box_mesh({5, 5, 1}), absorbing({0.25f, 0.5f, 1}));
  add_object(scene, quad_mesh({-9, -9, -2}, {18, 0, 0}, {0, 18, 0}), diffuse_material({0.6f, 0.6f, 0.6f}));
  scene.instances.back().flags |= kCausticReceiver;
  scene.lights.push_back(sun_from({0, 0, -1}, 3));
  // The camera sees it through the glass as well.
  const double T = slab_transmittance(1.5);
  std::array<double, 3> truth{};
  for (std::size_t c = 0; c < 3; ++c) truth[c] = 3 * T * T * 0.6 / M_PI * std::exp(-2 * 2 * 0.25 * (1 << c));
  expect_mean_by_photons(scene, 8, truth);
}

/// A ball of glass on a floor in fog, under a lamp that paths find through it.
Scene ball_in_fog(const Medium& fog)
{
  Scene scene = empty_scene();
  add_floor(scene, 2);
  add_medium(scene, box_mesh({1.6f, 0.9f, 1.6f}), fog, {0, 0.85f, 0});
  Affine3 place;
  place.p = {0.1f, 0.8f, 0};
  add_caster(scene, sphere_mesh(0.4f, 64, 32, true), glass_material(), place);
  scene.lights.push_back(square_light({0.3f, 2.6f, 0.2f}, normalize(Vec3f{-0.1f, -1, 0}), 0.7f, 4));
  look_down(scene, {}, 1.1f, 2.4f);
  scene.render.max_bounces = 6;
  scene.render.volume_bounces = 3;
  return scene;
}

/// More pixels with fewer photons, see kFewPhotons.
constexpr PhotonPictures kMediumPhotons{64, 1 << 14};

TEST(MediaCaustics, AreTheSameByPhotonsAsByPaths)
{
  expect_same(ball_in_fog(scattering({0.5f, 0.5f, 0.5f}, 0.4f, {0.1f, 0.1f, 0.1f})), 128, 8, 0.02, "fog",
              LightTechnique::kMis, kMediumPhotons);
}

TEST(MediaCaustics, WithinGlassAreTheSameByPhotonsAsByPaths)
{
  Scene scene = ball_in_fog(absorbing({0.05f, 0.05f, 0.05f}));
  Material& ice = scene.materials[static_cast<std::size_t>(scene.instances.back().material_index)];
  ice.medium_index = static_cast<int>(scene.media.size());
  scene.media.push_back(scattering({2, 2, 2}, 0.5f));
  expect_same(scene, 128, 8, 0.02, "ice", LightTechnique::kMis, kMediumPhotons);
}

TEST(MediaCaustics, AreTheSameByPhotonsAsByPathsWhereMediaVary)
{
  Varying v;
  const GraphScalar white = v.number(0.9);
  v.add(VolumeClosureKind::kScatter, {white, white, white, v.z(0.5, 0.5), v.number(0.3)});
  Scene scene = ball_in_fog({});
  scene.varying_media.push_back(v.program());
  expect_same(scene, 64, 4, 0.02, "smoke", LightTechnique::kMis, kMediumPhotons);
}

TEST(MediaCaustics, AreTheSameForAnyNumberOfThreads)
{
  const Scene scene = ball_in_fog(scattering({0.5f, 0.4f, 0.3f}, 0.4f));
  const RenderOptions options = caustic_options(scene, CausticsMode::kOn, 40, 3);
  const auto with_threads = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    return arena.execute([&] { return render_scene(scene, options).image.pixels; });
  };
  const std::vector<float> one = with_threads(1);
  EXPECT_EQ(one, with_threads(2));
  EXPECT_EQ(one, with_threads(4));
}

}  // namespace
}  // namespace relief::test
