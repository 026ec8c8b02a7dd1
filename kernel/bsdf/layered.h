// The surface model: glTF's metallic-roughness material with its Khronos layers, as one BSDF with eval, sample and pdf.
//
//   coat                                            KHR_materials_clearcoat
//   over sheen                                      KHR_materials_sheen
//   over mix(dielectric, metal, metallic)
//   dielectric = specular over mix(diffuse, glass, transmission)
//
// The bases (metal; specular over diffuse; specular over thin wall; solid glass) are complete surfaces that each
// conserve energy, so the mixes are plain weighted sums. All but glass share one GGX reflection, because Schlick's
// Fresnel is linear in F0 and F90; glass has the exact Fresnel. Read surface_closure.h first (a hit's constants), then
// closure_eval, closure_sample.
//
// Conventions. Directions are in the local shading frame, normal +z, unit. Opaque surfaces and thin walls look alike
// from both sides; a solid's inside is z < 0. f excludes |cos|; the pdf is the whole mixture's. f of light that
// crosses a solid's boundary is for radiance, scaled by (eta_i / eta_t)², unless kMode says importance. Everything is
// reciprocal but the coat's attenuation of what lies below, which depends on wo alone as in KHR_materials_clearcoat.
#pragma once

#include "kernel/bsdf/surface_closure.h"
#include "kernel/bsdf/thin_wall.h"

namespace relief {

enum LobeBit : std::uint8_t {
  kLobeReflect = 1u << 0,
  kLobeTransmit = 1u << 1,
  kLobeDiffuse = 1u << 2,
  kLobeGlossy = 1u << 3,
  kLobeDelta = 1u << 4,
};

/// The BSDF for two directions; delta lobes contribute nothing.
struct BsdfEval {
  Vec3f f{};      ///< 1/sr, without |cos|
  float pdf = 0;  ///< solid angle of wi under surface_sample
};

/// A sampled direction. f·|cos|/pdf is the factor on the throughput.
struct BsdfSample {
  Vec3f wi{};
  Vec3f f{};      ///< of the whole surface at wi; delta lobes: of this lobe alone
  float pdf = 0;  ///< solid angle; delta lobes: probability of this lobe; 0: absorbed, nothing else means anything
  float roughness = 0;    ///< GGX alpha of the lobe, for ray cones; 1 for diffuse lobes and sheen, 0 for delta lobes
  float eta = 1;          ///< index of wi's side / index of wo's side; 1 unless refracted
  std::uint8_t lobe = 0;  ///< LobeBits: reflect or transmit; and diffuse, glossy or delta
};

/// What coat and sheen leave for the lobes below them.
/// @param wi  turned to wo's side
template <unsigned kFeatures>
RELIEF_KERNEL float closure_below(const SurfaceClosure& c, const BsdfTables& tables, Vec3f wi)
{
  if constexpr ((kFeatures & kFeatureLayers) == 0) return 1.0f;
  const LayersClosure& layers = c.layers;
  float transmits = layers.coat_transmits;
  float sheen = layers.sheen_o.albedo;
  // From inside a solid the layers lie on the side that wi leaves on.
  const float outer_z = c.inside ? -wi.z : wi.z;
  if (outer_z > 0.0f) {
    if (c.inside && layers.coat > 0.0f) {
      transmits = coat_transmits(layers, tables, dot(layers.coat_frame.n, {wi.x, wi.y, outer_z}));
    }
    if (layers.sheen_max > 0.0f) sheen = max(sheen, sheen_albedo(tables, layers.sheen_table, outer_z).albedo);
  }
  return transmits * (1.0f - layers.sheen_max * sheen);
}

/// Adds coat and sheen to an evaluation whose f holds what lies below.
/// @param wi  z > 0
RELIEF_KERNEL void closure_add_layers(const SurfaceClosure& c, const BsdfTables& tables, Vec3f wi, BsdfEval& e)
{
  const LayersClosure& layers = c.layers;
  if (c.probability.sheen > 0.0f) {
    const float bound = min(layers.sheen_o.bound, sheen_albedo(tables, layers.sheen_table, wi.z).bound);
    e.f += layers.sheen * (layers.coat_transmits * bound * sheen_eval(c.wo, wi, layers.sheen_roughness));
    e.pdf += c.probability.sheen * sheen_pdf(wi);
  }
  if (c.probability.coat > 0.0f && !layers.coat_table.mirror) {
    const GgxReflection r =
        clearcoat_eval(layers.coat_wo, to_local(layers.coat_frame, wi), wi.z, layers.coat_table.alpha);
    e.f += splat3(layers.coat * r.f);
    e.pdf += c.probability.coat * r.pdf;
  }
}

/// Rough glass; f for radiance or importance, tinted where it crosses.
template <TransportMode kMode>
RELIEF_KERNEL BsdfEval glass_closure_eval(const SurfaceClosure& c, const BsdfTables& tables, Vec3f wi)
{
  const GlassClosure& glass = c.glass;
  const bool crosses = wi.z < 0.0f;
  const DielectricEval single = dielectric_eval(c.wo, wi, c.ggx.alpha, glass.eta);
  float f = single.f;
  float pdf = single.pdf;
  if (glass.lost > 0.0f) {
    const float cos_i = __builtin_fabsf(wi.z);
    const int side = crosses ? 1 - glass.table.side : glass.table.side;
    const float lost_i = glass_lost(tables, glass.table, side, cos_i);
    const float share = crosses ? 1.0f - glass.reflect_share : glass.reflect_share;
    f += share * diffuse_coupled_eval(splat3(1.0f), glass.lost, lost_i, crosses ? glass.mean_far : glass.mean_near).x;
    pdf = lerp(glass.lost, pdf, share * multiple_scattering_pdf(c.scattering, cos_i));
  }
  f *= glass.weight;
  return {crosses ? c.transmission_color * (f * transmission_scale<kMode>(glass.eta)) : splat3(f), pdf};
}

/// Evaluates a closure with the features it was made with.
/// @param wi_local  unit, the frame that the closure's wo was given in
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance>
RELIEF_KERNEL BsdfEval closure_eval(const SurfaceClosure& c, const BsdfTables& tables, Vec3f wi_local)
{
  const Vec3f wi{wi_local.x, wi_local.y, wi_local.z * c.side};
  const LobeProbabilities& probability = c.probability;
  BsdfEval e;
  if (!(c.wo.z > kMinCosine && __builtin_fabsf(wi.z) > kMinCosine)) return e;

  if (wi.z > 0.0f) {
    if (probability.specular > 0.0f && !c.ggx.mirror) {
      const GgxReflection r = ggx_reflection_eval(c.wo, wi, c.ggx.alpha);
      e.f = fresnel_schlick(c.F0, c.F90, r.cos_d) * r.f;
      e.pdf = probability.specular * r.pdf;
    }
    if (probability.diffuse > 0.0f) {
      float transmits = 1.0f;
      if (c.under_F90 > 0.0f) {
        transmits = 1.0f - ggx_albedo_with(c.under_F0, c.under_F90, ggx_albedo(tables, c.ggx, wi.z));
      }
      e.f += c.diffuse * transmits;
      e.pdf += probability.diffuse * diffuse_pdf(wi);
    }
    if (probability.multiple > 0.0f) {
      e.f += c.multiple * ggx_albedo(tables, c.ggx, wi.z).lost;
      e.pdf += probability.multiple * multiple_scattering_pdf(c.scattering, wi.z);
    }
  }
  if constexpr ((kFeatures & kFeatureTransmission) != 0) {
    if (wi.z < 0.0f && probability.thin > 0.0f && !c.ggx.mirror) {
      const GgxReflection r = thin_wall_eval(c.wo, wi, c.ggx.alpha);
      const float F = fresnel_schlick(splat3(c.under_F0), c.under_F90, r.cos_d).x;
      e.f = c.transmission_color * (c.thin_weight * (1.0f - F) * r.f);
      e.pdf = probability.thin * r.pdf;
    }
    if (wi.z < 0.0f && probability.thin_multiple > 0.0f) {
      e.f += c.thin_multiple * ggx_albedo(tables, c.ggx, -wi.z).lost;
      e.pdf += probability.thin_multiple * multiple_scattering_pdf(c.scattering, -wi.z);
    }
    if (probability.glass > 0.0f && !c.glass.delta) {
      const BsdfEval g = glass_closure_eval<kMode>(c, tables, wi);
      e.f += g.f;
      e.pdf += probability.glass * g.pdf;
    }
  }
  if constexpr ((kFeatures & kFeatureLayers) != 0) {
    if (c.layers.coat > 0.0f || c.layers.sheen_max > 0.0f) {
      e.f *= closure_below<kFeatures>(c, tables, wi);
      if (wi.z > 0.0f) closure_add_layers(c, tables, wi, e);
    }
  }
  return e;
}

/// A sample of a delta lobe.
/// @param wi           turned to wo's side
/// @param reflectance  throughput of the lobe, its probability not divided out
RELIEF_KERNEL BsdfSample delta_sample(const SurfaceClosure& c, Vec3f wi, Vec3f reflectance, float probability)
{
  const float cos_i = __builtin_fabsf(wi.z);
  if (!(cos_i > kMinCosine)) return {};
  BsdfSample s;
  s.wi = {wi.x, wi.y, wi.z * c.side};
  s.f = reflectance / cos_i;
  s.pdf = probability;
  s.lobe = static_cast<std::uint8_t>(kLobeDelta | (wi.z > 0.0f ? kLobeReflect : kLobeTransmit));
  return s;
}

/// Samples smooth or index-matched glass.
template <unsigned kFeatures, TransportMode kMode>
RELIEF_KERNEL BsdfSample glass_sample_delta(const SurfaceClosure& c, const BsdfTables& tables, float u_choice)
{
  const float probability = c.probability.glass;
  const float weight = c.glass.weight;
  if (dielectric_is_matched(c.glass.eta)) {
    const Vec3f straight = -c.wo;
    return delta_sample(c, straight, c.transmission_color * (weight * closure_below<kFeatures>(c, tables, straight)),
                        probability);
  }
  const float eta = c.glass.eta;
  const float cos_t = refracted_cosine(c.wo.z, eta);
  const float F = fresnel_dielectric(c.wo.z, cos_t, eta);
  if (u_choice < F) {
    const Vec3f wi{-c.wo.x, -c.wo.y, c.wo.z};
    return delta_sample(c, wi, splat3(weight * F * closure_below<kFeatures>(c, tables, wi)), probability * F);
  }
  const Vec3f wi = normalize({-c.wo.x / eta, -c.wo.y / eta, -cos_t});
  const float scale = (1.0f - F) * weight * transmission_scale<kMode>(eta) * closure_below<kFeatures>(c, tables, wi);
  BsdfSample s = delta_sample(c, wi, c.transmission_color * scale, probability * (1.0f - F));
  s.eta = eta;
  return s;
}

/// Samples a closure with the features it was made with: one lobe is chosen, and the direction weighed against all of
/// them.
/// @param u_lobe  [0, 1): chooses the lobe, and what is left of it between reflection and refraction
/// @param u       [0, 1)²: direction
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance>
RELIEF_KERNEL BsdfSample closure_sample(const SurfaceClosure& c, const BsdfTables& tables, float u_lobe, Vec2f u)
{
  const LobeProbabilities& probability = c.probability;
  BsdfSample s;
  Vec3f wi;
  bool transmits = false;
  // Whether u_lobe falls into the next lobe's share; what is left of it starts at the following one.
  const auto chosen = [&u_lobe](float share) {
    if (u_lobe < share) return true;
    u_lobe -= share;
    return false;
  };
  const auto as_diffuse = [&s] {
    s.lobe = kLobeDiffuse;
    s.roughness = 1.0f;
  };
  const auto as_glossy = [&s](float alpha) {
    s.lobe = kLobeGlossy;
    s.roughness = alpha;
  };

  if (chosen(probability.diffuse)) {
    wi = diffuse_sample(u);
    as_diffuse();
  } else if (chosen(probability.multiple)) {
    wi = multiple_scattering_sample(c.scattering, u);
    as_diffuse();
  } else if (chosen(probability.specular)) {
    if (c.ggx.mirror) {
      wi = {-c.wo.x, -c.wo.y, c.wo.z};
      const Vec3f F = fresnel_schlick(c.F0, c.F90, c.wo.z) * closure_below<kFeatures>(c, tables, wi);
      return delta_sample(c, wi, F, probability.specular);
    }
    wi = ggx_reflection_sample(c.wo, c.ggx.alpha, u);
    as_glossy(c.ggx.alpha);
  } else {
    bool found = false;
    if constexpr ((kFeatures & kFeatureTransmission) != 0) {
      found = true;
      if (chosen(probability.glass)) {
        const GlassClosure& glass = c.glass;
        float u_choice = u_lobe / probability.glass;
        if (glass.delta) return glass_sample_delta<kFeatures, kMode>(c, tables, u_choice);
        if (u_choice < glass.lost) {
          u_choice /= glass.lost;
          transmits = u_choice >= glass.reflect_share;
          wi = multiple_scattering_sample(c.scattering, u);
          if (transmits) wi = -wi;
          as_diffuse();
        } else {
          u_choice = (u_choice - glass.lost) / (1.0f - glass.lost);
          const DielectricSample d = dielectric_sample(c.wo, c.ggx.alpha, glass.eta, u_choice, u);
          transmits = d.transmitted;
          wi = d.wi;
          as_glossy(c.ggx.alpha);
        }
        if (transmits) s.eta = glass.eta;
      } else if (chosen(probability.thin)) {
        transmits = true;
        if (c.ggx.mirror) {
          wi = -c.wo;
          const float F = fresnel_schlick(splat3(c.under_F0), c.under_F90, c.wo.z).x;
          const float scale = c.thin_weight * (1.0f - F) * closure_below<kFeatures>(c, tables, wi);
          return delta_sample(c, wi, c.transmission_color * scale, probability.thin);
        }
        wi = thin_wall_sample(c.wo, c.ggx.alpha, u);
        as_glossy(c.ggx.alpha);
      } else if (chosen(probability.thin_multiple)) {
        transmits = true;
        wi = thin_wall_mirror(multiple_scattering_sample(c.scattering, u));
        as_diffuse();
      } else {
        found = false;
      }
    }
    if constexpr ((kFeatures & kFeatureLayers) != 0) {
      const LayersClosure& layers = c.layers;
      if (!found && chosen(probability.coat)) {
        found = true;
        if (layers.coat_table.mirror) {
          const Vec3f N = layers.coat_frame.n;
          wi = 2.0f * layers.coat_wo.z * N - c.wo;
          if (!(wi.z > 0.0f)) return {};
          const float F = kClearcoatF0 + (1.0f - kClearcoatF0) * schlick_weight(layers.coat_wo.z);
          return delta_sample(c, wi, splat3(layers.coat * F), probability.coat);
        }
        const Vec3f wi_coat = clearcoat_sample(layers.coat_wo, layers.coat_table.alpha, u);
        // Below a tilted coat's horizon can still be above the surface's, where the coat has no density.
        if (!(wi_coat.z > kMinCosine)) return {};
        wi = from_local(layers.coat_frame, wi_coat);
        as_glossy(layers.coat_table.alpha);
      } else if (!found && probability.sheen > 0.0f) {
        found = true;
        wi = sheen_sample(u);
        as_diffuse();
      }
    }
    if (!found) return {};
  }

  // Lost among the microfacets: the ray left on the side it cannot have left on.
  if ((wi.z < 0.0f) != transmits) return {};
  s.wi = {wi.x, wi.y, wi.z * c.side};
  const BsdfEval e = closure_eval<kFeatures, kMode>(c, tables, s.wi);
  s.f = e.f;
  s.pdf = e.pdf;
  s.lobe = static_cast<std::uint8_t>(s.lobe | (transmits ? kLobeTransmit : kLobeReflect));
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
/// @param wo      unit, local shading frame
/// @param u_lobe  [0, 1): see closure_sample
/// @param u       [0, 1)²
template <unsigned kFeatures, TransportMode kMode = TransportMode::kRadiance>
[[gnu::flatten]] RELIEF_KERNEL BsdfSample
surface_sample(const SurfaceParams& p, const BsdfTables& tables, Vec3f wo, float u_lobe, Vec2f u)
{
  return with_needed_features<kFeatures>(p, [&]<unsigned kNeeded>() {
    return closure_sample<kNeeded, kMode>(surface_closure_make<kNeeded>(p, tables, wo), tables, u_lobe, u);
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
