// Morph targets: weights of meshes, nodes and animations, at rest, at a frame and while the shutter is open.
#include <gtest/gtest.h>

#include "tests/support/loaded_scene.h"

namespace relief::test {
namespace {

/// A square with two targets: one moves its first vertex along x, the other all of it along z and tilts its normals.
GltfBuilder square_with_targets()
{
  GltfBuilder b = square_scene();
  const int first = b.accessor<float>({1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC3");
  const int all = b.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int tilt = b.accessor<float>({1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0}, "VEC3");
  b.json["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", first}}, {{"POSITION", all}, {"NORMAL", tilt}}};
  return b;
}

/// Weights that go from (0, 0) to (10, 1) in ten frames of 1 s.
void animate(GltfBuilder& b, const char* interpolation = "LINEAR")
{
  b.json["extensions"]["RELIEF_render"] = {{"fps", 1}};
  const int times = b.accessor<float>({0, 10}, "SCALAR");
  const int weights = b.accessor<float>({0, 0, 10, 1}, "SCALAR");
  b.json["animations"] = {{{"samplers", {{{"input", times}, {"output", weights}, {"interpolation", interpolation}}}},
                           {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "weights"}}}}}}}};
}

LoadOptions frame(double number, float shutter = 0)
{
  LoadOptions options;
  options.has_frame = true;
  options.frame = number;
  options.camera.look_from = Vec3f{0, 0, 5};
  options.camera.shutter = shutter;
  return options;
}

TEST(MorphTargets, AreWithoutWeightsNothing)
{
  const Scene scene = load(square_with_targets());
  EXPECT_EQ(scene.meshes.at(0).P[0], (Vec3f{0, 0, 0}));
  EXPECT_TRUE(scene.meshes[0].steps.empty());
  EXPECT_FALSE(has_warning(scene, "morph"));
}

TEST(MorphTargets, AddUpByTheMeshsWeightsOrTheNodes)
{
  GltfBuilder b = square_with_targets();
  b.json["meshes"][0]["weights"] = {0.5, 2};
  const Scene of_mesh = load(b);
  EXPECT_EQ(of_mesh.meshes.at(0).P[0], (Vec3f{0.5f, 0, 2}));
  EXPECT_EQ(of_mesh.meshes[0].P[2], (Vec3f{1, 1, 2}));
  const Vec3f N = as_vector(of_mesh.meshes[0].N[0]);
  EXPECT_NEAR(length(N), 1, 1e-6f);
  EXPECT_NEAR(N.x / N.z, 2, 1e-5f);

  b.json["nodes"][0]["weights"] = {0, -1};
  EXPECT_EQ(load(b).meshes.at(0).P[0], (Vec3f{0, 0, -1}));
}

TEST(MorphTargets, MakeAMeshForEachSetOfWeights)
{
  GltfBuilder b = square_with_targets();
  for (const double weight : {1.0, 2.0, 1.0}) b.root_node({{"mesh", 0}, {"weights", {weight, 0}}});
  const Scene scene = load(b);
  ASSERT_EQ(scene.instances.size(), 4u);
  EXPECT_EQ(scene.meshes.size(), 3u);
  EXPECT_EQ(scene.instances[1].mesh_index, scene.instances[3].mesh_index);
  EXPECT_FLOAT_EQ(scene.meshes[static_cast<std::size_t>(scene.instances[2].mesh_index)].P[0].x, 2);
}

TEST(MorphTargets, FollowAnAnimation)
{
  GltfBuilder b = square_with_targets();
  animate(b);
  const Scene scene = load(b, frame(5));
  EXPECT_FLOAT_EQ(scene.meshes.at(0).P[0].x, 5);
  EXPECT_FLOAT_EQ(scene.meshes[0].P[3].z, 0.5f);
  animate(b, "STEP");
  EXPECT_FLOAT_EQ(load(b, frame(5)).meshes.at(0).P[0].x, 0);
  EXPECT_FLOAT_EQ(load(b, frame(10)).meshes.at(0).P[0].x, 10);
}

TEST(MorphTargets, DeformWhileTheShutterIsOpen)
{
  GltfBuilder b = square_with_targets();
  animate(b);
  const Scene scene = load(b, frame(5, 2));
  const Mesh& mesh = scene.meshes.at(0);
  ASSERT_EQ(mesh.steps.size(), 3u);
  for (int step = 0; step <= 2; ++step) {
    const MeshStep& at = mesh.steps[static_cast<std::size_t>(step)];
    ASSERT_EQ(at.P.size(), mesh.P.size());
    const float weight = 4 + static_cast<float>(step);
    EXPECT_FLOAT_EQ(at.P[0].x, weight);
    EXPECT_FLOAT_EQ(at.P[1].z, 0.1f * weight);
    const Vec3f N = as_vector(at.N[0]);
    EXPECT_NEAR(N.x / N.z, 0.1f * weight, 1e-5f);
  }
  EXPECT_FLOAT_EQ(scene.bounds_high.z, 0.6f);
  EXPECT_TRUE(scene.motions.empty());
  // After the last key nothing deforms.
  EXPECT_TRUE(load(b, frame(20, 2)).meshes.at(0).steps.empty());
}

TEST(MorphTargets, StayWithTheirVerticesWhereTangentsAreDerived)
{
  GltfBuilder b = square_with_targets();
  animate(b);
  b.push("images", {{"uri", kPixelPng}});
  b.push("textures", {{"source", 0}});
  b.push("materials", {{"normalTexture", {{"index", 0}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  const Scene scene = load(b, frame(5, 2));
  const Mesh& mesh = scene.meshes.at(0);
  ASSERT_FALSE(mesh.tangent.empty());
  ASSERT_EQ(mesh.steps.size(), 3u);
  for (std::size_t v = 0; v < mesh.P.size(); ++v) EXPECT_EQ(mesh.steps[1].P[v], mesh.P[v]);
  EXPECT_TRUE(mesh.columns.empty());
}

TEST(MorphTargets, SayWhatAGlowingMeshDoesAndNothingOfADisplacedOne)
{
  GltfBuilder b = square_with_targets();
  animate(b);
  b.push("images", {{"uri", kPixelPng}});
  b.push("textures", {{"source", 0}});
  b.push("materials", {{"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}}}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  EXPECT_FALSE(has_warning(load(b, frame(5, 2)), "deforms while the shutter is open"));
  b.json["materials"][0] = {{"emissiveFactor", {1, 1, 1}}};
  EXPECT_TRUE(has_warning(load(b, frame(5, 2)), "its light is found by chance alone"));
}

TEST(MorphTargets, ThatDoNotFitAreErrors)
{
  const auto message = [](const GltfBuilder& b) {
    try {
      load(b, frame(5));
    } catch (const SceneError& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  GltfBuilder fewer = square_with_targets();
  fewer.json["meshes"][0]["weights"] = {1, 1};
  fewer.json["meshes"][0]["primitives"][0]["targets"][1]["POSITION"] = fewer.accessor<float>({1, 1, 1}, "VEC3");
  EXPECT_NE(message(fewer).find("/meshes/0/primitives/0/targets/1/POSITION"), std::string::npos);

  GltfBuilder beyond = square_with_targets();
  beyond.json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = 99;
  EXPECT_NE(message(beyond).find("/meshes/0/primitives/0/targets/0/POSITION"), std::string::npos);

  GltfBuilder odd = square_with_targets();
  animate(odd);
  odd.json["animations"][0]["samplers"][0]["output"] = odd.accessor<float>({0, 1, 2}, "SCALAR");
  EXPECT_NE(message(odd).find("/animations/0/samplers/0/output"), std::string::npos);

  GltfBuilder huge = square_with_targets();
  huge.json["meshes"][0]["weights"] = {3e38, 0};
  EXPECT_NE(message(huge).find("/nodes/0"), std::string::npos);
}

}  // namespace
}  // namespace relief::test
