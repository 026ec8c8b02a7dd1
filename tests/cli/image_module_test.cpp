// OpenImageIO is loaded when the first image is opened that is neither PNG, JPEG, HDR nor EXR, and not before: it takes longer than many a command.
// Here it cannot be loaded at all, since a file of its name that is no library comes first in the search path.
#include "tests/cli/program.h"

namespace relief::test {
namespace {

class ImageModule : public ProgramTest {
 protected:
  void SetUp() override
  {
    folder_.write(RELIEF_OPENIMAGEIO_NAME, "not a library");
    ::setenv("LD_LIBRARY_PATH", file("").c_str(), 1);
  }
  void TearDown() override { ::unsetenv("LD_LIBRARY_PATH"); }

  /// A scene with an image as base colour. @return its path
  std::string scene_write(std::string_view uri)
  {
    GltfBuilder b = lit_square();
    b.push("images", {{"uri", uri}});
    b.push("textures", {{"source", 0}});
    b.push("materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
    b.json["meshes"][0]["primitives"][0]["material"] = 0;
    return folder_.write("scene.gltf", b.gltf()).string();
  }
};

TEST_F(ImageModule, IsNotNeededForPngHdrAndExr)
{
  const std::string scene = scene_write(kPixelPng);
  EXPECT_EQ(render(scene, file("a.exr"), {"--png", file("a.png")}).exit_code, 0);
  EXPECT_EQ(render(scene, file("b.exr"), {"--seed", "2"}).exit_code, 0);
  const std::string sky = folder_.write("sky.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\nabc\x80").string();
  EXPECT_EQ(render(scene, file("s.exr"), {"--environment", sky}).exit_code, 0);
  EXPECT_EQ(render(scene, file("p.exr"), {"--preview", file("color.exr")}).exit_code, 0);
  EXPECT_EQ(render(scene, file("e.exr"), {"--environment", file("color.exr")}).exit_code, 0);
  for (const Arguments& arguments : {Arguments{"info", scene},
                                     {"compare", file("a.exr"), file("b.exr"), "--diff", file("d.png")},
                                     {"merge", file("a.exr"), file("b.exr"), "-o", file("c.exr")}}) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << arguments[0] << ": " << outcome.errors;
  }
}

TEST_F(ImageModule, IsMissedByNameWhereThereIsAnotherImage)
{
  // One pixel.
  folder_.write("a.tga", std::string("\0\0\2\0\0\0\0\0\0\0\0\0\1\0\1\0\x18\x20", 18) + "abc");
  const std::string scene = scene_write("a.tga");
  const Outcome outcome = render(scene, file("a.exr"));
  EXPECT_EQ(outcome.exit_code, 3);
  for (const char* part :
       {"scene.gltf: /images/0: expected a readable image", "cannot be loaded", RELIEF_OPENIMAGEIO_NAME}) {
    EXPECT_NE(outcome.errors.find(part), std::string::npos) << part << "\n" << outcome.errors;
  }
  ::unsetenv("LD_LIBRARY_PATH");
  EXPECT_EQ(render(scene, file("a.exr")).exit_code, 0);
}

}  // namespace
}  // namespace relief::test
