// What a point that is lit tells the choice of a light: from which side light comes to it, and where its gloss shows lights. A lamp
// that lights a floor little may be what shines in it: chosen by irradiance alone it is asked seldom, and then counts for much. Four
// lamps over a dark, half glossy floor had 5 to 7 times the variance.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// A lobe that reflects, as the choice of a light sees it.
struct LightGloss {
  Vec3f R;           ///< unit, world: where a mirror would send the ray; any where share is 0
  float share = 0;   ///< of all that is scattered: 0, or [kLeastGlossShare, kMostGlossShare]
  float alpha2 = 1;  ///< square of the microfacets' width, [kLeastGlossAlpha2, 1]
};
/// Less is not worth asking, as of bright plastic seen from above.
inline constexpr float kLeastGlossShare = 0.125f;
/// What is left is chosen by irradiance, since lobes are not what they are taken for.
inline constexpr float kMostGlossShare = 0.75f;
/// What a narrower lobe shows of lamps is found by following it.
inline constexpr float kLeastGlossAlpha2 = 0.01f;

struct LightReceiver {
  Vec3f N;  ///< unit shading normal when only light from its side matters; zero vector: light from all sides does
  LightGloss gloss;

  LightReceiver() = default;
  [[gnu::always_inline]] LightReceiver(Vec3f normal) : N(normal) {}
  [[gnu::always_inline]] LightReceiver(Vec3f normal, const LightGloss& lobe) : N(normal), gloss(lobe) {}
};

/// How much more of a light the gloss shows than a white diffuse surface which faces it would, as far as light that is asked for brings
/// it: the rest is found by following the lobe. That is π p / (1 + (share p Ω)²), with the density p of a sampled reflection and the
/// power heuristic. GGX's, widened by the light's radius, is taken for  p = a / (π (2a + x)²),  where x = 1 − cos to R: that has the
/// right height and integral for rays that come along the normal.
/// @param Real    float or lanes of it
/// @param x       [0, 2], of the light's centre
/// @param radius2 ≥ 0: square of the sine of the angle that it is seen by, so that Ω = π radius2
template <typename Real>
RELIEF_KERNEL Real light_gloss_eval(const LightGloss& gloss, Real x, Real radius2)
{
  const Real a = radius2 * 0.125f + gloss.alpha2;
  const Real twice = a + a + x, B = twice * twice, c = radius2 * a * gloss.share;
  return a * B / (B * B + c * c);
}

}  // namespace relief
