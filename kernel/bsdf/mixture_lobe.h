// The lobes of a mixture: one struct for all, told apart by its kind, so that a hit's stand side by side in memory. Each is
// resolved for one wo, in a frame of its own whose z is its normal on wo's side. What they scatter stands in a file a lobe; the
// list is mixture_lobes.inc, the contract mixture_traits.h.
#pragma once

#include "kernel/bsdf/ashikhmin_shirley.h"
#include "kernel/bsdf/beckmann.h"
#include "kernel/bsdf/bump_shadowing.h"
#include "kernel/bsdf/clearcoat_gtr1.h"
#include "kernel/bsdf/facet_fibre.h"
#include "kernel/bsdf/fibre.h"
#include "kernel/bsdf/ggx_anisotropic.h"
#include "kernel/bsdf/ggx_multiple.h"
#include "kernel/bsdf/hair.h"
#include "kernel/bsdf/lambert.h"
#include "kernel/bsdf/microfacet_glass.h"
#include "kernel/bsdf/microfacet_refraction.h"
#include "kernel/bsdf/oren_nayar.h"
#include "kernel/bsdf/principled_diffuse.h"
#include "kernel/bsdf/principled_sheen.h"
#include "kernel/bsdf/sheen_microfibre.h"
#include "kernel/bsdf/subsurface.h"
#include "kernel/bsdf/toon.h"
#include "kernel/bsdf/translucent.h"
#include "kernel/bsdf/velvet.h"
#include "kernel/film/film_layout.h"

namespace relief {

enum class MixtureLobeKind : std::uint8_t {
#define MIXTURE_LOBE(kind, member, Type) kind,
#include "kernel/bsdf/mixture_lobes.inc"
};

/// Traits by kind.
inline constexpr MixtureTraits kMixtureTraits[] = {
#define MIXTURE_LOBE(kind, member, Type) Type::kTraits,
#include "kernel/bsdf/mixture_lobes.inc"
};

RELIEF_KERNEL constexpr const MixtureTraits& mixture_traits(MixtureLobeKind kind)
{
  return kMixtureTraits[static_cast<int>(kind)];
}

/// Parameters of a lobe, by its kind.
union LobeShape {
  LobeShape() : none(0) {}
  float none;
#define MIXTURE_LOBE(kind, member, Type) Type member;
#include "kernel/bsdf/mixture_lobes.inc"
};

struct MixtureLobe : LobeHit {
  MixtureLobeKind kind = MixtureLobeKind::kLambert;
  Maths maths = Maths::k34;
  bool stays_sharp = false;  ///< a distribution without width: nothing blurs it
  bool is_bent = false;      ///< its normal is not the surface's
  bool mirrors_below =
      false;  ///< its microfacets mirror to below its normal as well, as far as the true surface lets them
  bool is_on_curve = false;  ///< its normal turns from edge to edge of a strand, whose geometric normal means little
  float probability = 0;     ///< not normalised
  float first_share = 1;     ///< since 4.0: of its light, what facets send on at once, before the rest is given back
  Vec3f weight{};            ///< factor on f
  Frame frame;               ///< world
  Vec3f surface_N{};         ///< the surface's shading normal, its own frame
  LobeShape shape;
};

/// What function(shape) gives, the lobe's parameters by their kind.
template <typename Lobe, typename Function>
RELIEF_KERNEL auto mixture_lobe_visit(Lobe& lobe, const Function& function)
{
  switch (lobe.kind) {
#define MIXTURE_LOBE(kind, member, Type) \
  case MixtureLobeKind::kind:            \
    return function(lobe.shape.member);
#include "kernel/bsdf/mixture_lobes.inc"
  }
  __builtin_unreachable();
}

/// Whether what the lobe scatters counts as diffuse, as lobe_sample says of it.
RELIEF_KERNEL bool mixture_lobe_is_diffuse(const MixtureLobe& lobe) { return mixture_traits(lobe.kind).is_diffuse; }

/// What layers of light call the lobe. Of glass it depends on the side.
RELIEF_KERNEL constexpr EventKind mixture_lobe_event(MixtureLobeKind kind)
{
  const MixtureTraits& traits = mixture_traits(kind);
  if (traits.is_diffuse && kind != MixtureLobeKind::kMultiple) return EventKind::kDiffuse;
  return traits.sides == LobeSides::kTransmit ? EventKind::kTransmission : EventKind::kGlossy;
}

RELIEF_KERNEL bool mixture_lobe_is_sharp(const MixtureLobe& lobe, float most_roughness)
{
  return lobe.roughness < kInfinity && lobe.roughness <= most_roughness;
}

/// Where a direction is.
struct LobeSide {
  bool
      below;  ///< it is meant to go through the surface: it is below the lobe's normal, unless microfacets mirrored it there
  bool below_Ns;  ///< below the surface's shading normal
  bool below_Ng;  ///< below its geometric normal
};

/// Whether a lobe sends light to a direction that its own normal has on one side and the surface on another: as the version
/// of Cycles has it whose maths it is. What is sampled leaves by the true surface, so that no mirror sends it inside; but for
/// Ashikhmin and Shirley's lobe before 5.0.
/// @param on_curve  the lobe's is_on_curve
/// @param sampled   wi was sampled from this lobe; or else it is asked for, as the direction of a lamp is
RELIEF_KERNEL constexpr bool mixture_reaches(const MixtureTraits& t,
                                             Maths maths,
                                             bool on_curve,
                                             LobeSide at,
                                             bool sampled)
{
  if (t.is_strand) {
    if (t.sides == LobeSides::kSphere || sampled) return true;
    return t.sides == LobeSides::kTransmit ? at.below_Ns : !(at.below || at.below_Ns);
  }
  if (t.sides != LobeSides::kBoth && at.below != (t.sides == LobeSides::kTransmit)) return false;
  if (on_curve && (sampled || maths >= Maths::k52)) return true;
  if (sampled && t.leaves_below && maths < Maths::k52) return true;
  if (maths < Maths::k43) {
    const bool refracts = t.is_microfacet && t.sides != LobeSides::kReflect;
    return !sampled || (refracts && at.below) || at.below == at.below_Ng;
  }
  if (sampled) return at.below == at.below_Ng && (t.is_microfacet || maths < Maths::k52 || at.below == at.below_Ns);
  if (maths >= Maths::k52) return at.below == at.below_Ns;
  return !t.is_microfacet || at.below == at.below_Ng;
}

/// The same of all directions, by reach_bit.
struct MixtureReach {
  std::uint32_t bits = 0;
};

/// The bit of a direction for which lights shine; that of its density, which counts in what all lobes sample, is kReachFound
/// higher.
/// @param sampled  as of mixture_reaches
RELIEF_KERNEL constexpr int reach_bit(LobeSide at, bool sampled)
{
  return (at.below ? 1 : 0) + (at.below_Ns ? 2 : 0) + (at.below_Ng ? 4 : 0) + (sampled ? 16 : 0);
}
inline constexpr int kReachFound = 8;

/// By kind, maths, and whether the lobe is on a curve.
struct MixtureReachTable {
  static constexpr int kKinds = sizeof kMixtureTraits / sizeof kMixtureTraits[0];
  static constexpr int kMaths = static_cast<int>(Maths::k52) + 1;
  MixtureReach of[kKinds][kMaths][2];
};

RELIEF_KERNEL constexpr MixtureReachTable mixture_reach_table_make()
{
  MixtureReachTable table{};
  for (int i = 0; i < MixtureReachTable::kKinds * MixtureReachTable::kMaths * 2 * 8; ++i) {
    const int on_curve = i / 8 % 2, maths = i / 16 % MixtureReachTable::kMaths,
              kind = i / 16 / MixtureReachTable::kMaths;
    const MixtureTraits& traits = kMixtureTraits[kind];
    const LobeSide at{(i & 1) != 0, (i & 2) != 0, (i & 4) != 0};
    const auto reaches = [&](bool sampled) {
      return mixture_reaches(traits, static_cast<Maths>(maths), on_curve != 0, at, sampled);
    };
    // Of microfacets Cycles counts the density of what it would not sample, too: a lamp that they see so is not the brighter
    // for it, nor noisier.
    const bool shines[2] = {reaches(false), reaches(true)};
    // A strand's lobe samples directions of both sides, but for others' samples its density counts on its own alone.
    const bool is_found[2] = {traits.is_strand ? shines[0] : shines[1] || (shines[0] && traits.is_microfacet),
                              shines[1]};
    for (const bool sampled : {false, true}) {
      const int bit = reach_bit(at, sampled);
      std::uint32_t& bits = table.of[kind][maths][on_curve].bits;
      if (shines[sampled ? 1 : 0]) bits |= 1u << bit;
      if (is_found[sampled ? 1 : 0]) bits |= 1u << (bit + kReachFound);
    }
  }
  return table;
}

/// A look-up, as every lobe of every hit asks, twice.
inline constexpr MixtureReachTable kMixtureReach = mixture_reach_table_make();

RELIEF_KERNEL MixtureReach mixture_lobe_reach(const MixtureLobe& lobe)
{
  return kMixtureReach.of[static_cast<int>(lobe.kind)][static_cast<int>(lobe.maths)][lobe.is_on_curve ? 1 : 0];
}

RELIEF_KERNEL bool mixture_lobe_reaches(const MixtureLobe& lobe, LobeSide at, bool sampled)
{
  return (mixture_lobe_reach(lobe).bits >> reach_bit(at, sampled) & 1u) != 0;
}

/// Evaluates a lobe.
/// @param wi       the lobe's frame
/// @param through  whether wi goes through the surface: as LobeSide::below, of a direction that the lobe reaches
/// @param sampled  wi was sampled from this lobe
/// @return         f times |cos| to the lobe's own normal, before its weight; pdf as if the lobe were chosen
template <TransportMode kMode>
RELIEF_KERNEL BsdfEval
mixture_lobe_eval(const MixtureLobe& lobe, const BsdfTables& tables, Vec3f wi, bool through, bool sampled)
{
  if (lobe.is_delta || !(__builtin_fabsf(wi.z) > kMinCosine)) return {};
  BsdfEval e =
      mixture_lobe_visit(lobe, [&](const auto& shape) { return lobe_eval<kMode>(shape, lobe, tables, wi, through); });
  const MixtureTraits& traits = mixture_traits(lobe.kind);
  if (traits.is_strand) return e;
  if (traits.has_fresnel) e.f *= mixture_fresnel(lobe.fresnel, half_angle_cosine(lobe.wo, wi));
  if (lobe.is_bent) {
    const bool is_5 = lobe.maths >= Maths::k52;
    // In Cycles what a lobe sends through the surface itself does not fade, as what it is asked for does.
    const bool fades = traits.fading != LobeFading::kNever && !(traits.fading == LobeFading::kBefore52 && is_5) &&
                       !(traits.sides == LobeSides::kTransmit && sampled);
    if (fades) e.f *= is_5 ? bump_shadowing_ggx(lobe.surface_N, wi) : bump_shadowing(lobe.surface_N, wi);
  }
  e.f *= __builtin_fabsf(wi.z);
  return e;
}

/// Samples a lobe. Not inlined, as are all that know every kind of lobe: kernels call them from many places, and with a copy in
/// each were half a megabyte long and slower.
/// @param u_branch  [0, 1): between reflection and refraction
/// @return          in the lobe's frame
template <TransportMode kMode>
[[gnu::noinline]] RELIEF_KERNEL LobeSample mixture_lobe_sample(const MixtureLobe& lobe, float u_branch, Vec2f u)
{
  return mixture_lobe_visit(lobe, [&](const auto& shape) { return lobe_sample<kMode>(shape, lobe, u_branch, u); });
}

/// Widens a lobe to a least width. The energy that it has been given back stays that of before.
RELIEF_KERNEL void lobe_blur(MixtureLobe& lobe, float blur, float most_sharp)
{
  const bool stays = lobe.stays_sharp || !(lobe.roughness < kInfinity) || lobe.roughness <= most_sharp;
  if (stays && !mixture_traits(lobe.kind).is_strand) return;
  const bool is_wider = mixture_lobe_visit(lobe, [&](auto& shape) {
    if constexpr (requires { lobe_widen(shape, lobe.fresnel.eta, blur); }) {
      return lobe_widen(shape, lobe.fresnel.eta, blur);
    } else {
      return false;
    }
  });
  if (!is_wider) return;
  lobe.roughness = max(lobe.roughness, __builtin_sqrtf(blur));
  lobe.is_delta = lobe.is_delta && blur < kDeltaAlpha;
}

}  // namespace relief
