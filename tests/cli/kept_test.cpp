// What stays from one frame or request to the next never shows in a picture: each is that of the frame alone.
#include <cmath>
#include <functional>

#include "exporters/png_encode.h"
#include "tests/cli/conversation.h"

namespace relief::test {
namespace {

/// A scene of which each part can be another.
struct Look {
  double scale = 0.3, midlevel = 0.2, turned = 0, lamp = 3, corner = 0, shift = 0;
  float vertex = 0.5f;
  std::string space = "object", method = "chord";
  std::vector<std::uint8_t> texels = {16, 144, 64, 240, 128, 32, 192, 96, 48, 255, 8, 160, 112, 80, 224, 24};
  int level = 0;
  bool alpha = false, smooth = false;
};

nlohmann::json quarter_turns(double angle) { return {0, 0, std::sin(angle / 2), std::cos(angle / 2)}; }

/// A displaced square, a mesh that occurs twice, and one that occurs once and stands across it; a lamp and an area light.
GltfBuilder scene_of(const Look& look)
{
  GltfBuilder b;
  const int N = b.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const auto s = static_cast<float>(look.shift);
  const int uv = b.accessor<float>({s, 0, 1 + s, 0, s, 1, 1 + s, 1}, "VEC2");
  const int square = b.accessor<std::uint16_t>({0, 1, 2, 2, 1, 3}, "SCALAR");
  const int flat = b.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, static_cast<float>(look.corner)}, "VEC3");
  const int leaf = b.accessor<float>({0, 0, 0, 0.3f, 0, 0.1f, 0, look.vertex, 0.2f}, "VEC3");
  const int wall = b.accessor<float>({0.7f, 0, 0, 0.7f, 1, 0, 0.9f, 0.3f, 1 + look.vertex}, "VEC3");
  b.mesh(
      {{"attributes", {{"POSITION", flat}, {"NORMAL", N}, {"TEXCOORD_0", uv}}}, {"indices", square}, {"material", 0}});
  b.mesh({{"attributes", {{"POSITION", leaf}}}, {"material", 1}});
  b.mesh({{"attributes", {{"POSITION", wall}}}, {"material", 1}});
  b.root_node({{"mesh", 0}, {"name", "ground"}});
  b.root_node(
      {{"mesh", 1}, {"name", "leaf"}, {"translation", {0.2, 0.1, 0.6}}, {"rotation", quarter_turns(look.turned)}});
  b.root_node({{"mesh", 1}, {"translation", {0.5, 0.4, 0.7}}});
  b.root_node({{"mesh", 2}});
  b.push("materials", {{"extensions",
                        {{"RELIEF_displacement",
                          {{"heightTexture", {{"uri", "h.png"}}},
                           {"scale", look.scale},
                           {"midlevel", look.midlevel},
                           {"space", look.space},
                           {"method", look.method},
                           {"lod", look.level},
                           {"smoothing", look.smooth}}}}}});
  nlohmann::json plain = {{"doubleSided", true}, {"pbrMetallicRoughness", {{"metallicFactor", 0}}}};
  if (look.alpha) {
    plain["alphaMode"] = "BLEND";
    plain["pbrMetallicRoughness"]["baseColorFactor"] = {1, 0.5, 0.5, 0.5};
  }
  b.push("materials", plain);
  b.json["extensionsUsed"] = {"RELIEF_displacement", "KHR_lights_punctual"};
  b.json["extensions"]["KHR_lights_punctual"] = {{"lights", {{{"type", "point"}, {"intensity", look.lamp}}}}};
  b.root_node({{"translation", {0.3, 0.6, 2}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  b.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.1}}}});
  b.root_node({{"camera", 0}, {"name", "eye"}, {"translation", {0.5, 0.5, 3}}});
  return b;
}

constexpr int kEye = 5, kLeaf = 1, kGround = 0;

/// The height map: a PNG, for which no process needs OpenImageIO.
std::string map_of(const Look& look) { return png_encode(4, 4, look.texels); }

class Kept : public ProgramTest {
 protected:
  std::string write(const Look& look)
  {
    // A file that is written again is another one.
    if (look.texels != written_) folder_.write("h.png", map_of(look));
    written_ = look.texels;
    return folder_.write("s.gltf", scene_of(look).gltf()).string();
  }

  std::vector<std::uint8_t> written_;

  void expect_same(const std::string& name, const std::string& other) const
  {
    for (const char* channel : {"R", "G", "B", "A", "depth.Z", "normal.X"})
      EXPECT_EQ(values_of(file(name), channel), values_of(file(other), channel)) << name << " " << channel;
  }

  nlohmann::json kept_of(const std::string& name) const
  {
    return nlohmann::json::parse(bytes_of_file(file(name)))["kept"];
  }
};

const Arguments kSmall = {"--resolution", "20x16", "--spp", "2", "--aov", "beauty,depth,normal"};

Arguments joined(Arguments a, const Arguments& b)
{
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

TEST_F(Kept, FramesAreThoseOfEachFrameAlone)
{
  Look look;
  look.space = "world";  // so that a node's scale is one of displacements
  GltfBuilder b = scene_of(look);
  const int times = b.accessor<float>({0, 0.5f}, "SCALAR");
  const auto animate = [&](int node, const std::string& path, const std::vector<float>& values) {
    const int sampler = static_cast<int>(b.json["animations"][0]["samplers"].size());
    b.json["animations"][0]["samplers"].push_back(
        {{"input", times}, {"output", b.accessor<float>(values, path == "rotation" ? "VEC4" : "VEC3")}});
    b.json["animations"][0]["channels"].push_back({{"sampler", sampler}, {"target", {{"node", node}, {"path", path}}}});
  };
  animate(kEye, "translation", {0.5f, 0.5f, 3, 0.2f, 0.8f, 2.5f});
  animate(kLeaf, "rotation", {0, 0, 0, 1, 0, 0, 0.7071068f, 0.7071068f});
  animate(kGround, "scale", {1, 1, 1, 1.25f, 1.25f, 1.25f});
  folder_.write("h.png", map_of(look));
  const std::string scene = folder_.write("s.gltf", b.gltf()).string();
  const auto rendered = [&](const std::string& frames, const std::string& name, const Arguments& more) {
    const Arguments all = {"render", scene, "-o", file(name + ".#.exr"), "--frames", frames};
    const Outcome outcome = run(joined(joined(all, kSmall), more));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  };
  rendered("1-12", "one", {"--threads", "1", "--stats", file("one.#.json")});
  rendered("1-12", "two", {"--threads", "2"});
  for (int frame = 1; frame <= 12; ++frame) {
    const std::string number = "." + std::to_string(frame) + ".exr";
    rendered(std::to_string(frame), "alone", {});
    expect_same("one" + number, "alone" + number);
    expect_same("two" + number, "alone" + number);
  }
  // The mesh of the leaf, which moves.
  EXPECT_EQ(kept_of("one.2.json")["meshes"], 1);
  EXPECT_EQ(kept_of("one.2.json")["height_fields"], 1);
  EXPECT_EQ(kept_of("one.1.json")["meshes"], 0);
}

TEST_F(Kept, RequestsForAChangingSceneAreThoseOfEachAlone)
{
  struct Step {
    std::string what;
    std::function<void(Look&)> change;
    int meshes;  ///< that are kept: of the ground, of the leaves, and the wall, if nothing of the top tree changes
    Arguments more = {};
  };
  const std::vector<Step> steps = {
      {"first", [](Look&) {}, 0},
      {"lamp", [](Look& l) { l.lamp = 5; }, 3},
      {"leaf", [](Look& l) { l.turned = 0.7; }, 2},
      {"scale", [](Look& l) { l.scale = 0.2; }, 1},
      {"midlevel", [](Look& l) { l.midlevel = 0.4; }, 1},
      {"map", [](Look& l) { l.texels[5] = 255; }, 1},
      {"uv", [](Look& l) { l.shift = 0.3; }, 1},
      {"corner", [](Look& l) { l.corner = 0.1; }, 1},
      {"smoothing", [](Look& l) { l.smooth = true; }, 3},
      {"method", [](Look& l) { l.method = "rmip"; }, 3},
      {"level", [](Look& l) { l.level = 1; }, 1},
      {"alpha", [](Look& l) { l.alpha = true; }, 1},
      {"vertex", [](Look& l) { l.vertex = 0.4f; }, 1},
      {"tessellated", [](Look& l) { l.method = "tessellate"; }, 2},
      {"chord", [](Look& l) { l.method = "chord"; }, 1},
      {"negative", [](Look& l) { l.scale = -0.2; }, 1},
      {"camera", [](Look&) {}, 3, {"--look-from", "0.2,0.1,2.5"}},
  };
  Conversation server(open_file("stderr"));
  Look look;
  int threads = 1;
  for (const Step& step : steps) {
    step.change(look);
    const std::string scene = write(look);
    const Arguments words = joined(kSmall, step.more);
    const auto with = [&](const std::string& name) {
      Arguments all = {scene, "-o", file(name + ".exr"), "--stats", file(name + ".json"), "--threads"};
      all.push_back(std::to_string(threads));
      return joined(all, words);
    };
    const nlohmann::json end = server.render(step.what, with("served"));
    ASSERT_EQ(end["exit_code"], 0) << step.what << end;
    const Outcome alone = run(joined({"render"}, with("alone")));
    ASSERT_EQ(alone.exit_code, 0) << step.what << alone.errors;
    SCOPED_TRACE(step.what);
    expect_same("served.exr", "alone.exr");
    EXPECT_EQ(kept_of("served.json")["scene"], false);
    EXPECT_EQ(kept_of("served.json")["meshes"], step.meshes);
    EXPECT_EQ(kept_of("alone.json")["bytes"], 0);
    threads = 3 - threads;
  }
}

TEST_F(Kept, OfASceneThatStaysNothingIsLoadedOrBuilt)
{
  const std::string scene = write({});
  Conversation server(open_file("stderr"));
  const auto written_camera = [&](double x) {
    GltfBuilder b = scene_of({});
    b.json["nodes"][kEye]["translation"][0] = x;
    return folder_.write("eye.gltf", b.gltf()).string();
  };
  const auto expect = [&](const Arguments& more, bool scene_kept, bool preparation_kept) {
    const auto with = [&](const std::string& name) {
      return joined({scene, "-o", file(name + ".exr"), "--stats", file(name + ".json"), "--threads", "2", "--aov",
                     "beauty,depth,normal"},
                    more);
    };
    EXPECT_EQ(server.render(1, with("served"))["exit_code"], 0);
    EXPECT_EQ(run(joined({"render"}, with("alone"))).exit_code, 0);
    expect_same("served.exr", "alone.exr");
    const nlohmann::json kept = kept_of("served.json");
    EXPECT_EQ(kept["scene"], scene_kept) << kept;
    EXPECT_EQ(kept["preparation"], preparation_kept) << kept;
    EXPECT_EQ(kept["seconds"] > 0, scene_kept || kept["meshes"] > 0) << kept;
  };
  const std::string eye = written_camera(0.5);
  const Arguments through = {"--camera-from", eye, "--spp", "1"};
  expect(joined(through, {"--resolution", "10x8"}), false, false);
  expect(joined(through, {"--resolution", "21x16", "--seed", "7"}), true, true);
  written_camera(0.3);
  expect(joined(through, {"--resolution", "21x16"}), true, true);
  expect(joined(through, {"--resolution", "21x16", "--displacement", "rmip"}), true, false);
  expect(joined(through, {"--resolution", "21x16", "--environment", "sky"}), false, false);
}

TEST_F(Kept, ACameraOfAnotherFileIsTheOnlyThingOfIt)
{
  const std::string scene = write({});
  GltfBuilder b = scene_of({});
  b.json["nodes"] = {b.json["nodes"][kEye]};
  b.json["scenes"][0]["nodes"] = {0};
  b.json["nodes"][0]["name"] = "other";
  b.json["nodes"][0]["translation"] = {0.5, 0.5, 2};
  const std::string other = folder_.write("other.gltf", b.gltf()).string();
  ASSERT_EQ(render(scene, file("from.exr"), joined(kSmall, {"--camera-from", other, "--camera", "other"})).exit_code,
            0);
  GltfBuilder moved = scene_of({});
  moved.json["nodes"][kEye]["translation"] = {0.5, 0.5, 2};
  const std::string same = folder_.write("moved.gltf", moved.gltf()).string();
  ASSERT_EQ(render(same, file("moved.exr"), kSmall).exit_code, 0);
  expect_same("from.exr", "moved.exr");

  const auto fails = [&](const Arguments& more, int exit_code, const std::string& text) {
    const Outcome outcome = render(scene, file("o.exr"), joined(kSmall, more));
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.errors;
    EXPECT_NE(outcome.errors.find(text), std::string::npos) << outcome.errors;
  };
  fails({"--camera-from", other, "--camera", "eye"}, 2, "expected one of 0 ('other')");
  fails({"--camera-from", file("none.gltf")}, 3, "none.gltf");
  fails({"--camera-from", other, "--look-from", "1,2,3"}, 2, "--camera-from");
  GltfBuilder blind = scene_of({});
  blind.json["nodes"][kEye].erase("camera");
  fails({"--camera-from", folder_.write("blind.gltf", blind.gltf()).string()}, 3, "one with a camera");
  EXPECT_FALSE(exists("o.exr"));
}

}  // namespace
}  // namespace relief::test
