// Damaged files: an error of one line, never a crash, never memory of the size that a liar claims.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <string>
#include <vector>

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

  /// Most memory that this process has held since it was last told to forget, or holds.
  /// @param name  VmHWM or VmRSS
  static double held_mib(const std::string& name)
  {
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;) {
      double kib = 0;
      if (word == name + ":" && status >> kib) return kib / 1024;
    }
    return -1;
  }

  /// What a call takes at its peak.
  template <class Call>
  static double peak_mib(const Call& call)
  {
    std::ofstream("/proc/self/clear_refs") << 5;
    const double before = held_mib("VmRSS");
    call();
    return held_mib("VmHWM") - before;
  }

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

// Of 65536 x 1 pixels in 64 channels, 18 kB that hold 16 MiB of values: reading 256 rows at once took 8.2 GB, and writing them 4.3.
TEST_F(ExrFault, AWidePictureOfOneRowTakesWhatItsValuesTake)
{
  for (const ChannelType type : {ChannelType::kUint, ChannelType::kFloat, ChannelType::kHalf}) {
    for (const ExrCompression compression : {ExrCompression::kZip, ExrCompression::kNone}) {
      Picture picture;
      picture.width = picture.full_width = 65536;
      picture.height = picture.full_height = 1;
      for (int c = 0; c < 64; ++c) {
        picture.channels.push_back({"c" + std::to_string(c), type, std::vector<float>(65536, static_cast<float>(c))});
      }
      const double written = peak_mib([&] { exr_write(file("wide.exr"), picture, compression); });
      EXPECT_LT(written, 200) << static_cast<int>(type) << " " << static_cast<int>(compression);
      Picture loaded;
      const double taken = peak_mib([&] { loaded = exr_load(file("wide.exr")); });
      EXPECT_LT(taken, 200) << static_cast<int>(type) << " " << static_cast<int>(compression);
      ASSERT_EQ(loaded.channels.size(), 64u);
      for (int c = 0; c < 64; c += 21) {
        EXPECT_EQ(loaded.find("c" + std::to_string(c))->values, std::vector<float>(65536, static_cast<float>(c)));
      }
    }
  }
}

TEST_F(ExrFault, TextThatClaimsMoreThanTheFileHasIsRefusedBeforeAllocation)
{
  std::string bytes = valid_bytes(ExrCompression::kZip);
  put_int(bytes, value_of(bytes, "relief:seed", "string") - 4, 0x7fffff00);
  EXPECT_LT(peak_mib([&] { EXPECT_FALSE(loads(bytes)); }), 100);
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
