// The page about a frame: that it nests, has all sections and pictures, and that colours and scales mean what they say.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include <nlohmann/json.hpp>

#include "exporters/color_map.h"
#include "exporters/errors.h"
#include "exporters/report/figure_text.h"
#include "exporters/report/frame_report.h"
#include "exporters/report/value_map.h"
#include "exporters/report/warning_groups.h"
#include "exporters/shared_exponent.h"
#include "exporters/stats_json.h"
#include "tests/exporters/test_pictures.h"
#include "tests/support/html_check.h"

namespace relief {
namespace {

/// L* of sRGB codes. @source CIE 1976, IEC 61966-2-1
double lightness_of(const std::array<std::uint8_t, 3>& codes)
{
  const double weights[] = {0.2126, 0.7152, 0.0722};
  double luminance = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const double v = codes[c] / 255.0;
    luminance += weights[c] * (v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
  }
  return luminance > 0.008856 ? 116 * std::cbrt(luminance) - 16 : 903.3 * luminance;
}

TEST(ColorMap, GetsLighterEvenly)
{
  constexpr int kSteps = 16;
  const double dark = lightness_of(color_map(0)), light = lightness_of(color_map(1));
  EXPECT_LT(dark, 20);
  EXPECT_GT(light, 85);
  for (int i = 1; i <= kSteps; ++i) {
    const double step = lightness_of(color_map(i / double{kSteps})) - lightness_of(color_map((i - 1) / double{kSteps}));
    // Oklab's lightness and CIE's differ; neither may stand still or jump.
    EXPECT_GT(step, 0.5 * (light - dark) / kSteps) << i;
    EXPECT_LT(step, 1.6 * (light - dark) / kSteps) << i;
  }
  EXPECT_EQ(color_map(-3), color_map(0));
  EXPECT_EQ(color_map(7), color_map(1));
  EXPECT_EQ(color_map(std::nan("")), (std::array<std::uint8_t, 3>{128, 128, 128}));
}

TEST(SharedExponent, KeepsColorsOfEverySize)
{
  const std::vector<float> values = {0, 1e-30f, 0.001f, 0.18f, 0.5f, 1, 3.7f, 255, 65504, 1e30f};
  const float nan = std::nanf(""), infinity = HUGE_VALF;
  std::vector<float> red = values, green, blue(values.size(), 0);
  for (const float v : values) green.push_back(v / 3);
  for (std::vector<float>* plane : {&red, &green, &blue}) plane->insert(plane->end(), {nan, -infinity, -1, 0});
  const int width = static_cast<int>(red.size());
  ImageView view{width, 1, {}};
  for (const std::vector<float>* plane : {&red, &green, &blue})
    view.channels.push_back({plane->data(), 1, width, {}, ""});
  const SharedExponentImage image = shared_exponent_encode(view);
  ASSERT_EQ(image.exponents.size(), red.size());
  const auto value_at = [&](std::size_t i, std::size_t c) {
    return image.exponents[i] == 0 ? 0.0 : std::ldexp(image.mantissas[3 * i + c] + 0.5, image.exponents[i] - 136);
  };
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_NEAR(value_at(i, 0), values[i], values[i] / 256) << values[i];
    EXPECT_NEAR(value_at(i, 1), values[i] / 3.0, values[i] / 256.0) << values[i];
  }
  for (std::size_t i = values.size(); i < red.size(); ++i) EXPECT_EQ(value_at(i, 0), 0) << red[i];
}

TEST(ValueScale, TicksAreRoundAndWithin)
{
  for (const bool log : {false, true}) {
    for (const float factor : {1e-6f, 0.37f, 4096.f}) {
      std::vector<float> values;
      for (int i = 0; i <= 1000; ++i) values.push_back(factor * static_cast<float>(i));
      const ValueScale scale = value_scale_make(values, log);
      const std::vector<double> ticks = scale.ticks();
      EXPECT_GE(ticks.size(), 2u) << log << factor;
      EXPECT_LE(ticks.size(), 10u) << log << factor;
      for (std::size_t i = 1; i < ticks.size(); ++i) EXPECT_LT(scale.at(ticks[i - 1]), scale.at(ticks[i]));
      EXPECT_EQ(scale.at(2.0 * factor * 1000), 1);
      EXPECT_EQ(scale.at(-1), 0);
    }
  }
  EXPECT_NEAR((ValueScale{1, 100, true}.at(10)), 0.5, 1e-12);
  for (const std::vector<float>& odd : {std::vector<float>{}, {0, 0}, {5, 5}, {std::nanf("")}, {-2}}) {
    for (const bool log : {false, true}) {
      const ValueScale scale = value_scale_make(odd, log);
      EXPECT_LT(scale.low, scale.high);
      EXPECT_FALSE(scale.ticks().empty());
    }
  }
}

TEST(ValueMap, ReducesByMeansOfSquares)
{
  const ValueImage image{3, 2, {1, 3, 10, 5, 7, 20}};
  int factor = 0;
  const ValueImage reduced = value_image_reduced(image, 2, &factor);
  EXPECT_EQ(factor, 2);
  ASSERT_EQ(reduced.values.size(), 2u);
  EXPECT_EQ(reduced.values[0], 4);
  EXPECT_EQ(reduced.values[1], 15);
}

TEST(WarningGroups, JoinWhatDiffersInNamesAndNumbers)
{
  const std::vector<WarningGroup> groups = warning_groups(
      {"the camera 'main one' isn't used", "s.gltf: /materials/3: has no name", "s.gltf: /materials/14/x: has no name",
       "the camera 'b' isn't used", "s.gltf: /nodes/1: has no name"});
  ASSERT_EQ(groups.size(), 2u);
  EXPECT_EQ(groups[0].kind, "s.gltf: … has no name");
  EXPECT_EQ(groups[0].texts.size(), 3u);
  EXPECT_EQ(groups[1].kind, "the camera … isn't used");
  EXPECT_EQ(groups[1].texts[1], "the camera 'b' isn't used");
}

TEST(FigureText, IsWhatPeopleRead)
{
  EXPECT_EQ(figure_text(0.00123456), "0.001235");
  EXPECT_EQ(figure_text(999.96), "1000");
  EXPECT_EQ(figure_text(1234567, 3), "1,230,000");
  EXPECT_EQ(figure_text(-1234), "-1,234");
  EXPECT_EQ(figure_text(-123456, 20), "-123,456");
  EXPECT_EQ(bytes_text(1536 * 1024.0), "1.5 MiB");
  EXPECT_EQ(bytes_text(1000), "0.977 KiB");
  EXPECT_EQ(seconds_text(0.0021), "2.1 ms");
  EXPECT_EQ(seconds_text(725), "12 min 5 s");
  EXPECT_EQ(seconds_text(12000), "3 h 20 min");
}

/// A grey picture with noise and the layers that a report shows.
Picture rendered_picture(int width, int height)
{
  Picture picture = constant_picture(width, height, .5f, .25f, .125f);
  const std::size_t num_pixels = picture.channels[0].values.size();
  const auto add = [&](const char* name, float scale) {
    Channel channel{name, ChannelType::kFloat, {}};
    for (std::size_t i = 0; i < num_pixels; ++i) channel.values.push_back(scale * static_cast<float>(i % 17 + 1));
    picture.channels.push_back(std::move(channel));
  };
  for (const char* name : {"variance.R", "variance.G", "variance.B"}) add(name, 1e-4f);
  add("samples.N", 1);
  add("displacement_steps.N", 3);
  picture.file = "<frame> & \"co\".exr";
  return picture;
}

Statistics some_statistics()
{
  Statistics stats;
  stats.scene = "a<b>.gltf";
  stats.render_seconds = 3;
  stats.samples_per_pixel = 16;
  stats.errors = {{0.5, 2, 0.2, 0.04, 0.22, 0.05}, {1, 4, 0.14, 0.02, 0.15, 0.024}, {3, 16, 0.07, 0.005, 0.08, 0.006}};
  stats.stages = {{"shade_surface", 2}, {"intersect", 3}};
  stats.peak_memory_bytes = 1 << 28;
  stats.bvh_bytes = 1 << 20;
  stats.kept = {3, 2, 1, false, true, 1000, 0.25};
  stats.counters.camera_rays = 1000;
  stats.displacement.method = "chord";
  stats.settings = {{"samples", "16"}, {"exposure", "1.5"}, {"filterWidth", "1.5"}};
  stats.warnings = {"/images/1: is odd", "/images/2: is odd", "<script>alert(1)</script>"};
  return stats;
}

std::string page_of(const Picture& picture, const Picture* reference, const std::string& statistics)
{
  FrameReport report = frame_report_of(picture);
  report.statistics = statistics;
  report.statistics_file = "stats.json";
  if (reference != nullptr) report.reference = frame_report_of(*reference).beauty;
  return frame_report_html(report);
}

TEST(FrameReport, HasEverySectionAndNests)
{
  const Picture picture = rendered_picture(30, 20), reference = constant_picture(30, 20, .5f, .3f, .1f);
  const std::string html = page_of(picture, &reference, stats_json(some_statistics()));
  EXPECT_EQ(test::html_nesting_error(html), "");
  for (const char* text :
       {"<h2>Error over time</h2>", "<h2>Maps</h2>", "<h2>Where time and memory went</h2>", "<h2>Kept and rebuilt</h2>",
        "<h2>Rays</h2>", "<h2>Settings</h2>", "<h2>Warnings</h2>", "Error against the reference", "Variance, relative",
        "<h3>Samples</h3>", "<h3>Steps</h3>", "class='wipe'", "value='1.5'", "2 × … is odd", "1 / √time",
        "a&lt;b&gt;.gltf", "displaced meshes", "all that is built for rays, 3 images, 2 levels of height maps",
        "trees;"}) {
    EXPECT_NE(html.find(text), std::string::npos) << text;
  }
  for (const char* text : {"<script>alert", "http:", "https:", "<link", "src='/", "a<b>", "<frame>"}) {
    EXPECT_EQ(html.find(text), std::string::npos) << text;
  }
  // Two pictures of two parts each, four maps.
  const std::vector<std::string> pictures = test::html_pictures(html);
  ASSERT_EQ(pictures.size(), 8u);
  for (const std::string& png : pictures) EXPECT_EQ(test::png_size(png), (std::array<int, 2>{30, 20}));
}

TEST(FrameReport, MakesDoWithAPictureAlone)
{
  Picture picture = constant_picture(2100, 3, 1, 1, 1);
  picture.attributes = {{"relief:seconds", "12.5"},
                        {"relief:warnings", "one\ntwo"},
                        {"relief:command", "relief render 'x'"},
                        {"relief:error_rmse", "nan"}};
  const std::string html = page_of(picture, nullptr, "");
  EXPECT_EQ(test::html_nesting_error(html), "");
  for (const char* text : {"12.5 s", "<p>one</p>", "relief render &#39;x&#39;", "2100 × 3", "means of 2 × 2"}) {
    EXPECT_NE(html.find(text), std::string::npos) << text;
  }
  EXPECT_EQ(html.find("RMSE, estimated"), std::string::npos) << "it is not known";
  EXPECT_EQ(html.find("class='wipe'"), std::string::npos);
  EXPECT_EQ(html.find("Error over time</h2>"), std::string::npos);
  const std::vector<std::string> pictures = test::html_pictures(html);
  ASSERT_EQ(pictures.size(), 2u);
  EXPECT_EQ(test::png_size(pictures[0]), (std::array<int, 2>{1050, 2}));
}

TEST(FrameReport, NumbersForProgramsHaveNoCommasAndSeedsAllOfTheirDigits)
{
  Picture picture = constant_picture(1200, 1, 1, 1, 1);
  picture.attributes = {{"relief:seed", "18446744073709551615"}};
  EXPECT_NE(page_of(picture, nullptr, "").find(">18446744073709551615</td>"), std::string::npos);
  Statistics stats = some_statistics();
  stats.seed = 9007199254740993;
  const std::string html = page_of(picture, nullptr, stats_json(stats));
  EXPECT_NE(html.find(">9007199254740993</td>"), std::string::npos);
  EXPECT_NE(html.find("--aspect:1200;"), std::string::npos) << "1,200 is none for a style sheet";
}

TEST(FrameReport, RefusesWhatIsNoStatistics)
{
  const Picture picture = constant_picture(4, 4, 1, 1, 1);
  for (const char* text : {"{", "[]", "{}", "{\"render_seconds\": \"3\"}", "\xff"}) {
    EXPECT_THROW(page_of(picture, nullptr, text), InputError) << text;
  }
  // As deep as a text can be, and not as a stack.
  const std::string deep =
      R"({"render_seconds": 1, "settings": {"a": )" + std::string(300'000, '[') + std::string(300'000, ']') + "}}";
  EXPECT_THROW(page_of(picture, nullptr, deep), InputError);
  // What is of another type than it should be is not known.
  const std::string html = page_of(picture, nullptr,
                                   R"({"render_seconds": 1, "errors": [3, {"seconds": "x"}], "kept": 7, "settings": [],
                                       "stage_seconds": {"a": null}, "warnings": [1], "rays": "many", "scene": {}})");
  EXPECT_EQ(test::html_nesting_error(html), "");
  Picture grey = picture;
  grey.channels.resize(1);
  EXPECT_THROW(frame_report_of(grey), InputError);
}

}  // namespace
}  // namespace relief
