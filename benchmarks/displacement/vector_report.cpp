#include "benchmarks/displacement/vector_report.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace relief {

namespace {

std::string mebibytes(std::size_t bytes) { return fmt::format("{:.4g}", static_cast<double>(bytes) / (1 << 20)); }

}  // namespace

Table vector_table(const VectorResult& scene)
{
  Table table{
      fmt::format("{}, moved by vectors ({} triangles, divided into {:.3g} million)", scene.name,
                  scene.num_base_triangles, 1e-6 * static_cast<double>(scene.num_triangles)),
      fmt::format(
          "Rays: {} primary, {} bounce, {} shadow. Two disagree about a ray if only one hits or t differs by more than "
          "{:.2g} m. First ray: processor seconds until it can be traced, all threads.",
          scene.num_rays[0], scene.num_rays[1], scene.num_rays[2], scene.tolerance),
      {"method", "MiB", "most MiB", "first ray, s"},
      {}};
  for (const char* what : {"Mrays/s", "disagree"}) {
    for (const std::string_view kind : kBenchRayKindNames) table.header.push_back(fmt::format("{} {}", kind, what));
  }
  for (const VectorMethodResult& method : scene.methods) {
    std::vector<std::string> row = {method.name, mebibytes(method.bytes), mebibytes(method.peak_bytes),
                                    fmt::format("{:.3g}", method.first_seconds)};
    for (const Measurement& m : method.of_kind)
      row.push_back(m.nanoseconds > 0 ? fmt::format("{:.3g}", 1e3 / m.nanoseconds) : "–");
    for (const Measurement& m : method.of_kind)
      row.push_back(m.disagreement > 0 ? fmt::format("{:.2g} %", 100 * m.disagreement) : "0");
    table.rows.push_back(std::move(row));
  }
  return table;
}

nlohmann::ordered_json vector_json(std::span<const VectorResult> scenes)
{
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const VectorResult& scene : scenes) {
    nlohmann::ordered_json methods = nlohmann::ordered_json::array();
    for (const VectorMethodResult& method : scene.methods) {
      nlohmann::ordered_json rays;
      for (std::size_t k = 0; k < method.of_kind.size(); ++k) {
        const Measurement& m = method.of_kind[k];
        rays[std::string(kBenchRayKindNames[k])] = {
            {"nanoseconds", m.nanoseconds}, {"hit_share", m.hit_share}, {"disagreement", m.disagreement}};
      }
      methods.push_back({{"name", method.name},
                         {"bytes", method.bytes},
                         {"peak_bytes", method.peak_bytes},
                         {"first_seconds", method.first_seconds},
                         {"rays", rays}});
    }
    json.push_back({{"name", scene.name},
                    {"base_triangles", scene.num_base_triangles},
                    {"triangles", scene.num_triangles},
                    {"num_rays", scene.num_rays},
                    {"methods", methods}});
  }
  return json;
}

}  // namespace relief
