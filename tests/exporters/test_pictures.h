// What the tests of this folder share: a folder of their own, and made-up films and pictures.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "exporters/picture.h"

namespace relief {

/// A new, empty folder for each test, removed afterwards.
class FolderTest : public ::testing::Test {
 protected:
  void SetUp() override
  {
    std::random_device entropy;
    folder_ = std::filesystem::temp_directory_path() /
              ("relief_test_" + std::to_string(entropy()) + std::to_string(entropy()));
    std::filesystem::create_directory(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path file(const std::string& name) const { return folder_ / name; }

  std::vector<std::string> files_in_folder() const
  {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      names.push_back(entry.path().filename().string());
    }
    return names;
  }

  std::filesystem::path folder_;
};

inline std::string bytes_of_file(const std::filesystem::path& path)
{
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

inline void write_bytes(const std::filesystem::path& path, const std::string& bytes)
{
  std::ofstream(path, std::ios::binary) << bytes;
}

/// Bits of all AOVs but the Cryptomattes, whose channels are no numbers.
inline constexpr AovMask kNumericAovs = aov_bit(static_cast<Aov>(kFirstCryptomatte)) - 1;

/// A film with plausible values in every AOV: ids and counts are integers, the rest is uniform in [0, 2).
struct TestFilm {
  std::vector<float> pixels;
  FilmView view;

  TestFilm(int width, int height, std::uint32_t seed, AovMask aov_mask = kNumericAovs)
  {
    view.width = view.full_width = width;
    view.height = view.full_height = height;
    static const std::string kLightGroups[] = {"key"};
    view.layout = film_layout_make(aov_mask, 6, 1);
    view.light_groups = kLightGroups;
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> uniform(0.f, 2.f);
    std::uniform_int_distribution<int> integer(1, 70000);
    for (int i = 0; i < width * height; ++i) {
      for (const AovInfo& info : kAovInfo) {
        if (view.layout.offset[static_cast<std::size_t>(info.aov)] < 0) continue;
        for (int c = 0; c < aov_num_channels(info, view.layout); ++c) {
          pixels.push_back(info.integer_like ? static_cast<float>(integer(random)) : uniform(random));
        }
      }
    }
    view.pixels = pixels.data();
  }
};

/// An owned picture of R, G, B with uniform values in [0, largest).
inline Picture random_picture(int width, int height, std::uint32_t seed, float largest = 1.f)
{
  Picture picture;
  picture.width = picture.full_width = width;
  picture.height = picture.full_height = height;
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.f, largest);
  for (const char* name : {"R", "G", "B"}) {
    Channel channel{name, ChannelType::kFloat, {}};
    for (int i = 0; i < width * height; ++i) {
      channel.values.push_back(uniform(random));
    }
    picture.channels.push_back(channel);
  }
  return picture;
}

/// An owned picture of one colour.
inline Picture constant_picture(int width, int height, float r, float g, float b)
{
  Picture picture;
  picture.width = picture.full_width = width;
  picture.height = picture.full_height = height;
  const std::size_t num_pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  picture.channels = {{"R", ChannelType::kFloat, std::vector<float>(num_pixels, r)},
                      {"G", ChannelType::kFloat, std::vector<float>(num_pixels, g)},
                      {"B", ChannelType::kFloat, std::vector<float>(num_pixels, b)}};
  return picture;
}

}  // namespace relief
