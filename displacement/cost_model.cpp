#include "displacement/cost_model.h"

#include <cmath>
#include <cstdio>

namespace relief {

double method_seconds(const MethodCost& cost, std::uint64_t num_micro_triangles, double num_rays)
{
  constexpr double kNanosecond = 1e-9, kMillion = 1 << 20;
  if (num_micro_triangles == 0) return kNanosecond * cost.ray * num_rays;
  const auto count = static_cast<double>(num_micro_triangles);
  // Small trees are in the cache from a point on; a ray always costs something.
  const double doublings = std::log2(count / kMillion);
  const double ray = std::fmax(cost.ray + cost.ray_doubling * doublings, 0.25 * cost.ray);
  return kNanosecond * (ray * num_rays + cost.build * count);
}

DisplacementChoice displacement_choose(std::span<const MethodOffer> offers,
                                       double num_rays,
                                       std::uint64_t allowance_bytes)
{
  DisplacementChoice best;
  double best_seconds = 0;
  for (const MethodOffer& offer : offers) {
    const double seconds = method_seconds(offer.cost, offer.num_micro_triangles, num_rays) + offer.preparation_seconds;
    char text[96];
    std::snprintf(text, sizeof text, "%.2g s by %s", seconds, displacement_method_label(offer.method).data());
    std::string said = text;
    if (offer.num_micro_triangles > 0) {
      std::snprintf(text, sizeof text, " (%.0f MiB)", static_cast<double>(offer.bytes) / (1 << 20));
      said += text;
    }
    const bool fits = offer.bytes <= allowance_bytes;
    if (!fits) said += ", too large";
    if (best.reason.empty()) {
      best = {offer.method, said};
      best_seconds = seconds;
    } else if (fits && seconds < best_seconds) {
      best = {offer.method, said + " against " + best.reason};
      best_seconds = seconds;
    } else {
      best.reason += " against " + said;
    }
  }
  return best;
}

}  // namespace relief
