// What a render reports about itself, filled by the integrator and the command line, written by exporters.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "kernel/counters.h"

namespace relief {

struct StageSeconds {
  std::string name;
  double seconds = 0;  ///< summed over threads
};

/// Displaced meshes; what their rays cost is in the counters.
struct DisplacementStatistics {
  std::string method;                ///< of all geometries, separated by commas; empty: nothing is displaced
  std::uint64_t num_geometries = 0;  ///< pairs of a mesh and a displacement
  std::uint64_t num_prisms = 0;      ///< base triangles of all geometries
  std::uint64_t bytes = 0;           ///< tables and prepared triangles, besides the maps
  std::uint64_t map_bytes = 0;
  std::uint64_t most_steps = 0;      ///< bounds and texels tested for a single ray
  /// Tiles of points that rays asked for: how often one was made, how often that took the room of another, and what they take.
  std::uint64_t tiles_made = 0, tiles_evicted = 0, tile_bytes = 0;
  std::vector<std::string> reasons;  ///< for what `auto` chose, a line a geometry that it weighed tessellations for
};

/// The photon pass; all 0 where there is none.
struct CausticStatistics {
  std::string reason;         ///< why there is a pass, or none
  std::uint64_t photons = 0;  ///< started, of all passes
  std::uint64_t stored = 0;   ///< kept
  std::uint64_t passes = 0, num_sources = 0, bytes = 0;
  double first_radius = 0, radius = 0;  ///< typical, in the first and the last pass, metres
  double seconds = 0;
  /// What decided by benefit: squared error of paths alone over that with photons, and cost of a sample with photons over that of
  /// one without; 0 where nothing was measured.
  double error_ratio = 0, cost_ratio = 0;
};

/// What frames before had made already.
struct KeptStatistics {
  std::uint64_t images = 0;         ///< textures and height maps
  std::uint64_t height_fields = 0;  ///< levels of height maps with their bounds and tables
  std::uint64_t meshes = 0;         ///< that have trees or prisms of their own
  bool scene = false;               ///< all that was loaded: the counts of the others are 0 then
  bool preparation = false;         ///< all that was built of the scene, likewise
  std::uint64_t bytes = 0;          ///< of all that
  double seconds = 0;               ///< that making them took, summed over those made side by side
};

/// How wrong a picture was at some time of its rendering.
struct ErrorPoint {
  double seconds = 0;                                      ///< of sampling
  double samples = 0;                                      ///< a pixel, in the mean
  double rmse = 0, relmse = 0;                             ///< estimated as Statistics::error_rmse and error_relmse
  std::optional<double> reference_rmse, reference_relmse;  ///< against a picture that it is compared with
};

/// One sample of a pixel; x and y in the whole image.
struct PixelSample {
  int x = 0, y = 0;
  std::uint32_t sample_index = 0;
};

struct Statistics {
  std::string scene, version, isa, view;
  std::uint64_t seed = 0;
  int width = 0, height = 0, threads = 0, frame = 0;
  double load_seconds = 0, build_seconds = 0, render_seconds = 0;
  double samples_per_pixel = 0;
  double error_rmse = 0;    ///< estimated root mean square error of the beauty image, from its halves and quarters
  double error_relmse = 0;  ///< likewise, squared error relative to (radiance² + 0.01), as `relief compare` defines it
  std::vector<ErrorPoint> errors;  ///< each time that the samples had doubled, and at the end
  std::uint64_t peak_memory_bytes = 0, bvh_bytes = 0, mesh_bytes = 0, texture_bytes = 0, light_bytes = 0,
                film_bytes = 0, path_state_bytes = 0;
  DisplacementStatistics displacement;
  CausticStatistics caustics;
  KeptStatistics kept;
  Counters counters;
  std::vector<StageSeconds> stages;
  /// Of the samples that were dropped because they were not finite, the first in the picture's order.
  std::optional<PixelSample> first_nonfinite;
  std::vector<std::string> warnings;
  std::vector<std::pair<std::string, std::string>> settings;  ///< names, and values as JSON
  std::string stop_reason;  ///< "samples", "noise_threshold", "time_limit", "interrupted"
};

}  // namespace relief
