// OpenEXR by relief's own reader has the values that OpenImageIO gives, and the same is said of them, whatever is in the file;
// damage is an error or other values, and nothing else.
#include "scene/exr_file.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <ImfTiledOutputFile.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>

#include "tests/support/gltf_builder.h"
#include "tests/support/image_header.h"

namespace relief {
namespace {

struct ExrCase {
  std::vector<std::string> channels;
  Imf::PixelType type = Imf::HALF;
  Imf::Compression compression = Imf::ZIP_COMPRESSION;
  int tile = 0;                                  ///< texels a side; 0: by rows
  Imf::LevelMode levels = Imf::ONE_LEVEL;        ///< of tiles
  int x = 0, y = 0;                              ///< of the first texel
  Imf::LineOrder order = Imf::INCREASING_Y;
  bool is_subsampled = false;                    ///< the last channel
  Imf::PixelType last = Imf::NUM_PIXELTYPES;     ///< type of the last channel, if another
};

constexpr int kWidth = 72, kHeight = 54;

void PrintTo(const ExrCase& c, std::ostream* out)
{
  for (const std::string& name : c.channels) *out << name << ' ';
  *out << (c.type == Imf::HALF ? "half" : "float") << ", compression " << c.compression << ", tile " << c.tile;
}

Imf::Header header_of(const ExrCase& c)
{
  const Imath::Box2i window({c.x, c.y}, {c.x + kWidth - 1, c.y + kHeight - 1});
  Imf::Header header(Imath::Box2i({0, 0}, {99, 99}), window, 1, {0, 0}, 1, c.order, c.compression);
  for (const std::string& name : c.channels) {
    const bool is_last = name == c.channels.back();
    const int sampling = is_last && c.is_subsampled ? 2 : 1;
    header.channels().insert(name, {is_last && c.last != Imf::NUM_PIXELTYPES ? c.last : c.type, sampling, sampling});
  }
  if (c.tile > 0) {
    header.setTileDescription({static_cast<unsigned>(c.tile), static_cast<unsigned>(c.tile), c.levels, Imf::ROUND_UP});
  }
  return header;
}

/// Negative, above 1, tiny and infinite values among others.
std::vector<float> values_make()
{
  std::mt19937 random(11);
  std::normal_distribution<float> normal(0, 2);
  std::vector<float> values(std::size_t{kWidth} * kHeight);
  for (float& value : values) value = std::pow(normal(random), 3.0f);
  values[5] = std::numeric_limits<float>::infinity();
  values[6] = 1e-7f;
  return values;
}

void exr_write(const std::string& path, const ExrCase& c)
{
  const Imf::Header header = header_of(c);
  std::vector<std::vector<float>> floats(c.channels.size(), values_make());
  std::vector<std::vector<Imath::half>> halves;
  const std::vector<std::uint32_t> integers(std::size_t{kWidth} * kHeight, 7);
  Imf::FrameBuffer buffer;
  for (std::size_t i = 0; i < c.channels.size(); ++i) {
    for (std::size_t k = 0; k < floats[i].size(); k += i + 2) floats[i][k] *= 0.25f;
    halves.emplace_back(floats[i].begin(), floats[i].end());
    const Imf::Channel& channel = *header.channels().findChannel(c.channels[i]);
    const void* const data = channel.type == Imf::UINT   ? integers.data()
                             : channel.type == Imf::HALF ? static_cast<const void*>(halves[i].data())
                                                         : floats[i].data();
    const std::size_t bytes = channel.type == Imf::HALF ? 2 : 4;
    buffer.insert(c.channels[i], Imf::Slice::Make(channel.type, data, {c.x, c.y}, kWidth, kHeight, bytes, bytes * kWidth,
                                                  channel.xSampling, channel.ySampling));
  }
  if (c.tile == 0) {
    Imf::OutputFile out(path.c_str(), header);
    out.setFrameBuffer(buffer);
    out.writePixels(kHeight);
    return;
  }
  Imf::TiledOutputFile out(path.c_str(), header);
  out.setFrameBuffer(buffer);
  for (int level = 0; level < out.numLevels(); ++level) {
    out.writeTiles(0, out.numXTiles(level) - 1, 0, out.numYTiles(level) - 1, level);
  }
}

std::vector<unsigned char> bytes_of(const std::string& path)
{
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class ExrFileValues : public testing::TestWithParam<ExrCase> {};

TEST_P(ExrFileValues, AreThoseOfOpenImageIo)
{
  const test::TemporaryFolder folder;
  const std::string path = (folder / "a.exr").string();
  exr_write(path, GetParam());
  const std::vector<unsigned char> bytes = bytes_of(path);
  for (const bool is_embedded : {false, true}) {
    const std::unique_ptr<ImageFile> file =
        is_embedded ? exr_file_make("", bytes) : exr_file_make(path, {});
    const std::unique_ptr<ImageFile> other = image_io().make_file("openexr");
    ASSERT_NE(file, nullptr);
    ImageHeader header, expected;
    ASSERT_EQ(file->open(path, {}, header), "");
    ASSERT_EQ(other->open(path, {}, expected), "");
    test::expect_same_header(header, expected);
    EXPECT_EQ(header.strip_height, expected.strip_height);
    EXPECT_EQ(header.alpha_is_straight, expected.alpha_is_straight);
    const int num = header.num_channels, step = std::max(GetParam().tile, 16);
    struct Part {
      int begin, end, first, last;
    };
    // All, rows in the middle, from the start again; all channels and one.
    for (const Part part : {Part{0, kHeight, 0, num}, Part{step, 2 * step, 0, num}, Part{0, step, num - 1, num}}) {
      for (const SampleType type : {SampleType::kFloat, SampleType::kU8, SampleType::kU16}) {
        const auto size = static_cast<std::size_t>((part.end - part.begin) * kWidth * (part.last - part.first)) *
                          sample_bytes(type);
        std::vector<unsigned char> found(size), wanted(size);
        ASSERT_EQ(file->read_rows(part.begin, part.end, part.first, part.last, type, found.data()), "");
        ASSERT_EQ(other->read_rows(part.begin, part.end, part.first, part.last, type, wanted.data()), "");
        EXPECT_TRUE(found == wanted) << "rows from " << part.begin << ", " << sample_bytes(type) << " bytes";
      }
    }
  }
}

const std::vector<std::string> kRgb = {"R", "G", "B"}, kRgba = {"R", "G", "B", "A"};

INSTANTIATE_TEST_SUITE_P(Kinds,
                         ExrFileValues,
                         testing::Values(ExrCase{.channels = kRgb},
                                         ExrCase{.channels = kRgba, .type = Imf::FLOAT, .compression = Imf::PIZ_COMPRESSION},
                                         ExrCase{.channels = {"Y"}, .type = Imf::FLOAT, .compression = Imf::NO_COMPRESSION},
                                         ExrCase{.channels = {"R"}, .compression = Imf::ZIPS_COMPRESSION},
                                         ExrCase{.channels = {"R", "G"}, .compression = Imf::RLE_COMPRESSION},
                                         ExrCase{.channels = {"A"}, .type = Imf::FLOAT},
                                         ExrCase{.channels = kRgba, .compression = Imf::DWAA_COMPRESSION},
                                         ExrCase{.channels = kRgb, .compression = Imf::B44_COMPRESSION},
                                         ExrCase{.channels = kRgb, .compression = Imf::PXR24_COMPRESSION, .x = -9, .y = 31},
                                         ExrCase{.channels = kRgb, .x = 17, .y = -20, .order = Imf::DECREASING_Y},
                                         ExrCase{.channels = kRgba, .tile = 16},
                                         ExrCase{.channels = kRgb, .type = Imf::FLOAT, .tile = 16, .x = 5, .y = -7},
                                         ExrCase{.channels = kRgb, .tile = 16, .levels = Imf::MIPMAP_LEVELS}));

TEST(ExrFile, OtherKindsAreLeftToOpenImageIo)
{
  const test::TemporaryFolder folder;
  const std::string path = (folder / "a.exr").string();
  for (const ExrCase& c : {ExrCase{.channels = {"R", "G", "B", "Z"}},
                           ExrCase{.channels = {"depth"}},
                           ExrCase{.channels = {"diffuse.R", "diffuse.G", "diffuse.B"}},
                           ExrCase{.channels = kRgba, .is_subsampled = true},
                           ExrCase{.channels = kRgba, .last = Imf::FLOAT},
                           ExrCase{.channels = {"Y"}, .type = Imf::UINT}}) {
    exr_write(path, c);
    EXPECT_EQ(exr_file_make(path, {}), nullptr) << testing::PrintToString(c);
  }
  Imf::Header header = header_of({.channels = kRgb});
  header.setType(Imf::SCANLINEIMAGE);
  header.setName("one");
  Imf::Header second = header;
  second.setName("two");
  const Imf::Header headers[] = {header, second};
  {
    Imf::MultiPartOutputFile parts(path.c_str(), headers, 2);
  }
  EXPECT_EQ(exr_file_make(path, {}), nullptr);
}

TEST(ExrFile, WhatIsNoneIsLeftToOpenImageIo)
{
  const test::TemporaryFolder folder;
  EXPECT_EQ(exr_file_make((folder / "missing.exr").string(), {}), nullptr);
  EXPECT_EQ(exr_file_make(folder.write("text.exr", "no picture").string(), {}), nullptr);
  const std::vector<unsigned char> magic = {0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0};
  EXPECT_EQ(exr_file_make("", magic), nullptr);
}

/// Zeroes in place of the table that says where each row or tile begins, as Blender 5.2 leaves them in images that it packs.
/// @param num  entries, behind which the first row begins
std::vector<unsigned char> without_table(std::vector<unsigned char> bytes, std::size_t num)
{
  for (std::size_t at = 0; at + 8 * num < bytes.size(); ++at) {
    std::uint64_t first;
    std::memcpy(&first, &bytes[at], sizeof first);
    if (first != at + 8 * num) continue;
    std::memset(&bytes[at], 0, 8 * num);
    return bytes;
  }
  ADD_FAILURE() << "no table";
  return bytes;
}

TEST(ExrFile, WithoutItsTableTheRowsAreFound)
{
  const test::TemporaryFolder folder;
  const std::string path = (folder / "a.exr").string();
  constexpr std::size_t kTiles = ((kWidth + 15) / 16) * ((kHeight + 15) / 16);
  for (const auto& [c, num] :
       {std::pair{ExrCase{.channels = kRgba, .type = Imf::FLOAT, .compression = Imf::NO_COMPRESSION},
                  std::size_t{kHeight}},
        std::pair{ExrCase{.channels = kRgba}, std::size_t{(kHeight + 15) / 16}},
        std::pair{ExrCase{.channels = kRgba, .tile = 16}, kTiles}}) {
    exr_write(path, c);
    const std::vector<unsigned char> whole = bytes_of(path), bare = without_table(whole, num);
    const std::string bare_path = folder.write("bare.exr", std::string(bare.begin(), bare.end())).string();
    std::vector<float> rows[3];
    for (int k = 0; k < 3; ++k) {
      const std::unique_ptr<ImageFile> file =
          k == 2 ? exr_file_make(bare_path, {}) : exr_file_make("", k == 0 ? whole : bare);
      ASSERT_NE(file, nullptr);
      ImageHeader header;
      ASSERT_EQ(file->open("a.exr", k == 0 ? whole : bare, header), "");
      rows[k].resize(std::size_t{kWidth} * kHeight * 4);
      EXPECT_EQ(file->read_rows(0, kHeight, 0, 4, SampleType::kFloat, reinterpret_cast<unsigned char*>(rows[k].data())),
                "");
    }
    EXPECT_EQ(rows[0], rows[1]);
    EXPECT_EQ(rows[0], rows[2]);
  }
}

TEST(ExrFile, RowsThatAreMissingAreAnError)
{
  const test::TemporaryFolder folder;
  const std::string path = (folder / "a.exr").string();
  exr_write(path, {.channels = kRgb});
  std::vector<unsigned char> bytes = bytes_of(path);
  bytes.resize(bytes.size() - 100);
  const std::unique_ptr<ImageFile> file = exr_file_make("", bytes);
  ASSERT_NE(file, nullptr);
  ImageHeader header;
  ASSERT_EQ(file->open("a.exr", bytes, header), "");
  std::vector<float> rows(std::size_t{kWidth} * kHeight * 3);
  EXPECT_NE(file->read_rows(0, kHeight, 0, 3, SampleType::kFloat, reinterpret_cast<unsigned char*>(rows.data())), "");
}

TEST(ExrFile, DamagedBytesDoNoHarm)
{
  const test::TemporaryFolder folder;
  std::mt19937 random(3);
  int num_errors = 0;
  for (const ExrCase& c : {ExrCase{.channels = kRgb}, ExrCase{.channels = kRgba, .compression = Imf::PIZ_COMPRESSION},
                           ExrCase{.channels = kRgb, .compression = Imf::DWAA_COMPRESSION}, ExrCase{.channels = kRgb, .tile = 16}}) {
    const std::string path = (folder / "a.exr").string();
    exr_write(path, c);
    const std::vector<unsigned char> whole = bytes_of(path);
    for (int k = 0; k < 300; ++k) {
      std::vector<unsigned char> damaged = whole;
      // Behind the header, whose claims image_memory.h looks at before.
      constexpr std::size_t kHeader = 500;
      for (int n = 0; n < 1 + k % 3; ++n) {
        damaged[kHeader + random() % (damaged.size() - kHeader)] = static_cast<unsigned char>(random());
      }
      if (k % 5 == 0) damaged.resize(kHeader + random() % (damaged.size() - kHeader));
      const std::unique_ptr<ImageFile> file = exr_file_make("", damaged);
      ImageHeader header;
      if (file == nullptr || !file->open("damaged", damaged, header).empty()) {
        ++num_errors;
        continue;
      }
      std::vector<float> rows(std::size_t{kWidth} * kHeight * 4);
      const std::string error = file->read_rows(0, kHeight, 0, header.num_channels, SampleType::kFloat,
                                                reinterpret_cast<unsigned char*>(rows.data()));
      num_errors += error.empty() ? 0 : 1;
    }
  }
  EXPECT_GT(num_errors, 100);
}

}  // namespace
}  // namespace relief
