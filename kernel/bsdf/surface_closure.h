// The surface model at one hit, its parameters resolved for one wo: albedos looked up, lobes weighted. Made once, then
// evaluated and sampled by layered.h, whose head describes the model.
#pragma once

#include "kernel/bsdf/clearcoat.h"
#include "kernel/bsdf/diffuse.h"
#include "kernel/bsdf/energy_tables.h"
#include "kernel/bsdf/multiple_scattering.h"
#include "kernel/bsdf/surface_params.h"

namespace relief {

/// Mean losses below this are left lost: smaller ones are mostly rounding, and they are divided by.
inline constexpr float kLeastMeanLost = 1e-6f;

/// What sampling chooses among; each lobe's probability is proportional to an estimate of its largest channel's albedo.
struct LobeProbabilities {
  float specular = 0;       ///< GGX reflection
  float diffuse = 0;        ///< cosine
  float multiple = 0;       ///< multiple scattering, reflected
  float thin = 0;           ///< GGX through a thin wall
  float thin_multiple = 0;  ///< multiple scattering, through a thin wall
  float glass = 0;
  float sheen = 0;
  float coat = 0;
};

/// Solid glass: exact Fresnel, refraction.
struct GlassClosure {
  float weight = 0;  ///< share of the surface
  float eta = 1;     ///< index of the far side / index of wo's side
  bool delta = false;
  GlassCoordinate table;
  float lost = 0;                     ///< 1 − E(wo): to be scattered again
  float reflect_share = 1;            ///< of what is scattered again
  float mean_near = 0, mean_far = 0;  ///< mean of 1 − E on wo's side and on the other
};

/// Coat and sheen.
struct LayersClosure {
  float coat = 0;
  Frame coat_frame;
  Vec3f coat_wo{};  ///< coat's frame
  GgxCoordinate coat_table;
  Vec3f sheen{};
  float sheen_max = 0, sheen_roughness = 0;
  TableCoordinate sheen_table;
  SheenAlbedo sheen_o;
  float coat_transmits = 1;  ///< what the coat leaves for below, seen from wo
};

struct SurfaceClosure {
  Vec3f wo{};           ///< turned so that z > 0
  float side = 1;       ///< −1 where wo was below: the z of every other direction is multiplied by it
  bool inside = false;  ///< wo is inside a solid: coat and sheen lie on the far side
  LobeProbabilities probability;

  GgxCoordinate ggx;  ///< of all lobes but the coat
  Vec3f F0{};         ///< of the GGX reflection: metal, dielectric and thin wall together, weighted
  float F90 = 0;
  Vec3f diffuse{};                    ///< f of the diffuse base over what the interface lets through towards wi
  float under_F0 = 0, under_F90 = 0;  ///< the interface over diffuse base and thin wall; both 0: there is none
  MultipleScattering scattering;
  Vec3f multiple{}, thin_multiple{};  ///< f of multiple scattering, reflected and transmitted, over 1 − E(wi)
  Vec3f transmission_color{};         ///< tint of all that crosses
  float thin_weight = 0;
  GlassClosure glass;
  LayersClosure layers;
};

/// What a coat leaves for below.
/// @param cos_theta  to the coat's normal
RELIEF_KERNEL float coat_transmits(const LayersClosure& layers, const BsdfTables& tables, float cos_theta)
{
  if (!(cos_theta > kMinCosine)) return 1.0f;
  const GgxAlbedo e = ggx_albedo(tables, layers.coat_table, cos_theta);
  return 1.0f - layers.coat * ggx_albedo_with(kClearcoatF0, 1.0f, e);
}

/// Coat and sheen of a hit, and their unnormalised probabilities.
/// @return what they leave for below, seen from wo
RELIEF_KERNEL float layers_closure_make(const SurfaceParams& p, const BsdfTables& tables, SurfaceClosure& c)
{
  LayersClosure& layers = c.layers;
  layers.coat = p.clearcoat;
  if (p.clearcoat > 0.0f) {
    layers.coat_table = ggx_coordinate(p.clearcoat_roughness);
    layers.coat_frame = frame_from_normal(p.clearcoat_N);
    if (!c.inside) {
      layers.coat_wo = to_local(layers.coat_frame, c.wo);
      layers.coat_transmits = coat_transmits(layers, tables, layers.coat_wo.z);
      c.probability.coat = 1.0f - layers.coat_transmits;
    }
  }
  layers.sheen = p.sheen_color;
  layers.sheen_max = max_component(p.sheen_color);
  float sheen_transmits = 1.0f;
  if (layers.sheen_max > 0.0f) {
    layers.sheen_roughness = p.sheen_roughness;
    layers.sheen_table = sheen_table_roughness(p.sheen_roughness);
    if (!c.inside) {
      layers.sheen_o = sheen_albedo(tables, layers.sheen_table, c.wo.z);
      const float albedo = layers.sheen_max * layers.sheen_o.albedo;
      c.probability.sheen = layers.coat_transmits * albedo;
      sheen_transmits = 1.0f - albedo;
    }
  }
  return layers.coat_transmits * sheen_transmits;
}

/// Solid glass of a hit.
RELIEF_KERNEL GlassClosure glass_closure_make(const SurfaceParams& p,
                                              const BsdfTables& tables,
                                              const SurfaceClosure& c,
                                              float weight)
{
  GlassClosure glass;
  glass.weight = weight;
  glass.eta = c.inside ? 1.0f / p.ior : p.ior;
  glass.delta = c.ggx.mirror || dielectric_is_matched(glass.eta);
  if (glass.delta) return glass;
  glass.table = glass_coordinate(glass.eta, p.roughness);
  glass.mean_near = glass_lost_mean(tables, glass.table, glass.table.side);
  glass.mean_far = glass_lost_mean(tables, glass.table, 1 - glass.table.side);
  if (min(glass.mean_near, glass.mean_far) > kLeastMeanLost) {
    glass.lost = glass_lost(tables, glass.table, glass.table.side, c.wo.z);
    glass.reflect_share = dielectric_multiple_reflect_share(glass.eta, glass.mean_near, glass.mean_far);
  }
  return glass;
}

/// Resolves a surface for one direction.
/// @param wo  unit, local shading frame; below the surface: seen from behind, or from inside a solid
/// @return    no lobe has a probability where nothing is scattered: black, unlit, or wo.z within kMinCosine of 0
template <unsigned kFeatures>
RELIEF_KERNEL SurfaceClosure surface_closure_make(const SurfaceParams& p, const BsdfTables& tables, Vec3f wo)
{
  constexpr bool kMetal = (kFeatures & kFeatureMetal) != 0;
  constexpr bool kTransmission = (kFeatures & kFeatureTransmission) != 0;
  constexpr bool kLayers = (kFeatures & kFeatureLayers) != 0;

  SurfaceClosure c;
  c.side = wo.z < 0.0f ? -1.0f : 1.0f;
  c.wo = {wo.x, wo.y, wo.z * c.side};
  if (p.unlit || !(c.wo.z > kMinCosine)) return c;

  const float metal = kMetal ? p.metallic : 0.0f;
  const float transmission = kTransmission ? (1.0f - metal) * p.transmission : 0.0f;
  const bool solid = transmission > 0.0f && !p.thin;
  const float glass = solid ? transmission : 0.0f;
  const float diffuse = 1.0f - metal - transmission;
  const float interface = 1.0f - metal - glass;
  c.thin_weight = transmission - glass;
  c.inside = solid && wo.z < 0.0f;
  c.ggx = ggx_coordinate(p.roughness);

  float below = 1.0f;
  if constexpr (kLayers) {
    if (p.clearcoat > 0.0f || !is_zero(p.sheen_color)) below = layers_closure_make(p, tables, c);
  }

  const Vec3f dielectric_F0 = min(fresnel_F0(p.ior) * p.specular_color, splat3(1.0f)) * p.specular;
  c.F0 = interface * dielectric_F0 + metal * p.base_color;
  c.F90 = interface * p.specular + metal;
  LobeProbabilities& probability = c.probability;

  GgxAlbedo e, mean;
  if (c.F90 > 0.0f || c.thin_weight > 0.0f) {
    e = ggx_albedo(tables, c.ggx, c.wo.z);
    mean = ggx_albedo_mean(tables, c.ggx);
    probability.specular = below * ggx_albedo_with(max_component(c.F0), c.F90, e);
  }
  if (interface > 0.0f) {
    c.under_F0 = max_component(dielectric_F0);
    c.under_F90 = p.specular;
  }
  if (diffuse > 0.0f) {
    const float transmits = 1.0f - ggx_albedo_with(c.under_F0, c.under_F90, e);
    c.diffuse = diffuse_coupled_eval(diffuse * p.base_color, transmits, 1.0f,
                                     (1.0f - ggx_albedo_with(c.under_F0, c.under_F90, mean)));
    probability.diffuse = below * diffuse * transmits * max_component(p.base_color);
  }

  const float mean_lost = mean.lost;
  // Nearly smooth surfaces lose less than rounding; without a mean there is nothing to divide by.
  if ((metal > 0.0f || c.thin_weight > 0.0f) && mean_lost > kLeastMeanLost) {
    const float lost = e.lost;
    c.scattering = multiple_scattering_make(c.ggx.alpha);
    if constexpr (kMetal) {
      // Kulla and Conty 2017, with the square of the mean Fresnel that Hill 2018 restored: the light meets the
      // metal at least twice.
      const Vec3f F = fresnel_schlick_mean(p.base_color, 1.0f);
      const Vec3f kept = F * F * (1.0f - mean_lost) / (splat3(1.0f) - F * mean_lost);
      c.multiple = diffuse_coupled_eval(metal * kept, lost, 1.0f, mean_lost);
      probability.multiple = below * lost * metal * max_component(kept);
    }
    if constexpr (kTransmission) {
      const float F = fresnel_schlick_mean(splat3(c.under_F0), c.under_F90).x;
      c.multiple += diffuse_coupled_eval(splat3(c.thin_weight * F), lost, 1.0f, mean_lost);
      c.thin_multiple = diffuse_coupled_eval(c.thin_weight * (1.0f - F) * p.base_color, lost, 1.0f, mean_lost);
      probability.multiple += below * lost * c.thin_weight * F;
      probability.thin_multiple = below * lost * c.thin_weight * (1.0f - F) * max_component(p.base_color);
    }
  }
  if constexpr (kTransmission) {
    c.transmission_color = p.base_color;
    if (c.thin_weight > 0.0f) {
      const float transmits = 1.0f - e.lost - ggx_albedo_with(c.under_F0, c.under_F90, e);
      probability.thin = below * c.thin_weight * transmits * max_component(p.base_color);
    }
    if (glass > 0.0f) {
      c.glass = glass_closure_make(p, tables, c, glass);
      if (c.glass.lost > 0.0f) c.scattering = multiple_scattering_make(c.ggx.alpha);
      probability.glass = below * glass;
    }
  }

  const float sum = probability.specular + probability.diffuse + probability.multiple + probability.thin +
                    probability.thin_multiple + probability.glass + probability.sheen + probability.coat;
  const float scale = sum > 0.0f ? 1.0f / sum : 0.0f;
  probability.specular *= scale;
  probability.diffuse *= scale;
  probability.multiple *= scale;
  probability.thin *= scale;
  probability.thin_multiple *= scale;
  probability.glass *= scale;
  probability.sheen *= scale;
  probability.coat *= scale;
  return c;
}

}  // namespace relief
