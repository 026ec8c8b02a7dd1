// Caustics that are switched off are not there by either road, and those that are left are neither lost nor counted twice.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/caustic_scene.h"

namespace relief::test {
namespace {

constexpr CausticKinds kKinds[] = {CausticKinds::kBoth, CausticKinds::kReflective, CausticKinds::kRefractive,
                                   CausticKinds::kNone};

/// A ball over a floor under a lamp that paths find by it.
Scene ball_over_floor(const Material& ball, const Material& floor)
{
  Scene scene = empty_scene();
  add_floor(scene, 2);
  scene.materials[static_cast<std::size_t>(scene.instances.front().material_index)] = floor;
  Affine3 place;
  place.p = {0.1f, 0.42f, 0};
  add_caster(scene, sphere_mesh(0.4f, 64, 32, true), ball, place);
  scene.lights.push_back(square_light({0.3f, 2.2f, 0.2f}, normalize(Vec3f{-0.1f, -1, 0}), 0.7f, 4));
  look_down(scene, {}, 1.1f, 1.9f);
  // More of them may be of both kinds.
  scene.render.diffuse_bounces = 1;
  return scene;
}

Regions regions_of(const Scene& scene, CausticKinds kinds, CausticsMode mode)
{
  const bool has_photons = mode == CausticsMode::kOn;
  RenderOptions options = caustic_options(scene, mode, has_photons ? kFewPhotons.size : 32, has_photons ? 8 : 96);
  options.settings.caustics.kinds = kinds;
  options.settings.caustics.photons = kFewPhotons.photons;
  return render_regions(scene, options, 6);
}

/// @param terms  with their signs, which should come to nothing
void expect_none(std::initializer_list<std::pair<double, const Regions*>> terms, const char* what)
{
  for (int r = 0; r < Regions::kSide * Regions::kSide; ++r) {
    double sum = 0, variance = 0, most = 0;
    for (const auto& [sign, regions] : terms) {
      sum += sign * regions->mean[r];
      variance += regions->cautious_variance(r);
      most = std::max(most, regions->mean[r]);
    }
    EXPECT_NEAR(sum, 0, 4 * std::sqrt(variance) + 0.005 * most) << what << ", region " << r;
  }
}

double whole(const Regions& regions)
{
  double sum = 0;
  for (const double mean : regions.mean) sum += mean / (Regions::kSide * Regions::kSide);
  return sum;
}

TEST(CausticKinds, AreTheSameByPhotonsAndByPathsAndAddUp)
{
  struct Case {
    const char* name;
    Material ball;
    bool reflects, refracts;
  };
  Material rough_metal = mirror_material();
  rough_metal.roughness = 0.2f;
  for (const Case& c :
       {Case{"mirror", mirror_material(), true, false}, Case{"rough metal", rough_metal, true, false},
        Case{"glass", glass_material(), true, true}, Case{"rough glass", glass_material(0.3f), true, true}}) {
    const Scene scene = ball_over_floor(c.ball, diffuse_material(splat3(0.5f)));
    Regions on[4], off[4];
    for (int k = 0; k < 4; ++k) {
      on[k] = regions_of(scene, kKinds[k], CausticsMode::kOn);
      off[k] = regions_of(scene, kKinds[k], CausticsMode::kOff);
      expect_none({{1, &on[k]}, {-1, &off[k]}}, c.name);
    }
    for (const Regions* of : {on, off}) expect_none({{1, of}, {-1, of + 1}, {-1, of + 2}, {1, of + 3}}, c.name);
    if (c.refracts) {
      EXPECT_GT(whole(on[2]), 1.02 * whole(on[3])) << c.name;
    }
    if (c.reflects && !c.refracts) {
      EXPECT_GT(whole(on[1]), 1.02 * whole(on[3])) << c.name;
      expect_none({{1, &on[2]}, {-1, &on[3]}}, c.name);
    }
  }
}

TEST(CausticKinds, WithoutReflectionsAFloorBesideAMirrorHasTheLampsOwnLight)
{
  Scene scene = empty_scene();
  add_floor(scene, 3);
  add_caster(scene, quad_mesh({-1, 0, 1.5f}, {0, 0, -3}, {0, 3, 0}), mirror_material());
  scene.lights.push_back(point_light({0, 1, -1}, 5));
  scene.lights.back().radius = 0.2f;
  look_down(scene, {0.3f, 0, 0.2f}, 0.4f, 2);
  // The lamp, which the camera does not see, and with reflections its mirror image too; of several bounces between the two the floor would get more.
  for (const CausticKinds kinds : {CausticKinds::kReflective, CausticKinds::kRefractive, CausticKinds::kNone}) {
    RenderOptions options = caustic_options(scene, CausticsMode::kOn, 32, 32);
    options.settings.caustics.kinds = kinds;
    options.settings.caustics.photons = 1 << 16;
    options.settings.max_bounces = 1;
    const Rendered picture = render_scene(scene, options);
    double expected = 0;
    for (int y = 0; y < 32; ++y) {
      for (int x = 0; x < 32; ++x) {
        const float* P = picture.at(Aov::kPosition, x, y);
        for (const float lamp_x : {0.0f, -2.0f}) {
          if (lamp_x < 0 && kinds != CausticKinds::kReflective) continue;
          const Vec3f to_lamp = Vec3f{lamp_x, 1, -1} - Vec3f{P[0], P[1], P[2]};
          const auto d2 = static_cast<double>(length_squared(to_lamp));
          expected += 5.0 / (d2 * std::sqrt(d2)) * 0.5 / 3.14159265358979 / (32 * 32);
        }
      }
    }
    EXPECT_NEAR(picture.mean() / expected, 1, 0.01) << static_cast<int>(kinds);
  }
}

TEST(CausticKinds, LeaveWhatIsSeenByGlossyReflectionAlone)
{
  // Metal shows photons by no diffuse event: as in Cycles it sees what it saw, by paths where photons are not kept.
  Material rough;
  rough.roughness = 0.6f;
  const Scene scene = ball_over_floor(mirror_material(), rough);
  const Regions both = regions_of(scene, CausticKinds::kBoth, CausticsMode::kOff);
  for (const CausticsMode mode : {CausticsMode::kOn, CausticsMode::kOff}) {
    const Regions refractive = regions_of(scene, CausticKinds::kRefractive, mode);
    const double share = whole(refractive) / whole(both);
    // What metal's facets reflect more than once counts as diffuse.
    EXPECT_GT(share, 0.97);
    EXPECT_LT(share, 1.005);
  }
}

TEST(CausticKinds, WithoutAnyThereAreNoPhotons)
{
  const Scene scene = ball_over_floor(glass_material(), diffuse_material(splat3(0.5f)));
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 16, 2);
  options.settings.caustics.kinds = CausticKinds::kNone;
  const Rendered picture = render_scene(scene, options);
  EXPECT_EQ(picture.stats.caustics.photons, 0u);
  EXPECT_EQ(picture.stats.caustics.reason, "there are to be none");
}

}  // namespace
}  // namespace relief::test
