// What a kind of lobe has to have to stand in mixture_lobes.inc: a struct of its parameters, resolved for one wo, with
//
//   kTraits   a MixtureTraits
//
// and two functions, in the lobe's own frame, whose z is its normal on wo's side:
//
//   lobe_eval<kMode>(lobe, hit, tables, wi, through)  BsdfEval; f before the lobe's weight, pdf as if the lobe were chosen
//   lobe_sample<kMode>(lobe, hit, u_branch, u)        LobeSample
//
// They are asked for directions on the sides that the traits name alone. Kinds that have a width, which paths may blur, have
//
//   lobe_widen(lobe, eta, blur)  makes its α at least `blur`; eta as in MicrofacetFresnel. False: it has none after all
//
// Whatever is missing does not compile. mixture_lobe.h calls these.
#pragma once

#include "kernel/bsdf/closure_kinds.h"
#include "kernel/bsdf/lobe.h"
#include "kernel/bsdf/microfacet_fresnel.h"

namespace relief {

struct BsdfTables;

/// What lobes of all kinds know of their hit.
struct LobeHit {
  Vec3f wo{};                   ///< unit, the lobe's own frame, z > 0
  float roughness = kInfinity;  ///< perceptual; infinite: never sharp
  MicrofacetFresnel fresnel;
  bool is_delta = false;  ///< lights are not found through it: also what enters the object
};

/// What a lobe of microfacets sends on as a mirror.
RELIEF_KERNEL LobeSample lobe_sample_mirror(const LobeHit& hit)
{
  return lobe_sample_delta({-hit.wo.x, -hit.wo.y, hit.wo.z}, mixture_fresnel(hit.fresnel, hit.wo.z));
}

/// The traits of reflection by microfacets.
inline constexpr MixtureTraits kReflectingMicrofacets{.is_diffuse = false,
                                                      .is_microfacet = true,
                                                      .has_fresnel = true,
                                                      .fading = LobeFading::kNever};

}  // namespace relief
