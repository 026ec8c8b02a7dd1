// HDR by relief's own reader has the values that OpenImageIO gives, whatever is in the file; damage is an error or other
// values, and nothing else.
#include "scene/hdr_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>

#include "tests/support/gltf_builder.h"
#include "tests/support/image_header.h"

namespace relief {
namespace {

struct HdrCase {
  int width = 0, height = 0;
  bool has_runs = false;
  std::string more = {};  ///< lines of the header
};

void PrintTo(const HdrCase& c, std::ostream* out)
{
  *out << c.width << " x " << c.height << (c.has_runs ? ", runs" : "") << (c.more.empty() ? "" : ", with more");
}

std::string hdr_write(const HdrCase& c)
{
  std::string bytes = "#?RADIANCE\n" + c.more + "FORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(c.height) + " +X " +
                      std::to_string(c.width) + "\n";
  std::mt19937 random(7);
  const auto byte = [&](unsigned most) { return static_cast<char>(random() % (most + 1)); };
  for (int y = 0; y < c.height; ++y) {
    if (!c.has_runs) {
      // The first of a row is not taken for the start of runs.
      for (int x = 0; x < c.width; ++x)
        bytes += {static_cast<char>(x == 0 ? 200 : byte(255)), byte(255), byte(255), byte(255)};
      continue;
    }
    bytes += {2, 2, static_cast<char>(c.width >> 8), static_cast<char>(c.width & 0xff)};
    for (int channel = 0; channel < 4; ++channel) {
      for (int x = 0; x < c.width;) {
        const int num = 1 + static_cast<int>(random() % static_cast<unsigned>(std::min(c.width - x, 127)));
        if (random() % 2 == 0) {
          bytes += {static_cast<char>(128 + num), byte(255)};
        } else {
          bytes += static_cast<char>(num);
          for (int i = 0; i < num; ++i) bytes += byte(255);
        }
        x += num;
      }
    }
  }
  return bytes;
}

std::vector<unsigned char> bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

class HdrFileValues : public testing::TestWithParam<HdrCase> {};

TEST_P(HdrFileValues, AreThoseOfOpenImageIo)
{
  const std::string text = hdr_write(GetParam());
  const std::vector<unsigned char> bytes = bytes_of(text);
  const test::TemporaryFolder folder;
  const std::string path = folder.write("a.hdr", text).string();
  const std::unique_ptr<ImageFile> file = hdr_file_make(bytes), other = image_io().make_file("hdr");
  ASSERT_NE(file, nullptr);
  ImageHeader header, expected;
  ASSERT_EQ(file->open(path, bytes, header), "");
  ASSERT_EQ(other->open(path, {}, expected), "");
  test::expect_same_header(header, expected);
  const auto [width, height, has_runs, more] = GetParam();
  for (const SampleType type : {SampleType::kFloat, SampleType::kU8, SampleType::kU16}) {
    // All, the last rows, from the start again; all channels and one.
    using Part = std::array<int, 4>;
    for (const auto& [begin, end, first, last] :
         {Part{0, height, 0, 3}, Part{height - 2, height, 0, 3}, Part{0, 1, 1, 2}}) {
      const auto size = static_cast<std::size_t>((end - begin) * width * (last - first)) * sample_bytes(type);
      std::vector<unsigned char> found(size), wanted(size);
      ASSERT_EQ(file->read_rows(begin, end, first, last, type, found.data()), "");
      ASSERT_EQ(other->read_rows(begin, end, first, last, type, wanted.data()), "");
      if (type != SampleType::kFloat) {
        EXPECT_TRUE(found == wanted) << "rows from " << begin << ", " << sample_bytes(type) << " bytes";
        continue;
      }
      for (std::size_t i = 0; i < size; i += sizeof(float)) {
        float a, b;
        std::memcpy(&a, &found[i], sizeof a);
        std::memcpy(&b, &wanted[i], sizeof b);
        // Some of its powers of two are a bit too small.
        ASSERT_LE(std::abs(a - b), 0x1p-23f * a) << "rows from " << begin;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Kinds,
    HdrFileValues,
    testing::Values(HdrCase{40, 30, true},
                    HdrCase{300, 5, true,
                            "EXPOSURE=2\nPRIMARIES=0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329\n# a comment\n"},
                    HdrCase{40, 30, false},
                    HdrCase{7, 9, false}));

TEST(HdrFile, PowersOfTwoAreExact)
{
  const std::vector<unsigned char> bytes =
      bytes_of(std::string("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 3\n") + "\x80\x40\xff\x81" +
               std::string("\x80\x01\x80\x01", 4) + std::string("\x80\x80\x80\0", 4));
  const std::unique_ptr<ImageFile> file = hdr_file_make(bytes);
  ImageHeader header;
  ASSERT_EQ(file->open("a.hdr", bytes, header), "");
  float rows[9];
  ASSERT_EQ(file->read_rows(0, 1, 0, 3, SampleType::kFloat, reinterpret_cast<unsigned char*>(rows)), "");
  const float expected[9] = {1.0f, 0.5f, 255.0f / 128, 0x1p-128f, 0x1p-135f, 0x1p-128f, 0, 0, 0};
  for (int i = 0; i < 9; ++i) EXPECT_EQ(rows[i], expected[i]) << i;
}

TEST(HdrFile, OtherColoursAreLeftToOpenImageIo)
{
  std::string text = hdr_write({40, 30, true});
  text.replace(text.find("rgbe"), 4, "xyze");
  EXPECT_EQ(hdr_file_make(bytes_of(text)), nullptr);
}

TEST(HdrFile, OtherDirectionsAreLeftToOpenImageIo)
{
  const std::string text = hdr_write({40, 30, true});
  for (const char* size : {"+Y 30 +X 40", "-Y 30 -X 40", "+X 40 -Y 30"}) {
    std::string other = text;
    other.replace(other.find("-Y"), std::strlen("-Y 30 +X 40"), size);
    EXPECT_EQ(hdr_file_make(bytes_of(other)), nullptr) << size;
  }
  EXPECT_EQ(hdr_file_make({}), nullptr);
  EXPECT_EQ(hdr_file_make(bytes_of("#?RADIANCE\n")), nullptr);
}

TEST(HdrFile, RowsThatEndTooEarlyOrTooLateAreErrors)
{
  const std::string text = hdr_write({40, 30, true});
  std::vector<float> rows(std::size_t{40} * 30 * 3);
  const auto error_of = [&](const std::string& damaged) {
    const std::vector<unsigned char> bytes = bytes_of(damaged);
    const std::unique_ptr<ImageFile> file = hdr_file_make(bytes);
    ImageHeader header;
    EXPECT_EQ(file->open("damaged", bytes, header), "");
    return file->read_rows(0, 30, 0, 3, SampleType::kFloat, reinterpret_cast<unsigned char*>(rows.data()));
  };
  EXPECT_EQ(error_of(text), "");
  EXPECT_EQ(error_of(text.substr(0, text.size() - 1)), "row 29: the file ends before it does");
  const std::size_t first = text.find("+X 40\n") + 6;
  std::string other = text;
  other[first + 3] = 41;
  EXPECT_EQ(error_of(other), "row 0: its width is not the image's");
  other = text;
  other[first + 4] = static_cast<char>(128 + 41);
  EXPECT_EQ(error_of(other), "row 0: a run goes beyond it");
  other[first + 4] = 0;
  EXPECT_EQ(error_of(other), "row 0: a run goes beyond it");
}

TEST(HdrFile, DamagedBytesDoNoHarm)
{
  std::mt19937 random(3);
  const std::string whole = hdr_write({40, 30, true});
  int num_errors = 0;
  for (int k = 0; k < 2000; ++k) {
    std::string damaged = whole;
    for (int n = 0; n < 1 + k % 3; ++n) damaged[random() % damaged.size()] = static_cast<char>(random());
    if (k % 5 == 0) damaged.resize(random() % damaged.size());
    const std::vector<unsigned char> bytes = bytes_of(damaged);
    const std::unique_ptr<ImageFile> file = hdr_file_make(bytes);
    ImageHeader header;
    if (file == nullptr || !file->open("damaged", bytes, header).empty() || header.width <= 0 || header.height <= 0) {
      ++num_errors;
      continue;
    }
    if (std::int64_t{header.width} * header.height > 1 << 20) continue;
    std::vector<float> rows(static_cast<std::size_t>(header.width * header.height * 3));
    const std::string error =
        file->read_rows(0, header.height, 0, 3, SampleType::kFloat, reinterpret_cast<unsigned char*>(rows.data()));
    num_errors += error.empty() ? 0 : 1;
  }
  EXPECT_GT(num_errors, 100);
}

}  // namespace
}  // namespace relief
