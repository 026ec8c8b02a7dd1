#include "benchmarks/heightfield/study.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <iterator>
#include <tuple>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "benchmarks/displacement/maps.h"
#include "benchmarks/displacement/table.h"
#include "benchmarks/heightfield/map_file.h"
#include "exporters/report_html.h"

namespace relief {

namespace {

/// Height of the relief in lengths of the texture.
constexpr double kDepth = 0.12;
/// Steps by which [P] looks for where a ray comes out.
constexpr int kRelaxedSteps = 64;

constexpr std::pair<const char*, ConeMap (*)(const HeightTexture&)> kConeMaps[] = {
    {"conservative", cone_map_conservative},
    {"quick", cone_map_quick},
    {"approximate relaxed", [](const HeightTexture& t) { return cone_map_relaxed_approximate(t, kRelaxedSteps); }},
    {"relaxed", cone_map_relaxed},
    {"quick relaxed", cone_map_quick_relaxed}};

/// A cone map's name on the command line.
std::string option_name(std::string cone)
{
  std::replace(cone.begin(), cone.end(), ' ', '-');
  return cone;
}

double processor_seconds()
{
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

HeightTexture texture_of(BenchMap kind, int size)
{
  HeightTexture texture{size, {}};
  for (const std::uint16_t h : bench_map_make(kind, size)) texture.h.push_back(static_cast<float>(h) / 65535.0f);
  return texture;
}

/// Single texels of full height, the paper's worst case.
HeightTexture impulses(int size)
{
  HeightTexture texture{size,
                        std::vector<float>(static_cast<std::size_t>(size) * static_cast<std::size_t>(size), 0.0f)};
  for (int j = size / 16; j < size; j += size / 8) {
    for (int i = size / 16; i < size; i += size / 8)
      texture.h[static_cast<std::size_t>(j) * static_cast<std::size_t>(size) + static_cast<std::size_t>(i)] = 1.0f;
  }
  return texture;
}

/// One ray a pixel of a picture that looks down on the plane at a shallow angle; those that miss it have none.
std::vector<TextureRay> rays_of(const HeightfieldOptions& options)
{
  std::vector<TextureRay> rays;
  const double eye[3] = {0.5, -0.55, 0.5};  // u, v, height in lengths of the texture
  const double pitch = -0.5, aspect = static_cast<double>(options.width) / options.height;
  for (int y = 0; y < options.height; ++y) {
    for (int x = 0; x < options.width; ++x) {
      const double px = (2 * (x + 0.5) / options.width - 1) * 0.55 * aspect,
                   py = (1 - 2 * (y + 0.5) / options.height) * 0.55;
      const double dv = std::cos(pitch) - py * std::sin(pitch), dz = std::sin(pitch) + py * std::cos(pitch);
      if (dz > -0.05) continue;
      const double t = (kDepth - eye[2]) / dz;
      rays.push_back({eye[0] + px * t, eye[1] + dv * t, px, dv, dz / kDepth});
    }
  }
  return rays;
}

struct Variant {
  std::string map, stepping, refinement;
  bool is_corrected;
  int max_iterations;
  std::function<TextureHit(const TextureRay&)> trace;
};

/// Traces all rays by all variants in turns; the fastest round counts.
void measure(const HeightTexture& texture,
             const std::vector<TextureRay>& rays,
             const std::vector<Variant>& variants,
             int rounds,
             std::vector<HeightfieldResult>* out)
{
  std::vector<TextureHit> exact;
  exact.reserve(rays.size());
  for (const TextureRay& ray : rays) exact.push_back(exact_trace(texture, ray));
  out->resize(variants.size());
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t k = 0; k < variants.size(); ++k) {
      const Variant& v = variants[k];
      HeightfieldResult& result = (*out)[k];
      std::uint64_t steps = 0;
      std::size_t wrong = 0, unconverged = 0;
      const double start = processor_seconds();
      std::vector<TextureHit> hits;
      hits.reserve(rays.size());
      for (const TextureRay& ray : rays) hits.push_back(v.trace(ray));
      const double nanoseconds = 1e9 * (processor_seconds() - start) / static_cast<double>(rays.size());
      if (round > 0) {
        result.nanoseconds = std::min(result.nanoseconds, nanoseconds);
        continue;
      }
      for (std::size_t i = 0; i < rays.size(); ++i) {
        const double texel = 1.0 / (texture.size * std::hypot(rays[i].du, rays[i].dv));
        steps += static_cast<std::uint64_t>(hits[i].num_steps);
        if (!hits[i].converged) {
          ++unconverged;
        } else if (!(std::abs(hits[i].t - exact[i].t) <= texel)) {
          ++wrong;
        }
      }
      const auto share = [&](std::size_t count) {
        return static_cast<double>(count) / static_cast<double>(rays.size());
      };
      result = {v.map,
                v.stepping,
                v.refinement,
                v.is_corrected,
                v.max_iterations,
                nanoseconds,
                static_cast<double>(steps) / static_cast<double>(rays.size()),
                share(wrong),
                share(unconverged)};
    }
  }
}

/// Shaded hits; given up magenta, off by more than a texel red.
HeightfieldPicture picture_of(const HeightTexture& texture, const HeightfieldOptions& options, const Variant& variant)
{
  HeightfieldPicture picture{
      fmt::format("{}{}, {}, {}, at most {} steps", variant.map, variant.is_corrected ? " corrected" : "",
                  variant.stepping, variant.refinement, variant.max_iterations),
      options.width,
      options.height,
      {}};
  const std::vector<TextureRay> rays = rays_of(options);
  const std::size_t num_sky = static_cast<std::size_t>(options.width * options.height) - rays.size();
  for (std::size_t k = 0; k < num_sky; ++k) picture.rgb.insert(picture.rgb.end(), {150, 170, 190});
  for (const TextureRay& ray : rays) {
    const TextureHit hit = variant.trace(ray), exact = exact_trace(texture, ray);
    if (!hit.converged) {
      picture.rgb.insert(picture.rgb.end(), {255, 0, 255});
      continue;
    }
    const double u = ray.u + ray.du * hit.t, v = ray.v + ray.dv * hit.t, step = 0.5 / texture.size;
    const double gu = (texture.height(u + step, v) - texture.height(u - step, v)) / (2 * step) * kDepth;
    const double gv = (texture.height(u, v + step) - texture.height(u, v - step)) / (2 * step) * kDepth;
    const double light = std::max((-0.5 * gu + 0.4 * gv + 0.77) / std::sqrt(gu * gu + gv * gv + 1), 0.0);
    const double shade = 40 + 200 * std::min(light, 1.0);
    const bool is_wrong = std::abs(hit.t - exact.t) * texture.size * std::hypot(ray.du, ray.dv) > 1;
    const auto c = static_cast<std::uint8_t>(shade);
    if (is_wrong) {
      picture.rgb.insert(picture.rgb.end(), {230, 30, 20});
    } else {
      picture.rgb.insert(picture.rgb.end(), {c, c, c});
    }
  }
  return picture;
}

HeightfieldTexture study(const std::string& name, const HeightTexture& texture, const HeightfieldOptions& options)
{
  HeightfieldTexture out{name, {}, {}, {}};
  struct Map {
    std::string name;
    ConeMap (*make)(const HeightTexture&);
    ConeMap plain = {}, corrected = {};
  };
  std::vector<Map> maps;
  for (const auto& [cone, make] : kConeMaps) {
    const bool is_wanted = options.cones.empty() || std::find(options.cones.begin(), options.cones.end(),
                                                              option_name(cone)) != options.cones.end();
    if (is_wanted) maps.push_back({cone, make});
  }
  for (Map& map : maps) {
    double start = processor_seconds();
    map.plain = map.make(texture);
    out.generation.emplace_back(map.name, processor_seconds() - start);
    start = processor_seconds();
    map.corrected = cone_map_corrected(texture, map.plain);
    if (&map == &maps.front()) out.generation.emplace_back("3 × 3 correction", processor_seconds() - start);
    if (options.progress) options.progress(fmt::format("{}: {} made", name, map.name));
  }
  const double start = processor_seconds();
  const MaximumPyramid pyramid(texture);
  out.generation.emplace_back("maximum mipmap", processor_seconds() - start);

  std::vector<Variant> variants;
  for (const int most : {32, 200}) {
    for (const auto& [refinement, refines] :
         {std::pair("secant", ConeRefinement::kSecant), std::pair("7 bisections", ConeRefinement::kBisection)}) {
      for (const auto& [stepping, steps] :
           {std::pair("original", ConeStepping::kOriginal), std::pair("cell-max", ConeStepping::kCellMax)}) {
        for (const Map& map : maps) {
          for (const bool corrected : {false, true}) {
            const ConeMap& cones = corrected ? map.corrected : map.plain;
            variants.push_back({map.name, stepping, refinement, corrected, most,
                                [&texture, &cones, steps = steps, refines = refines, most](const TextureRay& ray) {
                                  return cone_trace(texture, cones, ray, steps, refines, most);
                                }});
          }
        }
      }
    }
    variants.push_back({"maximum mipmap", "Tevs", "bilinear patch", false, most,
                        [&pyramid, most](const TextureRay& ray) { return pyramid.trace(ray, true, most); }});
    variants.push_back({"maximum mipmap", "Drobot", "secant", false, most,
                        [&pyramid, most](const TextureRay& ray) { return pyramid.trace(ray, false, most); }});
    variants.push_back({"none", "linear search", "secant", false, most,
                        [&texture, most](const TextureRay& ray) { return linear_trace(texture, ray, most); }});
  }
  variants.push_back({"none", "linear search", "secant", false, 10000,
                      [&texture](const TextureRay& ray) { return linear_trace(texture, ray, 10000); }});
  variants.push_back({"none", "every cell", "bilinear patch", false, 0,
                      [&texture](const TextureRay& ray) { return exact_trace(texture, ray); }});
  const std::vector<TextureRay> rays = rays_of(options);
  measure(texture, rays, variants, options.rounds, &out.results);
  for (const Variant& v : variants) {
    // The paper's Figs. 1, 3 and 6.
    const bool is_shown = v.max_iterations == 200 && v.refinement == "secant" &&
                          ((v.map == "conservative" && v.stepping == "original" && !v.is_corrected) ||
                           (v.map == "approximate relaxed" && v.stepping == "original" && !v.is_corrected) ||
                           (v.map == "relaxed" && v.stepping == "cell-max" && v.is_corrected));
    if (is_shown) out.pictures.push_back(picture_of(texture, options, v));
  }
  return out;
}

std::string per_cent(double share) { return share > 0 ? fmt::format("{:.3g} %", 100 * share) : "0"; }

Table generation_table(const HeightfieldResults& results)
{
  Table table{
      "Making maps, milliseconds (the paper's Table 1)",
      fmt::format("{0} × {0} texels, one thread. The paper (512 × 512, a GPU): quadtree .1, maximum mipmap .08, "
                  "conservative 380, quick .35, approximate relaxed 592, relaxed 11.3.",
                  results.options.size),
      {"map"},
      {}};
  for (const HeightfieldTexture& texture : results.textures) table.header.push_back(texture.name);
  for (std::size_t k = 0; k < results.textures[0].generation.size(); ++k) {
    std::vector<std::string> row = {results.textures[0].generation[k].first};
    for (const HeightfieldTexture& texture : results.textures)
      row.push_back(fmt::format("{:.3g}", 1e3 * texture.generation[k].second));
    table.rows.push_back(row);
  }
  return table;
}

Table trace_table(const HeightfieldTexture& texture)
{
  Table table{
      fmt::format("Tracing {} (the paper's Table 2)", texture.name),
      "Nanoseconds of one thread a ray, steps a ray, and shares of rays that are off by more than a texel or used up "
      "their steps.",
      {"map", "corrected", "stepping", "refinement", "at most", "ns", "steps", "wrong", "given up"},
      {}};
  // Grouped as the paper's: by map, then by what is done with it. What a row shares with the one above is said once.
  std::vector<const HeightfieldResult*> rows;
  for (const HeightfieldResult& r : texture.results) rows.push_back(&r);
  const auto place = [&](const HeightfieldResult* r) {
    return std::find_if(rows.begin(), rows.end(), [&](const HeightfieldResult* other) { return other->map == r->map; });
  };
  std::vector<std::vector<const HeightfieldResult*>> groups;
  for (auto row = rows.begin(); row != rows.end(); ++row) {
    if (place(*row) != row) continue;
    std::vector<const HeightfieldResult*>& group = groups.emplace_back();
    std::copy_if(rows.begin(), rows.end(), std::back_inserter(group),
                 [&](const HeightfieldResult* r) { return r->map == (*row)->map; });
    std::stable_sort(group.begin(), group.end(), [](const HeightfieldResult* a, const HeightfieldResult* b) {
      return std::tie(a->is_corrected, a->stepping) < std::tie(b->is_corrected, b->stepping);
    });
  }
  for (const auto& group : groups) {
    const HeightfieldResult* above = nullptr;
    for (const HeightfieldResult* r : group) {
      const bool same_map = above != nullptr;
      const bool same_way = same_map && r->is_corrected == above->is_corrected && r->stepping == above->stepping;
      table.rows.push_back({same_map ? "" : r->map, same_way || !r->is_corrected ? "" : "yes", same_way ? "" : r->stepping,
                            r->refinement, r->max_iterations > 0 ? std::to_string(r->max_iterations) : "–",
                            fmt::format("{:.0f}", r->nanoseconds), fmt::format("{:.3g}", r->steps), per_cent(r->wrong),
                            per_cent(r->unconverged)});
      above = r;
    }
  }
  return table;
}

std::string conditions(const HeightfieldResults& results)
{
  return fmt::format(
      "{} rays from above over a texture of {} × {} texels that repeats, {} high in lengths of the texture; {} × {} "
      "pixels. "
      "Processor time of one thread, all variants in turns, fastest of {} rounds. What is right is every cell's "
      "bilinear patch.{}",
      results.num_rays, results.options.size, results.options.size, kDepth, results.options.width,
      results.options.height, results.options.rounds,
      results.options.maps.empty() ? "" : " Maps of files: means of their texels, over the whole range of heights.");
}

}  // namespace

std::vector<std::string> bench_heightfield_cones()
{
  std::vector<std::string> names;
  for (const auto& [cone, make] : kConeMaps) names.push_back(option_name(cone));
  return names;
}

HeightfieldResults bench_heightfield_run(const HeightfieldOptions& options)
{
  HeightfieldResults results;
  results.options = options;
  results.num_rays = rays_of(options).size();
  // All of them first: a file that cannot be read is known at once.
  std::vector<std::pair<std::string, HeightTexture>> textures = {
      {"impulses", impulses(options.size)},
      {"rock", texture_of(BenchMap::kRock, options.size)},
      {"panels", texture_of(BenchMap::kPanels, options.size)}};
  for (const std::string& file : options.maps) {
    textures.emplace_back(std::filesystem::path(file).stem().string(), height_texture_load(file, options.size));
  }
  for (const auto& [name, texture] : textures) results.textures.push_back(study(name, texture, options));
  return results;
}

std::string bench_heightfield_markdown(const HeightfieldResults& results)
{
  std::string text =
      "# relief bench heightfield\n\n" + conditions(results) + "\n\n" + markdown(generation_table(results));
  for (const HeightfieldTexture& texture : results.textures) text += markdown(trace_table(texture));
  return text;
}

std::string bench_heightfield_json(const HeightfieldResults& results)
{
  nlohmann::ordered_json textures = nlohmann::ordered_json::array();
  for (const HeightfieldTexture& texture : results.textures) {
    nlohmann::ordered_json generation, traced = nlohmann::ordered_json::array();
    for (const auto& [map, seconds] : texture.generation) generation[map] = seconds;
    for (const HeightfieldResult& r : texture.results) {
      traced.push_back({{"map", r.map},
                        {"corrected", r.is_corrected},
                        {"stepping", r.stepping},
                        {"refinement", r.refinement},
                        {"max_iterations", r.max_iterations},
                        {"nanoseconds_a_ray", r.nanoseconds},
                        {"steps", r.steps},
                        {"wrong", r.wrong},
                        {"unconverged", r.unconverged}});
    }
    textures.push_back({{"texture", texture.name}, {"generation_seconds", generation}, {"traced", traced}});
  }
  const nlohmann::ordered_json json = {{"bench", "heightfield"},
                                       {"version", RELIEF_VERSION},
                                       {"size", results.options.size},
                                       {"resolution", {results.options.width, results.options.height}},
                                       {"rounds", results.options.rounds},
                                       {"rays", results.num_rays},
                                       {"textures", textures}};
  return json.dump(2) + "\n";
}

std::string bench_heightfield_html(const HeightfieldResults& results)
{
  std::vector<std::string> pieces = {html_paragraph(conditions(results)), html(generation_table(results))};
  for (const HeightfieldTexture& texture : results.textures) {
    pieces.push_back(html_heading(texture.name, 2));
    std::vector<std::string> pictures;
    for (const HeightfieldPicture& picture : texture.pictures)
      pictures.push_back(html_picture(picture.width, picture.height, picture.rgb, picture.caption, 1));
    pieces.push_back(html_row(pictures));
    pieces.push_back(html(trace_table(texture)));
  }
  return html_page("Height fields: cone maps side by side", pieces);
}

}  // namespace relief
