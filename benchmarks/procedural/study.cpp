#include "benchmarks/procedural/study.h"

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <random>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "benchmarks/displacement/table.h"
#include "benchmarks/procedural/microtriangle_march.h"
#include "displacement/displaced_mesh.h"
#include "displacement/embree_geometry.h"
#include "displacement/lattice_split.h"
#include "exporters/report_html.h"
#include "exporters/svg_plot.h"
#include "integrator/stages.h"
#include "kernel/graph/noise.h"
#include "scene/load.h"

namespace relief {

namespace {

constexpr int kSizes[] = {1, 4, 16, 64, 256};
constexpr double kAmplitude = 0.5;  ///< of the radius, as in the paper's Fig. 1
constexpr std::size_t kCacheBytes = std::size_t{64} << 20;
constexpr const char* kMarching = "marching";
constexpr const char* kLattice = "lattice";
constexpr const char* kSmoothing = "smoothing";

double processor_seconds()
{
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// A face of an icosahedron whose normals are those of the ball.
struct Face {
  Vec3f P[3] = {{0, 0.525731f, 0.850651f}, {0, -0.525731f, 0.850651f}, {0.850651f, 0, 0.525731f}};
  Normal3f N[3] = {{0, 0.525731f, 0.850651f}, {0, -0.525731f, 0.850651f}, {0.850651f, 0, 0.525731f}};
  TriangleIndices triangle{0, 1, 2};

  MeshView mesh() const
  {
    MeshView view;
    view.P = P;
    view.N = N;
    view.triangles = &triangle;
    view.num_vertices = 3;
    view.num_triangles = 1;
    return view;
  }
};

/// Eight octaves of noise, −½ to ½ times the amplitude.
void heights(const Face& face, const float (*b)[8], float* h)
{
  F8 p[3];
  const auto sum = [&](float x, float y, float z) { return load8(b[0]) * x + load8(b[1]) * y + load8(b[2]) * z; };
  p[0] = 4.0f * sum(face.P[0].x, face.P[1].x, face.P[2].x);
  p[1] = 4.0f * sum(face.P[0].y, face.P[1].y, face.P[2].y);
  p[2] = 4.0f * sum(face.P[0].z, face.P[1].z, face.P[2].z);
  const NoiseOctaves octaves{splat8(7.0f), splat8(0.5f), splat8(2.0f)};
  store8(h, static_cast<float>(kAmplitude) * (noise_fractal<3>(p, octaves, true, false) - 0.5f));
}

void eval(const void* owner, std::uint32_t, const float (*b)[8], float* h)
{
  heights(*static_cast<const Face*>(owner), b, h);
}
void bounds(const void*, std::uint32_t, const WeightPatches&, float* low, float* high)
{
  std::fill_n(low, 8, static_cast<float>(-0.5 * kAmplitude));
  std::fill_n(high, 8, static_cast<float>(0.5 * kAmplitude));
}

MarchedTriangle marched(const Face& face, int n)
{
  MarchedTriangle out;
  for (std::size_t k = 0; k < 3; ++k) {
    out.P[k] = {face.P[k].x, face.P[k].y, face.P[k].z};
    out.N[k] = {face.N[k].x, face.N[k].y, face.N[k].z};
  }
  out.n = n;
  out.h.resize(static_cast<std::size_t>((n + 1) * (n + 1)));
  out.low = -0.5 * kAmplitude;
  out.high = 0.5 * kAmplitude;
  for (int j = 0; j <= n; ++j) {
    for (int k = 0; j + k <= n; ++k) {
      float b[3][8], h[8];
      std::fill_n(b[0], 8, static_cast<float>(n - j - k) / static_cast<float>(n));
      std::fill_n(b[1], 8, static_cast<float>(j) / static_cast<float>(n));
      std::fill_n(b[2], 8, static_cast<float>(k) / static_cast<float>(n));
      heights(face, b, h);
      out.h[static_cast<std::size_t>(j * (n + 1) + k)] = h[0];
    }
  }
  return out;
}

struct Ray {
  Vec3f O, D;
};

/// From around the ball at points near the face's surface: from all sides, many of them shallow.
std::vector<Ray> random_rays(const Face& face, int count)
{
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0, 1), both(-1, 1);
  std::vector<Ray> rays;
  while (rays.size() < static_cast<std::size_t>(count)) {
    Vec3f O{both(random), both(random), both(random)};
    if (!(length(O) > 0.2f)) continue;
    O = normalize(O) * 2.5f;
    float u = unit(random), v = unit(random);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Vec3f at = face.P[0] * (1 - u - v) + face.P[1] * u + face.P[2] * v;
    rays.push_back({O, at * (1 + 0.25f * both(random)) - O});
  }
  return rays;
}

template <class Real>
MarchVector<Real> vector(Vec3f a)
{
  return {static_cast<Real>(a.x), static_cast<Real>(a.y), static_cast<Real>(a.z)};
}

template <class Real>
MarchResult measure_march(const MarchedTriangle& triangle,
                          const std::vector<Ray>& rays,
                          const std::vector<MarchHit>& truth,
                          int rounds,
                          const char* precision)
{
  const MicrotriangleMarch<Real> march(triangle);
  MarchResult out{triangle.n, precision};
  for (int round = 0; round < rounds; ++round) {
    std::vector<MarchHit> hits;
    hits.reserve(rays.size());
    const double start = processor_seconds();
    for (const Ray& ray : rays) hits.push_back(march.march(vector<Real>(ray.O), vector<Real>(ray.D)));
    const double nanoseconds = 1e9 * (processor_seconds() - start) / static_cast<double>(rays.size());
    out.nanoseconds = round == 0 ? nanoseconds : std::min(out.nanoseconds, nanoseconds);
    if (round > 0) continue;
    for (std::size_t k = 0; k < rays.size(); ++k) {
      // Rounding of single precision, in parts of the ray.
      constexpr double kTolerance = 1e-5;
      const double one = 1.0 / static_cast<double>(rays.size());
      out.cells += hits[k].num_cells * one;
      if (truth[k].hit && !hits[k].hit) out.missed += one;
      if (truth[k].hit && hits[k].hit && hits[k].t > truth[k].t + kTolerance) out.passed_over += one;
      if (hits[k].hit && (!truth[k].hit || hits[k].t < truth[k].t - kTolerance)) out.invented += one;
    }
  }
  return out;
}

LatticeResult measure_lattice(const Face& face, int n, const std::vector<Ray>& rays, int rounds)
{
  LatticeResult out{.n = n};
  const MeshView mesh = face.mesh();
  const HeightSource source{&face, eval, bounds};
  for (int round = 0; round < rounds; ++round) {
    LatticeCache cache(kCacheBytes);
    const ProceduralField field(source, lattices_make(mesh, n), 0, cache);
    const DisplacedMesh displaced(mesh, field, {.height = {}, .scale = 1, .midlevel = 0});
    DisplacedGeometry geometry;
    geometry.mesh = displaced.view();
    geometry.procedural = &field;
    TraversalCounters counters;
    const TraversalTable& table = traversal_table_select();
    const auto trace_all = [&] {
      const double start = processor_seconds();
      for (const Ray& ray : rays) {
        DisplacedHit hit;
        DisplacedQuery query{to_double(ray.O), to_double(ray.D), 0, 10};
        table.trace(geometry, 0, query, &hit, &counters);
      }
      return 1e9 * (processor_seconds() - start) / static_cast<double>(rays.size());
    };
    const double first = trace_all(), again = trace_all();
    out.first_nanoseconds = round == 0 ? first : std::min(out.first_nanoseconds, first);
    out.nanoseconds = round == 0 ? again : std::min(out.nanoseconds, again);
    out.bytes = static_cast<double>(field.bytes() + cache.bytes());
    if (round > 0) continue;
    std::mt19937 random(6);
    std::uniform_real_distribution<float> unit(0, 1);
    double squares = 0;
    constexpr int kPoints = 20000;
    for (int k = 0; k < kPoints; ++k) {
      float u = unit(random), v = unit(random);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const SurfacePoint point = displaced_surface_point(geometry, 0, {u, v});
      float b[3][8], h[8];
      std::fill_n(b[0], 8, 1 - u - v);
      std::fill_n(b[1], 8, u);
      std::fill_n(b[2], 8, v);
      heights(face, b, h);
      const double off = point.d - static_cast<double>(h[0]);
      squares += off * off / kPoints;
    }
    out.rms = std::sqrt(squares) / kAmplitude;
  }
  return out;
}

std::string per_cent(double share) { return share > 0 ? fmt::format("{:.3g} %", 100 * share) : "0"; }

Table march_table(const ProceduralResults& results)
{
  Table table{
      "Microtriangle marching as published",
      "Against all micro-triangles in double precision: shares of rays that found nothing, one behind the first, or "
      "one "
      "that is not there; cells and nanoseconds a ray. The paper: \"we have not noticed any significant errors\".",
      {"N", "precision", "missed", "passed over", "invented", "cells", "ns"},
      {}};
  for (const MarchResult& r : results.marches) {
    table.rows.push_back({std::to_string(r.n), r.precision, per_cent(r.missed), per_cent(r.passed_over),
                          per_cent(r.invented), fmt::format("{:.3g}", r.cells), fmt::format("{:.0f}", r.nanoseconds)});
  }
  return table;
}

Table lattice_table(const ProceduralResults& results)
{
  Table table{"Heights on demand over the same lattice",
              "How far the lattice's heights are from the function's (root of the mean square, in parts of the range: "
              "the paper's "
              "Fig. 4 in figures), nanoseconds a ray the first time, heights included, and once they are there; KiB of "
              "heights.",
              {"N", "error", "ns first", "ns", "KiB"},
              {}};
  for (const LatticeResult& r : results.lattices) {
    table.rows.push_back({std::to_string(r.n), fmt::format("{:.3g}", r.rms), fmt::format("{:.0f}", r.first_nanoseconds),
                          fmt::format("{:.0f}", r.nanoseconds), fmt::format("{:.0f}", r.bytes / 1024)});
  }
  return table;
}

void run_marches(const Face& face,
                 const std::vector<Ray>& rays,
                 const ProceduralOptions& options,
                 ProceduralResults* results)
{
  for (const int n : kSizes) {
    const MarchedTriangle triangle = marched(face, n);
    std::vector<MarchHit> truth;
    const MicrotriangleMarch<double> all(triangle);
    // All of them are many.
    const std::size_t count = n > 64 ? rays.size() / 16 : rays.size();
    const std::vector<Ray> some(rays.begin(), rays.begin() + static_cast<std::ptrdiff_t>(count));
    for (const Ray& ray : some) truth.push_back(all.brute_force(vector<double>(ray.O), vector<double>(ray.D)));
    results->marches.push_back(measure_march<float>(triangle, some, truth, options.rounds, "single"));
    results->marches.push_back(measure_march<double>(triangle, some, truth, options.rounds, "double"));
    if (options.progress) options.progress(fmt::format("marched N = {}", n));
  }
}

Table smoothing_table(const ProceduralResults& results)
{
  Table table{
      "A smooth surface through the vertices",
      "Angles between normals on either side of the triangles' sides, degrees, at 15 points of each: of the flat "
      "triangles, and of the surface that is displaced with `curved` (the paper's section 4, Fig. 8). Left out: "
      "sides where normals are so far apart that there is no such surface.",
      {"mesh", "triangles", "sides", "left out", "flat: largest", "mean", "curved: largest", "mean", "points over .1°"},
      {}};
  for (const SmoothingResult& r : results.smoothings) {
    table.rows.push_back({r.mesh, std::to_string(r.num_triangles), std::to_string(r.num_sides),
                          std::to_string(r.num_left_out), fmt::format("{:.3g}", r.flat.largest),
                          fmt::format("{:.3g}", r.flat.mean), fmt::format("{:.3g}", r.curved.largest),
                          fmt::format("{:.2g}", r.curved.mean), per_cent(r.steps_share)});
  }
  return table;
}

void run_smoothings(const ProceduralOptions& options, ProceduralResults* results)
{
  results->smoothings.push_back(smoothing_study_of_icosahedron());
  for (const std::string& file : options.meshes) {
    const Scene scene = scene_load(file);
    const std::size_t num_before = results->smoothings.size();
    for (const Mesh& mesh : scene.meshes) {
      if (mesh.N.empty()) continue;
      results->smoothings.push_back(
          smoothing_study(mesh.name.empty() ? std::filesystem::path(file).stem().string() : mesh.name, mesh.view()));
    }
    if (results->smoothings.size() == num_before) {
      throw SceneError(file, "/meshes", "a mesh with normals", "none");
    }
  }
}

std::string conditions(const ProceduralResults& results)
{
  return fmt::format(
      "{} rays at one face of an icosahedron with the normals of its ball, eight octaves of noise, half of the "
      "radius high (Smits and others 2000, Figs. 1 and 4). Kernels: {}. Processor time of one thread.",
      results.num_rays, results.isa);
}

}  // namespace

std::vector<std::string> bench_procedural_parts()
{
  std::vector<std::string> names = {kMarching, kLattice, kSmoothing};
  for (const WorldSpec& spec : world_specs()) names.emplace_back(spec.name);
  return names;
}

ProceduralResults bench_procedural_run(const ProceduralOptions& options)
{
  const auto is_wanted = [&](std::string_view part) {
    return options.parts.empty() || std::find(options.parts.begin(), options.parts.end(), part) != options.parts.end();
  };
  const Face face;
  const std::vector<Ray> rays = random_rays(face, options.num_rays);
  ProceduralResults results{options.num_rays, traversal_table_select().isa, {}, {}, {}, {}};
  if (is_wanted(kMarching)) run_marches(face, rays, options, &results);
  if (is_wanted(kLattice)) {
    for (const int n : {1, 4, 16, 64, 256, 4096}) {
      results.lattices.push_back(measure_lattice(face, n, rays, options.rounds));
      if (options.progress) options.progress(fmt::format("traced N = {}", n));
    }
  }
  if (is_wanted(kSmoothing)) run_smoothings(options, &results);
  for (const WorldSpec& spec : world_specs()) {
    if (!is_wanted(spec.name)) continue;
    results.worlds.push_back(
        world_study(spec, {options.rounds, options.world_shrink, options.world_mesh_divisor, options.progress}));
  }
  return results;
}

std::string bench_procedural_markdown(const ProceduralResults& results)
{
  std::string text = "# relief bench procedural\n\n" + conditions(results) + "\n\n";
  if (!results.marches.empty()) text += markdown(march_table(results));
  if (!results.lattices.empty()) text += markdown(lattice_table(results));
  if (!results.smoothings.empty()) text += markdown(smoothing_table(results));
  for (const WorldStudy& world : results.worlds) text += world_markdown(world);
  return text;
}

std::string bench_procedural_json(const ProceduralResults& results)
{
  nlohmann::ordered_json marches = nlohmann::ordered_json::array(), lattices = marches, smoothings = marches,
                         worlds = marches;
  for (const MarchResult& r : results.marches) {
    marches.push_back({{"n", r.n},
                       {"precision", r.precision},
                       {"missed", r.missed},
                       {"passed_over", r.passed_over},
                       {"invented", r.invented},
                       {"cells", r.cells},
                       {"nanoseconds_a_ray", r.nanoseconds}});
  }
  for (const LatticeResult& r : results.lattices) {
    lattices.push_back({{"n", r.n},
                        {"error", r.rms},
                        {"first_nanoseconds_a_ray", r.first_nanoseconds},
                        {"nanoseconds_a_ray", r.nanoseconds},
                        {"bytes", r.bytes}});
  }
  for (const SmoothingResult& r : results.smoothings) {
    smoothings.push_back({{"mesh", r.mesh},
                          {"triangles", r.num_triangles},
                          {"sides", r.num_sides},
                          {"left_out", r.num_left_out},
                          {"flat_largest_degrees", r.flat.largest},
                          {"flat_mean_degrees", r.flat.mean},
                          {"curved_largest_degrees", r.curved.largest},
                          {"curved_mean_degrees", r.curved.mean},
                          {"over_a_tenth_of_a_degree", r.steps_share}});
  }
  for (const WorldStudy& world : results.worlds) worlds.push_back(world_json(world));
  const nlohmann::ordered_json json = {{"bench", "procedural"},    {"version", RELIEF_VERSION}, {"isa", results.isa},
                                       {"rays", results.num_rays}, {"marches", marches},        {"lattices", lattices},
                                       {"smoothings", smoothings}, {"worlds", worlds}};
  return json.dump(2) + "\n";
}

std::string bench_procedural_html(const ProceduralResults& results)
{
  std::vector<double> x, error, x_march, missed;
  for (const LatticeResult& r : results.lattices) {
    x.push_back(r.n);
    error.push_back(r.rms);
  }
  for (const MarchResult& r : results.marches) {
    if (r.precision != "double") continue;
    x_march.push_back(r.n);
    missed.push_back(100 * (r.missed + r.passed_over));
  }
  PlotStyles styles;
  std::vector<std::string> plots, pieces = {html_paragraph(conditions(results))};
  if (!results.lattices.empty())
    plots.push_back(
        svg_line_plot({"error of the lattice", "N", "parts of the range", true, true}, {{"rms", x, error}}, styles));
  if (!results.marches.empty())
    plots.push_back(svg_line_plot({"rays that marching gets wrong", "N", "%", true, false},
                                  {{"double precision", x_march, missed}}, styles));
  pieces.push_back(html_row(plots));
  if (!results.marches.empty()) pieces.push_back(html(march_table(results)));
  if (!results.lattices.empty()) pieces.push_back(html(lattice_table(results)));
  if (!results.smoothings.empty()) pieces.push_back(html(smoothing_table(results)));
  for (const WorldStudy& world : results.worlds) pieces.push_back(world_html(world));
  return html_page("Procedural displacement: marching and heights on demand", pieces);
}

}  // namespace relief
