#include "integrator/displacement_cost.h"

#include <cmath>
#include <cstdio>

namespace relief {

namespace {

constexpr double kNanosecond = 1e-9;
constexpr double kMillion = 1 << 20;

std::string text_of(const char* name, double seconds, std::uint64_t bytes)
{
  char text[96];
  std::snprintf(text, sizeof text, "%.2g s by %s (%.0f MiB)", seconds, name, static_cast<double>(bytes) / (1 << 20));
  return text;
}

}  // namespace

double expected_rays(const RenderSettings& settings)
{
  // Of camera, bounces and shadows: what the example scenes have.
  constexpr double kRaysPerSample = 4;
  return kRaysPerSample * settings.samples * static_cast<double>(settings.width) * settings.height;
}

double exact_seconds(const DisplacementCosts& costs, double num_rays)
{
  return kNanosecond * costs.exact_ray * num_rays;
}

double tessellation_seconds(const TessellationCost& cost, std::uint64_t num_micro_triangles, double num_rays)
{
  const auto count = static_cast<double>(num_micro_triangles);
  // Small trees are in the cache from a point on; a ray always costs something.
  const double doublings = std::log2(std::fmax(count, 1.0) / kMillion);
  const double ray = std::fmax(cost.ray + cost.ray_doubling * doublings, 0.25 * cost.ray);
  return kNanosecond * (ray * num_rays + cost.build * count);
}

DisplacementChoice displacement_choose(const DisplacementCosts& costs,
                                       const TessellationLayout& triangles,
                                       const TessellationLayout& grids,
                                       double num_rays,
                                       std::uint64_t allowance_bytes)
{
  DisplacementChoice best;
  double best_seconds = exact_seconds(costs, num_rays);
  char text[64];
  std::snprintf(text, sizeof text, "%.2g s by chord", best_seconds);
  best.reason = text;
  const auto offer = [&](const char* name, const TessellationCost& cost, const TessellationLayout& layout) {
    const double seconds = tessellation_seconds(cost, layout.num_micro_triangles, num_rays);
    const std::uint64_t bytes = tessellation_peak_bytes(layout, kRenderTessellation);
    const bool fits = bytes <= allowance_bytes;
    const std::string other = text_of(name, seconds, bytes) + (fits ? "" : ", too large");
    if (fits && seconds < best_seconds) {
      best = {true, layout.kind, other + " against " + best.reason};
      best_seconds = seconds;
    } else {
      best.reason += " against " + other;
    }
  };
  offer("tessellate", costs.triangles, triangles);
  offer("tessellate-grid", costs.grids, grids);
  return best;
}

}  // namespace relief
