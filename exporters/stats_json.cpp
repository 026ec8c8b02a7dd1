#include "exporters/stats_json.h"

#include <nlohmann/json.hpp>

namespace relief {

std::string stats_json(const Statistics& statistics)
{
  const Statistics& s = statistics;
  const std::uint64_t num_rays = s.counters.camera_rays + s.counters.bounce_rays + s.counters.shadow_rays;
  nlohmann::ordered_json counters;
#define X(name) counters[#name] = s.counters.name;
  RELIEF_COUNTERS(X)
#undef X
  nlohmann::ordered_json stages = nlohmann::ordered_json::object();
  for (const StageSeconds& stage : s.stages) {
    stages[stage.name] = stage.seconds;
  }
  nlohmann::ordered_json displacement;  // null where nothing is displaced
  if (!s.displacement.method.empty()) {
    const auto a_ray = [&](std::uint64_t count) {
      return num_rays > 0 ? static_cast<double>(count) / static_cast<double>(num_rays) : 0.0;
    };
    displacement = {{"method", s.displacement.method},
                    {"geometries", s.displacement.num_geometries},
                    {"prisms", s.displacement.num_prisms},
                    {"bytes", s.displacement.bytes},
                    {"map_bytes", s.displacement.map_bytes},
                    {"steps_mean", a_ray(s.counters.displaced_bounds + s.counters.displaced_texels)},
                    {"steps_max", s.displacement.most_steps},
                    {"texels_mean", a_ray(s.counters.displaced_texels)},
                    {"prisms_per_ray", a_ray(s.counters.displaced_prisms)},
                    {"tiles_made", s.displacement.tiles_made},
                    {"tiles_evicted", s.displacement.tiles_evicted},
                    {"tile_bytes", s.displacement.tile_bytes},
                    {"reasons", s.displacement.reasons}};
  }
  nlohmann::ordered_json errors = nlohmann::ordered_json::array();
  for (const ErrorPoint& point : s.errors) {
    errors.push_back(
        {{"seconds", point.seconds}, {"samples", point.samples}, {"rmse", point.rmse}, {"relmse", point.relmse}});
    if (point.reference_rmse) errors.back()["reference_rmse"] = *point.reference_rmse;
    if (point.reference_relmse) errors.back()["reference_relmse"] = *point.reference_relmse;
  }
  nlohmann::ordered_json settings = nlohmann::ordered_json::object();
  for (const auto& [name, value] : s.settings) settings[name] = nlohmann::ordered_json::parse(value);
  nlohmann::ordered_json caustics = {{"reason", s.caustics.reason},
                                     {"photons", s.caustics.photons},
                                     {"stored", s.caustics.stored},
                                     {"passes", s.caustics.passes},
                                     {"first_radius", s.caustics.first_radius},
                                     {"radius", s.caustics.radius},
                                     {"seconds", s.caustics.seconds},
                                     {"bytes", s.caustics.bytes},
                                     {"sources", s.caustics.num_sources},
                                     {"error_ratio", s.caustics.error_ratio},
                                     {"cost_ratio", s.caustics.cost_ratio}};
  const nlohmann::ordered_json json = {
      {"scene", s.scene},
      {"version", s.version},
      {"isa", s.isa},
      {"view", s.view},
      {"seed", s.seed},
      {"frame", s.frame},
      {"width", s.width},
      {"height", s.height},
      {"threads", s.threads},
      {"load_seconds", s.load_seconds},
      {"build_seconds", s.build_seconds},
      {"render_seconds", s.render_seconds},
      {"kept",
       {{"images", s.kept.images},
        {"height_fields", s.kept.height_fields},
        {"meshes", s.kept.meshes},
        {"scene", s.kept.scene},
        {"preparation", s.kept.preparation},
        {"bytes", s.kept.bytes},
        {"seconds", s.kept.seconds}}},
      {"samples_per_pixel", s.samples_per_pixel},
      {"error_rmse", s.error_rmse},
      {"error_relmse", s.error_relmse},
      {"errors", errors},
      {"stop_reason", s.stop_reason},
      {"rays",
       {{"camera", s.counters.camera_rays},
        {"bounce", s.counters.bounce_rays},
        {"shadow", s.counters.shadow_rays},
        {"total", num_rays}}},
      {"rays_per_second", s.render_seconds > 0 ? static_cast<double>(num_rays) / s.render_seconds : 0.0},
      {"peak_memory_bytes", s.peak_memory_bytes},
      {"bvh_bytes", s.bvh_bytes},
      {"mesh_bytes", s.mesh_bytes},
      {"texture_bytes", s.texture_bytes},
      {"light_bytes", s.light_bytes},
      {"film_bytes", s.film_bytes},
      {"path_state_bytes", s.path_state_bytes},
      {"displacement", displacement},
      {"caustics", caustics},
      {"counters", counters},
      {"stage_seconds", stages},
      {"settings", settings},
      {"warnings", s.warnings},
  };
  // A scene's path may hold bytes that are not UTF-8; they must not cost a finished render its statistics.
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace relief
