// Density of photons around a point.
#pragma once

#include "kernel/bsdf/dielectric.h"
#include "kernel/bsdf/thin_wall.h"
#include "kernel/photon/photon.h"
#include "kernel/sample/sobol.h"

namespace relief {

/// Irradiance that photons bring, and one direction it comes from, chosen among theirs in proportion to power and to what
/// a narrow lobe makes of it, if there is one. E[irradiance · f(wi)] is the sum over all photons, so one evaluation of a BSDF
/// does for all of them.
struct PhotonGather {
  Vec3f irradiance{};         ///< W/m² on the surface, as if all photons were as likely as the one chosen
  Vec3f wi{};                 ///< unit, towards the light
  std::uint32_t bounces = 0;  ///< its, see PhotonArrival
};

/// Directions of a rough caster from which light is photons', those where the density of paths that it scatters is less than
/// this, 1/sr: there paths find small lamps too seldom, and elsewhere single photons are too bright. On
/// benchmarks/caustics' `rough` 2 to 5 leave the least error, 1 a sixth more, 10 a tenth and 20 two thirds.
inline constexpr float kTailDensity = 4.0f;

/// A lobe of microfacets that shows photons, as far as choosing one asks for it.
struct PhotonLobe {
  float alpha = 0;  ///< 0: all directions are alike
  float eta = 0;    ///< of solid glass, far side over wo's; 0: light is reflected, or passes a thin wall
  Frame frame{};    ///< normal on wo's side
  Vec3f wo{};       ///< in the frame
  float most = 0;   ///< density of the lobe from which on photons are not wanted
};

/// Whom a search wants.
struct PhotonQuery {
  Vec3f P, Ng;                ///< world; unit geometric normal on the side of wo
  bool both_sides = false;    ///< light from below passes through to wo
  std::uint32_t bounces = 0;  ///< packed as the path state's: what a photon's may not exceed
  std::uint32_t hash = 0;     ///< chooses
  PhotonLobe lobe;            ///< what it makes of a photon's direction counts in the choice
};

/// What a photon's direction is worth to a query, up to a factor; never zero, since there may be other lobes. Towards the
/// lobe's peak it falls again: those photons are chosen in vain.
/// @param wi  unit, world
RELIEF_KERNEL float photon_lobe(const PhotonLobe& lobe, Vec3f wi)
{
  if (!(lobe.alpha > 0.0f)) return 1.0f;
  constexpr float kOthers = 0.01f;
  const Vec3f w = to_local(lobe.frame, wi);
  if (!(__builtin_fabsf(w.z) > kMinCosine)) return kOthers;
  DielectricEval e;
  if (lobe.eta > 0.0f) {
    e = dielectric_eval(lobe.wo, w, lobe.alpha, lobe.eta);
  } else {
    const GgxReflection r = ggx_reflection_eval(lobe.wo, w.z > 0.0f ? w : thin_wall_mirror(w), lobe.alpha);
    e = {r.f, r.pdf};
  }
  return kOthers + (e.pdf > lobe.most ? e.f * sqr(lobe.most / e.pdf) : e.f);
}

/// Whether none of the four counts of `a` exceeds that of `b`.
RELIEF_KERNEL bool photon_bounces_allowed(std::uint32_t a, std::uint32_t b)
{
  // A borrow out of a byte shows in the top bit of its difference: counts are below 128.
  return (((b | 0x80808080u) - a) & 0x80808080u) == 0x80808080u;
}

/// Searches a map for the photons that have a point within their radius R. The kernel is Epanechnikov's,
/// K(r) = 2 (1 − r²/R²) / (π R²): the one of least mean squared error, and without the edge that a constant one draws
/// around single photons. As R is the photon's, its light is spread, and neither lost nor made (Silverman 1986, §5.3).
///
/// Photons on other surfaces that happen to be near are left out: those on planes tilted by more than 75°, those more than
/// half a radius off the plane, and on opaque surfaces those from below.
/// @cost   a byte where no photon can be near; 4 rows of cells an octave of radii that reaches there; about three distances a
///         photon found, of which the compiler makes SIMD
RELIEF_KERNEL PhotonGather photon_gather(const PhotonMapView& map, const PhotonQuery& query)
{
  PhotonGather gather;
  const float least_inverse = 1.0f / sqr(map.largest_radius);
  float sum = 0.0f;
  std::uint32_t random = query.hash | 1u;
  const PhotonArrival* chosen = nullptr;
  const float inverse_near = 1.0f / map.largest_radius;
  const std::uint32_t near =
      map.near[photon_near(photon_cell(query.P.x, inverse_near), photon_cell(query.P.y, inverse_near),
                           photon_cell(query.P.z, inverse_near), map.near_mask)];
  for (std::uint32_t octaves = map.octaves & near; octaves != 0; octaves &= octaves - 1) {
    const int octave = __builtin_ctz(octaves);
    const float radius = __builtin_ldexpf(map.largest_radius, -octave);
    const Box3 around{query.P - splat3(radius), query.P + splat3(radius)};
    if (!boxes_overlap(around, map.bounds[octave])) continue;
    const float inverse_cell = 0.5f / radius;
    const std::int32_t x0 = photon_cell(around.low.x, inverse_cell);
    const std::int32_t y0 = photon_cell(around.low.y, inverse_cell);
    const std::int32_t z0 = photon_cell(around.low.z, inverse_cell);
    // Two cells are as wide as a search; where coordinates hardly resolve the radius, rounding would make it three or four.
    const std::int32_t x1 = x0 + (photon_cell(around.high.x, inverse_cell) > x0 ? 1 : 0);
    const std::int32_t y1 = y0 + (photon_cell(around.high.y, inverse_cell) > y0 ? 1 : 0);
    const std::int32_t z1 = z0 + (photon_cell(around.high.z, inverse_cell) > z0 ? 1 : 0);
    for (std::int32_t z = z0; z <= z1; ++z) {
      for (std::int32_t y = y0; y <= y1; ++y) {
        const std::uint32_t row = photon_row(y, z, octave);
        for (std::int32_t x = x0; x <= x1; ++x) {
          const std::uint32_t bucket = (row + static_cast<std::uint32_t>(x)) & map.bucket_mask;
          const std::uint32_t begin = map.bucket_begin[bucket];
          std::uint32_t end = map.bucket_begin[bucket + 1];
          // The next cell of the row follows at once, but at the table's end.
          if (x < x1 && bucket != map.bucket_mask) {
            end = map.bucket_begin[bucket + 2];
            ++x;
          }
          for (std::uint32_t first = begin; first < end; first += 8) {
            const std::uint32_t count = end - first < 8 ? end - first : 8;
            float squared[8];  // distances over radii
            for (std::uint32_t k = 0; k < 8; ++k) {
              const std::uint32_t i = first + (k < count ? k : count - 1);
              squared[k] = (sqr(map.x[i] - query.P.x) + sqr(map.y[i] - query.P.y) + sqr(map.z[i] - query.P.z)) *
                           map.inverse_radius_squared[i];
            }
            for (std::uint32_t k = 0; k < count; ++k) {
              if (!(squared[k] < 1.0f)) continue;
              const std::uint32_t i = first + k;
              // Rows may share buckets: each photon counts in its own.
              const float inverse_squared = map.inverse_radius_squared[i];
              if (photon_cell(map.y[i], inverse_cell) != y || photon_cell(map.z[i], inverse_cell) != z) continue;
              if (photon_octave(inverse_squared, least_inverse) != octave) continue;
              const PhotonArrival& photon = map.arrivals[i];
              const Vec3f offset{map.x[i] - query.P.x, map.y[i] - query.P.y, map.z[i] - query.P.z};
              if (!photon_bounces_allowed(photon.bounces, query.bounces)) continue;
              constexpr float kLeastCosine = 0.26f;
              constexpr float kThickness = 0.5f;
              if (__builtin_fabsf(dot(octahedral_decode(photon.Ng), query.Ng)) < kLeastCosine) continue;
              if (sqr(dot(offset, query.Ng)) * inverse_squared > sqr(kThickness)) continue;
              const Vec3f wi = octahedral_decode(photon.wi);
              if (!query.both_sides && dot(wi, query.Ng) <= 0.0f) continue;
              const float weight =
                  (1.0f - squared[k]) * inverse_squared * max_component(abs(photon.power)) * photon_lobe(query.lobe, wi);
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
  }
  if (chosen == nullptr) return gather;
  gather.wi = octahedral_decode(chosen->wi);
  gather.bounces = chosen->bounces;
  gather.irradiance =
      chosen->power * (sum / (max_component(abs(chosen->power)) * photon_lobe(query.lobe, gather.wi)) * (2.0f * kInvPi));
  return gather;
}

}  // namespace relief
