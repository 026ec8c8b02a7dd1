#include "exporters/merge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "exporters/errors.h"
#include "exporters/exr.h"
#include "scene/memory.h"
#include "tests/exporters/test_pictures.h"

namespace relief {

namespace {

constexpr int kWidth = 21, kHeight = 13;

class Merge : public FolderTest {
 protected:
  /// A render with its own values and sample counts; the first pixel has no samples.
  TestFilm film(std::uint32_t seed)
  {
    TestFilm made(kWidth, kHeight, seed);
    std::mt19937 random(seed + 1000);
    const std::size_t record = static_cast<std::size_t>(made.view.layout.num_floats);
    const std::size_t samples = offset(made, Aov::kSampleCount), alpha = offset(made, Aov::kBeauty) + 3;
    for (std::size_t i = 0; i < kWidth * kHeight; ++i) {
      made.pixels[i * record + samples] = static_cast<float>(i == 0 ? 0 : 1 + random() % 100);
      made.pixels[i * record + alpha] = static_cast<float>(random() % 5) / 4;  // 0 … 1, exact
    }
    return made;
  }

  static std::size_t offset(const TestFilm& film, Aov aov)
  {
    return static_cast<std::size_t>(film.view.layout.offset[static_cast<std::size_t>(aov)]);
  }

  std::filesystem::path write(const std::string& name,
                              const TestFilm& film,
                              const std::string& seed,
                              Attributes extra = {})
  {
    extra.insert(
        {{"relief:seed", seed}, {"relief:scene", "scene.glb"}, {"relief:frame", "1"}, {"relief:seconds", "2.5"}});
    ExrOptions options;
    options.float_color = true;
    exr_write(file(name), film.view, extra, options);
    return file(name);
  }

  MergeResult merge(std::vector<std::filesystem::path> files, bool force = false)
  {
    MergeOptions options;
    options.force = force;
    return merge_pictures(files, options);
  }

  /// The message of the error that merging must give.
  std::string refusal(std::vector<std::filesystem::path> files, bool force = false)
  {
    try {
      merge(std::move(files), force);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }
};

}  // namespace

TEST_F(Merge, EqualsTheSampleWeightedMeansInDoublePrecision)
{
  const TestFilm films[] = {film(1), film(2), film(3)};
  const MergeResult result =
      merge({write("1.exr", films[0], "1"), write("2.exr", films[1], "2"), write("3.exr", films[2], "3")});
  EXPECT_TRUE(result.warnings.empty());
  for (const AovInfo& info : kAovInfo) {
    for (std::size_t c = 0; c < info.channels.size(); ++c) {
      const Channel* merged = result.picture.find(channel_name(info, c, films[0].view.light_groups));
      ASSERT_NE(merged, nullptr);
      for (std::size_t i = 0; i < kWidth * kHeight; ++i) {
        double sum = 0, weights = 0, first = 0, num_samples = 0;
        for (const TestFilm& f : films) {
          const std::size_t pixel = i * static_cast<std::size_t>(f.view.layout.num_floats);
          const double n = double{f.pixels[pixel + offset(f, Aov::kSampleCount)]};
          const double alpha = double{f.pixels[pixel + offset(f, Aov::kBeauty) + 3]};
          const double x = double{f.pixels[pixel + offset(f, info.aov) + c]};
          if (num_samples == 0 && n > 0) first = x;
          num_samples += n;
          const bool over_hits = info.aov == Aov::kDepth || info.aov == Aov::kPosition;
          const bool is_half = info.aov == Aov::kHalf || info.aov == Aov::kDenoisingHalf;
          const double weight = is_half ? std::floor((n + 1) / 2) : over_hits ? n * alpha : n;
          sum += info.aov == Aov::kVariance ? n * n * x : weight * x;
          weights += weight;
        }
        double expected = weights > 0 ? sum / weights : 0;
        if (info.aov == Aov::kVariance) expected = weights > 0 ? sum / (weights * weights) : 0;
        if (info.aov == Aov::kSampleCount) expected = num_samples;
        if (info.aov == Aov::kObjectId || info.aov == Aov::kMaterialId) expected = first;
        ASSERT_FLOAT_EQ(merged->values[i], static_cast<float>(expected)) << merged->name << " at " << i;
      }
    }
  }
}

TEST_F(Merge, MetadataDescribeTheJoinedRender)
{
  TestFilm a = film(1), b = film(2);
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) {
    a.pixels[i * static_cast<std::size_t>(a.view.layout.num_floats) + offset(a, Aov::kSampleCount)] = 16;
    b.pixels[i * static_cast<std::size_t>(b.view.layout.num_floats) + offset(b, Aov::kSampleCount)] = 48;
  }
  const Picture merged = merge({write("1.exr", a, "1", {{"relief:error_rmse", "0.2"}, {"relief:warnings", "x\ny"}}),
                                write("2.exr", b, "2", {{"relief:error_rmse", "0.1"}, {"relief:warnings", "y\nz"}})})
                             .picture;
  EXPECT_EQ(merged.attributes.at("relief:seed"), "1,2");
  EXPECT_EQ(merged.attributes.at("relief:samples"), "64");
  EXPECT_EQ(merged.attributes.at("relief:seconds"), "5");
  EXPECT_EQ(merged.attributes.at("relief:scene"), "scene.glb");
  EXPECT_EQ(merged.attributes.at("relief:warnings"), "x\ny\nz");
  EXPECT_NEAR(std::stod(merged.attributes.at("relief:error_rmse")), std::hypot(16 * .2, 48 * .1) / 64, 1e-9);
}

TEST_F(Merge, OfAMergeIsTheSameAsOfAllAtOnce)
{
  const auto a = write("1.exr", film(1), "1"), b = write("2.exr", film(2), "2"), c = write("3.exr", film(3), "3");
  exr_write(file("ab.exr"), merge({a, b}).picture);
  const Picture steps = merge({file("ab.exr"), c}).picture, once = merge({a, b, c}).picture;
  EXPECT_EQ(steps.attributes.at("relief:seed"), "1,2,3");
  for (const Channel& channel : once.channels) {
    // Layers weighted by hits and half-samples are weighted by the merged coverage and counts, which are rounded.
    const bool is_exact = !channel.name.starts_with("half.") && !channel.name.starts_with("denoising_half.");
    for (std::size_t i = 0; is_exact && i < channel.values.size(); ++i) {
      EXPECT_NEAR(steps.find(channel.name)->values[i], channel.values[i], 2e-6f * (1 + channel.values[i]))
          << channel.name;
    }
  }
  // The same seed does not get in through the back door.
  EXPECT_NE(refusal({file("ab.exr"), b}).find("same seed"), std::string::npos);
}

TEST_F(Merge, PartsOfASeedJoinInAnyOrder)
{
  const auto part = [&](const std::string& name, std::uint32_t values, const std::string& range,
                        const char* seed = "5") {
    return write(name, film(values), seed, {{"relief:sample_ranges", range}});
  };
  const auto a = part("a.exr", 1, "0-16/64"), b = part("b.exr", 2, "16-48/64"), c = part("c.exr", 3, "48-64/64");
  for (const auto& files : {std::vector{a, b, c}, {c, a, b}, {b, c, a}, {c, b, a}}) {
    const Attributes all = merge(files).picture.attributes;
    EXPECT_EQ(all.at("relief:seed"), "5");
    EXPECT_FALSE(all.contains("relief:sample_ranges"));
  }
  const Attributes two = merge({c, a}).picture.attributes;
  EXPECT_EQ(two.at("relief:seed"), "5,5");
  EXPECT_EQ(two.at("relief:sample_ranges"), "48-64/64,0-16/64");
  // Merges of parts, with another seed between.
  exr_write(file("ca.exr"), merge({c, a}).picture);
  const auto other = write("o.exr", film(4), "6");
  const Attributes mixed = merge({file("ca.exr"), other}).picture.attributes;
  EXPECT_EQ(mixed.at("relief:seed"), "5,5,6");
  EXPECT_EQ(mixed.at("relief:sample_ranges"), "48-64/64,0-16/64,all");
  exr_write(file("cao.exr"), merge({file("ca.exr"), other}).picture);
  EXPECT_EQ(merge({file("cao.exr"), b}).picture.attributes.at("relief:seed"), "5,6");
}

TEST_F(Merge, RefusesTheSameSamplesOfASeedTwice)
{
  const auto part = [&](const std::string& name, std::uint32_t values, const std::string& range) {
    return write(name, film(values), "5", {{"relief:sample_ranges", range}});
  };
  const auto a = part("a.exr", 1, "0-16/64"), b = part("b.exr", 2, "16-64/64"), whole = write("w.exr", film(3), "5");
  for (const auto& [name, range] : {std::pair{"x.exr", "0-16/64"}, {"y.exr", "12-20/64"}, {"z.exr", "16-32/48"}}) {
    const std::string text = refusal({a, part(name, 4, range)}, true);
    EXPECT_NE(text.find("same seed, 5"), std::string::npos) << text;
  }
  EXPECT_NE(refusal({a, whole}).find("the same samples twice"), std::string::npos);
  exr_write(file("ab.exr"), merge({a, b}).picture);
  EXPECT_NE(refusal({file("ab.exr"), b}).find("the same samples twice"), std::string::npos);
  for (const char* wrong : {"16-16/64", "0-65/64", "x", "1-2", "0-16/64,16-32/64"}) {
    EXPECT_NE(refusal({a, part("wrong.exr", 4, wrong)}).find("relief:sample_ranges"), std::string::npos) << wrong;
  }
}

TEST_F(Merge, RefusesEqualSeedsEvenByForceAndNamesBothFiles)
{
  const auto a = write("1.exr", film(1), "7"), b = write("2.exr", film(2), "7");
  for (const bool force : {false, true}) {
    const std::string message = refusal({a, b}, force);
    EXPECT_NE(message.find("same seed"), std::string::npos);
    EXPECT_NE(message.find("1.exr"), std::string::npos);
    EXPECT_NE(message.find("2.exr"), std::string::npos);
  }
}

TEST_F(Merge, RefusesOtherScenesFramesAndUnknownSeedsUnlessForced)
{
  const auto a = write("1.exr", film(1), "1");
  const auto other_scene = write("2.exr", film(2), "2", {{"relief:scene", "other.glb"}});
  const auto other_frame = write("3.exr", film(3), "3", {{"relief:frame", "2"}});
  exr_write(file("4.exr"), film(4).view, {{"relief:scene", "scene.glb"}, {"relief:frame", "1"}});
  EXPECT_NE(refusal({a, other_scene}).find("'other.glb'"), std::string::npos);
  EXPECT_NE(refusal({a, other_frame}).find("relief:frame"), std::string::npos);
  EXPECT_NE(refusal({a, file("4.exr")}).find("relief:seed"), std::string::npos);
  EXPECT_EQ(refusal({a, other_scene, other_frame, file("4.exr")}, true), "no error");
}

TEST_F(Merge, RefusesOtherSizesAndWindows)
{
  const auto a = write("1.exr", film(1), "1");
  const auto smaller = write("2.exr", TestFilm(kWidth, kHeight - 1, 2), "2");
  TestFilm moved = film(3);
  moved.view.crop_x = 1;
  moved.view.full_width = kWidth + 1;
  const auto crop = write("3.exr", moved, "3");
  for (const bool force : {false, true}) {
    EXPECT_NE(refusal({a, smaller}, force).find("21x12"), std::string::npos);
    EXPECT_NE(refusal({a, crop}, force).find("at 1,0 of 22x13"), std::string::npos);
  }
}

TEST_F(Merge, LeavesOutLayersThatNotAllHaveAndSaysSo)
{
  const AovMask few = aov_bit(Aov::kBeauty) | aov_bit(Aov::kSampleCount);
  const auto rich = write("1.exr", film(1), "1"), poor = write("2.exr", TestFilm(kWidth, kHeight, 2, few), "2");
  for (const auto& files : {std::vector{rich, poor}, std::vector{poor, rich}}) {
    const MergeResult result = merge(files);
    EXPECT_EQ(picture_layers(result.picture), (std::vector<std::string>{"beauty", "samples"}));
    EXPECT_EQ(result.warnings.size(), static_cast<std::size_t>(kFirstCryptomatte - 2));
    EXPECT_TRUE(std::any_of(result.warnings.begin(), result.warnings.end(), [](const std::string& text) {
      return text.find("'albedo' is left out") != std::string::npos;
    }));
  }
}

TEST_F(Merge, WithoutCountsWeighsByTheMetadataAndWithoutThoseRefuses)
{
  const AovMask beauty = aov_bit(Aov::kBeauty);
  const TestFilm a(kWidth, kHeight, 1, beauty), b(kWidth, kHeight, 2, beauty);
  const Picture merged =
      merge({write("1.exr", a, "1", {{"relief:samples", "10"}}), write("2.exr", b, "2", {{"relief:samples", "30"}})})
          .picture;
  EXPECT_FLOAT_EQ(merged.find("R")->values[5], .25f * a.pixels[20] + .75f * b.pixels[20]);
  EXPECT_NE(refusal({write("3.exr", a, "3"), write("4.exr", b, "4")}).find("relief:samples"), std::string::npos);
}

TEST_F(Merge, RefusesACheckpointWhosePixelsMayHaveNoSample)
{
  const TestFilm a(kWidth, kHeight, 1, aov_bit(Aov::kBeauty));
  const Attributes unfinished = {{"relief:samples", "10"}, {"relief:stop_reason", "interrupted"}};
  // With the seed of the other it is a part that is still rendered.
  for (const char* seed : {"1", "2"}) {
    const auto checkpoint = write("c.exr", a, seed, unfinished);
    const auto whole = write("w.exr", a, "1", {{"relief:samples", "10"}, {"relief:sample_ranges", "0-10/20"}});
    for (const bool force : {false, true}) {
      EXPECT_NE(refusal({whole, checkpoint}, force).find("c.exr: is of a render that is not finished"),
                std::string::npos);
    }
  }
  // One that knows the samples of its pixels is as good as any.
  EXPECT_EQ(refusal({write("1.exr", film(1), "1", unfinished), write("2.exr", film(2), "2")}), "no error");
}

TEST_F(Merge, HalvesTheVarianceOfTwoEqualRenders)
{
  TestFilm a = film(1), b = film(2);
  for (TestFilm* f : {&a, &b}) {
    for (std::size_t i = 0; i < kWidth * kHeight; ++i) {
      const std::size_t pixel = i * static_cast<std::size_t>(f->view.layout.num_floats);
      f->pixels[pixel + offset(*f, Aov::kSampleCount)] = 8;
      f->pixels[pixel + offset(*f, Aov::kVariance)] = .5f;
    }
  }
  const Picture merged = merge({write("1.exr", a, "1"), write("2.exr", b, "2")}).picture;
  for (const float v : merged.find("variance.R")->values) {
    EXPECT_EQ(v, .25f);
  }
}

// Of merged samples there is a better one.
TEST_F(Merge, DenoisedLayersAreLeftOutAndSaid)
{
  std::vector<std::filesystem::path> files;
  for (const char* seed : {"1", "2"}) {
    const TestFilm rendered = film(static_cast<unsigned>(*seed - '0'));
    const ChannelView red = film_layer(rendered.view, Aov::kBeauty).channels[0];
    ChannelView denoised = red, error = red;
    denoised.name = "denoised.R";
    error.name = "denoised_error.R";
    files.push_back(file(std::string(seed) + ".exr"));
    exr_write(files.back(), rendered.view, {{"relief:seed", seed}, {"relief:scene", "s"}, {"relief:frame", "0"}}, {},
              {denoised, error});
    ASSERT_NE(exr_load(files.back()).find("denoised.R"), nullptr);
  }
  const MergeResult result = merge(files);
  EXPECT_EQ(result.picture.find("denoised.R"), nullptr);
  EXPECT_EQ(result.picture.find("denoised_error.R"), nullptr);
  EXPECT_NE(std::find(result.warnings.begin(), result.warnings.end(),
                      "layer 'denoised' is left out: denoise the merged picture, which has less noise"),
            result.warnings.end());
}

TEST_F(Merge, CryptomattesAreLeftOutAndSaid)
{
  const AovMask aovs = 1u | aov_bit(Aov::kSampleCount) | aov_bit(Aov::kCryptoObject);
  TestFilm film(kWidth, kHeight, 1, aovs);
  const Attributes name = {{"cryptomatte/3ae39a5/name", "CryptoObject"}};
  const MergeResult result = merge({write("1.exr", film, "1", name), write("2.exr", film, "2", name)});
  EXPECT_EQ(result.picture.find("CryptoObject00.r"), nullptr);
  EXPECT_EQ(result.picture.attributes.count("cryptomatte/3ae39a5/name"), 0u);
  ASSERT_EQ(result.warnings.size(), 3u);
  EXPECT_EQ(result.warnings[0], "layer 'CryptoObject00' is left out: ids have no mean");
}

TEST_F(Merge, AsksForTheMemoryOfItsSums)
{
  Picture large;
  large.width = large.full_width = 2048;
  large.height = large.full_height = 1024;
  const std::size_t num_pixels = std::size_t{2048} * 1024;
  for (const char* name : {"R", "G", "B", "A", "samples.N"}) {
    large.channels.push_back({name, ChannelType::kFloat, std::vector<float>(num_pixels, 1.0f)});
  }
  large.attributes = {{"relief:seed", "1"}, {"relief:scene", "s"}, {"relief:frame", "0"}};
  exr_write(file("1.exr"), large);
  large = {};
  // Enough for the picture, 40 MiB, and not for eight sums of 16.
  constexpr std::uint64_t kAll = std::uint64_t{1} << 40;
  memory_limit_set(kAll);
  memory_limit_set(kAll - memory_left() + (std::uint64_t{64} << 20));
  std::string refused = "no error";
  try {
    merge({file("1.exr")});
  } catch (const OutOfMemory& error) {
    refused = error.what();
  }
  memory_limit_reset();
  EXPECT_NE(refused.find("the sums of its layers"), std::string::npos) << refused;
}

}  // namespace relief
