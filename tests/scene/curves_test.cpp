// RELIEF_curves: lines of a file as the segments of curves, and what of them is dropped.
#include <gtest/gtest.h>

#include "tests/support/loaded_scene.h"

namespace relief {
namespace {

using nlohmann::json;
using test::GltfBuilder;
using test::has_warning;

Scene load_lines(GltfBuilder& b, json primitive, const std::string& shape = "tubes")
{
  primitive["extensions"] = {{"RELIEF_curves", {{"shape", shape}}}};
  b.root_node({{"mesh", b.mesh(primitive)}});
  const test::TemporaryFolder folder;
  return scene_load(folder.write("scene.glb", b.glb()));
}

const std::vector<float> kFivePoints{0, 0, 0, 1, 0, 0, 2, 1, 0, 5, 0, 0, 6, 0, 0};

TEST(Curves, LinesThatMeetAreOneCurve)
{
  GltfBuilder b;
  const int P = b.accessor(kFivePoints, "VEC3");
  const int radius = b.accessor(std::vector<float>{.5f, .4f, .3f, .2f, .1f}, "SCALAR");
  const int uv = b.accessor(std::vector<float>{0, 0, 0, .1f, 0, .2f, 1, .3f, 1, .4f}, "VEC2");
  const int indices = b.accessor<std::uint16_t>({0, 1, 1, 2, 3, 4}, "SCALAR");
  const Scene scene = load_lines(
      b,
      {{"mode", 1}, {"attributes", {{"POSITION", P}, {"_RADIUS", radius}, {"TEXCOORD_0", uv}}}, {"indices", indices}});
  const Mesh& mesh = scene.meshes.at(0);
  EXPECT_FALSE(mesh.are_ribbons);
  // Each curve's ends stand twice: 0 0 1 2 2 and 3 3 4 4.
  ASSERT_EQ(mesh.P.size(), 9u);
  const std::vector<float> radii{.5f, .5f, .4f, .3f, .3f, .2f, .2f, .1f, .1f};
  EXPECT_EQ(mesh.radius, radii);
  EXPECT_EQ(mesh.uv[0].at(8), (Vec2f{1, .4f}));
  ASSERT_EQ(mesh.triangles.size(), 3u);
  const std::uint32_t first[] = {1, 2, 6};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(mesh.triangles[i].v0, first[i]);
    EXPECT_EQ(mesh.triangles[i].v1, first[i] + 1);
    EXPECT_EQ(mesh.triangles[i].v2, first[i]);
  }
}

TEST(Curves, AStripIsOneAndALoopComesBack)
{
  for (const int mode : {2, 3}) {
    GltfBuilder b;
    const int P = b.accessor(kFivePoints, "VEC3");
    const int radius = b.accessor(std::vector<float>(5, 1.0f), "SCALAR");
    const Scene scene =
        load_lines(b, {{"mode", mode}, {"attributes", {{"POSITION", P}, {"_RADIUS", radius}}}}, "ribbons");
    EXPECT_TRUE(scene.meshes.at(0).are_ribbons);
    EXPECT_EQ(scene.meshes.at(0).triangles.size(), mode == 2 ? 5u : 4u);
  }
}

TEST(Curves, WhatHasNoLengthOrNoWidthIsDropped)
{
  GltfBuilder b;
  // A point twice within a curve, a curve of one place, and one of radius 0.
  const int P =
      b.accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 1, 0, 0, 2, 0, 0, 7, 7, 7, 7, 7, 7, 0, 5, 0, 1, 5, 0}, "VEC3");
  const int radius = b.accessor(std::vector<float>{1, 1, 1, 1, 1, 1, 0, 0}, "SCALAR");
  const int indices = b.accessor<std::uint16_t>({0, 1, 1, 2, 2, 3, 4, 5, 6, 7}, "SCALAR");
  const Scene scene =
      load_lines(b, {{"mode", 1}, {"attributes", {{"POSITION", P}, {"_RADIUS", radius}}}, {"indices", indices}});
  EXPECT_EQ(scene.meshes.at(0).triangles.size(), 2u);
  EXPECT_TRUE(has_warning(scene, "2 curves without a length or a width"));
}

TEST(Curves, TheyAreNeitherDisplacedNorCastersOfCaustics)
{
  GltfBuilder b;
  b.json["materials"] = {
      {{"pbrMetallicRoughness", {{"metallicFactor", 1}, {"roughnessFactor", 0}}},
       {"extensions",
        {{"RELIEF_displacement",
          {{"heightGraph", {{"nodes", json::array()}, {"outputs", {{"height", 1}}}}}, {"scale", .1}}}}}}};
  const int P = b.accessor(kFivePoints, "VEC3");
  const int radius = b.accessor(std::vector<float>(5, 1.0f), "SCALAR");
  const Scene scene =
      load_lines(b, {{"mode", 3}, {"material", 0}, {"attributes", {{"POSITION", P}, {"_RADIUS", radius}}}});
  const Instance& instance = scene.instances.at(0);
  EXPECT_LT(scene.materials.at(static_cast<std::size_t>(instance.material_index)).displacement_index, 0);
  EXPECT_EQ(instance.flags & (kCausticCaster | kCausticReceiver), 0u);
}

TEST(Points, AreBallsEachOnceAndThoseOfRadius0AreDropped)
{
  GltfBuilder b;
  const int P = b.accessor(kFivePoints, "VEC3");
  const int radius = b.accessor(std::vector<float>{1, .5f, 0, 2, 3}, "SCALAR");
  const int indices = b.accessor<std::uint16_t>({1, 2, 3, 1}, "SCALAR");
  json primitive = {{"mode", 0}, {"attributes", {{"POSITION", P}, {"_RADIUS", radius}}}, {"indices", indices}};
  primitive["extensions"]["RELIEF_points"] = json::object();
  b.root_node({{"mesh", b.mesh(primitive)}});
  const test::TemporaryFolder folder;
  const Scene scene = scene_load(folder.write("scene.glb", b.glb()));
  const Mesh& mesh = scene.meshes.at(0);
  EXPECT_TRUE(mesh.are_points);
  EXPECT_EQ(mesh.P, (std::vector<Vec3f>{{1, 0, 0}, {5, 0, 0}}));
  EXPECT_EQ(mesh.radius, (std::vector<float>{.5f, 2}));
  EXPECT_EQ(mesh.triangles.size(), 2u);
  EXPECT_EQ(mesh.triangles[1].v2, 1u);
  EXPECT_TRUE(has_warning(scene, "1 points of radius 0"));
}

TEST(Points, OfTrianglesAreAnError)
{
  GltfBuilder b;
  const int P = b.accessor(kFivePoints, "VEC3");
  json primitive = {{"mode", 5}, {"attributes", {{"POSITION", P}}}};
  primitive["extensions"]["RELIEF_points"] = json::object();
  b.root_node({{"mesh", b.mesh(primitive)}});
  const test::TemporaryFolder folder;
  try {
    static_cast<void>(scene_load(folder.write("scene.glb", b.glb())));
    FAIL();
  } catch (const SceneError& error) {
    EXPECT_EQ(error.json_path, "/meshes/0/primitives/0/mode");
    EXPECT_EQ(error.expected, "points (0)");
  }
}

TEST(Points, WithoutTheExtensionAreNotRendered)
{
  GltfBuilder b;
  const int P = b.accessor(kFivePoints, "VEC3");
  b.root_node({{"mesh", b.mesh({{"mode", 0}, {"attributes", {{"POSITION", P}}}})}});
  const test::TemporaryFolder folder;
  EXPECT_TRUE(has_warning(scene_load(folder.write("scene.glb", b.glb())), "RELIEF_points"));
}

TEST(Curves, RadiiBelowNothingAreErrors)
{
  GltfBuilder b;
  const int P = b.accessor(kFivePoints, "VEC3");
  const int radius = b.accessor(std::vector<float>{1, 1, -2, 1, 1}, "SCALAR");
  try {
    load_lines(b, {{"mode", 3}, {"attributes", {{"POSITION", P}, {"_RADIUS", radius}}}});
    FAIL();
  } catch (const SceneError& error) {
    EXPECT_NE(std::string(error.what()).find("/meshes/0/primitives/0/attributes/_RADIUS"), std::string::npos)
        << error.what();
    EXPECT_NE(std::string(error.what()).find("position 2"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace relief
