// How the reflectance of a mixture's microfacets depends on the angle.
#pragma once

#include "kernel/bsdf/fresnel_models.h"
#include "kernel/bsdf/thin_film.h"

namespace relief {

enum class MixtureFresnel : std::uint8_t {
  kNone,          ///< 1 everywhere
  kInterpolated,  ///< from F0 to 1 along a dielectric's curve
  kDielectric,
  kF82,
  kConductor,
  kConductorExact,
  kThinFilm,
  kFilmOnDielectric,
  kFilmOnConductor,
  kFilmOnF82,
};

/// A microfacet's reflectance.
struct MicrofacetFresnel {
  MixtureFresnel kind = MixtureFresnel::kNone;
  float eta = 1.5f;  ///< index of the far side / index of wo's side
  Vec3f a{};         ///< F0; of conductors their index
  Vec3f b{};         ///< FresnelF82::B; of conductors the imaginary part
  float film_ior = 1.33f, film_nm = 0;
  const ThinFilmTable* film_table = nullptr;  ///< of those kinds that have a film, but for kThinFilm
};

/// Reflectance under a film. Not inlined, as there seldom is one.
[[gnu::noinline]] RELIEF_KERNEL Vec3f film_fresnel(const MicrofacetFresnel& f, float cos_d)
{
  const ThinFilm film{f.film_table, f.film_ior, f.film_nm};
  switch (f.kind) {
    case MixtureFresnel::kFilmOnConductor:
      return fresnel_film_on_conductor(film, cos_d, f.a, f.b);
    case MixtureFresnel::kFilmOnF82:
      return fresnel_film_on_f82(film, cos_d, {f.a, f.b});
    case MixtureFresnel::kFilmOnDielectric:
      return fresnel_thin_film_scaled(fresnel_film_on_dielectric(film, cos_d, f.eta), f.a, f.eta);
    case MixtureFresnel::kThinFilm:
      return fresnel_thin_film_scaled(fresnel_thin_film(cos_d, f.eta, f.film_ior, f.film_nm), f.a, f.eta);
    case MixtureFresnel::kNone:
    case MixtureFresnel::kInterpolated:
    case MixtureFresnel::kDielectric:
    case MixtureFresnel::kF82:
    case MixtureFresnel::kConductor:
    case MixtureFresnel::kConductorExact:
      break;
  }
  return {1, 1, 1};
}

/// The share by which samples of a dielectric are reflected.
/// @param F  mixture_fresnel of the same
RELIEF_KERNEL float reflected_chance(const MicrofacetFresnel& f, Vec3f F, float cos_d)
{
  // A film may reflect fifty times what is below it does, which samples would have to make up for.
  const bool has_film = f.kind == MixtureFresnel::kFilmOnDielectric || f.kind == MixtureFresnel::kThinFilm;
  return has_film ? clamp((F.x + F.y + F.z) * (1.0f / 3.0f), 0.0f, 1.0f) : fresnel_dielectric_at(cos_d, f.eta);
}

/// @param cos_d  between either direction and the microfacet, >= 0
[[gnu::always_inline]] RELIEF_KERNEL Vec3f mixture_fresnel(const MicrofacetFresnel& f, float cos_d)
{
  switch (f.kind) {
    case MixtureFresnel::kNone:
      break;
    case MixtureFresnel::kInterpolated:
      return fresnel_interpolated(f.a, {1, 1, 1}, cos_d, f.eta);
    case MixtureFresnel::kDielectric:
      return splat3(fresnel_dielectric_at(cos_d, f.eta));
    case MixtureFresnel::kF82:
      return fresnel_f82({f.a, f.b}, cos_d);
    case MixtureFresnel::kConductor:
      return fresnel_conductor(f.a, f.b, cos_d);
    case MixtureFresnel::kConductorExact:
      return fresnel_conductor_exact(f.a, f.b, cos_d);
    case MixtureFresnel::kThinFilm:
    case MixtureFresnel::kFilmOnDielectric:
    case MixtureFresnel::kFilmOnConductor:
    case MixtureFresnel::kFilmOnF82:
      return film_fresnel(f, cos_d);
  }
  return {1, 1, 1};
}

}  // namespace relief
