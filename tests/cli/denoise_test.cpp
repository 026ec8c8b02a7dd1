// `--denoise` and `relief denoise`, from a scene to its files.
#include <cmath>

#include "tests/cli/program.h"

namespace relief::test {
namespace {

constexpr const char* kLayers =
    "beauty,samples,variance,half,denoising_albedo,denoising_normal,denoising_depth,denoising_half";

class DenoiseProgram : public ProgramTest {
 protected:
  /// A scene with noise: a wall lit by what is around it and by the floor.
  std::string scene() const { return folder_.write("scene.gltf", lit_square().gltf()).string(); }

  double rmse(const std::string& exr, const std::string& channel, const std::string& reference) const
  {
    const std::vector<float> a = values_of(exr, channel.c_str()), b = values_of(reference, "G");
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const double off = static_cast<double>(a[i]) - static_cast<double>(b[i]);
      sum += off * off;
    }
    return std::sqrt(sum / static_cast<double>(a.size()));
  }
};

TEST_F(DenoiseProgram, ARenderKeepsWhatWasRenderedAndHasItDenoisedBeside)
{
  const Arguments size = {"--resolution", "48x48", "--float"};
  const auto with = [&](Arguments more) {
    more.insert(more.end(), size.begin(), size.end());
    return more;
  };
  ASSERT_EQ(render(scene(), file("plain.exr"), with({"--png", file("plain.png")})).exit_code, 0);
  const Outcome outcome = render(
      scene(), file("a.exr"), with({"--denoise", "builtin", "--png", file("a.png"), "--reference", file("plain.exr")}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const Picture plain = exr_load(file("plain.exr")), denoised = exr_load(file("a.exr"));
  for (const Channel& channel : plain.channels) {
    ASSERT_NE(denoised.find(channel.name), nullptr) << channel.name;
    EXPECT_EQ(denoised.find(channel.name)->values, channel.values) << channel.name;
  }
  EXPECT_EQ(denoised.channels.size(), plain.channels.size() + 6) << "what only the denoiser wanted is not written";
  EXPECT_EQ(denoised.attributes.at("relief:denoiser"), "builtin");
  EXPECT_NE(bytes_of_file(file("a.png")), bytes_of_file(file("plain.png")));
  const nlohmann::json done = outcome.events().back();
  EXPECT_EQ(done["event"], "done");
  EXPECT_GT(done["denoised_rmse"], 0.0);
  EXPECT_EQ(done["reference_rmse"], 0.0);
  EXPECT_GT(done["denoised_reference_rmse"], 0.0);
}

TEST_F(DenoiseProgram, LessNoiseThanBefore)
{
  const Arguments size = {"--resolution", "48x48", "--float"};
  ASSERT_EQ(
      render(scene(), file("r.exr"), {"--resolution", "48x48", "--float", "--spp", "1024", "--seed", "3"}).exit_code,
      0);
  ASSERT_EQ(render(scene(), file("a.exr"), {"--resolution", "48x48", "--float", "--denoise", "builtin"}).exit_code, 0);
  EXPECT_LT(rmse(file("a.exr"), "denoised.G", file("r.exr")), rmse(file("a.exr"), "G", file("r.exr")));
}

TEST_F(DenoiseProgram, AFileOfBeforeIsDenoisedToTheSame)
{
  ASSERT_EQ(render(scene(), file("a.exr"), {"--float", "--denoise", "builtin", "--aov", kLayers}).exit_code, 0);
  ASSERT_EQ(render(scene(), file("b.exr"), {"--float", "--aov", kLayers}).exit_code, 0);
  const Outcome outcome = run({"denoise", file("b.exr"), "-o", file("c.exr"), "--png", file("c.png")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  for (const char* channel : {"denoised.R", "denoised.B", "denoised_error.G", "R", "half.B", "denoising_half.D"}) {
    EXPECT_EQ(values_of(file("c.exr"), channel), values_of(file("a.exr"), channel)) << channel;
  }
  EXPECT_TRUE(exists("c.png"));
  // Once more: the older layers are replaced.
  ASSERT_EQ(run({"denoise", file("c.exr"), "-o", file("d.exr")}).exit_code, 0);
  EXPECT_EQ(values_of(file("d.exr"), "denoised.G"), values_of(file("c.exr"), "denoised.G"));
  EXPECT_EQ(exr_load(file("d.exr")).channels.size(), exr_load(file("c.exr")).channels.size());
}

TEST_F(DenoiseProgram, AFileWithoutTheLayersIsAnErrorThatNamesThem)
{
  ASSERT_EQ(render(scene(), file("a.exr"), {"--aov", "beauty,samples,half"}).exit_code, 0);
  const Outcome outcome = run({"denoise", file("a.exr"), "-o", file("b.exr")});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_NE(outcome.errors.find("it lacks variance, denoising_albedo, denoising_normal, denoising_depth"),
            std::string::npos)
      << outcome.errors;
  EXPECT_FALSE(exists("b.exr"));
}

TEST_F(DenoiseProgram, OneSampleAPixelIsAWarning)
{
  const Outcome outcome = render(scene(), file("a.exr"), {"--spp", "1", "--denoise", "builtin"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_NE(outcome.errors.find("less than two samples"), std::string::npos) << outcome.errors;
  EXPECT_EQ(exr_load(file("a.exr")).attributes.count("relief:denoised_rmse"), 0u);
}

// Before anything is rendered.
TEST_F(DenoiseProgram, WithoutOpenImageDenoiseTheErrorSaysWhatWasLookedFor)
{
  const Outcome outcome = render(scene(), file("a.exr"), {"--denoise", "oidn"});
  if (outcome.exit_code == 0) GTEST_SKIP() << "this machine has it";
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.errors.find("libOpenImageDenoise.so.2, libOpenImageDenoise.so.1"), std::string::npos)
      << outcome.errors;
  EXPECT_FALSE(exists("a.exr"));
}

}  // namespace
}  // namespace relief::test
