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

TEST(CameraReader, ReadsPanoramas)
{
  Camera camera = camera_of({{"panorama", {{"longitude", {-1, 2}}, {"latitude", {0, 1}}, {"window", {2, 3}}}}});
  EXPECT_EQ(camera.projection, Projection::kPanoramic);
  EXPECT_EQ(camera.panorama.kind, PanoramaKind::kEquirectangular);
  EXPECT_EQ(camera.panorama.longitude_min, -1);
  EXPECT_EQ(camera.panorama.longitude_max, 2);
  EXPECT_EQ(camera.panorama.latitude_max, 1);
  EXPECT_EQ(camera.half_width, 2);
  EXPECT_EQ(camera.half_height, 3);
  camera =
      camera_of({{"panorama", {{"type", "equisolid"}, {"fieldOfView", 3}, {"sensor", {30, 20}}, {"focalLength", 8}}}});
  EXPECT_EQ(camera.panorama.kind, PanoramaKind::kEquisolid);
  EXPECT_EQ(camera.panorama.half_field, 1.5f);
  EXPECT_EQ(camera.panorama.half_sensor_width, 15);
  EXPECT_EQ(camera.panorama.half_sensor_height, 10);
  EXPECT_EQ(camera.panorama.focal_length, 8);
  EXPECT_EQ(camera.half_width, 1);
  camera = camera_of({{"panorama", {{"type", "polynomial"}, {"coefficients", {0, 0.1, 0, 0, 0.5}}}}});
  EXPECT_EQ(camera.panorama.kind, PanoramaKind::kPolynomial);
  EXPECT_EQ(camera.panorama.k[4], 0.5f);
  camera = camera_of({{"panorama", {{"type", "cylindrical"}, {"heights", {-2, 1}}}}});
  EXPECT_EQ(camera.panorama.kind, PanoramaKind::kCylindrical);
  EXPECT_EQ(camera.panorama.height_min, -2);
  for (const auto& [type, kind] : {std::pair{"mirror-ball", PanoramaKind::kMirrorBall},
                                   {"cube-face", PanoramaKind::kCubeFace},
                                   {"equidistant", PanoramaKind::kEquidistant}}) {
    EXPECT_EQ(camera_of({{"panorama", {{"type", type}}}}).panorama.kind, kind);
  }
}

TEST(CameraReader, WarnsOfWhatAPanoramaHasNot)
{
  EXPECT_TRUE(has_warning(load_lens({{"panorama", {{"type", "mirror-ball"}, {"fieldOfView", 2}}}}), "fieldOfView"));
  EXPECT_TRUE(has_warning(load_lens({{"panorama", json::object()}, {"pixelAspect", 2}}), "pixelAspect"));
  EXPECT_FALSE(has_warning(load_lens({{"panorama", {{"type", "equidistant"}, {"fieldOfView", 2}}}}), "fieldOfView"));
}

TEST(CameraReader, OrthographicCamerasHaveNoPanoramas)
{
  GltfBuilder b = square_scene();
  b.json["cameras"] = {{{"type", "orthographic"},
                        {"orthographic", {{"xmag", 3}, {"ymag", 2}, {"znear", 0}, {"zfar", 10}}},
                        {"extensions", {{"RELIEF_camera", {{"panorama", json::object()}}}}}}};
  b.root_node({{"camera", 0}});
  EXPECT_THROW(load(b), SceneError);
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
      {{{"panorama", 1}}, "/panorama"},
      {{{"panorama", {{"type", "fisheye"}}}}, "/panorama/type"},
      {{{"panorama", {{"latitude", {1, 1}}}}}, "/panorama/latitude"},
      {{{"panorama", {{"longitude", {0, 1e9}}}}}, "/panorama/longitude"},
      {{{"panorama", {{"type", "cylindrical"}, {"heights", {0, 0}}}}}, "/panorama/heights"},
      {{{"panorama", {{"type", "equidistant"}, {"fieldOfView", 0}}}}, "/panorama/fieldOfView"},
      {{{"panorama", {{"type", "equisolid"}, {"focalLength", -1}}}}, "/panorama/focalLength"},
      {{{"panorama", {{"type", "equisolid"}, {"sensor", {36, 0}}}}}, "/panorama/sensor"},
      {{{"panorama", {{"type", "polynomial"}}}}, "/panorama/coefficients"},
      {{{"panorama", {{"type", "polynomial"}, {"coefficients", {1, 2, 3}}}}}, "/panorama/coefficients"},
      {{{"panorama", {{"window", {0, 1}}}}}, "/panorama/window"},
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
