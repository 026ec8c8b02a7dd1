// From a scene to its lights.
#include "integrator/light_set.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numeric>

#include "kernel/shape/surface_hit.h"

namespace relief {
namespace {

/// A parallelogram of area 1 in the xy plane as two triangles, with the uv of a square; front towards +z.
/// @param skew  0: a square
Mesh square_mesh(float skew = 0.5f)
{
  Mesh mesh;
  mesh.P = {{0, 0, 0}, {1, 0, 0}, {1 + skew, 1, 0}, {skew, 1, 0}};
  mesh.uv[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// One emissive parallelogram a material, placed at x = 10 · index.
Scene squares(const std::vector<Material>& materials)
{
  Scene scene;
  scene.meshes.push_back(square_mesh());
  scene.materials = materials;
  for (std::size_t i = 0; i < materials.size(); ++i) {
    Instance instance;
    instance.material_index = static_cast<int>(i);
    instance.world_from_object.p = {10.0f * static_cast<float>(i), 0, 0};
    scene.instances.push_back(instance);
  }
  return scene;
}

Material emissive(Vec3f emission)
{
  Material material;
  material.emission = emission;
  return material;
}

float choice_probability(const LightSet& set, Vec3f P, std::uint32_t light)
{
  const LightsView view = set.view();
  LightEstimates root;
  light_tree_estimate(view.tree, view.tree.root, P, {}, root);
  return light_tree_pdf(view.tree, root, P, {}, light, view.light_trails[light], -1);
}

TEST(LightSet, TrianglesOfAnInstanceAreConsecutiveAfterTheScenesLights)
{
  Material displaced = emissive({1, 1, 1});
  displaced.displacement_index = 0;
  Material unlit = emissive({1, 1, 1});
  unlit.unlit = true;
  Scene scene = squares({emissive({1, 2, 3}), emissive({}), emissive({4, 5, 6}), displaced, unlit});
  scene.lights.resize(3);
  const LightSet set = light_set_make(scene, {});
  EXPECT_EQ(set.first_light_index, (std::vector<std::int32_t>{3, -1, 5, -1, -1}));
  ASSERT_EQ(set.lights.size(), 7u);
  for (std::size_t i = 3; i < 7; ++i) {
    EXPECT_EQ(set.lights[i].kind, LightKind::kTriangle);
    EXPECT_EQ(set.lights[i].instance_index, i < 5 ? 0 : 2);
    EXPECT_EQ(set.lights[i].triangle_index, static_cast<int>(i + 1) % 2);
    EXPECT_EQ(set.lights[i].emission, i < 5 ? (Vec3f{1, 2, 3}) : (Vec3f{4, 5, 6}));
    EXPECT_FLOAT_EQ(set.lights[i].area, 0.5f);
  }
}

/// The lights of one mesh that emits, turned, scaled and moved.
LightSet lights_of(const Mesh& mesh, const Material& material = emissive({1, 2, 3}))
{
  Scene scene = squares({material});
  scene.meshes[0] = mesh;
  Affine3& m = scene.instances[0].world_from_object;
  m.x = {0.6f * 3, 0.8f * 3, 0};
  m.y = {0, 0, 3};
  m.z = {0.8f * 3, -0.6f * 3, 0};
  m.p = {7, -5, 2};
  return light_set_make(scene, {});
}

TEST(LightSet, TwoTrianglesOfARectangleAreOneLight)
{
  for (const std::array<TriangleIndices, 2>& triangles :
       {std::array<TriangleIndices, 2>{{{0, 1, 2}, {0, 2, 3}}}, {{{1, 2, 3}, {3, 0, 1}}}, {{{3, 1, 2}, {1, 3, 0}}}}) {
    Mesh mesh = square_mesh(0);
    for (Vec3f& P : mesh.P) P.x *= 2;
    mesh.triangles.assign(triangles.begin(), triangles.end());
    const LightSet set = lights_of(mesh);
    ASSERT_EQ(set.lights.size(), 2u);
    const Light& light = set.lights[0];
    ASSERT_EQ(light.kind, LightKind::kRectangle);
    EXPECT_FLOAT_EQ(light.area, 18);
    EXPECT_NEAR(length(cross(2 * light.edge_u, 2 * light.edge_v)), 18, 1e-4);
    EXPECT_NEAR(length(light.P - (Vec3f{7, -5, 2} + Vec3f{1.8f, 2.4f, 1.5f})), 0, 1e-5);
    EXPECT_EQ(light.instance_index, 0);
    EXPECT_TRUE(is_zero(set.lights[1].emission));
    EXPECT_TRUE(set.area_lights.empty());
    // Seen from its front, both triangles stand for the whole.
    const LightsView view = set.view();
    const Vec3f P = light.P + light.axis * 2;
    const Vec3f wi = normalize(light.P + 0.3f * light.edge_u - P);
    const float pdf = lights_pdf(view, P, {}, {0}, wi, 2.1f);
    EXPECT_GT(pdf, 0.0f);
    EXPECT_EQ(lights_pdf(view, P, {}, {1}, wi, 2.1f), pdf);
    EXPECT_EQ(lights_sample(view, P, {}, {0.4, 0.9f}).ref.light_index, 0);
  }
}

TEST(LightSet, TrianglesThatAreNoEvenRectangleStayApart)
{
  const auto expect_apart = [](const LightSet& set, const char* what) {
    for (const Light& light : set.lights) {
      EXPECT_EQ(light.kind, LightKind::kTriangle) << what;
      EXPECT_EQ(light.whole_index, -1) << what;
    }
  };
  expect_apart(lights_of(square_mesh(0.01f)), "skewed");
  Mesh folded = square_mesh(0);
  folded.P[3] = {1e-3f, 1, 0.1f};
  expect_apart(lights_of(folded), "folded");
  Mesh facing_away = square_mesh(0);
  facing_away.triangles[1] = {0, 3, 2};
  expect_apart(lights_of(facing_away), "one triangle faces away");
  Mesh kite = square_mesh(0);
  kite.P[3] = {0.5f, 0.5f, 0};
  kite.triangles = {{0, 1, 2}, {1, 0, 3}};
  expect_apart(lights_of(kite), "other triangle within the first");
  Mesh degenerate = square_mesh(0);
  degenerate.triangles = {{0, 0, 1}, {0, 1, 2}};
  expect_apart(lights_of(degenerate), "no area");
  Material blended = emissive({1, 1, 1});
  blended.alpha_mode = AlphaMode::kBlend;
  expect_apart(lights_of(square_mesh(0), blended), "transparent");
}

TEST(LightSet, FrontIsTheSurfacesFrontUnderEveryTransform)
{
  std::uint64_t state = 1;
  const auto next = [&state] {
    state = hash_mix(state + 0x9e3779b97f4a7c15u);
    return static_cast<float>(state >> 40) * 0x1p-23f - 1.0f;
  };
  int mirrored = 0;
  for (int k = 0; k < 200; ++k) {
    Scene scene = squares({emissive({1, 1, 1})});
    Affine3& m = scene.instances[0].world_from_object;
    m = {{next(), next(), next()}, {next(), next(), next()}, {next(), next(), next()}, {next(), next(), next()}};
    InstanceView instance;
    instance.world_from_object = m;
    instance.object_from_world = inverse(m);
    if (determinant(m) < 0.0f) {
      instance.flags |= kMirrored;
      ++mirrored;
    }
    const LightSet set = light_set_make(scene, {});
    for (std::uint32_t triangle = 0; triangle < 2; ++triangle) {
      const Vec2f b{0.3f, 0.5f};
      const SurfaceHit hit = surface_hit_make(scene.meshes[0].view(), instance, triangle, b.x, b.y);
      const Light& light = set.lights[triangle];
      ASSERT_LT(length(hit.Ng - light.axis), 1e-3f) << k;
      ASSERT_LT(length(hit.P - (light.P + light.edge_u * b.x + light.edge_v * b.y)), 1e-5f) << k;
    }
  }
  EXPECT_GT(mirrored, 50);
}

TEST(LightSet, DoubleSidedMaterialsEmitFromBothSides)
{
  Material both = emissive({1, 1, 1});
  both.double_sided = true;
  const LightSet set = light_set_make(squares({emissive({1, 1, 1}), both}), {});
  EXPECT_FALSE(set.lights[0].two_sided);
  EXPECT_TRUE(set.lights[2].two_sided);
  EXPECT_EQ(lights_sample(set.view(), {0.5f, 0.2f, -1}, {}, {0.0, 0.5f}).ref.light_index / 2, 1);
}

TEST(LightSet, TexturesWeighTheChoiceButNotTheEmission)
{
  // Left half black, right half white: u < ½ is dark. One mesh has both halves, so its first triangle (below the diagonal,
  // to the right) is the brighter one.
  const int size = 64;
  std::vector<unsigned char> texels(size * size);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) texels[static_cast<std::size_t>(y * size + x)] = x < size / 2 ? 0 : 255;
  }
  TextureView texture;
  texture.levels[0] = texels.data();
  texture.width = texture.height = size;
  texture.num_levels = 1;
  texture.num_channels = 1;

  Material material = emissive({2, 2, 2});
  material.emission_texture.texture_index = 0;
  Material dark = material;  // sees the left quarter of the map only
  dark.emission_texture.m00 = 0.25f;
  dark.emission_texture.m02 = 0.1f;
  const std::vector<TextureView> textures{texture};
  const LightSet set = light_set_make(squares({material, dark, emissive({2, 2, 2})}), textures);
  for (const Light& light : set.lights) EXPECT_EQ(light.emission, (Vec3f{2, 2, 2}));
  const Vec3f P{0.5f, 0.5f, 1000};
  EXPECT_EQ(choice_probability(set, P, 2), 0.0f);
  EXPECT_EQ(choice_probability(set, P, 3), 0.0f);
  // Means over the triangles: ¾ and ¼; ten lattice points know them to a tenth.
  EXPECT_NEAR(choice_probability(set, P, 0) / choice_probability(set, P, 4), 0.75f, 0.1f);
  EXPECT_NEAR(choice_probability(set, P, 1) / choice_probability(set, P, 4), 0.25f, 0.1f);
}

TEST(LightSet, DegenerateTrianglesKeepTheirPlaceAndAreNeverChosen)
{
  Scene scene = squares({emissive({1, 1, 1})});
  scene.meshes[0].triangles = {{0, 0, 1}, {0, 1, 2}, {2, 2, 2}};
  const LightSet set = light_set_make(scene, {});
  ASSERT_EQ(set.lights.size(), 3u);
  EXPECT_EQ(choice_probability(set, {0.5f, 0.5f, 1}, 0), 0.0f);
  EXPECT_EQ(choice_probability(set, {0.5f, 0.5f, 1}, 1), 1.0f);
  EXPECT_EQ(choice_probability(set, {0.5f, 0.5f, 1}, 2), 0.0f);
  EXPECT_EQ(lights_pdf(set.view(), {0.5f, 0.5f, 1}, {}, {2}, {0, 0, -1}, 1), 0.0f);
}

/// An 8-bit map of one channel; 1000 / 255 a step.
struct GreyMap {
  GreyMap(int width, int height, unsigned char grey) : texels(static_cast<std::size_t>(width * height), grey)
  {
    view.levels[0] = texels.data();
    view.width = width;
    view.height = height;
    view.num_levels = 1;
    view.num_channels = 1;
    scene.environment.color = {1000, 1000, 1000};
    scene.environment.texture_index = 0;
  }
  LightSet lights(EnvironmentDensity density) const { return light_set_make(scene, std::vector{view}, density); }

  std::vector<unsigned char> texels;
  TextureView view;
  Scene scene;
};

/// 256 × 128 floats would be half floats; one bright texel of 255 among grey 1s in 8 bits, at the equator.
GreyMap small_sun()
{
  GreyMap map(256, 128, 1);
  map.texels[64 * 256 + 100] = 255;
  map.view.levels[0] = map.texels.data();
  return map;
}

constexpr double kStep = 1000.0 / 255;                                                   // radiance
constexpr double kSunTexel = 2 * std::numbers::pi / 256 * std::numbers::pi / 128 * 254;  // sr × steps

TEST(LightSet, EnvironmentIrradianceFindsASmallSunInTheMap)
{
  const GreyMap map = small_sun();
  const LightSet set = map.lights(EnvironmentDensity::kRadiance);
  const double expected = 0.25 * kStep * (4 * std::numbers::pi + kSunTexel);
  EXPECT_NEAR(static_cast<double>(set.environment_irradiance.mean), expected, 0.01 * expected);
  EXPECT_TRUE(set.any());
}

TEST(LightSet, ExcessOfASmallSunIsTheSunAlone)
{
  const GreyMap map = small_sun();
  const LightSet set = map.lights(EnvironmentDensity::kExcess);
  const double expected = 0.25 * kStep * kSunTexel;
  // The mean that is taken off is the grey and a 1/256 of it for the sun.
  EXPECT_NEAR(static_cast<double>(set.environment_irradiance.mean), expected, 0.02 * expected);
}

TEST(LightSet, EvenMapsHaveNoExcess)
{
  const GreyMap map(64, 32, 200);
  EXPECT_TRUE(map.lights(EnvironmentDensity::kRadiance).any());
  EXPECT_FALSE(map.lights(EnvironmentDensity::kExcess).any());
}

TEST(LightSet, EnvironmentIrradianceFollowsTheNormal)
{
  // Bright above, dim below, brighter towards u = 0.4: smooth enough for two orders, which are then good to 2 % of the
  // greatest. Truth by midpoints over the directions.
  GreyMap map(64, 32, 0);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 64; ++x) {
      const double value = (y < 16 ? 120 : 20) + 60 * std::cos(2 * std::numbers::pi * ((x + 0.5) / 64 - 0.4));
      map.texels[static_cast<std::size_t>(y * 64 + x)] = static_cast<unsigned char>(std::max(value, 0.0));
    }
  }
  const LightSet set = map.lights(EnvironmentDensity::kRadiance);
  const EnvironmentView environment = set.environment.view();
  const auto truth = [&](Vec3f N) {
    double sum = 0;
    const int rows = 200;
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < 2 * rows; ++j) {
        const double z = -1 + 2 * (i + 0.5) / rows, phi = std::numbers::pi * (j + 0.5) / rows;
        const double r = std::sqrt(1 - z * z);
        const Vec3f wi{static_cast<float>(r * std::cos(phi)), static_cast<float>(z),
                       static_cast<float>(r * std::sin(phi))};
        sum += static_cast<double>(light_scalar(environment_eval(environment, wi)) * std::max(dot(wi, N), 0.0f));
      }
    }
    return sum * 4 * std::numbers::pi / (2.0 * rows * rows);
  };
  const double greatest = truth({0, 1, 0});
  for (const Vec3f N : {Vec3f{0, 1, 0}, Vec3f{0, -1, 0}, Vec3f{1, 0, 0}, Vec3f{0, 0, 1}, normalize(Vec3f{-1, 2, 3}),
                        normalize(Vec3f{3, -1, -2})}) {
    EXPECT_NEAR(static_cast<double>(environment_irradiance_eval(set.environment_irradiance, N)), truth(N),
                0.02 * greatest);
  }
}

TEST(LightSet, EnvironmentIrradianceIsNeverNothingInAnyDirection)
{
  // A lone sun, for which the expansion has negative lobes.
  GreyMap map(256, 128, 0);
  map.texels[64 * 256 + 100] = 255;
  const LightSet set = map.lights(EnvironmentDensity::kExcess);
  for (int i = 0; i <= 100; ++i) {
    const float angle = 0.01f * static_cast<float>(i) * kPi;
    const Vec3f N{std::sin(angle), std::cos(angle), 0};
    EXPECT_GE(environment_irradiance_eval(set.environment_irradiance, N), 0.05f * set.environment_irradiance.mean);
  }
  EXPECT_GT(set.environment_irradiance.mean, 0.0f);
}

TEST(LightSet, WhatFewLightsSendIsLookedForMoreOften)
{
  Scene scene;
  scene.lights.resize(2);
  for (Light& light : scene.lights) light.kind = LightKind::kPoint;
  scene.lights[0].emission = {0, 10, 10};
  scene.lights[1].emission = {1, 0, 0};
  const auto red_share = [&scene] { return choice_probability(light_set_make(scene, {}), {0, 0, -5}, 1); };
  // By weights 1 / (share of the mean + 1/20): 1 / (1/7 + .05) of red, 1 / (10/7 + .05) of the others.
  const double red = 1 / (1.0 / 7 + 0.05), others = 1 / (10.0 / 7 + 0.05);
  EXPECT_NEAR(static_cast<double>(red_share()), red / (red + 2 * 10 * others), 0.01);
  // Of grey light channels count alike.
  scene.lights[0].emission = {7, 7, 7};
  scene.lights[1].emission = {1, 1, 1};
  EXPECT_EQ(light_set_make(scene, {}).channels, (Vec3f{1, 1, 1}));
  EXPECT_NEAR(red_share(), 0.125f, 0.01f);
}

TEST(LightSet, ConstantEnvironmentsIrradianceIsPiTimesItsRadiance)
{
  Scene scene;
  scene.environment.color = {1, 2, 3};
  const LightSet set = light_set_make(scene, {});
  for (const Vec3f N : {Vec3f{}, Vec3f{0, 0, 1}, normalize(Vec3f{1, -2, 3})}) {
    EXPECT_FLOAT_EQ(environment_irradiance_eval(set.environment_irradiance, N),
                    light_scalar(scene.environment.color, set.channels) * kPi);
  }
  scene.environment.color = {};
  EXPECT_FALSE(light_set_make(scene, {}).any());
}

TEST(LightSet, SunsThatCountLeaveAConstantEnvironmentToTheBsdf)
{
  Scene scene;
  scene.environment.color = {1, 1, 1};
  scene.lights.resize(1);
  scene.lights[0].kind = LightKind::kSun;
  const auto environment_pdf_under = [&scene](float irradiance, EnvironmentDensity density) {
    scene.lights[0].emission = {irradiance, irradiance, irradiance};
    const LightSet set = light_set_make(scene, {}, density);
    return lights_environment_pdf(set.view(), {}, Vec3f{0, 0, 1}, {0, 0, 1});
  };
  EXPECT_EQ(environment_pdf_under(1.0f, EnvironmentDensity::kExcess), 0.0f);
  EXPECT_GT(environment_pdf_under(0.1f, EnvironmentDensity::kExcess), 0.0f);
  EXPECT_GT(environment_pdf_under(1.0f, EnvironmentDensity::kRadiance), 0.0f);
}

TEST(LightSet, AConstantEnvironmentIsLeftToTheBsdfWhereShadowRaysPassWhatOthersDoNot)
{
  Scene scene;
  scene.environment.color = {1, 1, 1};
  scene.materials.resize(1);
  const auto is_asked = [&scene](bool depends_on_ray, int transparency_index) {
    scene.materials[0].depends_on_ray = depends_on_ray;
    scene.materials[0].transparency_index = transparency_index;
    return light_set_make(scene, {}).any();
  };
  EXPECT_TRUE(is_asked(false, 0));
  EXPECT_TRUE(is_asked(true, -1));
  EXPECT_FALSE(is_asked(true, 0));
}

TEST(LightSet, LampsThatCountLeaveAConstantEnvironmentToTheBsdfNearThem)
{
  Scene scene;
  scene.environment.color = {1, 1, 1};
  scene.lights.resize(1);
  scene.lights[0].kind = LightKind::kPoint;
  scene.lights[0].emission = {10, 10, 10};
  const LightSet set = light_set_make(scene, {});
  const auto pdf_below = [&set](float distance) {
    return lights_environment_pdf(set.view(), {0, 0, -distance}, Vec3f{0, 0, 1}, {0, 0, 1});
  };
  EXPECT_EQ(pdf_below(2), 0.0f);
  EXPECT_GT(pdf_below(50), 0.0f);
}

}  // namespace
}  // namespace relief
