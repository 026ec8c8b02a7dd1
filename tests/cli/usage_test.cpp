// What the program says to somebody who is new to it: what was meant, what a scene has to offer, which frames it has.
#include "cli/suggestion.h"
#include "tests/cli/program.h"

namespace relief::test {
namespace {

using UsageProgram = ProgramTest;

TEST(NearestWord, IsNoFurtherThanATypingErrorInFourLetters)
{
  const std::vector<std::string> known = {"render", "merge", "trace", "--resolution", "--seed"};
  EXPECT_EQ(nearest_word("rendr", known), "render");
  EXPECT_EQ(nearest_word("rneder", known), "render");
  EXPECT_EQ(nearest_word("--resoltuion", known), "--resolution");
  EXPECT_EQ(nearest_word("--sed", known), "--seed");
  EXPECT_EQ(nearest_word("teapot", known), "");
  EXPECT_EQ(nearest_word("", known), "");
  EXPECT_EQ(nearest_word(std::string(100000, 'x'), known), "");
}

TEST_F(UsageProgram, SaysWhatWasMeant)
{
  const std::string scene = folder_.write("s.gltf", lit_square().gltf()).string();
  const std::pair<Arguments, const char*> kCases[] = {
      {{"rendr", scene, "-o", file("a.exr")}, "did you mean relief render?"},
      {{scene}, "did you mean relief render "},
      {{"render", scene, "-o", file("a.exr"), "--samples", "4"}, "did you mean --spp?"},
      {{"render", scene, "-o", file("a.exr"), "--resoltion=4x4"}, "did you mean --resolution?"},
      {{"render", scene, "-o", file("a.exr"), "--frame", "4"}, "did you mean --frames?"},
      {{"trace", scene, "--pixl", "4,4"}, "did you mean --pixel?"},
      {{"render", scene, "-o", file("a.png")}, "--png"},
  };
  for (const auto& [arguments, expected] : kCases) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << expected;
    EXPECT_NE(outcome.errors.find(expected), std::string::npos) << outcome.errors;
  }
  EXPECT_EQ(run({"frobnicate"}).errors.find("did you mean"), std::string::npos);
  EXPECT_EQ(run({"help"}).output, run({"--help"}).output);
  const Outcome help = run({"help", "render"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_NE(help.output.find("--resolution"), std::string::npos);
}

TEST_F(UsageProgram, AViewIsLookedUpWithoutAPng)
{
  const std::string scene = folder_.write("s.gltf", lit_square().gltf()).string();
  EXPECT_NE(render(scene, file("a.exr"), {"--view", "No such view"}).exit_code, 0);
  EXPECT_FALSE(exists("a.exr"));
  EXPECT_EQ(render(scene, file("a.exr"), {"--view", "Standard"}).exit_code,
            render(scene, file("b.exr"), {"--view", "Standard", "--png", file("b.png")}).exit_code);
}

/// A square with two animations, from second 0 to 0.25 and from 0.125 to 0.5.
GltfBuilder animated_square()
{
  GltfBuilder b = lit_square();
  for (const auto& [name, start, end] : {std::tuple{"slide", 0.0f, 0.25f}, {"hop", 0.125f, 0.5f}}) {
    const int times = b.accessor<float>({start, end}, "SCALAR"), values = b.accessor<float>({0, 0, 0, 1, 0, 0}, "VEC3");
    b.push("animations", {{"name", name},
                          {"samplers", {{{"input", times}, {"output", values}}}},
                          {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}});
  }
  return b;
}

TEST_F(UsageProgram, AllFramesAreTheScenes)
{
  GltfBuilder b = animated_square();
  // Half a second of 8 frames a second.
  b.json["extensions"]["RELIEF_render"] = {{"fps", 8}};
  std::string scene = folder_.write("s.gltf", b.gltf()).string();
  ASSERT_EQ(render(scene, file("a.#.exr"), {"--frames", "all", "--spp", "1"}).exit_code, 0);
  for (const int frame : {0, 1, 2, 3, 4}) EXPECT_TRUE(exists("a." + std::to_string(frame) + ".exr")) << frame;
  EXPECT_FALSE(exists("a.5.exr"));
  b.json["extensions"]["RELIEF_render"] = {{"frameRange", {7, 8}}};
  scene = folder_.write("s.gltf", b.gltf()).string();
  ASSERT_EQ(render(scene, file("b.#.exr"), {"--frames", "all", "--spp", "1"}).exit_code, 0);
  EXPECT_FALSE(exists("b.6.exr"));
  EXPECT_TRUE(exists("b.7.exr"));
  EXPECT_TRUE(exists("b.8.exr"));
  EXPECT_FALSE(exists("b.9.exr"));
  b.json["extensions"]["RELIEF_render"] = {{"frameRange", {-2, 1}}};
  const Outcome outcome = render(folder_.write("s.gltf", b.gltf()).string(), file("c.#.exr"), {"--frames", "all"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_NE(outcome.errors.find("found -2 to 1"), std::string::npos) << outcome.errors;
}

TEST_F(UsageProgram, InfoTellsClipsNodesAndTheBox)
{
  const std::string scene = folder_.write("s.gltf", animated_square().gltf()).string();
  const std::string text = run({"info", scene}).output;
  for (const char* line : {"frames: 0 to 12 at 24 a second", "  clip slide: 0.25 s, from 0 to 0.25 s",
                           "  clip hop: 0.375 s, from 0.125 to 0.5 s", "bounding box: 0 0 0 to 1 1 0 m",
                           "named nodes (2): square, front"}) {
    EXPECT_NE(text.find(line), std::string::npos) << line << '\n' << text;
  }
}

}  // namespace
}  // namespace relief::test
