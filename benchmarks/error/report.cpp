#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "benchmarks/displacement/table.h"
#include "benchmarks/error/study.h"
#include "exporters/report_html.h"
#include "exporters/svg_plot.h"

namespace relief {

namespace {

std::string figure(double value) { return std::isfinite(value) ? fmt::format("{:.3g}", value) : "–"; }

/// How many times `value` is in `base`.
std::string ratio(double base, double value)
{
  return std::isfinite(base / value) ? fmt::format("×{:.2f}", base / value) : "–";
}

/// Equal times and equal error: the first way is what the others are measured by.
Table summary(const ErrorStudyResults& results, const ErrorSceneResult& scene)
{
  Table table;
  table.title = scene.scene;
  table.note = fmt::format("{} × {} pixels. ", scene.width, scene.height);
  table.note += scene.reference_samples > 0
                    ? fmt::format("Reference of {:.4g} samples a pixel, whose own RMSE is estimated as {}.",
                                  scene.reference_samples, figure(scene.reference_rmse))
                    : std::string("The reference was given.");
  for (const std::string& failure : scene.failures) table.note += " Missing: " + failure + ".";
  table.header = {"way", "preparation, s"};
  for (const double seconds : results.times) table.header.push_back(fmt::format("RMSE after {:g} s", seconds));
  const double error = common_error(scene.series);
  table.header.insert(table.header.end(), {fmt::format("error over the first's at {:g} s", results.times.back()),
                                           fmt::format("s to RMSE {}", figure(error)), "times as fast as the first"});
  for (const ErrorSeries& series : scene.series) {
    std::vector<std::string> row = {series.name, figure(series.preparation_seconds)};
    for (const double seconds : results.times) row.push_back(figure(error_at_time(series, seconds)));
    const double last = results.times.back();
    row.push_back(ratio(error_at_time(series, last), error_at_time(scene.series.front(), last)));
    const double seconds = time_to_error(series, error);
    row.push_back(figure(seconds));
    row.push_back(ratio(time_to_error(scene.series.front(), error), seconds));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table measurements(const ErrorSceneResult& scene)
{
  Table table;
  table.header = {"way", "samples a pixel", "seconds", "RMSE", "relMSE"};
  for (const ErrorSeries& series : scene.series) {
    for (const ErrorMeasurement& point : series.points) {
      table.rows.push_back(
          {series.name, figure(point.samples), figure(point.seconds), figure(point.rmse), figure(point.relmse)});
    }
  }
  return table;
}

std::string plot(const ErrorSceneResult& scene,
                 const char* label,
                 double ErrorMeasurement::*value,
                 PlotStyles& styles)
{
  std::vector<PlotSeries> lines;
  for (const ErrorSeries& series : scene.series) {
    PlotSeries line{series.name, {}, {}};
    for (const ErrorMeasurement& point : series.points) {
      line.x.push_back(point.seconds);
      line.y.push_back(point.*value);
    }
    lines.push_back(std::move(line));
  }
  return svg_line_plot({scene.scene, "seconds of sampling", label, true, true}, lines, styles);
}

}  // namespace

std::string error_study_markdown(const ErrorStudyResults& results)
{
  std::string text;
  for (const ErrorSceneResult& scene : results.scenes)
    text += markdown(summary(results, scene)) + markdown(measurements(scene));
  return text;
}

std::string error_study_json(const ErrorStudyResults& results)
{
  nlohmann::ordered_json scenes = nlohmann::ordered_json::array();
  for (const ErrorSceneResult& scene : results.scenes) {
    nlohmann::ordered_json all = nlohmann::ordered_json::array();
    const double error = common_error(scene.series);
    for (const ErrorSeries& series : scene.series) {
      nlohmann::ordered_json points = nlohmann::ordered_json::array(), at_times = nlohmann::ordered_json::array();
      for (const ErrorMeasurement& p : series.points) {
        points.push_back({{"samples", p.samples}, {"seconds", p.seconds}, {"rmse", p.rmse}, {"relmse", p.relmse}});
      }
      for (const double seconds : results.times) at_times.push_back(error_at_time(series, seconds));
      all.push_back({{"way", series.name},
                     {"preparation_seconds", series.preparation_seconds},
                     {"points", points},
                     {"rmse_at_times", at_times},
                     {"seconds_to_common_rmse", time_to_error(series, error)}});
    }
    scenes.push_back({{"scene", scene.scene},
                      {"width", scene.width},
                      {"height", scene.height},
                      {"reference_samples", scene.reference_samples},
                      {"reference_rmse", scene.reference_rmse},
                      {"common_rmse", error},
                      {"series", all},
                      {"failures", scene.failures}});
  }
  const nlohmann::ordered_json json = {{"times", results.times}, {"scenes", scenes}};
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string error_study_html(const ErrorStudyResults& results)
{
  std::vector<std::string> pieces = {html_paragraph(
      "Each way to render a scene, with four times the samples from point to point, against one reference. "
      "Errors at equal times, and times to equal error, lie on straight lines between the points of these "
      "logarithmic plots.")};
  PlotStyles styles;
  for (const ErrorSceneResult& scene : results.scenes) {
    pieces.push_back(html(summary(results, scene)));
    pieces.push_back(
        html_row({plot(scene, "RMSE", &ErrorMeasurement::rmse, styles), plot(scene, "relMSE", &ErrorMeasurement::relmse, styles)}));
    pieces.push_back("<details><summary>All renders</summary>" + html(measurements(scene)) + "</details>\n");
  }
  return html_page("Speed against error", pieces);
}

}  // namespace relief
