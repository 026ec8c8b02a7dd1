// Films that interfere over dielectrics and metals, as Blender has them since 5.0: the same series as fresnel_thin_film, with
// spectra of the true matching functions from a table. And metal by its complex index, exactly.
//
// Belcour and Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence" [BB].
#pragma once

#include "kernel/bsdf/fresnel_models.h"
#include "kernel/math/cie_1931.h"

namespace relief {

inline constexpr int kThinFilmNodes = 512;
/// Longest optical path difference of the table; longer ones count as this.
inline constexpr float kThinFilmMostNanometres = 60000.0f / (2.0f * kPi);

/// Cosines and sines of phases at an optical path difference, weighted by the eye's sensitivities: linear Rec.709.
struct ThinFilmSpectrum {
  Vec3f cosine, sine;
};

/// Spectra from no path difference, where the cosine is 1, to kThinFilmMostNanometres.
struct ThinFilmTable {
  ThinFilmSpectrum nodes[kThinFilmNodes];
};

/// @cost  512 × 81 turns by a fixed angle
RELIEF_KERNEL void thin_film_table_make(ThinFilmTable& table)
{
  table = {};
  for (int w = 0; w < kNumCieMatches; ++w) {
    const Vec3f rgb = rec709_of_xyz({kCieMatches[0][w], kCieMatches[1][w], kCieMatches[2][w]});
    const float nanometres = kFirstCieNanometres + kCieStepNanometres * static_cast<float>(w);
    const double step = 2.0 * 3.141592653589793 * kThinFilmMostNanometres / (kThinFilmNodes - 1) / nanometres;
    const double c = std::cos(step), s = std::sin(step);
    double x = 1, y = 0;
    for (ThinFilmSpectrum& node : table.nodes) {
      node.cosine += rgb * static_cast<float>(x);
      node.sine += rgb * static_cast<float>(y);
      const double turned = x * c - y * s;
      y = x * s + y * c;
      x = turned;
    }
  }
  const Vec3f whole = table.nodes[0].cosine;
  for (ThinFilmSpectrum& node : table.nodes) {
    node.cosine = node.cosine / whole;
    node.sine = node.sine / whole;
  }
}

RELIEF_KERNEL ThinFilmSpectrum thin_film_spectrum(const ThinFilmTable& table, float path_nm)
{
  const float at = clamp(path_nm / kThinFilmMostNanometres, 0.0f, 1.0f) * (kThinFilmNodes - 1);
  const int lower = at < kThinFilmNodes - 2 ? static_cast<int>(at) : kThinFilmNodes - 2;
  const float t = at - static_cast<float>(lower);
  const ThinFilmSpectrum &a = table.nodes[lower], &b = table.nodes[lower + 1];
  return {lerp(t, a.cosine, b.cosine), lerp(t, a.sine, b.sine)};
}

/// Both polarisations of what a metal reflects: reflectances, and the phases of the reflected waves.
struct ConductorReflection {
  Vec3f R_s, R_p;
  Vec3f cos_s, sin_s, cos_p, sin_p;
};

/// @param outside  index of what lies over the metal
/// @param n, k     the metal's complex index n + ik, by channel
RELIEF_KERNEL ConductorReflection fresnel_conductor_polarized(float cos_i, float outside, Vec3f n, Vec3f k)
{
  struct Wave {
    float R, cosine, sine;
  };
  // Of the ratio (a − b) / (a + b) of complex numbers.
  const auto wave = [](float a_re, float a_im, float b_re, float b_im) -> Wave {
    const float plus = sqr(a_re + b_re) + sqr(a_im + b_im);
    const float minus = sqr(a_re - b_re) + sqr(a_im - b_im);
    if (!(plus > 0.0f)) return {0.0f, 1.0f, 0.0f};
    const float re = sqr(a_re) + sqr(a_im) - sqr(b_re) - sqr(b_im);
    const float im = 2.0f * (a_im * b_re - a_re * b_im);
    const float size = __builtin_sqrtf(re * re + im * im);
    return {minus / plus, size > 0.0f ? re / size : 1.0f, size > 0.0f ? im / size : 0.0f};
  };
  ConductorReflection r;
  const auto channel = [&](float n_c, float k_c, float& R_s, float& R_p, float& cos_s, float& sin_s, float& cos_p,
                           float& sin_p) {
    // Index times the complex cosine inside: u + iv.
    const float real = n_c * n_c - k_c * k_c, imaginary = 2.0f * n_c * k_c;
    const float below = real - sqr(outside) * (1.0f - sqr(cos_i));
    const float size = __builtin_sqrtf(below * below + imaginary * imaginary);
    const float u = safe_sqrt(0.5f * (size + below)), v = safe_sqrt(0.5f * (size - below));
    const Wave s = wave(outside * cos_i, 0.0f, u, v);
    const Wave p = wave(real * cos_i, imaginary * cos_i, outside * u, outside * v);
    R_s = s.R, cos_s = s.cosine, sin_s = s.sine;
    R_p = p.R, cos_p = p.cosine, sin_p = p.sine;
  };
  channel(n.x, k.x, r.R_s.x, r.R_p.x, r.cos_s.x, r.sin_s.x, r.cos_p.x, r.sin_p.x);
  channel(n.y, k.y, r.R_s.y, r.R_p.y, r.cos_s.y, r.sin_s.y, r.cos_p.y, r.sin_p.y);
  channel(n.z, k.z, r.R_s.z, r.R_p.z, r.cos_s.z, r.sin_s.z, r.cos_p.z, r.sin_p.z);
  return r;
}

/// Metal by its complex index.
RELIEF_KERNEL Vec3f fresnel_conductor_exact(Vec3f n, Vec3f k, float cos_i)
{
  const ConductorReflection r = fresnel_conductor_polarized(cos_i, 1.0f, n, k);
  return (r.R_s + r.R_p) * 0.5f;
}

/// A film, and what of it is the same whatever lies below.
struct ThinFilm {
  const ThinFilmTable* table = nullptr;
  float ior = 1.33f, nm = 0;
};

struct ThinFilmPath {
  float ior;  ///< of the film; faded to the outside's where it is too thin to interfere
  PolarizedReflection top;
  ThinFilmSpectrum orders[3];
};

/// @return  top.cos_t is 0 if all is reflected at the top
RELIEF_KERNEL ThinFilmPath thin_film_path(const ThinFilm& film, float cos_i)
{
  ThinFilmPath path;
  const float t = clamp(film.nm, 0.0f, 1.0f);
  path.ior = lerp(t * t * (3.0f - 2.0f * t), 1.0f, film.ior);
  path.top = fresnel_polarized(cos_i, path.ior);
  const float path_nm = 2.0f * path.ior * film.nm * path.top.cos_t;
  for (int m = 0; m < 3; ++m) path.orders[m] = thin_film_spectrum(*film.table, static_cast<float>(m + 1) * path_nm);
  return path;
}

/// Light of one polarisation reflected by both faces.
/// @param R12, phase12  of the top, from outside
/// @param R23           of the bottom, with the phase of its wave
/// @source              [BB] Eq. 10, first three orders
RELIEF_KERNEL Vec3f
thin_film_sum(const ThinFilmPath& path, float R12, float phase12, Vec3f R23, Vec3f cos_23, Vec3f sin_23)
{
  // From below the top reflects with the other sign.
  const float top = phase12 == 0.0f ? -1.0f : 1.0f;
  const Vec3f cos_1 = cos_23 * top, sin_1 = sin_23 * top;
  const float T121 = 1.0f - R12;
  const Vec3f R123 = R23 * R12;
  const Vec3f R_s = R23 * sqr(T121) / max(splat3(1.0f) - R123, splat3(1e-12f));
  const Vec3f amplitude{__builtin_sqrtf(R123.x), __builtin_sqrtf(R123.y), __builtin_sqrtf(R123.z)};
  Vec3f sum = splat3(R12) + R_s, C = R_s - splat3(T121);
  Vec3f cosine = cos_1, sine = sin_1;
  for (const ThinFilmSpectrum& order : path.orders) {
    C *= amplitude;
    sum += C * (cosine * order.cosine - sine * order.sine) * 2.0f;
    const Vec3f turned = cosine * cos_1 - sine * sin_1;
    sine = sine * cos_1 + cosine * sin_1;
    cosine = turned;
  }
  return sum;
}

RELIEF_KERNEL Vec3f thin_film_mean(const ThinFilmPath& path, const ConductorReflection& r)
{
  const Vec3f s = thin_film_sum(path, path.top.R_s, path.top.phase_s, r.R_s, r.cos_s, r.sin_s);
  const Vec3f p = thin_film_sum(path, path.top.R_p, path.top.phase_p, r.R_p, r.cos_p, r.sin_p);
  return min(max((s + p) * 0.5f, splat3(0.0f)), splat3(1.0f));
}

/// @param eta  index of what lies below over that of the outside; the film's is over the outside's, too
RELIEF_KERNEL Vec3f fresnel_film_on_dielectric(const ThinFilm& film, float cos_i, float eta)
{
  const ThinFilmPath path = thin_film_path(film, cos_i);
  if (!(path.top.cos_t > 0.0f)) return splat3(1.0f);
  const PolarizedReflection bottom = fresnel_polarized(path.top.cos_t, eta / path.ior);
  if (!(bottom.cos_t > 0.0f)) return splat3(1.0f);
  const auto sign_of = [](float phase) { return splat3(phase == 0.0f ? 1.0f : -1.0f); };
  const ConductorReflection below{
      splat3(bottom.R_s), splat3(bottom.R_p), sign_of(bottom.phase_s), {}, sign_of(bottom.phase_p), {}};
  return thin_film_mean(path, below);
}

/// @param n, k  complex index of the metal below
RELIEF_KERNEL Vec3f fresnel_film_on_conductor(const ThinFilm& film, float cos_i, Vec3f n, Vec3f k)
{
  const ThinFilmPath path = thin_film_path(film, cos_i);
  if (!(path.top.cos_t > 0.0f)) return splat3(1.0f);
  return thin_film_mean(path, fresnel_conductor_polarized(path.top.cos_t, path.ior, n, k));
}

/// The same of a metal by its colours: phases are those of an index that fits them, reflectances those of the colours seen
/// from within the film.
/// @source  Gulbrandsen 2014, "Artist Friendly Metallic Fresnel", Eq. 8 and 9, with the colour at 82° for the edge's tint
RELIEF_KERNEL Vec3f fresnel_film_on_f82(const ThinFilm& film, float cos_i, const FresnelF82& metal)
{
  const ThinFilmPath path = thin_film_path(film, cos_i);
  if (!(path.top.cos_t > 0.0f)) return splat3(1.0f);
  const Vec3f one = splat3(1.0f);
  const Vec3f edge = fresnel_f82(metal, 1.0f / 7.0f);
  const Vec3f r = min(metal.F0, splat3(0.999f));
  const Vec3f root{safe_sqrt(r.x), safe_sqrt(r.y), safe_sqrt(r.z)};
  const Vec3f most = (one + root) / (one - root), least = (one - r) / (one + r);
  const Vec3f n = most * (one - edge) + least * edge;
  const Vec3f square = (r * (n + one) * (n + one) - (n - one) * (n - one)) / (one - r);
  const Vec3f k{safe_sqrt(square.x), safe_sqrt(square.y), safe_sqrt(square.z)};
  ConductorReflection below = fresnel_conductor_polarized(path.top.cos_t, path.ior, n, k);
  const Vec3f n_film = n / path.ior, k_film = k / path.ior;
  const Vec3f F0 =
      ((n_film - one) * (n_film - one) + k_film * k_film) / ((n_film + one) * (n_film + one) + k_film * k_film);
  below.R_s = below.R_p = fresnel_f82(fresnel_f82_through(F0, edge), path.top.cos_t);
  return thin_film_mean(path, below);
}

}  // namespace relief
