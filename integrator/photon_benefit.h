// Whether photons pay: for the squared error that they take from a picture, against what tracing and gathering them costs.
//
// A pilot renders a few thousand samples all over the picture, with photons. What paths alone would do follows from it. A
// path that meets the light of a caustic brings X, which is seldom and then much: about V, the radiance of the light. Its mean is
// the caustic, which photons tell, and so its second moment is E[X²] = V E[X]: what photons bring if each carries V times its
// power. So noise that paths show once in a million samples is known from a few thousand photons.
// Costs are counted in rays, not timed: the choice is the same on all machines, for any number of threads, and after resuming.
#pragma once

#include <atomic>
#include <string>

#include "integrator/photon_pass.h"
#include "integrator/render.h"

namespace relief {

/// How a render shares out the light of caustics.
struct PhotonChoice {
  bool photons = false;
  PhotonSources sources;   ///< if photons are traced
  std::string reason;      ///< with its figures, if it was measured
  double error_ratio = 0;  ///< squared error of paths alone over that with photons, at equal samples; 0: not measured
  double cost_ratio = 0;   ///< cost of a sample with photons over that of paths alone; 0: not measured
};

/// Decides by the mode: `on` wherever photons can start, `auto` where they pay.
/// @param g     of the render; gets caustics.enabled
/// @param stop  true: what is chosen does not matter any more
PhotonChoice photon_choice_make(const SceneContext& context,
                                const RenderOptions& options,
                                KernelGlobals& g,
                                const std::atomic<bool>& stop);

/// A light as paths see it by a caster.
struct CausticLight {
  double irradiance = 0;   ///< on the caster, W/m²
  double solid_angle = 0;  ///< of the light or of the caster's lobe, the larger one: paths spread noise over it
};

/// How far a slightly tilted facet turns a path, over the 2 tilts of a mirror. Where paths ask for a light beyond glass they are on
/// their way out, and refraction turns them by η − 1; for one inside they are on their way in, and it is 1 − 1/η (Snell's law).
/// @param ior  η of glass over air; 0: the caster mirrors
/// @return     0.05 to 1
double caster_bending(double ior, bool is_light_inside);

/// @param box    around the casters, world
/// @param alpha  of the sharpest of their lobes, times caster_bending
CausticLight caustic_light(const Light& light, const Box3& box, double alpha);

/// E[X²] over the mean of X, where X is what one path brings of a caustic, W/m²/sr. As clamped paths lose light, it is that of
/// what is left of them over the mean of all.
/// @param clamp    of X; 0: none
/// @param samples  planned: light that no path can meet counts as what is lost of it
double caustic_second_moment(CausticLight light, double clamp, double samples);

}  // namespace relief
