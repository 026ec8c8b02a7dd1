// Layers beside the picture, on scenes where their values are known.
#include <cmath>

#include "scene/cryptomatte.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

constexpr int kSize = 16;

/// A wall across the picture's left half, 4 m in front of the camera.
Scene half_wall(const Material& material)
{
  Scene scene = empty_scene();
  add_object(scene, quad_mesh({-10, -10, 0}, {10, 0, 0}, {0, 20, 0}), material);
  scene.instances.back().name = "wall";
  return scene;
}

double mean_over_wall(const Rendered& r, Aov aov, int channel = 0)
{
  double sum = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize / 2; ++x) sum += static_cast<double>(r.at(aov, x, y)[channel]);
  }
  return sum / (kSize * kSize / 2);
}

TEST(Layers, MistGrowsFromItsStartToItsEnd)
{
  const MistFalloff falloffs[] = {MistFalloff::kLinear, MistFalloff::kQuadratic, MistFalloff::kInverseQuadratic};
  const float expected[] = {0.25f, 0.0625f, 0.5f};
  for (int i = 0; i < 3; ++i) {
    Scene scene = half_wall(diffuse_material({0.5f, 0.5f, 0.5f}));
    scene.cameras[0].camera.projection = Projection::kOrthographic;
    scene.render.mist = {3, 4, falloffs[i]};
    const Rendered r = render_scene(scene, render_options(scene, kSize, 4));
    EXPECT_NEAR(*r.at(Aov::kMist, 2, 8), expected[i], 1e-5f);
    EXPECT_EQ(*r.at(Aov::kMist, 12, 8), 1.0f) << "nothing is as far away as can be";
  }
}

// A perspective camera's mist is by distance, not by depth: a sphere around it has one value.
TEST(Layers, MistOfAPerspectiveIsByDistance)
{
  Scene scene = empty_scene();
  Affine3 around_camera;
  around_camera.p = {0, 0, 4};
  add_object(scene, sphere_mesh(2, 256, 128, false), diffuse_material({0.5f, 0.5f, 0.5f}), around_camera);
  scene.render.mist = {0, 4, MistFalloff::kLinear};
  const Rendered r = render_scene(scene, render_options(scene, kSize, 4));
  for (int x = 0; x < kSize; ++x) EXPECT_NEAR(*r.at(Aov::kMist, x, x), 0.5f, 1e-3f);
}

/// A panorama that shows all around in a circle, or the front half.
Camera round_panorama(const Scene& scene, PanoramaKind kind)
{
  Camera camera = scene.cameras[0].camera;
  camera.projection = Projection::kPanoramic;
  camera.panorama.kind = kind;
  camera.half_width = camera.half_height = 1;
  camera_fit(camera, 1, 1);
  return camera;
}

TEST(Layers, DepthAndMistOfAPanoramaAreByDistance)
{
  Scene scene = empty_scene();
  Affine3 around_camera;
  around_camera.p = {0, 0, 4};
  add_object(scene, sphere_mesh(2, 256, 128, false), diffuse_material({0.5f, 0.5f, 0.5f}), around_camera);
  scene.render.mist = {0, 4, MistFalloff::kLinear};
  scene.cameras[0].camera = round_panorama(scene, PanoramaKind::kMirrorBall);
  const Rendered r = render_scene(scene, render_options(scene, kSize, 4));
  for (int x = 3; x < kSize - 3; ++x) {
    EXPECT_NEAR(*r.at(Aov::kDepth, x, x), 2.0f, 2e-3f);
    EXPECT_NEAR(*r.at(Aov::kMist, x, x), 0.5f, 1e-3f);
  }
}

TEST(Layers, WhatALensDoesNotShowIsBlackAndCovered)
{
  Scene scene = empty_scene();
  scene.environment.color = {0.25f, 0.5f, 0.75f};
  scene.cameras[0].camera = round_panorama(scene, PanoramaKind::kEquidistant);
  for (const bool is_shown : {true, false}) {
    scene.environment.visible_to_camera = is_shown;
    const Rendered r = render_scene(scene, render_options(scene, kSize, 16));
    EXPECT_EQ(r.radiance(0, 0), (Vec3f{}));
    EXPECT_EQ(r.at(Aov::kBeauty, 0, 0)[3], 1.0f);
    EXPECT_EQ(r.at(Aov::kEnvironment, 0, 0)[1], 0.0f);
    EXPECT_EQ(r.radiance(8, 8).y, is_shown ? 0.5f : 0.0f);
    EXPECT_EQ(r.at(Aov::kBeauty, 8, 8)[3], 0.0f);
    EXPECT_EQ(r.stats.counters.camera_rays, 16u * kSize * kSize) << "by these progress is told";
    EXPECT_LT(r.stats.counters.background_hits, r.stats.counters.camera_rays);
  }
}

TEST(Layers, EmissionAndEnvironmentAreWhatTheCameraSees)
{
  Material glow = diffuse_material({0.5f, 0.5f, 0.5f});
  glow.emission = {3, 2, 1};
  Scene scene = half_wall(glow);
  scene.environment.color = {0.25f, 0.5f, 0.75f};
  for (const bool is_shown : {true, false}) {
    scene.environment.visible_to_camera = is_shown;
    const Rendered r = render_scene(scene, render_options(scene, kSize, 4));
    EXPECT_EQ(r.at(Aov::kEmission, 2, 8)[1], 2.0f);
    EXPECT_EQ(r.at(Aov::kEmission, 12, 8)[1], 0.0f);
    EXPECT_EQ(r.at(Aov::kEnvironment, 2, 8)[1], 0.0f);
    EXPECT_EQ(r.at(Aov::kEnvironment, 12, 8)[1], 0.5f) << "shown or not";
    EXPECT_EQ(r.radiance(12, 8).y, is_shown ? 0.5f : 0.0f);
  }
}

TEST(Layers, BackdropsAreSeenInTheEnvironmentsPlaceByTheCameraAlone)
{
  Scene scene = half_wall(diffuse_material({0.5f, 0.5f, 0.5f}));
  scene.environment.color = {0.25f, 0.5f, 0.75f};
  const Rendered lit = render_scene(scene, render_options(scene, kSize, 4));
  scene.environment.backdrop.emplace().color = {2, 3, 4};
  const Rendered r = render_scene(scene, render_options(scene, kSize, 4));
  EXPECT_EQ(r.radiance(12, 8).y, 3.0f);
  EXPECT_EQ(r.at(Aov::kEnvironment, 12, 8)[1], 3.0f);
  EXPECT_EQ(r.radiance(2, 8).y, lit.radiance(2, 8).y) << "what lights the wall is what lit it before";
  EXPECT_GT(lit.radiance(2, 8).y, 0.0f);
}

// A wall at distance h over a point covers of its cosine-weighted hemisphere what lies within the distance d looked at:
// 1 − h²/d² of a whole plane.
TEST(Layers, AmbientOcclusionIsTheOpenShareOfTheHemisphere)
{
  for (const float distance : {0.4f, 1.0f, 2.0f}) {
    Scene scene = half_wall(diffuse_material({0.5f, 0.5f, 0.5f}));
    add_object(scene, quad_mesh({-90, -90, 0.5f}, {180, 0, 0}, {0, 180, 0}), diffuse_material({1, 1, 1}));
    scene.instances.back().flags = kCastsShadow;
    scene.render.occlusion_distance = distance;
    const Rendered r = render_scene(scene, render_options(scene, kSize, 64));
    const double expected = std::min(1.0, 0.25 / static_cast<double>(sqr(distance)));
    EXPECT_NEAR(mean_over_wall(r, Aov::kAmbientOcclusion), expected, 0.01);
    EXPECT_EQ(*r.at(Aov::kAmbientOcclusion, 12, 8), 0.0f);
  }
}

constexpr Aov kLight[] = {Aov::kDiffuseDirect,  Aov::kDiffuseIndirect,    Aov::kGlossyDirect,
                          Aov::kGlossyIndirect, Aov::kTransmissionDirect, Aov::kTransmissionIndirect};

/// Diffuse, metal, glass, thin and coated surfaces under a sky.
Scene mixed_room()
{
  Scene scene = half_wall(diffuse_material({0.7f, 0.4f, 0.2f}));
  Material metal = diffuse_material({0.9f, 0.6f, 0.3f});
  metal.metallic = 1;
  metal.roughness = 0.3f;
  Material glass = diffuse_material({0.9f, 1.0f, 0.8f});
  glass.transmission = 1;
  glass.thickness = 1;
  glass.roughness = 0;
  Material plastic = diffuse_material({0.1f, 0.2f, 0.7f});
  plastic.roughness = 0.4f;
  plastic.clearcoat = 1;
  const Material materials[] = {metal, glass, plastic};
  for (int i = 0; i < 3; ++i) {
    Affine3 place;
    place.p = {static_cast<float>(i) - 1.0f, 0, 0.8f};
    add_object(scene, sphere_mesh(0.5f, 24, 16, false), materials[i], place);
  }
  // Light comes straight through what is thin.
  Material pane = glass;
  pane.thickness = 0;
  add_object(scene, quad_mesh({0.5f, -10, 1.5f}, {10, 0, 0}, {0, 20, 0}), pane);
  scene.environment.color = {0.3f, 0.4f, 0.5f};
  return scene;
}

// All light of a sample is counted once: what is emitted or behind, and what was scattered first in one of three ways.
TEST(Layers, LightByEventsMakesTheWhole)
{
  for (const float clamp : {0.0f, 0.5f}) {
    Scene scene = mixed_room();
    scene.render.clamp_direct = scene.render.clamp_indirect = clamp;
    const Rendered r = render_scene(scene, render_options(scene, kSize, 16));
    double sums[std::size(kLight)] = {};
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        for (int c = 0; c < 3; ++c) {
          double sum = static_cast<double>(r.at(Aov::kEmission, x, y)[c]) +
                       static_cast<double>(r.at(Aov::kEnvironment, x, y)[c]);
          for (std::size_t i = 0; i < std::size(kLight); ++i) {
            const auto part = static_cast<double>(r.at(kLight[i], x, y)[c]);
            EXPECT_GE(part, 0.0);
            sum += part;
            sums[i] += part;
          }
          EXPECT_NEAR(sum, static_cast<double>(r.at(Aov::kBeauty, x, y)[c]), 1e-5) << x << ' ' << y << ' ' << c;
        }
      }
    }
    for (const double sum : sums) EXPECT_GT(sum, 0.0);
  }
}

// A matte wall under an even sky reflects its colour times the sky, all of it diffusely and straight from there; a mirror reflects
// all of it as a mirror.
TEST(Layers, LightByEventsIsThatOfTheSurfaceAlone)
{
  Material mirror = diffuse_material({0.9f, 0.6f, 0.3f});
  mirror.metallic = 1;
  mirror.roughness = 0;
  Material matte = diffuse_material({0.9f, 0.6f, 0.3f});
  matte.specular = 0;
  for (const bool is_mirror : {false, true}) {
    Scene scene = half_wall(is_mirror ? mirror : matte);
    scene.cameras[0].camera.projection = Projection::kOrthographic;
    scene.environment.color = {2, 2, 2};
    const Rendered r = render_scene(scene, render_options(scene, kSize, 256));
    const Aov direct = is_mirror ? Aov::kGlossyDirect : Aov::kDiffuseDirect;
    const Aov color = is_mirror ? Aov::kGlossyColor : Aov::kDiffuseColor;
    const float base[3] = {0.9f, 0.6f, 0.3f};
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(mean_over_wall(r, direct, c), 2 * static_cast<double>(base[c]), 0.01);
      EXPECT_NEAR(mean_over_wall(r, color, c), static_cast<double>(base[c]), 1e-5);
    }
    for (const Aov aov : kLight) {
      if (aov == direct) continue;
      EXPECT_EQ(mean_over_wall(r, aov), 0.0) << kAovInfo[static_cast<std::size_t>(aov)].name;
    }
  }
}

TEST(Layers, AHoldoutIsAHoleForTheCameraAlone)
{
  Material glow = diffuse_material({0, 0, 0});
  glow.emission = {3, 3, 3};
  Scene scene = half_wall(glow);
  scene.instances.back().flags |= kHoldout;
  // Turned to the wall, it shows that the wall shines for others.
  add_object(scene, quad_mesh({1, -10, -5}, {0, 20, 0}, {0, 0, 10}), diffuse_material({0.5f, 0.5f, 0.5f}));
  const Rendered r = render_scene(scene, render_options(scene, kSize, 64));
  EXPECT_EQ(r.at(Aov::kBeauty, 2, 8)[0], 0.0f);
  EXPECT_EQ(r.at(Aov::kBeauty, 2, 8)[3], 0.0f);
  EXPECT_EQ(*r.at(Aov::kHoldout, 2, 8), 1.0f);
  EXPECT_EQ(*r.at(Aov::kHoldout, 15, 8), 0.0f);
  EXPECT_EQ(r.at(Aov::kEmission, 2, 8)[0], 0.0f);
}

TEST(Layers, DenoisersAreToldOfWhatMirrorsShow)
{
  Material mirror = diffuse_material({0.5f, 0.8f, 1.0f});
  mirror.metallic = 1;
  mirror.roughness = 0;
  Scene scene = half_wall(mirror);
  scene.cameras[0].camera.projection = Projection::kOrthographic;
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 1;
  // Behind the camera, 6 m from the wall.
  add_object(scene, quad_mesh({10, -10, 6}, {-20, 0, 0}, {0, 20, 0}), diffuse_material({0.4f, 0.2f, 0.5f}));
  const Rendered r = render_scene(scene, render_options(scene, kSize, 4));
  const float* albedo = r.at(Aov::kDenoisingAlbedo, 2, 8);
  EXPECT_NEAR(albedo[0], 0.2f, 1e-4f);
  EXPECT_NEAR(albedo[1], 0.16f, 1e-4f);
  const float* N = r.at(Aov::kDenoisingNormal, 2, 8);
  EXPECT_NEAR(N[2], 1.0f, 1e-5f) << "away from the camera, as seen in the mirror";
  EXPECT_NEAR(*r.at(Aov::kDenoisingDepth, 2, 8), 4.0f, 1e-4f) << "of the mirror itself";
  EXPECT_EQ(*r.at(Aov::kDenoisingDepth, 12, 8), 0.0f);
  const float* half = r.at(Aov::kDenoisingHalf, 2, 8);
  EXPECT_NEAR(half[0], 0.2f, 1e-4f);
  EXPECT_NEAR(half[5], 1.0f, 1e-5f);
  EXPECT_NEAR(half[6], 4.0f, 1e-4f);
  // The layers of the first hit are still the mirror's.
  EXPECT_NEAR(r.at(Aov::kNormal, 2, 8)[2], 1.0f, 1e-5f);
  EXPECT_NEAR(*r.at(Aov::kDepth, 2, 8), 4.0f, 1e-4f);
}

TEST(Layers, CryptomattesRankIdsByCoverage)
{
  Scene scene = half_wall(diffuse_material({0.5f, 0.5f, 0.5f}));
  // A quarter of the picture's middle column, before the wall and beside it.
  add_object(scene, quad_mesh({-0.025f, -10, 1}, {0.0501f, 0, 0}, {0, 20, 0}), diffuse_material({1, 1, 1}));
  scene.instances.back().name = "pole";
  scene.cameras[0].camera.projection = Projection::kOrthographic;
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 0.8f;
  for (const int levels : {1, 2, 6}) {
    scene.render.cryptomatte_levels = levels;
    RenderOptions options = render_options(scene, kSize, 256);
    const Rendered r = render_scene(scene, options);
    const float wall = cryptomatte_id(cryptomatte_hash("wall")), pole = cryptomatte_id(cryptomatte_hash("pole"));
    const float* pairs = r.at(Aov::kCryptoObject, 7, 8);
    EXPECT_EQ(pairs[0], wall);
    EXPECT_NEAR(pairs[1], 0.75f, 0.02f);
    EXPECT_EQ(pairs[2], levels > 1 ? pole : 0.0f);
    EXPECT_NEAR(pairs[3], levels > 1 ? 0.25f : 0.0f, 0.02f);
    const float* beside = r.at(Aov::kCryptoObject, 8, 8);
    EXPECT_EQ(beside[0], pole);
    EXPECT_NEAR(beside[1], 0.25f, 0.02f);
    EXPECT_EQ(beside[2], 0.0f);
    EXPECT_EQ(r.at(Aov::kCryptoMaterial, 2, 8)[0], cryptomatte_id(cryptomatte_hash("material 0")));
    EXPECT_EQ(r.at(Aov::kCryptoObject, 15, 8)[1], 0.0f);
  }
}

// A wall that only some samples meet: of an even number of them, the halves' mean is the pixel's.
TEST(Layers, DenoisersAreToldOfEvenSamplesByThemselves)
{
  Scene scene = empty_scene();
  add_object(scene, quad_mesh({-10, -10, 0}, {10.05f, 0, 0}, {0, 20, 0}), diffuse_material({0.5f, 0.5f, 0.5f}));
  scene.cameras[0].camera.projection = Projection::kOrthographic;
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 1;
  scene.environment.color = {2, 2, 2};
  const auto first = render_scene(scene, render_options(scene, kSize, 1));
  const auto both = render_scene(scene, render_options(scene, kSize, 2));
  int differing = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const float even = *first.at(Aov::kDenoisingAlbedo, x, y);
      EXPECT_EQ(*first.at(Aov::kDenoisingHalf, x, y), even) << "the first sample is even-numbered";
      EXPECT_EQ(*both.at(Aov::kDenoisingHalf, x, y), even) << "and the second is odd-numbered";
      differing += *both.at(Aov::kDenoisingAlbedo, x, y) != even ? 1 : 0;
    }
  }
  EXPECT_GT(differing, 0) << "of the pixels along the wall's edge, which both samples see otherwise";
}

// What shines is its own albedo: the noise before it is none of its colour.
TEST(Layers, DenoisersAreToldOfWhatShines)
{
  Material glow = diffuse_material({0.5f, 0.5f, 0.5f});
  glow.emission = {3, 2, 1};
  Scene scene = half_wall(glow);
  scene.environment.color = {0.25f, 0.5f, 0.75f};
  const Rendered r = render_scene(scene, render_options(scene, kSize, 4));
  EXPECT_NEAR(r.at(Aov::kDenoisingAlbedo, 2, 8)[1], 2.5f, 1e-5f);
  EXPECT_NEAR(r.at(Aov::kDenoisingAlbedo, 12, 8)[1], 0.5f, 1e-5f);
}

// A diffuse wall below a sky: hidden from diffuse rays it is black, hidden from glossy ones it is not.
TEST(Environment, CanBeHiddenFromKindsOfRays)
{
  for (const PathEvent event : {PathEvent::kDiffuse, PathEvent::kGlossy}) {
    Scene scene = half_wall(diffuse_material({0.5f, 0.5f, 0.5f}));
    scene.environment.color = {1, 1, 1};
    scene.environment.hidden_from = 1u << static_cast<std::uint32_t>(event);
    const Rendered r = render_scene(scene, render_options(scene, kSize, 64));
    EXPECT_NEAR(mean_over_wall(r, Aov::kBeauty), event == PathEvent::kDiffuse ? 0.0 : 0.5, 1e-3);
    EXPECT_EQ(r.radiance(12, 8).x, 1.0f) << "the camera sees it";
  }
}

TEST(Film, ExposureMultipliesLightAndNothingElse)
{
  Scene scene = half_wall(diffuse_material({0.5f, 0.5f, 0.5f}));
  scene.environment.color = {1, 1, 1};
  const Rendered one = render_scene(scene, render_options(scene, kSize, 8));
  scene.render.film_exposure = 4;
  const Rendered four = render_scene(scene, render_options(scene, kSize, 8));
  const auto ratio = [&](Aov aov) { return mean_over_wall(four, aov) / mean_over_wall(one, aov); };
  for (const Aov aov : {Aov::kBeauty, Aov::kDirect, Aov::kHalf}) EXPECT_NEAR(ratio(aov), 4.0, 1e-5);
  EXPECT_NEAR(ratio(Aov::kAlbedo), 1.0, 1e-6);
  EXPECT_NEAR(ratio(Aov::kDepth), 1.0, 1e-6);
  EXPECT_EQ(four.at(Aov::kBeauty, 2, 8)[3], 1.0f);
}

// What lay inside a large point light was black, and rays that started there met nothing else.
TEST(PointLights, AWallInsideTheBallIsLitAndSeesTheWorld)
{
  for (const bool faces_viewer : {false, true}) {
    Scene scene = half_wall(diffuse_material({0.5f, 0.5f, 0.5f}));
    scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 0.01f;
    scene.cameras[0].camera.world_from_camera.p.x = -2;
    Light light;
    light.P = {-2, 0, 1};
    light.radius = 2;
    light.emission = {4, 4, 4};
    light.faces_viewer = faces_viewer;
    light.visible_to_camera = false;
    scene.lights.push_back(light);
    scene.environment.color = {1, 1, 1};
    const RenderOptions options = render_options(scene, kSize, 256);
    const Rendered r = render_scene(scene, options);
    // Irradiance I sin²α / r²: from all around, or from the cone of atan(r / d); and the world's π.
    const double sin_squared = faces_viewer ? 4.0 / 5.0 : 1.0;
    const double expected = 0.5 / 3.14159265358979 * (4 * sin_squared / 4 + 3.14159265358979);
    EXPECT_NEAR(mean_over_wall(r, Aov::kBeauty), expected, 0.005 * expected);
  }
}

}  // namespace
}  // namespace relief::test
