// How much memory there is, what is kept of it for whom, and what of a text reaches a terminal.
#include "scene/memory.h"

#include <gtest/gtest.h>

#include <limits>

#include "scene/diagnostics.h"
#include "scene/image_memory.h"
#include "scene/validation.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/image_bytes.h"

namespace relief {
namespace {

namespace fs = std::filesystem;
using test::TemporaryFolder;

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

/// A system's folder with files of its own.
struct FakeRoot {
  void write(const fs::path& file, const std::string& text) const
  {
    fs::create_directories(folder / file.parent_path().string());
    folder.write(file.string(), text);
  }
  std::uint64_t limit() const { return cgroup_memory_limit(folder / ""); }

  TemporaryFolder folder;
};

TEST(CgroupMemoryLimit, IsTheLeastOfAGroupAndThoseAboveIt)
{
  const FakeRoot root;
  root.write("proc/self/cgroup", "0::/user.slice/job\n");
  root.write("sys/fs/cgroup/user.slice/job/memory.max", "max\n");
  EXPECT_EQ(root.limit(), std::numeric_limits<std::uint64_t>::max());
  root.write("sys/fs/cgroup/user.slice/memory.max", "1073741824\n");
  EXPECT_EQ(root.limit(), 1024 * kMiB);
  root.write("sys/fs/cgroup/user.slice/job/memory.max", "536870912\n");
  EXPECT_EQ(root.limit(), 512 * kMiB);
}

// In a container the process's own path may not be there, but its root is.
TEST(CgroupMemoryLimit, IsFoundAtTheRootOfAContainer)
{
  const FakeRoot root;
  root.write("proc/self/cgroup", "0::/system.slice/docker-123.scope\n");
  root.write("sys/fs/cgroup/memory.max", "268435456\n");
  EXPECT_EQ(root.limit(), 256 * kMiB);
}

TEST(CgroupMemoryLimit, KnowsTheFirstVersion)
{
  const FakeRoot root;
  root.write("proc/self/cgroup", "9:cpu,cpuacct:/a\n5:memory:/a/b\n1:name=systemd:/memory\n");
  root.write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
  root.write("sys/fs/cgroup/memory/a/memory.limit_in_bytes", "134217728\n");
  EXPECT_EQ(root.limit(), 128 * kMiB);
}

TEST(CgroupMemoryLimit, IsNoneWithoutGroups)
{
  EXPECT_EQ(FakeRoot().limit(), std::numeric_limits<std::uint64_t>::max());
  const FakeRoot root;
  root.write("proc/self/cgroup", "nonsense\n::\n0::\n");
  EXPECT_EQ(root.limit(), std::numeric_limits<std::uint64_t>::max());
}

// In a process of its own, since the limit is the process's.
TEST(MemoryReservation, CountsWhatOthersHold)
{
  memory_limit_set(memory_limit().bytes - memory_left() + 512 * kMiB);
  const MemoryReservation first(300 * kMiB, "the first");
  try {
    const MemoryReservation second(300 * kMiB, "a.gltf: /images/1");
    FAIL() << "there is no room for both";
  } catch (const OutOfMemory& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("a.gltf: /images/1: needs up to 300.0 MiB"), std::string::npos) << text;
    EXPECT_NE(text.find("--max-memory"), std::string::npos) << text;
  }
  {
    MemoryReservation moved = MemoryReservation(100 * kMiB, "the third");
    const MemoryReservation there = std::move(moved);
  }
  const MemoryReservation again(100 * kMiB, "what was given back");
  EXPECT_THROW(memory_require(std::numeric_limits<std::uint64_t>::max(), "everything"), OutOfMemory);
}

// Likewise.
TEST(MemoryOfJson, IsAskedForBeforeItIsParsed)
{
  std::string text = R"({"nodes":[)";
  for (int i = 0; i < 1 << 18; ++i) text += R"({"a":{"b":[1,2,3]}},)";
  text += "{}]}";
  EXPECT_EQ(validation_parse(text, "a.gltf")["nodes"].size(), (1u << 18) + 1u);
  memory_limit_set(memory_limit().bytes - memory_left() + 96 * kMiB);
  try {
    validation_parse(text, "a.gltf");
    FAIL() << "there is no room for it";
  } catch (const OutOfMemory& error) {
    EXPECT_NE(std::string(error.what()).find("a.gltf: JSON: needs up to"), std::string::npos) << error.what();
  }
}

/// Bytes of an image as decoder_bytes reads them.
struct TextBytes final : ImageBytes {
  explicit TextBytes(std::string all) : text(std::move(all)) {}
  bool read(std::uint64_t offset, std::span<unsigned char> bytes) override
  {
    if (offset > text.size() || bytes.size() > text.size() - offset) return false;
    std::copy_n(text.begin() + static_cast<std::ptrdiff_t>(offset), bytes.size(), bytes.begin());
    return true;
  }
  std::string text;
};

double decoder_gib(const char* reader, const std::string& bytes)
{
  TextBytes source(bytes);
  return static_cast<double>(decoder_bytes(reader, source).value_or(0)) / (1024.0 * kMiB);
}

// What was measured of such files: 8.4 GB, 25 GB, 4.2 GB.
TEST(DecoderBytes, AreThoseThatDecodersTake)
{
  EXPECT_NEAR(decoder_gib("jpeg", test::jpeg_progressive(65500, 65500, 1)), 8.0, 0.1);
  EXPECT_NEAR(decoder_gib("jpeg", test::jpeg_progressive(65500, 65500, 3)), 24.1, 0.3);
  EXPECT_NEAR(decoder_gib("png", test::png_header(65536, 65536, true)), 8.0, 0.1) << "with a channel for transparency";
  EXPECT_LT(decoder_gib("png", test::png_header(65536, 65536, false)), 0.001);
}

/// A header of OpenEXR: one channel of floats.
std::string exr_part(std::uint32_t side, std::uint32_t tile)
{
  const auto attribute = [](const std::string& name, const std::string& type, const std::string& value) {
    return name + '\0' + type + '\0' + test::little_endian(static_cast<std::uint32_t>(value.size()), 4) + value;
  };
  const std::string channel = std::string("Y\0\2\0\0\0", 6) + std::string(4, '\0') + test::little_endian(1, 4) +
                              test::little_endian(1, 4) + '\0';
  const std::string window = std::string(8, '\0') + test::little_endian(side - 1, 4) + test::little_endian(side - 1, 4);
  const std::string tiles = test::little_endian(tile, 4) + test::little_endian(tile, 4) + '\0';
  return attribute("channels", "chlist", channel) + attribute("compression", "compression", std::string(1, '\0')) +
         attribute("dataWindow", "box2i", window) + (tile > 0 ? attribute("tiles", "tiledesc", tiles) : "") + '\0';
}

TEST(DecoderBytes, OfOpenExrCountTheTablesOfAllParts)
{
  const std::string one = std::string("\x76\x2f\x31\x01\x02\0\0\0", 8), several("\x76\x2f\x31\x01\x02\x10\0\0", 8);
  EXPECT_LT(decoder_gib("openexr", one + exr_part(64, 0) + std::string(8, '\0')), 0.001);
  // 2^32 tiles of one texel, and their smaller levels.
  EXPECT_NEAR(decoder_gib("openexr", several + exr_part(64, 0) + exr_part(65536, 1) + std::string(8, '\0')), 42.7, 0.1);
  EXPECT_LT(decoder_gib("openexr", several + exr_part(64, 0) + exr_part(64, 16) + std::string(8, '\0')), 0.001);
  TextBytes cut(one + exr_part(64, 0).substr(0, 60) + std::string("text\0string\0\0\0\0\x7f", 16));
  EXPECT_FALSE(decoder_bytes("openexr", cut)) << "text of two gigabytes";
}

TEST(DecoderBytes, OfHeadersThatEndAreNone)
{
  for (const char* reader : {"jpeg", "png", "openexr", "bmp", "targa", "webp"}) {
    const std::string jpeg = test::jpeg_progressive(100, 100, 3);
    for (std::size_t length = 0; length < 20; ++length) {
      EXPECT_LT(decoder_gib(reader, jpeg.substr(0, length)), 1) << reader << " " << length;
    }
  }
}

TEST(PrintableText, EscapesWhatCommandsATerminal)
{
  EXPECT_EQ(printable_text("plain — Ünïcode ✓ 漢字 🜂"), "plain — Ünïcode ✓ 漢字 🜂");
  EXPECT_EQ(printable_text("\x1b[2J"), "\\x1b[2J");
  EXPECT_EQ(printable_text("two\nlines\r\t"), "two\\x0alines\\x0d\\x09");
  EXPECT_EQ(printable_text("\x7f"), "\\x7f");
  EXPECT_EQ(printable_text("\xc2\x9b"
                           "31m"),
            "\\u009b31m")
      << "CSI of the second set";
  EXPECT_EQ(printable_text("a\xe2\x80\xae"
                           "b\xe2\x80\xa8"),
            "a\\u202eb\\u2028");
  EXPECT_EQ(printable_text(std::string_view("\0", 1)), "\\x00");
}

TEST(PrintableText, EscapesBytesThatAreNoCharacters)
{
  EXPECT_EQ(printable_text("\xff\xfe"), "\\xff\\xfe");
  EXPECT_EQ(printable_text("\x9b"), "\\x9b");
  EXPECT_EQ(printable_text("\xc3"), "\\xc3");
  EXPECT_EQ(printable_text("\xe2\x82"
                           "a"),
            "\\xe2\\x82"
            "a");
  EXPECT_EQ(printable_text("\xc0\x8a"), "\\xc0\\x8a") << "a newline, overlong";
  EXPECT_EQ(printable_text("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "half of a surrogate pair";
  EXPECT_EQ(printable_text("\xf5\x80\x80\x80"), "\\xf5\\x80\\x80\\x80");
}

TEST(PrintableText, TwiceIsOnce)
{
  const std::string once = printable_text("\x1b\n\xff\xc2\x9b");
  EXPECT_EQ(printable_text(once), once);
}

}  // namespace
}  // namespace relief
