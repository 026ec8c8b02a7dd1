// `relief report` and `render --report`: from a scene to the page.
#include "tests/cli/program.h"
#include "tests/support/html_check.h"

namespace relief::test {
namespace {

class Report : public ProgramTest {
 protected:
  std::string scene_ = folder_.write("s.gltf", lit_square().gltf()).string();
};

TEST_F(Report, ARenderAndItsFilesGiveTheSamePage)
{
  ASSERT_EQ(render(scene_, file("reference.exr"), {"--spp", "16", "--seed", "7"}).exit_code, 0);
  ASSERT_EQ(render(scene_, file("a.exr"),
                   {"--spp", "8", "--aov", "beauty", "--reference", file("reference.exr"), "--stats", file("a.json"),
                    "--report", file("a.html"), "--float"})
                .exit_code,
            0);
  ASSERT_EQ(run({"report", file("a.exr"), "--stats", file("a.json"), "--reference", file("reference.exr"), "-o",
                 file("b.html")})
                .exit_code,
            0);
  const std::string page = bytes_of_file(file("a.html"));
  EXPECT_EQ(html_nesting_error(page), "");
  // Two pictures of two parts each; error, variance. Nothing is displaced, and all pixels have as many samples.
  const std::vector<std::string> pictures = html_pictures(page);
  ASSERT_EQ(pictures.size(), 6u);
  EXPECT_NE(page.find("Every pixel has 8 samples."), std::string::npos);
  for (const std::string& png : pictures) EXPECT_EQ(png_size(png), (std::array<int, 2>{16, 16}));
  EXPECT_EQ(pictures, html_pictures(bytes_of_file(file("b.html"))));
  EXPECT_EQ(page, bytes_of_file(file("b.html")));
}

TEST_F(Report, ErrorsAreKeptEachTimeTheSamplesDouble)
{
  ASSERT_EQ(render(scene_, file("reference.exr"), {"--spp", "64", "--seed", "7"}).exit_code, 0);
  ASSERT_EQ(render(scene_, file("plain.exr"), {"--spp", "12"}).exit_code, 0);
  const Outcome outcome =
      render(scene_, file("a.exr"), {"--spp", "12", "--reference", file("reference.exr"), "--stats", file("a.json")});
  ASSERT_EQ(outcome.exit_code, 0);
  const nlohmann::json stats = nlohmann::json::parse(bytes_of_file(file("a.json")));
  std::vector<double> samples;
  double seconds = 0;
  for (const nlohmann::json& point : stats["errors"]) {
    samples.push_back(point["samples"]);
    EXPECT_GE(point["seconds"], seconds);
    seconds = point["seconds"];
    EXPECT_GT(point["reference_rmse"], 0);
  }
  EXPECT_EQ(samples, (std::vector<double>{2, 4, 8, 12}));
  EXPECT_EQ(stats["errors"].back()["rmse"], stats["error_rmse"]);
  EXPECT_EQ(stats["errors"].back()["reference_rmse"], outcome.events().back()["reference_rmse"]);
  EXPECT_EQ(stats["settings"]["samples"], 12);
  // Watching a picture does not change it.
  EXPECT_EQ(values_of(file("a.exr"), "R"), values_of(file("plain.exr"), "R"));
}

TEST_F(Report, BelongsToItsFrame)
{
  const Arguments more = {"--report", file("a.#.html"), "--frames", "1-2", "--resume"};
  ASSERT_EQ(render(scene_, file("a.#.exr"), more).exit_code, 0);
  EXPECT_EQ(render(scene_, file("a.#.exr"), more).count("skipped"), 2);
  std::filesystem::remove(file("a.2.html"));
  EXPECT_EQ(render(scene_, file("a.#.exr"), more).count("skipped"), 1);
  EXPECT_TRUE(exists("a.2.html"));
}

TEST_F(Report, RefusesWhatItCannotShow)
{
  ASSERT_EQ(render(scene_, file("a.exr")).exit_code, 0);
  ASSERT_EQ(render(scene_, file("small.exr"), {"--resolution", "8x8"}).exit_code, 0);
  const std::string text = folder_.write("bad.json", "[1]").string();
  const std::tuple<Arguments, int, const char*> kCases[] = {
      {{"report", file("a.exr"), "-o", file("p.html"), "--stats", text}, 3, "expected the statistics of a render"},
      {{"report", file("a.exr"), "-o", file("p.html"), "--stats", file("none.json")}, 3, "none.json: "},
      {{"report", file("a.exr"), "-o", file("p.html"), "--stats", file(".")}, 3, "is a folder"},
      {{"report", file("a.exr"), "-o", file("p.html"), "--reference", file("small.exr")}, 3, "is 8x8 pixels at 0,0"},
      {{"report", file("none.exr"), "-o", file("p.html")}, 3, "none.exr"},
      {{"report", file("a.exr"), "-o", file("p.txt")}, 2, "a name that ends in .html"},
      {{"report", file("a.exr")}, 2, "--output"},
      {{"report", file("a.exr"), "-o", file("none/p.html")}, 1, "none"},
  };
  for (const auto& [arguments, exit_code, expected] : kCases) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.errors;
    EXPECT_NE(outcome.errors.find(expected), std::string::npos) << outcome.errors;
    EXPECT_FALSE(exists("p.html"));
  }
}

}  // namespace
}  // namespace relief::test
