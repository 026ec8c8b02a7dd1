// libFuzzer target: whatever bytes a scene file holds, scene_load returns a scene, throws a SceneError, or says that the
// file asks for more memory than there is.
//
// The file is always called scene.gltf and has three neighbours, other.gltf, data.bin and profile.ies, that it may refer to; the
// GLB container is recognized by content, so both forms are reached. What begins as an IES file does is read as one.
// tinygltf is compiled in (fuzz_tinygltf.cpp) so that it
// is instrumented too.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "scene/graph/ies_file.h"
#include "scene/load.h"
#include "scene/memory.h"
#include "tests/support/gltf_builder.h"

namespace {

/// Folder of the input file and its neighbours, made once.
const relief::test::TemporaryFolder& folder()
{
  static const relief::test::TemporaryFolder instance;
  static const bool has_neighbours = [] {
    instance.write("other.gltf", relief::test::square_scene().gltf());
    instance.write("data.bin", std::string(4096, '\x3f'));
    instance.write("profile.ies", "TILT=NONE\n1 1 1 3 2 1 2 0 0 0 1 1 1\n0 90 180\n0 90\n3 2 1\n6 5 4\n");
    return true;
  }();
  static_cast<void>(has_neighbours);
  return instance;
}

}  // namespace

// OpenImageIO keeps the last error of a damaged image for each thread, and loses it now and then.
extern "C" const char* __lsan_default_suppressions() { return "leak:libOpenImageIO"; }

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (text.starts_with("IESNA") || text.starts_with("TILT=")) {
    try {
      relief::ies_table(relief::ies_parse(text, "scene.gltf", "/uri"), relief::IesEnds::k34);
    } catch (const relief::SceneError&) {
    }
    return 0;
  }
  const auto file = folder().write("scene.gltf", text);
  relief::LoadOptions options;
  options.has_frame = true;
  options.frame = 12;
  try {
    relief::scene_load(file, options);
  } catch (const relief::SceneError&) {
  } catch (const relief::OutOfMemory&) {
  }
  return 0;
}
