// What is said when the module that reads images is not there. This program has image_io.cpp with the name of a file that
// does not exist.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "scene/diagnostics.h"
#include "scene/image_io.h"
#include "scene/image_reader.h"
#include "tests/support/gltf_builder.h"

namespace relief {
namespace {

TEST(MissingImageModule, IsAnErrorOfTheImageAndNamesTheFile)
{
  EXPECT_FALSE(image_io_is_there());
  const test::TemporaryFolder folder;
  const std::string file = folder.write("a.tif", std::string("II*\0", 4)).string();
  // Twice: a failure does not make a later image pass.
  for (int attempt = 0; attempt < 2; ++attempt) {
    try {
      ImageReader reader({file, {}, "scene.gltf", "/images/7"});
      FAIL() << "no error";
    } catch (const SceneError& e) {
      EXPECT_EQ(e.file, "scene.gltf");
      EXPECT_EQ(e.json_path, "/images/7");
      EXPECT_NE(e.found.find(file), std::string::npos) << e.found;
      // Not the path where it was built, which means nothing to whoever installed it.
      const std::string own = std::filesystem::read_symlink("/proc/self/exe").parent_path().string();
      const std::string expected = "cannot be loaded: relief_missing.so is neither in " + own + " nor in ../lib/relief";
      EXPECT_TRUE(e.found.ends_with(expected)) << e.found;
    }
  }
}

}  // namespace
}  // namespace relief
