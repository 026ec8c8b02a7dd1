// What a loaded scene knows of the time while the shutter is open.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/loaded_scene.h"

namespace relief::test {
namespace {

/// A square that goes 10 m along x a second, and a camera; 10 frames a second.
GltfBuilder moving_square(const nlohmann::json& shutter)
{
  GltfBuilder b = square_scene();
  b.json["extensions"]["RELIEF_render"] = {{"fps", 10}};
  const int times = b.accessor<float>({0, 10}, "SCALAR");
  const int places = b.accessor<float>({0, 0, 0, 100, 0, 0}, "VEC3");
  b.json["animations"] = {{{"samplers", {{{"input", times}, {"output", places}}}},
                           {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}}};
  nlohmann::json camera = {{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}}};
  camera["extensions"]["RELIEF_camera"] = shutter;
  b.root_node({{"name", "camera"}, {"camera", b.push("cameras", camera)}, {"translation", {0, 0, 5}}});
  return b;
}

LoadOptions frame(double number)
{
  LoadOptions options;
  options.has_frame = true;
  options.frame = number;
  return options;
}

TEST(Shutter, IsClosedUnlessTheCameraSaysOtherwise)
{
  const Scene scene = load(moving_square(nlohmann::json::object()), frame(5));
  EXPECT_TRUE(scene.motions.empty());
  EXPECT_EQ(scene.instances[0].motion_index, -1);
  EXPECT_FLOAT_EQ(scene.instances[0].world_from_object.p.x, 5);
  EXPECT_FALSE(has_warning(scene, "shutter"));
}

/// Where the square is when the shutter opens, is half done, and closes.
void expect_places(const nlohmann::json& shutter, float opens, float half_done, float closes)
{
  const Scene scene = load(moving_square(shutter), frame(5));
  ASSERT_EQ(scene.motions.size(), 1u) << shutter;
  const std::vector<Affine3>& steps = scene.motions[static_cast<std::size_t>(scene.instances[0].motion_index)];
  EXPECT_NEAR(steps.front().p.x, opens, 1e-5f) << shutter;
  EXPECT_NEAR(steps.back().p.x, closes, 1e-5f) << shutter;
  EXPECT_NEAR(scene.instances[0].world_from_object.p.x, half_done, 1e-5f) << shutter;
  EXPECT_LE(scene.bounds_low.x, opens + 1e-5f);
  EXPECT_GE(scene.bounds_high.x, closes + 1 - 1e-5f);
}

TEST(Shutter, LiesAroundBeforeOrAfterItsFrame)
{
  expect_places({{"shutter", 0.5}}, 4.75f, 5, 5.25f);
  expect_places({{"shutter", 0.5}, {"shutterPosition", "center"}}, 4.75f, 5, 5.25f);
  expect_places({{"shutter", 0.5}, {"shutterPosition", "start"}}, 5, 5.25f, 5.5f);
  expect_places({{"shutter", 2}, {"shutterPosition", "end"}}, 3, 4, 5);
}

TEST(Shutter, HasAsManyStepsAsAreAskedFor)
{
  for (const int steps : {1, 3, 8}) {
    const Scene scene = load(moving_square({{"shutter", 1}, {"shutterSteps", steps}}), frame(5));
    const std::vector<Affine3>& places = scene.motions.at(0);
    ASSERT_EQ(places.size(), static_cast<std::size_t>(steps) + 1);
    for (int i = 0; i <= steps; ++i) {
      EXPECT_NEAR(places[static_cast<std::size_t>(i)].p.x, 4.5f + static_cast<float>(i) / static_cast<float>(steps),
                  1e-5f);
    }
  }
}

TEST(Shutter, OfTheCommandLineReplacesTheCameras)
{
  LoadOptions options = frame(5);
  options.camera.shutter = 0.0f;
  EXPECT_TRUE(load(moving_square({{"shutter", 0.5}}), options).motions.empty());
  options.camera.shutter = 2.0f;
  EXPECT_NEAR(load(moving_square(nlohmann::json::object()), options).motions.at(0)[0].p.x, 4, 1e-5f);
}

TEST(Shutter, IsThatOfTheCameraThatIsChosen)
{
  GltfBuilder b = moving_square({{"shutter", 0.5}});
  const nlohmann::json other = {{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}}};
  b.root_node({{"name", "other"}, {"camera", b.push("cameras", other)}});
  LoadOptions options = frame(5);
  options.camera.name = "other";
  EXPECT_TRUE(load(b, options).motions.empty());
  options.camera.name = "0";
  EXPECT_EQ(load(b, options).motions.size(), 1u);
}

TEST(Shutter, MovesWhatHangsFromWhatMoves)
{
  GltfBuilder b = moving_square({{"shutter", 0.5}});
  const int child = b.push("nodes", {{"mesh", 0}, {"translation", {0, 3, 0}}});
  b.json["nodes"][0]["children"] = {child};
  b.json["nodes"][1]["name"] = "still camera";
  const Scene scene = load(b, frame(5));
  ASSERT_EQ(scene.instances.size(), 2u);
  const Affine3& first = scene.motions.at(static_cast<std::size_t>(scene.instances[1].motion_index)).front();
  EXPECT_NEAR(first.p.x, 4.75f, 1e-5f);
  EXPECT_FLOAT_EQ(first.p.y, 3);
  EXPECT_EQ(scene.cameras[0].motion_index, -1);
}

TEST(Shutter, MovesACameraWithoutItsScale)
{
  GltfBuilder b = moving_square({{"shutter", 0.5}});
  b.json["nodes"][1]["scale"] = {2, 3, 4};
  b.json["animations"][0]["channels"][0]["target"]["node"] = 1;
  const Scene scene = load(b, frame(5));
  ASSERT_EQ(scene.motions.size(), 1u);
  EXPECT_EQ(scene.instances[0].motion_index, -1);
  const Affine3& last = scene.motions.at(static_cast<std::size_t>(scene.cameras[0].motion_index)).back();
  EXPECT_NEAR(last.p.x, 5.25f, 1e-5f);
  EXPECT_NEAR(length(last.z), 1, 1e-6f);
}

TEST(Shutter, LeavesStillWhatAnAnimationDoesNotMoveMeanwhile)
{
  // After its last key.
  EXPECT_TRUE(load(moving_square({{"shutter", 0.5}}), frame(200)).motions.empty());
}

TEST(Shutter, SaysWhatItCannotMove)
{
  GltfBuilder b = moving_square({{"shutter", 1}});
  b.json["animations"][0]["channels"][0]["target"]["path"] = "scale";
  const int flips = b.accessor<float>({1, 1, 1, -1, 1, 1}, "VEC3");
  b.json["animations"][0]["samplers"][0]["output"] = flips;
  const Scene scene = load(b, frame(50.1));
  EXPECT_EQ(scene.instances[0].motion_index, -1);
  EXPECT_TRUE(has_warning(scene, "/nodes/0: a transform that mirrors at some of the steps while the shutter is open"));
}

TEST(Shutter, SaysThatNothingMovesWithoutAFrame)
{
  const Scene scene = load(moving_square({{"shutter", 0.5}}));
  EXPECT_TRUE(scene.motions.empty());
  EXPECT_TRUE(has_warning(scene, "no frame of the animation is asked for"));
}

GltfBuilder moving_light(const char* type)
{
  GltfBuilder b = moving_square({{"shutter", 1}});
  b.json["extensions"]["KHR_lights_punctual"] = {{"lights", {{{"type", type}, {"intensity", 10}}}}};
  b.json["nodes"][0]["extensions"]["KHR_lights_punctual"] = {{"light", 0}};
  return b;
}

TEST(Shutter, MovesLights)
{
  const Scene scene = load(moving_light("spot"), frame(5));
  ASSERT_EQ(scene.lights.size(), 1u);
  const std::vector<Affine3>& steps = scene.motions.at(static_cast<std::size_t>(scene.lights[0].motion_index));
  EXPECT_NEAR(steps.front().p.x, 4.5f, 1e-5f);
  EXPECT_NEAR(length(steps.front().x - Vec3f{1, 0, 0}), 0, 1e-6f);
}

TEST(Shutter, SaysThatALightThatGrowsAndASunThatTurnsStandStill)
{
  GltfBuilder grows = moving_light("point");
  grows.json["animations"][0]["channels"][0]["target"]["path"] = "scale";
  grows.json["animations"][0]["samplers"][0]["output"] = grows.accessor<float>({1, 1, 1, 3, 3, 3}, "VEC3");
  const Scene grown = load(grows, frame(50));
  EXPECT_EQ(grown.lights[0].motion_index, -1);
  EXPECT_TRUE(has_warning(grown, "a light that moves while the shutter is open, one that changes its size"));

  GltfBuilder turns = moving_light("directional");
  EXPECT_TRUE(load(turns, frame(5)).warnings.empty());
  turns.json["animations"][0]["channels"][0]["target"]["path"] = "rotation";
  turns.json["animations"][0]["samplers"][0]["output"] = turns.accessor<float>({0, 0, 0, 1, 0, 1, 0, 0}, "VEC4");
  const Scene turned = load(turns, frame(50));
  EXPECT_EQ(turned.lights[0].motion_index, -1);
  EXPECT_TRUE(has_warning(turned, "a light that moves while the shutter is open, a sun"));
}

TEST(Shutter, SaysThatAGlowingMeshThatMovesIsNoisy)
{
  GltfBuilder b = moving_square({{"shutter", 1}});
  b.push("materials", {{"emissiveFactor", {1, 1, 1}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  EXPECT_TRUE(has_warning(load(b, frame(5)), "its light is found by chance alone"));
}

TEST(Shutter, RefusesWhatItCannotBe)
{
  const nlohmann::json wrong[] = {{{"shutter", -1}},         {{"shutter", "long"}},    {{"shutterPosition", "middle"}},
                                  {{"shutterSteps", 0}},     {{"shutterSteps", 1000}}, {{"shutter", 1e9}},
                                  {{"shutterSteps", "two"}}, {{"shutterSteps", 1.5}}};
  for (const nlohmann::json& shutter : wrong) {
    EXPECT_THROW(load(moving_square(shutter), frame(5)), SceneError) << shutter;
  }
}

}  // namespace
}  // namespace relief::test
