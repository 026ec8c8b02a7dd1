// How the study of worlds is written.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "benchmarks/displacement/contender.h"
#include "benchmarks/displacement/table.h"
#include "benchmarks/procedural/world_study.h"
#include "displacement/displacement_set.h"
#include "exporters/report_html.h"
#include "exporters/svg_plot.h"

namespace relief {

namespace {

/// How a world is divided, and how much room heights have where it is not the usual.
std::string cells_text(const WorldResult& r)
{
  std::string text = r.cells.n > 0 ? fmt::format("N = {}", r.cells.n) : "a pixel";
  if (r.cells.least_metres > 0) text += fmt::format(", {:g} cm", 100 * r.cells.least_metres);
  if (r.room_bytes > DisplacementOptions{}.computed_bytes) text += fmt::format(", {} MiB", r.room_bytes >> 20);
  return text;
}

std::string size_text(const WorldResult& r)
{
  std::string text = fmt::format("{} × {}", r.width, r.height);
  if (r.traced_width < r.width) text += fmt::format(", middle {} × {}", r.traced_width, r.traced_height);
  return text;
}

std::string mebibytes(std::uint64_t bytes) { return fmt::format("{:.3g}", static_cast<double>(bytes) / (1 << 20)); }

std::string millions(double nanoseconds) { return nanoseconds > 0 ? fmt::format("{:.3g}", 1e3 / nanoseconds) : "–"; }

double per_ray(std::uint64_t tiles, const WorldRays& rays)
{
  return rays.count > 0 ? static_cast<double>(tiles) / static_cast<double>(rays.count) : 0;
}

/// Hours of one core for the paper's picture at the rates of a result: all its paths' rays, and a shadow ray at each end.
double hours_for_paper(const PaperPicture& paper, const WorldResult& r)
{
  const double paths = static_cast<double>(paper.width) * paper.height * paper.paths;
  return paths * 1e-9 / 3600 *
         (r.rays[0].nanoseconds + (paper.length - 1) * r.rays[1].nanoseconds + paper.length * r.rays[2].nanoseconds);
}

Table size_table(const WorldStudy& study)
{
  const PaperPicture& paper = study.spec->paper;
  Table table{
      fmt::format("{}: what it takes", study.spec->title),
      fmt::format(
          "{} base triangles. Cells: N along all sides, or as large as a pixel (and not divided below some size). "
          "Micro-triangles: N² a lattice, in all. Preparation in seconds of wall clock on all "
          "cores; MiB: the base mesh, what is prepared (lattices, triangles, tree), the room for heights, heights that "
          "were kept, and "
          "the most that the process had beyond what it had before, rays included.",
          study.num_triangles),
      {"cells", "picture", "finest N", "lattices", "micro-triangles", "preparation", "mesh", "prepared", "room",
       "heights", "peak"},
      {}};
  if (paper.hours > 0) table.note += fmt::format(" The paper: N {}, memory {}.", paper.cells, paper.memory);
  for (const WorldResult& r : study.results) {
    table.rows.push_back({cells_text(r), size_text(r), fmt::format("{:.0f}", r.most_cells_a_side),
                          std::to_string(r.num_lattices), fmt::format("{:.3g}", r.num_micro_triangles),
                          fmt::format("{:.2f}", r.prepare_seconds), mebibytes(r.mesh_bytes),
                          mebibytes(r.prepared_bytes), mebibytes(r.room_bytes), mebibytes(r.height_bytes),
                          mebibytes(r.peak_bytes)});
  }
  return table;
}

Table rate_table(const WorldStudy& study)
{
  const PaperPicture& paper = study.spec->paper;
  Table table{
      fmt::format("{}: rays", study.spec->title),
      "Million rays a second of one thread: first without any heights, which are made as rays ask for them, then in "
      "the fastest round with those that are kept. Tiles made a primary ray: in the first round, and in the last.",
      {"cells", "picture", "hit", "primary, first", "primary", "bounce, first", "bounce", "shadow",
       "tiles a primary ray", "again", "tiles a bounce ray", "again"},
      {}};
  if (paper.hours > 0) {
    table.header.emplace_back("hours for the paper's picture");
    table.note += fmt::format(
        " The paper's picture of {} × {} has {} paths of {} rays a pixel and took {} hours of 250 MHz processors; "
        "here: "
        "so many rays, and a shadow ray for each, at the rates of one core.",
        paper.width, paper.height, paper.paths, paper.length, paper.hours);
  }
  for (const WorldResult& r : study.results) {
    const WorldRays &primary = r.rays[0], &bounce = r.rays[1], &shadow = r.rays[2];
    table.rows.push_back({cells_text(r), size_text(r), fmt::format("{:.0f} %", 100 * primary.hit_share),
                          millions(primary.first_nanoseconds), millions(primary.nanoseconds),
                          millions(bounce.first_nanoseconds), millions(bounce.nanoseconds),
                          millions(shadow.nanoseconds), fmt::format("{:.3g}", per_ray(primary.first_tiles, primary)),
                          fmt::format("{:.3g}", per_ray(primary.repeated_tiles, primary)),
                          fmt::format("{:.3g}", per_ray(bounce.first_tiles, bounce)),
                          fmt::format("{:.3g}", per_ray(bounce.repeated_tiles, bounce))});
    if (paper.hours > 0) table.rows.back().push_back(fmt::format("{:.2g}", hours_for_paper(paper, r)));
  }
  return table;
}

}  // namespace

std::string world_markdown(const WorldStudy& study)
{
  return markdown(size_table(study)) + markdown(rate_table(study));
}

nlohmann::ordered_json world_json(const WorldStudy& study)
{
  nlohmann::ordered_json results = nlohmann::ordered_json::array();
  for (const WorldResult& r : study.results) {
    nlohmann::ordered_json rays;
    for (std::size_t kind = 0; kind < r.rays.size(); ++kind) {
      const WorldRays& of = r.rays[kind];
      rays[std::string(kBenchRayKindNames[kind])] = {{"rays", of.count},
                                                     {"hit_share", of.hit_share},
                                                     {"first_nanoseconds_a_ray", of.first_nanoseconds},
                                                     {"nanoseconds_a_ray", of.nanoseconds},
                                                     {"first_tiles", of.first_tiles},
                                                     {"repeated_tiles", of.repeated_tiles}};
    }
    nlohmann::ordered_json result = {{"n", r.cells.n},
                                     {"least_metres", r.cells.least_metres},
                                     {"resolution", {r.width, r.height}},
                                     {"traced", {r.traced_width, r.traced_height}},
                                     {"finest_n", r.most_cells_a_side},
                                     {"lattices", r.num_lattices},
                                     {"micro_triangles", r.num_micro_triangles},
                                     {"prepare_seconds", r.prepare_seconds},
                                     {"mesh_bytes", r.mesh_bytes},
                                     {"prepared_bytes", r.prepared_bytes},
                                     {"room_bytes", r.room_bytes},
                                     {"height_bytes", r.height_bytes},
                                     {"peak_bytes", r.peak_bytes}};
    result.update(rays);
    if (study.spec->paper.hours > 0) result["hours_for_paper"] = hours_for_paper(study.spec->paper, r);
    results.push_back(result);
  }
  nlohmann::ordered_json json = {{"world", study.spec->name}, {"triangles", study.num_triangles}, {"results", results}};
  if (study.spec->paper.hours > 0)
    json["paper"] = {{"hours", study.spec->paper.hours}, {"memory", study.spec->paper.memory}};
  return json;
}

std::string world_html(const WorldStudy& study)
{
  PlotStyles styles;
  std::vector<std::string> labels;
  std::vector<PlotSeries> series;
  for (const char* name : {"primary, first", "primary", "bounce", "shadow"}) series.push_back({name, {}, {}});
  for (const WorldResult& r : study.results) {
    labels.push_back(fmt::format("{}, {}", cells_text(r), r.width));
    series[0].y.push_back(1e3 / r.rays[0].first_nanoseconds);
    for (std::size_t kind = 0; kind < 3; ++kind) series[kind + 1].y.push_back(1e3 / r.rays[kind].nanoseconds);
  }
  const std::vector<std::string> pictures = {
      html_picture(study.picture_width, study.picture_height, study.rgb, cells_text(study.results[0]), 1),
      svg_bar_plot({"rays", "", "millions a second", false, true}, labels, series, styles)};
  return html_heading(study.spec->title, 2) + html_row(pictures) + html(size_table(study)) + html(rate_table(study));
}

}  // namespace relief
