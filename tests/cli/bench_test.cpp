// `relief bench`: that it runs, what it writes, and that all exact methods find the same hits. Times are not
// looked at: they belong to the machine.
#include <algorithm>
#include <set>

#include "displacement/method.h"
#include "tests/cli/program.h"
#include "tests/support/image_bytes.h"

namespace relief::test {
namespace {

class Bench : public ProgramTest {};

TEST_F(Bench, QuickRunMeasuresEveryMethodOnEveryScene)
{
  const std::string json_file = file("bench.json"), html_file = file("bench.html");
  const Outcome outcome = run({"bench", "displacement", "--quick", "--json", json_file, "--html", html_file});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json json = nlohmann::json::parse(bytes_of_file(json_file));
  ASSERT_EQ(json["scenes"].size(), 10u);
  std::set<std::string> expected = {"rmip-low", "rmip-high", "rmip-affine", "tfdm-affine"};
  for (const DisplacementMethod method : kDisplacementMethods) expected.emplace(displacement_method_label(method));
  for (const nlohmann::json& scene : json["scenes"]) {
    std::set<std::string> methods;
    for (const nlohmann::json& method : scene["methods"]) {
      const std::string name = method["method"];
      methods.insert(name);
      EXPECT_GT(method["bytes"], 0);
      for (const char* kind : {"primary", "bounce", "shadow"}) {
        SCOPED_TRACE(scene["scene"].get<std::string>() + " " + name + " " + kind);
        EXPECT_GT(scene["rays"][kind], 500);
        EXPECT_GT(method[kind]["nanoseconds_per_ray"], 0);
        const double share = method[kind]["hit_share"];
        EXPECT_GE(share, std::string(kind) == "primary" ? 0.2 : 0.001);
        EXPECT_LE(share, 1.0);
        if (method.contains("micro_triangles")) {
          // At full rate facets are close to the surface; coarser ones are only said to be.
          EXPECT_LT(method[kind]["disagreement"], method["edges_per_texel"] == 1.0 ? 0.25 : 1.0);
          continue;
        }
        // One surface, one answer; a hit may fall on either side of a texel's border or of t_min.
        EXPECT_LT(method[kind]["disagreement"], 1e-3);
        EXPECT_GT(method[kind]["bounds"], 0);
      }
    }
    EXPECT_EQ(methods, expected);
  }
  EXPECT_EQ(json["marching"].size(), 4u);
  EXPECT_EQ(json["sweeps"].size(), 4u);
  EXPECT_EQ(json["inversion"].size(), 80u);
  for (const nlohmann::json& variant : json["inversion"]) {
    // Two triangles a cell are another surface, which differs the more the coarser the map is.
    EXPECT_LT(variant["disagreement"], variant["variant"] == "two triangles a cell" ? 0.2 : 1e-3) << variant;
  }
  EXPECT_EQ(json["tessellation"].size(), 6u);
  EXPECT_EQ(json["frames"].size(), 10u * std::size(kDisplacementMethods));
  for (const nlohmann::json& frame : json["frames"]) {
    const std::string method = frame["method"];
    EXPECT_GT(frame["rays"], 1000);
    // Exact methods trace the same paths but for hits in the last bit.
    const bool is_exact = method == "rmip" || method == "tfdm";
    EXPECT_LT(frame["difference"], is_exact ? 0.02 : 1.0) << frame;
  }

  ASSERT_EQ(json["vectors"].size(), 4u);
  for (const nlohmann::json& scene : json["vectors"]) {
    ASSERT_EQ(scene["methods"].size(), 5u);
    EXPECT_GT(scene["triangles"], scene["base_triangles"]);
    for (const nlohmann::json& method : scene["methods"]) {
      EXPECT_GE(method["peak_bytes"], method["bytes"]) << method;
      for (const char* kind : {"primary", "bounce", "shadow"}) {
        // One surface: tiles agree with each other, and Embree's triangles but for rays along their sides.
        const bool is_tiles = method["name"].get<std::string>().starts_with("tiles");
        EXPECT_LE(method["rays"][kind]["disagreement"], is_tiles ? 0 : 0.01) << scene["name"] << method << kind;
      }
    }
  }

  const std::string html = bytes_of_file(html_file);
  EXPECT_NE(html.find("<svg"), std::string::npos);
  EXPECT_NE(html.find("data:image/png;base64,"), std::string::npos);
  EXPECT_EQ(html.find("http"), std::string::npos);
  EXPECT_NE(outcome.output.find("| chord |"), std::string::npos);
}

TEST_F(Bench, PartsAndScenesAreChosen)
{
  const std::string json_file = file("bench.json");
  const Outcome outcome = run({"bench", "displacement", "--quick", "--scenes", "roof,glass", "--parts",
                               "inversion,tessellation", "--json", json_file});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json json = nlohmann::json::parse(bytes_of_file(json_file));
  EXPECT_EQ(json["scenes"].size(), 0u);
  EXPECT_EQ(json["inversion"].size(), 16u);
  EXPECT_EQ(json["tessellation"].size(), 6u);
}

TEST_F(Bench, TessellationsThatDoNotFitAreCoarserAndSaySo)
{
  const std::string json_file = file("bench.json");
  const Outcome outcome = run({"bench", "displacement", "--quick", "--memory", "0.004", "--scenes", "roof", "--parts",
                               "table", "--json", json_file});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_NE(outcome.output.find("COARSER"), std::string::npos);
  const nlohmann::json json = nlohmann::json::parse(bytes_of_file(json_file));
  for (const nlohmann::json& method : json["scenes"][0]["methods"]) {
    if (!method.contains("micro_triangles")) continue;
    EXPECT_LT(method["edges_per_texel"], 1.0);
    EXPECT_LT(method["bytes"], 4 << 20);
  }
}

TEST_F(Bench, AMeshAMapAndRaysOfOnesOwn)
{
  // A square, displaced evenly by half of the scale: rays down on it, beside it, and one that just reaches it from the side.
  const std::string corners = "v -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\n", uv = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
  const std::string mesh = folder_.write("square.obj", corners + uv + "f 1/1 2/2 -2/3 -1/-1\n").string();
  const std::string map = folder_.write("map.tga", tga_grey(8, 4, std::string(32, '\xff'))).string();
  const std::string rays =
      folder_.write("rays.txt", "0 1 0 0 -1 0\n.5 1 .5 0 -2 0 0 9\n# beside\n2 1 0 0 -1 0\n-3 .09 0 1 -.015 0\n")
          .string();
  const std::string json_file = file("own.json"), csv_file = file("own.csv");
  for (const auto& [midlevel, share] : {std::pair("0.5", .75), std::pair("0", .5)}) {
    const Outcome outcome =
        run({"bench", "displacement", "--quick", "--mesh", mesh, "--map", map, "--scale", "0.1", "--tiles", "2",
             "--midlevel", midlevel, "--rays", rays, "--json", json_file, "--csv", csv_file});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
    const nlohmann::json json = nlohmann::json::parse(bytes_of_file(json_file));
    ASSERT_EQ(json["scenes"].size(), 1u);
    const nlohmann::json& scene = json["scenes"][0];
    EXPECT_EQ(scene["scene"], "square.obj");
    EXPECT_EQ(scene["triangles"], 2);
    EXPECT_EQ(scene["map_width"], 8);
    EXPECT_EQ(scene["map_height"], 4);
    EXPECT_EQ(scene["rays"]["primary"], 4);
    for (const nlohmann::json& method : scene["methods"]) EXPECT_EQ(method["primary"]["hit_share"], share) << method;
    const std::string csv = bytes_of_file(csv_file);
    EXPECT_EQ(static_cast<std::size_t>(std::count(csv.begin(), csv.end(), '\n')), 1 + 3 * scene["methods"].size());
    EXPECT_NE(csv.find("\nsquare.obj,chord,primary,4,"), std::string::npos) << csv;
  }
  const std::string scene_file = folder_.write("square.gltf", square_scene().gltf()).string();
  EXPECT_EQ(
      run({"bench", "displacement", "--quick", "--parts", "table", "--mesh", scene_file, "--map", map, "--scale", "1"})
          .exit_code,
      0);

  for (const auto& [text, message] :
       {std::pair(corners + uv + "f 1/1 2/2 5/3\n", "line 9: expected entries from 1 to 4"),
        std::pair(corners + uv + "f 1 2 3\n", "line 9: expected corners with texture"),
        std::pair(corners + uv + "f 1/1 2/2\n", "line 9: expected three corners"),
        std::pair(corners + uv, "expected faces"), std::pair("v 1 2 x\n" + corners, "line 1: expected 3"),
        std::pair("v 1 nan 2\n" + corners, "line 1: expected 3"),
        std::pair(corners + "vt 0 0\nf 1/1 2/1 3/1\n", "with an area")}) {
    const std::string broken = folder_.write("broken.obj", text).string();
    const Outcome outcome = run({"bench", "displacement", "--mesh", broken, "--map", map, "--scale", "1"});
    EXPECT_EQ(outcome.exit_code, 3);
    EXPECT_NE(outcome.errors.find("broken.obj: "), std::string::npos) << outcome.errors;
    EXPECT_NE(outcome.errors.find(message), std::string::npos) << outcome.errors;
  }
}

TEST_F(Bench, ConeMapsAreTracedAndJudged)
{
  const std::string json_file = file("cones.json"), html_file = file("cones.html");
  const Outcome outcome = run({"bench", "heightfield", "--quick", "--json", json_file, "--html", html_file});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json json = nlohmann::json::parse(bytes_of_file(json_file));
  ASSERT_EQ(json["textures"].size(), 3u);
  for (const nlohmann::json& texture : json["textures"]) {
    EXPECT_EQ(texture["generation_seconds"].size(), 7u);
    EXPECT_EQ(texture["traced"].size(), 88u);
    for (const nlohmann::json& row : texture["traced"]) {
      EXPECT_GT(row["nanoseconds_a_ray"], 0);
      if (row["stepping"] == "every cell") {
        EXPECT_EQ(row["wrong"], 0);
      }
    }
  }
  EXPECT_NE(bytes_of_file(html_file).find("Table 2"), std::string::npos);
}

TEST_F(Bench, ConeMapsOfFilesAreStudiedBesideTheOthers)
{
  std::string texels;
  for (int k = 0; k < 32 * 20; ++k) texels += static_cast<char>(60 + k * k * 37 % 90);
  const std::string map = folder_.write("map.tga", tga_grey(32, 20, texels)).string();
  const std::string small = folder_.write("small.tga", tga_grey(8, 8, texels.substr(0, 64))).string();
  const std::string json_file = file("cones.json");
  const Outcome outcome =
      run({"bench", "heightfield", "--quick", "--map", map, "--cones", "quick,quick-relaxed", "--json", json_file});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json json = nlohmann::json::parse(bytes_of_file(json_file));
  ASSERT_EQ(json["textures"].size(), 4u);
  EXPECT_EQ(json["textures"][3]["texture"], "map");
  EXPECT_EQ(json["textures"][3]["generation_seconds"].size(), 4u);
  for (const nlohmann::json& row : json["textures"][3]["traced"]) {
    if (row["stepping"] == "every cell") {
      EXPECT_EQ(row["wrong"], 0);
    }
  }
  const Outcome refused = run({"bench", "heightfield", "--quick", "--map", map, "--map", small});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_NE(refused.errors.find("16 texels a side"), std::string::npos) << refused.errors;
}

TEST_F(Bench, MarchingFindsTheMicroTriangles)
{
  const std::string json_file = file("march.json");
  const Outcome outcome = run({"bench", "procedural", "--quick", "--parts", "marching,lattice", "--json", json_file});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json json = nlohmann::json::parse(bytes_of_file(json_file));
  ASSERT_EQ(json["marches"].size(), 10u);
  for (const nlohmann::json& march : json["marches"]) {
    // As published it may lose some.
    EXPECT_LT(march["missed"], 0.01) << march;
    EXPECT_LT(march["passed_over"], 0.01) << march;
    EXPECT_LT(march["invented"], 0.01) << march;
  }
  double last = 1;
  for (const nlohmann::json& lattice : json["lattices"]) {
    EXPECT_LT(lattice["error"], last) << lattice;
    last = lattice["error"];
  }
}

TEST_F(Bench, SmoothSurfacesHaveNoEdges)
{
  const std::string json_file = file("smoothing.json"), scene = RELIEF_SOURCE_DIR "/examples/displaced/displaced.gltf";
  const Outcome outcome =
      run({"bench", "procedural", "--parts", "smoothing", "--mesh", scene, "--json", json_file, "--quick"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json json = nlohmann::json::parse(bytes_of_file(json_file));
  ASSERT_EQ(json["smoothings"].size(), 3u);
  const nlohmann::json& icosahedron = json["smoothings"][0];
  EXPECT_EQ(icosahedron["sides"], 30);
  EXPECT_NEAR(icosahedron["flat_largest_degrees"].get<double>(), 41.8103, 1e-3);  // 180° less its dihedral angle
  EXPECT_NEAR(icosahedron["flat_mean_degrees"].get<double>(), 41.8103, 1e-3);
  for (const nlohmann::json& result : json["smoothings"]) {
    EXPECT_LT(result["curved_largest_degrees"].get<double>(), 0.02) << result;  // what differences can tell
    EXPECT_EQ(result["over_a_tenth_of_a_degree"], 0) << result;
  }
}

TEST_F(Bench, WorldsOfMoreThanCouldBeStoredAreTraced)
{
  const std::string json_file = file("worlds.json"), html_file = file("worlds.html");
  const Outcome outcome = run(
      {"bench", "procedural", "--quick", "--parts", "pot,terrain,planet", "--json", json_file, "--html", html_file});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json json = nlohmann::json::parse(bytes_of_file(json_file));
  EXPECT_TRUE(json["marches"].empty());
  ASSERT_EQ(json["worlds"].size(), 3u);
  EXPECT_EQ(json["worlds"][0]["triangles"], 4680);
  EXPECT_EQ(json["worlds"][2]["triangles"], 960);
  for (const nlohmann::json& world : json["worlds"]) {
    for (const nlohmann::json& result : world["results"]) {
      SCOPED_TRACE(world["world"].get<std::string>() + " " + result["n"].dump());
      const double n = result["n"], triangles = world["triangles"];
      EXPECT_GE(result["lattices"], triangles);
      if (n > 0) {
        EXPECT_EQ(result["micro_triangles"], triangles * n * n);
      }
      EXPECT_GT(result["primary"]["hit_share"], 0.2);
      EXPECT_GT(result["primary"]["first_tiles"], 0);
      // Few of the heights that there are were made.
      EXPECT_LT(result["height_bytes"], 256 << 20);
      for (const char* kind : {"primary", "bounce", "shadow"}) EXPECT_GT(result[kind]["nanoseconds_a_ray"], 0);
    }
  }
  EXPECT_NE(bytes_of_file(html_file).find("hours for the paper"), std::string::npos);
}

TEST_F(Bench, WrongUseIsRefused)
{
  for (const Arguments& arguments :
       {Arguments{"bench"}, Arguments{"bench", "displacement", "--scenes", "teapot"},
        Arguments{"bench", "displacement", "--parts", "all"},
        Arguments{"bench", "displacement", "--parts", "vector", "--scenes", "roof"},
        Arguments{"bench", "displacement", "--json", "bench.txt"},
        Arguments{"bench", "displacement", "--mesh", "a.obj"}, Arguments{"bench", "displacement", "--rays", "rays.txt"},
        Arguments{"bench", "procedural", "--parts", "vase"}}) {
    EXPECT_EQ(run(arguments).exit_code, 2) << arguments.back();
  }
  const Outcome other = run({"bench", "displacement", "--mesh", "a.stl", "--map", "m.png", "--scale", "1"});
  EXPECT_EQ(other.exit_code, 3);
  EXPECT_NE(other.errors.find("a.stl: expected a mesh whose name ends in .obj, .gltf or .glb"), std::string::npos);
}

TEST_F(Bench, FiguresAreFilesOfTheirOwn)
{
  const std::string folder = file("figures");
  ASSERT_EQ(
      run({"bench", "displacement", "--quick", "--scenes", "glass", "--parts", "table", "--figures", folder}).exit_code,
      0);
  for (const char* name : {"01-primary-rays", "02-bounce-rays", "03-shadow-rays", "04-memory-besides-the-map"}) {
    const std::string svg = bytes_of_file(folder + "/" + name + ".svg");
    EXPECT_NE(svg.find("chord"), std::string::npos) << name;
  }
}

}  // namespace
}  // namespace relief::test
