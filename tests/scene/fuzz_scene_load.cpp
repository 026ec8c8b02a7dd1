// libFuzzer target: whatever bytes a scene file holds, scene_load returns a scene, throws a SceneError, or says that the
// file asks for more memory than there is.
//
// The file is always called scene.gltf and has two neighbours, other.gltf and data.bin, that it may refer to; the GLB
// container is recognized by content, so both forms are reached. tinygltf is compiled in (fuzz_tinygltf.cpp) so that it
// is instrumented too.
#include <cstddef>
#include <cstdint>
#include <string_view>

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
  const auto file = folder().write("scene.gltf", {reinterpret_cast<const char*>(data), size});
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
