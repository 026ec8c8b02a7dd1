// The camera of files that have none.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "scene/framing.h"
#include "tests/support/loaded_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

/// Part of the window's half width and half height that points reach; 1: the edge. Infinite for what is behind.
struct Reach {
  float left = -kInfinity, right = -kInfinity, bottom = -kInfinity, top = -kInfinity;

  void add(const Camera& camera, Vec3f P)
  {
    const Vec3f q = transform_point(inverse(camera.world_from_camera), P);
    const float x = q.z < 0 ? q.x / -q.z / camera.half_width : kInfinity;
    const float y = q.z < 0 ? q.y / -q.z / camera.half_height : kInfinity;
    left = std::max(left, -x), right = std::max(right, x), bottom = std::max(bottom, -y), top = std::max(top, y);
  }
  float most() const { return std::max({left, right, bottom, top}); }
  /// Part of the picture that is filled in the tighter direction.
  float filled() const { return std::max(left + right, bottom + top) / 2; }
};

Reach reach_of(const Scene& scene)
{
  Reach reach;
  for (const Instance& instance : scene.instances) {
    for (const Vec3f p : scene.meshes[static_cast<std::size_t>(instance.mesh_index)].P) {
      reach.add(scene.cameras.at(0).camera, transform_point(instance.world_from_object, p));
    }
  }
  return reach;
}

TEST(Framing, FillsThePictureInTheTighterDirection)
{
  GltfBuilder b = square_scene();
  b.root_node({{"mesh", 0}, {"translation", {30, 10, -20}}, {"scale", {4, 9, 1}}});
  for (const float aspect : {0.2f, 1.0f, 1.78f, 5.0f}) {
    LoadOptions options;
    options.camera.image_aspect = aspect;
    const Scene scene = load(b, options);
    ASSERT_EQ(scene.cameras.size(), 1u);
    EXPECT_NEAR(scene.cameras[0].camera.half_width / scene.cameras[0].camera.half_height, aspect, 1e-4f);
    EXPECT_NEAR(reach_of(scene).filled(), 0.88f, 1e-3f) << aspect;
    EXPECT_LT(reach_of(scene).most(), 0.9f) << aspect;
    EXPECT_TRUE(std::any_of(scene.warnings.begin(), scene.warnings.end(),
                            [](const std::string& w) { return w.find("no camera") != std::string::npos; }));
  }
}

TEST(Framing, FollowsTheShapeNotItsBox)
{
  for (const Affine3& m : {Affine3{}, Affine3{{3, 1, 0}, {0, 0.1f, 0.2f}, {0, 0, -40}, {1e4f, -1e4f, 3}}}) {
    const Mesh ball = sphere_mesh(2, 200, 100, true);
    Framing framing(0, 1.5f);
    framing.add(m, extreme_points(ball.P));
    Reach reach;
    for (const Vec3f p : ball.P) reach.add(framing.camera().camera, transform_point(m, p));
    EXPECT_GT(reach.filled(), 0.87f);
    EXPECT_LT(reach.most(), 0.92f);
  }
}

TEST(Framing, ExtremePointsAreOfTheMesh)
{
  const Mesh ball = sphere_mesh(1, 200, 100, true);
  const std::vector<Vec3f> points = extreme_points(ball.P);
  EXPECT_LE(points.size(), 128u);
  EXPECT_GT(points.size(), 100u);
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 1000; ++i) {
    const Vec3f d = normalize(Vec3f{normal(random), normal(random), normal(random)});
    float farthest = 0;
    for (const Vec3f p : points) farthest = std::max(farthest, dot(p, d));
    EXPECT_GT(farthest, 0.97f);
  }
}

TEST(Framing, PointsLinesAndNothingHaveACamera)
{
  const Vec3f axis = normalize(Vec3f{0.5f, 0.4f, 1.0f});
  for (const std::vector<Vec3f>& points :
       {std::vector<Vec3f>{}, std::vector<Vec3f>{{1e6f, 2, 3}}, std::vector<Vec3f>{axis * -5.0f, axis * 7.0f}}) {
    Framing framing(0, 1);
    framing.add({}, points);
    const Camera camera = framing.camera().camera;
    EXPECT_TRUE(is_finite(camera.world_from_camera.p));
    EXPECT_GT(camera.focus_distance, 0);
    Reach reach;
    for (const Vec3f p : points) reach.add(camera, p);
    EXPECT_LT(reach.most(), 0.9f) << points.size();
  }
}

/// A square that moves 10 m within two seconds, beside one that stands.
GltfBuilder moving_square()
{
  GltfBuilder b = square_scene();
  b.root_node({{"mesh", 0}, {"translation", {0, 0, -3}}});
  const int times = b.accessor<float>({0, 2}, "SCALAR");
  const int places = b.accessor<float>({0, 0, 0, 10, 0, 0}, "VEC3");
  b.json["animations"] = {{{"samplers", {{{"input", times}, {"output", places}}}},
                           {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}}};
  return b;
}

TEST(Framing, IsOneForAllFramesSoThatWhatMovesIsSeenToMove)
{
  Reach reach;
  Affine3 first;
  for (const double frame : {0, 1, 24, 48, 100}) {
    LoadOptions options;
    options.has_frame = true;
    options.frame = frame;
    const Scene scene = load(moving_square(), options);
    const Affine3& camera = scene.cameras.at(0).camera.world_from_camera;
    if (frame == 0) first = camera;
    EXPECT_EQ(camera.p, first.p) << frame;
    EXPECT_EQ(camera.z, first.z) << frame;
    for (const Instance& instance : scene.instances) {
      for (const Vec3f p : scene.meshes[0].P) {
        reach.add(scene.cameras[0].camera, transform_point(instance.world_from_object, p));
      }
    }
  }
  EXPECT_NEAR(reach.filled(), 0.88f, 1e-3f);
  EXPECT_LT(reach.most(), 0.9f);
  // Without a frame it is the rest pose that fills the picture.
  EXPECT_NEAR(reach_of(load(moving_square())).filled(), 0.88f, 1e-3f);
}

TEST(Framing, LeavesRoomForDisplacement)
{
  GltfBuilder b = square_scene();
  b.json["images"] = {{{"uri", kGreyPixelPng}}};
  b.json["textures"] = {{{"source", 0}}};
  b.push(
      "materials",
      {{"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}, {"scale", 2}, {"midlevel", 0}}}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  const Scene scene = load(b);
  Reach reach = reach_of(scene);
  const float height = height_map_range(scene.height_maps.at(0).view()).high;
  for (const Vec3f p : scene.meshes[0].P) reach.add(scene.cameras[0].camera, p + Vec3f{0, 0, 2 * height});
  EXPECT_LT(reach.most(), 0.9f);
}

TEST(Framing, LeavesRoomForHeightsInMetres)
{
  GltfBuilder b = square_scene();
  // One texel of Radiance's format: 128 / 256 · 2^(131 − 128) = 4.
  b.json["images"] = {{{"uri", "data:image/vnd.radiance;base64," +
                                   base64("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x80\x80\x83")}}};
  b.json["textures"] = {{{"source", 0}}};
  b.push(
      "materials",
      {{"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}, {"scale", 1}, {"midlevel", 0}}}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  const Scene scene = load(b);
  ASSERT_EQ(scene.height_maps.size(), 1u);
  EXPECT_EQ(scene.displacements[0].height.texture_index, 0);
  Reach reach = reach_of(scene);
  for (const Vec3f p : scene.meshes[0].P) reach.add(scene.cameras[0].camera, p + Vec3f{0, 0, 4});
  EXPECT_LT(reach.most(), 0.9f);
}

TEST(LookFrom, LooksAtThePointOrTheMiddle)
{
  GltfBuilder b = square_scene();
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 0.1}}}});
  b.root_node({{"camera", 0}});
  LoadOptions options;
  options.camera.look_from = Vec3f{0.5f, 0.5f, 7};
  const Scene middle = load(b, options);
  ASSERT_EQ(middle.cameras.size(), 1u);
  const auto is_near = [](Vec3f a, Vec3f expected) { return length(a - expected) < 1e-5f; };
  EXPECT_TRUE(is_near(middle.cameras[0].camera.world_from_camera.z, {0, 0, 1}));
  EXPECT_FLOAT_EQ(middle.cameras[0].camera.half_height, std::tan(kPi / 9));
  options.camera.look_at = Vec3f{-2.5f, 0.5f, 3};
  options.camera.fov = 90;
  const Camera camera = load(b, options).cameras.at(0).camera;
  EXPECT_TRUE(is_near(camera.world_from_camera.z, normalize(Vec3f{3, 0, 4})));
  EXPECT_TRUE(is_near(camera.world_from_camera.y, {0, 1, 0}));
  EXPECT_TRUE(is_near(camera.world_from_camera.p, {0.5f, 0.5f, 7}));
  EXPECT_FLOAT_EQ(camera.half_height, 1);
  EXPECT_FLOAT_EQ(camera.focus_distance, 5);
}

TEST(LookFrom, StraightUpAndDownHaveAFrame)
{
  for (const float y : {-5.0f, 5.0f}) {
    const Camera camera = look_camera({0, y, 0}, {0, 0, 0}, 0, 1).camera;
    const Affine3& m = camera.world_from_camera;
    EXPECT_LT(length(cross(m.x, m.y) - m.z), 1e-6f);
    EXPECT_FLOAT_EQ(m.z.y, y / 5);
    EXPECT_FLOAT_EQ(m.x.x, 1);
  }
  const Camera same = look_camera({1, 1, 1}, {1, 1, 1}, 0, 1).camera;
  EXPECT_EQ(same.world_from_camera.z, (Vec3f{0, 0, 1}));
  EXPECT_GT(same.focus_distance, 0);
}

}  // namespace
}  // namespace relief::test
