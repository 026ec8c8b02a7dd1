// The photon pass against closed forms, brute force, and the path tracer, which finds the same light without photons.
//
// Comparisons of pictures use independent runs: of each, the mean over a region. The difference of the means is judged by
// its standard error at 4 of it (6e-5 for a single region, 1e-3 for the sixteen of a picture); seeds are fixed. The bias
// of the density estimate is kept below that by a radius that is small against the region.
#include <algorithm>
#include <cmath>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "integrator/photon_pass.h"
#include "kernel/photon/gather.h"
#include "scene/material_traits.h"
#include "tests/support/caustic_scene.h"

namespace relief::test {
namespace {

TEST(PhotonRadius, FactorIsTheClosedFormOfItsProduct)
{
  // Π (i + α)/(i + 1), i = 1 … n, is Γ(n + 1 + α) / (Γ(1 + α) Γ(n + 2)).
  for (const double alpha : {0.1, 2.0 / 3.0, 1.0}) {
    EXPECT_EQ(photon_radius_factor(0, alpha), 1.0);
    for (const std::uint32_t n : {1u, 2u, 10u, 1000u}) {
      const double squared = std::exp(std::lgamma(n + 1 + alpha) - std::lgamma(1 + alpha) - std::lgamma(n + 2.0));
      EXPECT_NEAR(photon_radius_factor(n, alpha) / std::sqrt(squared), 1.0, 1e-12);
    }
  }
}

TEST(Octahedral, KeepsDirections)
{
  double worst = 0;
  for (std::uint32_t i = 0; i < 100000; ++i) {
    const Vec2f u = sample_2d(1, i, 0);
    const float z = 1 - 2 * u.x;
    const float r = std::sqrt(std::max(0.0f, 1 - z * z));
    const Vec3f v{r * std::cos(2 * kPi * u.y), r * std::sin(2 * kPi * u.y), z};
    worst = std::max(worst, static_cast<double>(length(octahedral_decode(octahedral_encode(v)) - v)));
  }
  EXPECT_LT(worst, 7e-5);
  for (const Vec3f axis : {Vec3f{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}) {
    EXPECT_LT(length(octahedral_decode(octahedral_encode(axis)) - axis), 6e-5f);
  }
}

TEST(BoxAim, DensityIntegratesToTheSolidAngle)
{
  const Box3 box{{-0.3f, -0.5f, -0.1f}, {0.4f, 0.2f, 0.6f}};
  for (const Vec3f P : {Vec3f{3, 0.1f, 0.2f}, {1, 2, -3}, {0.5f, 0.3f, 0.7f}, {-0.31f, 0, 0}, {0, 40, 100}}) {
    // E[1/pdf] over the samples is the solid angle; brute force over the sphere finds it by hits.
    constexpr std::uint32_t kSamples = 1 << 16;
    double inverse = 0;
    int missed = 0;
    const auto hits = [&](Vec3f D) {
      float t0 = 0, t1 = kInfinity;
      const float o[3] = {P.x, P.y, P.z}, d[3] = {D.x, D.y, D.z};
      const float low[3] = {box.low.x, box.low.y, box.low.z}, high[3] = {box.high.x, box.high.y, box.high.z};
      for (int a = 0; a < 3; ++a) {
        const float ta = (low[a] - o[a]) / d[a], tb = (high[a] - o[a]) / d[a];
        t0 = std::max(t0, std::min(ta, tb));
        t1 = std::min(t1, std::max(ta, tb));
      }
      return t0 <= t1 * (1 + 1e-4f);
    };
    for (std::uint32_t i = 0; i < kSamples; ++i) {
      const BoxDirection aim = box_aim_from(box, P, sample_2d(7, i, 0));
      ASSERT_GT(aim.pdf, 0);
      inverse += 1.0 / static_cast<double>(aim.pdf) / kSamples;
      missed += hits(aim.D) ? 0 : 1;
    }
    EXPECT_LE(missed, 3);
    // The box seen from P, by its projection on a sphere, cut fine.
    double omega = 0;
    constexpr int kFine = 700;
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool upper : {false, true}) {
        const Light face = box_face(box, axis, upper);
        const Vec3f outward = upper ? face.axis : -face.axis;
        if (!(dot(P - face.P, outward) > 0)) continue;
        for (int i = 0; i < kFine; ++i) {
          for (int k = 0; k < kFine; ++k) {
            const auto place = [](int step) { return (2 * static_cast<float>(step) + 1) / kFine - 1; };
            const Vec3f Q = face.P + face.edge_u * place(i) + face.edge_v * place(k);
            const Vec3f to = Q - P;
            const double d2 = static_cast<double>(length_squared(to));
            omega += std::abs(static_cast<double>(dot(to, face.axis))) / (d2 * std::sqrt(d2)) *
                     static_cast<double>(face.area) / (kFine * kFine);
          }
        }
      }
    }
    EXPECT_NEAR(inverse / omega, 1.0, 2e-3) << P.x << "," << P.y << "," << P.z;
  }
}

TEST(BoxAim, ParallelLightCoversTheShadowEvenly)
{
  const Box3 box{{-1, -2, -0.5f}, {1, 0.5f, 0.25f}};
  const Vec3f D = normalize(Vec3f{0.3f, -0.8f, 0.5f});
  // Points go to each face by its share of the shadow.
  int top = 0;
  constexpr int kSamples = 1 << 14;
  for (int i = 0; i < kSamples; ++i) {
    const Vec3f P = box_aim_along(box, D, sample_2d(3, static_cast<std::uint32_t>(i), 0));
    EXPECT_TRUE(box_contains({box.low - splat3(1e-5f), box.high + splat3(1e-5f)}, P));
    if (P.y == box.high.y) ++top;
  }
  const double share = 0.8 * 2 * 0.75 / (0.8 * 2 * 0.75 + 0.3 * 2.5 * 0.75 + 0.5 * 2 * 2.5);
  EXPECT_NEAR(static_cast<double>(top) / kSamples, share, 2e-3);
  EXPECT_NEAR(box_shadow_area(box, D),
              (0.8f * 2 * 0.75f + 0.3f * 2.5f * 0.75f + 0.5f * 2 * 2.5f) / length(Vec3f{0.3f, 0.8f, 0.5f}), 1e-4f);
}

/// Photons in clusters of very different density around the origin, on the plane y = 0 and off it.
std::vector<std::vector<Photon>> random_photons(std::size_t count)
{
  std::vector<std::vector<Photon>> chunks(7);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec2f u = sample_2d(11, static_cast<std::uint32_t>(i), 0);
    const Vec2f v = sample_2d(12, static_cast<std::uint32_t>(i), 1);
    const float spread = i % 3 == 0 ? 10.0f : i % 3 == 1 ? 1.0f : 0.05f;
    Photon photon;
    photon.P = {spread * (u.x - 0.5f), i % 5 == 0 ? 0.02f * (v.x - 0.5f) : 0.0f, spread * (u.y - 0.5f)};
    photon.arrival.power = splat3(1.0f + v.y);
    photon.arrival.wi = octahedral_encode(normalize(Vec3f{v.x - 0.5f, i % 11 == 0 ? -1.0f : 1.0f, v.y - 0.5f}));
    photon.arrival.Ng = octahedral_encode(i % 7 == 0 ? Vec3f{1, 0, 0} : Vec3f{0, 1, 0});
    photon.arrival.bounces = i % 13 == 0 ? 9u : 2u;
    chunks[i % chunks.size()].push_back(photon);
  }
  return chunks;
}

TEST(PhotonMap, SearchesAgreeWithBruteForce)
{
  const std::vector<std::vector<Photon>> chunks = random_photons(20000);
  for (const float widest : {0.003f, 0.05f, 0.7f, 30.0f}) {
    // Radii over ten octaves: more than have a grid of their own.
    std::vector<float> radii;
    for (std::uint32_t i = 0; i < 20000; ++i) radii.push_back(widest * std::exp2(-10 * sample_2d(21, i, 0).x));
    PhotonMap map;
    map.build(chunks, radii);
    EXPECT_EQ(map.size(), 20000u);
    int found = 0;
    for (std::uint32_t q = 0; q < 300; ++q) {
      const Vec2f u = sample_2d(5, q, 0);
      const float spread = q % 2 == 0 ? 8.0f : 0.06f;
      PhotonQuery query;
      query.P = {spread * (u.x - 0.5f), 0, spread * (u.y - 0.5f)};
      query.Ng = {0, 1, 0};
      query.bounces = 5;
      query.both_sides = q % 5 == 0;
      query.hash = q * 7919u;
      double expected = 0;
      std::size_t number = 0;
      for (const auto& chunk : chunks) {
        for (const Photon& photon : chunk) {
          const float radius = radii[number++];
          const Vec3f offset = photon.P - query.P;
          const double d2 = static_cast<double>(length_squared(offset));
          const double r2 = static_cast<double>(radius) * static_cast<double>(radius);
          const Vec3f wi = octahedral_decode(photon.arrival.wi);
          if (d2 >= r2 || std::abs(offset.y) > 0.5f * radius || photon.arrival.bounces > 5) continue;
          if (octahedral_decode(photon.arrival.Ng).y < 0.5f || (!query.both_sides && wi.y <= 0)) continue;
          expected += static_cast<double>(photon.arrival.power.x) * 2 * (1 - d2 / r2) / (3.14159265358979 * r2);
        }
      }
      // All powers are grey, so whichever photon is chosen stands for the same irradiance.
      const PhotonGather gather = photon_gather(map.view(), query);
      EXPECT_NEAR(static_cast<double>(gather.irradiance.x), expected, 2e-4 * expected + 1e-12);
      found += expected > 0 ? 1 : 0;
    }
    EXPECT_GT(found, 100);
  }
}

TEST(PhotonMap, LobesChooseWhomTheyWantAndChangeNoSum)
{
  // What a lobe of microfacets 0.1 wide reflects, all of it and by its tails, of photons that come from everywhere: the mean
  // over many choices is the sum over all photons, whatever is said of the lobe: nothing, all, or that its peak is not wanted.
  const std::vector<std::vector<Photon>> chunks = random_photons(1000);
  PhotonMap map;
  map.build(chunks, std::vector<float>(1000, 2.0f));
  PhotonQuery query;
  query.Ng = {0, 1, 0};
  query.bounces = 5;
  query.lobe.frame = frame_from_normal(query.Ng);
  query.lobe.wo = to_local(query.lobe.frame, normalize(Vec3f{0.3f, 1, 0.1f}));
  constexpr float kMost = 1;
  enum Part { kAll, kTails };
  const auto lobe = [&](Part part, Vec3f wi) {
    const GgxReflection r = ggx_reflection_eval(query.lobe.wo, to_local(query.lobe.frame, wi), 0.1f);
    return part == kTails && r.pdf >= kMost ? 0.0 : static_cast<double>(r.f);
  };
  double expected[2] = {};
  for (const auto& chunk : chunks) {
    for (const Photon& photon : chunk) {
      const double q = static_cast<double>(length_squared(photon.P)) / 4;
      const Vec3f wi = octahedral_decode(photon.arrival.wi);
      if (q >= 1 || photon.arrival.bounces > 5 || octahedral_decode(photon.arrival.Ng).y < 0.5f || wi.y <= 0) continue;
      const double irradiance = static_cast<double>(photon.arrival.power.x) * 2 * (1 - q) / (3.14159265358979 * 4);
      for (const Part part : {kAll, kTails}) expected[part] += irradiance * lobe(part, wi);
    }
  }
  double variance[2][3] = {};
  for (const int told : {0, 1, 2}) {
    query.lobe.alpha = told > 0 ? 0.1f : 0.0f;
    query.lobe.most = told == 2 ? kMost : kInfinity;
    constexpr int kChoices = 20000;
    double sum[2] = {}, squares[2] = {};
    for (std::uint32_t i = 0; i < kChoices; ++i) {
      query.hash = i * 2654435761u;
      const PhotonGather gather = photon_gather(map.view(), query);
      for (const Part part : {kAll, kTails}) {
        const double reflected = static_cast<double>(gather.irradiance.x) * lobe(part, gather.wi);
        sum[part] += reflected / kChoices;
        squares[part] += reflected * reflected / kChoices;
      }
    }
    for (const Part part : {kAll, kTails}) {
      variance[part][told] = squares[part] - sum[part] * sum[part];
      EXPECT_NEAR(sum[part], expected[part], 4 * std::sqrt(variance[part][told] / kChoices)) << part << told;
    }
  }
  EXPECT_LT(variance[kAll][1], variance[kAll][0] / 10);
  EXPECT_LT(variance[kTails][2], variance[kTails][1] / 2);
}

TEST(PhotonMap, SearchesStayWithinTheirCellsWhereCoordinatesHardlyResolveTheRadius)
{
  // A kilometre from the origin floats are 61 µm apart: a search of half that and more reaches over up to three cells by
  // rounding. Photons lie on the same floats, a few to each, so that what is found is known exactly.
  const float step = std::nextafter(1000.0f, 2000.0f) - 1000.0f;
  std::vector<std::vector<Photon>> chunks(1);
  for (int i = -4; i <= 4; ++i) {
    for (int k = -4; k <= 4; ++k) {
      const Vec3f P{1000 + static_cast<float>(i) * step, 1000, 1000 + static_cast<float>(k) * step};
      chunks[0].push_back({P, {{1, 1, 1}, octahedral_encode({0, 1, 0}), octahedral_encode({0, 1, 0}), 0}});
    }
  }
  for (const float factor : {0.3f, 0.51f, 0.6f, 0.75f, 0.99f}) {
    const float radius = factor * step;
    PhotonMap map;
    map.build(chunks, std::vector<float>(chunks[0].size(), radius));
    for (int i = -4; i <= 4; ++i) {
      PhotonQuery query;
      query.P = {1000 + static_cast<float>(i) * step, 1000, 1000 - static_cast<float>(i) * step};
      query.Ng = {0, 1, 0};
      // Only the photon at the same point is within the radius.
      const double expected = 2 / (3.14159265358979 * static_cast<double>(radius) * static_cast<double>(radius));
      EXPECT_NEAR(static_cast<double>(photon_gather(map.view(), query).irradiance.x) / expected, 1, 1e-5) << factor;
    }
  }
}

TEST(PhotonMap, TheChosenPhotonStandsForAll)
{
  // Two photons of different colour and direction: over many choices the mean of irradiance · g(wi) is their sum.
  std::vector<std::vector<Photon>> chunks(1);
  chunks[0].push_back(
      {{0.1f, 0, 0}, {{3, 1, 0}, octahedral_encode(normalize(Vec3f{1, 1, 0})), octahedral_encode({0, 1, 0}), 0}});
  chunks[0].push_back(
      {{0, 0, 0.2f}, {{0, 2, 1}, octahedral_encode(normalize(Vec3f{0, 1, 1})), octahedral_encode({0, 1, 0}), 0}});
  PhotonMap map;
  map.build(chunks, {0.5f, 0.5f});
  Vec3d sum{}, expected{};
  constexpr int kChoices = 200000;
  const auto g = [](Vec3f wi) { return 1.0 + 2.0 * static_cast<double>(wi.x); };
  for (int i = 0; i < kChoices; ++i) {
    PhotonQuery query;
    query.Ng = {0, 1, 0};
    query.hash = static_cast<std::uint32_t>(hash_mix(static_cast<std::uint64_t>(i)));
    const PhotonGather gather = photon_gather(map.view(), query);
    sum.x += static_cast<double>(gather.irradiance.x) * g(gather.wi) / kChoices;
    sum.y += static_cast<double>(gather.irradiance.y) * g(gather.wi) / kChoices;
    sum.z += static_cast<double>(gather.irradiance.z) * g(gather.wi) / kChoices;
  }
  const double k0 = 2 * (1 - 0.01 / 0.25) / (3.14159265358979 * 0.25),
               k1 = 2 * (1 - 0.04 / 0.25) / (3.14159265358979 * 0.25);
  const double g0 = 1 + std::sqrt(2.0), g1 = 1;
  expected = {3 * k0 * g0, k0 * g0 + 2 * k1 * g1, k1 * g1};
  EXPECT_NEAR(sum.x / expected.x, 1, 0.01);
  EXPECT_NEAR(sum.y / expected.y, 1, 0.01);
  EXPECT_NEAR(sum.z / expected.z, 1, 0.01);
}

TEST(PhotonRadii, FollowTheDensityAndKeepTheLight)
{
  // Squares of side 4 and 0.25 with as many photons each: 256 times as dense.
  std::vector<std::vector<Photon>> chunks(3);
  constexpr std::uint32_t kPhotons = 30000;
  std::vector<bool> dense;
  for (std::uint32_t c = 0; c < 3; ++c) {
    for (std::uint32_t i = c; i < kPhotons; i += 3) {
      const Vec2f u = sample_2d(31, i, 0);
      const bool small = i % 2 == 0;
      const float side = small ? 0.25f : 4.0f;
      const float x = side * (u.x - 0.5f) + (small ? 10.0f : 0.0f);
      chunks[c].push_back(
          {{x, 0, side * (u.y - 0.5f)}, {splat3(1), octahedral_encode({0, 1, 0}), octahedral_encode({0, 1, 0}), 0}});
      dense.push_back(small);
    }
  }
  constexpr double kWanted = 24, kPi64 = 3.14159265358979;
  std::vector<float> radii;
  for (std::uint32_t shift = 0; shift < 16; ++shift) {
    radii = photon_radii(chunks, kWanted, 0.04f, shift);
    ASSERT_EQ(radii.size(), kPhotons);
    double area[2] = {};
    for (std::uint32_t i = 0; i < kPhotons; ++i) {
      area[dense[i] ? 1 : 0] +=
          kPi64 * static_cast<double>(radii[i]) * static_cast<double>(radii[i]) / (kPhotons / 2.0);
      EXPECT_LE(radii[i], 0.16f);
    }
    // Cells that a square's edge cuts have fewer photons, so the mean area is above wanted / density.
    EXPECT_NEAR(area[0] / (kWanted * 16 / (kPhotons / 2.0)), 1.3, 0.4) << shift;
    EXPECT_NEAR(area[1] / (kWanted * 0.0625 / (kPhotons / 2.0)), 1.3, 0.4) << shift;
  }
  // The estimate's integral over the plane is all their power, whatever the radii.
  PhotonMap map;
  map.build(chunks, radii);
  double sum = 0;
  const auto integrate = [&](float x, float side, int steps) {
    const double step = static_cast<double>(side) / steps;
    for (int k = 0; k < steps; ++k) {
      for (int i = 0; i < steps; ++i) {
        PhotonQuery query;
        query.P = {x + static_cast<float>((i + 0.5) * step), 0, static_cast<float>((k + 0.5) * step) - 0.5f * side};
        query.Ng = {0, 1, 0};
        query.bounces = 0x7f7f7f7fu;
        sum += static_cast<double>(photon_gather(map.view(), query).irradiance.x) * step * step;
      }
    }
  };
  integrate(-2.5f, 5, 600);
  integrate(9.5f, 1, 600);
  EXPECT_NEAR(sum / kPhotons, 1, 2e-3);
}

TEST(PhotonBounces, LimitsAreComparedCountByCount)
{
  EXPECT_TRUE(photon_bounces_allowed(0x01020304u, 0x01020304u));
  EXPECT_TRUE(photon_bounces_allowed(0u, 0u));
  EXPECT_TRUE(photon_bounces_allowed(0x00000000u, 0x7f7f7f7fu));
  EXPECT_FALSE(photon_bounces_allowed(0x00000005u, 0x7f7f7f04u));
  EXPECT_FALSE(photon_bounces_allowed(0x02000001u, 0x01000001u));
  EXPECT_FALSE(photon_bounces_allowed(0x00010000u, 0x0100ff00u & 0x7f007f00u));
}

/// Mean of what a flat mirror at x = −1 throws on the floor, over the light of the lamp's mirror image. A ball that is
/// above the floor as a whole lights it as its centre would.
double mirrored_lamp_over_closed_form(float lamp_radius)
{
  Scene scene = empty_scene();
  add_floor(scene, 3);
  add_caster(scene, quad_mesh({-1, 0, 1.5f}, {0, 0, -3}, {0, 3, 0}), mirror_material());
  scene.lights.push_back(point_light({0, 1, 0}, 5));
  scene.lights.back().radius = lamp_radius;
  look_down(scene, {0.3f, 0, 0.2f}, 0.4f, 2);
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 32, 16);
  options.settings.caustics.photons = 1 << 17;
  const Rendered picture = render_scene(scene, options);
  EXPECT_EQ(picture.stats.caustics.passes, 16u);
  double expected = 0;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      const float* P = picture.at(Aov::kPosition, x, y);
      const Vec3f to_image = Vec3f{-2, 1, 0} - Vec3f{P[0], P[1], P[2]};
      const double d2 = static_cast<double>(length_squared(to_image));
      expected += 5.0 * static_cast<double>(to_image.y) / (d2 * std::sqrt(d2)) * 0.5 / 3.14159265358979 / (32 * 32);
    }
  }
  return mean_of(picture, Aov::kCaustic) / expected;
}

TEST(Caustics, MirrorCausticIsTheIrradianceOfTheVirtualImage)
{
  // 16 passes of 131,072 photons, of which some 3 % fall here: a standard error of about 0.4 % of the mean if they were
  // independent; they are stratified, and come out closer.
  EXPECT_NEAR(mirrored_lamp_over_closed_form(0), 1.0, 0.01);
  EXPECT_NEAR(mirrored_lamp_over_closed_form(0.4f), 1.0, 0.01) << "a ball";
}

/// Mean over a square of a nearly black floor of what a slab of glass lets through of a sun of 4 W/m² in the zenith, over
/// its closed form. At normal incidence a slab transmits (1 − F)/(1 + F), all reflections in between included, with
/// F = ((n−1)/(n+1))². The floor's own image in the slab adds at most its albedo times what glass reflects of diffuse
/// light, 9.2 %, from either side.
/// @param size   of the slab, metres
/// @param floor  half its width, metres
double slab_over_closed_form(float size, float floor)
{
  Scene scene = empty_scene();
  add_object(scene, quad_mesh({-floor, 0, floor}, {2 * floor, 0, 0}, {0, 0, -2 * floor}),
             diffuse_material(splat3(0.01f)));
  scene.instances.back().flags |= kCausticReceiver;
  const float h = 0.5f * size;
  Mesh slab = quad_mesh({-h, h, h}, {size, 0, 0}, {0, 0, -size});
  const Mesh below = quad_mesh({-h, 0.8f * h, -h}, {size, 0, 0}, {0, 0, size});
  for (const Vec3f& P : below.P) slab.P.push_back(P);
  for (const TriangleIndices& t : below.triangles) slab.triangles.push_back({t.v0 + 4, t.v1 + 4, t.v2 + 4});
  add_caster(scene, slab, glass_material());
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = {0, -1, 0};
  sun.emission = splat3(4);
  scene.lights.push_back(sun);
  look_down(scene, {}, 0.5f * h, 0.7f * h);
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 24, 16);
  options.settings.caustics.photons = 1 << 16;
  const double F = 0.04;
  const Rendered picture = render_scene(scene, options);
  EXPECT_EQ(picture.stats.counters.nonfinite_samples, 0u);
  return mean_of(picture, Aov::kCaustic) / (4 * (1 - F) / (1 + F) * 0.01 / 3.14159265358979);
}

/// Glass below a lamp that fills what it reflects, from above. All else is black.
Scene lamp_over_glass(bool far_side, float roughness)
{
  Scene scene = empty_scene();
  add_caster(scene, quad_mesh({-2, 0.2f, 2}, {4, 0, 0}, {0, 0, -4}), glass_material(roughness));
  if (far_side) add_caster(scene, quad_mesh({-2, 0.1f, -2}, {4, 0, 0}, {0, 0, 4}), glass_material(roughness));
  scene.lights.push_back(square_light({0, 2, 0}, {0, -1, 0}, 1.5f, 1));
  look_down(scene, {0, 0.2f, 0}, 0.05f, 1);
  return scene;
}

TEST(PathsThatFork, SmoothGlassShowsALampWithoutNoise)
{
  // Of a path that goes one way, one sample in 25 would be white.
  const Scene single = lamp_over_glass(false, 0);
  const Rendered picture = render_scene(single, caustic_options(single, CausticsMode::kOn, 16, 1));
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) EXPECT_NEAR(picture.radiance(x, y).x, 0.04f, 1e-5f);
  }
}

TEST(PathsThatFork, FarSidesOfGlassShowALamp)
{
  // R + T²R / (1 − R²) where smooth. A sample is R + TR or nearly R, the latter one time in 25: its deviation is 0.008, and
  // would be 0.27 by chance alone. Rough glass is compared with paths that go one way; means are judged at 4 standard errors.
  constexpr double kR = 0.04, kT = 0.96;
  const Scene slab = lamp_over_glass(true, 0);
  const Estimate smooth = estimate_mean(slab, caustic_options(slab, CausticsMode::kOn, 16, 16), 8);
  EXPECT_NEAR(smooth.mean, kR + kT * kT * kR / (1 - kR * kR), 4 * smooth.standard_error);
  EXPECT_LT(smooth.standard_error, 2e-4);
  // Too smooth for photons to be gathered.
  const Scene rough = lamp_over_glass(true, 0.1f);
  RenderOptions options = caustic_options(rough, CausticsMode::kOn, 16, 64);
  options.settings.caustics.photons = 1 << 10;
  const Estimate on = estimate_mean(rough, options, 8);
  const Estimate off = estimate_mean(rough, caustic_options(rough, CausticsMode::kOff, 16, 512), 8);
  const double error = std::hypot(on.standard_error, off.standard_error);
  EXPECT_NEAR(on.mean, off.mean, 4 * error);
  EXPECT_LT(error, 0.01 * off.mean);
}

/// Expects that paths go on from a rough surface in four ways that are one stratified set, and bring what single paths do. The
/// surface fills the picture, and half of its lobe leads to a lamp; paths sample no lights.
/// @param most  deviation of the pixels over their mean
void expect_four_ways(const Scene& scene, double most)
{
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 32, 1);
  options.light_technique = LightTechnique::kBsdfSampling;
  const Rendered picture = render_scene(scene, options);
  double sum = 0;
  double squares = 0;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      const double light = static_cast<double>(picture.radiance(x, y).x);
      sum += light;
      squares += light * light;
    }
  }
  const double mean = sum / (32 * 32);
  const double deviation = std::sqrt(squares / (32 * 32) - mean * mean);
  std::printf("deviation over mean %.3f\n", deviation / mean);
  EXPECT_LT(deviation, most * mean);
  options = caustic_options(scene, CausticsMode::kOff, 32, 256);
  options.light_technique = LightTechnique::kBsdfSampling;
  const Estimate off = estimate_mean(scene, options, 8);
  EXPECT_NEAR(mean, off.mean, 4 * std::hypot(deviation / 32, off.standard_error));
}

TEST(PathsThatFork, WaysIntoRoughGlassShareOneSetOfPoints)
{
  // A lamp lies behind half of the glass, so that a quarter turn of the lobe sees all of it or nothing. Of the four ways of a
  // sample two lead there, but for those that the glass reflects or scatters more than once: the pixels' deviation is 0.2 of
  // their mean. Ways that know nothing of each other lead there none to four times, with 0.5.
  Scene scene = empty_scene();
  add_caster(scene, quad_mesh({-2, 0.2f, 2}, {4, 0, 0}, {0, 0, -4}), glass_material(0.4f));
  scene.lights.push_back(square_light({10, 0, 0}, {0, 1, 0}, 10, 1));
  look_down(scene, {0, 0.2f, 0}, 0.0005f, 1);
  expect_four_ways(scene, 0.25);
}

TEST(PathsThatFork, WaysFromRoughMetalShareOneSetOfPoints)
{
  // Likewise with a lamp above. A single way leads there or not, with a deviation of the mean itself. The number that turns the
  // lobe has chosen it among others, so that its halves are not quite halves of the four points.
  Scene scene = empty_scene();
  Material metal;
  metal.roughness = 0.4f;
  add_caster(scene, quad_mesh({-2, 0.2f, 2}, {4, 0, 0}, {0, 0, -4}), metal);
  scene.lights.push_back(square_light({10, 3, 0}, {0, -1, 0}, 10, 1));
  look_down(scene, {0, 0.2f, 0}, 0.0005f, 1);
  expect_four_ways(scene, 0.3);
}

TEST(Caustics, SunThroughASlabLosesWhatTwoInterfacesReflect)
{
  EXPECT_NEAR(slab_over_closed_form(2, 3), 1.0, 0.005);
  EXPECT_NEAR(slab_over_closed_form(2e4f, 3e4f), 1.0, 0.005) << "a slab of 20 km";
  EXPECT_NEAR(slab_over_closed_form(2e-5f, 3e-5f), 1.0, 0.005) << "a slab of 20 µm";
  EXPECT_NEAR(slab_over_closed_form(0.02f, 1e4f), 1.0, 0.005) << "a slab of 2 cm on a plain of 20 km";
}

TEST(Caustics, FewPhotonsKeepTheLight)
{
  // However few arrive in a pass, none are lost: they are spread wider. All that a low mirror throws on a floor is in the
  // picture, whatever the radius.
  Scene scene = empty_scene();
  add_floor(scene, 20);
  add_caster(scene, quad_mesh({-1, 0, 1.5f}, {0, 0, -3}, {0, 0.6f, 0}), mirror_material());
  scene.lights.push_back(point_light({0, 1, 0}, 5));
  look_down(scene, {}, 15, 20);
  constexpr int kPasses = 64;
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 32, kPasses);
  const auto light = [&](double photons) {
    options.settings.caustics.photons = photons;
    return mean_of(render_scene(scene, options), Aov::kCaustic);
  };
  const double many = light(1 << 15);
  EXPECT_GT(many, 0);
  for (const double photons : {0.5, 1.0, 3.0, 20.0, 90.0, 200.0}) {
    // Four standard errors of as many independent photons, about half of which arrive, and one per cent for the edges.
    const double error = 1 / std::sqrt(kPasses * std::max(photons, 1.0));
    EXPECT_NEAR(light(photons) / many, 1.0, 4 * error + 0.01) << photons;
  }
}

TEST(Caustics, CropsShowTheWholePicturesPixels)
{
  Scene scene = empty_scene();
  add_floor(scene, 2);
  Affine3 place;
  place.p = {0, 0.5f, 0};
  add_caster(scene, sphere_mesh(0.4f, 48, 24, true), glass_material(), place);
  scene.lights.push_back(square_light({0, 2, 0}, {0, -1, 0}, 0.1f, 50));
  look_down(scene, {}, 1, 3);
  // More pixels than the fewest photons there are.
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 200, 2);
  const Rendered whole = render_scene(scene, options);
  options.crop_x0 = 60;
  options.crop_y0 = 80;
  options.crop_x1 = 130;
  options.crop_y1 = 120;
  const Rendered crop = render_scene(scene, options);
  EXPECT_EQ(crop.stats.caustics.photons, whole.stats.caustics.photons);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 70; ++x) ASSERT_TRUE(whole.radiance(x + 60, y + 80) == crop.radiance(x, y)) << x << "," << y;
  }
}

TEST(Caustics, OfACentimetreAndAKilometreAreTheSame)
{
  // All lengths change by powers of two, which rounds nothing: radii, offsets and thresholds that follow the scene's size
  // give the same bits.
  const auto picture = [](float scale) {
    Scene scene = empty_scene();
    add_floor(scene, scale);
    Affine3 place;
    place.p = {0, 0.5f * scale, 0};
    add_caster(scene, sphere_mesh(0.375f * scale, 48, 24, true), glass_material(), place);
    Material metal;
    metal.roughness = 0.3f;
    place.p = {0.5f * scale, 0.25f * scale, 0.5f * scale};
    add_caster(scene, sphere_mesh(0.25f * scale, 48, 24, true), metal, place);
    scene.lights.push_back(square_light({0, 2 * scale, 0}, {0, -1, 0}, 0.125f * scale, 50));
    scene.lights.push_back(point_light({scale, 2 * scale, 0}, 2 * scale * scale));
    look_down(scene, {}, scale, 3 * scale);
    return render_scene(scene, caustic_options(scene, CausticsMode::kOn, 64, 4));
  };
  const Rendered metre = picture(1);
  EXPECT_GT(mean_of(metre, Aov::kCaustic), 0.01);
  for (const float scale : {0.0078125f, 1024.0f}) {
    const Rendered scaled = picture(scale);
    EXPECT_EQ(scaled.stats.caustics.first_radius, scale * metre.stats.caustics.first_radius);
    int different = 0;
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 64; ++x) different += scaled.radiance(x, y) == metre.radiance(x, y) ? 0 : 1;
    }
    EXPECT_EQ(different, 0) << scale;
  }
}

TEST(Caustics, ProgressIsThatOfBothPasses)
{
  Scene scene = empty_scene();
  add_floor(scene, 1);
  Affine3 place;
  place.p = {0, 0.5f, 0};
  add_caster(scene, sphere_mesh(0.4f, 48, 24, true), glass_material(), place);
  scene.lights.push_back(square_light({0, 2, 0}, {0, -1, 0}, 0.1f, 50));
  look_down(scene, {}, 1, 3);
  const std::atomic<bool> stop{false};
  Statistics stats;
  RenderProgress last;
  const auto progress = [&](const RenderProgress& p) {
    EXPECT_GE(p.fraction, last.fraction);
    EXPECT_GE(p.photons, last.photons);
    last = p;
  };
  render(scene, caustic_options(scene, CausticsMode::kOn, 200, 5), stop, progress, stats);
  EXPECT_EQ(last.fraction, 1);
  EXPECT_EQ(last.samples_per_pixel, 5);
  EXPECT_EQ(last.photons, stats.caustics.photons);
  EXPECT_GT(last.photons, 0u);
}

TEST(Caustics, WhatCastersReceiveIsStoredOrEscapes)
{
  // A lamp and a glass sphere in a closed room: nothing absorbs photons, so the walls get what the sphere received, which
  // is the lamp's intensity times the sphere's solid angle.
  Scene scene = empty_scene();
  add_object(scene, sphere_mesh(5, 64, 32, false), diffuse_material(splat3(0.5f)));
  scene.instances.back().flags |= kCausticReceiver;
  add_caster(scene, sphere_mesh(0.5f, 256, 128, true), glass_material());
  scene.lights.push_back(point_light({0, 1.5f, 0.4f}, 2));
  // The widest image the light can have: paths of up to 100 scatterings.
  CausticSettings caustics;
  const SceneContext context(scene, {}, EnvironmentDensity::kExcess, caustics);
  ASSERT_TRUE(context.globals.caustics.enabled);
  RenderOptions options = render_options(scene, 16, 1);
  options.settings.max_bounces = 100;
  FilterTable filter;
  KernelGlobals g = render_globals(context, options, filter);
  constexpr std::uint32_t kPhotons = 1 << 17;
  const PhotonSources sources = photon_sources_make(context);
  Wavefront worker({.caustics = true});
  KeptPhotons photons;
  for (std::uint32_t first = 0; first < kPhotons; first += kBatchPaths) {
    worker.trace_photons(g, *context.accel, stage_table_select(), context.surface_kernel, sources.view(kPhotons), first,
                         kBatchPaths, photons);
  }
  double stored = 0;
  for (const Photon& photon : photons.on_surfaces) stored += static_cast<double>(photon.arrival.power.x);
  const double d = std::sqrt(1.5 * 1.5 + 0.4 * 0.4);
  const double received = 2 * 2 * 3.14159265358979 * (1 - std::sqrt(1 - 0.25 / (d * d)));
  EXPECT_NEAR(stored / received, 1.0, 0.01);
}

/// Six balls that shine, turned, scaled and one of them mirrored, over a floor beside a mirror.
/// @param distinct  each has a mesh of its own
Scene lamps_beside_a_mirror(bool distinct)
{
  Scene scene = empty_scene();
  add_floor(scene, 3);
  add_caster(scene, quad_mesh({-1, 0, 1.5f}, {0, 0, -3}, {0, 3, 0}), mirror_material());
  Material lamp;
  lamp.base_color = {};
  lamp.emission = {9, 6, 3};
  for (int i = 0; i < 6; ++i) {
    const float scale = 0.15f + 0.03f * static_cast<float>(i), angle = 0.9f * static_cast<float>(i);
    Affine3 place;
    place.x = Vec3f{std::cos(angle), 0, std::sin(angle)} * scale;
    place.y = Vec3f{0, i == 2 ? -scale : scale, 0};
    place.z = Vec3f{-std::sin(angle), 0, std::cos(angle)} * scale;
    place.p = {0.25f * static_cast<float>(i), 1.0f + 0.1f * static_cast<float>(i % 3),
               -0.8f + 0.3f * static_cast<float>(i)};
    add_object(scene, sphere_mesh(1, 6, 4, false), lamp, place);
    if (distinct || i == 0) continue;
    scene.instances.back().mesh_index = scene.instances[2].mesh_index;
    scene.instances.back().material_index = scene.instances[2].material_index;
  }
  look_down(scene, {-0.3f, 0, 0}, 0.6f, 0.7f);
  return scene;
}

TEST(Caustics, LampsThatShareTheirLightsSendTheSamePhotons)
{
  // The same pairs of lights and casters in the same order, so the same photons but for rounding.
  const auto caustic = [](const Scene& scene) {
    RenderOptions options = caustic_options(scene, CausticsMode::kOn, 32, 8);
    options.settings.caustics.photons = 1 << 15;
    return mean_of(render_scene(scene, options), Aov::kCaustic);
  };
  const double shared = caustic(lamps_beside_a_mirror(false)), distinct = caustic(lamps_beside_a_mirror(true));
  EXPECT_GT(distinct, 0.01);
  EXPECT_NEAR(shared / distinct, 1, 1e-3);
  expect_same(lamps_beside_a_mirror(false), 128, 16, 0.005, "lamps beside a mirror");
}

TEST(Caustics, NothingIsDoneWhereNoneCanBe)
{
  Scene scene = empty_scene();
  add_floor(scene, 2);
  scene.lights.push_back(square_light({0, 2, 0}, {0, -1, 0}, 0.3f, 5));
  look_down(scene, {}, 1, 1.5f);
  const auto pixels = [&](CausticsMode mode) { return render_scene(scene, caustic_options(scene, mode, 24, 8)); };
  const Rendered automatic = pixels(CausticsMode::kAuto);
  EXPECT_EQ(automatic.stats.caustics.photons, 0u);
  EXPECT_EQ(automatic.stats.caustics.bytes, 0u);
  EXPECT_EQ(automatic.stats.caustics.reason, "nothing casts caustics");
  EXPECT_EQ(automatic.image.pixels, pixels(CausticsMode::kOff).image.pixels);

  add_caster(scene, sphere_mesh(0.3f, 32, 16, true), glass_material());
  EXPECT_EQ(pixels(CausticsMode::kOff).stats.caustics.photons, 0u);
  EXPECT_GT(pixels(CausticsMode::kOn).stats.caustics.photons, 0u);
  scene.lights.front().casts_caustics = false;
  EXPECT_EQ(pixels(CausticsMode::kAuto).stats.caustics.reason, "no light casts caustics");

  // Metal alone: what it scatters more than once shows next to nothing. Rough metal shows tails, but not where it is displaced.
  for (const float roughness : {0.05f, 0.2f}) {
    Scene metal = empty_scene();
    Material material;
    material.roughness = roughness;
    add_caster(metal, sphere_mesh(0.3f, 32, 16, true), material);
    metal.lights.push_back(point_light({0, 1, 0}, 5));
    look_down(metal, {}, 1, 1.5f);
    const RenderOptions options = caustic_options(metal, CausticsMode::kAuto, 24, 8);
    EXPECT_EQ(render_scene(metal, options).stats.caustics.reason,
              roughness < 0.1f ? "nothing receives caustics" : "no caustic shows in the picture");
    add_displacement(metal, 16, noise_texels(16, 1), 0.01f);
    metal.materials[0].displacement_index = 0;
    EXPECT_EQ(render_scene(metal, options).stats.caustics.reason, "nothing receives caustics");
  }
}

TEST(Caustics, RoughCastersThatAreDisplacedAreOnesOnlyWhereTheySaySo)
{
  Material metal;
  metal.roughness = 0.3f;
  EXPECT_TRUE(material_casts_caustics(metal));
  metal.displacement_index = 0;
  EXPECT_FALSE(material_casts_caustics(metal));
  metal.roughness = 0.25f;
  EXPECT_TRUE(material_casts_caustics(metal));
}

TEST(Caustics, PhotonsKeepToTheirMemory)
{
  // A lamp in a closed room of rough metal, which casts and shows caustics: a path is kept wherever it goes. Under a bare
  // sky only few of the paths are kept, and more may start.
  Scene room = empty_scene();
  Material metal;
  metal.roughness = 0.4f;
  add_caster(room, sphere_mesh(2, 32, 16, false), metal);
  room.lights.push_back(point_light({0, 0.5f, 0}, 1));
  look_down(room, {}, 0.5f, 1);
  Scene open = empty_scene();
  add_floor(open, 0.5f);
  Affine3 place;
  place.p = {0, 0.6f, 0};
  add_caster(open, sphere_mesh(0.3f, 32, 16, true), glass_material(), place);
  open.lights.push_back(point_light({0, 2, 0}, 1));
  look_down(open, {}, 0.4f, 0.2f);
  double started[2];
  int i = 0;
  for (const Scene* scene : {&room, &open}) {
    RenderOptions options = caustic_options(*scene, CausticsMode::kOn, 8, 3);
    options.settings.caustics.photons = 1e7;
    for (const double mib : {0.01, 4.0}) {
      options.settings.caustics.memory_mib = mib;
      const CausticStatistics stats = render_scene(*scene, options).stats.caustics;
      EXPECT_LE(static_cast<double>(stats.bytes), mib * 1048576);
      EXPECT_GT(static_cast<double>(stats.bytes), 0.2 * mib * 1048576);
      EXPECT_GT(stats.stored, 0u);
      started[i] = static_cast<double>(stats.photons);
    }
    ++i;
  }
  EXPECT_GT(started[1], 5 * started[0]);
}

TEST(Caustics, SameBitsForAnyNumberOfThreads)
{
  Scene scene = empty_scene();
  add_floor(scene, 2);
  Affine3 place;
  place.p = {0, 0.5f, 0};
  add_caster(scene, sphere_mesh(0.4f, 48, 24, true), glass_material(0.1f), place);
  scene.lights.push_back(square_light({0, 2, 0}, {0, -1, 0}, 0.1f, 50));
  scene.lights.push_back(point_light({1, 1, 1}, 1));
  look_down(scene, {}, 1, 3);
  const RenderOptions options = caustic_options(scene, CausticsMode::kOn, 40, 6);
  const auto with_threads = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    return arena.execute([&] { return render_scene(scene, options).image.pixels; });
  };
  const std::vector<float> one = with_threads(1);
  EXPECT_EQ(one, with_threads(2));
  EXPECT_EQ(one, with_threads(4));
}

class CausticAgreement : public testing::Test {
 protected:
  /// A floor, a wall, a wide lamp that paths find through casters, and casters from sharp to soft.
  Scene room(const Material& material)
  {
    Scene scene = empty_scene();
    add_floor(scene, 2);
    Affine3 place;
    place.p = {0.1f, 0.42f, 0};
    add_caster(scene, sphere_mesh(0.4f, 64, 32, true), material, place);
    scene.lights.push_back(square_light({0.3f, 2.2f, 0.2f}, normalize(Vec3f{-0.1f, -1, 0}), 0.7f, 4));
    look_down(scene, {}, 1.1f, 1.9f);
    return scene;
  }

  /// The same of glass that absorbs.
  Scene room_of_amber()
  {
    Material amber = glass_material();
    amber.medium_index = 0;
    Scene scene = room(amber);
    scene.media.emplace_back().sigma_t = volume_sigma_a({0.4f, 0.6f, 0.8f}, 0.5f);
    return scene;
  }
};

TEST_F(CausticAgreement, SmoothGlass)
{
  expect_same(room(glass_material()), 128, 8, 0.005, "glass", LightTechnique::kMis, {64, 1 << 14});
}

TEST_F(CausticAgreement, RoughGlassAcrossTheThreshold)
{
  for (const float roughness : {0.1f, 0.24f, 0.26f, 0.45f}) {
    // The sharpest is the one whose photons are noisy.
    expect_same(room(glass_material(roughness)), 64, 8, 0.005, "rough glass", LightTechnique::kMis,
                roughness < 0.2f ? PhotonPictures{} : kFewPhotons);
  }
}

TEST_F(CausticAgreement, MetalAndCoatedPlastic)
{
  Material metal;
  metal.roughness = 0.2f;
  metal.base_color = {0.9f, 0.6f, 0.4f};
  expect_same(room(metal), 64, 8, 0.005, "metal", LightTechnique::kMis, kFewPhotons);
  // Sharp and soft lobes on one surface, which gathers and casts: the paths are shared out lobe by lobe.
  Material plastic = diffuse_material({0.5f, 0.4f, 0.3f});
  plastic.specular = 1;
  plastic.roughness = 0.3f;
  plastic.clearcoat = 1;
  plastic.clearcoat_roughness = 0.05f;
  expect_same(room(plastic), 64, 8, 0.005, "coated plastic", LightTechnique::kMis, kFewPhotons);
}

TEST_F(CausticAgreement, ThinWallsAbsorptionAndLimits)
{
  Material pane = glass_material(0.15f);
  pane.thickness = 0;
  expect_same(room(pane), 64, 8, 0.005, "thin wall", LightTechnique::kMis, kFewPhotons);
  expect_same(room_of_amber(), 128, 8, 0.005, "amber", LightTechnique::kMis, kFewPhotons);
  // Few bounces: photons and camera paths share them.
  for (const int bounces : {1, 2, 3}) {
    Scene scene = room(glass_material());
    scene.render.max_bounces = scene.render.diffuse_bounces = scene.render.glossy_bounces =
        scene.render.transmission_bounces = bounces;
    expect_same(scene, 128, 8, 0.005, "few bounces", LightTechnique::kMis, kFewPhotons);
  }
}

TEST_F(CausticAgreement, EmissiveMeshesEnvironmentsAndRefusals)
{
  Scene scene = room(glass_material());
  scene.lights.clear();
  Material emitter = diffuse_material({0, 0, 0});
  emitter.emission = splat3(4);
  add_object(scene, quad_mesh({-0.5f, 2.1f, -0.5f}, {1, 0, 0}, {0, 0, 1}), emitter);
  scene.environment.color = splat3(0.3f);
  expect_same(scene, 128, 8, 0.005, "emissive mesh and environment");
  // A lamp that casts none, a floor that receives none: theirs is left to paths, and nothing is lost.
  Scene refused = room(glass_material());
  refused.lights.push_back(square_light({-1, 1.5f, 0}, normalize(Vec3f{0.6f, -0.8f, 0}), 0.5f, 3));
  refused.lights.front().casts_caustics = false;
  expect_same(refused, 128, 8, 0.005, "a lamp that casts none", LightTechnique::kMis, kFewPhotons);
  refused.instances.front().flags &= ~std::uint32_t{kCausticReceiver};
  expect_same(refused, 128, 8, 0.005, "a floor that receives none", LightTechnique::kMis, kFewPhotons);
}

TEST_F(CausticAgreement, TransparentEmitters)
{
  Scene scene = room(glass_material());
  scene.lights.clear();
  Material emitter = diffuse_material({0, 0, 0});
  emitter.emission = splat3(10);
  emitter.alpha_mode = AlphaMode::kBlend;
  emitter.base_alpha = 0.4f;
  add_object(scene, quad_mesh({-0.5f, 2.1f, -0.5f}, {1, 0, 0}, {0, 0, 1}), emitter);
  expect_same(scene, 128, 8, 0.005, "transparent emitter", LightTechnique::kMis, kFewPhotons);
  // Nothing lies behind: opaque at 0.4 of the radiance it is the same lamp, for lights sampled and found alike.
  Scene opaque = scene;
  opaque.materials.back().alpha_mode = AlphaMode::kOpaque;
  opaque.materials.back().emission = splat3(4);
  const auto regions = [](const Scene& lit) {
    RenderOptions options = caustic_options(lit, CausticsMode::kOn, kFewPhotons.size, 8);
    options.settings.caustics.photons = kFewPhotons.photons;
    return render_regions(lit, options, 8);
  };
  const Regions a = regions(scene), b = regions(opaque);
  for (int r = 0; r < Regions::kSide * Regions::kSide; ++r) {
    EXPECT_NEAR(a.mean[r], b.mean[r], 4 * std::sqrt(a.cautious_variance(r) + b.cautious_variance(r))) << "region " << r;
  }
}

TEST_F(CausticAgreement, CausticsOfCaustics)
{
  // On white under glass and metal, the caustic itself is a lamp to what cast it: photons go on from it.
  for (const bool is_metal : {false, true}) {
    Material metal;
    metal.roughness = 0.1f;
    metal.base_color = splat3(0.95f);
    Scene scene = room(is_metal ? metal : glass_material());
    scene.materials.front() = diffuse_material(splat3(0.95f));
    expect_same(scene, 256, 16, 0.005, is_metal ? "metal over white" : "glass over white", LightTechnique::kMis,
                kFewPhotons);
  }
}

TEST_F(CausticAgreement, LampInsideAbsorbingGlass)
{
  Scene scene = room_of_amber();
  scene.lights.clear();
  Material emitter = diffuse_material({0, 0, 0});
  emitter.emission = splat3(20);
  Affine3 place;
  place.p = {0.1f, 0.42f, 0};
  add_object(scene, sphere_mesh(0.15f, 16, 8, false), emitter, place);
  expect_same(scene, 128, 8, 0.005, "lamp inside glass");
}

}  // namespace
}  // namespace relief::test
