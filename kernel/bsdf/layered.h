// The surface model: glTF's metallic-roughness material with its Khronos layers, as one BSDF with eval, sample and pdf.
//
//   coat                                            KHR_materials_clearcoat
//   over sheen                                      KHR_materials_sheen
//   over mix(dielectric, metal, metallic)
//   dielectric = specular over mix(diffuse, glass, transmission)
//
// The bases (metal; specular over diffuse; specular over thin wall; solid glass) are complete surfaces that each
// conserve energy, so the mixes are plain weighted sums. All but glass share one GGX reflection, because Schlick's
// Fresnel is linear in F0 and F90; glass has the exact Fresnel. Read lobe.h first (what a lobe is), then surface_closure.h
// (the lobes of a hit), then closure_eval and closure_sample, which know none of them by name but the layers.
//
// Conventions. Directions are in the local shading frame, normal +z, unit. Opaque surfaces and thin walls look alike
// from both sides; a solid's inside is z < 0. f excludes |cos|; the pdf is the whole mixture's. f of light that
// crosses a solid's boundary is for radiance over the square of the index, unless kMode says importance. Everything is
// reciprocal but the coat's attenuation of what lies below, which depends on wo alone as in KHR_materials_clearcoat.
#pragma once

#include "kernel/bsdf/surface_closure.h"
#include "kernel/sample/choice.h"

namespace relief {

/// Evaluates a closure with the features it was made with.
/// @param wi_local  unit, the frame that the closure's wo was given in
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance>
RELIEF_KERNEL BsdfEval closure_eval(const SurfaceClosure& c, const BsdfTables& tables, Vec3f wi_local)
{
  const Vec3f wi{wi_local.x, wi_local.y, wi_local.z * c.side};
  BsdfEval e;
  if (!(c.base.wo.z > kMinCosine && __builtin_fabsf(wi.z) > kMinCosine)) return e;

  const auto add = [&]<LobeSides kSides, bool kIsLayer>() {
    lobes_visit<kFeatures>(c.lobes, [&]<typename L>(const L& lobe) {
      if constexpr (L::kSides == kSides && L::kIsLayer == kIsLayer) {
        if (!(lobe.probability > 0.0f)) return;
        const BsdfEval one = lobe_eval<kMode>(lobe, c.base, tables, wi);
        e.f += one.f;
        e.pdf += lobe.probability * one.pdf;
      }
    });
  };
  // By side, so that it is asked for once.
  if (wi.z > 0.0f) {
    add.template operator()<LobeSides::kReflect, false>();
  } else {
    add.template operator()<LobeSides::kTransmit, false>();
  }
  add.template operator()<LobeSides::kBoth, false>();
  if constexpr ((kFeatures & kFeatureLayers) != 0) {
    if (lobe_of<CoatLobe>(c.lobes).strength > 0.0f || lobe_of<SheenLobe>(c.lobes).strength > 0.0f) {
      e.f *= closure_below<kFeatures>(c, tables, wi);
      if (wi.z > 0.0f) add.template operator()<LobeSides::kReflect, true>();
    }
  }
  return e;
}

/// Samples a closure with the features it was made with: one lobe is chosen, and the direction weighed against all of
/// them.
/// @param u_branch  [0, 1): between reflection and refraction at the microfacet that u gives
/// @param u         [0, 1)²: u.x chooses the lobe, and what is left of it is half of the direction, see ChoicePoint
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance>
RELIEF_KERNEL BsdfSample closure_sample(const SurfaceClosure& c, const BsdfTables& tables, float u_branch, Vec2f u)
{
  LobeSample d;
  float probability = 0.0f;
  bool is_layer = false;
  lobes_visit_until<kFeatures>(c.lobes, [&]<typename L>(const L& lobe) {
    if (!(u.x < lobe.probability)) {
      u.x -= lobe.probability;
      return false;
    }
    d = lobe_sample<kMode>(lobe, c.base, tables, u_branch, {choice_rest(u.x, lobe.probability), u.y});
    probability = lobe.probability;
    is_layer = L::kIsLayer;
    return true;
  });

  // Lost among the microfacets: the ray left on the side it cannot have left on.
  if (d.bits == 0 || (d.wi.z < 0.0f) != ((d.bits & kLobeTransmit) != 0)) return {};
  BsdfSample s;
  s.wi = {d.wi.x, d.wi.y, d.wi.z * c.side};
  s.roughness = d.roughness;
  s.eta = d.eta;
  s.lobe = d.bits;
  if ((d.bits & kLobeDelta) != 0) {
    const float cos_i = __builtin_fabsf(d.wi.z);
    if (!(cos_i > kMinCosine)) return {};
    s.f = d.reflectance * ((is_layer ? 1.0f : closure_below<kFeatures>(c, tables, d.wi)) / cos_i);
    s.pdf = probability * d.probability;
    return s;
  }
  const BsdfEval e = closure_eval<kFeatures, kMode>(c, tables, s.wi);
  s.f = e.f;
  s.pdf = e.pdf;
  return s;
}

/// Calls f<features>() with the features that a surface needs of those its kernel has. Most surfaces of a scene with
/// glass or coats have neither; this spares them the state and the branches (measured: a fifth of a diffuse sample's
/// time).
template <unsigned kFeatures, typename F>
RELIEF_KERNEL auto with_needed_features(const SurfaceParams& p, F&& f)
{
  constexpr unsigned kRare = kFeatureTransmission | kFeatureLayers;
  if constexpr ((kFeatures & kRare) != 0) {
    const bool plain = p.transmission == 0.0f && p.clearcoat == 0.0f && is_zero(p.sheen_color);
    if (plain) return f.template operator()<kFeatures & ~kRare>();
  }
  return f.template operator()<kFeatures>();
}

/// Evaluates the surface. Flattened, as surface_sample is: with its callees inlined the closure stays in registers,
/// which measured a third faster for diffuse and metal.
/// @param wo, wi  unit, local shading frame
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance>
[[gnu::flatten]] RELIEF_KERNEL BsdfEval
surface_eval(const SurfaceParams& p, const BsdfTables& tables, Vec3f wo, Vec3f wi)
{
  return with_needed_features<kFeatures>(p, [&]<unsigned kNeeded>() {
    return closure_eval<kNeeded, kMode>(surface_closure_make<kNeeded>(p, tables, wo), tables, wi);
  });
}

/// Samples the surface.
/// @param wo           unit, local shading frame
/// @param u_branch, u  see closure_sample
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance>
[[gnu::flatten]] RELIEF_KERNEL BsdfSample
surface_sample(const SurfaceParams& p, const BsdfTables& tables, Vec3f wo, float u_branch, Vec2f u)
{
  return with_needed_features<kFeatures>(p, [&]<unsigned kNeeded>() {
    return closure_sample<kNeeded, kMode>(surface_closure_make<kNeeded>(p, tables, wo), tables, u_branch, u);
  });
}

/// Whether the surface has nothing but delta lobes, so that lights need not be sampled: surface_eval would be zero.
RELIEF_KERNEL bool surface_is_delta(const SurfaceParams& p)
{
  if (p.unlit) return true;
  const bool has_diffuse = p.metallic < 1.0f && p.transmission < 1.0f && !is_zero(p.base_color);
  const bool rough = sqr(p.roughness) >= kDeltaAlpha;
  const bool rough_coat = p.clearcoat > 0.0f && sqr(p.clearcoat_roughness) >= kDeltaAlpha;
  return !has_diffuse && !rough && !rough_coat && is_zero(p.sheen_color);
}

}  // namespace relief
