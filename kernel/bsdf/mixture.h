// A surface that is a weighted list of lobes, each about a normal of its own: what Mix and Add Shader, and the Principled
// BSDF, mean. Sampled and evaluated as one mixture. mixture_make.h fills it from a material's closures.
//
// Closures of glTF's layered material (surface_closure.h) have the same functions, so that stages need not ask which of the
// two they have.
#pragma once

#include "kernel/bsdf/lobe_split.h"
#include "kernel/bsdf/mixture_lobe.h"
#include "kernel/math/rounding.h"

namespace relief {

/// Lobes that a surface may have at a point; loading refuses materials that may have more.
inline constexpr int kMostMixtureLobes = 64;

/// The lobes of one hit.
struct MixtureLobes {
  MixtureLobes() : none(0) {}
  int size = 0;
  union {  // room for many, of which few are filled
    char none;
    MixtureLobe lobes[kMostMixtureLobes];
  };
};

/// Those of a hit's lobes that are asked for.
struct Mixture {
  const MixtureLobes* all;
  Frame frame;           ///< of the surface: directions are given in it
  Vec3f Ng;              ///< its geometric normal, on the frame's side
  std::uint64_t chosen;  ///< bit by lobe
  float scale;           ///< of the chosen lobes' probabilities, which then sum to one
  float gain;            ///< factor on f: what makes up for the chance of a path to meet the lobes at all
};

/// Calls f(lobe) for the chosen lobes, in their order.
template <typename F>
RELIEF_KERNEL void mixture_visit(const Mixture& m, F&& f)
{
  for (std::uint64_t left = m.chosen; left != 0; left &= left - 1) {
    f(m.all->lobes[static_cast<std::size_t>(__builtin_ctzll(left))]);
  }
}

/// All lobes of a hit.
RELIEF_KERNEL Mixture mixture_of(const MixtureLobes& lobes, const Frame& frame, Vec3f Ng, float gain = 1.0f)
{
  const std::uint64_t chosen = lobes.size < 64 ? (std::uint64_t{1} << lobes.size) - 1 : ~std::uint64_t{0};
  Mixture m{&lobes, frame, Ng, chosen, 0.0f, gain};
  float sum = 0.0f;
  mixture_visit(m, [&](const MixtureLobe& lobe) { sum += lobe.probability; });
  m.scale = sum > 0.0f ? 1.0f / sum : 0.0f;
  return m;
}

/// The lobes for which wanted(lobe) is true.
template <typename F>
RELIEF_KERNEL Mixture mixture_choose(const Mixture& m, F&& wanted)
{
  Mixture part{m.all, m.frame, m.Ng, 0, 0.0f, m.gain};
  float sum = 0.0f;
  for (std::uint64_t left = m.chosen; left != 0; left &= left - 1) {
    const MixtureLobe& lobe = m.all->lobes[__builtin_ctzll(left)];
    if (!wanted(lobe)) continue;
    part.chosen |= left & -left;
    sum += lobe.probability;
  }
  part.scale = sum > 0.0f ? 1.0f / sum : 0.0f;
  return part;
}

/// The lobes that are sharp, or those that are soft; the same for both.
template <bool kSharp>
RELIEF_KERNEL Mixture mixture_part(const Mixture& m, SharpLobes sharp)
{
  return mixture_choose(
      m, [sharp](const MixtureLobe& lobe) { return mixture_lobe_is_sharp(lobe, sharp.most_roughness) == kSharp; });
}

/// f and pdf of the chosen lobes. Not inlined, and all kinds of lobes are in it: kernels ask from many places, and a call a lobe
/// cost as much as most lobes.
/// @param wi_local  in the surface's frame
/// @param sampled   the lobe that wi was sampled from; null: it was not. Then f is without that of lobes that are followed instead of
///                  asked (mixture_follow_fibre), and such that over pdf, which is of all, it is what the others' samples stand for
/// @param through   whether that lobe sent it through the surface
template <TransportMode kMode>
[[gnu::noinline]] RELIEF_KERNEL BsdfEval
mixture_eval(const Mixture& m, const BsdfTables& tables, Vec3f wi_local, const MixtureLobe* sampled, bool through)
{
  BsdfEval e;
  const float cos_i = __builtin_fabsf(wi_local.z);
  if (!(cos_i > kMinCosine)) return e;
  float followed = 0;  // density of the lobes that would have been followed
  const Vec3f wi = from_local(m.frame, wi_local);
  const bool below_Ns = wi_local.z < 0.0f, below_Ng = dot(wi, m.Ng) < 0.0f;
  mixture_visit(m, [&](const MixtureLobe& lobe) {
    const Vec3f wi_lobe = to_local(lobe.frame, wi);
    const bool is_own = &lobe == sampled;
    const bool below = is_own ? through : wi_lobe.z < 0.0f;
    const std::uint32_t reach = mixture_lobe_reach(lobe).bits >> reach_bit({below, below_Ns, below_Ng}, is_own);
    const bool shines = (reach & 1u) != 0, is_found = (reach >> kReachFound & 1u) != 0;
    if (!shines && !is_found) return;
    if (sampled != nullptr && lobe.kind == MixtureLobeKind::kFacetFibre) {
      followed += lobe.probability * facet_fibre_pdf(lobe.shape.facet_fibre, lobe.fresnel.eta, lobe.wo, wi_lobe);
      return;
    }
    const BsdfEval one = mixture_lobe_eval<kMode>(lobe, tables, wi_lobe, below, is_own);
    if (shines) e.f += lobe.weight * one.f;
    if (is_found) e.pdf += lobe.probability * one.pdf;
  });
  e.f *= m.gain / cos_i;
  if (__builtin_expect(followed > 0.0f, 0)) {
    e.f *= e.pdf > 0.0f ? (e.pdf + followed) / e.pdf : 0.0f;
    e.pdf += followed;
  }
  e.pdf *= m.scale;
  return e;
}

/// Samples a fibre by following light through it. What other lobes send the same way is theirs to find; so all have the density
/// by which lights are weighed against what is sampled, which is nearly that of the samples, and no more.
/// @pre  chosen is a lobe of facet fibres
template <TransportMode kMode>
[[gnu::noinline]] RELIEF_KERNEL BsdfSample
mixture_follow_fibre(const Mixture& m, const MixtureLobe& chosen, const BsdfTables& tables, float u_branch, Vec2f u)
{
  const FacetFibre& fibre = chosen.shape.facet_fibre;
  const FacetFibreSample d = facet_fibre_sample(fibre, chosen.fresnel.eta, tables, chosen.wo, u_branch, u);
  BsdfSample s;
  s.wi = to_local(m.frame, from_local(chosen.frame, d.wi));
  const float cos_i = __builtin_fabsf(s.wi.z);
  if (!(max_component(d.weight) > 0.0f && cos_i > kMinCosine)) return {};
  s.pdf = mixture_eval<kMode>(m, tables, s.wi, &chosen, !d.is_reflected).pdf;
  s.f = chosen.weight * d.weight * (m.gain * s.pdf / (chosen.probability * m.scale * cos_i));
  s.roughness = fibre.alpha;
  s.lobe = kLobeGlossy | (d.is_reflected ? kLobeReflect : kLobeTransmit);
  return s;
}

/// As closure_eval of a SurfaceClosure.
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance>
RELIEF_KERNEL BsdfEval closure_eval(const Mixture& m, const BsdfTables& tables, Vec3f wi_local)
{
  return mixture_eval<kMode>(m, tables, wi_local, nullptr, false);
}

/// As closure_sample of a SurfaceClosure.
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance>
RELIEF_KERNEL BsdfSample closure_sample(const Mixture& m, const BsdfTables& tables, float u_branch, Vec2f u)
{
  const MixtureLobe* chosen = nullptr;
  for (std::uint64_t left = m.chosen; left != 0; left &= left - 1) {
    const MixtureLobe& lobe = m.all->lobes[__builtin_ctzll(left)];
    const float probability = lobe.probability * m.scale;
    if (!(probability > 0.0f)) continue;
    chosen = &lobe;
    if (u.x < probability) {
      u.x /= probability;
      break;
    }
    u.x -= probability;
  }
  if (chosen == nullptr) return {};
  // Rounding may leave a little over behind the last lobe.
  u.x = min(u.x, 1.0f - kUnitRoundoff);
  if (chosen->kind == MixtureLobeKind::kSubsurface) {
    const Vec3f wi = from_local(chosen->frame, subsurface_enter(chosen->shape.subsurface, chosen->wo, u));
    if (!(dot(wi, m.Ng) < 0.0f)) return {};
    BsdfSample s;
    s.wi = to_local(m.frame, wi);
    s.f = chosen->weight * m.gain;
    s.pdf = chosen->probability * m.scale;
    s.lobe = kLobeSubsurface;
    s.entered = static_cast<std::uint32_t>(chosen - m.all->lobes);
    return s;
  }
  if (chosen->kind == MixtureLobeKind::kFacetFibre) {
    return mixture_follow_fibre<kMode>(m, *chosen, tables, u_branch, u);
  }
  const LobeSample d = mixture_lobe_sample<kMode>(*chosen, u_branch, u);
  const bool through = (d.bits & kLobeTransmit) != 0;
  const bool is_lost = (d.wi.z < 0.0f) != through && !mixture_traits(chosen->kind).is_strand &&
                       (through || !chosen->mirrors_below || chosen->is_on_curve);
  if (d.bits == 0 || is_lost) return {};
  BsdfSample s;
  const Vec3f wi = from_local(chosen->frame, d.wi);
  s.wi = to_local(m.frame, wi);
  if (!mixture_lobe_reaches(*chosen, {through, s.wi.z < 0.0f, dot(wi, m.Ng) < 0.0f}, true) ||
      !(__builtin_fabsf(s.wi.z) > kMinCosine)) {
    return {};
  }
  s.roughness = d.roughness;
  s.eta = d.eta;
  s.lobe = d.bits;
  if ((d.bits & kLobeDelta) != 0) {
    s.f = chosen->weight * d.reflectance * (m.gain / __builtin_fabsf(s.wi.z));
    s.pdf = chosen->probability * m.scale * d.probability;
    return s;
  }
  const BsdfEval e = mixture_eval<kMode>(m, tables, s.wi, chosen, through);
  s.f = e.f;
  s.pdf = e.pdf;
  return s;
}

RELIEF_KERNEL Mixture closure_sharp(const Mixture& m, SharpLobes sharp) { return mixture_part<true>(m, sharp); }
RELIEF_KERNEL Mixture closure_soft(const Mixture& m, SharpLobes sharp) { return mixture_part<false>(m, sharp); }
RELIEF_KERNEL Mixture closure_diffuse(const Mixture& m) { return mixture_choose(m, mixture_lobe_is_diffuse); }
RELIEF_KERNEL Mixture closure_matte(const Mixture& m)
{
  return mixture_choose(m,
                        [](const MixtureLobe& lobe) { return mixture_lobe_event(lobe.kind) == EventKind::kDiffuse; });
}

/// As of layered surfaces; but all that a fibre does is glossy, as in Cycles.
RELIEF_KERNEL EventKind closure_other_event(const Mixture& m, bool transmitted)
{
  bool has_fibre = false;
  mixture_visit(m, [&](const MixtureLobe& lobe) {
    has_fibre = has_fibre || lobe.kind == MixtureLobeKind::kFibre || lobe.kind == MixtureLobeKind::kFacetFibre;
  });
  return transmitted && !has_fibre ? EventKind::kTransmission : EventKind::kGlossy;
}

template <bool kSharp>
RELIEF_KERNEL bool closure_has(const Mixture& m, SharpLobes sharp)
{
  return mixture_part<kSharp>(m, sharp).scale > 0.0f;
}

/// Whether there is nothing but delta lobes, so that lights need not be sampled.
RELIEF_KERNEL bool lobes_are_delta(const MixtureLobes& lobes)
{
  bool are_delta = true;
  for (int i = 0; i < lobes.size; ++i) are_delta = are_delta && lobes.lobes[i].is_delta;
  return are_delta;
}

}  // namespace relief
