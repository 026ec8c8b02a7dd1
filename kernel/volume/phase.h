// The phase functions of media: into which directions what is scattered goes. All but Henyey and Greenstein's, which nearly all
// media have, are inverted by iteration, in double precision, out of line.
//
// Sources: Draine 2003, "Scattering by Interstellar Dust Grains. I. Optical and Ultraviolet", Eq. 7; Fournier and Jonasz 1999,
// "Computer-Based Underwater Imaging Analysis", Eq. 1, 2; Jendersie and d'Eon 2023, "An Approximate Mie Scattering Function for
// Fog and Cloud Rendering", and its supplement.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernel/volume/henyey_greenstein.h"

namespace relief {

enum class PhaseKind : std::uint8_t {
  kHenyeyGreenstein,
  kDraine,          ///< with α = 0 that of Henyey and Greenstein, with g = 0 and α = 1 Rayleigh's
  kFournierForand,  ///< of particles in water
};

struct Phase {
  Vec3f sigma_s;    ///< 1/m
  float g = 0;      ///< within ±kMostAnisotropy. Fournier and Forand's: 4/3 / (1 − index of refraction)²
  float shape = 0;  ///< Draine's α, at least 0. Fournier and Forand's ν, below 0
  PhaseKind kind = PhaseKind::kHenyeyGreenstein;
};

/// Steps after which an inversion takes what it has: halving alone comes to floats' precision in fewer.
inline constexpr int kPhaseSteps = 64;

/// Where a function that grows from at most 0 to at least 0 is 0, by Newton's method between bounds.
/// @param f     (value, derivative) at x
/// @param within  of the root that is enough
template <typename Function>
RELIEF_KERNEL double bracketed_root(double low, double high, double within, const Function& f)
{
  double x = 0.5 * (low + high);
  for (int step = 0; step < kPhaseSteps && high - low > within; ++step) {
    const auto [value, slope] = f(x);
    (value < 0.0 ? low : high) = x;
    const double next = x - value / slope;
    const bool is_within = next > low && next < high;  // false if it is no number
    const double moved = is_within ? next : 0.5 * (low + high);
    const bool is_found = is_within && __builtin_fabs(moved - x) < within;
    x = moved;
    if (is_found) break;
  }
  return x;
}

struct ValueAndSlope {
  double value, slope;
};

/// What Draine's function is divided by for it to be a density.
RELIEF_KERNEL double draine_norm(double g, double alpha) { return 1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0; }

RELIEF_KERNEL float draine_pdf(float cosine, float g, float alpha)
{
  const float norm = static_cast<float>(draine_norm(static_cast<double>(g), static_cast<double>(alpha)));
  return henyey_greenstein_pdf(cosine, g) * (1.0f + alpha * cosine * cosine) / norm;
}

/// Share of the light that goes nearer to straight on than a direction, at g ≥ kLeastAnisotropy.
/// @param s  √(1 + g² − 2 g cosine)
RELIEF_KERNEL ValueAndSlope draine_share(double s, double g, double alpha)
{
  const double sum = 1.0 + g * g, scale = (1.0 - g * g) / (2.0 * g * draine_norm(g, alpha));
  const double k = alpha / (4.0 * g * g);
  const auto integral = [&](double x) { return -1.0 / x + k * (-sum * sum / x - 2.0 * sum * x + x * x * x / 3.0); };
  const double cosine = (sum - s * s) / (2.0 * g);
  return {scale * (integral(s) - integral(1.0 - g)), scale * (1.0 + alpha * cosine * cosine) / (s * s)};
}

/// The cosine of which a share of all light goes nearer to straight on.
[[gnu::noinline]] RELIEF_KERNEL float draine_cosine(float share, float anisotropy, float shape)
{
  const bool is_backward = anisotropy < 0.0f;  // mirrored
  const double u = static_cast<double>(is_backward ? 1.0f - share : share);
  const double g = static_cast<double>(__builtin_fabsf(anisotropy)), alpha = static_cast<double>(shape);
  double cosine;
  if (g < static_cast<double>(kLeastAnisotropy)) {
    const double norm = 2.0 + 2.0 * alpha / 3.0;
    cosine = -bracketed_root(-1.0, 1.0, 1e-8, [&](double x) {
      return ValueAndSlope{(1.0 + x + alpha * (1.0 + x * x * x) / 3.0) / norm - u, (1.0 + alpha * x * x) / norm};
    });
  } else {
    const double s = bracketed_root(1.0 - g, 1.0 + g, 1e-9, [&](double x) {
      const ValueAndSlope at = draine_share(x, g, alpha);
      return ValueAndSlope{at.value - u, at.slope};
    });
    cosine = (1.0 + g * g - s * s) / (2.0 * g);
  }
  return clamp(static_cast<float>(is_backward ? -cosine : cosine), -1.0f, 1.0f);
}

/// δ nearer to 1 than this is moved away from it: both functions below are even there, but divide 0 by 0.
inline constexpr double kLeastDelta = 1e-5;

/// What of Fournier and Forand's functions depends on half an angle's sine alone.
struct FournierForandPoint {
  double delta, power;  ///< δ, δ^ν

  FournierForandPoint(double sin2, double factor, double nu) : delta(factor * sin2)
  {
    if (__builtin_fabs(delta - 1.0) < kLeastDelta) delta = delta < 1.0 ? 1.0 - kLeastDelta : 1.0 + kLeastDelta;
    power = std::pow(delta, nu);
  }
};

/// Weight of what the second term of Fournier and Forand's function adds, (δ180^−ν − 1) / (δ180 − 1).
RELIEF_KERNEL double fournier_forand_rest(double factor, double nu)
{
  const FournierForandPoint back(1.0, factor, nu);
  return (1.0 / back.power - 1.0) / (back.delta - 1.0);
}

/// Nearer to straight on the peak is taken for flat: float cosines end there.
inline constexpr double kLeastSin2 = 0x1p-26;

/// @param factor  4/3 / (1 − index)²
[[gnu::noinline]] RELIEF_KERNEL float fournier_forand_pdf(float cosine, float factor, float nu)
{
  const double c = static_cast<double>(cosine), v = static_cast<double>(nu), f = static_cast<double>(factor);
  const double half = 0.5 * (1.0 - c), sin2 = half > kLeastSin2 ? half : kLeastSin2;
  const FournierForandPoint at(sin2, f, v);
  const double m = 1.0 - at.delta, p = 1.0 - at.power;
  const double first = (v * m - p + (at.delta * p - v * m) / sin2) / (m * m * at.power);
  const double second = fournier_forand_rest(f, v) * (3.0 * c * c - 1.0) * 0.25;
  return static_cast<float>((first + second) * static_cast<double>(0.25f * kInvPi));
}

/// Share of the light that goes nearer to straight on than an angle.
/// @param sin2  square of the sine of half the angle, above 0
RELIEF_KERNEL double fournier_forand_share(double sin2, double factor, double nu)
{
  const FournierForandPoint at(sin2, factor, nu);
  const double first = (1.0 - at.power * at.delta - (1.0 - at.power) * sin2) / ((1.0 - at.delta) * at.power);
  const double cosine = 1.0 - 2.0 * sin2;
  return first + 0.125 * fournier_forand_rest(factor, nu) * cosine * (1.0 - cosine * cosine);
}

/// The cosine of which a share of all light goes nearer to straight on.
[[gnu::noinline]] RELIEF_KERNEL float fournier_forand_cosine(float share, float factor, float nu)
{
  const double u = static_cast<double>(share), f = static_cast<double>(factor), v = static_cast<double>(nu);
  // By the logarithm, as most of it may be in a narrow peak.
  const double log_sin2 = bracketed_root(std::log(kLeastSin2), 0.0, 1e-7, [&](double x) {
    const double sin2 = std::exp(x), cosine = 1.0 - 2.0 * sin2;
    const double density = static_cast<double>(fournier_forand_pdf(static_cast<float>(cosine), factor, nu));
    return ValueAndSlope{fournier_forand_share(sin2, f, v) - u, 4.0 * static_cast<double>(kPi) * density * sin2};
  });
  return static_cast<float>(1.0 - 2.0 * std::exp(log_sin2));
}

/// Fournier and Forand's function by what people know of it.
/// @param backscatter  the share that goes back, at most .499
/// @param index        of refraction of the particles, at least 1.001
RELIEF_KERNEL Phase fournier_forand_phase(Vec3f sigma_s, float backscatter, float index)
{
  // What is outside is taken for the nearest that is within: none of it would be a function's peak alone.
  const double b = static_cast<double>(clamp(__builtin_fabsf(backscatter), 1e-4f, 0.499f));
  const double n = static_cast<double>(max(index, 1.001f)) - 1.0;
  const double factor = 4.0 / (3.0 * n * n);
  double half = 0.5 * factor;
  if (__builtin_fabs(half - 1.0) < kLeastDelta) half = 1.0 + kLeastDelta;
  const double nu = -std::log1p(2.0 * b * (half - 1.0)) / std::log(half);
  return {sigma_s, static_cast<float>(factor), static_cast<float>(nu), PhaseKind::kFournierForand};
}

/// @param cosine  as henyey_greenstein_pdf has it
RELIEF_KERNEL float phase_pdf(const Phase& phase, float cosine)
{
  if (phase.kind == PhaseKind::kHenyeyGreenstein) return henyey_greenstein_pdf(cosine, phase.g);
  if (phase.kind == PhaseKind::kDraine) return draine_pdf(cosine, phase.g, phase.shape);
  return fournier_forand_pdf(cosine, phase.g, phase.shape);
}

/// @param D  unit, along the light's way
/// @return   unit, where it goes
RELIEF_KERNEL Vec3f phase_sample(const Phase& phase, Vec3f D, Vec2f u)
{
  if (phase.kind == PhaseKind::kHenyeyGreenstein) return henyey_greenstein_sample(D, phase.g, u);
  const float cosine = phase.kind == PhaseKind::kDraine ? draine_cosine(u.x, phase.g, phase.shape)
                                                        : fournier_forand_cosine(u.x, phase.g, phase.shape);
  return normalize(from_local(frame_from_normal(D), direction_from_z(cosine, u.y)));
}

/// What stands for Mie's function of water droplets: a mixture of Henyey and Greenstein's function with Draine's.
struct MieFit {
  float g_henyey_greenstein, g_draine, alpha;
  float share;  ///< of Draine's
};

/// @param diameter  of the droplets, micrometres
[[gnu::noinline]] RELIEF_KERNEL MieFit mie_fit(float diameter)
{
  const float d = max(diameter, 0.0f);
  if (d <= 0.1f) {  // Eq. 11 to 14
    return {13.8f * d * d, 1.1456f * d * std::sin(9.29044f * d), 250.0f, 0.252977f - 312.983f * std::pow(d, 4.3f)};
  }
  const float l = std::log(d);
  if (d < 1.5f) {  // Eq. 15 to 18
    const float angle = (l - 0.238604f) * (l + 1.00667f) / (0.507522f - 0.15677f * l);
    const float inner = 1.19692f * std::cos(angle) + 1.37932f * l + 0.0625835f;
    return {0.862f - 0.143f * l * l, 0.379685f * std::cos(inner) + 0.344213f, 250.0f,
            0.146209f * std::cos(3.38707f * l + 2.11193f) + 0.316072f + 0.0778917f * l};
  }
  if (d < 5.0f) {  // Eq. 19 to 22
    const float log_l = std::log(l);
    return {0.0604931f * log_l + 0.940256f, 0.500411f - 0.081287f / (-2.0f * l + std::tan(l) + 1.27551f),
            7.30354f * l + 6.31675f, 0.026914f * (l - std::cos(5.68947f * (log_l - 0.0292149f))) + 0.3764f};
  }
  // Eq. 7 to 10
  return {std::exp(-0.0990567f / (d - 1.67154f)), std::exp(-2.20679f / (d + 3.91029f) - 0.428934f),
          std::exp(3.62489f - 8.29288f / (d + 5.52825f)), std::exp(-0.599085f / (d - 0.641583f) - 0.665888f)};
}

}  // namespace relief
