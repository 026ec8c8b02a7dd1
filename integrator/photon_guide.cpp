#include "integrator/photon_guide.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace relief {

namespace {

/// Cell of a point, by a hash: in the few cells that share one, more light is taken to be seen than is.
std::uint64_t cell_of(Vec3f P, float inverse_cell)
{
  const auto bits = [&](float x) { return std::uint64_t{static_cast<std::uint32_t>(photon_cell(x, inverse_cell))}; };
  return bits(P.x) * 0x9e3779b97f4a7c15u ^ bits(P.y) * 0xc2b2ae3d27d4eb4fu ^ bits(P.z) * 0x165667b19e3779f9u;
}

}  // namespace

double photon_sources_guide(PhotonSources& sources,
                            const std::vector<std::size_t>& groups,
                            const std::vector<std::vector<Photon>>& photons,
                            const std::vector<Vec3f>& looks,
                            float radius)
{
  // With less, a camera that moves would change the pattern of photons for little.
  constexpr double kWorthwhile = 2;
  constexpr double kGuided = 0.5;  // of all photons
  if (!(radius > 0)) return 1;
  const float inverse_cell = 0.5f / radius;
  std::unordered_map<std::uint64_t, double> seen;
  for (const Vec3f P : looks) seen[cell_of(P, inverse_cell)] += 1;

  // By each half of the photons: the square of what few of them bring would tell of differences that are but noise.
  struct Halves {
    double of[2] = {0, 0};
  };
  std::vector<Halves> brought(photons.size());
  Halves sum;
  for (std::size_t j = 0; j < photons.size(); ++j) {
    for (std::size_t i = 0; i < photons[j].size(); ++i) {
      const auto place = seen.find(cell_of(photons[j][i].P, inverse_cell));
      if (place == seen.end()) continue;
      const double light = static_cast<double>(light_scalar(photons[j][i].arrival.power)) * place->second;
      brought[j].of[i & 1u] += light;
      sum.of[i & 1u] += light;
    }
  }
  if (!(sum.of[0] > 0 && sum.of[1] > 0)) return 1;
  // By the root of what a group brings times its power: photons of the faint ones would otherwise be few and bright.
  std::vector<double> roots;
  double denser = 1 - kGuided, sum_of_roots = 0;
  for (std::size_t j = 0; j < photons.size(); ++j) {
    const double chance = sources.cdf[groups[j + 1]] - sources.cdf[groups[j]];
    roots.push_back(std::sqrt(chance * (brought[j].of[0] + brought[j].of[1])));
    sum_of_roots += roots.back();
  }
  for (std::size_t j = 0; j < photons.size(); ++j) {
    const double chance = sources.cdf[groups[j + 1]] - sources.cdf[groups[j]];
    // The light that both halves of the photons tell of.
    const double light = std::sqrt((brought[j].of[0] / sum.of[0]) * (brought[j].of[1] / sum.of[1]));
    if (chance > 0) denser += kGuided * light * roots[j] / sum_of_roots / chance;
  }
  if (!(denser > kWorthwhile)) return 1;
  std::vector<double> cdf{0};
  for (std::size_t j = 0; j < photons.size(); ++j) {
    const double chance = sources.cdf[groups[j + 1]] - sources.cdf[groups[j]];
    const double guided = chance > 0 ? 1 - kGuided + kGuided * roots[j] / sum_of_roots / chance : 0.0;
    for (std::size_t s = groups[j]; s < groups[j + 1]; ++s) {
      cdf.push_back(cdf.back() + guided * (sources.cdf[s + 1] - sources.cdf[s]));
    }
  }
  for (double& entry : cdf) entry /= cdf.back();
  sources.cdf = std::move(cdf);
  // What is won is shared between sharpness and noise.
  constexpr double kMostWithin = 120;
  sources.within = std::min(sources.within * denser, kMostWithin);
  return denser;
}

}  // namespace relief
