// Scenes whose radiance is known in closed form, through every way of rendering them: instruction sets, techniques of
// direct light, meshes in place and instanced.
//
// Statistical comparisons use the mean of 16 independent runs and its standard error. The bound of 5.2 standard errors
// is the two-sided 1e-4 quantile of Student's t with 15 degrees of freedom; seeds are fixed, so a test that passes
// once passes always.
#include <cstdlib>

#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

constexpr int kRuns = 16;
constexpr double kQuantile = 5.2;

struct Configuration {
  const char* name;
  const char* isa;
  LightTechnique technique;
  bool instanced;
};

void PrintTo(const Configuration& c, std::ostream* out) { *out << c.name; }

class AnalyticScene : public testing::TestWithParam<Configuration> {
 protected:
  void SetUp() override { setenv("RELIEF_ISA", GetParam().isa, 1); }
  void TearDown() override { unsetenv("RELIEF_ISA"); }

  /// Adds an object; the instanced configurations place a second, hidden copy far away, so that Embree instances both.
  void add(Scene& scene, Mesh mesh, const Material& material)
  {
    add_object(scene, std::move(mesh), material);
    if (!GetParam().instanced) return;
    Instance copy = scene.instances.back();
    copy.world_from_object.p = {0, -1e4f, 0};
    copy.flags = 0;
    scene.instances.push_back(copy);
  }

  RenderOptions options(const Scene& scene, int size, int samples) const
  {
    RenderOptions o = render_options(scene, size, samples);
    o.light_technique = GetParam().technique;
    return o;
  }

  static void expect_mean(const Estimate& estimate, double truth, double absolute)
  {
    EXPECT_NEAR(estimate.mean, truth, kQuantile * estimate.standard_error + absolute)
        << "standard error " << estimate.standard_error;
  }
};

constexpr Configuration kConfigurations[] = {
    {"baseline_mis", "baseline", LightTechnique::kMis, false},
    {"avx2_mis", "avx2", LightTechnique::kMis, false},
    {"avx2_mis_instanced", "avx2", LightTechnique::kMis, true},
    {"avx2_light", "avx2", LightTechnique::kLightSampling, false},
    {"avx2_bsdf", "avx2", LightTechnique::kBsdfSampling, false},
};

TEST_P(AnalyticScene, WhiteDiffuseSphereVanishesInAWhiteFurnace)
{
  Scene scene = empty_scene();
  add(scene, sphere_mesh(1, 64, 32, true), diffuse_material({1, 1, 1}));
  scene.environment.color = {1, 1, 1};
  scene.render.max_bounces = scene.render.diffuse_bounces = 60;
  expect_mean(estimate_mean(scene, options(scene, 16, 16), kRuns), 1.0, 1e-5);
}

TEST_P(AnalyticScene, ClosedEmittingSphereGathersAGeometricSeries)
{
  // Inside, every point sees radiance L = e + ρ L.
  Scene scene = empty_scene();
  Material material = diffuse_material({0.5f, 0.7f, 0.2f});
  material.emission = {0.5f, 0.5f, 0.5f};
  material.double_sided = true;
  add(scene, sphere_mesh(10, 32, 16, false), material);
  scene.render.max_bounces = scene.render.diffuse_bounces = 120;
  const RenderOptions o = options(scene, 16, 16);
  expect_mean(estimate_mean(scene, o, kRuns, 0), 0.5 / (1 - 0.5), 1e-5);
  expect_mean(estimate_mean(scene, o, kRuns, 1), 0.5 / (1 - 0.7), 1e-5);
  expect_mean(estimate_mean(scene, o, kRuns, 2), 0.5 / (1 - 0.2), 1e-5);
}

/// Looks straight down onto one point of a floor at z = 0, through a window of 1e-4. Its quads are placed so that this
/// point is not on their diagonal: there a ray may meet both triangles, which counts a transparent quad twice.
Scene floor_scene()
{
  Scene scene = empty_scene();
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 1e-4f;
  scene.render.max_bounces = scene.render.diffuse_bounces = 0;
  return scene;
}

Mesh big_quad(float z) { return quad_mesh({-40, -50, z}, {100, 0, 0}, {0, 100, 0}); }

TEST_P(AnalyticScene, SunLightsAFloorByItsCosine)
{
  if (GetParam().technique == LightTechnique::kBsdfSampling) return;  // delta lights are sampled in every technique
  Scene scene = floor_scene();
  add(scene, big_quad(0), diffuse_material({0.6f, 0.6f, 0.6f}));
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = normalize(Vec3f{0.6f, 0, -0.8f});
  sun.emission = {3, 3, 3};
  scene.lights.push_back(sun);
  EXPECT_NEAR(render_scene(scene, options(scene, 4, 4)).mean(), 3 * 0.8 * 0.6 / kPi, 1e-5);
}

TEST_P(AnalyticScene, PointLightFallsOffWithTheSquare)
{
  if (GetParam().technique == LightTechnique::kBsdfSampling) return;
  Scene scene = floor_scene();
  add(scene, big_quad(0), diffuse_material({0.6f, 0.6f, 0.6f}));
  Light light;
  light.P = {0, 3, 1.5f};
  light.emission = {7, 7, 7};
  scene.lights.push_back(light);
  const double squared = 3.0 * 3.0 + 1.5 * 1.5;
  EXPECT_NEAR(render_scene(scene, options(scene, 4, 4)).mean(), 7 / squared * (1.5 / std::sqrt(squared)) * 0.6 / kPi,
              2e-5);
}

/// Irradiance on a floor from a parallel rectangle of unit radiance, one corner above the point: Howell's C-11.
double corner_form_factor(double a, double b, double height)
{
  const double x = a / height, y = b / height;
  const double rx = std::sqrt(1 + x * x), ry = std::sqrt(1 + y * y);
  return (x / rx * std::atan(y / rx) + y / ry * std::atan(x / ry)) / (2 * M_PI);
}

TEST_P(AnalyticScene, RectangleLightsAFloorByItsFormFactor)
{
  Scene scene = floor_scene();
  add(scene, big_quad(0), diffuse_material({0.6f, 0.6f, 0.6f}));
  Light light;
  light.kind = LightKind::kRectangle;
  light.P = {0, 0, 1.25f};
  light.axis = {0, 0, -1};
  light.edge_u = {0.75f, 0, 0};
  light.edge_v = {0, 0.5f, 0};
  light.area = 1.5f;
  light.emission = {4, 4, 4};
  light.visible_to_camera = false;
  scene.lights.push_back(light);
  const double truth = 0.6 * 4 * 4 * corner_form_factor(0.75, 0.5, 1.25);
  expect_mean(estimate_mean(scene, options(scene, 8, 64), kRuns), truth, 1e-5);
}

TEST_P(AnalyticScene, EmissiveMeshLightsAFloorByItsFormFactor)
{
  Scene scene = floor_scene();
  add(scene, big_quad(0), diffuse_material({0.6f, 0.6f, 0.6f}));
  Material emitter = diffuse_material({0, 0, 0});
  emitter.emission = {4, 4, 4};
  // Wound so that its front looks down; the camera sees its dark back and is therefore kept from it.
  add(scene, quad_mesh({-0.75f, -0.5f, 1.25f}, {0, 1, 0}, {1.5f, 0, 0}), emitter);
  for (Instance& instance : scene.instances) {
    if (instance.material_index == 1) instance.flags &= ~std::uint32_t{kVisibleToCamera};
  }
  const double truth = 0.6 * 4 * 4 * corner_form_factor(0.75, 0.5, 1.25);
  expect_mean(estimate_mean(scene, options(scene, 8, 64), kRuns), truth, 1e-5);
}

TEST_P(AnalyticScene, DiskLightsAFloorByItsFormFactor)
{
  Scene scene = floor_scene();
  add(scene, big_quad(0), diffuse_material({0.6f, 0.6f, 0.6f}));
  Light light;
  light.kind = LightKind::kDisk;
  light.P = {0, 0, 1.5f};
  light.axis = {0, 0, -1};
  light.edge_u = {0, 0.8f, 0};
  light.edge_v = {0.8f, 0, 0};
  light.area = kPi * 0.64f;
  light.emission = {4, 4, 4};
  light.visible_to_camera = false;
  scene.lights.push_back(light);
  const double truth = 0.6 * 4 * 0.64 / (0.64 + 1.5 * 1.5);
  expect_mean(estimate_mean(scene, options(scene, 8, 64), kRuns), truth, 1e-5);
}

TEST_P(AnalyticScene, BlendedSurfacesLetLightThroughByTheirAlpha)
{
  // The camera looks through two panes of alpha ½ and ¼ at a floor that a sun lights through the same panes.
  if (GetParam().technique == LightTechnique::kBsdfSampling) return;
  Scene scene = floor_scene();
  add(scene, big_quad(0), diffuse_material({0.6f, 0.6f, 0.6f}));
  Material pane = diffuse_material({0, 0, 0});
  pane.alpha_mode = AlphaMode::kBlend;
  pane.base_alpha = 0.5f;
  add(scene, big_quad(1), pane);
  pane.base_alpha = 0.25f;
  add(scene, big_quad(2), pane);
  Light sun;
  sun.kind = LightKind::kSun;
  sun.emission = {3, 3, 3};
  scene.lights.push_back(sun);
  const double through = 0.5 * 0.75;
  expect_mean(estimate_mean(scene, options(scene, 8, 64), kRuns), through * through * 3 * 0.6 / kPi, 1e-6);
}

TEST_P(AnalyticScene, AbsorbingSlabOfIndexOneFollowsBeerAndLambert)
{
  Scene scene = empty_scene();
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 1e-4f;
  scene.environment.color = {1, 1, 1};
  Material glass;
  glass.metallic = 0;
  glass.roughness = 0;
  glass.transmission = 1;
  glass.ior = 1;
  glass.thickness = 1;
  set_absorption(scene, glass, volume_sigma_a({0.25f, 0.5f, 1}, 2));
  Mesh slab = quad_mesh({-5, -5, 0.5f}, {10, 0, 0}, {0, 10, 0});
  const Mesh back = quad_mesh({-5, -5, -0.5f}, {0, 10, 0}, {10, 0, 0});
  for (const TriangleIndices t : back.triangles) slab.triangles.push_back({t.v0 + 4, t.v1 + 4, t.v2 + 4});
  slab.P.insert(slab.P.end(), back.P.begin(), back.P.end());
  add(scene, slab, glass);
  const Rendered rendered = render_scene(scene, options(scene, 4, 16));
  EXPECT_NEAR(rendered.mean(0), 0.5, 1e-5);
  EXPECT_NEAR(rendered.mean(1), std::sqrt(0.5), 1e-5);
  EXPECT_NEAR(rendered.mean(2), 1.0, 1e-5);
}

TEST_P(AnalyticScene, SmoothGlassSphereVanishesInAWhiteFurnace)
{
  Scene scene = empty_scene();
  Material glass;
  glass.metallic = 0;
  glass.roughness = 0;
  glass.transmission = 1;
  glass.thickness = 1;
  add(scene, sphere_mesh(1, 128, 64, true), glass);
  scene.environment.color = {1, 1, 1};
  scene.render.max_bounces = scene.render.transmission_bounces = scene.render.glossy_bounces = 120;
  // Facets under smooth normals refract as if bent: what is lost where the two disagree is 0.1 % at this tessellation.
  expect_mean(estimate_mean(scene, options(scene, 16, 64), kRuns), 1.0, 1e-3);
}

Material clear_glass()
{
  Material glass;
  glass.metallic = 0;
  glass.roughness = 0;
  glass.transmission = 1;
  glass.thickness = 1;
  return glass;
}

// Light is carried through one interface alone, and is what it was: by physics' own measure it would be 2.25 times as
// bright within. All paths carry radiance over the square of the index, as Cycles' do.
TEST_P(AnalyticScene, AWorldIsAsBrightFromWithinGlass)
{
  Scene scene = empty_scene();
  scene.cameras[0].camera.world_from_camera.p = {0, 0, 0};
  add(scene, sphere_mesh(2, 128, 64, true), clear_glass());
  scene.environment.color = {0.5f, 0.5f, 0.5f};
  scene.render.max_bounces = scene.render.transmission_bounces = scene.render.glossy_bounces = 120;
  expect_mean(estimate_mean(scene, options(scene, 16, 16), kRuns), 0.5, 1e-3);
}

TEST_P(AnalyticScene, AFloorBehindOneSheetOfGlassIsAsBright)
{
  // Through the sheet the floor emits .5, and the sheet mirrors a black world: 1 − F, straight down.
  Scene scene = floor_scene();
  Material floor = diffuse_material({0, 0, 0});
  floor.emission = {0.5f, 0.5f, 0.5f};
  add(scene, big_quad(0), floor);
  add(scene, big_quad(0.2f), clear_glass());
  scene.render.max_bounces = scene.render.transmission_bounces = 4;
  const double F = 0.04;
  expect_mean(estimate_mean(scene, options(scene, 8, 16), kRuns), 0.5 * (1 - F), 1e-4);
}

INSTANTIATE_TEST_SUITE_P(, AnalyticScene, testing::ValuesIn(kConfigurations), [](const auto& parameter) {
  return std::string(parameter.param.name);
});

}  // namespace
}  // namespace relief::test
