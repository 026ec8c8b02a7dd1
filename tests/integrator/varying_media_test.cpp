// Media that vary from place to place, whose light is known in closed form or by a quadrature in double precision.
#include <array>
#include <cmath>
#include <functional>
#include <random>

#include "integrator/scene_context.h"
#include "kernel/volume/medium_walk.h"
#include "tests/support/varying_scenes.h"

namespace relief::test {
namespace {

void fill_world(Scene& scene, const VolumeProgram& volume)
{
  scene.environment.medium = Medium{};
  scene.environment.varying_medium = volume;
}

/// 1 + sin(5 x) sin(4 y) sin(3 z), of object space.
GraphScalar waves(Varying& v)
{
  const auto wave = [&](Q axis, double k) {
    return v.build(Op::sine, {v.build(Op::multiply, {v.build.quantity(axis), v.number(k)})});
  };
  const GraphScalar xy = v.build(Op::multiply, {wave(Q::object_x, 5), wave(Q::object_y, 4)});
  return v.build(Op::multiply_add, {xy, wave(Q::object_z, 3), v.number(1)});
}

bool is_told(const Rendered& rendered, const char* what)
{
  return std::any_of(rendered.stats.warnings.begin(), rendered.stats.warnings.end(),
                     [what](const std::string& text) { return text.find(what) != std::string::npos; });
}

TEST(VaryingMedia, LetThroughWhatTheIntegralOfTheirDensitySays)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  Varying v;
  // Densities 1 + z, eᶻ and z², of the channels.
  const GraphScalar z = v.z(1, 0), one = v.number(1), linear = v.z(1, 1);
  const GraphScalar exponential = v.build(Op::exponent, {z}), square = v.build(Op::multiply, {z, z});
  const auto rest = [&](GraphScalar a) { return v.build(Op::subtract, {one, a}); };
  // What absorbs has 1 − colour: channels over 1 are as good.
  v.add(VolumeClosureKind::kAbsorption, {rest(linear), rest(exponential), rest(square), one});
  add_varying(scene, box_mesh({1, 1, 1}), v.program());
  expect_mean(scene, 64, std::exp(-2.0), 1e-6, 0);
  expect_mean(scene, 64, std::exp(-(std::exp(1.0) - std::exp(-1.0))), 1e-6, 1);
  expect_mean(scene, 64, std::exp(-2.0 / 3), 1e-6, 2);
}

/// Absorbs where z is above a height, by the sine of how much. Bounds on sines are a little above what is 0.
VolumeProgram absorbing_above(double height)
{
  Varying v;
  const GraphScalar none = v.number(0), above = v.build(Op::maximum, {v.z(1, -height), none});
  v.add(VolumeClosureKind::kAbsorption, {none, none, none, v.build(Op::sine, {above})});
  return v.program();
}

TEST(VaryingMedia, AreLookedForInThePartOfTheirMeshThatIsFilled)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  add_varying(scene, box_mesh({1, 1, 1}), absorbing_above(0.5));
  const SceneContext context(scene);
  const RateGrid& grid = varying_place(context.globals.varying_media[0], 0).rates;
  const float size = static_cast<float>(grid.size);
  // A box of a grid of all of the mesh, on one side; the other ends where it does.
  EXPECT_NEAR(grid.low.z, 0.5f, 2.0f / size);
  EXPECT_NEAR(grid.low.z + grid.cell.z * size, 1.0f, 1e-3f);
  expect_mean(scene, 64, std::exp(std::cos(0.5) - 1), 1e-6);
}

TEST(VaryingMedia, ThatAreNothingAreNotAsked)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  add_varying(scene, box_mesh({1, 1, 1}), absorbing_above(2));
  const SceneContext context(scene);
  EXPECT_EQ(medium_that_varies(context.globals, 0), nullptr);
  MediumState inside{};
  inside.inside[0] = 0;
  inside.size = 1;
  EXPECT_FALSE(media_vary(context.globals, inside));
  expect_mean(scene, 64, 1.0, 1e-6);
}

TEST(VaryingMedia, AddUpWithOthersAndWithEvenOnes)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  Varying first, second;
  first.add(VolumeClosureKind::kAbsorption, {first.number(0), first.number(0), first.number(0), first.z(0.5, 0.5)});
  second.add(VolumeClosureKind::kAbsorption, {second.number(0), second.number(0), second.number(0), second.z(-1, 1)});
  add_varying(scene, box_mesh({1, 1, 1}), first.program());
  add_medium(scene, box_mesh({1, 1, 0.25f}), absorbing({0.5f, 1, 2}), {0, 0, 0.4f});
  // In its own space it reaches from −1 to 1 as well; it stands one to the front.
  add_varying(scene, box_mesh({1, 1, 1}), second.program(), {0, 0, 1});
  expect_mean(scene, 64, std::exp(-1.0 - 2.0 - 0.25), 1e-6, 0);
  expect_mean(scene, 64, std::exp(-1.0 - 2.0 - 0.5), 1e-6, 1);
}

TEST(VaryingMedia, FillTheWorldToInfinity)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  Varying v;
  // Less and less along the view, which starts at z = 4 and goes to −∞.
  const GraphScalar y = v.build(Op::multiply, {v.build.quantity(Q::position_y), v.number(-1)});
  const GraphScalar density = v.build(Op::multiply, {v.build(Op::exponent, {y}), v.number(0.02)});
  v.add(VolumeClosureKind::kAbsorption, {v.number(0.5), v.number(0), v.number(0), density});
  fill_world(scene, v.program());
  expect_mean(scene, 64, std::exp(-0.5 * 0.02 * std::exp(4.0)), 1e-6, 0);
  expect_mean(scene, 64, std::exp(-0.02 * std::exp(4.0)), 1e-6, 1);
}

TEST(VaryingMedia, ShineAsFarAsTheyLetLightThrough)
{
  Scene scene = view();
  Varying v;
  const GraphScalar one = v.number(1), none = v.number(0);
  v.add(VolumeClosureKind::kAbsorption, {none, none, one, v.z(0.8, 1)});
  v.add(VolumeClosureKind::kEmission, {one, v.number(0.5), one, v.build(Op::exponent, {v.z(1, 0)})});
  add_varying(scene, box_mesh({1, 1, 1}), v.program());
  // From the front, which is at z = 1, to z: 0.8 (1 − z²) / 2 + 1 − z.
  const double red = integral(-1, 1, [](double z) { return std::exp(z - (0.4 * (1 - z * z) + 1 - z)); });
  expect_mean(scene, 64, red, 1e-6, 0);
  expect_mean(scene, 64, 0.5 * red, 1e-6, 1);
  // Blue takes nothing away.
  expect_mean(scene, 64, std::exp(1.0) - std::exp(-1.0), 1e-6, 2);
}

TEST(VaryingMedia, DimASunThatShinesThroughThem)
{
  Scene scene = view();
  add_object(scene, quad_mesh({-40, -50, -3}, {100, 0, 0}, {0, 100, 0}), diffuse_material({0.6f, 0.6f, 0.6f}));
  Varying v;
  const GraphScalar none = v.number(0), z = v.z(1, 0);
  v.add(VolumeClosureKind::kAbsorption, {none, none, none, v.build(Op::multiply, {z, z})});
  add_varying(scene, box_mesh({9, 9, 0.5f}), v.program(), {14, 0, 0});
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = normalize(Vec3f{-3, 0, -1});
  sun.emission = {3, 3, 3};
  scene.lights.push_back(sun);
  const double slant = std::sqrt(10.0), cosine = 1 / slant;
  expect_mean(scene, 64, 3 * cosine * 0.6 / M_PI * std::exp(-slant / 12), 1e-6);
}

TEST(VaryingMedia, ScatterASunOnce)
{
  Scene scene = view();
  Varying v;
  const GraphScalar density = v.z(0.5, 1), one = v.number(1);
  v.add(VolumeClosureKind::kScatter, {v.number(0.4), v.number(0.8), v.number(0.1), density, v.number(0.5)});
  v.add(VolumeClosureKind::kAbsorption, {v.number(0.8), v.number(0.8), one, density});
  add_varying(scene, box_mesh({50, 50, 1}), v.program());
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = {0, 0, -1};
  sun.emission = {3, 3, 3};
  scene.lights.push_back(sun);
  const double phase = (1 - 0.25) / std::pow(1 + 0.25 + 1, 1.5) / (4 * M_PI);
  const auto once = [&](double scattered, double absorbed) {
    return 3 * phase * integral(-1, 1, [=](double z) {
             const double depth = 0.25 * (1 - z * z) + 1 - z;
             return scattered * (1 + 0.5 * z) * std::exp(-2 * (scattered + absorbed) * depth);
           });
  };
  expect_mean(scene, 64, once(0.4, 0.2), 1e-6, 0);
  expect_mean(scene, 64, once(0.8, 0.2), 1e-6, 1);
  expect_mean(scene, 64, once(0.1, 0), 1e-6, 2);
}

/// Radiance along the view of view() where the density is σ e^(z / 3): by the substitution that makes the lamp's part even.
double lamp_in_varying_fog(double scattered, double density, double along, double beside)
{
  const double start = 4, lamp = start - along;
  const auto between = [=](double z, double w) {  // optical depth a metre of a way between two heights
    return std::abs(w - z) < 1e-9 ? density * std::exp(z / 3)
                                  : density * 3 * (std::exp(w / 3) - std::exp(z / 3)) / (w - z);
  };
  const double first = std::atan(-along / beside), last = M_PI / 2 - 1e-9;
  return integral(first, last, [=](double angle) {
    const double t = along + beside * std::tan(angle), r = beside / std::cos(angle), z = start - t;
    const double depth = t * between(start, z) + r * between(z, lamp);
    return scattered * density * std::exp(z / 3) / (4 * M_PI) * std::exp(-depth) / beside;
  });
}

TEST(VaryingMedia, GlowAroundALampFarAndNear)
{
  for (const float beside : {0.02f, 0.5f}) {
    Scene scene = view();
    Varying v;
    const GraphScalar height = v.build(Op::multiply, {v.build.quantity(Q::position_y), v.number(-1.0 / 3)});
    const GraphScalar density = v.build(Op::multiply, {v.build(Op::exponent, {height}), v.number(0.1)});
    v.add(VolumeClosureKind::kScatter, {v.number(0.8), v.number(0.8), v.number(0.8), density, v.number(0)});
    v.add(VolumeClosureKind::kAbsorption, {v.number(0.8), v.number(0.8), v.number(0.8), density});
    fill_world(scene, v.program());
    Light lamp;
    lamp.P = {0.1f + beside, 0.03f, 1};
    lamp.emission = {1, 1, 1};
    scene.lights.push_back(lamp);
    expect_mean(scene, 64, lamp_in_varying_fog(0.8, 0.1, 3, static_cast<double>(beside)), 1e-9);
  }
}

TEST(VaryingMedia, ThatTakeNothingVanishInAWhiteFurnace)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  scene.render.max_bounces = scene.render.volume_bounces = 200;
  Varying v;
  v.add(VolumeClosureKind::kScatter, {v.number(1), v.number(2), v.number(4), waves(v), v.number(0.6)});
  add_varying(scene, sphere_mesh(1, 32, 16, false), v.program());
  add_medium(scene, sphere_mesh(0.7f, 32, 16, false), scattering({0.5f, 1, 2}, -0.6f), {0.5f, 0, 0});
  for (const int channel : {0, 2}) expect_mean(scene, 16, 1.0, 1e-3, channel);
}

TEST(VaryingMedia, OfAnyCoefficientsHaveAFinitePicture)
{
  // 1e30 at one side, negative at the other, not a number between.
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  scene.render.max_bounces = scene.render.volume_bounces = 4;
  Varying v;
  const GraphScalar root = v.build(Op::square_root, {v.z(1, -0.2)});
  const GraphScalar wild = v.build(Op::multiply, {v.z(1e30, 0), v.build(Op::logarithm, {v.z(1, 0), v.number(-1)})});
  const GraphScalar density = v.build(Op::add, {wild, root});
  v.add(VolumeClosureKind::kScatter, {v.number(1), v.number(0.5), v.z(-1e30, 0), density, v.z(2, 0)});
  v.add(VolumeClosureKind::kEmission, {v.number(1), v.number(1), v.number(1), density});
  add_varying(scene, box_mesh({1, 1, 1}), v.program());
  const Rendered rendered = render_scene(scene, render_options(scene, 4, 4));
  EXPECT_TRUE(std::isfinite(rendered.mean()));
}

TEST(VaryingMedia, WithoutBoundsAreWarnedAboutAndRight)
{
  Scene scene = view();
  scene.environment.color = {1, 1, 1};
  Varying v;
  // 1 / max(|z|, 0.01), of whose second half nothing is known as it goes around 0 by a detour.
  const GraphScalar z = v.z(1, 0), size = v.build(Op::square_root, {v.build(Op::multiply, {z, z})});
  const GraphScalar zero =
      v.build(Op::subtract, {v.build(Op::add, {size, v.build(Op::sine, {z})}), v.build(Op::sine, {z})});
  const GraphScalar density = v.build(Op::divide, {v.number(0.1), v.build(Op::add, {zero, v.number(0.002)})});
  const GraphScalar none = v.number(0);
  v.add(VolumeClosureKind::kAbsorption, {none, none, none, density});
  add_varying(scene, box_mesh({1, 1, 1}), v.program());
  scene.instances.back().name = "pole";
  EXPECT_TRUE(is_told(render_scene(scene, render_options(scene, 4, 4)), "\"pole\" has no bounds"));
  expect_mean(scene, 256, std::exp(-0.2 * std::log(1.002 / 0.002)), 1e-6);
}

/// Rays through a density by what it is taken for. It sends out .6 of itself.
class MediumWalkIn : public testing::TestWithParam<RateBox> {
 protected:
  /// Compares means of rays through a density of 1 + z / 2, of which `albedo` scatters, from z = 1 to −1.
  /// @param values  (globals, media, seed) -> two numbers
  template <typename Values>
  static void expect_means(double albedo, const double (&expected)[2], const Values& values)
  {
    Scene scene = view();
    Varying v;
    const GraphScalar color = v.number(albedo), black = v.number(0);
    v.add(VolumeClosureKind::kScatter, {color, color, color, v.z(0.5, 1), black});
    const GraphScalar rest = v.number(albedo);
    v.add(VolumeClosureKind::kAbsorption, {rest, rest, rest, v.z(0.5, 1)});
    const GraphScalar one = v.number(1);
    v.add(VolumeClosureKind::kEmission, {one, one, one, v.z(0.3, 0.6)});
    add_varying(scene, box_mesh({1, 1, 1}), v.program());
    const SceneContext context(scene);
    VaryingMedium medium = context.globals.varying_media[0];
    VaryingPlace place = varying_place(medium, 0);
    const auto size = static_cast<std::size_t>(place.rates.size);
    const std::vector<RateBox> boxes(size * size * size, GetParam());
    place.rates.boxes = boxes.data();
    medium.places = &place;
    const std::int32_t first = 0;
    medium.place_of_instance = &first;
    KernelGlobals g = context.globals;
    g.varying_media = &medium;
    MediumState inside{};
    inside.inside[0] = 0;
    inside.size = 1;
    double sum[2] = {}, squares[2] = {};
    constexpr int kSamples = 200000;
    for (int i = 0; i < kSamples; ++i) {
      const std::array<double, 2> got = values(g, inside, static_cast<std::uint32_t>(i));
      for (std::size_t which = 0; which < 2; ++which) {
        sum[which] += got[which];
        squares[which] += got[which] * got[which];
      }
    }
    for (int which = 0; which < 2; ++which) {
      const double mean = sum[which] / kSamples;
      const double error = std::sqrt((squares[which] / kSamples - mean * mean) / kSamples);
      EXPECT_NEAR(mean, expected[which], kQuantile * error) << which;
      EXPECT_LT(error, 0.01);
    }
  }
};

constexpr Vec3f kRayStart{0.1f, 0.2f, 1}, kRayDown{0, 0, -1};

TEST_P(MediumWalkIn, HasTheRightMeanHoweverWrongThatIs)
{
  // What is let through, and the integral of the density times that.
  const double expected[2] = {std::exp(-2.0), 1 - std::exp(-2.0)};
  expect_means(0, expected, [](const KernelGlobals& g, const MediumState& inside, std::uint32_t seed) {
    CountedNumbers numbers{seed};
    const MediumRay ray = medium_ray_make(g, inside, kRayStart, kRayDown, 2);
    const auto passes = static_cast<double>(medium_ray_transmittance(g, ray, {}, numbers).x);
    MediumWalk sampled = medium_walk_make(g, inside, kRayStart, kRayDown, 2, seed);
    // So that there are places of more density than collisions.
    sampled.factor = 1;
    sampled.collision = {};
    walk_collide(sampled);
    medium_walk_sample(sampled, unit_float(hash_mix_32(seed + 77u)));
    medium_walk_approach(sampled, equiangular_make(sampled.O, sampled.D, 2, {0.4f, 0, 0.3f}),
                         unit_float(hash_mix_32(seed + 99u)));
    Vec3f left{1, 1, 1};
    double taken = 0;
    MediumPlaces places;
    for (bool goes_on = true; goes_on && !is_zero(left);) {
      goes_on = medium_walk_next(g, sampled, {}, places);
      for (int k = 0; k < places.size && !is_zero(left); ++k) {
        const float sigma_t = medium_place_media(sampled, places, k).sigma_t.x;
        taken += static_cast<double>(left.x * places.passes[k].x * sigma_t / places.rate[k]);
        medium_walk_correct(sampled, places, k, splat3(sigma_t), left);
      }
    }
    return std::array{passes, taken};
  });
}

TEST_P(MediumWalkIn, FliesAsOftenAsItScattersAndPasses)
{
  const double albedo = 0.7, expected[2] = {std::exp(-2.0), albedo * (1 - std::exp(-2.0))};
  expect_means(albedo, expected, [](const KernelGlobals& g, const MediumState& inside, std::uint32_t seed) {
    CountedNumbers numbers{seed};
    MediumFlight flight;
    const MediumRay ray = medium_ray_make(g, inside, kRayStart, kRayDown, 2);
    medium_fly(g, ray, {}, numbers, {1, 1, 1}, flight);
    if (!flight.scatters) return std::array{static_cast<double>(flight.left.x), 0.0};
    return std::array{0.0, static_cast<double>(flight.left.x * flight_media(ray, flight).sigma_s.x)};
  });
}

TEST_P(MediumWalkIn, FliesPastWhatShines)
{
  // Of an albedo of 1 as of any: what is scattered goes on elsewhere.
  const double share = 1 - std::exp(-2.0), expected[2] = {0.6 * share, share};
  expect_means(1, expected, [](const KernelGlobals& g, const MediumState& inside, std::uint32_t seed) {
    CountedNumbers numbers{seed};
    MediumFlight flight;
    const MediumRay ray = medium_ray_make(g, inside, kRayStart, kRayDown, 2);
    medium_fly(g, ray, {}, numbers, {1, 1, 1}, flight);
    double scattered = 0;
    if (flight.scatters) {
      // What the medium is where it is scattered, by what it says and by where that is.
      const MediaSum media = flight_media(ray, flight);
      const float z = kRayStart.z - flight.distance;
      EXPECT_NEAR(media.sigma_s.x, 1 + 0.5f * z, 1e-5f);
      scattered = static_cast<double>(flight.left.x * media.sigma_s.x);
    }
    return std::array{static_cast<double>(flight.emitted.x), scattered};
  });
}

INSTANTIATE_TEST_SUITE_P(Boxes,
                         MediumWalkIn,
                         testing::Values(RateBox{{0, 0, 0}, 1, 1, 2},           // collisions alone, too few
                                         RateBox{{1, 1, 1}, 0.6f, 1, 1.5f},     // the mean
                                         RateBox{{2, 2, 2}, 1, 0.2f, 1},        // too dense, and flights too long
                                         RateBox{{0.5f, 0.5f, 0.5f}, 2, 3, 4},  // too thin
                                         RateBox{{0.5f, 0.5f, 0.5f}, 2, 0, 1.2f}));

TEST(VaryingMedia, AreNowhereFartherFromWhatTheyAreTakenForThanTheirBounds)
{
  Scene scene = view();
  Varying v;
  v.add(VolumeClosureKind::kScatter, {waves(v), v.number(1), v.number(0.5), waves(v), v.number(0)});
  v.add(VolumeClosureKind::kPrincipled,
        {v.build.quantity(Q::position_x), v.number(0.4), v.number(1.5), waves(v), v.number(0),
         v.build.quantity(Q::object_z), v.number(0.2), v.number(2), v.number(0), v.number(0), v.number(0), v.number(0),
         v.number(0), v.number(0), v.number(0), v.number(0), v.number(0)});
  add_varying(scene, box_mesh({1, 0.6f, 1.4f}), v.program());
  Instance& instance = scene.instances.back();
  instance.world_from_object.x = {0.8f, 0.6f, 0};
  instance.world_from_object.y = {-0.6f, 0.8f, 0};
  instance.world_from_object.p = {0.3f, -2, 5};
  const SceneContext context(scene);
  const VaryingMedium& medium = context.globals.varying_media[0];
  const RateGrid& grid = varying_place(medium, 0).rates;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> part(0, 1);
  for (int i = 0; i < 20000; ++i) {
    Vec3f P[8];
    Medium media[8];
    for (Vec3f& point : P) {
      point = grid.low + grid.cell * static_cast<float>(grid.size) * Vec3f{part(random), part(random), part(random)};
    }
    varying_medium_eval(context.globals, medium, 0, P, 8, {0, 0, 1}, {}, media);
    for (int k = 0; k < 8; ++k) {
      const RateBox& box = *rate_way_make(grid, P[k], {0, 0, 1}).box;
      // A tenth of what may be off is corrected at least.
      ASSERT_LE(max_component(abs(media[k].sigma_t - box.sigma_t)), 10 * box.residual * 1.0001f)
          << P[k].x << " " << P[k].y;
      ASSERT_GE(box.shows, 0.1f * max_component(media[k].sigma_t) * 0.9999f);
      ASSERT_GE(box.most, 0.2f * max_component(media[k].sigma_t) * 0.9999f);
    }
  }
}

TEST(RateGrid, RaysGoThroughEachBoxOnTheirWay)
{
  // Three levels of 4³ boxes, of which each has a number of its own.
  std::vector<RateBox> boxes(3 * 64);
  for (std::size_t i = 0; i < boxes.size(); ++i) boxes[i].residual = static_cast<float>(i + 1);
  const RateGrid grid{{-1, -2, -1}, {0.5f, 1, 0.5f}, 4, 3, boxes.data()};
  const auto rate_of = [&](const std::array<double, 3>& P) {
    const double low[3] = {-1, -2, -1}, cell[3] = {0.5, 1, 0.5};
    for (std::size_t level = 0; level < 3; ++level) {
      std::size_t index = level;
      bool within = true;
      for (std::size_t axis = 3; axis-- > 0;) {
        const double length = cell[axis] * std::exp2(level), first = (low[axis] + 2 * cell[axis]) - 2 * length;
        const double at = std::floor((P[axis] - first) / length);
        within = within && at >= 0 && at < 4;
        index = index * 4 + static_cast<std::size_t>(std::max(at, 0.0));
      }
      if (within) return static_cast<double>(boxes[index].residual);
    }
    return 0.0;
  };
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 300; ++i) {
    const Vec3f O = Vec3f{normal(random), normal(random), normal(random)} * 4.0f;
    Vec3f D = normalize(Vec3f{normal(random), normal(random), normal(random)});
    if (i % 5 == 0) D = {0, i % 2 == 0 ? 1.0f : -1.0f, 0};
    double depth = 0, expected = 0;
    int steps = 0;
    RateWay way = rate_way_make(grid, O, D);
    for (float t = 0; t < 30;) {
      const float end = std::min(way.end, 30.0f);
      ASSERT_GE(end, t);
      ASSERT_LT(++steps, 100);
      if (way.box != nullptr) depth += static_cast<double>(way.box->residual) * static_cast<double>(end - t);
      t = end;
      rate_way_go(way);
    }
    constexpr int kPoints = 30000;
    for (int k = 0; k < kPoints; ++k) {
      const double t = 30 * (k + 0.5) / kPoints;
      const auto along = [t](float o, float d) { return static_cast<double>(o) + t * static_cast<double>(d); };
      expected += rate_of({along(O.x, D.x), along(O.y, D.y), along(O.z, D.z)}) * 30 / kPoints;
    }
    EXPECT_NEAR(depth, expected, 2e-3 * expected + 0.5) << i;
  }
}

}  // namespace
}  // namespace relief::test
