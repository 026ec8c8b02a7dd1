// Walks below surfaces, as whole renders: what comes out of a box is what walks of the plainest kind, in double precision, say.
#include <array>
#include <cmath>
#include <random>

#include "kernel/bsdf/subsurface.h"
#include "tests/support/loaded_scene.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

using nlohmann::json;

/// A cube of the given side about the origin, counter-clockwise from outside.
Mesh cube_mesh(float side)
{
  Mesh cube;
  const float h = 0.5f * side;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float sign : {-1.0f, 1.0f}) {
      float n[3] = {}, u[3] = {}, v[3] = {};
      n[axis] = sign * h;
      u[(axis + 1) % 3] = side;
      v[(axis + 2) % 3] = sign * side;
      const Vec3f N{n[0], n[1], n[2]}, U{u[0], u[1], u[2]}, V{v[0], v[1], v[2]};
      const Mesh face = quad_mesh(N - 0.5f * (U + V), U, V);
      const auto first = static_cast<std::uint32_t>(cube.P.size());
      cube.P.insert(cube.P.end(), face.P.begin(), face.P.end());
      for (const TriangleIndices t : face.triangles) {
        cube.triangles.push_back({first + t.v0, first + t.v1, first + t.v2});
      }
    }
  }
  return cube;
}

/// White surroundings, and a cube of side 1 before a camera that sees one face from straight above, all of it.
/// @param closure  all that the cube's material is
Scene cube_of(const json& closure)
{
  GltfBuilder b;
  const std::vector<float> P{0, 0, 0, 1, 0, 0, 0, 1, 0};
  b.mesh({{"attributes", {{"POSITION", b.accessor(P, "VEC3")}}}, {"material", 0}});
  b.push("materials", {{"extensions", {{"RELIEF_surface", {{"closures", json::array({closure})}}}}}});
  b.root_node({{"mesh", 0}});
  Scene scene = load(b);
  EXPECT_TRUE(scene.materials.front().scatters_below);
  Mesh cube = cube_mesh(1);
  cube.material_index = scene.meshes.front().material_index;
  scene.meshes = {cube};
  scene.environment = {};
  scene.environment.color = {1, 1, 1};
  scene.lights.clear();
  scene.cameras = empty_scene().cameras;
  Camera& camera = scene.cameras.front().camera;
  camera.projection = Projection::kOrthographic;
  camera.half_width = camera.half_height = 0.499f;
  scene.render.filter = PixelFilter::kBox;
  scene.render.filter_width = 1;
  return scene;
}

/// Unit vectors that with a unit D make a frame.
std::array<std::array<double, 3>, 2> across(const std::array<double, 3>& D)
{
  const std::size_t least = std::abs(D[0]) < 0.6 ? 0 : 1;
  std::array<double, 3> s{}, t{};
  s[least] = 1;
  const double along = D[least];
  double length = 0;
  for (std::size_t i = 0; i < 3; ++i) length += (s[i] -= along * D[i]) * s[i];
  for (double& x : s) x /= std::sqrt(length);
  for (std::size_t i = 0; i < 3; ++i) t[i] = D[(i + 1) % 3] * s[(i + 2) % 3] - D[(i + 2) % 3] * s[(i + 1) % 3];
  return {s, t};
}

/// Light that leaves the cube where the camera sees it, by walks that choose flights and directions as the medium does.
/// @param free_path  metres, of the even medium that is as good as the anisotropic one after ten steps
/// @param g          of Henyey and Greenstein
double walked(double free_path, double single_albedo, double g)
{
  constexpr int kWalks = 100000;
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> u(0, 1);
  double sum = 0;
  for (int walk = 0; walk < kWalks; ++walk) {
    std::array<double, 3> P{u(random) - 0.5, u(random) - 0.5, 0.5}, D{0, 0, -1};
    double carried = 1;
    for (int step = 0; step < 256; ++step) {
      const bool is_even = step >= 10;
      // Of the one who comes in, by Lambert's law.
      double cosine = std::sqrt(u(random));
      if (step > 0) cosine = 2 * u(random) - 1;
      if (step > 0 && !is_even && g != 0) {
        const double k = (1 - g * g) / (1 + g * cosine);
        cosine = (1 + g * g - k * k) / (2 * g);
      }
      const double r = std::sqrt(std::max(1 - cosine * cosine, 0.0)), phi = 2 * M_PI * u(random);
      const auto [s, t] = across(D);
      for (std::size_t i = 0; i < 3; ++i) D[i] = cosine * D[i] + r * (std::cos(phi) * s[i] + std::sin(phi) * t[i]);
      const double sigma = 1 / (free_path * (1 - g));
      const double sigma_s = sigma * single_albedo * (is_even ? 1 - g : 1);
      const double sigma_t = sigma * (1 - single_albedo) + sigma_s;
      const double way = -std::log(1 - u(random)) / sigma_t;
      bool is_out = false;
      for (std::size_t i = 0; i < 3; ++i) {
        P[i] += way * D[i];
        is_out = is_out || std::abs(P[i]) > 0.5;
      }
      if (is_out) {
        sum += carried;
        break;
      }
      carried *= sigma_s / sigma_t;
    }
  }
  return sum / kWalks;
}

/// The same by a profile: what it holds over the cube's faces, seen along the three axes of Cycles' probes, whose tangents lie across
/// the diagonal (1, 1, -1) and so at 45 degrees to the four sides. Densities are of distances.
double profiled(double free_path)
{
  constexpr int kPoints = 1000000;
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> u(0, 1);
  const double end = 16 * free_path, whole = 1 - 0.25 * std::exp(-16.0) - 0.75 * std::exp(-16.0 / 3);
  const auto density = [&](double r) {
    return r < end ? (std::exp(-r / free_path) + std::exp(-r / (3 * free_path))) / (4 * free_path * whole) : 0.0;
  };
  double sum = 0;
  for (int point = 0; point < kPoints; ++point) {
    const std::array<double, 2> P{u(random) - 0.5, u(random) - 0.5};
    const double r = end * u(random), phi = 2 * M_PI * u(random);
    const double a = r * std::cos(phi), b = r * std::sin(phi);
    // Straight down: the face itself, and the one below.
    if (std::abs(P[0] + a) < 0.5 && std::abs(P[1] + b) < 0.5) sum += density(r) + density(std::sqrt(r * r + 1));
    // Along both tangents: b is the depth, a the way across.
    for (const double sign : {-1.0, 1.0}) {
      const std::array<double, 2> along{std::sqrt(0.5), sign * std::sqrt(0.5)};
      const std::array<double, 2> from{P[0] - along[1] * a, P[1] + along[0] * a};
      if (b < 0 || b > 1) continue;
      for (std::size_t i = 0; i < 2; ++i) {
        for (const double side : {-0.5, 0.5}) {
          const double t = (side - from[i]) / along[i];
          if (std::abs(from[1 - i] + t * along[1 - i]) >= 0.5) continue;
          // Half of each tangent's, over the cosine of 45 degrees.
          sum += std::sqrt(0.5) * density(std::sqrt(t * t + r * r));
        }
      }
    }
  }
  return sum / kPoints * end;
}

RenderOptions options_for(const Scene& scene)
{
  RenderOptions options = render_options(scene, 16, 64);
  options.settings.max_bounces = 4;
  return options;
}

TEST(Subsurface, WhatLeavesACubeIsWhatPlainWalksSay)
{
  // A 4π-th of the radius is the free path.
  const Vec3f color{0.8f, 0.5f, 0.15f};
  const double free_path[3] = {0.4, 0.1, 0.25};
  json radius;
  for (const double path : free_path) radius.push_back(path * 4 * M_PI);
  for (const float g : {0.0f, 0.3f, 0.8f}) {
    const Scene scene = cube_of({{"type", "subsurface"},
                                 {"method", "random-walk-legacy"},
                                 {"color", {color.x, color.y, color.z}},
                                 {"anisotropy", g},
                                 {"radius", radius}});
    for (int channel = 0; channel < 3; ++channel) {
      const float albedo = channel == 0 ? color.x : channel == 1 ? color.y : color.z;
      const double single = static_cast<double>(subsurface_single_albedo(albedo, g));
      const double expected = walked(free_path[channel], single, static_cast<double>(g));
      const Estimate found = estimate_mean(scene, options_for(scene), 8, channel);
      // 5 standard errors, and those of the walks.
      EXPECT_NEAR(found.mean, expected, 5 * found.standard_error + 0.005 * expected) << g << " " << channel;
      EXPECT_LT(found.standard_error, 0.01);
    }
  }
}

TEST(Subsurface, WhatLeavesACubeByAProfileIsWhatItsFacesHold)
{
  for (const double free_path : {0.02, 0.1, 0.3}) {
    const double radius = free_path * 4 * M_PI;
    const Scene scene = cube_of({{"type", "subsurface"},
                                 {"method", "christensen-burley"},
                                 {"color", {0.8, 0.5, 0.05}},
                                 {"radius", {radius, 0, radius}}});
    const double expected = profiled(free_path);
    const Estimate red = estimate_mean(scene, options_for(scene), 8, 0);
    EXPECT_NEAR(red.mean, 0.8 * expected, 5 * red.standard_error + 0.004 * expected) << free_path;
    EXPECT_LT(red.standard_error, 0.01);
    // Without a radius light leaves where it has entered.
    const Estimate green = estimate_mean(scene, options_for(scene), 8, 1);
    EXPECT_NEAR(green.mean, 0.5, 5 * green.standard_error + 1e-4) << free_path;
  }
}

/// White things in white surroundings cannot be seen, whichever way light scatters in them.
TEST(Subsurface, WhiteKeepsItsEnergy)
{
  for (const char* method : {"random-walk", "random-walk-legacy", "random-walk-skin"}) {
    for (const char* maths : {"3.4", "4.3"}) {
      for (const double anisotropy : {0.0, 0.7}) {
        // Of white things skin takes a 577th of the radius for the free path, the older walk a 4π-th.
        const double radius = method == std::string("random-walk-skin") ? 200 : 4;
        const Scene scene = cube_of({{"type", "subsurface"},
                                     {"maths", maths},
                                     {"method", method},
                                     {"color", {1, 1, 1}},
                                     {"radius", {radius, radius, radius}},
                                     {"anisotropy", anisotropy}});
        const Estimate found = estimate_mean(scene, options_for(scene), 4);
        // A thousandth of the walks are longer than 256 steps, where paths are short.
        EXPECT_NEAR(found.mean, 1, 5 * found.standard_error + 0.002) << method << " " << maths << " " << anisotropy;
      }
    }
  }
}

/// Channels whose radius is nothing have nothing to walk in.
TEST(Subsurface, RadiiOfNothingAreDiffuse)
{
  const Scene below =
      cube_of({{"type", "subsurface"}, {"color", {0.6, 0.6, 0.6}}, {"radius", {0, 0, 0}}});
  const Estimate found = estimate_mean(below, options_for(below), 4);
  EXPECT_NEAR(found.mean, 0.6, 5 * found.standard_error + 1e-4);
}

/// What stands in the object is passed, and its like as well.
TEST(Subsurface, PathsKnowNoOtherObject)
{
  const json wax{{"type", "subsurface"}, {"color", {0.7, 0.7, 0.7}}, {"radius", {0.4, 0.4, 0.4}}};
  const Scene alone = cube_of(wax);
  Scene filled = cube_of(wax);
  Instance inner = filled.instances.front();
  inner.object_index = -1;
  inner.world_from_object.x *= 0.5f;
  inner.world_from_object.y *= 0.5f;
  inner.world_from_object.z *= 0.5f;
  filled.instances.push_back(inner);
  const Rendered a = render_scene(alone, options_for(alone)), b = render_scene(filled, options_for(filled));
  EXPECT_NEAR(a.mean(), b.mean(), 1e-3 * a.mean());
}

/// A copy that was left in place of an object: files of real life have some. Where the copy's hits stood before the object's, the
/// object had none, and was black.
TEST(Subsurface, PathsKnowNoCopyOnTheObject)
{
  for (const char* method : {"random-walk", "christensen-burley"}) {
    const Scene alone =
        cube_of({{"type", "subsurface"}, {"method", method}, {"color", {0.7, 0.7, 0.7}}, {"radius", {0.4, 0.4, 0.4}}});
    Scene doubled = alone;
    Instance copy = doubled.instances.front();
    copy.object_index = -1;
    doubled.instances.push_back(copy);
    const Rendered a = render_scene(alone, options_for(alone)), b = render_scene(doubled, options_for(doubled));
    EXPECT_NEAR(a.mean(), b.mean(), 1e-3 * a.mean()) << method;
  }
}

/// However many there are: walks used to be given up behind the 64th.
TEST(Subsurface, PathsPassAnyNumberOfObjects)
{
  const json wax{{"type", "subsurface"}, {"color", {0.7, 0.7, 0.7}}, {"radius", {4, 4, 4}}};
  const Scene alone = cube_of(wax);
  Scene filled = cube_of(wax);
  for (int i = 0; i < 60; ++i) {
    Instance inner = alone.instances.front();
    inner.object_index = -1;
    const float scale = 0.9f - 0.01f * static_cast<float>(i);
    for (Vec3f* axis : {&inner.world_from_object.x, &inner.world_from_object.y, &inner.world_from_object.z})
      *axis *= scale;
    filled.instances.push_back(inner);
  }
  const Rendered a = render_scene(alone, options_for(alone)), b = render_scene(filled, options_for(filled));
  EXPECT_NEAR(a.mean(), b.mean(), 1e-3 * a.mean());
}

}  // namespace
}  // namespace relief::test
