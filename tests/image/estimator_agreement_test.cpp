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

class EstimatorAgreement : public testing::TestWithParam<Example> {};

TEST_P(EstimatorAgreement, TechniquesAgreePairwise)
{
  const Example& example = GetParam();
  const std::string name = example.name;
  const Scene scene = scene_load(std::filesystem::path(RELIEF_SOURCE_DIR) / "examples" / name / (name + ".gltf"));
  RunOptions run;
  run.width = example.width;
  run.height = example.height;
  run.samples = example.samples;
  expect_techniques_agree(scene, run, example.name);
}

INSTANTIATE_TEST_SUITE_P(Examples, EstimatorAgreement, testing::ValuesIn(kExamples), [](const auto& test) {
  return std::string(test.param.name);
});

}  // namespace

}  // namespace relief::test
