#include "exporters/exr_state.h"

#include <cstring>
#include <limits>

#include "exporters/errors.h"
#include "tests/exporters/test_pictures.h"

namespace relief {
namespace {

class ExrStateTest : public FolderTest {
 protected:
  static constexpr int kWidth = 37, kHeight = 301;
  static constexpr std::size_t kSums = 23;

  ExrStateTest() : film_(kWidth, kHeight, 1)
  {
    saved_.width = kWidth;
    saved_.height = kHeight;
    saved_.sums.resize(kWidth * kHeight * kSums);
    // Every pattern of bits has to come back, those of NaN and denormals too.
    std::mt19937 random(1);
    for (float& sum : saved_.sums) {
      const auto bits = static_cast<std::uint32_t>(random());
      std::memcpy(&sum, &bits, sizeof sum);
    }
    RenderState& state = saved_.state;
    state.done_samples = 48;
    state.pass_samples = 16;
    state.active = {0, 2, 5};
    state.tile_samples = {48, 16, 64, 32, 32, 48};
    state.photons = {1234567, 0.1f, 0.2f, std::uint64_t{1} << 40, 1.0 / 3, 77, 2, 0.6};
    state.seconds = 1e9 / 7;
    state.counters.camera_rays = std::numeric_limits<std::uint64_t>::max();
    state.stage_seconds = {0.1, 0.2};
    state.most_displacement_steps = 17;
    state.first_nonfinite = std::uint64_t{5} << 32;
  }

  void write(const std::string& fingerprint) const
  {
    exr_write(file("a.exr"), film_.view, {{"relief:seed", "7"}}, {}, {saved_.state, saved_.sums, fingerprint});
  }

  /// Whether a file's state is refused with its name, what was expected and what was found, one of which is given.
  testing::AssertionResult is_refused(const std::string& name, const std::string& text)
  {
    try {
      exr_state_load(file(name), "abc");
    } catch (const InputError& error) {
      const bool says_all = error.file == file(name) && error.cause.starts_with("expected ") &&
                            error.cause.find(", found ") != std::string::npos &&
                            error.cause.find('\n') == std::string::npos;
      if (says_all && error.cause.find(text) != std::string::npos) return testing::AssertionSuccess();
      return testing::AssertionFailure() << error.what();
    }
    return testing::AssertionFailure() << "no error";
  }

  TestFilm film_;
  SavedRender saved_;
};

TEST_F(ExrStateTest, ComesBackInEveryBit)
{
  write("abc");
  const std::optional<SavedRender> found = exr_state_load(file("a.exr"), "abc");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->width, kWidth);
  EXPECT_EQ(found->height, kHeight);
  ASSERT_EQ(found->sums.size(), saved_.sums.size());
  EXPECT_EQ(std::memcmp(found->sums.data(), saved_.sums.data(), saved_.sums.size() * sizeof(float)), 0);
  const RenderState &a = found->state, &b = saved_.state;
  EXPECT_EQ(a.done_samples, b.done_samples);
  EXPECT_EQ(a.pass_samples, b.pass_samples);
  EXPECT_EQ(a.active, b.active);
  EXPECT_EQ(a.tile_samples, b.tile_samples);
  EXPECT_EQ(a.photons.photons_a_pass, b.photons.photons_a_pass);
  EXPECT_EQ(a.photons.first_radius, b.photons.first_radius);
  EXPECT_EQ(a.photons.first_radius_in_media, b.photons.first_radius_in_media);
  EXPECT_EQ(a.photons.stored, b.photons.stored);
  EXPECT_EQ(a.photons.seconds, b.photons.seconds);
  EXPECT_EQ(a.photons.passes, b.photons.passes);
  EXPECT_EQ(a.photons.maps, b.photons.maps);
  EXPECT_EQ(a.photons.served, b.photons.served);
  EXPECT_EQ(a.seconds, b.seconds);
  EXPECT_EQ(a.counters.camera_rays, b.counters.camera_rays);
  EXPECT_EQ(a.stage_seconds, b.stage_seconds);
  EXPECT_EQ(a.most_displacement_steps, b.most_displacement_steps);
  EXPECT_EQ(a.first_nonfinite, b.first_nonfinite);
}

TEST_F(ExrStateTest, ThePictureIsTheFirstPartAsItIsAlone)
{
  write("abc");
  exr_write(file("alone.exr"), film_.view, {{"relief:seed", "7"}});
  const Picture with = exr_load(file("a.exr")), alone = exr_load(file("alone.exr"));
  EXPECT_EQ(with.attributes, alone.attributes);
  ASSERT_EQ(with.channels.size(), alone.channels.size());
  for (std::size_t c = 0; c < with.channels.size(); ++c) {
    EXPECT_EQ(with.channels[c].name, alone.channels[c].name);
    EXPECT_EQ(with.channels[c].type, alone.channels[c].type);
    const std::vector<float>&x = with.channels[c].values, &y = alone.channels[c].values;
    ASSERT_EQ(x.size(), y.size());
    EXPECT_EQ(std::memcmp(x.data(), y.data(), x.size() * sizeof(float)), 0) << with.channels[c].name;
  }
}

TEST_F(ExrStateTest, IsOfItsFingerprintAlone)
{
  EXPECT_FALSE(exr_state_load(file("a.exr"), "abc")) << "no file";
  write("abc");
  EXPECT_FALSE(exr_state_load(file("a.exr"), "abd"));
  exr_write(file("a.exr"), film_.view, {});
  EXPECT_FALSE(exr_state_load(file("a.exr"), "")) << "a whole picture has no state";
}

TEST_F(ExrStateTest, IsRefusedIfTheFileIsCutShortOrItsTextDamaged)
{
  write("abc");
  const std::string bytes = bytes_of_file(file("a.exr"));
  for (const double part : {0.0, 0.001, 0.1, 0.5, 0.9, 0.9999}) {
    write_bytes(file("cut.exr"), bytes.substr(0, static_cast<std::size_t>(part * static_cast<double>(bytes.size()))));
    EXPECT_TRUE(is_refused("cut.exr", part < 0.01 ? "found a file that cannot be read: " : "")) << part;
  }
  for (const std::string word : {"done_samples", "\"active\":[", "camera_rays"}) {
    std::string damaged = bytes;
    const std::size_t at = damaged.find(word);
    ASSERT_NE(at, std::string::npos) << word;
    damaged[at + 1] = '#';
    write_bytes(file("damaged.exr"), damaged);
    EXPECT_TRUE(is_refused("damaged.exr", "expected a state whose hash is '")) << word;
  }
}

TEST_F(ExrStateTest, IsRefusedIfABitOfItHasTurned)
{
  write("abc");
  const std::string bytes = bytes_of_file(file("a.exr"));
  // In digits, which stay digits; and in sums, the last of which end the file.
  const std::size_t text = bytes.find("\"done_samples\":48"), photons = bytes.find("\"photons_a_pass\":1234567");
  ASSERT_NE(text, std::string::npos);
  ASSERT_NE(photons, std::string::npos);
  const std::size_t sums_end = bytes.size(), sums_size = saved_.sums.size() * sizeof(float);
  std::vector<std::size_t> places = {text + 15, photons + 18};
  for (std::size_t i = 1; i < 40; ++i) places.push_back(sums_end - i * (sums_size / 40) - i % 4);
  for (const std::size_t at : places) {
    for (const int bit : {0, 7}) {
      if (bit == 7 && at < sums_end - sums_size) continue;
      std::string damaged = bytes;
      damaged[at] = static_cast<char>(damaged[at] ^ (1 << bit));
      write_bytes(file("damaged.exr"), damaged);
      EXPECT_TRUE(is_refused("damaged.exr", "")) << at << " bit " << bit;
    }
  }
  // The highest bits of two words: products alone leave them where they are, and the one would undo the other.
  std::string damaged = bytes;
  for (const std::size_t at : {sums_end - 5, sums_end - 13}) damaged[at] = static_cast<char>(damaged[at] ^ 0x80);
  write_bytes(file("damaged.exr"), damaged);
  EXPECT_TRUE(is_refused("damaged.exr", "expected a state whose hash is '"));
}

}  // namespace
}  // namespace relief
