// Damaged files: an error of one line, never a crash, never memory of the size that a liar claims.
#include <gtest/gtest.h>

#include <cstring>

#include "exporters/errors.h"
#include "exporters/exr.h"
#include "tests/exporters/test_pictures.h"

namespace relief {

namespace {

class ExrFault : public FolderTest {
 protected:
  std::string valid_bytes(ExrCompression compression)
  {
    ExrOptions options;
    options.compression = compression;
    exr_write(file("valid.exr"), TestFilm(40, 50, 1).view, {{"relief:seed", "1"}}, options);
    return bytes_of_file(file("valid.exr"));
  }

  /// Loads; an error must be an InputError of one line that names the file.
  bool loads(const std::string& bytes)
  {
    write_bytes(file("bad.exr"), bytes);
    try {
      exr_load(file("bad.exr"));
      return true;
    } catch (const InputError& error) {
      EXPECT_EQ(error.file, file("bad.exr").string());
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      EXPECT_FALSE(error.cause.empty());
      return false;
    }
  }

  static void put_int(std::string& bytes, std::size_t at, std::int32_t value) { std::memcpy(&bytes[at], &value, 4); }

  /// Start of an attribute's value.
  static std::size_t value_of(const std::string& bytes, const std::string& name, const std::string& type)
  {
    const std::string key = name + '\0' + type + '\0';
    return bytes.find(key) + key.size() + 4;
  }
};

constexpr ExrCompression kAll[] = {ExrCompression::kNone, ExrCompression::kZips, ExrCompression::kZip,
                                   ExrCompression::kPiz,  ExrCompression::kDwaa, ExrCompression::kDwab};

}  // namespace

TEST_F(ExrFault, EveryTruncationIsAnError)
{
  for (const ExrCompression compression : kAll) {
    const std::string bytes = valid_bytes(compression);
    ASSERT_TRUE(loads(bytes));
    // The header is the same for all, so one of them is cut there at every few bytes; the rest is sampled.
    const std::size_t fine_step = compression == ExrCompression::kZip ? 3 : 40;
    for (std::size_t length = 0; length < bytes.size(); length += length < 1500 ? fine_step : bytes.size() / 40) {
      EXPECT_FALSE(loads(bytes.substr(0, length))) << length << " of " << bytes.size() << " bytes";
    }
    EXPECT_FALSE(loads(bytes.substr(0, bytes.size() - 1)));
  }
}

TEST_F(ExrFault, RandomDamageNeverCrashes)
{
  // What damaged bytes decode to is OpenEXR's affair; that it does not end the process is ours.
  std::mt19937 random(7);
  for (const ExrCompression compression : kAll) {
    const std::string bytes = valid_bytes(compression);
    for (int round = 0; round < 300; ++round) {
      std::string damaged = bytes;
      // Half of the rounds hit the header, where the sizes are.
      const std::size_t range = round % 2 == 0 ? std::size_t{1400} : bytes.size();
      const int num_hits = 1 + round % 8;
      for (int hit = 0; hit < num_hits; ++hit) {
        damaged[random() % range] = static_cast<char>(random());
      }
      loads(damaged);
    }
  }
}

TEST_F(ExrFault, AHeaderThatClaimsAHugePictureIsRefusedBeforeAllocation)
{
  const std::string bytes = valid_bytes(ExrCompression::kZip);
  const std::size_t data_window = value_of(bytes, "dataWindow", "box2i");
  const std::size_t display_window = value_of(bytes, "displayWindow", "box2i");
  for (const std::int32_t last : {100000, 1 << 20, 0x3fffffff, 0x7ffffffe, 0x7fffffff, -5}) {
    std::string hostile = bytes;
    put_int(hostile, data_window + 8, last);
    put_int(hostile, data_window + 12, last);
    EXPECT_FALSE(loads(hostile)) << last;
    put_int(hostile, display_window + 8, last);
    put_int(hostile, display_window + 12, last);
    EXPECT_FALSE(loads(hostile)) << last;
  }
}

TEST_F(ExrFault, WhatIsNoExrIsSaidToBeNone)
{
  EXPECT_FALSE(loads(""));
  EXPECT_FALSE(loads("hello, world"));
  EXPECT_FALSE(loads(std::string(100000, '\0')));
  EXPECT_FALSE(loads(std::string("\x76\x2f\x31\x01", 4)));
  EXPECT_THROW(exr_load(file("missing.exr")), InputError);
  EXPECT_THROW(exr_load(folder_), InputError);
  EXPECT_THROW(exr_load("/dev/null"), InputError);
}

}  // namespace relief
