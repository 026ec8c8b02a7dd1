// Runs that are ended while they work, and what they are compared with.
#pragma once

#include <algorithm>
#include <cstring>
#include <memory>

#include "tests/cli/program.h"
#include "tests/support/image_bytes.h"

namespace relief::test {

/// A square displaced by a map, seen by a camera that moves by a metre and a half a second. Its buffer and its map are files.
inline GltfBuilder moving_view(TemporaryFolder& folder)
{
  GltfBuilder b = lit_square();
  std::string texels;
  for (int i = 0; i < 64; ++i) texels += static_cast<char>(i * 37 % 256);
  folder.write("heights.tga", tga_grey(8, 8, texels));
  b.push("materials",
         {{"extensions",
           {{"RELIEF_displacement", {{"heightTexture", {{"uri", "heights.tga"}}}, {"scale", 0.3}, {"midlevel", 0}}}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  b.json["nodes"].back()["translation"] = {0.2, 0.2, 5};
  const int times = b.accessor<float>({0, 2}, "SCALAR");
  const int values = b.accessor<float>({0.2f, 0.2f, 5, 0.8f, 0.6f, 5}, "VEC3");
  const std::size_t camera = b.json["nodes"].size() - 1;
  b.push("animations", {{"samplers", {{{"input", times}, {"output", values}}}},
                        {"channels", {{{"sampler", 0}, {"target", {{"node", camera}, {"path", "translation"}}}}}}});
  folder.write("scene.bin", b.binary);
  b.json["buffers"] = {{{"byteLength", b.binary.size()}, {"uri", "scene.bin"}}};
  return b;
}

/// A process and what it says.
struct Running {
  std::unique_ptr<Process> process;
  int output = -1;

  ~Running()
  {
    if (output >= 0) ::close(output);
  }

  /// Reads until the program tells of an event.
  /// @return false if its output ends before
  bool wait_for(const std::string& event) const
  {
    std::string line;
    for (char byte = 0; ::read(output, &byte, 1) == 1;) {
      line += byte;
      if (byte != '\n') continue;
      if (line.find("\"event\":\"" + event + "\"") != std::string::npos) return true;
      line.clear();
    }
    return false;
  }
};

/// Whether two pictures have the same channels with the same bits.
inline ::testing::AssertionResult same_bits(const std::string& a, const std::string& b)
{
  const Picture x = exr_load(a), y = exr_load(b);
  if (x.channels.size() != y.channels.size()) return ::testing::AssertionFailure() << a << ": other channels";
  for (std::size_t c = 0; c < x.channels.size(); ++c) {
    const std::vector<float>&u = x.channels[c].values, &v = y.channels[c].values;
    if (x.channels[c].name != y.channels[c].name || u.size() != v.size() ||
        std::memcmp(u.data(), v.data(), u.size() * sizeof(float)) != 0) {
      return ::testing::AssertionFailure() << a << ": other bits in " << x.channels[c].name;
    }
  }
  return ::testing::AssertionSuccess();
}

class InterruptedRuns : public ProgramTest {
 protected:
  Running start(const Arguments& arguments) const
  {
    int ends[2];
    EXPECT_EQ(::pipe2(ends, O_CLOEXEC), 0);
    return {std::make_unique<Process>(arguments, ends[1], open_file("stderr")), ends[0]};
  }
};

}  // namespace relief::test
