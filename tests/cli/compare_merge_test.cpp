// `relief compare` and `relief merge` as the command line reaches them, without a process.
#include <CLI/CLI.hpp>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "cli/cmd_compare.h"
#include "cli/cmd_merge.h"
#include "exporters/errors.h"
#include "exporters/exr.h"
#include "tests/exporters/test_pictures.h"

namespace relief {

namespace {

class CompareMerge : public FolderTest {
 protected:
  /// Parses and runs; keeps what was printed. @return the exit code
  int run(std::vector<std::string> arguments)
  {
    CLI::App app{"relief"};
    std::function<int()> command;
    cmd_compare_register(app, command);
    cmd_merge_register(app, command);
    std::reverse(arguments.begin(), arguments.end());
    app.parse(arguments);
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    int exit_code = -1;
    try {
      exit_code = command();
    } catch (...) {
      output_ = testing::internal::GetCapturedStdout();
      errors_ = testing::internal::GetCapturedStderr();
      throw;
    }
    output_ = testing::internal::GetCapturedStdout();
    errors_ = testing::internal::GetCapturedStderr();
    return exit_code;
  }

  /// A grey picture with noise, its variance, and 16 samples a pixel.
  std::string write_render(const std::string& name, std::uint32_t seed, float offset = 0)
  {
    Picture picture = constant_picture(32, 24, .5f + offset, .5f + offset, .5f + offset);
    std::mt19937 random(seed);
    std::normal_distribution<float> noise(0.f, .01f);
    for (std::size_t c = 0; c < 3; ++c) {
      for (float& value : picture.channels[c].values) {
        value += noise(random);
      }
    }
    const std::size_t num_pixels = picture.channels[0].values.size();
    for (const char* channel : {"variance.R", "variance.G", "variance.B"}) {
      picture.channels.push_back({channel, ChannelType::kFloat, std::vector<float>(num_pixels, 1e-4f)});
    }
    picture.channels.push_back({"samples.N", ChannelType::kUint, std::vector<float>(num_pixels, 16.f)});
    picture.attributes = {{"relief:seed", std::to_string(seed)}};
    exr_write(file(name), picture);
    return file(name).string();
  }

  std::string output_, errors_;
};

}  // namespace

TEST_F(CompareMerge, ComparePrintsEveryMeasure)
{
  EXPECT_EQ(run({"compare", write_render("a.exr", 1), write_render("b.exr", 2)}), 0);
  for (const char* word : {"RMSE", "relMSE", "PSNR", "FLIP", "MAE", "max"}) {
    EXPECT_NE(output_.find(word), std::string::npos) << word;
  }
  EXPECT_EQ(output_.find("z-test"), std::string::npos);
}

TEST_F(CompareMerge, CompareExitsWithOneAboveABoundAndSaysWhich)
{
  const std::string a = write_render("a.exr", 1), b = write_render("b.exr", 2);
  // Two noises of 0.01 give an RMSE of 0.0141.
  EXPECT_EQ(run({"compare", a, b, "--max-rmse", "0.02", "--max-relmse", "0.01", "--max-flip", "0.5"}), 0);
  EXPECT_EQ(run({"compare", a, b, "--max-rmse", "0.01"}), 1);
  EXPECT_NE(errors_.find("RMSE"), std::string::npos);
  EXPECT_EQ(run({"compare", a, b, "--max-relmse", "1e-6"}), 1);
  EXPECT_EQ(run({"compare", a, b, "--max-flip", "1e-6"}), 1);
  EXPECT_NE(errors_.find("FLIP"), std::string::npos);
  EXPECT_EQ(run({"compare", a, a, "--max-rmse", "0"}), 0);
}

TEST_F(CompareMerge, CompareMeetsNoBoundWithNan)
{
  Picture picture = constant_picture(4, 4, 1, 1, 1);
  exr_write(file("a.exr"), picture);
  picture.channels[0].values[3] = std::nanf("");
  exr_write(file("b.exr"), picture);
  EXPECT_EQ(run({"compare", file("b.exr").string(), file("a.exr").string(), "--max-rmse", "10"}), 1);
}

TEST_F(CompareMerge, CompareZTestPassesForNoiseAndFailsForBias)
{
  const std::string a = write_render("a.exr", 1), b = write_render("b.exr", 2),
                    biased = write_render("c.exr", 3, .004f);
  EXPECT_EQ(run({"compare", a, b, "--z-test"}), 0);
  EXPECT_NE(output_.find("z-test  passed"), std::string::npos);
  EXPECT_EQ(run({"compare", a, biased, "--z-test"}), 1);
  EXPECT_NE(output_.find("z-test  FAILED"), std::string::npos);
}

TEST_F(CompareMerge, CompareZTestNeedsVariances)
{
  exr_write(file("a.exr"), constant_picture(4, 4, 1, 1, 1));
  EXPECT_THROW(run({"compare", file("a.exr").string(), file("a.exr").string(), "--z-test"}), InputError);
}

TEST_F(CompareMerge, CompareWritesJsonToAFileOrAloneToStandardOutput)
{
  const std::string a = write_render("a.exr", 1), b = write_render("b.exr", 2);
  EXPECT_EQ(run({"compare", a, b, "--json", "-", "--z-test"}), 0);
  const nlohmann::json printed = nlohmann::json::parse(output_);
  EXPECT_NEAR(printed["rmse"].get<double>(), .0141, .001);
  EXPECT_EQ(printed["z_test"]["passed"], true);
  EXPECT_EQ(run({"compare", a, b, "--json", file("out.json").string(), "--z-test"}), 0);
  EXPECT_EQ(nlohmann::json::parse(bytes_of_file(file("out.json"))), printed);
  EXPECT_NE(output_.find("RMSE"), std::string::npos);
}

TEST_F(CompareMerge, CompareWritesADifferencePicture)
{
  EXPECT_EQ(run({"compare", write_render("a.exr", 1), write_render("b.exr", 2), "--diff", file("d.png").string()}), 0);
  EXPECT_EQ(bytes_of_file(file("d.png")).substr(1, 3), "PNG");
}

TEST_F(CompareMerge, CompareRefusesWhatCannotBeCompared)
{
  const std::string a = write_render("a.exr", 1);
  exr_write(file("small.exr"), constant_picture(4, 4, 1, 1, 1));
  EXPECT_THROW(run({"compare", a, file("small.exr").string()}), InputError);
  EXPECT_THROW(run({"compare", a, file("missing.exr").string()}), InputError);
  EXPECT_THROW(run({"compare", a, a, "--layer", "nothing"}), InputError);
  EXPECT_THROW(run({"compare", a, a, "--layer", "samples", "--max-flip", "1"}), InputError);
  EXPECT_THROW(run({"compare", a}), CLI::ParseError);
  EXPECT_THROW(run({"compare", a, a, "--significance", "2"}), CLI::ParseError);
}

TEST_F(CompareMerge, CompareTakesAnyLayer)
{
  const std::string a = write_render("a.exr", 1);
  EXPECT_EQ(run({"compare", a, a, "--layer", "samples", "--max-rmse", "0"}), 0);
  EXPECT_EQ(output_.find("FLIP"), std::string::npos);
}

TEST_F(CompareMerge, MergeHasLessNoiseThanItsParts)
{
  std::vector<std::string> arguments = {"merge"};
  for (std::uint32_t seed = 1; seed <= 4; ++seed) {
    arguments.push_back(write_render(std::to_string(seed) + ".exr", seed));
  }
  arguments.insert(arguments.end(), {"-o", file("merged.exr").string()});
  EXPECT_EQ(run(arguments), 0);
  EXPECT_NE(output_.find("64 samples"), std::string::npos);
  const Picture merged = exr_load(file("merged.exr"));
  double square = 0;
  for (const float value : merged.find("G")->values) {
    square += std::pow(double{value} - .5, 2);
  }
  // 768 pixels: the deviation is known to 2.6 %, and 4 such errors are allowed.
  EXPECT_NEAR(std::sqrt(square / 768), .005, .005 * .11);
  EXPECT_FLOAT_EQ(merged.find("variance.R")->values[0], 2.5e-5f);
  EXPECT_EQ(run({"compare", file("merged.exr").string(), write_render("9.exr", 9), "--z-test"}), 0);
}

TEST_F(CompareMerge, MergeNeedsTwoFilesWithDifferentSeedsAndAnOutput)
{
  const std::string a = write_render("a.exr", 1), b = write_render("b.exr", 1);
  EXPECT_THROW(run({"merge", a, b, "-o", file("m.exr").string()}), InputError);
  EXPECT_FALSE(std::filesystem::exists(file("m.exr")));
  EXPECT_THROW(run({"merge", a, b}), CLI::ParseError);
  EXPECT_THROW(run({"merge", a, "-o", file("m.exr").string()}), CLI::ParseError);
}

}  // namespace relief
