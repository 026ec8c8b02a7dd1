// Three ways to estimate direct light that share little but the integrand: sampling lights, sampling the BSDF, and both
// with multiple importance sampling. On every example they must agree within their noise. What only one technique can find
// is always left to it: suns, points and spots to light sampling, smooth glass and mirrors to BSDF sampling.
//
// Where a technique is poor its noise has heavy tails, and few runs mostly lie a little low: in the glass example's
// block at 40,32 light sampling is 0.3 % (two standard errors) below the others at 24 × 8192 samples a pixel and within
// its error of 0.1 % at 24 × 32768.
#include <array>
#include <filesystem>

#include "scene/load.h"
#include "tests/image/render_runs.h"

namespace relief::test {

namespace {

struct Example {
  const char* name;
  int width, height;
  int samples;  ///< a pixel and run
};

/// For GoogleTest's messages, which would print the bytes.
void PrintTo(const Example& example, std::ostream* out) { *out << example.name; }

constexpr std::array kExamples = {
    Example{"cornell", 48, 48, 256},  Example{"spheres", 64, 36, 256},  Example{"glass", 64, 36, 256},
    Example{"product", 64, 36, 256},  Example{"instances", 64, 36, 64}, Example{"many_lights", 64, 36, 64},
    Example{"displaced", 64, 36, 64},
};

constexpr int kNumRuns = 16;
constexpr double kSignificance = 0.001;  // of one pair

// A BSDF sample finds a small lamp by luck alone, a light sample a sharp highlight: a pixel that was never lucky in sixteen
// runs looks certain. In the Cornell box that is one pixel in fifty; blocks and the mean carry the test.
constexpr double kAllowedOutliers = 0.05;

class EstimatorAgreement : public testing::TestWithParam<Example> {};

TEST_P(EstimatorAgreement, TechniquesAgreePairwise)
{
  const Example& example = GetParam();
  const std::string name = example.name;
  const Scene scene = scene_load(std::filesystem::path(RELIEF_SOURCE_DIR) / "examples" / name / (name + ".gltf"));
  constexpr std::array kTechniques = {LightTechnique::kMis, LightTechnique::kLightSampling,
                                      LightTechnique::kBsdfSampling};
  constexpr std::array kNames = {"mis", "light", "bsdf"};
  std::array<Picture, 3> pictures;
  for (std::size_t i = 0; i < kTechniques.size(); ++i) {
    RunOptions run;
    run.width = example.width;
    run.height = example.height;
    run.samples = example.samples;
    run.num_runs = kNumRuns;
    run.technique = kTechniques[i];
    run.first_seed = 100 * (i + 1);  // independent of one another
    pictures[i] = render_runs(scene, run);
  }
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    for (std::size_t k = i + 1; k < pictures.size(); ++k) {
      const ZTestResult result =
          z_test_pictures(pictures[i], pictures[k], example.samples * kNumRuns, kSignificance, kAllowedOutliers);
      const std::string text = std::string(kNames[i]) + " and " + kNames[k] + ": " + z_text(result);
      EXPECT_TRUE(result.passed) << text;
      std::printf("%s: %s\n", example.name, text.c_str());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Examples, EstimatorAgreement, testing::ValuesIn(kExamples), [](const auto& test) {
  return std::string(test.param.name);
});

}  // namespace

}  // namespace relief::test
