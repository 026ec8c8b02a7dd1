// The first picture of a file that says little about light or camera.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "tests/cli/program.h"

namespace relief::test {
namespace {

using FirstPictures = ProgramTest;

double mean(const std::vector<float>& values)
{
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// A white square that fills the picture, across a sun's light.
GltfBuilder sunlit_square(double lux)
{
  GltfBuilder b = lit_square();
  b.json["extensions"].erase("RELIEF_environment");
  b.json["extensionsUsed"] = {"KHR_lights_punctual"};
  b.json["extensions"]["KHR_lights_punctual"] = {{"lights", {{{"type", "directional"}, {"intensity", lux}}}}};
  b.push("materials", {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}},
                       {"extensions", {{"KHR_materials_specular", {{"specularFactor", 0}}}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  b.json["cameras"][0]["orthographic"].update({{"xmag", 0.4}, {"ymag", 0.4}});
  b.json["nodes"][1]["translation"] = {0.5, 0.5, 5};
  b.root_node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  return b;
}

TEST_F(FirstPictures, LightsOfBlendersExporterAreAsBrightAsInBlender)
{
  GltfBuilder b = sunlit_square(2049);
  b.json["asset"]["generator"] = "Khronos glTF Blender I/O v3.4.50";
  const std::string scene = folder_.write("s.gltf", b.gltf()).string();
  const Outcome outcome = render(scene, file("a.exr"), {"--png", file("a.png")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_NE(outcome.errors.find("683 lm/W"), std::string::npos) << outcome.errors;
  EXPECT_EQ(outcome.errors.find("is white"), std::string::npos) << outcome.errors;
  EXPECT_NEAR(mean(values_of(file("a.exr"), "G")), 3 / 3.14159265, 1e-3);
}

TEST_F(FirstPictures, LuminousEfficacyIsTold)
{
  const std::string scene = folder_.write("s.gltf", sunlit_square(1000).gltf()).string();
  ASSERT_EQ(render(scene, file("a.exr"), {"--luminous-efficacy", "500", "--strict"}).exit_code, 0);
  EXPECT_NEAR(mean(values_of(file("a.exr"), "G")), 2 / 3.14159265, 1e-3);
  for (const char* wrong : {"0", "-1", "nan", "1e9", "bright"}) {
    EXPECT_EQ(render(scene, file("b.exr"), {"--luminous-efficacy", wrong}).exit_code, 2) << wrong;
  }
  EXPECT_EQ(run({"info", scene, "--luminous-efficacy", "683"}).exit_code, 0);
  EXPECT_EQ(run({"trace", scene, "--pixel", "3,3", "--luminous-efficacy", "683"}).exit_code, 0);
}

TEST_F(FirstPictures, APictureThatIsMostlyWhiteComesWithAHint)
{
  const std::string scene = folder_.write("s.gltf", sunlit_square(2049).gltf()).string();
  const Outcome outcome = render(scene, file("a.exr"), {"--png", file("a.png")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  // 2049 / π is 11.8 stops above .18.
  EXPECT_NE(
      outcome.errors.find("a.png: 100 % of what is seen is white: try --exposure -11.8, or --luminous-efficacy 683"),
      std::string::npos)
      << outcome.errors;
  EXPECT_EQ(render(scene, file("a.exr"), {"--png", file("a.png"), "--exposure", "-11.8"}).errors.find("white"),
            std::string::npos);
  EXPECT_EQ(render(scene, file("a.exr")).errors.find("white"), std::string::npos);
}

/// A dark ball with a few small lights on its surface, as helmets and robots have them, and no other light or camera.
GltfBuilder ball_with_lights()
{
  // 16 × 16, four of its texels white.
  constexpr const char* kLights =
      "data:image/"
      "png;base64,iVBORw0KGgoAAAANSUhEUgAAABAAAAAQCAAAAAA6mKC9AAAAFklEQVR42mNgoA74j0bTDvwnKEAJAAAx+wP9YfbDHAAAAABJRU"
      "5ErkJggg==";
  GltfBuilder b;
  constexpr int kColumns = 32, kRows = 16;
  std::vector<float> P, uv;
  std::vector<std::uint16_t> indices;
  for (int r = 0; r <= kRows; ++r) {
    for (int c = 0; c <= kColumns; ++c) {
      const float theta = 3.14159265f * static_cast<float>(r) / kRows,
                  phi = 6.2831853f * static_cast<float>(c) / kColumns;
      P.insert(P.end(), {std::sin(theta) * std::cos(phi), std::cos(theta), -std::sin(theta) * std::sin(phi)});
      uv.insert(uv.end(), {static_cast<float>(c) / kColumns, static_cast<float>(r) / kRows});
      const int at = r * (kColumns + 1) + c;
      if (r == kRows || c == kColumns) continue;
      for (const int i : {at, at + kColumns + 1, at + 1, at + 1, at + kColumns + 1, at + kColumns + 2}) {
        indices.push_back(static_cast<std::uint16_t>(i));
      }
    }
  }
  b.mesh({{"attributes",
           {{"POSITION", b.accessor<float>(P, "VEC3")},
            {"NORMAL", b.accessor<float>(P, "VEC3")},
            {"TEXCOORD_0", b.accessor<float>(uv, "VEC2")}}},
          {"indices", b.accessor<std::uint16_t>(indices, "SCALAR")},
          {"material", 0}});
  b.push("images", {{"uri", kLights}});
  b.push("textures", {{"source", 0}});
  b.push("materials", {{"pbrMetallicRoughness",
                        {{"baseColorFactor", {0.5, 0.5, 0.5, 1}}, {"metallicFactor", 0}, {"roughnessFactor", 0.7}}},
                       {"emissiveFactor", {1, 1, 1}},
                       {"emissiveTexture", {{"index", 0}}}});
  b.root_node({{"name", "ball"}, {"mesh", 0}});
  return b;
}

/// Mean of a channel where there is geometry.
double mean_seen(const std::string& exr, const char* channel)
{
  const std::vector<float> values = values_of(exr, channel), coverage = values_of(exr, "A");
  double sum = 0, covered = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (coverage[i] < 0.999f) continue;
    sum += static_cast<double>(values[i]);
    covered += 1;
  }
  return sum / covered;
}

/// Columns of a picture with geometry.
std::vector<int> columns_seen(const std::string& exr, int width)
{
  const std::vector<float> coverage = values_of(exr, "A");
  std::vector<int> columns;
  for (int x = 0; x < width; ++x) {
    for (std::size_t i = static_cast<std::size_t>(x); i < coverage.size(); i += static_cast<std::size_t>(width)) {
      if (coverage[i] < 0.5f) continue;
      columns.push_back(x);
      break;
    }
  }
  return columns;
}

TEST_F(FirstPictures, AModelWithLightsOnItIsLit)
{
  const std::string scene = folder_.write("s.gltf", ball_with_lights().gltf()).string();
  const Outcome outcome = render(scene, file("a.exr"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_NE(outcome.errors.find("a soft studio lights it"), std::string::npos) << outcome.errors;
  EXPECT_GT(mean_seen(file("a.exr"), "G"), 0.15);
  EXPECT_LT(mean_seen(file("a.exr"), "G"), 0.6);
  ASSERT_EQ(render(scene, file("dark.exr"), {"--environment", "none"}).exit_code, 0);
  EXPECT_LT(mean_seen(file("dark.exr"), "G"), 0.06);
  ASSERT_EQ(render(scene, file("bright.exr"), {"--environment", "studio,2"}).exit_code, 0);
  EXPECT_NEAR(mean_seen(file("bright.exr"), "B") - mean_seen(file("dark.exr"), "B"),
              2 * (mean_seen(file("a.exr"), "B") - mean_seen(file("dark.exr"), "B")), 0.03);
}

TEST_F(FirstPictures, AnySceneIsLitByAnImage)
{
  GltfBuilder b = lit_square();
  const std::string scene = folder_.write("s.gltf", b.gltf()).string();
  folder_.write("white.png", from_base64(std::string_view(kPixelPng).substr(22)));
  const auto background = [&](const Arguments& options) {
    EXPECT_EQ(render(scene, file("a.exr"), options).exit_code, 0);
    return std::pair{values_of(file("a.exr"), "G").back(), values_of(file("a.exr"), "A").back()};
  };
  // The pixel's own colour, whatever it is; a strength scales it.
  const float green = background({"--environment", file("white.png")}).first;
  EXPECT_GT(green, 0);
  EXPECT_NEAR(background({"--environment", file("white.png") + ",3"}).first, 3 * green, 0.01 * green);
  EXPECT_GT(background({"--environment", "sky"}).first, 0.1f);
  // Grey in the studio's place, which is not part of the picture.
  EXPECT_GT(background({"--environment", "studio"}).first, 0.05f);
  EXPECT_LT(background({"--environment", "studio"}).first, 0.35f);
  EXPECT_EQ(background({"--environment", "studio"}).second, 0.0f);
  EXPECT_EQ(background({"--environment", "studio", "--background", "black"}), std::pair(0.0f, 0.0f));
  EXPECT_EQ(background({"--environment", "sky", "--background", "black"}), std::pair(0.0f, 0.0f));
  EXPECT_GT(background({"--environment", "studio", "--background", "world"}).first, 0.1f);
  // Without another environment, the scene's.
  EXPECT_EQ(background({"--background", "world"}).first, 0.5f);
  EXPECT_EQ(background({"--background", "transparent"}), std::pair(0.0f, 0.0f));
  EXPECT_EQ(run({"info", scene, "--environment", "sky"}).exit_code, 0);
  EXPECT_EQ(run({"trace", scene, "--pixel", "3,3", "--environment", file("white.png")}).exit_code, 0);
}

TEST_F(FirstPictures, TheBackdropIsDarkBelowAndLightAboveAndLightsNothing)
{
  GltfBuilder b = lit_square();
  b.json["extensions"].erase("RELIEF_environment");
  b.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 0.1}}}}};
  const std::string scene = folder_.write("s.gltf", b.gltf()).string();
  ASSERT_EQ(render(scene, file("a.exr")).exit_code, 0);
  const std::vector<float> grey = values_of(file("a.exr"), "G"), alpha = values_of(file("a.exr"), "A");
  ASSERT_EQ(alpha.front() + alpha.back(), 0.0f);
  EXPECT_GT(grey.front(), grey.back() + 0.02f);
  for (const float value : {grey.front(), grey.back()}) {
    EXPECT_GT(value, 0.05f);
    EXPECT_LT(value, 0.35f);
  }
  ASSERT_EQ(render(scene, file("b.exr"), {"--background", "black"}).exit_code, 0);
  const std::vector<float> black = values_of(file("b.exr"), "G");
  for (std::size_t i = 0; i < grey.size(); ++i) {
    if (alpha[i] == 1.0f) {
      EXPECT_EQ(grey[i], black[i]) << i;
    } else if (alpha[i] == 0.0f) {
      EXPECT_EQ(black[i], 0.0f) << i;
    }
  }
}

TEST_F(FirstPictures, APictureOfNothingComesWithAWarningThatHelps)
{
  GltfBuilder b = lit_square();
  b.json["nodes"].back()["rotation"] = {0, 1, 0, 0};
  const std::string blind = folder_.write("blind.gltf", b.gltf()).string();
  Outcome outcome = render(blind, file("a.exr"));
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.errors.find("the camera sees nothing of the scene; --camera auto"), std::string::npos) << outcome.errors;
  outcome = render(blind, file("a.exr"), {"--camera", "auto"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.errors.find("warning"), std::string::npos) << outcome.errors;
  EXPECT_GT(columns_seen(file("a.exr"), 16).size(), 8u);
  EXPECT_EQ(run({"trace", blind, "--pixel", "8,8", "--camera", "auto", "--resolution", "16x16"}).exit_code, 0);

  GltfBuilder dark = mirrored_lamp();
  dark.json["extensions"]["KHR_lights_punctual"] = {
      {"lights", {{{"type", "spot"}, {"intensity", 1}, {"spot", nlohmann::json::object()}}}}};
  // It shines away from everything.
  dark.json["nodes"].back()["translation"] = {0.5, 0.5, -20};
  const std::string missed = folder_.write("missed.gltf", dark.gltf()).string();
  outcome = render(missed, file("a.exr"));
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.errors.find("no light reaches what the camera sees; --environment studio"), std::string::npos)
      << outcome.errors;
  EXPECT_EQ(render(missed, file("a.exr"), {"--strict"}).exit_code, 3);
  outcome = render(missed, file("a.exr"), {"--environment", "studio"});
  EXPECT_EQ(outcome.errors.find("no light reaches"), std::string::npos) << outcome.errors;
}

TEST_F(FirstPictures, AStudioLightsWhatGlowsAwayFromTheCamera)
{
  // What is near is lit, yet on the side that the camera does not see: a lamp behind a wall, that looks out a little.
  GltfBuilder b = sunlit_square(1);
  b.json["extensions"].erase("KHR_lights_punctual");
  b.json["nodes"].back().erase("extensions");
  b.json["cameras"][0]["orthographic"].update({{"xmag", 1}, {"ymag", 1}});
  b.push("materials", {{"emissiveFactor", {1, 1, 1}}});
  nlohmann::json lamp = b.json["meshes"][0];
  lamp["primitives"][0]["material"] = 1;
  b.push("meshes", lamp);
  b.root_node({{"mesh", 1}, {"translation", {0.15, 0, -0.2}}});
  const std::string scene = folder_.write("s.gltf", b.gltf()).string();
  Outcome outcome = render(scene, file("a.exr"));
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.errors.find("a soft studio lights it"), std::string::npos) << outcome.errors;
  EXPECT_EQ(outcome.errors.find("what glows"), std::string::npos) << outcome.errors;
  EXPECT_NE(run({"info", scene}).output.find("a soft studio lights it"), std::string::npos);
  // From before the lamp, where what it lights is seen, nothing is added.
  outcome = render(scene, file("a.exr"), {"--look-from", "0.5,0.5,-0.19", "--look-at", "0.5,0.5,0"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.errors.find("studio"), std::string::npos) << outcome.errors;
  outcome = render(scene, file("a.exr"), {"--environment", "none"});
  EXPECT_NE(outcome.errors.find("what glows is all its light"), std::string::npos) << outcome.errors;
}

TEST_F(FirstPictures, AStudioLightsACarBehindItsHeadlights)
{
  // Six sides, and lamps before one of them that shine to both of theirs: if nothing stood between, they would light most.
  GltfBuilder b = sunlit_square(1);
  b.json["extensions"].erase("KHR_lights_punctual");
  b.json["nodes"].back().erase("extensions");
  const double half = std::sqrt(0.5);
  const auto place = [&](int mesh, std::array<double, 3> at, std::array<double, 4> turn, double size) {
    b.root_node({{"mesh", mesh}, {"translation", at}, {"rotation", turn}, {"scale", {size, size, size}}});
  };
  b.push("materials", {{"emissiveFactor", {1, 1, 1}},
                       {"doubleSided", true},
                       {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 20}}}}}});
  nlohmann::json lamp = b.json["meshes"][0];
  lamp["primitives"][0]["material"] = 1;
  b.push("meshes", lamp);
  // The square itself, from (0, 0, 0) to (1, 1, 0), is the front.
  place(0, {0, 0, -1}, {0, 0, 0, 1}, 1);
  place(0, {0, 0, 0}, {0, half, 0, half}, 1);
  place(0, {1, 0, 0}, {0, half, 0, half}, 1);
  place(0, {0, 0, 0}, {-half, 0, 0, half}, 1);
  place(0, {0, 1, 0}, {-half, 0, 0, half}, 1);
  place(1, {0.1, 0.3, 0.02}, {0, 0, 0, 1}, 0.15);
  place(1, {0.75, 0.3, 0.02}, {0, 0, 0, 1}, 0.15);
  const std::string scene = folder_.write("car.gltf", b.gltf()).string();
  for (const char* from : {"-2,1,-3", "3,2,-1"}) {
    const Outcome outcome = render(scene, file("a.exr"), {"--look-from", from, "--look-at", "0.5,0.5,-0.5"});
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_NE(outcome.errors.find("a soft studio lights it"), std::string::npos) << from << ": " << outcome.errors;
  }
}

TEST_F(FirstPictures, TransparentPngsHaveCoverage)
{
  const std::string scene = folder_.write("s.gltf", lit_square().gltf()).string();
  constexpr std::size_t kColorType = 25;
  for (const auto& [background, color_type] :
       {std::pair("black", 2), std::pair("world", 2), std::pair("transparent", 6)}) {
    ASSERT_EQ(render(scene, file("a.exr"), {"--png", file("a.png"), "--background", background}).exit_code, 0);
    EXPECT_EQ(bytes_of_file(file("a.png")).at(kColorType), color_type) << background;
  }
}

TEST_F(FirstPictures, EnvironmentsThatAreNoneAreRefused)
{
  const std::string scene = folder_.write("s.gltf", lit_square().gltf()).string();
  const std::string image = folder_.write("e.png", from_base64(std::string_view(kPixelPng).substr(22))).string();
  folder_.write("text.hdr", "no picture");
  const Outcome missing = render(scene, file("a.exr"), {"--environment", file("nowhere.hdr")});
  EXPECT_EQ(missing.exit_code, 3);
  EXPECT_NE(missing.errors.find("nowhere.hdr: --environment: expected an image file"), std::string::npos)
      << missing.errors;
  EXPECT_EQ(render(scene, file("a.exr"), {"--environment", file("text.hdr")}).exit_code, 3);
  EXPECT_EQ(render(scene, file("a.exr"), {"--environment", "sky,-1"}).exit_code, 2);
  EXPECT_EQ(render(scene, file("a.exr"), {"--background", "white"}).exit_code, 2);
  // It is an input, which no output may be.
  const std::string before = bytes_of_file(image);
  const Outcome same = render(scene, file("a.exr"), {"--environment", image, "--png", image});
  EXPECT_EQ(same.exit_code, 2) << same.errors;
  EXPECT_NE(same.errors.find("read as the environment"), std::string::npos) << same.errors;
  EXPECT_EQ(bytes_of_file(image), before);
  EXPECT_FALSE(exists("a.exr"));
}

TEST_F(FirstPictures, ResumingSeesAnotherEnvironment)
{
  const std::string scene = folder_.write("s.gltf", lit_square().gltf()).string();
  folder_.write("e.png", from_base64(std::string_view(kPixelPng).substr(22)));
  const Arguments options = {"--environment", file("e.png"), "--resume"};
  EXPECT_EQ(render(scene, file("a.exr"), options).count("done"), 1);
  EXPECT_EQ(render(scene, file("a.exr"), options).count("skipped"), 1);
  folder_.write("e.png", from_base64(std::string_view(kGreyPixelPng).substr(22)));
  EXPECT_EQ(render(scene, file("a.exr"), options).count("done"), 1);
  EXPECT_EQ(render(scene, file("a.exr"), {"--environment", "sky", "--resume"}).count("done"), 1);
}

TEST_F(FirstPictures, WhatMovesIsSeenToMove)
{
  GltfBuilder b = square_scene();
  const int times = b.accessor<float>({0, 2}, "SCALAR");
  const int places = b.accessor<float>({0, 0, 0, 4, 0, 0}, "VEC3");
  b.json["animations"] = {{{"samplers", {{{"input", times}, {"output", places}}}},
                           {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}}};
  const std::string scene = folder_.write("s.gltf", b.gltf()).string();
  ASSERT_EQ(render(scene, file("f.#.exr"), {"--frames", "0,24,48", "--resolution", "64x64"}).exit_code, 0);
  const std::vector<int> first = columns_seen(file("f.0.exr"), 64), middle = columns_seen(file("f.24.exr"), 64),
                         last = columns_seen(file("f.48.exr"), 64);
  ASSERT_FALSE(first.empty() || middle.empty() || last.empty());
  EXPECT_LT(first.back(), middle.back() - 8);
  EXPECT_LT(middle.back(), last.back() - 8);
  EXPECT_NEAR(last.back() - first.front(), 0.88 * 64, 4);
  // A frame alone, and what a replay of its rays sees, have the same camera.
  ASSERT_EQ(render(scene, file("alone.#.exr"), {"--frames", "48", "--resolution", "64x64"}).exit_code, 0);
  EXPECT_EQ(values_of(file("alone.48.exr"), "G"), values_of(file("f.48.exr"), "G"));
  const std::vector<float> at_first = values_of(file("f.0.exr"), "A"), at_last = values_of(file("f.48.exr"), "A");
  const auto rays_at = [&](const std::vector<float>& covered) {
    const auto index =
        std::find_if(covered.begin(), covered.end(), [](float a) { return a > 0.999f; }) - covered.begin();
    const std::string pixel = std::to_string(index % 64) + "," + std::to_string(index / 64);
    const std::string text =
        run({"trace", scene, "--frame", "48", "--resolution", "64x64", "--spp", "4", "--pixel", pixel}).output;
    int num_rays = 0;
    for (std::size_t at = 0; (at = text.find("\npath ", at)) != std::string::npos; ++at) ++num_rays;
    return num_rays;
  };
  EXPECT_GT(rays_at(at_last), 1);
  EXPECT_EQ(rays_at(at_first), 1);
}

TEST_F(FirstPictures, ModelsFillThePicture)
{
  const std::string scene = folder_.write("s.gltf", ball_with_lights().gltf()).string();
  for (const char* resolution : {"64x64", "64x200"}) {
    ASSERT_EQ(render(scene, file("a.exr"), {"--resolution", resolution}).exit_code, 0);
    EXPECT_NEAR(static_cast<double>(columns_seen(file("a.exr"), 64).size()), 0.88 * 64, 3) << resolution;
  }
}

TEST_F(FirstPictures, TheCameraIsChosenFromTheCommandLine)
{
  GltfBuilder b = lit_square();
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 0.1}}}});
  b.root_node({{"camera", 1}, {"translation", {0.5, 0.5, 50}}});
  const std::string scene = folder_.write("s.gltf", b.gltf()).string();
  const auto seen = [&](const Arguments& options) {
    const Outcome outcome = render(scene, file("a.exr"), options);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
    const std::vector<float> coverage = values_of(file("a.exr"), "A");
    return std::accumulate(coverage.begin(), coverage.end(), 0.0f) / static_cast<float>(coverage.size());
  };
  EXPECT_NEAR(seen({}), 1.0 / 16, 0.02);
  EXPECT_NEAR(seen({"--camera", "0"}), 1.0 / 16, 0.02);
  EXPECT_NEAR(seen({"--camera", "front"}), 1.0 / 16, 0.02);
  EXPECT_LT(seen({"--camera", "1"}), 0.01);
  EXPECT_GT(seen({"--camera", "1", "--fov", "1"}), 0.99f);
  // From 2 m the square is 28° wide.
  EXPECT_NEAR(seen({"--look-from", "0.5,0.5,2", "--fov", "28.07"}), 1, 0.1);
  EXPECT_NEAR(seen({"--look-from", "0.5,0.5,2", "--fov", "53.13"}), 0.25, 0.05);
  EXPECT_EQ(seen({"--look-from", "0.5,0.5,2", "--look-at", "0.5,0.5,9"}), 0);
  const Outcome unknown = render(scene, file("b.exr"), {"--camera", "2"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_NE(unknown.errors.find("expected one of 0 ('front'), 1 (''), found '2'"), std::string::npos) << unknown.errors;
  for (const Arguments& wrong :
       {Arguments{"--fov", "60"}, Arguments{"--fov", "0"}, Arguments{"--fov", "180"}, Arguments{"--look-at", "1,2,3"},
        Arguments{"--look-from", "1,2"}, Arguments{"--look-from", "1,2,3", "--camera", "0"}}) {
    EXPECT_EQ(render(scene, file("b.exr"), wrong).exit_code, 2) << wrong[0] << " " << wrong[1];
  }
  EXPECT_FALSE(exists("b.exr"));
  EXPECT_EQ(run({"trace", scene, "--pixel", "3,3", "--look-from", "1,2,3", "--fov", "20"}).exit_code, 0);
  folder_.write("rays.txt", "0 0 5 0 0 -1");
  EXPECT_EQ(run({"trace", scene, "--rays", file("rays.txt"), "--fov", "20"}).exit_code, 2);
}

}  // namespace
}  // namespace relief::test
