#include "exporters/report/frame_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "exporters/errors.h"
#include "exporters/report/figure_text.h"
#include "exporters/report/picture_viewer.h"
#include "exporters/report/render_facts.h"
#include "exporters/report/sections.h"
#include "exporters/report/value_map.h"
#include "exporters/report_html.h"
#include "scene/diagnostics.h"

namespace relief {

namespace {

bool has_colors(const ImageView& view) { return view.channels.size() >= 3; }

/// A number for each pixel, the mean of what `value` makes of its three channels.
template <class Value>
ValueImage color_mean(const ImageView& view, Value value)
{
  ValueImage mean{view.width, view.height, {}};
  mean.values.reserve(static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height));
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      float sum = 0;
      for (std::size_t c = 0; c < 3; ++c) sum += value(c, x, y);
      mean.values.push_back(sum / 3);
    }
  }
  return mean;
}

std::string maps_html(const FrameReport& report)
{
  const auto at = [](const ImageView& view, std::size_t c, int x, int y) { return view.channels[c].at(x, y); };
  std::string maps, notes;
  if (has_colors(report.reference)) {
    const ValueImage error = color_mean(report.beauty, [&](std::size_t c, int x, int y) {
      return std::abs(at(report.beauty, c, x, y) - at(report.reference, c, x, y));
    });
    maps += html_value_map("Error against the reference", "|a − b|, mean of the channels.", error, true, "radiance");
  }
  if (has_colors(report.variance)) {
    if (!has_colors(report.reference)) {
      const ValueImage error = color_mean(
          report.variance, [&](std::size_t c, int x, int y) { return std::sqrt(at(report.variance, c, x, y)); });
      maps += html_value_map("Error, estimated", "Standard error, mean of the channels.", error, true, "radiance");
    }
    const ValueImage relative = color_mean(report.variance, [&](std::size_t c, int x, int y) {
      const float radiance = at(report.beauty, c, x, y);
      return at(report.variance, c, x, y) / (radiance * radiance + 0.01f);
    });
    maps +=
        html_value_map("Variance, relative",
                       "Estimated variance / (radiance² + 0.01), mean of the channels; its mean over pixels is relMSE.",
                       relative, true, "share of the squared radiance");
  }
  if (!report.samples.channels.empty()) {
    const ValueImage samples = value_image_of(report.samples, 0);
    const auto [least, most] = std::minmax_element(samples.values.begin(), samples.values.end());
    if (*least < *most) {
      maps += html_value_map("Samples", "Taken in each pixel.", samples, false, "samples");
    } else {
      notes += html_paragraph("Every pixel has " + figure_text(*most) + (*most == 1 ? " sample." : " samples."));
    }
  }
  if (!report.steps.channels.empty()) {
    const ValueImage steps = value_image_of(report.steps, 0);
    const bool has_steps = std::any_of(steps.values.begin(), steps.values.end(), [](float n) { return n > 0; });
    if (has_steps) {
      maps += html_value_map("Steps", "Bounds and texels of displaced meshes tested for a camera ray; darkest: none.",
                             steps, true, "steps a ray");
    }
  }
  return maps.empty() ? maps : html_heading("Maps", 2) + "<div class='maps'>" + maps + "</div>\n" + notes;
}

}  // namespace

FrameReport frame_report_of(const Picture& picture)
{
  FrameReport report;
  report.name = picture.file;
  report.beauty = picture_layer(picture, "");
  if (!has_colors(report.beauty)) throw InputError(picture.file, "expected red, green and blue, found other channels");
  const auto layer = [&](Aov aov) { return picture_layer(picture, kAovInfo[static_cast<std::size_t>(aov)].name); };
  report.variance = layer(Aov::kVariance);
  report.samples = layer(Aov::kSampleCount);
  report.steps = layer(Aov::kDisplacementSteps);
  report.crop_x = picture.crop_x;
  report.crop_y = picture.crop_y;
  report.attributes = picture.attributes;
  return report;
}

std::string frame_report_html(const FrameReport& report)
{
  const RenderFacts facts(report.attributes, report.statistics, report.statistics_file);
  ViewerOptions options{report.crop_x, report.crop_y, facts.number("/settings/exposure").value_or(0)};
  const ViewedPicture reference{report.reference, "reference"};
  std::vector<std::string> pieces = {key_figures_html(facts, report.beauty.width, report.beauty.height),
                                     html_picture_viewer({report.beauty, "this render"}, reference, options)};
  pieces.push_back(errors_html(facts));
  pieces.push_back(maps_html(report));
  if (facts.has_statistics()) {
    pieces.insert(pieces.end(), {costs_html(facts), kept_html(facts), work_html(facts)});
  } else {
    pieces.push_back(html_paragraph(
        "Error over time, time, memory and rays are in a render's statistics (render --stats, report --stats)."));
  }
  pieces.insert(pieces.end(), {settings_html(facts), warnings_html(facts)});
  return html_page(printable_text(report.name), pieces);
}

}  // namespace relief
