// PNG by libpng has the values that OpenImageIO gives, whatever is in the file; damage is an error and nothing else.
// Images are written by libpng.
#include "scene/png_file.h"

#include <gtest/gtest.h>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <csetjmp>
#include <cstring>
#include <fstream>
#include <random>

#include "tests/support/gltf_builder.h"
#include "tests/support/image_header.h"

namespace relief {
namespace {

namespace fs = std::filesystem;

struct PngCase {
  int color_type, bit_depth;
  bool interlaced = false;
  bool transparent = false;  ///< one colour, or some of the palette's
};

/// For GoogleTest's messages, which would print the bytes.
void PrintTo(const PngCase& c, std::ostream* out)
{
  *out << "colour type " << c.color_type << ", " << c.bit_depth << " bits" << (c.interlaced ? ", interlaced" : "")
       << (c.transparent ? ", transparent" : "");
}

constexpr int kWidth = 21, kHeight = 13;

/// Writes random samples; of few bits and colours, so that the transparent one is met.
/// @return false if libpng does not take it
bool png_write_random(std::FILE* file, const PngCase& c)
{
  std::mt19937 random(7);
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  // Known before setjmp: nothing after it may need a destructor.
  std::vector<png_byte> rows(std::size_t{kHeight} * kWidth * 8);
  std::vector<png_bytep> row_pointers;
  row_pointers.reserve(kHeight);
  for (std::size_t y = 0; y < kHeight; ++y) row_pointers.push_back(rows.data() + y * kWidth * 8);
  for (png_byte& byte : rows) byte = static_cast<png_byte>(random() % 4 == 0 ? 5 : random());
  png_color palette[256];
  png_byte alphas[256];
  for (int i = 0; i < 256; ++i) {
    palette[i] = {static_cast<png_byte>(random()), static_cast<png_byte>(random()), static_cast<png_byte>(random())};
    alphas[i] = static_cast<png_byte>(random());
  }
  if (setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_init_io(png, file);
  png_set_IHDR(png, info, kWidth, kHeight, c.bit_depth, c.color_type,
               c.interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  if (c.color_type == PNG_COLOR_TYPE_PALETTE) png_set_PLTE(png, info, palette, 1 << c.bit_depth);
  // 16 bits of 0x0505 are as likely as any other colour made of two bytes.
  const png_uint_16 key = c.bit_depth == 16 ? 0x0505 : c.bit_depth == 8 ? 5 : 1;
  const png_color_16 color{0, key, key, key, key};
  if (c.transparent) png_set_tRNS(png, info, alphas, 1 << (c.bit_depth < 8 ? c.bit_depth - 1 : 7), &color);
  // What must not change values.
  png_set_gAMA(png, info, 1.0);
  png_write_info(png, info);
  png_write_image(png, row_pointers.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return true;
}

fs::path png_write_random(const fs::path& path, const PngCase& c)
{
  std::FILE* file = std::fopen(path.c_str(), "wb");
  EXPECT_TRUE(file != nullptr && png_write_random(file, c)) << testing::PrintToString(c);
  if (file != nullptr) std::fclose(file);
  return path;
}

std::vector<unsigned char> file_bytes(const fs::path& path)
{
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Some rows and channels of an open image.
std::vector<unsigned char> read(ImageFile& file,
                                int begin,
                                int end,
                                int channel_begin,
                                int channel_end,
                                SampleType type)
{
  std::vector<unsigned char> rows(static_cast<std::size_t>((end - begin) * kWidth * (channel_end - channel_begin)) *
                                  sample_bytes(type));
  EXPECT_EQ(file.read_rows(begin, end, channel_begin, channel_end, type, rows.data()), "");
  return rows;
}

/// Integers are the same. Floats are quotients here; the library multiplies by a rounded inverse.
void expect_same(ImageFile& file,
                 ImageFile& other,
                 int begin,
                 int end,
                 int channel_begin,
                 int channel_end,
                 SampleType type)
{
  const std::vector<unsigned char> found = read(file, begin, end, channel_begin, channel_end, type);
  const std::vector<unsigned char> expected = read(other, begin, end, channel_begin, channel_end, type);
  const std::string label = "rows from " + std::to_string(begin) + ", " + std::to_string(sample_bytes(type)) + " bytes";
  if (type != SampleType::kFloat) {
    EXPECT_TRUE(found == expected) << label;
    return;
  }
  ASSERT_EQ(found.size(), expected.size());
  double most = 0;
  for (std::size_t i = 0; i < found.size(); i += sizeof(float)) {
    float a, b;
    std::memcpy(&a, &found[i], sizeof a);
    std::memcpy(&b, &expected[i], sizeof b);
    most = std::max(most, std::abs(double{a} - double{b}));
  }
  EXPECT_LE(most, 0x1p-23) << label;
}

std::vector<PngCase> cases_make()
{
  struct Kind {
    int color_type;
    std::vector<int> bit_depths;
  };
  const Kind kinds[] = {{PNG_COLOR_TYPE_GRAY, {1, 2, 4, 8, 16}},
                        {PNG_COLOR_TYPE_PALETTE, {1, 2, 4, 8}},
                        {PNG_COLOR_TYPE_GRAY_ALPHA, {8, 16}},
                        {PNG_COLOR_TYPE_RGB, {8, 16}},
                        {PNG_COLOR_TYPE_RGB_ALPHA, {8, 16}}};
  std::vector<PngCase> cases;
  for (const Kind& kind : kinds) {
    for (const int bits : kind.bit_depths) {
      for (const bool interlaced : {false, true}) {
        cases.push_back({kind.color_type, bits, interlaced, false});
        const bool has_alpha = (kind.color_type & PNG_COLOR_MASK_ALPHA) != 0;
        if (!has_alpha) cases.push_back({kind.color_type, bits, interlaced, true});
      }
    }
  }
  return cases;
}

class PngFileValues : public testing::TestWithParam<PngCase> {};

TEST_P(PngFileValues, AreThoseOfOpenImageIo)
{
  const test::TemporaryFolder folder;
  const std::string path = png_write_random(folder / "a.png", GetParam()).string();
  const std::vector<unsigned char> bytes = file_bytes(path);
  ImageHeader expected;
  const std::unique_ptr<ImageFile> other = image_io().make_file("png");
  ASSERT_EQ(other->open(path, {}, expected), "");
  for (const bool embedded : {false, true}) {
    const std::unique_ptr<ImageFile> file = png_file_make();
    ImageHeader header;
    const std::span<const unsigned char> encoded = embedded ? std::span(bytes) : std::span<const unsigned char>();
    ASSERT_EQ(file->open(path, encoded, header), "");
    test::expect_same_header(header, expected);
    EXPECT_EQ(header.width, kWidth);
    EXPECT_EQ(header.height, kHeight);
    ASSERT_EQ(header.num_channels, expected.num_channels);
    const int last = header.num_channels;
    for (const SampleType type : {SampleType::kU8, SampleType::kU16, SampleType::kFloat}) {
      // All, the middle, from the start again, the last channel alone.
      expect_same(*file, *other, 0, kHeight, 0, last, type);
      expect_same(*file, *other, 5, 8, 0, last, type);
      expect_same(*file, *other, 0, 3, 0, last, type);
      expect_same(*file, *other, 3, 4, last - 1, last, type);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, PngFileValues, testing::ValuesIn(cases_make()));

/// Opens and reads it all. @return what is wrong
std::string read_all(std::span<const unsigned char> bytes)
{
  const std::unique_ptr<ImageFile> file = png_file_make();
  ImageHeader header;
  std::string error = file->open("embedded", bytes, header);
  if (!error.empty()) return error;
  // What a damaged header asks for is not what this test is about.
  if (std::int64_t{header.width} * header.height > 1 << 20) return "too large";
  std::vector<unsigned char> rows(static_cast<std::size_t>(header.width) * static_cast<std::size_t>(header.height) *
                                  static_cast<std::size_t>(header.num_channels) * 4);
  return file->read_rows(0, header.height, 0, header.num_channels, SampleType::kFloat, rows.data());
}

TEST(PngFile, TruncatedDataIsAnError)
{
  const test::TemporaryFolder folder;
  for (const bool interlaced : {false, true}) {
    const std::vector<unsigned char> bytes =
        file_bytes(png_write_random(folder / "a.png", {PNG_COLOR_TYPE_RGB, 16, interlaced}));
    EXPECT_EQ(read_all(bytes), "");
    // All but the end chunk, and the checksum before it, is needed.
    for (std::size_t size = 1; size < bytes.size() - 16; ++size) {
      EXPECT_EQ(read_all(std::span(bytes).first(size)), "truncated data") << size;
    }
  }
}

TEST(PngFile, DamagedBytesDoNoHarm)
{
  const test::TemporaryFolder folder;
  std::mt19937 random(3);
  for (const PngCase& c : cases_make()) {
    const std::vector<unsigned char> whole = file_bytes(png_write_random(folder / "a.png", c));
    int num_errors = 0;
    for (int k = 0; k < 300; ++k) {
      std::vector<unsigned char> bytes = whole;
      for (int n = 0; n < 1 + k % 3; ++n) bytes[random() % bytes.size()] = static_cast<unsigned char>(random());
      num_errors += read_all(bytes).empty() ? 0 : 1;
    }
    // Chunks have checksums.
    EXPECT_GT(num_errors, 200) << testing::PrintToString(c);
  }
}

TEST(PngFile, FilesThatAreNotThereOrChangeAreErrors)
{
  const test::TemporaryFolder folder;
  ImageHeader header;
  EXPECT_EQ(png_file_make()->open((folder / "none.png").string(), {}, header), "cannot be opened");

  const std::string path = (folder / "a.png").string();
  std::vector<unsigned char> row(kWidth);
  for (const PngCase& other : {PngCase{PNG_COLOR_TYPE_RGB_ALPHA, 16}, PngCase{PNG_COLOR_TYPE_GRAY, 8, true}}) {
    png_write_random(path, {PNG_COLOR_TYPE_GRAY, 8});
    const std::unique_ptr<ImageFile> file = png_file_make();
    ASSERT_EQ(file->open(path, {}, header), "");
    read(*file, 0, kHeight, 0, 1, SampleType::kU8);
    png_write_random(path, other);
    // It stays an error: the tile cache asks again.
    for (int attempt = 0; attempt < 2; ++attempt) {
      EXPECT_EQ(file->read_rows(0, 1, 0, 1, SampleType::kU8, row.data()), "changed while it was read");
    }
  }
}

}  // namespace
}  // namespace relief
