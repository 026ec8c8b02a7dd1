// Files that want to harm: that promise more than there is memory for, that end never, that speak to the terminal. And runs
// where memory is short anyhow.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <sys/resource.h>

#include "scene/diagnostics.h"
#include "tests/cli/program.h"
#include "tests/support/image_bytes.h"

namespace relief {
namespace {

using namespace test;
using nlohmann::json;

/// How many times the memory sanitizers take, which shadow all of it.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr double kShadows = 6;
#else
constexpr double kShadows = 1;
#endif

/// Most that any process started here has had in memory, MiB.
double peak_mib()
{
  rusage usage{};
  ::getrusage(RUSAGE_CHILDREN, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

class HostileProgram : public ProgramTest {
 protected:
  std::string write(const std::string& name, const GltfBuilder& b) const
  {
    return folder_.write(name, b.gltf()).string();
  }

  /// The square with a file as its colour, or as its heights.
  std::string with_image(const std::string& image, bool as_heights) const
  {
    GltfBuilder b = square_scene();
    b.push("images", {{"uri", image}});
    b.push("textures", {{"source", 0}});
    json material = {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}};
    if (as_heights) {
      material = {{"extensions", {{"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}}}}}};
      b.json["extensionsUsed"] = {"RELIEF_displacement"};
    }
    b.push("materials", material);
    b.json["meshes"][0]["primitives"][0]["material"] = 0;
    return write(image + ".gltf", b);
  }

  void expect_refusal(const Outcome& outcome, const std::string& of) const
  {
    EXPECT_EQ(outcome.exit_code, 1) << of << "\n" << outcome.errors;
    EXPECT_EQ(outcome.errors.rfind("relief: out of memory: ", 0), 0u) << of << "\n" << outcome.errors;
    EXPECT_NE(outcome.errors.find(of), std::string::npos) << outcome.errors;
    EXPECT_NE(outcome.errors.find("(--max-memory)"), std::string::npos) << outcome.errors;
  }
};

// A progressive JPEG of 150 bytes took 8.4 GB, one with colours would have taken 25; a tile of a TIFF 8.3, an interlaced PNG
// 4.2, the table of an OpenEXR's tiles 34.
TEST_F(HostileProgram, SmallImagesThatPromiseMuchAreRefusedWithTheNumber)
{
  const std::pair<const char*, std::string> images[] = {{"grey.jpg", jpeg_progressive(65500, 65500, 1)},
                                                        {"rgb.jpg", jpeg_progressive(65500, 65500, 3)},
                                                        {"interlaced.png", png_header(65536, 65536, true)},
                                                        {"tile.tif", tiff_tile(65536)},
                                                        {"tiles.exr", exr_tiles(65536, 1)},
                                                        {"tile.exr", exr_tiles(65536, 65536)}};
  for (const auto& [name, bytes] : images) {
    ASSERT_LT(bytes.size(), 1000u);
    folder_.write(name, bytes);
    for (const bool as_heights : {false, true}) {
      expect_refusal(run({"info", with_image(name, as_heights), "--max-memory", "0.5"}), name);
    }
  }
  EXPECT_LT(peak_mib(), 500 * kShadows);
}

// Where it says little and holds what it says, the same image is read.
TEST_F(HostileProgram, SmallImagesAreReadUnderTheSameLimit)
{
  folder_.write("h.tga", tga_grey(2, 1, "\x33\xff"));
  for (const bool as_heights : {false, true}) {
    const Outcome outcome = run({"info", with_image("h.tga", as_heights), "--max-memory", "0.5"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  }
}

// A buffer was read whole: 5 GB for one that says it has 384 bytes.
TEST_F(HostileProgram, ABufferIsReadAsFarAsItsLengthSays)
{
  GltfBuilder b = square_scene();
  const std::string scene = write("s.gltf", b);
  json gltf = json::parse(bytes_of_file(scene));
  gltf["buffers"][0]["uri"] = "long.bin";
  folder_.write("long.bin", b.binary);
  std::filesystem::resize_file(file("long.bin"), std::uintmax_t{8} << 30);
  folder_.write("s.gltf", gltf.dump());
  const Outcome outcome = run({"info", scene, "--max-memory", "0.5"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_LT(peak_mib(), 300 * kShadows);
  gltf["buffers"][0]["byteLength"] = std::uint64_t{8} << 30;
  folder_.write("s.gltf", gltf.dump());
  expect_refusal(run({"info", scene, "--max-memory", "0.5"}), "long.bin: needs up to 8.0 GiB");
  EXPECT_LT(peak_mib(), 300 * kShadows);
}

TEST_F(HostileProgram, RaysWithoutEndAreRefused)
{
  const std::string scene = write("s.gltf", square_scene());
  const Outcome outcome = run({"trace", scene, "--rays", "/dev/zero", "-o", file("hits.csv")});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_NE(outcome.errors.find("/dev/zero: line 1: expected at most 4096 characters, found more"), std::string::npos)
      << outcome.errors;
  std::string rays;
  for (int i = 0; i < 400'000; ++i) rays += "0 0 1 0 0 -1\n";
  folder_.write("rays.txt", rays);
  expect_refusal(run({"trace", scene, "--rays", file("rays.txt"), "-o", file("hits.csv"), "--max-memory", "0.1"}),
                 "rays.txt");
  EXPECT_LT(peak_mib(), 200 * kShadows);
}

// Six files of a kilobyte, each with ten references to the next.
TEST_F(HostileProgram, AMillionReferencesAreRefusedWhereMemoryIsShort)
{
  write("r0.gltf", square_scene());
  for (int level = 1; level <= 6; ++level) {
    GltfBuilder b;
    b.json["extensionsUsed"] = {"RELIEF_reference"};
    for (int i = 0; i < 10; ++i) {
      b.root_node({{"translation", {i, level, 0}},
                   {"extensions", {{"RELIEF_reference", {{"uri", "r" + std::to_string(level - 1) + ".gltf"}}}}}});
    }
    write("r" + std::to_string(level) + ".gltf", b);
  }
  expect_refusal(run({"info", file("r6.gltf"), "--max-memory", "0.2"}), "r");
  EXPECT_LT(peak_mib(), 300 * kShadows);
  EXPECT_EQ(run({"info", file("r3.gltf"), "--max-memory", "0.2"}).exit_code, 0);
}

/// A strip of many vertices that all primitives name.
GltfBuilder primitives_on_one_accessor(int num_primitives, bool own_indices)
{
  constexpr int kVertices = 40'000;
  GltfBuilder b;
  std::vector<float> positions;
  for (int i = 0; i < kVertices; ++i) {
    positions.insert(positions.end(), {static_cast<float>(i / 2), static_cast<float>(i % 2), 0});
  }
  const int P = b.accessor<float>(positions, "VEC3");
  json primitives = json::array();
  for (int p = 0; p < num_primitives; ++p) {
    primitives.push_back({{"attributes", {{"POSITION", P}}}, {"mode", 5}});
    if (!own_indices) continue;
    // From one end to the other, so that the range of what is used is all.
    const auto i = static_cast<std::uint32_t>(p + 1);
    primitives.back()["mode"] = 4;
    primitives.back()["indices"] = b.accessor<std::uint32_t>({0, i, kVertices - 1}, "SCALAR");
  }
  b.push("meshes", {{"primitives", primitives}});
  b.root_node({{"mesh", 0}});
  return b;
}

// 3,000 primitives on one accessor took 4.4 GB.
TEST_F(HostileProgram, PrimitivesOnOneAccessorShareItOrTakeTheirPart)
{
  const std::string equal = write("equal.gltf", primitives_on_one_accessor(3000, false));
  const Outcome shared = run({"info", equal, "--max-memory", "0.5"});
  EXPECT_EQ(shared.exit_code, 0) << shared.errors;
  EXPECT_NE(shared.output.find("meshes: 1 with 39998 triangles; instances: 3000 with 119994000 triangles in all"),
            std::string::npos)
      << shared.output;
  const std::string parts = write("parts.gltf", primitives_on_one_accessor(3000, true));
  const Outcome taken = run({"info", parts, "--max-memory", "0.5"});
  EXPECT_EQ(taken.exit_code, 0) << taken.errors;
  EXPECT_LT(peak_mib(), 300 * kShadows);
}

TEST_F(HostileProgram, APictureTooLargeForMemoryIsRefused)
{
  const std::string scene = write("s.gltf", lit_square());
  expect_refusal(render(scene, file("o.exr"), {"--resolution", "20000x20000", "--max-memory", "0.5"}),
                 "a picture of 20000 x 20000 pixels");
  EXPECT_FALSE(exists("o.exr"));
}

/// What nothing that a file says may bring to a terminal; newlines are judged by whole lines.
void expect_printable(const std::string& text, const std::string& of)
{
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_EQ(line, printable_text(line)) << of;
    EXPECT_NE(line.rfind("forged", 0), 0u) << of << ": " << line;
  }
}

TEST_F(HostileProgram, NothingOfAFileCommandsTheTerminal)
{
  // Clears the screen, begins a line of its own, a bell; CSI in its short form; a turn of the direction of writing.
  const std::string evil =
      "n\x1b[2J\nforged: all is well\r\a\xc2\x9b"
      "31m\xe2\x80\xae";
  GltfBuilder b = lit_square();
  b.json["nodes"][0]["name"] = evil;
  b.json["meshes"][0]["name"] = evil;
  b.json["cameras"][0]["name"] = evil;
  b.json["asset"]["generator"] = evil;
  b.json["nodes"][1]["name"] = evil;
  folder_.write("h.tga", tga_grey(2, 1, "\x33\xff"));
  b.push("images", {{"uri", "h.tga"}, {"name", evil}});
  b.push("textures", {{"source", 0}});
  b.push(
      "materials",
      {{"name", evil},
       {"unknown" + evil, 1},
       {"extensions",
        {{"KHR_" + evil, json::object()}, {"RELIEF_displacement", {{"heightTexture", {{"index", 0}}}, {evil, 1}}}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  b.json["extensionsUsed"] = {"RELIEF_environment", "RELIEF_displacement", "RELIEF_render", "KHR_" + evil};
  const std::string good = write("good.gltf", b);
  b.json["extensions"]["RELIEF_render"]["view"] = evil;
  const std::string view = write("view.gltf", b);
  b.json["extensions"]["RELIEF_render"]["view"] = json::array({evil});
  const std::string bad = write("bad.gltf", b);
  folder_.write("rays.txt", "0.1 0.2 5 0 0 -1\n");
  folder_.write("evil_rays.txt", "0 0 1 0 0 \x1b]0;forged\a -1\xff\n");
  folder_.write("scene" + evil.substr(0, 8) + ".gltf", "{");
  const std::vector<std::pair<Arguments, std::set<int>>> runs = {
      {{"info", good}, {0}},
      {{"info", bad}, {3}},
      {{"info", file("scene" + evil.substr(0, 8) + ".gltf")}, {3}},
      {{"info", file(evil)}, {3}},
      {{"trace", good, "--rays", file("rays.txt")}, {0}},
      {{"trace", good, "--rays", file("rays.txt"), "--explain", "0"}, {0}},
      {{"trace", good, "--rays", file("evil_rays.txt")}, {3}},
      {{"trace", good, "--pixel", "1,1", "--camera", evil + "x"}, {2}},
      {{"render", good, "-o", file("a.exr"), "--spp", "1", "--resolution", "8x8", "--camera", "other" + evil}, {2}},
      {{"render", view, "-o", file("b.exr"), "--png", file("b.png"), "--spp", "1", "--resolution", "8x8"}, {3}},
      {{"render", good, "-o", file("c.exr"), "--spp", "1", "--resolution", "8x8", "--progress", "json"}, {0}},
      {{"render", good, "-o", file("d.exr"), "--spp", "1", "--resolution", "8x8", "--stats", file("s" + evil)}, {0}},
      {{"render", good, "-o", file("e.exr"), "--png", file("e.png"), "--view", evil + "\xff"}, {3}},
      {{"compare", file("c.exr"), file("d.exr"), "--layer", evil}, {3}},
      {{"compare", file("c.exr"), file("d" + evil)}, {3}},
      {{"merge", file("c.exr"), file(evil), "-o", file("m.exr")}, {3}},
      {{evil}, {2}},
  };
  for (const auto& [arguments, codes] : runs) {
    const Outcome outcome = run(arguments);
    std::string of;
    for (const std::string& argument : arguments) of += printable_text(argument) + " ";
    EXPECT_TRUE(codes.count(outcome.exit_code) > 0) << of << outcome.exit_code << " " << outcome.errors;
    expect_printable(outcome.output, of);
    expect_printable(outcome.errors, of);
  }
}

// Of 76 such runs four ended in std::terminate, and others blamed an image.
TEST_F(HostileProgram, LittleMemoryIsSaidAndNothingElseIsBlamed)
{
  if (kShadows > 1) GTEST_SKIP() << "sanitizers reserve terabytes of addresses";
  std::string texels;
  for (int i = 0; i < 256 * 256; ++i) texels += static_cast<char>(i * 7919 >> 3);
  folder_.write("h.tga", tga_grey(256, 256, texels));
  GltfBuilder plain = lit_square();
  const std::string scenes[] = {write("plain.gltf", plain), with_image("h.tga", false), with_image("h.tga", true)};
  int num_failed = 0, num_done = 0;
  for (const std::string& scene : scenes) {
    for (std::uint64_t mib = 48; mib < 1600; mib += std::max<std::uint64_t>(16, mib / 6)) {
      const std::uint64_t bytes = mib << 20;
      // Below this the program does not come to its own code.
      if (run({"--version"}, bytes).exit_code != 0) continue;
      const Outcome outcome =
          run(render_arguments(scene, file("o.exr"), {"--spp", "1", "--png", file("o.png")}), bytes);
      num_failed += outcome.exit_code == 1 ? 1 : 0;
      num_done += outcome.exit_code == 0 ? 1 : 0;
      EXPECT_TRUE(outcome.exit_code == 0 || outcome.exit_code == 1)
          << scene << " in " << mib << " MiB: " << outcome.exit_code << " " << outcome.errors;
      if (outcome.exit_code == 1) {
        EXPECT_NE(outcome.errors.find("relief: out of memory"), std::string::npos)
            << scene << " in " << mib << " MiB: " << outcome.errors;
      }
    }
  }
  EXPECT_GT(num_failed, 0) << "no limit was short";
  EXPECT_GT(num_done, 0) << "every limit was short";
}

}  // namespace
}  // namespace relief
