// Each rule by which photons and paths share the light, in a scene where leaving it out shows: every test here fails if the
// one line that it is about is broken.
#include <cstdio>

#include "tests/support/caustic_scene.h"

namespace relief::test {
namespace {

constexpr double kPi_d = 3.14159265358979323846;

Vec3f leaning(float x, float y, float z) { return normalize(Vec3f{x, y, z}); }

/// Shading normals of all corners.
Mesh with_normal(Mesh mesh, Vec3f N)
{
  mesh.N.assign(mesh.P.size(), as_normal(N));
  return mesh;
}

/// The wall x = −1 as a mirror, 3 m wide and high, seen from the right.
Mesh wall() { return quad_mesh({-1, 0, 1.5f}, {0, 0, -3}, {0, 3, 0}); }

TEST(CausticSplit, ShadingNormalsTurnFluxAsTheyTurnRadiance)
{
  // A mirror whose shading normals lean down by 20°. Paths find the lamp by its true solid angle; photons count it by
  // areas, which the two normals measure differently: without the adjoint's factor they bring some 20 % too much or less.
  Scene scene = empty_scene();
  add_floor(scene, 3);
  add_caster(scene, with_normal(wall(), leaning(0.94f, -0.34f, 0)), mirror_material());
  scene.lights.push_back(square_light({0.2f, 2.0f, 0}, leaning(-1, -0.2f, 0), 0.4f, 10));
  look_down(scene, {0.9f, 0, 0}, 0.5f, 1.2f);
  expect_same(scene, 64, 8, 0.005, "mirror that leans");
}

TEST(CausticSplit, RefractionBringsItsFactorForFluxAlone)
{
  // Into glass that ends below the floor: light is refracted once, so that nothing undoes what an index of refraction does
  // to radiance and must not do to flux. The floor in the glass is what the camera, in the glass as well, looks at.
  Scene scene = empty_scene();
  add_floor(scene, 3);
  add_caster(scene, quad_mesh({-2, 0.6f, 2}, {4, 0, 0}, {0, 0, -4}), glass_material());
  scene.lights.push_back(square_light({0.3f, 1.5f, 0}, {0, -1, 0}, 0.4f, 10));
  look_down(scene, {0, 0, 0}, 0.25f, 0.5f);
  expect_same(scene, 64, 8, 0.005, "under a surface of glass");
}

/// A wall that is a caster, between a lamp that faces it and a floor that the lamp leaves dark.
Scene lit_wall(const Material& material)
{
  Scene scene = empty_scene();
  add_floor(scene, 3);
  add_caster(scene, wall(), material);
  scene.lights.push_back(square_light({-0.3f, 1.6f, 0}, {-1, 0, 0}, 1.5f, 10));
  look_down(scene, {0.8f, 0, 0}, 0.5f, 2);
  return scene;
}

TEST(CausticSplit, LampsSendACastersSharpLobesPhotonsAlone)
{
  // Of the lamp, paths sample at the wall what its soft lobes reflect, and weigh that against all directions to which the
  // wall scatters: its sharp lobes go there as well, and widely.
  Material half_metal;
  half_metal.metallic = 0.5f;
  half_metal.roughness = 0.3f;
  half_metal.base_color = {0.9f, 0.5f, 0.1f};
  expect_same(lit_wall(half_metal), 128, 16, 0.005, "half metal");
}

TEST(CausticSplit, SharesOfAColourAreItsOwn)
{
  // Blue plastic reflects red by its sharp lobe alone, nearly, and most of all light by its soft one: what goes to either by
  // chance is weighed colour by colour. Red is compared, by paths that sample no lights: these
  // would hide it.
  Material plastic;
  plastic.metallic = 0;
  plastic.specular = 1;
  plastic.roughness = 0.4f;
  plastic.base_color = {0.02f, 0.5f, 0.9f};
  expect_same(lit_wall(plastic), 128, 16, 0.005, "blue plastic", LightTechnique::kBsdfSampling);
}

/// The picture of a floor under the light of a lamp's mirror image, over its closed form.
/// @param N  shading normal of the floor
double mirrored_over_closed_form(Scene scene, Vec3f N)
{
  add_object(scene, with_normal(quad_mesh({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}), N), diffuse_material(splat3(0.5f)));
  scene.instances.back().flags |= kCausticReceiver;
  add_caster(scene, wall(), mirror_material());
  scene.lights.push_back(point_light({0, 1, 0}, 5));
  look_down(scene, {0.3f, 0, 0.2f}, 0.4f, 2);
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 32, 16);
  options.settings.diffuse_bounces = 1;
  options.settings.caustics.photons = 1 << 17;
  const Rendered picture = render_scene(scene, options);
  double expected = 0;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      const float* P = picture.at(Aov::kPosition, x, y);
      const Vec3f to_image = Vec3f{-2, 1, 0} - Vec3f{P[0], P[1], P[2]};
      const double d2 = static_cast<double>(length_squared(to_image));
      expected += 5.0 * static_cast<double>(dot(to_image, N)) / (d2 * std::sqrt(d2)) * 0.5 / kPi_d / (32 * 32);
    }
  }
  return mean_of(picture, Aov::kCaustic) / expected;
}

TEST(CausticSplit, PhotonsOnALeaningSurfaceShineByItsShadingNormal)
{
  EXPECT_NEAR(mirrored_over_closed_form(empty_scene(), {0, 1, 0}), 1.0, 0.01);
  EXPECT_NEAR(mirrored_over_closed_form(empty_scene(), leaning(-0.4f, 0.9f, 0.1f)), 1.0, 0.01);
}

TEST(CausticSplit, PhotonsCountForTheCasterTheyWereAimedAt)
{
  // Two scraps of mirror that are one caster, so far apart that its box holds everything else: half of all photons are
  // aimed at that box, and those that meet the wall are the wall's and not its: counted twice, the light would be twice as
  // much. (Of six seeds the mean is within 0.1 %, a single one within 0.9 %.)
  Scene scene = empty_scene();
  Mesh scraps = quad_mesh({-2.5f, -1, -3}, {0.01f, 0, 0}, {0, 0, 0.01f});
  const Mesh far = quad_mesh({4, 4, 3}, {0.01f, 0, 0}, {0, 0, 0.01f});
  for (const Vec3f& P : far.P) scraps.P.push_back(P);
  for (const TriangleIndices& t : far.triangles) scraps.triangles.push_back({t.v0 + 4, t.v1 + 4, t.v2 + 4});
  add_caster(scene, scraps, mirror_material());
  EXPECT_NEAR(mirrored_over_closed_form(scene, {0, 1, 0}), 1.0, 0.04);
}

TEST(CausticSplit, WhatCannotBeGoneBackInsideGlassIsLeftToPaths)
{
  // A coarse ball of rough glass, shaded smooth, that shows a lamp behind the camera.
  Scene scene = empty_scene();
  add_caster(scene, sphere_mesh(0.4f, 8, 4, true), glass_material(0.4f));
  scene.lights.push_back(square_light({0.6f, 1.5f, 0}, leaning(-0.4f, -1, 0), 0.4f, 10));
  look_down(scene, {0, 0, 0}, 0.4f, 1.5f);
  expect_same(scene, 256, 32, 0.005, "coarse ball of rough glass");
}

TEST(CausticSplit, WhatCannotBeGoneBackIsLeftToPaths)
{
  // A coarse sphere of mirror, shaded smooth, and the floor below it, seen from underneath. Near the sphere's edges paths
  // leave below a facet and above the horizon that the shading normal draws, where no photon can come from, or come from
  // below that horizon. Of the light on the floor's far side this is a tenth.
  Scene scene = empty_scene();
  add_floor(scene, 3);
  Affine3 place;
  place.p = {0, 0.7f, 0};
  add_caster(scene, sphere_mesh(0.4f, 8, 4, true), mirror_material(), place);
  scene.lights.push_back(square_light({1.5f, 1.2f, 0}, {-1, 0, 0}, 0.6f, 10));
  for (const float x : {-0.4f, 0.0f}) {
    look_down(scene, {x, 0, 0}, 0.15f, 0.25f);
    RenderOptions options = caustic_options(scene, CausticsMode::kOn, 8, 64);
    options.settings.caustics.photons = 1 << 14;
    // The radius that these photons would get, 0.22, is wider than what is looked at, and blurs away 0.5 ± 0.1 % of its light.
    options.settings.caustics.radius = 0.05f;
    const Estimate on = estimate_mean(scene, options, 8);
    options = caustic_options(scene, CausticsMode::kOff, 8, 512);
    const Estimate off = estimate_mean(scene, options, 8);
    const double error = std::hypot(on.standard_error, off.standard_error);
    std::printf("photons over paths %.4f, standard error %.4f\n", on.mean / off.mean, error / off.mean);
    EXPECT_NEAR(on.mean, off.mean, 4 * error);
    EXPECT_LT(error, 0.02 * off.mean);
  }
}

/// A slab of rough glass, seen from above beside a lamp: nearly half of the light has been in the glass and was reflected by
/// its far side.
/// @param place  of both faces
Scene rough_slab(float roughness, const Affine3& place = {})
{
  Scene scene = empty_scene();
  add_caster(scene, quad_mesh({-2, 0.2f, 2}, {4, 0, 0}, {0, 0, -4}), glass_material(roughness), place);
  add_caster(scene, quad_mesh({-2, 0, -2}, {4, 0, 0}, {0, 0, 4}), glass_material(roughness), place);
  scene.lights.push_back(square_light({0.5f, 1.2f, 0}, leaning(-0.1f, -1, 0), 0.6f, 2));
  look_down(scene, {0.25f, 0.2f, 0}, 0.3f, 1);
  return scene;
}

TEST(CausticSplit, InsidesOfRoughGlassShowPhotons)
{
  for (const float roughness : {0.3f, 0.45f}) expect_same(rough_slab(roughness), 128, 16, 0.005, "slab");
  Affine3 mirrored;
  mirrored.x = {-1, 0, 0};
  expect_same(rough_slab(0.45f, mirrored), 128, 16, 0.005, "mirrored slab");
}

TEST(CausticSplit, InsidesOfRoughGlassKeepTheLimitsOfBounces)
{
  // In, reflected, out. Without reflections, the near side's is all there is. What microfacets reflect more than once counts
  // as diffuse.
  Scene scene = rough_slab(0.45f);
  scene.render.max_bounces = 2;
  scene.render.transmission_bounces = 1;
  double light[2] = {};
  for (const int reflections : {1, 0}) {
    scene.render.glossy_bounces = scene.render.diffuse_bounces = reflections;
    expect_same(scene, 128, 16, 0.005, "slab and few bounces");
    light[reflections] = mean_of(render_scene(scene, caustic_options(scene, CausticsMode::kOn, 32, 16)), Aov::kCaustic);
  }
  EXPECT_GT(light[1], 0);
  EXPECT_EQ(light[0], 0);
}

TEST(CausticSplit, ReflectionsInsideRoughGlassCountAsGlossy)
{
  // As above, but with one kind of reflection alone. What is reflected more than once, and is diffuse, is little at this
  // roughness.
  Scene scene = rough_slab(0.25f);
  scene.render.max_bounces = 2;
  scene.render.transmission_bounces = 1;
  double light[2] = {};
  for (const bool glossy : {false, true}) {
    scene.render.glossy_bounces = glossy ? 1 : 0;
    scene.render.diffuse_bounces = glossy ? 0 : 1;
    expect_same(scene, 128, 16, 0.005, glossy ? "slab that is glossy" : "slab that is diffuse");
    light[glossy] = mean_of(render_scene(scene, caustic_options(scene, CausticsMode::kOn, 32, 16)), Aov::kCaustic);
  }
  std::printf("diffuse over glossy %.5f\n", light[false] / light[true]);
  EXPECT_GT(light[true], 0);
  EXPECT_LT(light[false], 0.01 * light[true]);
}

TEST(CausticSplit, WhatTheShadingNormalHidesInsideGlassIsLeftToPaths)
{
  // A facet of very rough glass seen from inside, below the horizon of a shading normal that leans by 70°. What the facet
  // reflects above the horizon that is drawn for such a path and below its own meets it again and leaves to the lamp: 3 %
  // of the light. No photon can come that way, nor does any other reach the facet from inside, so that paths with and
  // without photons are the same: nothing is left to chance.
  Scene scene = empty_scene();
  add_caster(scene, with_normal(quad_mesh({-3, 0.6f, 3}, {6, 0, 0}, {0, 0, -6}), leaning(0.94f, 0.34f, 0)),
             glass_material(1));
  scene.lights.push_back(square_light({0, 1.6f, 0.7f}, leaning(0, -1, -0.7f), 0.5f, 10));
  const Vec3f wo = leaning(0.49f, -0.17f, 0.85f);
  Camera& camera = scene.cameras.front().camera;
  const Frame frame = frame_from_normal(wo);
  camera.world_from_camera = {frame.s, frame.t, wo, Vec3f{0, 0.6f, 0} + 2.0f * wo};
  camera.half_width = camera.half_height = 0.01f;
  double light[2] = {};
  for (const bool photons : {false, true}) {
    const CausticsMode mode = photons ? CausticsMode::kOn : CausticsMode::kOff;
    light[photons] = render_scene(scene, caustic_options(scene, mode, 32, 64)).mean();
  }
  EXPECT_NEAR(light[1], light[0], 1e-3 * light[0]);
}

/// A floor of rough metal or glass beside a mirror, seen from above. The floor's lobe leads by way of the mirror to a lamp: its
/// peak at x = −0.8, its tails from where x is more.
Scene rough_floor(const Material& material, float x, float half)
{
  Scene scene = empty_scene();
  add_caster(scene, quad_mesh({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}), material);
  add_caster(scene, wall(), mirror_material());
  scene.lights.push_back(square_light({-0.6f, 2.6f, 0}, leaning(-1, -0.6f, 0), 0.3f, 10));
  look_down(scene, {x, 0, 0}, half, 2);
  return scene;
}

Material rough_metal(float roughness)
{
  Material metal;
  metal.roughness = roughness;
  metal.base_color = {0.9f, 0.5f, 0.1f};
  return metal;
}

TEST(CausticSplit, TailsOfRoughCastersShowPhotons)
{
  for (const float roughness : {0.2f, 0.3f, 0.45f}) {
    expect_same(rough_floor(rough_metal(roughness), -0.3f, 0.6f), 256, 16, 0.005, "metal");
  }
  expect_same(rough_floor(glass_material(0.45f), -0.3f, 0.6f), 512, 16, 0.005, "glass");
}

TEST(CausticSplit, TailsHaveLittleNoise)
{
  // Paths that leave the metal by its tail find the lamp in the mirror one time in hundreds, and are the brighter for it.
  const Scene scene = rough_floor(rough_metal(0.3f), 0.1f, 0.2f);
  RenderOptions options = caustic_options(scene, CausticsMode::kOn, 32, 4);
  options.settings.caustics.photons = 1 << 15;
  const Estimate on = estimate_mean(scene, options, 8);
  const Estimate off = estimate_mean(scene, caustic_options(scene, CausticsMode::kOff, 32, 4), 8);
  std::printf("standard errors %.4f with photons, %.4f without\n", on.standard_error / on.mean,
              off.standard_error / off.mean);
  EXPECT_LT(on.standard_error, off.standard_error / 4);
}

TEST(CausticSplit, TailsKeepTheLimitsOfBounces)
{
  // By way of the mirror a path is reflected twice; the last event before the lamp is not asked for its kind. What microfacets
  // reflect more than once counts as diffuse.
  Scene scene = rough_floor(rough_metal(0.45f), -0.3f, 0.6f);
  for (const bool glossy : {false, true}) {
    for (const bool diffuse : {false, true}) {
      scene.render.glossy_bounces = glossy ? 1 : 0;
      scene.render.diffuse_bounces = diffuse ? 1 : 0;
      expect_same(scene, 128, 16, 0.005, "metal and few bounces");
      const double light =
          mean_of(render_scene(scene, caustic_options(scene, CausticsMode::kOn, 32, 16)), Aov::kCaustic);
      EXPECT_EQ(light > 0, glossy || diffuse);
    }
  }
}

TEST(CausticSplit, PathsFromAFloorInGlassDoNotLookInside)
{
  // The floor lies in the glass and is lit through its rough surface; half of what it throws back that surface reflects. So
  // photons go on from the floor to the floor, and paths that come from it have been given their light.
  Scene scene = empty_scene();
  add_floor(scene, 3);
  scene.materials.front() = diffuse_material(splat3(0.9f));
  add_caster(scene, quad_mesh({-2, 0.6f, 2}, {4, 0, 0}, {0, 0, -4}), glass_material(0.4f));
  scene.lights.push_back(square_light({0.3f, 1.5f, 0}, {0, -1, 0}, 0.4f, 10));
  look_down(scene, {0, 0, 0}, 0.25f, 0.5f);
  expect_same(scene, 128, 16, 0.005, "floor in rough glass");
}

TEST(CausticSplit, RouletteTakesWhatTheSurfaceTakes)
{
  // A mirror that reflects a third.
  Scene scene = empty_scene();
  add_floor(scene, 3);
  Material dark = mirror_material();
  dark.base_color = splat3(0.3f);
  add_caster(scene, wall(), dark);
  scene.lights.push_back(square_light({0.2f, 2.0f, 0}, leaning(-1, -0.2f, 0), 0.4f, 10));
  look_down(scene, {0.9f, 0, 0}, 0.5f, 1.2f);
  expect_same(scene, 64, 8, 0.005, "dark mirror");
}

}  // namespace
}  // namespace relief::test
