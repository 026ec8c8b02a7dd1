// `relief bench error`: what lies between measurements, and the way from scenes to the page. Times are not looked at.
#include <cmath>

#include "benchmarks/error/series.h"
#include "tests/cli/program.h"
#include "tests/support/html_check.h"

namespace relief::test {
namespace {

TEST(ErrorSeries, IsAPowerLawBetweenItsPoints)
{
  // Independent samples: error · √time is 0.2.
  const ErrorSeries series{"a", 0, {{1, 1, 0.2, 0}, {4, 4, 0.1, 0}, {16, 16, 0.05, 0}}};
  EXPECT_NEAR(error_at_time(series, 9), 0.2 / 3, 1e-12);
  EXPECT_NEAR(time_to_error(series, 0.2 / 3), 9, 1e-12);
  EXPECT_EQ(error_at_time(series, 16), 0.05);
  EXPECT_EQ(error_at_time(series, 1), 0.2);
  for (const double beyond : {0.5, 17.0}) EXPECT_TRUE(std::isnan(error_at_time(series, beyond))) << beyond;
  for (const double beyond : {0.3, 0.04}) EXPECT_TRUE(std::isnan(time_to_error(series, beyond))) << beyond;
  // Where more samples made it worse, the first time counts.
  const ErrorSeries bumpy{"b", 0, {{1, 1, 0.2, 0}, {4, 4, 0.1, 0}, {16, 16, 0.15, 0}, {64, 64, 0.08, 0}}};
  EXPECT_EQ(time_to_error(bumpy, 0.1), 4);
  EXPECT_EQ(common_error({series, bumpy}), 0.08);
  EXPECT_TRUE(std::isnan(common_error({})));
  EXPECT_TRUE(std::isnan(error_at_time({}, 1)));
}

class BenchError : public ProgramTest {};

TEST_F(BenchError, RendersEveryWayThatDiffers)
{
  const std::string scene = folder_.write("s.gltf", mirrored_lamp().gltf()).string();
  const Outcome outcome = run({"bench", "error", scene, "--quick", "--lights", "mis,lights", "--threads", "2", "--json",
                               file("e.json"), "--html", file("e.html")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json json = nlohmann::json::parse(bytes_of_file(file("e.json")));
  ASSERT_EQ(json["scenes"].size(), 1u);
  std::vector<std::string> ways;
  for (const nlohmann::json& series : json["scenes"][0]["series"]) {
    ways.push_back(series["way"]);
    ASSERT_GE(series["points"].size(), 3u);
    EXPECT_EQ(series["points"][0]["samples"], 1);
    EXPECT_EQ(series["points"][1]["samples"], 4);
    EXPECT_GT(series["points"][0]["rmse"], series["points"].back()["rmse"]) << ways.back();
  }
  // Nothing is displaced; the mirror casts.
  EXPECT_EQ(ways, (std::vector<std::string>{"caustics on, mis", "caustics on, lights", "caustics off, mis",
                                            "caustics off, lights"}));
  EXPECT_NE(outcome.output.find("| caustics on, mis |"), std::string::npos) << outcome.output;
  const std::string html = bytes_of_file(file("e.html"));
  EXPECT_EQ(html_nesting_error(html), "");
  EXPECT_NE(html.find("<svg"), std::string::npos);
}

TEST_F(BenchError, AnotherRendererStandsBeside)
{
  const std::string scene = folder_.write("s.gltf", lit_square().gltf()).string();
  // Its picture is the reference itself, so that its error is 0; and it is called with what it needs.
  ASSERT_EQ(render(scene, file("r.exr"), {"--filter", "box", "--float", "--resolution", "16x16"}).exit_code, 0);
  const std::string other =
      folder_
          .write("other.sh",
                 "test \"$3 $5 $6 $7 $8\" = '--spp --seed 1 --resolution 16x16' || exit 1\n"
                 "cp '" +
                     file("r.exr") +
                     "' \"$2\"\n"
                     "echo '{\"runs\": [{\"render_seconds\": 5, \"preparation_seconds\": 0.5}]}'\n")
          .string();
  const Arguments common = {"bench",       "error",       scene,    "--quick",      "--resolution", "16x16",
                            "--reference", file("r.exr"), "--json", file("e.json"), "--beside"};
  Arguments arguments = common;
  arguments.push_back("Other=sh '" + other + "'");
  const Outcome outcome = run(arguments);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const nlohmann::json series = nlohmann::json::parse(bytes_of_file(file("e.json")))["scenes"][0]["series"];
  ASSERT_EQ(series.size(), 2u);
  EXPECT_EQ(series[0]["way"], "relief");
  EXPECT_EQ(series[1]["way"], "Other");
  EXPECT_EQ(series[1]["preparation_seconds"], 0.5);
  EXPECT_EQ(series[1]["points"], nlohmann::json::parse(R"([{"samples": 1, "seconds": 5, "rmse": 0, "relmse": 0},
                                       {"samples": 4, "seconds": 5, "rmse": 0, "relmse": 0},
                                       {"samples": 16, "seconds": 5, "rmse": 0, "relmse": 0}])"));

  std::filesystem::remove(file("e.json"));
  for (const auto& [beside, code, expected] : {std::tuple{"Other", 2, "expected NAME=COMMAND"},
                                               {"Other=false", 1, "failed"},
                                               {"Other=echo", 1, "expected JSON"}}) {
    arguments = common;
    arguments.push_back(beside);
    const Outcome failed = run(arguments);
    EXPECT_EQ(failed.exit_code, code) << failed.errors;
    EXPECT_NE(failed.errors.find(expected), std::string::npos) << failed.errors;
    // What was measured is kept.
    EXPECT_EQ(exists("e.json"), code == 1);
    std::filesystem::remove(file("e.json"));
  }
}

TEST_F(BenchError, RefusesAReferenceThatDoesNotFit)
{
  const std::string scene = folder_.write("s.gltf", lit_square().gltf()).string();
  ASSERT_EQ(render(scene, file("r.exr")).exit_code, 0);
  EXPECT_EQ(run({"bench", "error", scene, "--quick", "--reference", file("r.exr")}).exit_code, 3);
  const Outcome two = run({"bench", "error", scene, scene, "--quick", "--reference", file("r.exr")});
  EXPECT_EQ(two.exit_code, 2);
  EXPECT_NE(two.errors.find("expected one scene, found 2"), std::string::npos) << two.errors;
}

}  // namespace
}  // namespace relief::test
