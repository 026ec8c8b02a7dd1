// RELIEF_camera: what a file says of lenses, and what it must not.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/loaded_scene.h"

namespace relief::test {
namespace {

using nlohmann::json;

Scene load_lens(const json& lens)
{
  GltfBuilder b = square_scene();
  b.json["cameras"] = {{{"type", "perspective"},
                        {"perspective", {{"yfov", 1.0}, {"aspectRatio", 2.0}, {"znear", 0.1}}},
                        {"extensions", {{"RELIEF_camera", lens}}}}};
  b.root_node({{"camera", 0}});
  return load(b);
}

Camera camera_of(const json& lens) { return load_lens(lens).cameras.at(0).camera; }

TEST(CameraReader, ReadsAperturesAndPixels)
{
  const Camera camera = camera_of({{"apertureRadius", 0.02},
                                   {"apertureBlades", 5},
                                   {"apertureRotation", 0.3},
                                   {"apertureRatio", 2},
                                   {"pixelAspect", 1.5}});
  EXPECT_EQ(camera.aperture_radius, 0.02f);
  EXPECT_EQ(camera.aperture_blades, 5);
  EXPECT_EQ(camera.aperture_rotation, 0.3f);
  EXPECT_EQ(camera.aperture_ratio, 2);
  EXPECT_EQ(camera.pixel_aspect, 1.5f);
  EXPECT_FLOAT_EQ(camera.half_width, 1.5f * 2 * std::tan(0.5f));
}

TEST(CameraReader, ApertureIsRoundAndPixelsAreSquareUnlessTheFileSaysOtherwise)
{
  const Camera camera = camera_of({{"apertureRadius", 0.02}});
  EXPECT_EQ(camera.aperture_blades, 0);
  EXPECT_EQ(camera.aperture_ratio, 1);
  EXPECT_EQ(camera.pixel_aspect, 1);
}

TEST(CameraReader, MistakesAreNamed)
{
  const std::pair<json, const char*> cases[] = {
      {{{"apertureBlades", 5.5}}, "/apertureBlades"},
      {{{"apertureBlades", -1}}, "/apertureBlades"},
      {{{"apertureBlades", 1001}}, "/apertureBlades"},
      {{{"apertureRotation", "round"}}, "/apertureRotation"},
      {{{"apertureRotation", 1e30}}, "/apertureRotation"},
      {{{"apertureRatio", 0}}, "/apertureRatio"},
      {{{"apertureRadius", 1e12}, {"apertureRatio", 1e-6}}, "/apertureRatio"},
      {{{"pixelAspect", 0}}, "/pixelAspect"},
      {{{"pixelAspect", json::array({1, 2})}}, "/pixelAspect"},
  };
  for (const auto& [lens, place] : cases) {
    try {
      load_lens(lens);
      ADD_FAILURE() << lens;
    } catch (const SceneError& error) {
      EXPECT_NE(std::string(error.what()).find("/RELIEF_camera" + std::string(place)), std::string::npos)
          << error.what();
    }
  }
}

}  // namespace
}  // namespace relief::test
