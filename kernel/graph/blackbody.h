// Colours of black bodies, as Blender's Blackbody node has them: fits to the colours that the CIE's matching functions give
// of Planck's spectra, at the luminance of white.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// Linear Rec. 709 of a black body; outside of its gamut below 0.
/// @param kelvins  800 to 12,000; the colours at these ends beyond them
RELIEF_KERNEL Vec3f blackbody_color(float kelvins)
{
  // Red and green: a / T + b T + c; blue: a cubic.
  struct Fit {
    float least;
    float red[3], green[3], blue[4];
  };
  static constexpr Fit kFits[] = {
      {800.0f,
       {1.61919106e+03f, -2.05010916e-03f, 5.02995757e+00f},
       {-4.88999748e+02f, 6.04330754e-04f, -7.55807526e-02f},
       {5.96945309e-11f, -4.85742887e-08f, -9.70622247e-05f, -4.07936148e-03f}},
      {965.0f,
       {2.48845471e+03f, -1.11330907e-03f, 3.22621544e+00f},
       {-7.55994277e+02f, 3.16730098e-04f, 4.78306139e-01f},
       {2.40430366e-11f, 5.55021075e-08f, -1.98503712e-04f, 2.89312858e-02f}},
      {1167.0f,
       {3.34143193e+03f, -4.86551192e-04f, 1.76486769e+00f},
       {-1.02363977e+03f, 1.20223470e-04f, 9.36662319e-01f},
       {-1.40949732e-11f, 1.89878968e-07f, -3.56632824e-04f, 9.10767778e-02f}},
      {1449.0f,
       {4.09461742e+03f, -1.27446582e-04f, 7.25731635e-01f},
       {-1.26571316e+03f, 4.87340896e-06f, 1.27054498e+00f},
       {-3.61460868e-11f, 2.84822009e-07f, -4.93211319e-04f, 1.56723440e-01f}},
      {1902.0f,
       {4.67028036e+03f, 2.91258199e-05f, 1.26703442e-01f},
       {-1.42529332e+03f, -4.01150431e-05f, 1.43972784e+00f},
       {-1.97075738e-11f, 1.75359352e-07f, -2.50542825e-04f, -2.22783266e-02f}},
      {3315.0f,
       {4.59509185e+03f, 2.87495649e-05f, 1.50345020e-01f},
       {-1.17554822e+03f, -2.16378048e-05f, 1.30408023e+00f},
       {-1.61997957e-13f, -1.64216008e-08f, 3.86216271e-04f, -7.38077418e-01f}},
      {6365.0f,
       {3.78717450e+03f, 9.35907826e-06f, 3.99075871e-01f},
       {-5.00799571e+02f, -4.59832026e-06f, 1.09098763e+00f},
       {6.72650283e-13f, -2.73078809e-08f, 4.24098264e-04f, -7.52335691e-01f}},
  };
  if (kelvins >= 12000.0f) return {0.8262954810464208f, 0.9945080501520986f, 1.566307710274283f};
  if (!(kelvins >= 800.0f)) return {5.413294490189271f, -0.20319390035873933f, -0.0822535242887164f};
  const Fit* fit = kFits;
  for (const Fit& next : kFits) fit = kelvins >= next.least ? &next : fit;
  const float t = kelvins, over = 1.0f / t;
  const auto& [least, r, g, b] = *fit;
  return {r[0] * over + r[1] * t + r[2], g[0] * over + g[1] * t + g[2], ((b[0] * t + b[1]) * t + b[2]) * t + b[3]};
}

}  // namespace relief
