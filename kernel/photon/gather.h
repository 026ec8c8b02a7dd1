// Density of photons around a point.
#pragma once

#include "kernel/photon/photon.h"
#include "kernel/sample/sobol.h"

namespace relief {

/// Irradiance that photons bring, and one direction it comes from, chosen among theirs in proportion to power.
/// E[irradiance · f(wi)] is the sum over all photons, so one evaluation of a BSDF does for all of them.
struct PhotonGather {
  Vec3f irradiance{};  ///< W/m² on the surface
  Vec3f wi{};          ///< unit, towards the light
};

/// Whom a search wants.
struct PhotonQuery {
  Vec3f P, Ng;                ///< world; unit geometric normal on the side of wo
  bool both_sides = false;    ///< light from below passes through to wo
  std::uint32_t bounces = 0;  ///< packed as the path state's: what a photon's may not exceed
  std::uint32_t hash = 0;     ///< chooses
};

/// Whether none of the four counts of `a` exceeds that of `b`.
RELIEF_KERNEL bool photon_bounces_allowed(std::uint32_t a, std::uint32_t b)
{
  // A borrow out of a byte shows in the top bit of its difference: counts are below 128.
  return (((b | 0x80808080u) - a) & 0x80808080u) == 0x80808080u;
}

/// Searches a map. The kernel is Epanechnikov's, K(r) = 2 (1 − r²/R²) / (π R²): the one of least mean squared error, and
/// without the edge that a constant one draws around single photons.
///
/// Photons on other surfaces that happen to be near are left out: those on planes tilted by more than 75°, those more than
/// half a radius off the plane, and on opaque surfaces those from below.
/// @cost   8 cells, about three distances a photon found, of which the compiler makes SIMD
RELIEF_KERNEL PhotonGather photon_gather(const PhotonMapView& map, const PhotonQuery& query)
{
  PhotonGather gather;
  const float radius = map.radius;
  const float radius_squared = sqr(radius);
  const float inverse_radius_squared = 1.0f / radius_squared;
  const float inverse_cell = 0.5f / radius;
  const std::int32_t x0 = photon_cell(query.P.x - radius, inverse_cell);
  const std::int32_t y0 = photon_cell(query.P.y - radius, inverse_cell);
  const std::int32_t z0 = photon_cell(query.P.z - radius, inverse_cell);
  // Two cells are as wide as a search; where coordinates hardly resolve the radius, rounding would make it three or four.
  const std::int32_t x1 = x0 + (photon_cell(query.P.x + radius, inverse_cell) > x0 ? 1 : 0);
  const std::int32_t y1 = y0 + (photon_cell(query.P.y + radius, inverse_cell) > y0 ? 1 : 0);
  const std::int32_t z1 = z0 + (photon_cell(query.P.z + radius, inverse_cell) > z0 ? 1 : 0);
  float sum = 0.0f;
  std::uint32_t random = query.hash | 1u;
  const PhotonArrival* chosen = nullptr;
  std::uint32_t seen[8];
  int num_seen = 0;
  for (std::int32_t z = z0; z <= z1; ++z) {
    for (std::int32_t y = y0; y <= y1; ++y) {
      for (std::int32_t x = x0; x <= x1; ++x) {
        const std::uint32_t bucket = (photon_row(y, z) + static_cast<std::uint32_t>(x)) & map.bucket_mask;
        // Two cells may share a bucket, and be handed out once all the same.
        bool again = false;
        for (int i = 0; i < num_seen; ++i) again |= seen[i] == bucket;
        if (again) continue;
        seen[num_seen++] = bucket;
        const std::uint32_t end = map.bucket_begin[bucket + 1];
        for (std::uint32_t first = map.bucket_begin[bucket]; first < end; first += 8) {
          const std::uint32_t count = end - first < 8 ? end - first : 8;
          float distance_squared[8];
          for (std::uint32_t k = 0; k < 8; ++k) {
            const std::uint32_t i = first + (k < count ? k : count - 1);
            distance_squared[k] = sqr(map.x[i] - query.P.x) + sqr(map.y[i] - query.P.y) + sqr(map.z[i] - query.P.z);
          }
          for (std::uint32_t k = 0; k < count; ++k) {
            if (!(distance_squared[k] < radius_squared)) continue;
            const PhotonArrival& photon = map.arrivals[first + k];
            const Vec3f offset{map.x[first + k] - query.P.x, map.y[first + k] - query.P.y,
                               map.z[first + k] - query.P.z};
            if (!photon_bounces_allowed(photon.bounces, query.bounces)) continue;
            constexpr float kLeastCosine = 0.26f;
            constexpr float kThickness = 0.5f;
            if (__builtin_fabsf(dot(octahedral_decode(photon.Ng), query.Ng)) < kLeastCosine) continue;
            if (__builtin_fabsf(dot(offset, query.Ng)) > kThickness * radius) continue;
            if (!query.both_sides && dot(octahedral_decode(photon.wi), query.Ng) <= 0.0f) continue;
            const float weight = (1.0f - distance_squared[k] * inverse_radius_squared) * max_component(photon.power);
            if (!(weight > 0.0f)) continue;
            sum += weight;
            // xorshift32 (Marsaglia 2003): which photon stands for all needs no stratification.
            random ^= random << 13;
            random ^= random >> 17;
            random ^= random << 5;
            if (unit_float(random) * sum < weight) chosen = &photon;
          }
        }
      }
    }
  }
  if (chosen == nullptr) return gather;
  gather.wi = octahedral_decode(chosen->wi);
  gather.irradiance = chosen->power * (sum / max_component(chosen->power) * (2.0f * kInvPi * inverse_radius_squared));
  return gather;
}

}  // namespace relief
