// What every lobe is, and the list that a surface's lobes stand in.
//
// A lobe is one way in which a surface scatters light, resolved for one wo. It is a struct, derived from Lobe, with
//
//   kFeatures   FeatureBits of which any brings it; 0: always there
//   kSides      where it sends light: on wo's side, through the surface, or either way
//   kSharpness  whether the photon pass may take it for one that focuses light, and whose roughness decides
//   kIsLayer    it lies over all others, and nothing is taken from it by what lies on top
//
// and two functions, which are given the interface that the lobes of the base share (base_interface.h):
//
//   lobe_eval<kMode>(lobe, base, tables, wi)             BsdfEval; pdf as if the lobe were chosen; delta lobes: 0
//   lobe_sample<kMode>(lobe, base, tables, u_branch, u)  LobeSample
//
// They are called for lobes with a probability alone, and lobe_eval for directions on the lobe's side. Directions are in
// the shading frame turned so that wo.z > 0. surface_closure.h has the one list and fills it; layered.h evaluates and
// samples whatever stands in it, lobe_split.h takes it apart.
#pragma once

#include "kernel/bsdf/dielectric.h"
#include "kernel/bsdf/lobe_traits.h"
#include "kernel/feature_mask.h"

namespace relief {

enum LobeBit : std::uint32_t {
  kLobeReflect = 1u << 0,
  kLobeTransmit = 1u << 1,
  kLobeDiffuse = 1u << 2,
  kLobeGlossy = 1u << 3,
  kLobeDelta = 1u << 4,
  kLobeSubsurface = 1u << 5,  ///< the path enters the object, and leaves it elsewhere
};

/// A BSDF for two directions; delta lobes contribute nothing.
struct BsdfEval {
  Vec3f f{};      ///< 1/sr, without |cos|
  float pdf = 0;  ///< solid angle of wi
};

/// A sampled direction. f·|cos|/pdf is the factor on the throughput.
struct BsdfSample {
  Vec3f wi{};
  Vec3f f{};      ///< of the whole surface at wi; delta lobes: of this lobe alone
  float pdf = 0;  ///< solid angle; delta lobes: probability of this lobe; 0: absorbed, nothing else means anything
  float roughness = 0;     ///< GGX alpha of the lobe, for ray cones; 1 for diffuse lobes and sheen, 0 for delta lobes
  float eta = 1;           ///< index of wi's side / index of wo's side; 1 unless refracted
  std::uint32_t lobe = 0;  ///< LobeBits: reflect or transmit; and diffuse, glossy or delta
  std::uint32_t entered = 0;  ///< kLobeSubsurface: place of the lobe in its mixture; wi is the way in, f/pdf the factor
};

/// What a lobe samples: a direction and no more, unless it is delta.
struct LobeSample {
  Vec3f wi{};
  std::uint32_t bits = 0;        ///< LobeBits; 0: absorbed. Lost too is what is not on the side that they say
  Vec3f reflectance{};           ///< delta lobes: share of the light that goes this way
  float probability = 1;         ///< delta lobes: of this way, once the lobe is chosen
  float roughness = 0, eta = 1;  ///< as BsdfSample's
};

/// @param transmits  wi is meant for the far side; on which side it is tells whether the ray was lost
RELIEF_KERNEL LobeSample lobe_sample_glossy(Vec3f wi, bool transmits, float alpha)
{
  return {wi, kLobeGlossy | (transmits ? kLobeTransmit : kLobeReflect), {}, 1.0f, alpha, 1.0f};
}

RELIEF_KERNEL LobeSample lobe_sample_diffuse(Vec3f wi, bool transmits)
{
  return {wi, kLobeDiffuse | (transmits ? kLobeTransmit : kLobeReflect), {}, 1.0f, 1.0f, 1.0f};
}

RELIEF_KERNEL LobeSample lobe_sample_delta(Vec3f wi, Vec3f reflectance, float probability = 1.0f)
{
  return {wi, kLobeDelta | (wi.z < 0.0f ? kLobeTransmit : kLobeReflect), reflectance, probability, 0.0f, 1.0f};
}

/// Whose roughness decides whether a lobe is sharp.
enum class LobeSharpness { kNever, kBase, kCoat };

struct Lobe {
  float probability = 0;  ///< that sampling chooses it; 0: it scatters nothing
};

/// Lobes in the order in which sampling chooses among them.
template <typename... L>
struct LobeList : L... {
};

template <typename L, unsigned kFeatures>
inline constexpr bool kHasLobe = L::kFeatures == 0 || (L::kFeatures & kFeatures) != 0;

/// Calls f(lobe) for every lobe of a list that the features bring, in order.
template <unsigned kFeatures, typename F, typename... L>
RELIEF_KERNEL void lobes_visit(const LobeList<L...>& lobes, F&& f)
{
  const auto visit = [&]<typename One>(const One& lobe) {
    if constexpr (kHasLobe<One, kFeatures>) f(lobe);
  };
  (visit(static_cast<const L&>(lobes)), ...);
}

template <unsigned kFeatures, typename F, typename... L>
RELIEF_KERNEL void lobes_visit(LobeList<L...>& lobes, F&& f)
{
  const auto visit = [&]<typename One>(One& lobe) {
    if constexpr (kHasLobe<One, kFeatures>) f(lobe);
  };
  (visit(static_cast<L&>(lobes)), ...);
}

/// As lobes_visit, until f is true.
/// @return whether it was
template <unsigned kFeatures, typename F, typename... L>
RELIEF_KERNEL bool lobes_visit_until(const LobeList<L...>& lobes, F&& f)
{
  const auto visit = [&]<typename One>(const One& lobe) {
    if constexpr (kHasLobe<One, kFeatures>) return f(lobe);
    return false;
  };
  return (visit(static_cast<const L&>(lobes)) || ...);
}

/// One lobe of a list.
template <typename L, typename... All>
RELIEF_KERNEL const L& lobe_of(const LobeList<All...>& lobes)
{
  return lobes;
}

}  // namespace relief
