#include "exporters/stats_json.h"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

namespace relief {

TEST(StatsJson, HasEveryKeyThatProgramsReadAndEveryCounter)
{
  Statistics statistics;
  statistics.load_seconds = 1;
  statistics.build_seconds = 2;
  statistics.render_seconds = 4;
  statistics.samples_per_pixel = 16;
  statistics.peak_memory_bytes = 123;
  statistics.counters.camera_rays = 100;
  statistics.counters.bounce_rays = 200;
  statistics.counters.shadow_rays = 300;
  statistics.stages = {{"shade_surface", 1.5}};
  statistics.warnings = {"a", "b"};
  statistics.kept = {3, 2, 7, true, false, 400, 5};
  const nlohmann::json json = nlohmann::json::parse(stats_json(statistics));
  EXPECT_EQ(json["load_seconds"], 1);
  EXPECT_EQ(json["build_seconds"], 2);
  EXPECT_EQ(json["render_seconds"], 4);
  EXPECT_EQ(json["samples_per_pixel"], 16);
  const nlohmann::json kept{{"images", 3},          {"height_fields", 2}, {"meshes", 7},   {"scene", true},
                            {"preparation", false}, {"bytes", 400},       {"seconds", 5.0}};
  EXPECT_EQ(json["kept"], kept);
  EXPECT_EQ(json["peak_memory_bytes"], 123);
  EXPECT_EQ(json["rays"]["camera"], 100);
  EXPECT_EQ(json["rays"]["bounce"], 200);
  EXPECT_EQ(json["rays"]["shadow"], 300);
  EXPECT_EQ(json["rays"]["total"], 600);
  EXPECT_EQ(json["rays_per_second"], 150);
  EXPECT_EQ(json["stage_seconds"]["shade_surface"], 1.5);
  EXPECT_EQ(json["warnings"], (std::vector<std::string>{"a", "b"}));
#define X(name) EXPECT_TRUE(json["counters"].contains(#name));
  RELIEF_COUNTERS(X)
#undef X
}

TEST(StatsJson, DisplacementIsCountedARay)
{
  Statistics statistics;
  EXPECT_TRUE(nlohmann::json::parse(stats_json(statistics)).at("displacement").is_null());
  statistics.displacement = {"chord, rmip", 2, 900, 5000, 4096, 77, 9, 4, 640, {"mesh 'a': 2 s by chord"}};
  statistics.counters.camera_rays = 3;
  statistics.counters.bounce_rays = 2;
  statistics.counters.shadow_rays = 5;
  statistics.counters.displaced_bounds = 40;
  statistics.counters.displaced_texels = 10;
  statistics.counters.displaced_prisms = 15;
  const nlohmann::json expected = {{"method", "chord, rmip"},
                                   {"geometries", 2},
                                   {"prisms", 900},
                                   {"bytes", 5000},
                                   {"map_bytes", 4096},
                                   {"steps_mean", 5.0},
                                   {"steps_max", 77},
                                   {"texels_mean", 1.0},
                                   {"prisms_per_ray", 1.5},
                                   {"tiles_made", 9},
                                   {"tiles_evicted", 4},
                                   {"tile_bytes", 640},
                                   {"reasons", {"mesh 'a': 2 s by chord"}}};
  EXPECT_EQ(nlohmann::json::parse(stats_json(statistics)).at("displacement"), expected);
}

TEST(StatsJson, KeepsLargeSeedsAndSurvivesWhatJsonCannotSay)
{
  Statistics statistics;
  statistics.seed = std::numeric_limits<std::uint64_t>::max();
  statistics.error_rmse = std::numeric_limits<double>::quiet_NaN();
  statistics.scene = "latin-1 \xe9.glb";
  const nlohmann::json json = nlohmann::json::parse(stats_json(statistics));
  EXPECT_EQ(json["seed"].get<std::uint64_t>(), statistics.seed);
  EXPECT_TRUE(json["error_rmse"].is_null());
  EXPECT_EQ(json["rays_per_second"], 0);
}

}  // namespace relief
