// Coefficients of the sky by Hosek and Wilkie for one sun.
//
// Hosek and Wilkie 2012, "An Analytic Model for Full Spectral Sky-Dome Radiance".
#pragma once

namespace relief {

/// How X, Y or Z is spread over the sky: (1 + a exp(b / (cos θ + .01))) (c + d exp(e γ) + f cos²γ + g χ(h, γ) + i √cos θ), with
/// θ from the zenith, γ from the sun, χ(h, γ) = (1 + cos²γ) / (1 + h² − 2 h cos γ)^1.5.
struct HosekWilkieLobe {
  float a, b, c, d, e, f, g, i, h;  ///< in the order of the coefficients: the paper's I comes before its H
  float radiance;                   ///< multiplies it
};

struct HosekWilkieSky {
  HosekWilkieLobe xyz[3];
};

/// @param turbidity  clamped to 1 … 10
/// @param albedo     of the ground, clamped to 0 … 1
/// @param elevation  of the sun, radians, 0 … π/2
HosekWilkieSky hosek_wilkie_make(float turbidity, float albedo, float elevation);

}  // namespace relief
