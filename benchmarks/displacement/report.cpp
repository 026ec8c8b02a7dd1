#include "benchmarks/displacement/report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "benchmarks/displacement/table.h"
#include "benchmarks/displacement/vector_report.h"
#include "exporters/report_html.h"
#include "exporters/svg_plot.h"

namespace relief {

namespace {

constexpr BenchRayKind kKinds[] = {BenchRayKind::kPrimary, BenchRayKind::kBounce, BenchRayKind::kShadow};
constexpr const char* kNone = "–";

std::string mebibytes(std::size_t bytes) { return fmt::format("{:.4g}", static_cast<double>(bytes) / (1 << 20)); }

std::string times(double factor)
{
  return std::isfinite(factor) && factor > 0 ? fmt::format("×{:.3g}", factor) : kNone;
}

std::string per_cent(double share) { return share > 0 ? fmt::format("{:.2g} %", 100 * share) : "0"; }

const MethodResult* find_method(const SceneResult& scene, std::string_view name)
{
  const auto found = std::find_if(scene.methods.begin(), scene.methods.end(),
                                  [=](const MethodResult& method) { return method.name == name; });
  return found != scene.methods.end() ? &*found : nullptr;
}

/// Speed over that of another method, NaN if one of them is missing or was not timed.
double speed_ratio(const SceneResult& scene, std::string_view method, std::string_view base, BenchRayKind kind)
{
  const MethodResult *a = find_method(scene, method), *b = find_method(scene, base);
  if (a == nullptr || b == nullptr || !(b->speed(kind) > 0)) return std::nan("");
  return a->speed(kind) / b->speed(kind);
}

/// Of the time of primary and bounce rays together, as a frame with one bounce has them.
double frame_ratio(const SceneResult& scene, std::string_view method, std::string_view base)
{
  const auto time_of = [&](std::string_view name) {
    const MethodResult* result = find_method(scene, name);
    if (result == nullptr) return std::nan("");
    double sum = 0;
    for (const BenchRayKind kind : {BenchRayKind::kPrimary, BenchRayKind::kBounce}) {
      const auto k = static_cast<std::size_t>(kind);
      sum += result->of_kind[k].nanoseconds * static_cast<double>(scene.num_rays[k]);
    }
    return sum > 0 ? sum : std::nan("");
  };
  return time_of(base) / time_of(method);
}

/// A method's name, with the rate of a tessellation that had to be coarser.
std::string label_of(const MethodResult& method)
{
  if (!method.is_tessellation()) return method.name;
  const double millions = 1e-6 * static_cast<double>(method.num_micro_triangles);
  if (method.rate == 1) return fmt::format("{} ({:.3g} M, full rate)", method.name, millions);
  return fmt::format("{} ({:.3g} M, COARSER: every {:.3g} texels)", method.name, millions, 1 / method.rate);
}

std::string scene_title(const SceneResult& scene)
{
  return fmt::format("{} ({}{} triangles, {} map, tiled {:g} × {:g})", scene.name,
                     scene.like.empty() ? "" : "like " + scene.like + ": ", scene.num_triangles,
                     scene.map_width == scene.map_height ? fmt::format("{}²", scene.map_width)
                                                         : fmt::format("{} × {}", scene.map_width, scene.map_height),
                     scene.tiles_u, scene.tiles_v);
}

Table speed_table(const SceneResult& scene)
{
  Table table{
      scene_title(scene),
      fmt::format("Map {} MiB, not counted. Rays: {} primary, {} bounce, {} shadow. Two methods disagree about a "
                  "ray if only one hits or t differs by more than {:.2g} m, a texel.",
                  mebibytes(scene.map_bytes), scene.num_rays[0], scene.num_rays[1], scene.num_rays[2], scene.tolerance),
      {"method", "MiB", "prepared in s", "for a new scale in s"},
      {}};
  for (const char* what : {"Mrays/s", "over tfdm", "over tessellate", "disagree"}) {
    for (const BenchRayKind kind : kKinds) {
      table.header.push_back(fmt::format("{} {}", kBenchRayKindNames[static_cast<std::size_t>(kind)], what));
    }
  }
  for (const MethodResult& method : scene.methods) {
    std::vector<std::string> row = {label_of(method), mebibytes(method.bytes()),
                                    fmt::format("{:.3g}", method.build_seconds),
                                    fmt::format("{:.3g}", method.rescale_seconds)};
    for (const BenchRayKind kind : kKinds) {
      row.push_back(method.speed(kind) > 0 ? fmt::format("{:.3g}", method.speed(kind)) : kNone);
    }
    for (const std::string_view base : {kPublishedMethod, kTessellationMethod}) {
      for (const BenchRayKind kind : kKinds) row.push_back(times(speed_ratio(scene, method.name, base, kind)));
    }
    for (const Measurement& measured : method.of_kind) row.push_back(per_cent(measured.disagreement));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table count_table(const SceneResult& scene)
{
  Table table{"",
              "Work of one ray: primary / bounce / shadow.",
              {"method", "tables MiB", "triangles MiB", "tree MiB", "prisms", "bounds", "texels", "inversions"},
              {}};
  for (const MethodResult& method : scene.methods) {
    const auto counts = [&](double Measurement::*count) {
      const auto& of = method.of_kind;
      return method.is_tessellation()
                 ? std::string(kNone)
                 : fmt::format("{:.3g} / {:.3g} / {:.3g}", of[0].*count, of[1].*count, of[2].*count);
    };
    table.rows.push_back({method.name, mebibytes(method.table_bytes), mebibytes(method.triangle_bytes),
                          mebibytes(method.bvh_bytes), counts(&Measurement::prisms), counts(&Measurement::bounds),
                          counts(&Measurement::texels), counts(&Measurement::inversions)});
  }
  return table;
}

/// Table 1 of the paper's supplement, ours beside theirs.
Table paper_table(const BenchResults& results)
{
  Table table{
      "Speed over TFDM, primary and bounce rays together, beside the paper's (CPU)",
      "In brackets: the paper's, of its own scenes, machine and TFDM. A tessellation marked * is coarser than the "
      "map: it does less.",
      {"scene", "tessellate", "rmip-low", "rmip", "rmip-high", "chord", "chord over tessellate",
       "memory of chord over tfdm"},
      {}};
  for (const SceneResult& scene : results.scenes) {
    const auto both = [&](std::string_view method, double paper) {
      const MethodResult* result = find_method(scene, method);
      const bool coarser = result != nullptr && result->is_tessellation() && result->rate < 1;
      return times(frame_ratio(scene, method, kPublishedMethod)) + (coarser ? "*" : "") +
             (paper > 0 ? fmt::format(" ({:g})", paper) : "");
    };
    const MethodResult* tessellated = find_method(scene, kTessellationMethod);
    const char* mark = tessellated != nullptr && tessellated->rate < 1 ? "*" : "";
    const MethodResult *chord = find_method(scene, kExactMethod), *tfdm = find_method(scene, kPublishedMethod);
    const bool known = chord != nullptr && tfdm != nullptr;
    table.rows.push_back(
        {scene.name, both(kTessellationMethod, scene.paper.tessellation), both("rmip-low", scene.paper.rmip_low),
         both("rmip", scene.paper.rmip), both("rmip-high", scene.paper.rmip_high), both(kExactMethod, 0),
         times(frame_ratio(scene, kExactMethod, kTessellationMethod)) + mark,
         known ? times(static_cast<double>(chord->bytes()) / static_cast<double>(tfdm->bytes())) : std::string(kNone)});
  }
  return table;
}

/// The other half of Table 1: memory of what is searched, ours beside theirs.
Table memory_table(const BenchResults& results)
{
  Table table{"Memory over TFDM's, beside the paper's",
              "Tables of maps, and of tessellations all there is. In brackets: the paper's. What chord searches is the "
              "pyramid that prisms are made by, which is not counted of the others. A tessellation marked * is coarser "
              "than the map.",
              {"scene", "tfdm MiB", "tessellate", "rmip-low", "rmip", "rmip-high", "chord"},
              {}};
  for (const SceneResult& scene : results.scenes) {
    const MethodResult* tfdm = find_method(scene, kPublishedMethod);
    if (tfdm == nullptr) continue;
    const auto beside = [&](std::string_view name, double paper) -> std::string {
      const MethodResult* method = find_method(scene, name);
      if (method == nullptr) return kNone;
      const std::size_t bytes = method->is_tessellation() ? method->bytes() : method->table_bytes;
      return times(static_cast<double>(bytes) / static_cast<double>(tfdm->table_bytes)) +
             (method->is_tessellation() && method->rate < 1 ? "*" : "") +
             (paper > 0 ? fmt::format(" ({:g})", paper) : "");
    };
    const PaperFigures& paper = scene.paper;
    table.rows.push_back({scene.name, mebibytes(tfdm->table_bytes),
                          beside(kTessellationMethod, paper.tessellation_memory),
                          beside("rmip-low", paper.rmip_low_memory), beside("rmip", paper.rmip_memory),
                          beside("rmip-high", paper.rmip_high_memory), beside(kExactMethod, 0)});
  }
  return table;
}

Table sweep_table(const Sweep& sweep)
{
  Table table{sweep.title, fmt::format("{} by {}", sweep.y_label, sweep.x_label), {sweep.x_label}, {}};
  for (const Sweep::Line& line : sweep.lines) table.header.push_back(line.name);
  for (std::size_t k = 0; !sweep.lines.empty() && k < sweep.lines[0].x.size(); ++k) {
    std::vector<std::string> row = {fmt::format("{:g}", sweep.lines[0].x[k])};
    for (const Sweep::Line& line : sweep.lines) row.push_back(fmt::format("{:.4g}", line.y[k]));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table variant_table(std::string title, const std::vector<VariantResult>& variants)
{
  Table table{std::move(title),
              "",
              {"scene", "variant", "MiB", "prepared in s", "primary Mrays/s", "bounce Mrays/s", "bounds a primary ray",
               "texels", "inversions", "disagree"},
              {}};
  for (const VariantResult& v : variants) {
    table.rows.push_back({v.scene, v.variant, mebibytes(v.bytes), fmt::format("{:.3g}", v.build_seconds),
                          fmt::format("{:.3g}", v.primary_speed), fmt::format("{:.3g}", v.bounce_speed),
                          fmt::format("{:.3g}", v.primary.bounds), fmt::format("{:.3g}", v.primary.texels),
                          fmt::format("{:.3g}", v.primary.inversions), per_cent(v.primary.disagreement)});
  }
  return table;
}

Table frame_table(const std::vector<FrameResult>& frames)
{
  Table table{
      "Whole path-traced frames",
      "Half the width and height, 4 samples a pixel, 4 bounces, sky and sun; one thread, wall clock. Difference: root "
      "mean square over the mean, from the frame by chord with the same random numbers.",
      {"scene", "method", "MiB", "prepared in s", "rendered in s", "Mrays/s", "over tfdm", "difference"},
      {}};
  for (const FrameResult& frame : frames) {
    const auto published = std::find_if(frames.begin(), frames.end(), [&](const FrameResult& other) {
      return other.scene == frame.scene && other.method == kPublishedMethod;
    });
    table.rows.push_back(
        {frame.scene,
         frame.rate < 1 ? fmt::format("{} (COARSER: every {:.3g} texels)", frame.method, 1 / frame.rate) : frame.method,
         mebibytes(frame.bytes), fmt::format("{:.3g}", frame.build_seconds),
         fmt::format("{:.3g}", frame.render_seconds),
         fmt::format("{:.3g}", 1e-6 * static_cast<double>(frame.num_rays) / frame.render_seconds),
         published != frames.end() ? times(published->render_seconds / frame.render_seconds) : std::string(kNone),
         per_cent(frame.difference)});
  }
  return table;
}

Table cost_table(const std::vector<CostSample>& samples)
{
  std::string fit;
  for (const FittedCost& fitted : fitted_costs(samples)) {
    fit += fmt::format("{}{}: {{{:.0f}, {:.0f}, {:.0f}}}", fit.empty() ? "" : ", ",
                       displacement_method_label(fitted.method), fitted.cost.ray, fitted.cost.ray_doubling,
                       fitted.cost.build);
  }
  Table table{"What auto chooses by (MethodCost)",
              "Fitted: " + fit,
              {"scene", "method", "million micro-triangles", "ns a ray", "ns a build"},
              {}};
  for (const CostSample& s : samples) {
    table.rows.push_back({s.scene, std::string(displacement_method_label(s.method)),
                          fmt::format("{:.3g}", 1e-6 * static_cast<double>(s.num_micro_triangles)),
                          fmt::format("{:.0f}", s.ray), fmt::format("{:.0f}", s.build)});
  }
  return table;
}

/// A text as one value of CSV.
std::string csv_word(const std::string& text)
{
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

constexpr const char* kMarchingTitle = "Marching scale and resolution of RMIP (the paper's Fig. 10)";
constexpr const char* kSweepsTitle = "More displacement, more tiles (the paper's Fig. 11)";
constexpr const char* kInversionTitle = "RMIP with and without inversion (the paper's Fig. 12), and its variants";
constexpr const char* kTessellationTitle = "Ways to build a tessellation's tree (half the map's size)";

std::string conditions(const BenchResults& results)
{
  return fmt::format(
      "Kernels: {}. Maps at {:g} of their size, {} × {} pixels. One thread, one ray at a time; processor "
      "time, chunks of rays in turns by all methods, fastest of {} rounds. A hit includes its position "
      "and normal.",
      results.isa, results.map_scale, results.resolution.width, results.resolution.height, results.rounds);
}

std::string html(const Sweep& sweep, PlotStyles& styles)
{
  std::vector<PlotSeries> series;
  for (const Sweep::Line& line : sweep.lines) series.push_back({line.name, line.x, line.y});
  return svg_line_plot({sweep.title, sweep.x_label, sweep.y_label, true, sweep.log_y}, series, styles);
}

/// Bars of all methods' speeds on all scenes.
std::string speed_plot(const BenchResults& results, BenchRayKind kind, PlotStyles& styles)
{
  std::vector<std::string> labels;
  std::vector<PlotSeries> series;
  for (const SceneResult& scene : results.scenes) {
    labels.push_back(scene.name);
    for (std::size_t m = 0; m < scene.methods.size(); ++m) {
      if (m == series.size()) series.push_back({scene.methods[m].name, {}, {}});
      series[m].y.push_back(scene.methods[m].speed(kind));
    }
  }
  return svg_bar_plot(
      {fmt::format("{} rays", kBenchRayKindNames[static_cast<std::size_t>(kind)]), "", "Mrays/s", false, false}, labels,
      series, styles);
}

std::string memory_plot(const BenchResults& results, PlotStyles& styles)
{
  std::vector<std::string> labels;
  std::vector<PlotSeries> series;
  for (const SceneResult& scene : results.scenes) {
    labels.push_back(scene.name);
    for (std::size_t m = 0; m < scene.methods.size(); ++m) {
      if (m == series.size()) series.push_back({scene.methods[m].name, {}, {}});
      series[m].y.push_back(static_cast<double>(scene.methods[m].bytes()) / (1 << 20));
    }
  }
  return svg_bar_plot({"memory besides the map", "", "MiB", false, true}, labels, series, styles);
}

/// Half as wide and high, each pixel the mean of four.
BenchPicture halved(const BenchPicture& picture)
{
  BenchPicture half{picture.width / 2, picture.height / 2, picture.caption, {}};
  const auto at = [&](int x, int y, int c) {
    const int index = (y * picture.width + x) * 3 + c;
    return int{picture.rgb[static_cast<std::size_t>(index)]};
  };
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const int sum =
            at(2 * x, 2 * y, c) + at(2 * x + 1, 2 * y, c) + at(2 * x, 2 * y + 1, c) + at(2 * x + 1, 2 * y + 1, c);
        half.rgb.push_back(static_cast<std::uint8_t>((sum + 2) / 4));
      }
    }
  }
  return half;
}

std::string html(const BenchPicture& picture)
{
  const BenchPicture shown = picture.width > 400 ? halved(picture) : picture;
  return html_picture(shown.width, shown.height, shown.rgb, shown.caption, 1);
}

std::vector<std::string> scene_pieces(const SceneResult& scene)
{
  std::vector<std::string> pieces = {html_heading(scene_title(scene), 2)};
  std::vector<std::string> pictures;
  for (const BenchPicture& picture : scene.pictures) pictures.push_back(html(picture));
  pieces.push_back(html_row(pictures));
  Table speeds = speed_table(scene);
  speeds.title.clear();
  pieces.push_back(html(speeds));
  pieces.push_back(html(count_table(scene)));
  return pieces;
}

nlohmann::ordered_json json_of(const MethodResult& method)
{
  nlohmann::ordered_json json = {{"method", method.name},
                                 {"bytes", method.bytes()},
                                 {"table_bytes", method.table_bytes},
                                 {"triangle_bytes", method.triangle_bytes},
                                 {"bvh_bytes", method.bvh_bytes},
                                 {"build_seconds", method.build_seconds},
                                 {"rescale_seconds", method.rescale_seconds}};
  if (method.is_tessellation()) {
    json["edges_per_texel"] = method.rate;
    json["micro_triangles"] = method.num_micro_triangles;
  }
  for (const BenchRayKind kind : kKinds) {
    const auto k = static_cast<std::size_t>(kind);
    const Measurement& m = method.of_kind[k];
    json[std::string(kBenchRayKindNames[k])] = {{"nanoseconds_per_ray", m.nanoseconds},
                                                {"hit_share", m.hit_share},
                                                {"disagreement", m.disagreement},
                                                {"prisms", m.prisms},
                                                {"bounds", m.bounds},
                                                {"texels", m.texels},
                                                {"inversions", m.inversions}};
  }
  return json;
}

nlohmann::ordered_json json_of(const SceneResult& scene)
{
  nlohmann::ordered_json methods = nlohmann::ordered_json::array();
  for (const MethodResult& method : scene.methods) methods.push_back(json_of(method));
  return {{"scene", scene.name},
          {"like", scene.like},
          {"triangles", scene.num_triangles},
          {"map_width", scene.map_width},
          {"map_height", scene.map_height},
          {"map_bytes", scene.map_bytes},
          {"tiles", {scene.tiles_u, scene.tiles_v}},
          {"rays", {{"primary", scene.num_rays[0]}, {"bounce", scene.num_rays[1]}, {"shadow", scene.num_rays[2]}}},
          {"tolerance_metres", scene.tolerance},
          {"paper",
           {{"tfdm_milliseconds", scene.paper.tfdm_milliseconds},
            {"tessellation", scene.paper.tessellation},
            {"rmip_low", scene.paper.rmip_low},
            {"rmip", scene.paper.rmip},
            {"rmip_high", scene.paper.rmip_high}}},
          {"methods", methods}};
}

nlohmann::ordered_json json_of(const std::vector<Sweep>& sweeps)
{
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const Sweep& sweep : sweeps) {
    nlohmann::ordered_json lines = nlohmann::ordered_json::array();
    for (const Sweep::Line& line : sweep.lines) lines.push_back({{"name", line.name}, {"x", line.x}, {"y", line.y}});
    json.push_back({{"title", sweep.title}, {"x", sweep.x_label}, {"y", sweep.y_label}, {"lines", lines}});
  }
  return json;
}

nlohmann::ordered_json json_of(const std::vector<FrameResult>& frames)
{
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const FrameResult& frame : frames) {
    json.push_back({{"scene", frame.scene},
                    {"method", frame.method},
                    {"edges_per_texel", frame.rate},
                    {"bytes", frame.bytes},
                    {"build_seconds", frame.build_seconds},
                    {"render_seconds", frame.render_seconds},
                    {"rays", frame.num_rays},
                    {"difference", frame.difference}});
  }
  return json;
}

nlohmann::ordered_json json_of(const std::vector<VariantResult>& variants)
{
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const VariantResult& v : variants) {
    json.push_back({{"scene", v.scene},
                    {"variant", v.variant},
                    {"bytes", v.bytes},
                    {"build_seconds", v.build_seconds},
                    {"primary_rays_per_second", 1e6 * v.primary_speed},
                    {"bounce_rays_per_second", 1e6 * v.bounce_speed},
                    {"bounds", v.primary.bounds},
                    {"texels", v.primary.texels},
                    {"inversions", v.primary.inversions},
                    {"disagreement", v.primary.disagreement}});
  }
  return json;
}

nlohmann::ordered_json json_of(const std::vector<CostSample>& samples)
{
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const CostSample& s : samples) {
    json.push_back({{"scene", s.scene},
                    {"method", displacement_method_label(s.method)},
                    {"micro_triangles", s.num_micro_triangles},
                    {"ns_a_ray", s.ray},
                    {"ns_a_build", s.build}});
  }
  return json;
}

}  // namespace

std::string bench_markdown(const BenchResults& results)
{
  std::string text = "# relief bench displacement\n\n" + conditions(results) + "\n\n";
  if (!results.scenes.empty() && !results.is_own) {
    text += markdown(paper_table(results)) + markdown(memory_table(results));
  }
  for (const SceneResult& scene : results.scenes) text += markdown(speed_table(scene)) + markdown(count_table(scene));
  for (const auto& [title, sweeps] :
       {std::pair(kMarchingTitle, &results.marching), std::pair(kSweepsTitle, &results.sweeps)}) {
    if (!sweeps->empty()) text += fmt::format("## {}\n\n", title);
    for (const Sweep& sweep : *sweeps) text += markdown(sweep_table(sweep));
  }
  if (!results.inversion.empty()) text += markdown(variant_table(kInversionTitle, results.inversion));
  if (!results.tessellation.empty()) text += markdown(variant_table(kTessellationTitle, results.tessellation));
  if (!results.costs.empty()) text += markdown(cost_table(results.costs));
  if (!results.frames.empty()) text += markdown(frame_table(results.frames));
  for (const VectorResult& scene : results.vectors) text += markdown(vector_table(scene));
  return text;
}

std::string bench_json(const BenchResults& results)
{
  nlohmann::ordered_json scenes = nlohmann::ordered_json::array();
  for (const SceneResult& scene : results.scenes) scenes.push_back(json_of(scene));
  const nlohmann::ordered_json json = {{"bench", "displacement"},
                                       {"version", RELIEF_VERSION},
                                       {"isa", results.isa},
                                       {"map_scale", results.map_scale},
                                       {"resolution", {results.resolution.width, results.resolution.height}},
                                       {"rounds", results.rounds},
                                       {"scenes", scenes},
                                       {"marching", json_of(results.marching)},
                                       {"sweeps", json_of(results.sweeps)},
                                       {"inversion", json_of(results.inversion)},
                                       {"tessellation", json_of(results.tessellation)},
                                       {"costs", json_of(results.costs)},
                                       {"frames", json_of(results.frames)},
                                       {"vectors", vector_json(results.vectors)}};
  return json.dump(2) + "\n";
}

std::string bench_csv(const BenchResults& results)
{
  std::string text =
      "scene,method,rays,num_rays,nanoseconds_per_ray,hit_share,disagreement,prisms,bounds,texels,inversions,"
      "bytes,build_seconds,edges_per_texel\n";
  for (const SceneResult& scene : results.scenes) {
    for (const MethodResult& method : scene.methods) {
      for (const BenchRayKind kind : kKinds) {
        const auto k = static_cast<std::size_t>(kind);
        const Measurement& m = method.of_kind[k];
        text += fmt::format("{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{},{:.6g},{}\n",
                            csv_word(scene.name), method.name, kBenchRayKindNames[k], scene.num_rays[k], m.nanoseconds,
                            m.hit_share, m.disagreement, m.prisms, m.bounds, m.texels, m.inversions, method.bytes(),
                            method.build_seconds, method.is_tessellation() ? fmt::format("{:.6g}", method.rate) : "");
      }
    }
  }
  return text;
}

std::string bench_html(const BenchResults& results)
{
  PlotStyles styles;
  // In one order, so that a method looks the same in all runs, whatever was measured.
  for (const DisplacementMethod method : kDisplacementMethods)
    styles.of(std::string(displacement_method_label(method)));
  for (const char* variant : {"tfdm-affine", "rmip-affine", "rmip-low", "rmip-high"}) styles.of(variant);
  std::vector<std::string> pieces = {html_paragraph(conditions(results))};
  if (!results.scenes.empty()) {
    if (!results.is_own) {
      pieces.push_back(html(paper_table(results)));
      pieces.push_back(html(memory_table(results)));
    }
    std::vector<std::string> plots;
    for (const BenchRayKind kind : kKinds) plots.push_back(speed_plot(results, kind, styles));
    plots.push_back(memory_plot(results, styles));
    pieces.push_back(html_row(plots));
  }
  for (const SceneResult& scene : results.scenes) {
    for (std::string& piece : scene_pieces(scene)) pieces.push_back(std::move(piece));
  }
  for (const auto& [title, sweeps] :
       {std::pair(kMarchingTitle, &results.marching), std::pair(kSweepsTitle, &results.sweeps)}) {
    if (sweeps->empty()) continue;
    pieces.push_back(html_heading(title, 2));
    std::vector<std::string> plots;
    for (const Sweep& sweep : *sweeps) plots.push_back(html(sweep, styles));
    pieces.push_back(html_row(plots));
  }
  if (!results.inversion.empty()) pieces.push_back(html(variant_table(kInversionTitle, results.inversion)));
  if (!results.tessellation.empty()) pieces.push_back(html(variant_table(kTessellationTitle, results.tessellation)));
  if (!results.costs.empty()) pieces.push_back(html(cost_table(results.costs)));
  if (!results.frames.empty()) pieces.push_back(html(frame_table(results.frames)));
  std::vector<std::string> pictures;
  for (const VectorResult& scene : results.vectors) pictures.push_back(html(scene.picture));
  if (!pictures.empty()) pieces.push_back(html_row(pictures));
  for (const VectorResult& scene : results.vectors) pieces.push_back(html(vector_table(scene)));
  return html_page("Displacement: methods side by side", pieces);
}

}  // namespace relief
