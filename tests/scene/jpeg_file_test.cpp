// JPEG by libjpeg has the values that OpenImageIO gives, whatever is in the file; damage is an error or other values, and nothing
// else. Images are written by libjpeg.
#include "scene/jpeg_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>

#include <jpeglib.h>

#include "tests/support/gltf_builder.h"
#include "tests/support/image_header.h"

namespace relief {
namespace {

constexpr int kWidth = 37, kHeight = 29;

struct JpegCase {
  J_COLOR_SPACE input, stored;
  bool halves_color = false;  ///< colours have half the resolution
  bool progressive = false;
  bool has_more = false;  ///< a profile's and a comment's segments come before the picture
};

/// For GoogleTest's messages, which would print the bytes.
void PrintTo(const JpegCase& c, std::ostream* out)
{
  *out << "colour space " << c.input << " as " << c.stored << (c.halves_color ? ", halved" : "")
       << (c.progressive ? ", progressive" : "") << (c.has_more ? ", with more" : "");
}

std::vector<unsigned char> jpeg_write(const JpegCase& c)
{
  jpeg_compress_struct jpeg;
  jpeg_error_mgr errors;
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &bytes, &size);
  jpeg.image_width = kWidth;
  jpeg.image_height = kHeight;
  jpeg.in_color_space = c.input;
  jpeg.input_components = c.input == JCS_GRAYSCALE ? 1 : c.input == JCS_CMYK ? 4 : 3;
  jpeg_set_defaults(&jpeg);
  jpeg_set_colorspace(&jpeg, c.stored);
  jpeg_set_quality(&jpeg, 92, TRUE);
  jpeg.comp_info[0].h_samp_factor = jpeg.comp_info[0].v_samp_factor = c.halves_color ? 2 : 1;
  if (c.progressive) jpeg_simple_progression(&jpeg);
  jpeg_start_compress(&jpeg, TRUE);
  if (c.has_more) {
    const std::vector<JOCTET> more(3000, 0xff);
    jpeg_write_marker(&jpeg, JPEG_APP0 + 2, more.data(), static_cast<unsigned>(more.size()));
    jpeg_write_marker(&jpeg, JPEG_COM, more.data(), 20);
  }
  std::mt19937 random(11);
  std::vector<JSAMPLE> row(static_cast<std::size_t>(kWidth * jpeg.input_components));
  for (int y = 0; y < kHeight; ++y) {
    // Slopes with some noise, as photographs have.
    for (std::size_t i = 0; i < row.size(); ++i)
      row[i] = static_cast<JSAMPLE>(i * 2 + static_cast<std::size_t>(y) * 5 + random() % 9);
    JSAMPROW from = row.data();
    jpeg_write_scanlines(&jpeg, &from, 1);
  }
  jpeg_finish_compress(&jpeg);
  std::vector<unsigned char> out(bytes, bytes + size);
  jpeg_destroy_compress(&jpeg);
  std::free(bytes);
  return out;
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
  const auto size = static_cast<std::size_t>((end - begin) * kWidth * (channel_end - channel_begin)) * sample_bytes(type);
  std::vector<unsigned char> found(size), expected(size);
  ASSERT_EQ(file.read_rows(begin, end, channel_begin, channel_end, type, found.data()), "");
  ASSERT_EQ(other.read_rows(begin, end, channel_begin, channel_end, type, expected.data()), "");
  if (type != SampleType::kFloat) {
    EXPECT_TRUE(found == expected) << "rows from " << begin << ", " << sample_bytes(type) << " bytes";
    return;
  }
  for (std::size_t i = 0; i < size; i += sizeof(float)) {
    float a, b;
    std::memcpy(&a, &found[i], sizeof a);
    std::memcpy(&b, &expected[i], sizeof b);
    ASSERT_LE(std::abs(a - b), 0x1p-23f) << "rows from " << begin;
  }
}

const JpegCase kCases[] = {{JCS_GRAYSCALE, JCS_GRAYSCALE},
                           {JCS_GRAYSCALE, JCS_GRAYSCALE, false, true},
                           {JCS_RGB, JCS_YCbCr},
                           {JCS_RGB, JCS_YCbCr, true},
                           {JCS_RGB, JCS_YCbCr, true, true, true},
                           {JCS_RGB, JCS_YCbCr, true, false, true},
                           {JCS_RGB, JCS_RGB},
                           {JCS_RGB, JCS_GRAYSCALE}};

class JpegFileValues : public testing::TestWithParam<JpegCase> {};

TEST_P(JpegFileValues, AreThoseOfOpenImageIo)
{
  const std::vector<unsigned char> bytes = jpeg_write(GetParam());
  const test::TemporaryFolder folder;
  const std::string path = folder.write("a.jpg", std::string(bytes.begin(), bytes.end())).string();
  const std::unique_ptr<ImageFile> file = jpeg_file_make(bytes), other = image_io().make_file("jpeg");
  ASSERT_NE(file, nullptr);
  ImageHeader header, expected;
  ASSERT_EQ(file->open(path, bytes, header), "");
  // Of a file: of bytes it cannot go back to earlier rows.
  ASSERT_EQ(other->open(path, {}, expected), "");
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

INSTANTIATE_TEST_SUITE_P(Kinds, JpegFileValues, testing::ValuesIn(kCases));

TEST(JpegFile, OtherColorSpacesAreLeftToOpenImageIo)
{
  EXPECT_EQ(jpeg_file_make(jpeg_write({JCS_CMYK, JCS_CMYK})), nullptr);
  EXPECT_EQ(jpeg_file_make(jpeg_write({JCS_CMYK, JCS_YCCK})), nullptr);
  EXPECT_EQ(jpeg_file_make({}), nullptr);
}

TEST(JpegFile, DamagedBytesDoNoHarm)
{
  std::mt19937 random(3);
  for (const JpegCase& c : kCases) {
    const std::vector<unsigned char> whole = jpeg_write(c);
    int num_errors = 0;
    for (int k = 0; k < 400; ++k) {
      std::vector<unsigned char> bytes = whole;
      for (int n = 0; n < 1 + k % 3; ++n) bytes[random() % bytes.size()] = static_cast<unsigned char>(random());
      if (k % 5 == 0) bytes.resize(random() % bytes.size());
      const std::unique_ptr<ImageFile> file = jpeg_file_make(bytes);
      ImageHeader header;
      if (file == nullptr || !file->open("damaged", bytes, header).empty()) {
        ++num_errors;
        continue;
      }
      // What a damaged header asks for is not what this test is about.
      if (std::int64_t{header.width} * header.height > 1 << 20) continue;
      std::vector<float> rows(static_cast<std::size_t>(header.width * header.height * header.num_channels));
      const std::string error = file->read_rows(0, header.height, 0, header.num_channels, SampleType::kFloat,
                                                reinterpret_cast<unsigned char*>(rows.data()));
      num_errors += error.empty() ? 0 : 1;
    }
    EXPECT_GT(num_errors, 10) << testing::PrintToString(c);
  }
}

}  // namespace
}  // namespace relief
