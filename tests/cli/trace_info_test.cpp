// `relief trace` and `relief info` against scenes whose answers are known.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "tests/cli/program.h"
#include "tests/support/image_bytes.h"

namespace relief::test {
namespace {

using TraceInfoProgram = ProgramTest;

std::vector<std::vector<std::string>> csv_rows(const std::string& text)
{
  std::vector<std::vector<std::string>> rows;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    rows.emplace_back();
    std::istringstream fields(line + ",");
    for (std::string field; std::getline(fields, field, ',');) rows.back().push_back(field);
  }
  return rows;
}

/// The line of a text that has a word, from there on; without one, the text.
std::string line_of(const std::string& text, const std::string& word)
{
  const std::size_t at = text.find(word);
  return at == std::string::npos ? text : text.substr(at, text.find('\n', at) - at);
}

GltfBuilder triangle_scene()
{
  GltfBuilder b;
  const int P = b.accessor<float>({0, 0, 0, 2, 0, 0, 0, 2, 0}, "VEC3");
  b.mesh({{"attributes", {{"POSITION", P}}}});
  b.root_node({{"mesh", 0}, {"translation", {10, 0, 0}}});
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 0.1}}}});
  b.root_node({{"camera", 0}, {"translation", {10, 0, 5}}});
  return b;
}

TEST_F(TraceInfoProgram, TraceOfAKnownTriangle)
{
  const std::string scene = folder_.write("t.gltf", triangle_scene().gltf()).string();
  folder_.write("rays.txt",
                "# a comment, and an empty line\n\n"
                "10.5 1 3  0 0 -2\n"
                "\t10.5 1 3 0 0 -2 0 1.25\r\n"
                "  # indented\n"
                "10.5 1 3 0 0 -2 1.6 inf\n"
                "10.5 1 -3 0 1e-60 2 1 2\n"
                "11.5 1.5 3 0 0 -1\n"
                "shadow 10.5 1 3 0 0 -2 0 inf\n");
  const Outcome outcome = run({"trace", scene, "--rays", file("rays.txt")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const auto rows = csv_rows(outcome.output);
  ASSERT_EQ(rows.size(), 7u);
  EXPECT_EQ(outcome.output.substr(0, outcome.output.find('\n')), "hit,t,px,py,pz,nx,ny,nz,u,v,mesh,triangle,steps");
  const std::vector<double> kHit = {1, 1.5, 10.5, 1, 0, 0, 0, 1, .25, .5, 0, 0};
  for (const std::size_t r : {1u, 4u, 6u}) {
    ASSERT_EQ(rows[r].size(), 13u) << r;
    for (std::size_t i = 0; i < kHit.size(); ++i) {
      // The second ray comes from behind, where the geometric normal is still that of the front.
      EXPECT_NEAR(std::stod(rows[r][i]), kHit[i], 1e-6) << "row " << r << " field " << i;
    }
    EXPECT_EQ(rows[r][12], "");
  }
  // t runs to 1.25, from 1.6, and beside the triangle.
  for (const std::size_t r : {2u, 3u, 5u}) {
    ASSERT_EQ(rows[r].size(), 13u);
    EXPECT_EQ(rows[r][0], "0");
    for (std::size_t i = 1; i < 13; ++i) EXPECT_EQ(rows[r][i], "");
  }
  EXPECT_EQ(run({"trace", scene, "--rays", file("rays.txt"), "-o", file("hits.csv")}).exit_code, 0);
  EXPECT_EQ(bytes_of_file(file("hits.csv")), outcome.output);
}

TEST_F(TraceInfoProgram, RaysThatAreNoRaysNameTheirLine)
{
  const std::string scene = folder_.write("t.gltf", triangle_scene().gltf()).string();
  for (const char* line : {"1 2 3 4 5", "1 2 3 4 5 6 7", "1 2 3-4 5 6", "1 2 3 0 0 0", "nan 2 3 4 5 6",
                           "1 2 3 4 5 6 -1 2", "1 2 3 4 5 6 0 nan", "1,2,3,4,5,6", "1e99 0 0 0 0 1"}) {
    folder_.write("rays.txt", std::string("0 0 0 0 0 1\n") + line + "\n");
    const Outcome outcome = run({"trace", scene, "--rays", file("rays.txt"), "-o", file("hits.csv")});
    EXPECT_EQ(outcome.exit_code, 3) << line;
    EXPECT_NE(outcome.errors.find("rays.txt: line 2: expected"), std::string::npos) << outcome.errors;
    EXPECT_FALSE(exists("hits.csv"));
  }
  EXPECT_EQ(run({"trace", scene, "--rays", file("nothing.txt")}).exit_code, 3);
  EXPECT_EQ(run({"trace", scene, "--rays", file("")}).exit_code, 3);
}

TEST_F(TraceInfoProgram, RaysOfAPixelFedBackHitWhereThePathWentOn)
{
  // Two squares face one another, so that paths have several bounces.
  GltfBuilder b = lit_square();
  b.root_node({{"mesh", 0}, {"translation", {0, 1, 1}}, {"rotation", {1, 0, 0, 0}}});
  const std::string scene = folder_.write("s.gltf", b.gltf()).string();
  int num_followed = 0;
  for (int sample = 0; sample < 6; ++sample) {
    const std::string pixel = "48,52," + std::to_string(sample);
    ASSERT_EQ(run({"trace", scene, "--pixel", pixel, "--resolution", "128x128", "-o", file("p.txt")}).exit_code, 0);
    std::istringstream lines(bytes_of_file(file("p.txt")));
    std::string paths;
    std::vector<std::vector<double>> origins;
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("path ", 0) != 0) continue;
      paths += line + "\n";
      std::istringstream numbers(line.substr(5));
      origins.emplace_back(3);
      for (double& x : origins.back()) numbers >> x;
    }
    ASSERT_GE(origins.size(), 1u);
    folder_.write("rays.txt", paths);
    const auto rows = csv_rows(run({"trace", scene, "--rays", file("rays.txt")}).output);
    ASSERT_EQ(rows.size(), origins.size() + 1);
    for (std::size_t i = 0; i + 1 < origins.size(); ++i) {
      ASSERT_EQ(rows[i + 1][0], "1");
      for (std::size_t axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(std::stod(rows[i + 1][2 + axis]), origins[i + 1][axis], 1e-5) << pixel << " ray " << i;
      }
      ++num_followed;
    }
  }
  EXPECT_GE(num_followed, 4);
}

/// What `relief trace --pixel` says a path brings.
std::vector<double> radiance_of(const std::string& text)
{
  std::istringstream words(text);
  std::string hash, name, value;
  words >> hash >> name;
  EXPECT_EQ(name, "radiance") << text;
  std::vector<double> radiance;
  while (radiance.size() < 3 && words >> value) radiance.push_back(std::stod(value));
  return radiance;
}

TEST_F(TraceInfoProgram, PathsOfAPixelAreThoseOfThePicture)
{
  const std::string scene = folder_.write("s.gltf", mirrored_lamp().gltf()).string();
  for (const char* caustics : {"on", "off"}) {
    const Arguments options = {"--resolution",  "24x24", "--spp",  "4",         "--seed",   "7",
                               "--max-bounces", "5",     "--crop", "2,3,22,23", "--filter", "blackman-harris",
                               "--caustics",    caustics};
    Arguments render = {"render", scene, "-o", file("s.exr"), "--float"};
    render.insert(render.end(), options.begin(), options.end());
    ASSERT_EQ(run(render).exit_code, 0);
    const Picture picture = exr_load(file("s.exr"));
    for (const auto& [x, y] : {std::pair{8, 11}, {10, 13}}) {
      std::vector<double> mean(3);
      for (int sample = 0; sample < 4; ++sample) {
        Arguments trace = {"trace", scene, "--pixel",
                           std::to_string(x) + "," + std::to_string(y) + "," + std::to_string(sample)};
        trace.insert(trace.end(), options.begin(), options.end());
        const Outcome outcome = run(trace);
        ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
        const std::vector<double> radiance = radiance_of(outcome.output);
        ASSERT_EQ(radiance.size(), 3u);
        for (std::size_t c = 0; c < 3; ++c) mean[c] += radiance[c] / 4;
      }
      for (std::size_t c = 0; c < 3; ++c) {
        const double expected = picture_layer(picture, "").channels[c].at(x - 2, y - 3);
        EXPECT_GT(expected, 0);
        EXPECT_NEAR(mean[c], expected, 2e-6 * expected) << x << ',' << y << " caustics " << caustics;
      }
    }
  }
}

TEST_F(TraceInfoProgram, ACommandIsPrintedThatFollowsASampleThatWasNotFinite)
{
  // What the square emits, and what it reflects of a sky as bright, are together more than a float holds.
  GltfBuilder b = lit_square();
  b.json["extensionsUsed"].push_back("KHR_materials_emissive_strength");
  b.json["extensions"]["RELIEF_environment"]["color"] = {3e38, 3e38, 3e38};
  b.push("materials", {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}},
                       {"emissiveFactor", {1, 1, 1}},
                       {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 3e38}}}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  const std::string scene = folder_.write("it's a scene.gltf", b.gltf()).string();
  const Outcome rendered = run({"render",
                                scene,
                                "-o",
                                file("s.exr"),
                                "--frames",
                                "3",
                                "--resolution",
                                "33x21",
                                "--spp",
                                "5",
                                "--seed",
                                "12345678901",
                                "--crop",
                                "3,2,30,20",
                                "--filter",
                                "box",
                                "--max-bounces",
                                "1",
                                "--caustics",
                                "off",
                                "--camera",
                                "front",
                                "--displacement",
                                "chord",
                                "--lod",
                                "0",
                                "--displacement-memory",
                                "0.5"});
  ASSERT_EQ(rendered.exit_code, 0) << rendered.errors;
  const std::size_t at = rendered.errors.find("relief trace ");
  ASSERT_NE(at, std::string::npos) << rendered.errors;
  const std::string command = rendered.errors.substr(at, rendered.errors.find('\n', at) - at);
  for (const char* given : {"--resolution 33x21", "--spp 5", "--seed 12345678901", "--crop 3,2,30,20", "--filter box",
                            "--max-bounces 1", "--caustics off", "--camera front", "--displacement chord", "--lod 0",
                            "--displacement-memory 0.5", "--frame 3", "--pixel "}) {
    EXPECT_NE(command.find(given), std::string::npos) << command;
  }
  const std::string shell = "relief() { '" RELIEF_PROGRAM "' \"$@\"; }\n" + command + " > '" + file("path.txt") + "'\n";
  folder_.write("replay.sh", shell);
  ASSERT_EQ(std::system(("sh '" + file("replay.sh") + "'").c_str()), 0) << command;
  const std::vector<double> radiance = radiance_of(bytes_of_file(file("path.txt")));
  ASSERT_EQ(radiance.size(), 3u);
  EXPECT_FALSE(std::isfinite(radiance[0]));
}

TEST_F(TraceInfoProgram, TraceSeesTheFrameItIsAskedFor)
{
  GltfBuilder b = triangle_scene();
  const int times = b.accessor<float>({0, 1}, "SCALAR"), values = b.accessor<float>({0, 0, 0, 0, 0, 1}, "VEC3");
  b.push("animations", {{"samplers", {{{"input", times}, {"output", values}}}},
                        {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}});
  const std::string scene = folder_.write("t.gltf", b.gltf()).string();
  folder_.write("rays.txt", "0.5 0.5 3 0 0 -1\n");
  const auto rows = csv_rows(run({"trace", scene, "--rays", file("rays.txt"), "--frame", "12"}).output);
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_NEAR(std::stod(rows[1][1]), 2.5, 1e-6);
}

TEST_F(TraceInfoProgram, TraceUsage)
{
  const std::string scene = folder_.write("t.gltf", triangle_scene().gltf()).string();
  folder_.write("rays.txt", "0 0 0 0 0 1\n");
  EXPECT_EQ(run({"trace", scene}).exit_code, 2);
  EXPECT_EQ(run({"trace", scene, "--rays", file("rays.txt"), "--pixel", "1,1"}).exit_code, 2);
  EXPECT_EQ(run({"trace", scene, "--rays", file("rays.txt"), "--seed", "1"}).exit_code, 2);
  EXPECT_EQ(run({"trace", scene, "--pixel", "960,0"}).exit_code, 2);
  EXPECT_EQ(run({"trace", scene, "--pixel", "959,539"}).exit_code, 0);
  EXPECT_EQ(run({"trace", scene, "--pixel", "5,5", "--crop", "6,0,9,9"}).exit_code, 2);
  EXPECT_EQ(run({"trace", scene, "--pixel", "5,5,8", "--spp", "8"}).exit_code, 2);
  for (const Arguments& option : {Arguments{"--spp", "4"},
                                  {"--crop", "0,0,1,1"},
                                  {"--filter", "box"},
                                  {"--caustics", "on"},
                                  {"--max-bounces", "1"},
                                  {"--displacement-memory", "1"}}) {
    Arguments trace = {"trace", scene, "--rays", file("rays.txt")};
    trace.insert(trace.end(), option.begin(), option.end());
    EXPECT_EQ(run(trace).exit_code, 2) << option[0];
  }
  EXPECT_EQ(run({"trace", scene, "--pixel", "1,1", "--camera", "nobody"}).exit_code, 2);
}

TEST_F(TraceInfoProgram, InfoCountsWhatIsThere)
{
  GltfBuilder b = lit_square();
  b.root_node({{"mesh", 0}, {"translation", {2, 0, 0}}});
  b.root_node({{"mesh", 0}, {"translation", {4, 0, 0}}});
  b.push("materials", {{"name", "glow"}, {"emissiveFactor", {1, 1, 1}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  b.json["extensionsUsed"].push_back("RELIEF_render");
  b.json["extensions"]["RELIEF_render"] = {{"resolution", {320, 200}}, {"samples", 17}, {"maxBounces", 3}, {"seed", 5},
                                           {"frameRange", {2, 9}},     {"fps", 25}};
  const Outcome outcome = run({"info", folder_.write("s.gltf", b.gltf()).string()});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  for (const char* line : {"image: 320x200, 17 samples, 3 bounces, seed 5\n", "frames: 2 to 9 at 25 a second\n",
                           "meshes: 1 with 2 triangles; instances: 3 with 6 triangles in all\n", "cameras (1): front\n",
                           "lights: 0 placed, 6 emissive triangles, constant environment\n", "textures: 0\n"}) {
    EXPECT_NE(outcome.output.find(line), std::string::npos) << line << outcome.output;
  }
}

TEST_F(TraceInfoProgram, InfoNamesTheFeaturesThatAreUsed)
{
  const auto features = [&](const GltfBuilder& b) {
    return line_of(run({"info", folder_.write("s.gltf", b.gltf()).string()}).output, "features: ");
  };
  // glTF's default material is a metal.
  EXPECT_EQ(features(lit_square()), "features: metal; caustic casters 0, value graphs 0, open apertures 0");
  GltfBuilder b = lit_square();
  b.json["images"] = {{{"uri", kPixelPng}}};
  b.json["textures"] = {{{"source", 0}}};
  b.push("materials", {{"alphaMode", "BLEND"},
                       {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"roughnessFactor", 0}}},
                       {"normalTexture", {{"index", 0}}}});
  b.push("materials",
         {{"extensions", {{"KHR_materials_sheen", {{"sheenColorFactor", {1, 1, 1}}}}}}});  // nothing has it
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  EXPECT_EQ(
      features(b),
      "features: textures, normal maps, transparency, metal; caustic casters 1, value graphs 0, open apertures 0");
}

TEST_F(TraceInfoProgram, InfoShowsSettingsThatAreNotTheDefaults)
{
  GltfBuilder b = lit_square();
  const auto settings = [&] {
    return line_of(run({"info", folder_.write("s.gltf", b.gltf()).string()}).output, "settings: ");
  };
  EXPECT_EQ(settings(), "settings: as by default");
  b.json["extensions"]["RELIEF_render"] = {
      {"samples", 64},    {"maxBounces", 3},      {"diffuseBounces", 2},          {"noiseThreshold", 0.1},
      {"view", "Filmic"}, {"resolution", {4, 3}}, {"caustics", {{"mode", "off"}}}};
  EXPECT_EQ(
      settings(),
      "settings: resolution [4,3], noiseThreshold 0.1, maxBounces 3, diffuseBounces 2, view \"Filmic\", caustics.mode "
      "\"off\"");
}

TEST_F(TraceInfoProgram, InfoListsAllSettingsWithoutAScene)
{
  const Outcome outcome = run({"info", "--settings"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const auto all = nlohmann::json::parse(outcome.output);
  const auto named = [&](const char* name) {
    return *std::find_if(all.begin(), all.end(), [&](const auto& s) { return s.at("name") == name; });
  };
  const auto samples = named("samples");
  EXPECT_EQ(samples.at("type"), "integer");
  EXPECT_EQ(samples.at("default"), 64);
  EXPECT_EQ(samples.at("range"), (nlohmann::json{1, 2147483647}));
  EXPECT_NE(samples.at("description"), "");
  EXPECT_EQ(named("noiseThreshold").at("range"), (nlohmann::json{0, nullptr}));
  EXPECT_EQ(named("caustics.mode").at("range"), (nlohmann::json{"auto", "on", "off"}));
  EXPECT_EQ(named("resolution").at("default"), (nlohmann::json{960, 540}));
  EXPECT_EQ(named("view").at("range"), nullptr);
  EXPECT_EQ(named("luminousEfficacy").at("default"), nullptr);
  EXPECT_EQ(run({"info"}).exit_code, 2);
  EXPECT_EQ(run({"info", "--settings", file("s.gltf")}).exit_code, 2);
}

TEST_F(TraceInfoProgram, InfoSaysWhetherThereWillBePhotons)
{
  const std::string scene = folder_.write("s.gltf", mirrored_lamp().gltf()).string();
  const std::string plain = folder_.write("p.gltf", lit_square().gltf()).string();
  const auto caustics = [&](const Arguments& arguments) { return line_of(run(arguments).output, "caustics: "); };
  EXPECT_EQ(caustics({"info", scene}), "caustics: photons where they pay (lights on casters)");
  EXPECT_EQ(caustics({"info", scene, "--caustics", "off"}), "caustics: none (off)");
  EXPECT_EQ(caustics({"info", plain, "--caustics", "on"}), "caustics: none (nothing casts caustics)");
  EXPECT_EQ(run({"info", scene, "--caustics", "sometimes"}).exit_code, 2);
}

// A square of two triangles with a material each: one is raised by half a metre, the other by a tenth or not at all.
TEST_F(TraceInfoProgram, InfoShowsBordersBetweenMaterials)
{
  for (const auto& [both, welds, by_vertices] :
       {std::array{false, false, false}, std::array{true, false, false}, std::array{false, true, false},
        std::array{true, true, false}, std::array{true, false, true}}) {
    GltfBuilder b;
    const int first = b.accessor<float>({0, 0, 0, 1, 0, 0, 1, 1, 0}, "VEC3"),
              second = b.accessor<float>({0, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3"),
              N = b.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3"),
              uv = b.accessor<float>({0, 0, 1, 0, 0, 1}, "VEC2");
    const auto primitive = [&](int P, int material) {
      return nlohmann::json{{"attributes", {{"POSITION", P}, {"NORMAL", N}, {"TEXCOORD_0", uv}}},
                            {"material", material}};
    };
    b.mesh(primitive(first, 0));
    b.json["meshes"][0]["primitives"].push_back(primitive(second, 1));
    b.root_node({{"mesh", 0}});
    folder_.write("white.tga", tga_grey(1, 1, "\xff"));
    const auto raised = [welds = welds](double scale) {
      return nlohmann::json{{"RELIEF_displacement",
                             {{"heightTexture", {{"uri", "white.tga"}}},
                              {"scale", scale},
                              {"midlevel", 0},
                              {"seams", welds ? "weld" : "keep"}}}};
    };
    b.push("materials", {{"name", "bark"}, {"extensions", raised(0.5)}});
    b.push("materials", {{"name", "moss"}, {"extensions", both ? raised(0.1) : nlohmann::json::object()}});
    b.json["extensionsUsed"].push_back("RELIEF_displacement");
    // What one height raises everywhere is moved by its vertices, unless a method is named.
    std::vector<std::string> arguments{"info", folder_.write("s.gltf", b.gltf()).string()};
    if (!by_vertices) arguments.insert(arguments.end(), {"--displacement", "chord"});
    const Outcome outcome = run(arguments);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
    const std::string extent = std::string("1 edges, 1.41421 m, gap up to ") + (both ? "0.4" : "0.5") + " m\n";
    const std::string expected = "borders with other materials: " + extent +
                                 "      left open: " + (welds ? "0 edges, 0 m, gap up to 0 m\n" : extent);
    const std::size_t at = outcome.output.find(expected);
    EXPECT_NE(at, std::string::npos) << outcome.output;
    EXPECT_EQ(outcome.output.find(expected, at + 1) != std::string::npos, both) << outcome.output;
  }
}

// A square of two triangles with vertices of their own. Along the diagonal one side reads u = ¼, the centre of the first
// texel, the other u = ¾, that of the second.
TEST_F(TraceInfoProgram, InfoShowsHeightMapsAndTheirSeams)
{
  GltfBuilder b;
  const int P = b.accessor<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3");
  const int N = b.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int uv = b.accessor<float>({.25, 0, 2, 0, .25, 1, .75, 0, .75, 1, 0, 1}, "VEC2");
  b.mesh({{"attributes", {{"POSITION", P}, {"NORMAL", N}, {"TEXCOORD_0", uv}}}, {"material", 0}});
  b.root_node({{"mesh", 0}});
  folder_.write("h.tga", tga_grey(2, 1, "\x33\xff"));
  b.push("materials",
         {{"name", "bark"},
          {"extensions",
           {{"RELIEF_displacement", {{"heightTexture", {{"uri", "h.tga"}}}, {"scale", 0.5}, {"method", "chord"}}}}}});
  b.json["extensionsUsed"].push_back("RELIEF_displacement");
  const Outcome outcome = run({"info", folder_.write("s.gltf", b.gltf()).string()});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  for (const char* text :
       {"height maps: 1\n", "(h.tga): 2x1, 8-bit, 0.0 MiB, heights 0.2 to 1, wrap repeat, repeat\n",
        "displacements: 1\n", "  bark: ", "method chord, scale 0.5 m, midlevel 0.5, object space\n",
        "meshes: 1, uv 0 to 2, 0 to 1\n", "uv seams with different heights: 1 edges, 1.41421 m, gap up to 0.4 m\n",
        ", height maps 0.0 MiB, "}) {
    EXPECT_NE(outcome.output.find(text), std::string::npos) << text << outcome.output;
  }
}

}  // namespace
}  // namespace relief::test
