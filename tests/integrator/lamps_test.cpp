// Lamps that are not quite as others: that hold the camera, are seen by some rays alone, or are far away; and media that the
// camera stands in. Each has a closed form.
#include "tests/support/medium_scenes.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

constexpr int kRuns = 16;
constexpr double kQuantile = 5.2;  // of Student's t at 1e-4, as in analytic_scenes_test.cpp

Light flat_light(LightKind kind, Vec3f P, float half, float radiance)
{
  Light light;
  light.kind = kind;
  light.P = P;
  light.edge_u = {half, 0, 0};
  light.edge_v = {0, half, 0};
  light.axis = {0, 0, -1};
  light.area = sqr(half) * (kind == LightKind::kDisk ? kPi : 4.0f);
  light.emission = splat3(radiance);
  return light;
}

Light ball_light(Vec3f P, float radius, float radiance)
{
  Light light;
  light.P = P;
  light.radius = radius;
  light.emission = splat3(radiance * kPi * sqr(radius));
  return light;
}

/// A world of radiance 1 around the camera of empty_scene.
Scene white_world()
{
  Scene scene = empty_scene();
  scene.environment.color = {1, 1, 1};
  return scene;
}

void expect_white(const Scene& scene)
{
  const Rendered rendered = render_scene(scene, render_options(scene, 8, 4));
  EXPECT_EQ(rendered.stats.counters.endless_paths, 0u);
  EXPECT_NEAR(rendered.mean(), 1.0, 1e-6);
}

/// Rays meet it at the distance 0, and met it there for ever.
TEST(LightThatHoldsTheCamera, LetsRaysPass)
{
  for (const LightKind kind : {LightKind::kRectangle, LightKind::kDisk}) {
    for (const float tilt : {0.0f, 0.5f}) {
      Scene scene = white_world();
      Light light = flat_light(kind, scene.cameras[0].camera.world_from_camera.p, 1, 7);
      light.edge_v = {0, std::cos(tilt), std::sin(tilt)};
      light.axis = normalize(cross(light.edge_v, light.edge_u));
      scene.lights.push_back(light);
      expect_white(scene);
    }
  }
}

TEST(LightThatHoldsTheCamera, LetsRaysPassBesideItsCentre)
{
  for (const float shift : {1e-40f, 1e-30f, 1e-8f, 1e-3f}) {
    for (const float sign : {-1.0f, 1.0f}) {
      Scene scene = white_world();
      Light light = flat_light(LightKind::kRectangle, scene.cameras[0].camera.world_from_camera.p, 1, 7);
      light.P.z += sign * shift;
      light.P.x += 0.3f;
      // Its light goes where rays go.
      scene.lights.push_back(light);
      scene.cameras[0].camera.world_from_camera.p.z = 4;
      expect_white(scene);
    }
  }
}

TEST(BallThatHoldsTheCamera, ShinesAroundItOnce)
{
  Scene scene = white_world();
  scene.lights.push_back(ball_light(scene.cameras[0].camera.world_from_camera.p, 0.5f, 3));
  const Rendered rendered = render_scene(scene, render_options(scene, 8, 4));
  EXPECT_NEAR(rendered.mean(), 4.0, 1e-5);
  EXPECT_EQ(rendered.stats.counters.endless_paths, 0u);
}

/// Such a quad was met again until the path had passed as many surfaces as it may, and was black.
TEST(TransparentSurfaceThatHoldsTheCamera, LetsRaysPass)
{
  Scene scene = white_world();
  Material clear = diffuse_material({1, 1, 1});
  clear.base_alpha = 0;
  clear.alpha_mode = AlphaMode::kBlend;
  add_object(scene, quad_mesh({-1, -2, 4}, {3, 0, 0}, {0, 3, 0}), clear);
  expect_white(scene);
}

/// A floor far from the origin, seen from above through a narrow window.
Scene far_floor(float far)
{
  Scene scene = empty_scene();
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 0.01f;
  scene.cameras[0].camera.world_from_camera.p = {far, far, 4};
  add_object(scene, quad_mesh({far - 8, far - 4, 0}, {12, 0, 0}, {0, 8, 0}), diffuse_material({0.6f, 0.6f, 0.6f}));
  scene.render.max_bounces = scene.render.diffuse_bounces = 0;
  return scene;
}

Light sun_disk(float half_angle, Vec3f axis, float irradiance)
{
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = normalize(axis);
  sun.emission = splat3(irradiance);
  sun.cone = 2 * sqr(std::sin(half_angle / 2));
  sun.visible_to_camera = false;
  return sun;
}

/// As a disk far away it was 3 % too dark at 10 km, and 67 % at 500 km.
TEST(SunDisk, ShinesAlikeHoweverFarFromTheOrigin)
{
  for (const float far : {0.0f, 1e3f, 1e4f, 1e5f, 1e6f}) {
    for (const LightTechnique technique : {LightTechnique::kMis, LightTechnique::kLightSampling}) {
      Scene scene = far_floor(far);
      scene.lights.push_back(sun_disk(0.025f, {0.6f, 0, -0.8f}, 3));
      RenderOptions options = render_options(scene, 4, 16);
      options.light_technique = technique;
      EXPECT_NEAR(render_scene(scene, options).mean(), 3 * 0.8 * 0.6 / static_cast<double>(kPi), 2e-3) << far;
    }
  }
}

/// A wide one, part of it below the horizon: all techniques agree, and with the integral over the cone.
TEST(SunDisk, IsFoundByEveryTechnique)
{
  constexpr double kHalf = 0.7, kTilt = 1.2;
  // ∫ max(0, cos) over the cone by the midpoint rule, over its projected solid angle.
  double sum = 0;
  constexpr int kSteps = 600;
  for (int i = 0; i < kSteps; ++i) {
    const double theta = (i + 0.5) * kHalf / kSteps;
    for (int k = 0; k < kSteps; ++k) {
      const double phi = (k + 0.5) * 2 * static_cast<double>(kPi) / kSteps;
      sum += std::max(0.0, std::cos(theta) * std::cos(kTilt) + std::sin(theta) * std::cos(phi) * std::sin(kTilt)) *
             std::sin(theta);
    }
  }
  const double cosine = sum * kHalf / kSteps * 2 / kSteps / (std::sin(kHalf) * std::sin(kHalf));
  for (const LightTechnique technique :
       {LightTechnique::kMis, LightTechnique::kLightSampling, LightTechnique::kBsdfSampling}) {
    Scene scene = far_floor(0);
    scene.lights.push_back(sun_disk(static_cast<float>(kHalf),
                                    {static_cast<float>(std::sin(kTilt)), 0, -static_cast<float>(std::cos(kTilt))}, 3));
    RenderOptions options = render_options(scene, 8, 64);
    options.light_technique = technique;
    const Estimate estimate = estimate_mean(scene, options, kRuns);
    EXPECT_NEAR(estimate.mean, 3 * cosine * 0.6 / static_cast<double>(kPi), kQuantile * estimate.standard_error + 1e-5);
  }
}

/// Two suns, of which one takes away more than the other gives: of red, of green, and of no blue.
TEST(NegativeLight, TakesAwayWhatAsMuchLightGives)
{
  for (const LightTechnique technique :
       {LightTechnique::kMis, LightTechnique::kLightSampling, LightTechnique::kBsdfSampling}) {
    Scene scene = far_floor(0);
    scene.lights.push_back(sun_disk(0.7f, {0, 0, -1}, 1));
    scene.lights.push_back(sun_disk(0.7f, {0, 0, -1}, 1));
    scene.lights[0].emission = {3, -3, 0};
    scene.lights[1].emission = {-4, 2, 0};
    RenderOptions options = render_options(scene, 8, 64);
    options.light_technique = technique;
    for (const int channel : {0, 1, 2}) {
      const Estimate estimate = estimate_mean(scene, options, kRuns, channel);
      const double net = channel == 2 ? 0 : -1;
      EXPECT_NEAR(estimate.mean, net * 0.6 / static_cast<double>(kPi), kQuantile * estimate.standard_error + 1e-5);
    }
  }
}

TEST(SunDisk, IsSeenByTheCameraIfItIsToBe)
{
  Scene scene = empty_scene();
  scene.lights.push_back(sun_disk(1.0f, {0, 0, 1}, 3));
  EXPECT_EQ(render_scene(scene, render_options(scene, 4, 1)).mean(), 0.0);
  scene.lights.back().visible_to_camera = true;
  const double expected = 3 / (static_cast<double>(kPi) * std::sin(1.0) * std::sin(1.0));
  EXPECT_NEAR(render_scene(scene, render_options(scene, 4, 1)).mean(), expected, 1e-5);
}

/// Glass of the index of air.
Material clear()
{
  Material m = diffuse_material({1, 1, 1});
  m.roughness = 0;
  m.transmission = 1;
  m.ior = 1;
  m.thickness = 1;
  return m;
}

/// The same, which absorbs.
Material absorbing(Scene& scene, float sigma)
{
  Material m = clear();
  set_absorption(scene, m, splat3(sigma));
  return m;
}

std::uint8_t hidden(std::initializer_list<PathEvent> events)
{
  unsigned bits = 0;
  for (const PathEvent event : events) bits |= 1u << static_cast<unsigned>(event);
  return static_cast<std::uint8_t>(bits);
}

/// A light that only some lobes see: what they make of it is what a surface without the others does.
TEST(HiddenLight, IsForTheOtherLobesAlone)
{
  Material plastic = diffuse_material({0.6f, 0.6f, 0.6f});
  plastic.specular = 1;
  plastic.roughness = 0.3f;
  struct Case {
    Material material;
    std::uint8_t hidden_from;
    bool is_dark;
  };
  const Case cases[] = {
      {diffuse_material({0.6f, 0.6f, 0.6f}), hidden({PathEvent::kDiffuse}), true},
      {diffuse_material({0.6f, 0.6f, 0.6f}), hidden({PathEvent::kGlossy, PathEvent::kTransmission}), false},
      {plastic, hidden({PathEvent::kTransmission}), false},
      {plastic, hidden({PathEvent::kDiffuse, PathEvent::kGlossy}), true},
  };
  for (const LightKind kind : {LightKind::kRectangle, LightKind::kPoint, LightKind::kSun}) {
    for (const Case& c : cases) {
      Scene scene = far_floor(0);
      scene.materials[0] = c.material;
      scene.lights.push_back(kind == LightKind::kRectangle ? flat_light(kind, {0.5f, 0, 3}, 1, 5)
                             : kind == LightKind::kPoint   ? ball_light({0.5f, 0, 3}, 0.6f, 5)
                                                           : sun_disk(0.4f, {0.3f, 0, -1}, 5));
      scene.lights[0].visible_to_camera = false;
      const Estimate seen = estimate_mean(scene, render_options(scene, 8, 64), kRuns);
      scene.lights[0].hidden_from = c.hidden_from;
      const Estimate some = estimate_mean(scene, render_options(scene, 8, 64), kRuns);
      if (c.is_dark) {
        EXPECT_EQ(some.mean, 0.0);
      } else {
        EXPECT_NEAR(some.mean, seen.mean, kQuantile * (some.standard_error + seen.standard_error));
      }
    }
  }
}

/// What diffuse lobes and what the others see of a light are the whole, whichever way it is found.
TEST(HiddenLight, PartsSumToTheWhole)
{
  Material plastic = diffuse_material({0.6f, 0.6f, 0.6f});
  plastic.specular = 1;
  plastic.roughness = 0.4f;
  for (const LightTechnique technique :
       {LightTechnique::kMis, LightTechnique::kLightSampling, LightTechnique::kBsdfSampling}) {
    Scene scene = far_floor(0);
    scene.materials[0] = plastic;
    scene.lights.push_back(flat_light(LightKind::kRectangle, {0.2f, 0, 3}, 1, 5));
    RenderOptions options = render_options(scene, 8, 64);
    options.light_technique = technique;
    const Estimate whole = estimate_mean(scene, options, kRuns);
    scene.lights[0].hidden_from = hidden({PathEvent::kDiffuse});
    const Estimate glossy = estimate_mean(scene, options, kRuns);
    scene.lights[0].hidden_from = hidden({PathEvent::kGlossy});
    const Estimate diffuse = estimate_mean(scene, options, kRuns);
    EXPECT_GT(glossy.mean, 0.05 * whole.mean);
    EXPECT_GT(diffuse.mean, 0.05 * whole.mean);
    EXPECT_NEAR(glossy.mean + diffuse.mean, whole.mean,
                kQuantile * (whole.standard_error + glossy.standard_error + diffuse.standard_error));
  }
}

TEST(HiddenLight, IsNotMirrored)
{
  Material mirror = diffuse_material({1, 1, 1});
  mirror.metallic = 1;
  mirror.roughness = 0;
  Scene scene = far_floor(0);
  scene.materials[0] = mirror;
  scene.lights.push_back(flat_light(LightKind::kRectangle, {0, 0, 6}, 3, 5));
  scene.lights[0].visible_to_camera = false;
  scene.render.max_bounces = scene.render.glossy_bounces = 1;
  EXPECT_NEAR(render_scene(scene, render_options(scene, 4, 16)).mean(), 5.0, 1e-3);
  scene.lights[0].hidden_from = hidden({PathEvent::kGlossy});
  EXPECT_EQ(render_scene(scene, render_options(scene, 4, 16)).mean(), 0.0);
}

/// Lamps of all kinds that have a size, above the floor; the camera does not see them.
std::vector<Light> sized_lights()
{
  std::vector<Light> lights{flat_light(LightKind::kRectangle, {0.5f, 0, 3}, 1, 5), ball_light({0.5f, 0, 3}, 0.6f, 5),
                            sun_disk(0.4f, {0.3f, 0, -1}, 5)};
  for (Light& light : lights) light.visible_to_camera = false;
  return lights;
}

/// One that is only asked for lights as much as one that is met, too.
TEST(LightWithoutMultipleImportance, LightsSurfacesAndMediaAsMuch)
{
  Material plastic = diffuse_material({0.6f, 0.6f, 0.6f});
  plastic.specular = 1;
  plastic.roughness = 0.3f;
  for (const bool has_fog : {false, true}) {
    for (const Light& light : sized_lights()) {
      Scene scene = far_floor(0);
      scene.materials[0] = plastic;
      if (has_fog) {
        if (light.kind == LightKind::kSun) continue;
        scene.environment.medium = scattering(splat3(0.1f), 0.5f);
        scene.render.volume_bounces = scene.render.max_bounces = 1;
      }
      scene.lights.push_back(light);
      const Estimate met = estimate_mean(scene, render_options(scene, 8, 64), kRuns);
      scene.lights[0].multiple_importance = false;
      const Estimate asked = estimate_mean(scene, render_options(scene, 8, 64), kRuns);
      EXPECT_GT(asked.mean, 30 * asked.standard_error);
      EXPECT_NEAR(asked.mean, met.mean, kQuantile * (asked.standard_error + met.standard_error));
    }
  }
}

TEST(LightWithoutMultipleImportance, IsNotMirroredButMayBeSeen)
{
  Material mirror = diffuse_material({1, 1, 1});
  mirror.metallic = 1;
  mirror.roughness = 0;
  for (Light& light : sized_lights()) {
    Scene scene = far_floor(0);
    scene.materials[0] = mirror;
    // All of the sky that the floor mirrors.
    if (light.kind == LightKind::kRectangle) light = flat_light(LightKind::kRectangle, {0, 0, 6}, 3, 5);
    if (light.kind == LightKind::kSun) light = sun_disk(3.0f, {0, 0, -1}, 5);
    light.visible_to_camera = false;
    scene.lights.push_back(light);
    scene.render.max_bounces = scene.render.glossy_bounces = 1;
    EXPECT_GT(render_scene(scene, render_options(scene, 8, 16)).mean(), 0.01);
    scene.lights[0].multiple_importance = false;
    EXPECT_EQ(render_scene(scene, render_options(scene, 8, 16)).mean(), 0.0);
  }
  Scene scene = empty_scene();
  scene.lights.push_back(sun_disk(1.0f, {0, 0, 1}, 3));
  scene.lights[0].multiple_importance = false;
  scene.lights[0].visible_to_camera = true;
  EXPECT_GT(render_scene(scene, render_options(scene, 4, 1)).mean(), 1.0);
}

std::uint32_t hidden_flags(std::initializer_list<PathEvent> events)
{
  return std::uint32_t{hidden(events)} << kHiddenFromShift;
}

/// What a surface makes of a white world behind a black wall that is in no light's way.
TEST(HiddenObject, IsPassedByRaysThatDoNotSeeIt)
{
  Material mirror = diffuse_material({1, 1, 1});
  mirror.metallic = 1;
  mirror.roughness = 0;
  struct Case {
    Material material;
    PathEvent event;
    float wall_z;
    double expected;
  };
  const Case cases[] = {{diffuse_material({0.6f, 0.6f, 0.6f}), PathEvent::kDiffuse, 6, 0.6},
                        {mirror, PathEvent::kGlossy, 6, 1.0},
                        {clear(), PathEvent::kTransmission, -2, 1.0}};
  for (const Case& c : cases) {
    Scene scene = far_floor(0);
    scene.environment.color = {1, 1, 1};
    scene.materials[0] = c.material;
    scene.render.max_bounces = scene.render.diffuse_bounces = scene.render.glossy_bounces =
        scene.render.transmission_bounces = 1;
    add_object(scene, quad_mesh({-40, -40, c.wall_z}, {80, 0, 0}, {0, 80, 0}), diffuse_material({0, 0, 0}));
    for (const PathEvent event : {PathEvent::kDiffuse, PathEvent::kGlossy, PathEvent::kTransmission}) {
      scene.instances[1].flags = hidden_flags({event});
      const double mean = render_scene(scene, render_options(scene, 8, 64)).mean();
      if (event == c.event) {
        EXPECT_NEAR(mean, c.expected, 1e-5);
      } else {
        EXPECT_LT(mean, 0.8 * c.expected);
      }
    }
  }
}

/// What diffuse lobes and what the others see of a mesh that emits are the whole, whichever way it is found.
TEST(HiddenObject, ShinesOnTheOtherLobesAlone)
{
  Material plastic = diffuse_material({0.6f, 0.6f, 0.6f});
  plastic.specular = 1;
  plastic.roughness = 0.4f;
  Material emitter = diffuse_material({0, 0, 0});
  emitter.emission = {5, 5, 5};
  for (const LightTechnique technique :
       {LightTechnique::kMis, LightTechnique::kLightSampling, LightTechnique::kBsdfSampling}) {
    Scene scene = far_floor(0);
    scene.materials[0] = plastic;
    // Its front looks down; the camera stands above it.
    add_object(scene, quad_mesh({-0.8f, -1, 3}, {0, 2, 0}, {2, 0, 0}), emitter);
    Instance& lamp = scene.instances[1];
    RenderOptions options = render_options(scene, 8, 64);
    options.light_technique = technique;
    lamp.flags = 0;
    const Estimate whole = estimate_mean(scene, options, kRuns);
    lamp.flags = hidden_flags({PathEvent::kDiffuse});
    const Estimate glossy = estimate_mean(scene, options, kRuns);
    lamp.flags = hidden_flags({PathEvent::kGlossy});
    const Estimate diffuse = estimate_mean(scene, options, kRuns);
    lamp.flags = hidden_flags({PathEvent::kGlossy, PathEvent::kDiffuse});
    EXPECT_EQ(estimate_mean(scene, options, 2).mean, 0.0);
    EXPECT_GT(glossy.mean, 0.05 * whole.mean);
    EXPECT_GT(diffuse.mean, 0.05 * whole.mean);
    EXPECT_NEAR(glossy.mean + diffuse.mean, whole.mean,
                kQuantile * (whole.standard_error + glossy.standard_error + diffuse.standard_error));
  }
}

/// Without a word the camera saw no absorption until it had left the ball and come back.
TEST(CameraInAMedium, SeesThroughItToItsSurface)
{
  for (const bool is_instanced : {false, true}) {
    Scene scene = white_world();
    add_object(scene, sphere_mesh(2, 128, 64, false), absorbing(scene, 0.4f), {.p = {0, 0, 4}});
    if (is_instanced) {
      Instance other = scene.instances[0];
      other.world_from_object.p = {0, 30, 0};
      scene.instances.push_back(other);
    }
    const Rendered rendered = render_scene(scene, render_options(scene, 8, 4));
    EXPECT_NEAR(rendered.mean(), std::exp(-0.8), 1e-3);
    EXPECT_TRUE(rendered.stats.warnings.empty());
  }
}

/// Media that stand in each other add up, whether the camera is in both of them, in one, or in none, as in Cycles.
TEST(CameraInAMedium, OfSeveralInEachOtherAndOfNoneOutside)
{
  Scene scene = white_world();
  add_object(scene, sphere_mesh(2, 128, 64, false), absorbing(scene, 0.4f), {.p = {0, 0, 4}});
  add_object(scene, sphere_mesh(1, 128, 64, false), absorbing(scene, 0.1f), {.p = {0, 0, 4}});
  const Rendered both = render_scene(scene, render_options(scene, 8, 4));
  EXPECT_NEAR(both.mean(), std::exp(-0.4 * 2 - 0.1), 1e-3);
  EXPECT_TRUE(both.stats.warnings.empty());

  // The camera is in the small one, which reaches into the other.
  scene.instances[0].world_from_object.p = {0, 0, 1.5f};
  scene.instances[1].world_from_object.p = {0, 0, 3.5f};
  const Camera wide = scene.cameras[0].camera;
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 1e-4f;
  const Rendered one = render_scene(scene, render_options(scene, 8, 4));
  EXPECT_NEAR(one.mean(), std::exp(-0.1 * 1.5 - 0.4 * 4), 1e-3);
  scene.cameras[0].camera = wide;

  for (Instance& instance : scene.instances) instance.world_from_object.p = {0, 0, 40};
  scene.instances[1].world_from_object.p.x = 10;
  const Rendered outside = render_scene(scene, render_options(scene, 8, 4));
  EXPECT_NEAR(outside.mean(), 1.0, 1e-6);
  EXPECT_TRUE(outside.stats.warnings.empty());
}

/// What an orthographic camera's rays start in differs from pixel to pixel.
TEST(CameraInAMedium, IsFoundForEachRay)
{
  Scene scene = white_world();
  Camera& camera = scene.cameras[0].camera;
  camera.projection = Projection::kOrthographic;
  camera.half_width = camera.half_height = 2;
  Mesh box;
  for (const float z : {-1.0f, 1.0f}) {
    for (const float y : {-3.0f, 3.0f}) {
      for (const float x : {-3.0f, 0.0f}) box.P.push_back({x, y, z});
    }
  }
  box.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                   {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  add_object(scene, box, absorbing(scene, 0.7f), {.p = {0, 0, 4}});
  const Rendered rendered = render_scene(scene, render_options(scene, 8, 4));
  EXPECT_NEAR(rendered.mean(), 0.5 * (1 + std::exp(-0.7)), 1e-3);
}

/// A lamp in the medium, found by asking for it and by meeting it.
TEST(LampInAMedium, IsDimmedWhicheverWayItIsFound)
{
  double means[3] = {};
  int i = 0;
  double error = 0;
  for (const LightTechnique technique :
       {LightTechnique::kMis, LightTechnique::kLightSampling, LightTechnique::kBsdfSampling}) {
    Scene scene = far_floor(0);
    add_object(scene, sphere_mesh(20, 64, 32, false), absorbing(scene, 0.3f));
    scene.lights.push_back(flat_light(LightKind::kRectangle, {0.2f, 0, 3}, 1, 5));
    RenderOptions options = render_options(scene, 8, 64);
    options.light_technique = technique;
    const Estimate estimate = estimate_mean(scene, options, kRuns);
    means[i++] = estimate.mean;
    error += estimate.standard_error;
  }
  EXPECT_GT(means[0], 0.01);
  EXPECT_NEAR(means[0], means[1], kQuantile * error);
  EXPECT_NEAR(means[0], means[2], kQuantile * error);
}

}  // namespace
}  // namespace relief::test
