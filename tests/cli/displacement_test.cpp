// Displacement on the command line: methods, levels, what a ray did, and what statistics and warnings say.
#include <chrono>
#include <cmath>
#include <functional>
#include <random>
#include <sstream>
#include <thread>

#include "kernel/shape/displacement_settings.h"
#include "tests/cli/program.h"
#include "tests/support/image_bytes.h"

namespace relief::test {
namespace {

/// A square of one metre at z = 0, displaced upward by 0.5 m · height, seen from above; its material is unlit, so that
/// paths end where they first hit.
GltfBuilder displaced_square()
{
  GltfBuilder b;
  const int P = b.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, "VEC3");
  const int N = b.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int uv = b.accessor<float>({0, 0, 1, 0, 0, 1, 1, 1}, "VEC2");
  const int indices = b.accessor<std::uint16_t>({0, 1, 2, 2, 1, 3}, "SCALAR");
  b.mesh({{"attributes", {{"POSITION", P}, {"NORMAL", N}, {"TEXCOORD_0", uv}}}, {"indices", indices}, {"material", 0}});
  b.root_node({{"mesh", 0}, {"name", "ground"}});
  b.json["extensionsUsed"] = {"RELIEF_displacement", "KHR_materials_unlit"};
  b.push("materials",
         {{"name", "bark"},
          {"extensions",
           {{"KHR_materials_unlit", nlohmann::json::object()},
            {"RELIEF_displacement", {{"heightTexture", {{"uri", "h.tga"}}}, {"scale", 0.5}, {"midlevel", 0}}}}}});
  b.push("cameras", {{"type", "orthographic"},
                     {"name", "above"},
                     {"orthographic", {{"xmag", 0.6}, {"ymag", 0.6}, {"znear", 0.1}, {"zfar", 100}}}});
  b.root_node({{"name", "above"}, {"camera", 0}, {"translation", {0.5, 0.5, 5}}});
  return b;
}

nlohmann::json& displacement_of(GltfBuilder& b) { return b.json["materials"][0]["extensions"]["RELIEF_displacement"]; }

class DisplacementProgram : public ProgramTest {
 protected:
  /// Writes the scene and its map; the map is 4x4, 8-bit.
  std::string write(const GltfBuilder& b, const std::string& texels)
  {
    folder_.write("h.tga", tga_grey(4, 4, texels));
    return folder_.write("s.gltf", b.gltf()).string();
  }

  std::string bumpy(const GltfBuilder& b = displaced_square())
  {
    return write(b, std::string("\x10\x90\x40\xf0\x80\x20\xc0\x60\x30\xff\x08\xa0\x70\x50\xe0\x18", 16));
  }

  std::vector<std::vector<std::string>> trace(const std::string& scene, const Arguments& more)
  {
    Arguments arguments = {"trace", scene, "--rays", file("rays.txt")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
    std::vector<std::vector<std::string>> rows;
    std::istringstream lines(outcome.output);
    for (std::string line; std::getline(lines, line);) {
      rows.emplace_back();
      std::istringstream fields(line + ",");
      for (std::string field; std::getline(fields, field, ',');) rows.back().push_back(field);
    }
    rows.erase(rows.begin());
    return rows;
  }
};

TEST_F(DisplacementProgram, OptionsOfRmipChangeWhatItDoesAndNotWhatItFinds)
{
  const std::string scene = bumpy();
  std::ostringstream rays;
  for (int k = 0; k < 60; ++k)
    rays << (k % 10) * .1 + .03 << ' ' << (k / 10) * .15 + .04 << " 1 " << (k % 7) * .1 - .3 << " .1 -1\n";
  folder_.write("rays.txt", rays.str());
  const auto expected = trace(scene, {"--displacement", "rmip"});
  const auto steps_of = [](const std::vector<std::vector<std::string>>& rows) {
    std::vector<std::string> steps;
    for (const auto& row : rows) steps.push_back(row.back());
    return steps;
  };
  const char* kAll = "scale=0.5,resolution=2,inversion=off,split=ray";
  for (const char* options : {"scale=0.5", "inversion=off", "scale=0.5,split=ray", "resolution=1", kAll}) {
    const auto rows = trace(scene, {"--displacement", "rmip", "--rmip", options});
    ASSERT_EQ(rows.size(), expected.size());
    for (std::size_t k = 0; k < rows.size(); ++k) {
      ASSERT_EQ(rows[k][0], expected[k][0]) << options << ", ray " << k;
      if (rows[k][0] != "1") continue;
      EXPECT_NEAR(std::stod(rows[k][1]), std::stod(expected[k][1]), 1e-6) << options;
    }
  }
  EXPECT_NE(steps_of(trace(scene, {"--displacement", "rmip", "--rmip", kAll})), steps_of(expected));
  const auto other = trace(scene, {"--displacement", "rmip", "--rmip", "leaf=triangles"});
  EXPECT_NE(other, expected);
}

TEST_F(DisplacementProgram, OptionsOfRmipAreChecked)
{
  const std::string scene = bumpy();
  folder_.write("rays.txt", ".5 .5 1 0 0 -1\n");
  for (const char* options : {"", "speed=1", "scale", "scale=0", "scale=nan", "resolution=0", "resolution=2.5",
                              "inversion=yes", "split=", "leaf=quads", "scale=1,scale=2", "scale=1,",
                              "levels=", "levels=1", "levels=interpolated,leaf=triangles"}) {
    const Outcome outcome = run({"trace", scene, "--rays", file("rays.txt"), "--rmip", options});
    EXPECT_EQ(outcome.exit_code, 2) << options;
    EXPECT_NE(outcome.errors.find("--rmip: expected "), std::string::npos) << options << outcome.errors;
  }
  const Outcome outcome = run({"trace", scene, "--rays", file("rays.txt"), "--rmip", "scale=4"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.errors.find("options of RMIP have no effect on displacement method 'auto'"), std::string::npos)
      << outcome.errors;
}

TEST_F(DisplacementProgram, RmipInterpolatesBetweenTwoLevels)
{
  const std::string scene = bumpy();
  std::string rays;
  for (int i = 0; i < 12; ++i) {
    for (int k = 0; k < 12; ++k)
      rays += std::to_string(0.03 + 0.077 * i) + " " + std::to_string(0.02 + 0.078 * k) + " 3 0 0 -1\n";
  }
  folder_.write("rays.txt", rays);
  const auto at = [&](const std::string& method, const std::string& lod) {
    return trace(scene, {"--displacement", method, "--lod", lod, "--rmip", "levels=interpolated"});
  };
  for (const std::string method : {"rmip", "rmip-minmax"}) {
    // Straight down, a ray's way is blended as the heights are.
    const auto fine = at(method, "0"), coarse = at(method, "1"), between = at(method, "0.25");
    ASSERT_EQ(between.size(), 144u);
    int num_apart = 0;
    for (std::size_t k = 0; k < between.size(); ++k) {
      ASSERT_EQ(between[k][0], "1") << k;
      const double t[2] = {std::stod(fine[k][1]), std::stod(coarse[k][1])};
      EXPECT_NEAR(std::stod(between[k][1]), .75 * t[0] + .25 * t[1], 2e-6) << method << " ray " << k;
      num_apart += std::abs(t[0] - t[1]) > .02 ? 1 : 0;
    }
    EXPECT_GT(num_apart, 72);
    EXPECT_NE(at(method, "0.25"), trace(scene, {"--displacement", method, "--lod", "0.25"}));
  }
}

TEST_F(DisplacementProgram, RmipSaysWhereItDoesNotInterpolate)
{
  const std::string scene = bumpy();
  folder_.write("rays.txt", ".5 .5 1 0 0 -1\n");
  const auto warnings = [&](const std::string& lod) {
    return run({"trace", scene, "--rays", file("rays.txt"), "--displacement", "rmip", "--lod", lod, "--rmip",
                "levels=interpolated"})
        .errors;
  };
  const std::string of_rmip = "RMIP interpolates only between levels of detail that are fixed, such as 1.5; ";
  EXPECT_NE(warnings("auto").find(of_rmip + "those that rays choose by their cones are mixed"), std::string::npos);
  EXPECT_NE(warnings("1").find(of_rmip + "a whole level is traced as it is"), std::string::npos);
  EXPECT_EQ(warnings("0.5").find(of_rmip), std::string::npos);
}

TEST_F(DisplacementProgram, SizesBeyondTheLimitsAreErrorsOfTheScene)
{
  struct Beyond {
    const char* message;
    std::function<void(GltfBuilder&)> make;
  };
  const auto optics = [](const char* name, double value) {
    return [=](GltfBuilder& b) {
      b.json["cameras"][0]["extensions"]["RELIEF_camera"] = {{"apertureRadius", 0.1}};
      b.json["cameras"][0]["extensions"]["RELIEF_camera"][name] = value;
    };
  };
  const auto number = [](const char* pointer, const nlohmann::json& value) {
    return [=](GltfBuilder& b) { b.json[nlohmann::json::json_pointer(pointer)] = value; };
  };
  const char* kScale = "/materials/0/extensions/RELIEF_displacement/scale";
  for (const Beyond& beyond : std::vector<Beyond>{
           {"/nodes/1: ", number("/nodes/1/translation", {0, 0, 2e18})},
           {"/cameras/0/extensions/RELIEF_camera/focusDistance: ", optics("focusDistance", 1e30)},
           {"/cameras/0/extensions/RELIEF_camera/apertureRadius: ", optics("apertureRadius", 1e19)},
           {"/cameras/0/orthographic: ", number("/cameras/0/orthographic/xmag", 1e18)},
           {"displaced positions within 2e15 m", number(kScale, 2.01e15)},
       }) {
    GltfBuilder b = displaced_square();
    b.json["extensionsUsed"].push_back("RELIEF_camera");
    beyond.make(b);
    const Outcome outcome = render(bumpy(b), file("o.exr"));
    EXPECT_EQ(outcome.exit_code, 3) << beyond.message << outcome.errors;
    EXPECT_NE(outcome.errors.find(beyond.message), std::string::npos) << beyond.message << outcome.errors;
    EXPECT_FALSE(exists("o.exr"));
  }
}

TEST_F(DisplacementProgram, ScenesAtTheLimitsAreRendered)
{
  const auto optics = [](const nlohmann::json& camera) {
    return [=](GltfBuilder& b) { b.json["cameras"][0]["extensions"]["RELIEF_camera"] = camera; };
  };
  const std::function<void(GltfBuilder&)> kMakes[] = {
      [](GltfBuilder& b) {
        b.json["nodes"][0]["scale"] = {2e-15, 2e-15, 2e-15};
      },
      [](GltfBuilder& b) {
        b.json["nodes"][0]["scale"] = {2e-15, 2e-15, 2e-15};
        b.json["nodes"][0]["translation"] = {0.5, 0.5, 0};
      },
      [](GltfBuilder& b) {
        b.json["nodes"][0]["scale"] = {9e14, 9e14, 9e14};
      },
      [](GltfBuilder& b) {
        b.json["nodes"][1]["translation"] = {.5, .5, 9e14};
      },
      [](GltfBuilder& b) { displacement_of(b)["scale"] = 1.99e15; },
      optics({{"apertureRadius", 0.1}, {"focusDistance", 1e15}}),
      optics({{"apertureRadius", 1e15}, {"focusDistance", 5}}),
      optics({{"clip", {1e30}}}),
      [&](GltfBuilder& b) {
        b.json["cameras"][0]["orthographic"]["xmag"] = b.json["cameras"][0]["orthographic"]["ymag"] = 1e15;
        optics({{"shift", {1000, -1000}}})(b);
      },
  };
  for (const auto& make : kMakes) {
    GltfBuilder b = displaced_square();
    b.json["extensionsUsed"].push_back("RELIEF_camera");
    make(b);
    const Outcome outcome = render(bumpy(b), file("o.exr"), {"--resolution", "16x16", "--spp", "2"});
    EXPECT_EQ(outcome.exit_code, 0) << b.json["nodes"] << b.json["cameras"] << outcome.errors;
  }
}

TEST_F(DisplacementProgram, RaysMeetTheSurfaceFromAnywhereAndWithDirectionsOfAnyLength)
{
  const std::string scene = bumpy();
  folder_.write("rays.txt",
                ".3 .4 3 0 0 -1\n.3 .4 1e7 0 0 -1\n.3 .4 1e19 0 0 -1\n.3 .4 3e38 0 0 -1\n"
                ".3 .4 3 0 0 -1e19\n.3 .4 3 0 0 -3e38\n.3 .4 3 0 0 -1e-30\n.3 .4 1e19 0 0 -1e30\n");
  for (const std::string method : {"chord", "rmip", "rmip-minmax", "tfdm", "tessellate"}) {
    const auto rows = trace(scene, {"--displacement", method});
    ASSERT_EQ(rows.size(), 8u);
    for (const auto& row : rows) {
      ASSERT_EQ(row[0], "1") << method << " t of the ray " << rows[0][1];
      for (std::size_t i = 2; i < 10; ++i) EXPECT_NEAR(std::stod(row[i]), std::stod(rows[0][i]), 1e-6) << method;
    }
    const double distance = std::stod(rows[0][1]), tolerance = 1e-6;
    const double expected[] = {distance, 1e7, 1e19, 3e38, distance / 1e19, distance / 3e38, distance / 1e-30, 1e-11};
    for (std::size_t r = 0; r < rows.size(); ++r)
      EXPECT_NEAR(std::stod(rows[r][1]) / expected[r], 1, tolerance) << method << " ray " << r;
  }
}

TEST_F(DisplacementProgram, NoRayFromAfarGetsThroughAPlane)
{
  constexpr int kQuads = 32;
  std::vector<float> P, uv;
  std::vector<std::uint16_t> indices;
  for (int k = 0; k <= kQuads; ++k) {
    for (int i = 0; i <= kQuads; ++i) {
      uv.insert(uv.end(), {static_cast<float>(i) / kQuads, static_cast<float>(k) / kQuads});
      P.insert(P.end(), {2 * uv[uv.size() - 2] - 1, 2 * uv.back() - 1, 0});
      if (i == kQuads || k == kQuads) continue;
      const int corner = k * (kQuads + 1) + i;
      for (const int step : {0, 1, kQuads + 2, 0, kQuads + 2, kQuads + 1})
        indices.push_back(static_cast<std::uint16_t>(corner + step));
    }
  }
  GltfBuilder b = displaced_square();
  nlohmann::json& primitive = b.json["meshes"][0]["primitives"][0];
  primitive["attributes"] = {{"POSITION", b.accessor<float>(P, "VEC3")}, {"TEXCOORD_0", b.accessor<float>(uv, "VEC2")}};
  primitive["indices"] = b.accessor<std::uint16_t>(indices, "SCALAR");
  displacement_of(b)["scale"] = 0;
  b.json["nodes"][0]["rotation"] = {0, 0, 0.6, 0.8};
  const std::string scene = bumpy(b);
  std::mt19937 random(4);
  std::uniform_real_distribution<float> inside(-0.6f, 0.6f), slope(-1, 1);
  std::string rays;
  constexpr int kRays = 50'000;
  for (int k = 0; k < kRays; ++k) {
    // Multiples of this are floats also 8 km away, and six digits say them: every ray is aimed right.
    const auto rounded = [](float v) { return std::round(v * 64) / 64; };
    const float D[2] = {rounded(slope(random)), rounded(slope(random))};
    for (const float d : D) rays += std::to_string(rounded(inside(random)) - 8192 * d) + " ";
    rays += "8192 " + std::to_string(D[0]) + " " + std::to_string(D[1]) + " -1\n";
  }
  folder_.write("rays.txt", rays);
  for (const std::string method : {"chord", "rmip", "tfdm"}) {
    int num_missed = 0;
    for (const auto& row : trace(scene, {"--displacement", method})) num_missed += row[0] == "0" ? 1 : 0;
    EXPECT_EQ(num_missed, 0) << method;
  }
}

TEST_F(DisplacementProgram, EveryMethodMeetsTheSameSurface)
{
  const std::string scene = bumpy();
  std::string rays;
  for (int i = 0; i < 20; ++i) {
    for (int k = 0; k < 20; ++k) {
      rays += std::to_string(0.03 + 0.047 * i) + " " + std::to_string(0.02 + 0.048 * k) + " 3 0.05 -0.03 -1\n";
    }
  }
  folder_.write("rays.txt", rays + "5 5 3 0 0 -1\n");
  const auto expected = trace(scene, {});
  for (const std::string method : {"auto", "chord", "rmip", "rmip-minmax", "tfdm", "tessellate", "tessellate-grid"}) {
    const bool approximate = method.rfind("tessellate", 0) == 0;
    const auto rows = trace(scene, {"--displacement", method});
    ASSERT_EQ(rows.size(), expected.size()) << method;
    double sum = 0;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      ASSERT_EQ(rows[r][0], expected[r][0]) << method << " ray " << r;
      if (rows[r][0] == "0") continue;
      const double difference = std::abs(std::stod(rows[r][1]) - std::stod(expected[r][1]));
      sum += difference;
      EXPECT_LT(difference, approximate ? 1 : 1e-6) << method << " ray " << r;
      EXPECT_EQ(rows[r][10], "0");
      if (approximate) {
        EXPECT_EQ(rows[r][12], "") << method;
      } else {
        EXPECT_EQ(rows[r][11], expected[r][11]) << method << " ray " << r;
        EXPECT_GE(std::stoi(rows[r][12]), 1) << method;
      }
    }
    // Two triangles a texel leave out the twist of its bilinear patch, on a map of noise a good part of its height.
    EXPECT_LT(sum / static_cast<double>(rows.size()), 0.05) << method;
    EXPECT_EQ(rows.back()[0], "0");
    EXPECT_EQ(rows.back()[12], "");
  }
}

TEST_F(DisplacementProgram, UnknownMethodsAndLevelsAreRefusedWithTheChoices)
{
  const std::string scene = bumpy();
  folder_.write("rays.txt", "0.3 0.3 3 0 0 -1\n");
  for (const Arguments& command : {Arguments{"info", scene}, Arguments{"trace", scene, "--rays", file("rays.txt")},
                                   Arguments{"render", scene, "-o", file("o.exr")}}) {
    for (const char* method : {"cones", "microtriangle", "CHORD", "", "fast"}) {
      Arguments arguments = command;
      arguments.insert(arguments.end(), {"--displacement", method});
      const Outcome outcome = run(arguments);
      EXPECT_EQ(outcome.exit_code, 2) << command[0] << " " << method;
      std::string choices;
      for (const std::string_view label : kDisplacementMethodLabels) {
        choices += (choices.empty() ? "" : ", ") + std::string(label);
      }
      EXPECT_NE(outcome.errors.find("expected one of " + choices), std::string::npos) << outcome.errors;
    }
    if (command[0] == "info") continue;
    for (const char* level : {"-1", "31", "fine", ""}) {
      Arguments arguments = command;
      arguments.insert(arguments.end(), {"--lod", level});
      const Outcome outcome = run(arguments);
      EXPECT_EQ(outcome.exit_code, 2) << command[0] << " " << level;
      EXPECT_NE(outcome.errors.find("expected auto or a level"), std::string::npos) << outcome.errors;
    }
  }
  EXPECT_FALSE(exists("o.exr"));
}

TEST_F(DisplacementProgram, LevelsAverageTheMap)
{
  // Blocks of 2x2 texels with means 0, 64, 128 and 255; the last level is their mean, 111.75.
  const std::string scene = write(displaced_square(), std::string("\x00\x00\x00\x80\x00\x00\x40\x40"
                                                                  "\x80\x80\xff\xff\x80\x80\xff\xff",
                                                                  16));
  // Through the centres of the blocks.
  folder_.write("rays.txt", "0.25 0.25 3 0 0 -1\n0.75 0.25 3 0 0 -1\n0.25 0.75 3 0 0 -1\n0.75 0.75 3 0 0 -1\n");
  const double means[] = {0, 64, 128, 255};
  const auto level1 = trace(scene, {"--lod", "1"});
  const auto level2 = trace(scene, {"--lod", "2"});
  const auto level9 = trace(scene, {"--lod", "9"});
  for (std::size_t r = 0; r < 4; ++r) {
    EXPECT_NEAR(std::stod(level1[r][1]), 3 - 0.5 * means[r] / 255, 1e-5) << r;
    // The block's mean is also its bilinear value in the middle.
    EXPECT_NEAR(std::stod(level1[r][1]), std::stod(trace(scene, {"--lod", "0"})[r][1]), 1e-5) << r;
    EXPECT_NEAR(std::stod(level2[r][1]), 3 - 0.5 * 111.75 / 255, 1e-5) << r;
    EXPECT_EQ(level9[r], level2[r]);
  }
  EXPECT_EQ(trace(scene, {"--lod", "auto"}), trace(scene, {}));
  GltfBuilder b = displaced_square();
  displacement_of(b)["lod"] = 1;
  const std::string file = folder_.write("l.gltf", b.gltf()).string();
  EXPECT_EQ(trace(file, {}), level1);
  EXPECT_EQ(trace(file, {"--lod", "auto"}), trace(scene, {}));
}

TEST_F(DisplacementProgram, ExplainTellsOfPrismsAndHits)
{
  // A method that is named: what one height raises everywhere is moved, and rays meet no prism.
  const std::string scene = write(displaced_square(), std::string(16, '\xff'));
  folder_.write("rays.txt", "9 9 3 0 0 -1\n0.25 0.1875 3 0 0 -1\n");
  const Outcome hit = run({"trace", scene, "--rays", file("rays.txt"), "--displacement", "chord", "--explain", "1"});
  ASSERT_EQ(hit.exit_code, 0) << hit.errors;
  for (const char* text :
       {"ray: origin 0.25 0.1875 3, direction 0 0 -1, t 0 to inf\n",
        "mesh 0 triangle 0 (node 'ground'): prism, searched",
        "  hit: t 2.5, b 0.5625 0.25 0.1875, uv 0.25 0.1875, cell 0 0, height 1, displacement 0.5 m\n",
        "in all: ", "nearest: t 2.5, mesh 0 triangle 0, P 0.25 0.1875 0.5, Ng 0 0 1\n"}) {
    EXPECT_NE(hit.output.find(text), std::string::npos) << text << "\n" << hit.output;
  }
  // All t are in the length of the direction that was given, and the ray in object space is the one that was.
  folder_.write("long.txt", "0.25 0.1875 3 0 0 -100\n");
  const Outcome long_ray = run({"trace", scene, "--rays", file("long.txt"), "--displacement", "chord", "--explain", "0"});
  for (const char* text : {"  inside: t 0.02499", "direction 0 0 -100\n", "  hit: t 0.025, ", "nearest: t 0.025, "}) {
    EXPECT_NE(long_ray.output.find(text), std::string::npos) << text << "\n" << long_ray.output;
  }
  const Outcome miss = run({"trace", scene, "--rays", file("rays.txt"), "--displacement", "chord", "--explain", "0"});
  EXPECT_NE(miss.output.find("in all: 0 boxes, 0 prisms, 0 bounds, 0 texels, 0 inversions\nnearest: nothing\n"),
            std::string::npos)
      << miss.output;
  EXPECT_EQ(run({"trace", scene, "--rays", file("rays.txt"), "--explain", "2"}).exit_code, 2);
  EXPECT_EQ(run({"trace", scene, "--pixel", "1,1", "--explain", "0"}).exit_code, 2);
}

TEST_F(DisplacementProgram, ExplainTellsOfHeightsThatAreComputed)
{
  GltfBuilder b = displaced_square();
  displacement_of(b)["curved"] = true;
  displacement_of(b)["cells"] = 4;
  const std::string scene = write(b, std::string(16, '\xff'));
  folder_.write("rays.txt", "0.25 0.1875 3 0 0 -1\n");
  const Outcome hit = run({"trace", scene, "--rays", file("rays.txt"), "--explain", "0"});
  ASSERT_EQ(hit.exit_code, 0) << hit.errors;
  for (const char* text : {"mesh 0 triangle 0 (node 'ground'): prism, searched",
                           "  hit: t 2.5, b 0.5625 0.25 0.1875, cell 0 0, height 1, displacement 0.5 m\n",
                           "nearest: t 2.5, mesh 0 triangle 0, P 0.25 0.1875 0.5, Ng 0 0 1\n"}) {
    EXPECT_NE(hit.output.find(text), std::string::npos) << text << "\n" << hit.output;
  }
}

TEST_F(DisplacementProgram, OptionsOfMapsAreSaidToHaveNoEffectOnHeightsThatAreComputed)
{
  GltfBuilder b = displaced_square();
  displacement_of(b)["curved"] = true;
  const std::string scene = write(b, std::string(16, '\xff'));
  const auto errors = [&](const Arguments& more) {
    Arguments arguments = {"trace", scene, "--pixel", "1,1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
    return outcome.errors;
  };
  EXPECT_EQ(errors({}), "");
  EXPECT_EQ(errors({"--displacement", "chord"}), "");
  const std::string of_maps = " has no effect on heights that are computed";
  EXPECT_NE(errors({"--displacement", "rmip"}).find("displacement method 'rmip'" + of_maps), std::string::npos);
  EXPECT_NE(errors({"--lod", "2"}).find("a level of detail" + of_maps), std::string::npos);
}

TEST_F(DisplacementProgram, FramesKeepMapsAndTheirTables)
{
  GltfBuilder b = displaced_square();
  const int times = b.accessor<float>({0, 1}, "SCALAR"), places = b.accessor<float>({0, 0, 0, .2f, 0, 0}, "VEC3");
  b.push("animations", {{"samplers", {{{"input", times}, {"output", places}}}},
                        {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}});
  const std::string scene = bumpy(b);
  for (const std::string method : {"chord", "rmip"}) {
    const Arguments options = {"--displacement", method,  "--lod", "1",     "--resolution",
                               "24x24",          "--spp", "2",     "--aov", "beauty,depth"};
    const auto rendered = [&](const std::string& frames, const std::string& name) {
      Arguments all = {"--frames", frames, "--stats", file(name + ".#.json")};
      all.insert(all.end(), options.begin(), options.end());
      const Outcome outcome = render(scene, file(name + ".#.exr"), all);
      EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
    };
    const auto kept = [&](const std::string& name) {
      return nlohmann::json::parse(bytes_of_file(file(name + ".json")))["kept"];
    };
    rendered("1-3", "all");
    rendered("3", "alone");
    EXPECT_EQ(kept("all.1")["images"], 0);
    EXPECT_EQ(kept("all.1")["height_fields"], 0);
    EXPECT_EQ(kept("all.3")["images"], 1);
    EXPECT_EQ(kept("all.3")["height_fields"], 1);
    EXPECT_GT(kept("all.3")["bytes"], 16);
    EXPECT_EQ(kept("alone.3")["images"], 0);
    for (const char* channel : {"R", "depth.Z"})
      EXPECT_EQ(values_of(file("all.3.exr"), channel), values_of(file("alone.3.exr"), channel));
  }
}

TEST_F(DisplacementProgram, StepsInPicturesAndStatisticsAgree)
{
  const std::string scene = bumpy();
  for (const std::string method : {"chord", "rmip"}) {
    const Outcome outcome = render(
        scene, file("o.exr"),
        {"--displacement", method, "--aov", "displacement_steps", "--stats", file("o.json"), "--resolution", "32x32"});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
    const auto stats = nlohmann::json::parse(bytes_of_file(file("o.json")));
    const nlohmann::json& d = stats["displacement"];
    EXPECT_EQ(d["method"], method);
    EXPECT_EQ(d["geometries"], 1);
    EXPECT_EQ(d["prisms"], 2);
    EXPECT_EQ(d["map_bytes"], 16);
    EXPECT_GT(d["bytes"], 2 * 128);
    EXPECT_EQ(stats["rays"]["total"], stats["rays"]["camera"]);
    double sum = 0, largest = 0;
    for (const float steps : values_of(file("o.exr"), "displacement_steps.N")) {
      sum += static_cast<double>(steps);
      largest = std::max(largest, static_cast<double>(steps));
    }
    EXPECT_GT(sum, 0);
    EXPECT_NEAR(d["steps_mean"], sum / (32 * 32), 1e-6 * sum);
    EXPECT_GE(d["steps_max"], largest);
    EXPECT_LE(d["texels_mean"], d["steps_mean"]);
    const double rays = stats["rays"]["total"];
    EXPECT_NEAR(d["prisms_per_ray"], stats["counters"]["displaced_prisms"].get<double>() / rays, 1e-9);
  }
  // The layer is zero, and the object null, where nothing is displaced.
  ASSERT_EQ(render(folder_.write("p.gltf", lit_square().gltf()).string(), file("p.exr"),
                   {"--aov", "all", "--stats", file("p.json")})
                .exit_code,
            0);
  EXPECT_TRUE(nlohmann::json::parse(bytes_of_file(file("p.json")))["displacement"].is_null());
  for (const float steps : values_of(file("p.exr"), "displacement_steps.N")) EXPECT_EQ(steps, 0.0f);
}

TEST_F(DisplacementProgram, SmoothingTurnsShadingNormalsAndNothingElse)
{
  GltfBuilder b = displaced_square();
  const std::string scene = bumpy(b);
  displacement_of(b)["smoothing"] = true;
  const std::string smooth = folder_.write("smooth.gltf", b.gltf()).string();
  for (const auto& [file_of, name] : {std::pair{scene, "a.exr"}, {smooth, "b.exr"}}) {
    ASSERT_EQ(render(file_of, file(name), {"--aov", "normal,depth,position", "--filter", "box"}).exit_code, 0);
  }
  for (const char* channel : {"depth.Z", "position.X", "position.Y", "position.Z"}) {
    EXPECT_EQ(values_of(file("a.exr"), channel), values_of(file("b.exr"), channel)) << channel;
  }
  EXPECT_NE(values_of(file("a.exr"), "normal.X"), values_of(file("b.exr"), "normal.X"));
  folder_.write("rays.txt", "0.3 0.4 3 0 0 -1\n");
  EXPECT_EQ(trace(scene, {}), trace(smooth, {}));
}

TEST_F(DisplacementProgram, WhatIsNotFollowedIsAWarning)
{
  GltfBuilder half = displaced_square();
  displacement_of(half)["lod"] = 0.5;
  const std::string scene = bumpy(half);
  EXPECT_EQ(run({"info", scene, "--strict"}).exit_code, 0);
  const Outcome tessellated = run({"info", scene, "--displacement", "tessellate", "--strict"});
  EXPECT_EQ(tessellated.exit_code, 3);
  EXPECT_NE(tessellated.errors.find("material 'bark': tessellations have whole levels of detail; level 0 is used"),
            std::string::npos)
      << tessellated.errors;
}

TEST_F(DisplacementProgram, MethodsAreListed)
{
  const Outcome outcome = run({"info", "--methods"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json methods = nlohmann::json::parse(outcome.output);
  ASSERT_EQ(methods.size(), std::size(kDisplacementMethodLabels));
  for (std::size_t k = 0; k < methods.size(); ++k) {
    EXPECT_EQ(methods[k]["name"], kDisplacementMethodLabels[k]);
    EXPECT_FALSE(methods[k]["title"].get<std::string>().empty());
    EXPECT_FALSE(methods[k]["description"].get<std::string>().empty());
  }
}

TEST_F(DisplacementProgram, MethodsThatSceneFilesCannotHaveAreErrors)
{
  GltfBuilder b = displaced_square();
  displacement_of(b)["method"] = "cones";
  const Outcome outcome = run({"info", bumpy(b)});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_NE(outcome.errors.find("/materials/0/extensions/RELIEF_displacement/method"), std::string::npos)
      << outcome.errors;
  EXPECT_NE(outcome.errors.find("\"cones\""), std::string::npos) << outcome.errors;
}

TEST_F(DisplacementProgram, InfoSaysHowItIsTraced)
{
  // Two copies of one mesh share one geometry; on the edges to the second vertex the normals cancel.
  GltfBuilder b = displaced_square();
  b.root_node({{"mesh", 0}, {"translation", {2, 0, 0}}});
  const int N = b.accessor<float>({0, 0, 1, 0, 0, -1, 0, 0, 1, 0, 0, 1}, "VEC3");
  b.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = N;
  const Outcome outcome = run({"info", bumpy(b), "--displacement", "rmip"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  for (const char* text : {"displaced geometries: 1, traced by rmip, 0.0 MiB\n",
                           "  prisms: 2; folded (slower to trace) 2, with normals that cancel 2, without a normal 0\n",
                           ", displacement 0.0 MiB, acceleration structure ", "warning: 2 of 2 triangles of mesh "}) {
    EXPECT_NE(outcome.output.find(text), std::string::npos) << text << outcome.output;
  }
}

TEST_F(DisplacementProgram, TextureCoordinatesBeyondCountingAreSaidAndTheirTriangleStays)
{
  const std::string usual = bumpy();
  // Below the diagonal; the other triangle is as it was.
  folder_.write("rays.txt", "0.2 0.2 3 0 0 -1\n0.7 0.6 3 0 0 -1\n");
  const auto expected = trace(usual, {});
  for (const float far_uv : {1e20f, -1e20f, 1e30f}) {
    GltfBuilder b = displaced_square();
    const int uv = b.accessor<float>({far_uv, 0, 1, 0, 0, 1, 1, 1}, "VEC2");
    b.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = uv;
    const std::string scene = bumpy(b);
    const Outcome info = run({"info", scene});
    EXPECT_NE(info.output.find("1 of 2 triangles of mesh"), std::string::npos) << info.output;
    EXPECT_NE(info.output.find("(the first is triangle 0) have texture coordinates beyond"), std::string::npos)
        << info.output;
    for (const char* method : {"chord", "rmip", "rmip-minmax", "tfdm", "tessellate", "tessellate-grid"}) {
      const auto rows = trace(scene, {"--displacement", method});
      EXPECT_EQ(rows[0][0], "1") << method;
      // The mean of the map's corners, which uv (0, 0) is between.
      EXPECT_NEAR(std::stod(rows[0][1]), 3 - 0.5 * (0x10 + 0xf0 + 0x70 + 0x18) / (4 * 255.0), 1e-5) << method;
      EXPECT_EQ(rows[1][0], "1") << method;
      if (std::string(method).rfind("tessellate", 0) == 0) continue;
      EXPECT_EQ(rows[1][1], expected[1][1]) << method;
    }
  }
}

/// Half of the picture, 16x32, is free; in the other half rays run through 10⁹ tiles just below their highest points.
GltfBuilder endless_tiles()
{
  GltfBuilder b = displaced_square();
  const int uv = b.accessor<float>({0, 0, 1e9f, 0, 0, 1e9f, 1e9f, 1e9f}, "VEC2");
  b.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = uv;
  displacement_of(b)["scale"] = 0.001;
  displacement_of(b)["frobnicate"] = 1;  // warned of before the frame is begun
  b.json["cameras"][0]["orthographic"] = {{"xmag", 2e-7}, {"ymag", 4e-7}, {"znear", 0.1}, {"zfar", 100}};
  nlohmann::json& camera = b.json["nodes"].back();
  camera["translation"] = {-0.5, 0.5, 0.0010001};
  camera["rotation"] = {0.5, -0.5, -0.5, 0.5};  // along x, z upward
  return b;
}

TEST_F(DisplacementProgram, ATimeLimitOrASignalEndsRaysThroughTilesWithoutEnd)
{
  // One peak in every second row of texels, so that every row of cells has some.
  const std::string scene = write(endless_tiles(), std::string("\xff\0\0\0\0\0\0\0\0\0\xff\0\0\0\0\0", 16));
  // Generous: it is a second or two, and would be hours.
  constexpr double kMostSeconds = 300;
  for (const char* method : {"chord", "rmip", "rmip-minmax", "tfdm"}) {
    const Arguments options = {"--displacement", method, "--resolution", "16x32",
                               "--spp",          "1",    "--stats",      file("a.json")};
    const auto start = std::chrono::steady_clock::now();
    Arguments limited = options;
    limited.insert(limited.end(), {"--time-limit", "0.2"});
    const Outcome outcome = render(scene, file("a.exr"), limited);
    EXPECT_EQ(outcome.exit_code, 0) << method << outcome.errors;
    EXPECT_NE(outcome.errors.find("50 % of the picture has no sample"), std::string::npos) << method << outcome.errors;
    const nlohmann::json stats = nlohmann::json::parse(bytes_of_file(file("a.json")));
    EXPECT_EQ(stats["stop_reason"], "time_limit") << method;
    EXPECT_EQ(stats["samples_per_pixel"], 0.5) << method;

    Process process(render_arguments(scene, file("b.exr"), options), open_file("stdout"), open_file("stderr"));
    // The warning says that the scene is loaded.
    const auto pause = [] { std::this_thread::sleep_for(std::chrono::milliseconds(300)); };
    pause();
    for (int k = 0; k < 200 && bytes_of_file(file("stderr")).find("frobnicate") == std::string::npos; ++k) pause();
    pause();
    process.signal(SIGINT);
    EXPECT_EQ(process.wait(), 130) << method;
    EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(), kMostSeconds) << method;
  }
}

TEST_F(DisplacementProgram, ATimeLimitBeforeAnySampleIsAnError)
{
  GltfBuilder b = endless_tiles();
  b.json["nodes"].back()["translation"] = {-0.5, 0.5, 0.0009997};
  b.json["cameras"][0]["orthographic"]["ymag"] = 2e-7;
  const std::string scene = write(b, std::string("\xff\0\0\0\0\0\0\0\0\0\xff\0\0\0\0\0", 16));
  const Outcome outcome = render(scene, file("a.exr"), {"--time-limit", "0.2", "--spp", "1"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.errors.find("the time limit came before the first sample"), std::string::npos) << outcome.errors;
  EXPECT_FALSE(exists("a.exr"));
}

TEST_F(DisplacementProgram, WeldedSeamsAreClosedByWalls)
{
  // The half of the square beyond its diagonal is raised by 0.5 m, because it lies elsewhere in the map.
  GltfBuilder b = displaced_square();
  const int P = b.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0, 1, 1, 0}, "VEC3");
  const int N = b.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int uv = b.accessor<float>({.2f, .2f, .3f, .2f, .2f, .3f, .2f, .8f, .3f, .7f, .3f, .8f}, "VEC2");
  const int indices = b.accessor<std::uint16_t>({0, 1, 2, 3, 4, 5}, "SCALAR");
  b.json["meshes"][0]["primitives"][0]["attributes"] = {{"POSITION", P}, {"NORMAL", N}, {"TEXCOORD_0", uv}};
  b.json["meshes"][0]["primitives"][0]["indices"] = indices;
  const std::string map = std::string(8, '\x00') + std::string(8, '\xff');
  folder_.write("rays.txt", "0 0 0.25 1 1 0\n1 1 0.25 -1 -1 0\n");

  const std::string open = write(b, map);
  for (const auto& row : trace(open, {})) EXPECT_EQ(row[0], "0");
  EXPECT_EQ(run({"info", open}).output.find("walls"), std::string::npos);

  displacement_of(b)["seams"] = "weld";
  const std::string welded = write(b, map);
  const std::string info = run({"info", welded}).output;
  for (const char* text : {"uv seams with different heights: 1 edges, 1.41421 m, gap up to 0.5 m\n",
                           "left open by welding: 0 edges", "walls along seams: 2, one a side"}) {
    EXPECT_NE(info.find(text), std::string::npos) << text << info;
  }
  for (const std::string method : {"chord", "rmip", "rmip-minmax", "tfdm"}) {
    const auto rows = trace(welded, {"--displacement", method});
    for (const auto& row : rows) {
      ASSERT_EQ(row[0], "1") << method;
      const double expected[] = {.5, .5, .5, .25, -std::sqrt(.5), -std::sqrt(.5), 0};
      for (std::size_t k = 0; k < std::size(expected); ++k) EXPECT_NEAR(std::stod(row[1 + k]), expected[k], 1e-6);
    }
  }
  for (const std::string method : {"tessellate", "tessellate-grid"}) {
    for (const auto& row : trace(welded, {"--displacement", method})) EXPECT_EQ(row[0], "1") << method;
  }
}

TEST_F(DisplacementProgram, ResumeTellsMethodsAndLevelsApart)
{
  const std::string scene = bumpy();
  EXPECT_EQ(render(scene, file("o.exr"), {"--lod", "1"}).count("done"), 1);
  EXPECT_EQ(render(scene, file("o.exr"), {"--lod", "1", "--resume"}).count("skipped"), 1);
  EXPECT_EQ(render(scene, file("o.exr"), {"--lod", "0", "--resume"}).count("done"), 1);
  EXPECT_EQ(render(scene, file("o.exr"), {"--lod", "0", "--displacement", "tessellate", "--resume"}).count("done"), 1);
}

}  // namespace
}  // namespace relief::test
