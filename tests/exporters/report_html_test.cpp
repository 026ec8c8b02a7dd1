#include <gtest/gtest.h>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "exporters/png_encode.h"
#include "exporters/report_html.h"
#include "exporters/svg_plot.h"

namespace relief {
namespace {

/// The vectors of RFC 4648, section 10.
TEST(ReportHtml, Base64IsThatOfTheRfc)
{
  const std::vector<std::pair<std::string, std::string>> vectors = {{"", ""},
                                                                    {"f", "Zg=="},
                                                                    {"fo", "Zm8="},
                                                                    {"foo", "Zm9v"},
                                                                    {"foob", "Zm9vYg=="},
                                                                    {"fooba", "Zm9vYmE="},
                                                                    {"foobar", "Zm9vYmFy"},
                                                                    {"\xff\xfe", "//4="}};
  for (const auto& [bytes, text] : vectors) EXPECT_EQ(base64_encode(bytes), text);
}

TEST(ReportHtml, PicturesComeBackAsTheyWere)
{
  const std::vector<std::uint8_t> rgb = {255, 0, 0, 0, 255, 0, 0, 0, 255, 10, 20, 30, 40, 50, 60, 70, 80, 90};
  std::string png = png_encode(3, 2, rgb);
  OIIO::Filesystem::IOMemReader reader(png.data(), png.size());
  const auto in = OIIO::ImageInput::open("picture.png", nullptr, &reader);
  ASSERT_TRUE(in);
  std::vector<std::uint8_t> back(rgb.size());
  ASSERT_EQ(in->spec().width, 3);
  ASSERT_EQ(in->spec().nchannels, 3);
  ASSERT_TRUE(in->read_image(0, 0, 0, 3, OIIO::TypeDesc::UINT8, back.data()));
  EXPECT_EQ(back, rgb);
}

TEST(ReportHtml, TextCannotBecomeMarkup)
{
  EXPECT_EQ(html_escape("<a href='x'>&\"</a>"), "&lt;a href=&#39;x&#39;&gt;&amp;&quot;&lt;/a&gt;");
  const std::string page = html_page("<b>", {html_paragraph("1 < 2"), html_table({"<h>"}, {{"<c>"}})});
  for (const char* markup : {"<b>", "1 < 2", "<h>", "<c>"}) EXPECT_EQ(page.find(markup), std::string::npos) << markup;
}

TEST(ReportHtml, NothingIsLoadedFromElsewhere)
{
  const std::vector<std::uint8_t> rgb(12, 0);
  PlotStyles styles;
  const std::string page = html_page(
      "t", {html_picture(2, 2, rgb, "c", 1), svg_line_plot({"p", "x", "y", true, true}, {{"s", {1, 10}, {2, 3}}}, styles)});
  for (const char* reference : {"http:", "https:", "<script", "url(", "<link"}) {
    EXPECT_EQ(page.find(reference), std::string::npos) << reference;
  }
}

int count(const std::string& text, const std::string& what)
{
  int found = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++found;
  return found;
}

TEST(ReportHtml, PlotsShowWhatCanBeShown)
{
  const double nan = std::nan("");
  PlotStyles styles;
  const std::string lines =
      svg_line_plot({"p", "x", "y", true, true},
                    {{"a", {1, 2, 4}, {1, nan, 3}}, {"b", {0, 2}, {1, -1}}, {"none", {}, {}}}, styles);
  // One of the legend, two points.
  EXPECT_EQ(count(lines, "<circle"), 3);
  EXPECT_EQ(count(lines, "nan"), 0);
  EXPECT_EQ(count(lines, "inf"), 0);
  const std::string bars =
      svg_bar_plot({"p", "", "y", false, true}, {"one", "two"}, {{"a", {}, {5, nan}}, {"b", {}, {7}}}, styles);
  EXPECT_EQ(count(bars, "<rect"), 2);
  EXPECT_EQ(count(svg_bar_plot({}, {}, {}, styles), "nan"), 0);
  EXPECT_EQ(count(svg_line_plot({}, {}, styles), "nan"), 0);
}

TEST(ReportHtml, ASeriesLooksTheSameInAllPlotsAndLikeNoOther)
{
  PlotStyles styles;
  std::set<std::pair<std::string, int>> all;
  std::set<std::string> colors;
  for (int i = 0; i < 64; ++i) {
    const PlotStyles::Style style = styles.of("method " + std::to_string(i));
    all.emplace(style.color, style.mark);
    if (i < 16) colors.insert(style.color);
  }
  EXPECT_EQ(all.size(), 64u);
  EXPECT_EQ(colors.size(), 16u);
  EXPECT_EQ(styles.of("method 7 (0.3 M)").color, styles.of("method 7").color);
  // Whatever stands before it in a plot.
  const std::string color = "stroke='" + styles.of("method 9").color + "'";
  for (const std::vector<PlotSeries>& series :
       {std::vector<PlotSeries>{{"method 9", {1, 2}, {1, 2}}},
        std::vector<PlotSeries>{{"method 3", {1, 2}, {1, 2}}, {"method 9", {1, 2}, {1, 2}}}}) {
    EXPECT_EQ(count(svg_line_plot({"p", "x", "y"}, series, styles), color), 1);
  }
}

TEST(ReportHtml, PlotsStandByThemselvesAsFiles)
{
  PlotStyles styles;
  const std::string page = html_page(
      "t", {svg_line_plot({"Speed & memory: \u00bd", "x", "y"}, {{"a", {1, 2}, {2, 3}}, {"b", {1, 2}, {3, 3}}}, styles),
            html_paragraph("between"), svg_bar_plot({"bounce rays", "", "Mrays/s"}, {"s"}, {{"b", {}, {2}}}, styles)});
  const std::vector<PlotFile> files = plot_files(page);
  ASSERT_EQ(files.size(), 2u);
  EXPECT_EQ(files[0].name, "01-speed-amp-memory");
  EXPECT_EQ(files[1].name, "02-bounce-rays");
  for (const PlotFile& file : files) {
    EXPECT_EQ(file.svg.rfind("<svg xmlns='http://www.w3.org/2000/svg' width='", 0), 0u);
    EXPECT_EQ(file.svg.find("var("), std::string::npos) << "a page's colours";
    EXPECT_EQ(file.svg.find("<svg", 1), std::string::npos);
    EXPECT_EQ(file.svg.find("between"), std::string::npos);
    EXPECT_NE(file.svg.find(styles.of("b").color), std::string::npos);
    EXPECT_EQ(file.svg.substr(file.svg.size() - 7), "</svg>\n");
  }
  EXPECT_TRUE(plot_files(html_page("t", {html_paragraph("<svg width='1'>")})).empty());
}

TEST(ReportHtml, NumbersAreAlignedAndShortRowsFilled)
{
  const std::string table = html_table({"a", "b", "c"}, {{"text", "-1.5"}, {"×3", ".5", "–"}});
  EXPECT_EQ(count(table, "<td class='n'>"), 3);
  EXPECT_EQ(count(table, "<td"), 6);
}

}  // namespace
}  // namespace relief
