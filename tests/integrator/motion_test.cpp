// Motion blur: what moves, against the mean of still pictures that know nothing of time, and against closed forms.
#include "integrator/scene_motion.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include <tbb/global_control.h>

#include "tests/support/caustic_scene.h"
#include "tests/support/loaded_scene.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

Affine3 turned(float angle, Vec3f p)
{
  const float c = std::cos(angle), s = std::sin(angle);
  return {{c, 0, -s}, {0, 1, 0}, {s, 0, c}, p};
}

/// Turns about the y axis while it goes along x and grows.
Affine3 place_at(float t)
{
  Affine3 m = turned(2.0f * t, {-0.5f + t, 0.1f, 0.3f * t});
  m.y = {0, 1 + 0.5f * t, 0};
  return m;
}

std::vector<Affine3> steps_of(const std::function<Affine3(float)>& at, int steps)
{
  std::vector<Affine3> out;
  for (int i = 0; i <= steps; ++i) out.push_back(at(static_cast<float>(i) / static_cast<float>(steps)));
  return out;
}

double largest_difference(const Affine3& a, const Affine3& b)
{
  const Vec3f d = max(max(abs(a.x - b.x), abs(a.y - b.y)), max(abs(a.z - b.z), abs(a.p - b.p)));
  return static_cast<double>(max_component(d));
}

struct Keys {
  explicit Keys(const std::vector<Affine3>& steps)
  {
    for (const Affine3& step : steps) keys.push_back(motion_key_make(step, keys.empty() ? nullptr : &keys.back()));
  }
  MotionView view() const { return {keys.data(), static_cast<std::uint32_t>(keys.size())}; }
  std::vector<MotionKey> keys;
};

TEST(Motion, GoesThroughItsKeys)
{
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(-2, 2);
  const auto vector = [&] { return Vec3f{uniform(random), uniform(random), uniform(random)}; };
  int num_tried = 0;
  while (num_tried < 500) {
    const std::vector<Affine3> steps = {{vector(), vector(), vector(), vector()},
                                        {vector(), vector(), vector(), vector()}};
    if (std::abs(determinant(steps[0])) < 0.1f || determinant(steps[0]) * determinant(steps[1]) <= 0) continue;
    ++num_tried;
    const Keys keys(steps);
    ASSERT_LT(largest_difference(motion_at(keys.view(), 0), steps[0]), 1e-6);
    ASSERT_LT(largest_difference(motion_at(keys.view(), 1), steps[1]), 1e-6);
  }
}

TEST(Motion, TurnsEvenlyAndGoesStraightBetweenThem)
{
  for (const int steps : {1, 2, 3, 5}) {
    const Keys keys(steps_of(place_at, steps));
    for (float t = 0; t <= 1; t += 0.03125f) {
      EXPECT_LT(largest_difference(motion_at(keys.view(), t), place_at(t)), 1e-6) << steps << " steps, " << t;
    }
  }
}

TEST(Motion, StraysNoFurtherThanItsBound)
{
  std::mt19937 random(4);
  std::uniform_real_distribution<float> uniform(-1, 1);
  const auto vector = [&] { return Vec3f{uniform(random), uniform(random), uniform(random)}; };
  double closest = 0;
  for (int i = 0; i < 300; ++i) {
    const std::vector<Affine3> steps = {{vector(), vector(), vector(), vector()},
                                        {vector(), vector(), vector(), vector()}};
    if (std::abs(determinant(steps[0])) < 0.05f || determinant(steps[0]) * determinant(steps[1]) <= 0) continue;
    const Keys keys(steps);
    const Vec3f P = vector();
    const double bound = motion_stray(keys.keys[0], keys.keys[1], static_cast<double>(length(P)));
    const Vec3f from = transform_point(steps[0], P), to = transform_point(steps[1], P);
    for (float t = 0.05f; t < 1; t += 0.05f) {
      const Vec3f strayed = transform_point(motion_at(keys.view(), t), P) - (from * (1 - t) + to * t);
      const auto distance = static_cast<double>(length(strayed));
      ASSERT_LE(distance, bound + 1e-5);
      closest = std::max(closest, distance / bound);
    }
  }
  EXPECT_GT(closest, 0.3);  // else the bound is of little use
}

int add_motion(Scene& scene, const std::vector<Affine3>& steps)
{
  scene.motions.push_back(steps);
  return static_cast<int>(scene.motions.size()) - 1;
}

/// A white square of half a metre that goes a metre to the right, before a camera that sees three.
TEST(MotionBlur, OfASquareIsATrapezoid)
{
  Scene scene = empty_scene();
  Material white = diffuse_material({1, 1, 1});
  white.unlit = true;
  add_object(scene, quad_mesh({-1, -1, 0}, {0.5f, 0, 0}, {0, 2, 0}), white);
  scene.instances[0].motion_index = add_motion(scene, {{}, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 0}}});
  Camera& camera = scene.cameras[0].camera;
  camera.projection = Projection::kOrthographic;
  camera.half_width = camera.half_height = 1.5f;
  constexpr int kSize = 24;
  const Rendered picture = render_scene(scene, render_options(scene, kSize, 256));
  // The part of the time for which x is in the square, integrated over x.
  const auto area = [](double x) {
    const auto ramp = [](double v) { return v > 0 ? 0.5 * v * v : 0.0; };
    return ramp(x + 1) - ramp(x + 0.5) - ramp(x) + ramp(x - 0.5);
  };
  for (int x = 0; x < kSize; ++x) {
    const double low = -1.5 + 3.0 * x / kSize, high = low + 3.0 / kSize;
    const double expected = (area(high) - area(low)) / (high - low);
    double mean = 0;
    for (int y = kSize / 4; y < 3 * kSize / 4; ++y) {
      mean += static_cast<double>(picture.radiance(x, y).x) / (kSize / 2);
    }
    EXPECT_NEAR(mean, expected, 0.02) << "column " << x;  // six standard errors, if nothing was stratified
  }
}

constexpr int kSize = 16, kRuns = 8;

/// Means of pixels over independent runs, and the variance of these means.
struct Pixels {
  double mean[kSize * kSize] = {}, variance[kSize * kSize] = {};

  /// @param add_picture  adds that of a run
  explicit Pixels(const std::function<void(int, std::vector<double>&)>& add_picture)
  {
    double squares[kSize * kSize] = {};
    for (int run = 0; run < kRuns; ++run) {
      std::vector<double> picture(kSize * kSize);
      add_picture(run, picture);
      for (std::size_t i = 0; i < kSize * kSize; ++i) {
        mean[i] += picture[i] / kRuns;
        squares[i] += picture[i] * picture[i] / kRuns;
      }
    }
    for (int i = 0; i < kSize * kSize; ++i) {
      variance[i] = std::max(squares[i] - mean[i] * mean[i], 0.0) / (kRuns - 1);
    }
  }
};

void add_pixels(const Rendered& picture, double share, std::vector<double>& pixels)
{
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      pixels[static_cast<std::size_t>(y * kSize + x)] += share * static_cast<double>(picture.radiance(x, y).x);
    }
  }
}

/// Expects the picture of a scene that moves to be the mean of those of still scenes.
/// @param still    scene at a time, without any motion
/// @param moving   the same with motion
/// @param samples  of a run
/// @param slack    of a pixel, for what is not noise
void expect_mean_of_stills(const std::function<Scene(float)>& still,
                           const Scene& moving,
                           const std::function<void(RenderOptions&)>& change = {},
                           int samples = 512,
                           double slack = 5e-4)
{
  const auto options_for = [&](const Scene& scene, int size_samples, std::uint64_t seed) {
    RenderOptions options = render_options(scene, kSize, size_samples);
    options.settings.seed = seed;
    options.aov_mask = 1;
    options.camera_motion_index = scene.cameras[0].motion_index;
    if (change) change(options);
    return options;
  };
  constexpr int kTimes = 16;
  const Pixels of_stills([&](int run, std::vector<double>& pixels) {
    for (int i = 0; i < kTimes; ++i) {
      // Other times in each run.
      const float within = (static_cast<float>(run * 5 % kRuns) + 0.5f) / kRuns;
      const Scene scene = still((static_cast<float>(i) + within) / kTimes);
      const auto seed = 1000u + static_cast<std::uint64_t>(100 * run + i);
      add_pixels(render_scene(scene, options_for(scene, samples / kTimes, seed)), 1.0 / kTimes, pixels);
    }
  });
  const Pixels of_motion([&](int run, std::vector<double>& pixels) {
    add_pixels(render_scene(moving, options_for(moving, samples, 70u + static_cast<std::uint64_t>(run))), 1, pixels);
  });
  double mean = 0, squares = 0;
  for (int i = 0; i < kSize * kSize; ++i) {
    mean += of_stills.mean[i] / (kSize * kSize);
    const double difference = of_motion.mean[i] - of_stills.mean[i];
    squares +=
        difference * difference / (of_stills.variance[i] + of_motion.variance[i] + slack * slack) / (kSize * kSize);
  }
  EXPECT_GT(mean, 0.01);
  // Squares of Student's t with 14 degrees of freedom have a mean of 7/6; that of 256 is within .15 of it two times in three.
  // With four fifths of the motion it is beyond this.
  EXPECT_LT(squares, 2);
}

/// A box that is no cube, with a hole in its silhouette's symmetry.
Mesh box_mesh()
{
  Mesh mesh;
  const auto add = [&](Vec3f P, Vec3f u, Vec3f v) {
    const Mesh side = quad_mesh(P, u, v);
    const auto first = static_cast<std::uint32_t>(mesh.P.size());
    mesh.P.insert(mesh.P.end(), side.P.begin(), side.P.end());
    for (const TriangleIndices& t : side.triangles)
      mesh.triangles.push_back({t.v0 + first, t.v1 + first, t.v2 + first});
  };
  const Vec3f x{0.9f, 0, 0}, y{0, 0.5f, 0}, z{0, 0, 0.3f}, low{-0.3f, -0.25f, -0.15f};
  add(low + z, x, y);
  add(low, y, x);
  add(low + x, y, z);
  add(low, z, y);
  add(low + y, z, x);
  add(low, x, z);
  return mesh;
}

/// A box on its way over a floor, lit by a lamp.
Scene box_scene(const Affine3& placed, Vec3f lamp = {1, 2.5f, 1})
{
  Scene scene = empty_scene();
  scene.render.max_bounces = 2;
  add_object(scene, box_mesh(), diffuse_material({0.8f, 0.5f, 0.3f}), placed);
  add_object(scene, quad_mesh({-2, -0.5f, 2}, {4, 0, 0}, {0, 0, -4}), diffuse_material(splat3(0.5f)));
  scene.lights.push_back(square_light(lamp, {0, -1, 0}, 0.3f, 20));
  scene.cameras[0].camera.world_from_camera.p = {0, 0.2f, 4};
  return scene;
}

TEST(MotionBlur, OfABoxThatTurnsIsTheMeanOfStills)
{
  Scene moving = box_scene(place_at(0.5f));
  moving.instances[0].motion_index = add_motion(moving, steps_of(place_at, 2));
  expect_mean_of_stills([](float t) { return box_scene(place_at(t)); }, moving);
}

/// What rays of the test above would not notice: that the one at the middle of the shutter sees another picture.
TEST(MotionBlur, OfABoxIsNotTheStillAtItsMiddle)
{
  Scene moving = box_scene(place_at(0.5f));
  const Rendered still = render_scene(moving, render_options(moving, kSize, 64));
  moving.instances[0].motion_index = add_motion(moving, steps_of(place_at, 2));
  const Rendered blurred = render_scene(moving, render_options(moving, kSize, 64));
  double most = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      most = std::max(most, std::abs(static_cast<double>(still.radiance(x, y).x - blurred.radiance(x, y).x)));
    }
  }
  EXPECT_GT(most, 0.05);
}

TEST(MotionBlur, OfInstancesOfOneMeshIsTheMeanOfStills)
{
  const auto scene_at = [](const Affine3& placed) {
    Scene scene = box_scene(placed);
    Instance second = scene.instances[0];
    second.world_from_object = turned(0.4f, {0.3f, 0.6f, -0.5f});
    scene.instances.push_back(second);
    return scene;
  };
  Scene moving = scene_at(place_at(0.5f));
  moving.instances[0].motion_index = add_motion(moving, steps_of(place_at, 1));
  expect_mean_of_stills([&](float t) { return scene_at(place_at(t)); }, moving);
}

TEST(MotionBlur, OfACameraIsTheMeanOfStills)
{
  const auto camera_at = [](float t) { return turned(-0.3f + 0.6f * t, {-1.2f + 2.4f * t, 0.3f, 4}); };
  const auto scene_at = [&](float t) {
    Scene scene = box_scene(place_at(0.3f));
    scene.cameras[0].camera.world_from_camera = camera_at(t);
    return scene;
  };
  Scene moving = scene_at(0.5f);
  moving.cameras[0].motion_index = add_motion(moving, steps_of(camera_at, 4));
  expect_mean_of_stills(scene_at, moving);
}

/// A lamp's motion as Light::motion_index has it.
std::vector<Affine3> lamp_steps(const std::function<Vec3f(float)>& P, float angle)
{
  return steps_of([&](float t) { return turned((t - 0.5f) * angle, P(t)); }, 2);
}

class MotionBlurOfLamps : public testing::TestWithParam<LightTechnique> {};

TEST_P(MotionBlurOfLamps, IsTheMeanOfStills)
{
  const auto P = [](float t) { return Vec3f{-1.5f + 3 * t, 1.5f, 1}; };
  for (const LightKind kind : {LightKind::kRectangle, LightKind::kDisk, LightKind::kPoint}) {
    const auto scene_at = [&](float t) {
      Scene scene = box_scene(place_at(0.3f), P(t));
      Light& light = scene.lights[0];
      const Affine3 turn = turned((t - 0.5f) * 0.8f, {});
      light.kind = kind;
      if (kind == LightKind::kPoint) {
        light.radius = 0.2f;
        light.emission = splat3(10);
      }
      light.axis = transform_vector(turn, normalize(Vec3f{0.3f, -1, 0}));
      const Frame frame = frame_from_normal(normalize(Vec3f{0.3f, -1, 0}));
      light.edge_u = transform_vector(turn, 0.3f * frame.s);
      light.edge_v = transform_vector(turn, 0.2f * frame.t);
      light.area = (kind == LightKind::kDisk ? kPi : 4.0f) * 0.06f;
      // Another, so that there is a choice.
      scene.lights.push_back(point_light({0, 3, -1}, 2));
      return scene;
    };
    Scene moving = scene_at(0.5f);
    moving.lights[0].motion_index = add_motion(moving, lamp_steps(P, 0.8f));
    SCOPED_TRACE(static_cast<int>(kind));
    expect_mean_of_stills(scene_at, moving, [](RenderOptions& o) { o.light_technique = GetParam(); });
  }
}

INSTANTIATE_TEST_SUITE_P(Techniques,
                         MotionBlurOfLamps,
                         testing::Values(LightTechnique::kMis, LightTechnique::kBsdfSampling));

TEST(MotionBlur, OfAGlowingMeshIsTheMeanOfStills)
{
  const auto scene_at = [](const Affine3& placed) {
    Scene scene = box_scene(placed);
    scene.materials[0].emission = splat3(1);
    return scene;
  };
  Scene moving = scene_at(place_at(0.5f));
  moving.instances[0].motion_index = add_motion(moving, steps_of(place_at, 2));
  expect_mean_of_stills([&](float t) { return scene_at(place_at(t)); }, moving);
}

constexpr int kColumns = 16, kRows = 8;  // of spheres that are displaced

/// A displaced sphere, its texture seam at the back, and a floor.
Scene displaced_sphere_scene(Mesh sphere, const Affine3& placed = {}, bool curved = false)
{
  Scene scene = empty_scene();
  scene.render.max_bounces = 1;
  constexpr int kTexels = 16;
  for (int r = 0; r <= kRows; ++r) {
    for (int c = 0; c <= kColumns; ++c)
      sphere.uv[0].push_back({static_cast<float>(c) / kColumns, static_cast<float>(r) / kRows});
  }
  Material material = diffuse_material({0.8f, 0.5f, 0.3f});
  material.displacement_index = 0;
  add_object(scene, std::move(sphere), material, placed);
  add_displacement(scene, kTexels, noise_texels(kTexels, 5), 0.2f).curved = curved;
  add_object(scene, quad_mesh({-2, -0.7f, 2}, {4, 0, 0}, {0, 0, -4}), diffuse_material(splat3(0.5f)));
  scene.lights.push_back(square_light({1, 2.5f, 1}, {0, -1, 0}, 0.3f, 20));
  return scene;
}

TEST(MotionBlur, OfADisplacedMeshIsTheMeanOfStills)
{
  const auto scene_at = [](const Affine3& placed) {
    return displaced_sphere_scene(sphere_mesh(0.5f, kColumns, kRows, true), placed);
  };
  Scene moving = scene_at(place_at(0.5f));
  moving.instances[0].motion_index = add_motion(moving, steps_of(place_at, 2));
  expect_mean_of_stills([&](float t) { return scene_at(place_at(t)); }, moving);
}

/// Shapes of a mesh at three times, and what is straight between them.
struct Shapes {
  Mesh shapes[3];

  Mesh at(float t) const
  {
    const int before = std::min(static_cast<int>(2 * t), 1);
    const float part = 2 * t - static_cast<float>(before);
    const Mesh &from = shapes[before], &to = shapes[before + 1];
    Mesh mesh = shapes[0];
    for (std::size_t v = 0; v < mesh.P.size(); ++v) {
      mesh.P[v] = from.P[v] * (1 - part) + to.P[v] * part;
      mesh.N[v] = as_normal(as_vector(from.N[v]) * (1 - part) + as_vector(to.N[v]) * part);
    }
    return mesh;
  }
  void add_steps(Scene& scene) const
  {
    for (const Mesh& mesh : shapes) scene.meshes[0].steps.push_back({mesh.P, mesh.N});
  }
};

TEST(MotionBlur, OfAMeshThatDeformsIsTheMeanOfStills)
{
  // Straight between three shapes, as steps are.
  const auto shape = [](int step) {
    Mesh mesh = sphere_mesh(0.5f, 24, 12, true);
    for (std::size_t v = 0; v < mesh.P.size(); ++v) {
      Vec3f& P = mesh.P[v];
      P = {P.x * (1 + 0.5f * static_cast<float>(step)), P.y + 0.4f * P.x * static_cast<float>(step * step), P.z};
      mesh.N[v] = as_normal(normalize(as_vector(mesh.N[v]) + Vec3f{0, 0.3f * static_cast<float>(step), 0}));
    }
    return mesh;
  };
  const Shapes shapes{shape(0), shape(1), shape(2)};
  const auto scene_at = [&](float t, const Affine3& placed) {
    Scene scene = box_scene(placed);
    scene.meshes[0] = shapes.at(t);
    return scene;
  };
  for (const bool moves : {false, true}) {
    SCOPED_TRACE(moves);
    Scene moving = scene_at(0.5f, place_at(0.5f));
    shapes.add_steps(moving);
    if (moves) moving.instances[0].motion_index = add_motion(moving, steps_of(place_at, 2));
    expect_mean_of_stills([&](float t) { return scene_at(t, place_at(moves ? t : 0.5f)); }, moving);
  }
}

TEST(MotionBlur, OfADisplacedMeshThatDeformsIsTheMeanOfStills)
{
  const auto shape = [](float step) {
    Mesh mesh = sphere_mesh(0.4f, kColumns, kRows, true);
    for (std::size_t v = 0; v < mesh.P.size(); ++v) {
      Vec3f& P = mesh.P[v];
      P = {P.x * (1 + 0.5f * step), P.y + 0.4f * P.x * step * step, P.z};
      const Vec3f N = as_vector(mesh.N[v]);
      mesh.N[v] = as_normal({N.x, N.y + 0.4f * N.x * step, N.z});
    }
    return mesh;
  };
  const Shapes shapes{shape(0), shape(1), shape(2)};
  for (const bool moves : {false, true}) {
    SCOPED_TRACE(moves);
    Scene moving = displaced_sphere_scene(shapes.at(0.5f), place_at(0.5f));
    shapes.add_steps(moving);
    if (moves) moving.instances[0].motion_index = add_motion(moving, steps_of(place_at, 2));
    expect_mean_of_stills([&](float t) { return displaced_sphere_scene(shapes.at(t), place_at(moves ? t : 0.5f)); },
                          moving);
  }
}

/// A grey PNG of 8 × 8 texels, two waves by one.
constexpr const char* kWavesPng =
    "data:image/png;base64,"
    "iVBORw0KGgoAAAANSUhEUgAAAAgAAAAICAAAAADhZOFXAAAAJUlEQVR42mNYtCgmBoQZLl3S0QFhBAMuBaEWLWKASF"
    "y6hGDApAB3hB/BGNGTdQAAAABJRU5ErkJggg==";

TEST(MotionBlur, OfADisplacedMorphOfAFileIsTheMeanOfItsFrames)
{
  GltfBuilder b = square_scene();
  const int corner = b.accessor<float>({-1, 0.5f, 0, 0, 0, 0, 0.5f, 0, 0, 0, 0, 1}, "VEC3");
  const int tilt = b.accessor<float>({-0.5f, 0, 0, 0, 0, 0, 0, 0.5f, 0, 0, 0, 0}, "VEC3");
  b.json["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", corner}, {"NORMAL", tilt}}};
  b.json["extensions"]["RELIEF_render"] = {{"fps", 1}};
  const int times = b.accessor<float>({0, 10}, "SCALAR"), weights = b.accessor<float>({0, 1}, "SCALAR");
  b.json["animations"] = {{{"samplers", {{{"input", times}, {"output", weights}}}},
                           {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "weights"}}}}}}}};
  b.push("images", {{"uri", kWavesPng}});
  b.push("textures", {{"source", 0}});
  b.push("materials",
         {{"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}, {"scale", 0.3f}}}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  // Those that a file without any gets follow what there is in a frame.
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.6f}, {"znear", 0.01f}}}});
  b.root_node({{"camera", 0}, {"translation", {0.3f, 0.5f, 3}}});
  b.json["extensions"]["KHR_lights_punctual"] = {{"lights", {{{"type", "directional"}, {"intensity", 3}}}}};
  b.root_node({{"rotation", {0, 0.383f, 0, 0.924f}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  const auto frame = [&](float number, float shutter) {
    LoadOptions options;
    options.has_frame = true;
    options.frame = static_cast<double>(number);
    options.camera.shutter = shutter;
    return load(b, options);
  };
  constexpr float kShutter = 8;
  const Scene moving = frame(5, kShutter);
  ASSERT_FALSE(moving.meshes.at(0).steps.empty());
  for (const std::string& warning : moving.warnings) EXPECT_EQ(warning.find("deform"), std::string::npos) << warning;
  expect_mean_of_stills([&](float t) { return frame(5 + kShutter * (t - 0.5f), 0); }, moving, {}, 512, 2e-3);
}

/// Computed heights are those of the middle: of a mesh that only shifts, the same at all times.
TEST(MotionBlur, OfACurvedMeshThatShiftsIsTheMeanOfStills)
{
  const auto shape = [](float step) {
    Mesh mesh = sphere_mesh(0.4f, kColumns, kRows, true);
    for (Vec3f& P : mesh.P) P += Vec3f{0.5f * (step - 1), 0.2f * step * step, 0};
    return mesh;
  };
  const Shapes shapes{shape(0), shape(1), shape(2)};
  const auto scene_at = [&](float t) { return displaced_sphere_scene(shapes.at(t), {}, true); };
  Scene moving = scene_at(0.5f);
  shapes.add_steps(moving);
  expect_mean_of_stills(scene_at, moving);
}

TEST(MotionBlur, OfCausticsIsTheMeanOfStills)
{
  const auto lamp = [](float t) { return Vec3f{0.5f - t, 2, 0}; };
  const auto ball = [](float t) { return Affine3{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-0.3f + 0.6f * t, 0.6f, 0}}; };
  const auto scene_at = [&](float t) {
    Scene scene = empty_scene();
    add_floor(scene, 2);
    add_caster(scene, sphere_mesh(0.3f, 48, 24, true), glass_material(), ball(t));
    scene.lights.push_back(square_light(lamp(t), {0, -1, 0}, 0.1f, 50));
    look_down(scene, {0, 0, 0}, 1, 1.5f);
    return scene;
  };
  Scene moving = scene_at(0.5f);
  moving.instances[1].motion_index = add_motion(moving, steps_of(ball, 1));
  moving.lights[0].motion_index = add_motion(moving, lamp_steps(lamp, 0));
  const auto photons = [](RenderOptions& options) {
    options.settings.caustics.mode = CausticsMode::kOn;
    options.settings.caustics.photons = 2048;
    options.settings.caustics.radius = 0.05f;
    options.settings.caustics.alpha = 1;
  };
  // Few photons each, and all samples of a pass at one time.
  expect_mean_of_stills(scene_at, moving, photons, 64, 0.02);
}

TEST(MotionBlur, IsTheSameWhateverTheThreads)
{
  Scene moving = box_scene(place_at(0.5f));
  moving.instances[0].motion_index = add_motion(moving, steps_of(place_at, 2));
  const auto picture = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return render_scene(moving, render_options(moving, kSize, 16));
  };
  const Rendered a = picture(1), b = picture(4);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) ASSERT_EQ(a.radiance(x, y), b.radiance(x, y));
  }
}

}  // namespace
}  // namespace relief::test
