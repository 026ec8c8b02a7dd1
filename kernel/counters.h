// Event counters: one plain struct, a copy a thread, summed at the end. Field names are the JSON keys of --stats.
#pragma once

#include <cstdint>

namespace relief {

// clang-format off
#define RELIEF_COUNTERS(X) \
  X(camera_rays) X(bounce_rays) X(shadow_rays) X(surface_hits) X(background_hits) \
  X(transparent_hits) X(graph_runs) X(graph_points) X(nonfinite_samples) X(photon_paths) X(photon_rays) X(endless_paths) \
  X(displaced_prisms) X(displaced_bounds) X(displaced_texels) X(displaced_inversions)
// clang-format on

struct Counters {
#define X(name) std::uint64_t name = 0;
  RELIEF_COUNTERS(X)
#undef X
};

inline void counters_add(Counters& total, const Counters& part)
{
#define X(name) total.name += part.name;
  RELIEF_COUNTERS(X)
#undef X
}

}  // namespace relief
