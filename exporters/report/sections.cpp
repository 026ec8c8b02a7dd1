#include "exporters/report/sections.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "exporters/report/figure_text.h"
#include "exporters/report/warning_groups.h"
#include "exporters/report_html.h"
#include "exporters/svg_plot.h"
#include "scene/diagnostics.h"
#include "scene/setting_values.h"

namespace relief {

namespace {

using Json = nlohmann::ordered_json;

/// A bar with its name, and what it stands for in words.
struct Bar {
  std::string name;
  double value = 0;
  std::string amount;
};

std::string bars_html(const std::vector<Bar>& bars)
{
  double largest = 0;
  for (const Bar& bar : bars) largest = std::max(largest, bar.value);
  std::string html = "<div class='bars'>\n";
  for (const Bar& bar : bars) {
    const double percent = largest > 0 ? 100 * bar.value / largest : 0;
    html += "<span>" + html_escape(bar.name) + "</span><div class='bar'><div style='width:" + figure_text(percent, 3) +
            "%'></div></div><span class='amount'>" + html_escape(bar.amount) + "</span>\n";
  }
  return html + "</div>\n";
}

std::string share_text(double part, double whole)
{
  return whole > 0 ? " · " + figure_text(100 * part / whole, 3) + " %" : std::string();
}

/// Those that are there, the largest first.
void sort_bars(std::vector<Bar>& bars)
{
  std::erase_if(bars, [](const Bar& bar) { return !(bar.value > 0); });
  std::stable_sort(bars.begin(), bars.end(), [](const Bar& a, const Bar& b) { return a.value > b.value; });
}

/// A name of the statistics as words.
std::string words_of(std::string name)
{
  std::replace(name.begin(), name.end(), '_', ' ');
  return printable_text(name);
}

void add_row(std::vector<std::vector<std::string>>& rows, const char* name, std::optional<double> value)
{
  if (value) rows.push_back({name, figure_text(*value)});
}

/// Points of the history at which a figure is known.
PlotSeries series_of(const std::string& name, const Json& errors, const char* key)
{
  PlotSeries series;
  series.name = name;
  for (const Json& point : errors) {
    if (!point.is_object() || !point.contains("seconds") || !point["seconds"].is_number() || !point.contains(key) ||
        !point[key].is_number()) {
      continue;
    }
    series.x.push_back(point["seconds"].get<double>());
    series.y.push_back(point[key].get<double>());
  }
  return series;
}

/// A line through the end of a series along which an error falls by the given power of time.
PlotSeries slope_of(const PlotSeries& series, const std::string& name, double power)
{
  PlotSeries line{name, {}, {}, true};
  for (const double x : {series.x.front(), series.x.back()}) {
    line.x.push_back(x);
    line.y.push_back(series.y.back() * std::pow(x / series.x.back(), power));
  }
  return line;
}

std::string error_plot(const Json& errors,
                       const PlotAxes& axes,
                       const std::string& key,
                       const char* slope,
                       double power)
{
  std::vector<PlotSeries> series;
  for (const auto& [name, prefix] : {std::pair{"estimated", ""}, {"against reference", "reference_"}}) {
    PlotSeries one = series_of(name, errors, (prefix + key).c_str());
    if (!one.x.empty()) series.push_back(std::move(one));
  }
  if (series.empty()) return {};
  series.push_back(slope_of(series.back(), slope, power));
  PlotStyles styles;
  return svg_line_plot(axes, series, styles);
}

std::string cell_of(const Json& point, const char* key)
{
  return point.is_object() && point.contains(key) && point[key].is_number() ? figure_text(point[key].get<double>())
                                                                            : "";
}

}  // namespace

std::string key_figures_html(const RenderFacts& facts, int width, int height)
{
  std::string html = "<div class='cards'>\n";
  const auto add = [&](const std::string& figure, const std::string& name) {
    html += "<div class='card'><b>" + html_escape(figure) + "</b><span>" + html_escape(name) + "</span></div>\n";
  };
  add(std::to_string(width) + " × " + std::to_string(height), "pixels");
  if (const auto n = facts.number("/samples_per_pixel", "relief:samples")) add(figure_text(*n), "samples a pixel");
  if (const auto s = facts.number("/render_seconds", "relief:seconds")) add(seconds_text(*s), "sampling");
  if (const auto e = facts.number("/error_rmse", "relief:error_rmse")) add(figure_text(*e, 3), "RMSE, estimated");
  if (const auto e = facts.number("/error_relmse", "relief:error_relmse")) add(figure_text(*e, 3), "relMSE, estimated");
  if (const auto r = facts.number("/rays_per_second")) add(figure_text(*r * 1e-6, 3) + " M", "rays a second");
  if (const auto m = facts.number("/peak_memory_bytes")) add(bytes_text(*m), "memory at most");
  if (const std::size_t n = facts.warnings().size(); n > 0) add(std::to_string(n), n == 1 ? "warning" : "warnings");
  return html + "</div>\n";
}

std::string errors_html(const RenderFacts& facts)
{
  const Json& errors = facts.value("/errors");
  if (!errors.is_array() || errors.empty()) return {};
  const std::string rmse =
      error_plot(errors, {"RMSE", "seconds of sampling", "RMSE", true, true}, "rmse", "∝ 1 / √time", -0.5);
  const std::string relmse =
      error_plot(errors, {"relMSE: (a − b)² / (b² + 0.01)", "seconds of sampling", "relMSE", true, true}, "relmse",
                 "∝ 1 / time", -1);
  if (rmse.empty()) return {};
  std::vector<std::string> header = {"samples a pixel", "seconds", "RMSE, estimated", "relMSE, estimated"};
  const bool has_reference = !series_of("", errors, "reference_rmse").x.empty();
  if (has_reference) header.insert(header.end(), {"RMSE, reference", "relMSE, reference"});
  std::vector<std::vector<std::string>> rows;
  for (const Json& point : errors) {
    rows.push_back({cell_of(point, "samples"), cell_of(point, "seconds"), cell_of(point, "rmse"),
                    cell_of(point, "relmse"), cell_of(point, "reference_rmse"), cell_of(point, "reference_relmse")});
  }
  return html_heading("Error over time", 2) + html_row({rmse, relmse}) +
         "<p class='note'>Dashed: how the error of independent samples falls, through the last point.</p>" +
         "<details><summary>Figures</summary>" + html_table(header, rows) + "</details>\n";
}

std::string costs_html(const RenderFacts& facts)
{
  const auto seconds = [&](const char* pointer) { return facts.number(pointer).value_or(0); };
  const double load = seconds("/load_seconds"), build = seconds("/build_seconds"),
               sampling = seconds("/render_seconds");
  const double all = load + build + sampling;
  std::vector<Bar> phases;
  for (const auto& [name, value] :
       {std::pair{"reading the scene", load}, {"building for rays", build}, {"sampling", sampling}}) {
    phases.push_back({name, value, seconds_text(value) + share_text(value, all)});
  }
  std::string time = "<div><h3>Time: " + seconds_text(all) + "</h3>\n" + bars_html(phases);
  double of_stages = 0;
  std::vector<Bar> stages;
  for (const auto& [name, value] : facts.numbers("/stage_seconds")) of_stages += value;
  for (const auto& [name, value] : facts.numbers("/stage_seconds")) {
    stages.push_back({words_of(name), value, seconds_text(value) + share_text(value, of_stages)});
  }
  sort_bars(stages);
  if (!stages.empty()) {
    time += "<h3>Sampling by stages, summed over " + figure_text(seconds("/threads")) + " threads</h3>\n" +
            bars_html(stages);
  }

  const double peak = seconds("/peak_memory_bytes");
  double known = 0;
  std::vector<Bar> parts;
  for (const auto& [name, pointer] : {std::pair{"ray structures", "/bvh_bytes"},
                                      {"meshes", "/mesh_bytes"},
                                      {"textures", "/texture_bytes"},
                                      {"lights", "/light_bytes"},
                                      {"film", "/film_bytes"},
                                      {"paths under way", "/path_state_bytes"},
                                      {"displacement tables", "/displacement/bytes"},
                                      {"height maps", "/displacement/map_bytes"},
                                      {"photons", "/caustics/bytes"}}) {
    const double value = seconds(pointer);
    known += value;
    parts.push_back({name, value, bytes_text(value) + share_text(value, peak)});
  }
  if (peak > known)
    parts.push_back({"program, and all else", peak - known, bytes_text(peak - known) + share_text(peak - known, peak)});
  sort_bars(parts);
  return html_heading("Where time and memory went", 2) + "<div class='halves'>" + time +
         "</div>\n<div><h3>Memory: " + bytes_text(peak) + " at most</h3>\n" + bars_html(parts) + "</div></div>\n";
}

std::string kept_html(const RenderFacts& facts)
{
  const auto number = [&](const char* pointer) { return facts.number(pointer).value_or(0); };
  const auto flag = [&](const char* pointer) { return facts.value(pointer) == true; };
  std::string kept;
  const auto add = [&](const std::string& things) { kept += (kept.empty() ? "" : ", ") + things; };
  if (flag("/kept/scene")) add("the scene with all its files");
  if (flag("/kept/preparation")) add("all that is built for rays");
  for (const auto& [count, things] :
       {std::pair{number("/kept/images"), "images"},
        {number("/kept/height_fields"), "levels of height maps with their bounds and tables"},
        {number("/kept/meshes"), "meshes' prisms and trees"}}) {
    if (count > 0) add(figure_text(count) + " " + things);
  }
  std::string html = html_heading("Kept and rebuilt", 2);
  if (kept.empty()) {
    return html +
           html_paragraph(
               "Nothing was kept: this was the first frame of its run, or the only one. Reading the scene took " +
               seconds_text(number("/load_seconds")) + ", building for rays " + seconds_text(number("/build_seconds")) +
               ".");
  }
  html += html_paragraph("Kept from frames before: " + kept + "; " + bytes_text(number("/kept/bytes")) + ".");
  std::vector<Bar> bars;
  for (const auto& [name, pointer] : {std::pair{"kept: making it took", "/kept/seconds"},
                                      {"rebuilt: reading the scene", "/load_seconds"},
                                      {"rebuilt: building for rays", "/build_seconds"}}) {
    bars.push_back({name, number(pointer), seconds_text(number(pointer))});
  }
  return html + bars_html(bars);
}

std::string work_html(const RenderFacts& facts)
{
  std::vector<std::string> tables;
  const auto add_table = [&](const char* title, const std::vector<std::vector<std::string>>& rows) {
    if (!rows.empty()) tables.push_back("<div>" + html_table({title, ""}, rows) + "</div>");
  };
  std::vector<std::vector<std::string>> rays;
  const double total = facts.number("/rays/total").value_or(0);
  for (const auto& [name, pointer] : {std::pair{"camera rays", "/rays/camera"},
                                      {"bounce rays", "/rays/bounce"},
                                      {"shadow rays", "/rays/shadow"},
                                      {"all rays", "/rays/total"}}) {
    if (const auto n = facts.number(pointer)) rays.push_back({name, figure_text(*n) + share_text(*n, total)});
  }
  add_row(rays, "surface hits", facts.number("/counters/surface_hits"));
  add_row(rays, "background hits", facts.number("/counters/background_hits"));
  add_row(rays, "samples that were not finite", facts.number("/counters/nonfinite_samples"));
  add_table("Rays", rays);

  std::vector<std::vector<std::string>> displacement;
  if (const std::string method = facts.text("/displacement/method"); !method.empty()) {
    displacement.push_back({"method", method});
    add_row(displacement, "displaced meshes", facts.number("/displacement/geometries"));
    add_row(displacement, "base triangles", facts.number("/displacement/prisms"));
    add_row(displacement, "prisms entered a ray", facts.number("/displacement/prisms_per_ray"));
    add_row(displacement, "bounds and texels tested a ray", facts.number("/displacement/steps_mean"));
    add_row(displacement, "… for the costliest ray", facts.number("/displacement/steps_max"));
    add_row(displacement, "texels tested a ray", facts.number("/displacement/texels_mean"));
  }
  add_table("Displacement", displacement);

  std::vector<std::vector<std::string>> photons;
  if (facts.number("/caustics/photons").value_or(0) > 0) {
    add_row(photons, "started", facts.number("/caustics/photons"));
    add_row(photons, "kept", facts.number("/caustics/stored"));
    add_row(photons, "passes", facts.number("/caustics/passes"));
    add_row(photons, "first radius, m", facts.number("/caustics/first_radius"));
    add_row(photons, "last radius, m", facts.number("/caustics/radius"));
    if (const auto s = facts.number("/caustics/seconds")) photons.push_back({"time", seconds_text(*s)});
  }
  add_table("Photons", photons);
  if (tables.empty()) return {};
  return html_heading("Rays", 2) + html_row(tables);
}

std::string settings_html(const RenderFacts& facts)
{
  std::string html = html_heading("Settings", 2);
  if (const std::string command = facts.text({}, "relief:command"); !command.empty()) {
    html += "<pre>" + html_escape(printable_text(command)) + "</pre>\n";
  }
  std::vector<std::vector<std::string>> facts_of_run;
  for (const auto& [name, pointer, attribute] : {std::tuple{"scene", "/scene", "relief:scene"},
                                                 {"version", "/version", "relief:version"},
                                                 {"instruction set", "/isa", "relief:isa"},
                                                 {"colour view of the PNG", "/view", "relief:view"},
                                                 {"ended by", "/stop_reason", "relief:stop_reason"},
                                                 {"seed", "/seed", "relief:seed"},
                                                 {"frame", "/frame", "relief:frame"},
                                                 {"threads", "/threads", "relief:threads"}}) {
    const std::string text = facts.text(pointer, attribute);
    if (!text.empty()) facts_of_run.push_back({name, printable_text(text)});
  }
  std::vector<std::vector<std::string>> changed, usual;
  const Json& settings = facts.value("/settings");
  const std::vector<SettingValue> known = setting_values({});
  if (settings.is_object()) {
    for (const auto& [name, value] : settings.items()) {
      const auto found =
          std::find_if(known.begin(), known.end(), [&](const SettingValue& s) { return s.info->name == name; });
      const bool is_usual = found != known.end() && setting_text(found->fallback) == setting_text(value);
      (is_usual ? usual : changed).push_back({printable_text(name), printable_text(setting_text(value))});
    }
  }
  std::vector<std::string> tables;
  if (!facts_of_run.empty()) tables.push_back("<div>" + html_table({"run", ""}, facts_of_run) + "</div>");
  if (!changed.empty())
    tables.push_back("<div>" + html_table({"setting", "other than its default"}, changed) + "</div>");
  html += html_row(tables);
  if (usual.empty()) return html;
  return html + "<details><summary>" + std::to_string(usual.size()) + " settings that are their defaults</summary>" +
         html_table({"setting", "default"}, usual) + "</details>\n";
}

std::string warnings_html(const RenderFacts& facts)
{
  const std::vector<WarningGroup> groups = warning_groups(facts.warnings());
  std::string html = html_heading("Warnings", 2);
  if (groups.empty()) return html + html_paragraph("None.");
  for (const WarningGroup& group : groups) {
    if (group.texts.size() == 1) {
      html += html_paragraph(printable_text(group.texts.front()));
      continue;
    }
    html += "<details><summary>" + std::to_string(group.texts.size()) + " × " +
            html_escape(printable_text(group.kind)) + "</summary><ul>";
    for (const std::string& text : group.texts) html += "<li>" + html_escape(printable_text(text)) + "</li>\n";
    html += "</ul></details>\n";
  }
  return html;
}

}  // namespace relief
