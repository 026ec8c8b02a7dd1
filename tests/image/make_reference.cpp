// Makes a reference picture by a long run of one light technique; scripts/update_references calls it.
//
//   relief_make_reference SCENE WIDTHxHEIGHT SAMPLES RUNS mis|light|bsdf OUTPUT.exr ORIGIN
#include <cstdio>
#include <exception>

#include "exporters/exr.h"
#include "scene/load.h"
#include "tests/image/render_runs.h"

namespace {

/// Seeds of references lie far from those of the tests: a picture compared with itself would always agree.
constexpr std::uint64_t kFirstSeed = 1'000'000;

int make_reference(char** arguments)
{
  using namespace relief;
  test::RunOptions run;
  if (std::sscanf(arguments[2], "%dx%d", &run.width, &run.height) != 2) return 2;
  run.samples = std::atoi(arguments[3]);
  run.num_runs = std::atoi(arguments[4]);
  const std::string technique = arguments[5];
  run.technique = technique == "bsdf"    ? LightTechnique::kBsdfSampling
                  : technique == "light" ? LightTechnique::kLightSampling
                                         : LightTechnique::kMis;
  run.first_seed = kFirstSeed;
  Picture picture = test::render_runs(scene_load(arguments[1]), run);
  picture.attributes["relief:origin"] = arguments[7];
  exr_write(arguments[6], picture);
  return 0;
}

}  // namespace

int main(int argc, char** argv)
{
  if (argc != 8) {
    std::fputs("usage: relief_make_reference SCENE WIDTHxHEIGHT SAMPLES RUNS mis|light|bsdf OUTPUT.exr ORIGIN\n",
               stderr);
    return 2;
  }
  try {
    return make_reference(argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "relief_make_reference: %s\n", error.what());
    return 1;
  }
}
