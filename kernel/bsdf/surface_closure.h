// The surface model at one hit, its parameters resolved for one wo: albedos looked up, lobes weighted. Made once, then
// evaluated and sampled by layered.h, whose head describes the model.
#pragma once

#include "kernel/bsdf/clearcoat.h"
#include "kernel/bsdf/diffuse.h"
#include "kernel/bsdf/glass.h"
#include "kernel/bsdf/multiple_scattering.h"
#include "kernel/bsdf/sheen_lobe.h"
#include "kernel/bsdf/specular.h"
#include "kernel/bsdf/surface_params.h"
#include "kernel/bsdf/thin_wall.h"

namespace relief {

/// Mean losses below this are left lost: smaller ones are mostly rounding, and they are divided by.
inline constexpr float kLeastMeanLost = 1e-6f;

/// The one list of lobes, in the order in which sampling chooses among them.
using SurfaceLobes =
    LobeList<DiffuseLobe, MultipleLobe, SpecularLobe, GlassLobe, ThinLobe, ThinMultipleLobe, CoatLobe, SheenLobe>;

/// Each lobe's probability is proportional to an estimate of its largest channel's albedo.
struct SurfaceClosure {
  BaseInterface base;
  float side = 1;            ///< −1 where wo was below: the z of every other direction is multiplied by it
  bool inside = false;       ///< wo is inside a solid: coat and sheen lie on the far side
  float coat_transmits = 1;  ///< what the coat leaves for below, seen from wo
  SurfaceLobes lobes;
};

/// Coat and sheen of a hit, and their unnormalised probabilities.
/// @return what they leave for below, seen from wo
RELIEF_KERNEL float layers_closure_make(const SurfaceParams& p, const BsdfTables& tables, SurfaceClosure& c)
{
  CoatLobe& coat = c.lobes;
  coat.strength = p.clearcoat;
  if (p.clearcoat > 0.0f) {
    coat.ggx = ggx_coordinate(p.clearcoat_roughness);
    coat.frame = frame_from_normal(p.clearcoat_N);
    if (!c.inside) {
      coat.wo = to_local(coat.frame, c.base.wo);
      c.coat_transmits = coat_transmits(coat, tables, coat.wo.z);
      coat.probability = 1.0f - c.coat_transmits;
    }
  }
  SheenLobe& sheen = c.lobes;
  sheen.strength = max_component(p.sheen_color);
  float sheen_transmits = 1.0f;
  if (sheen.strength > 0.0f) {
    sheen.color = p.sheen_color * c.coat_transmits;
    sheen.roughness = p.sheen_roughness;
    sheen.table = sheen_table_roughness(p.sheen_roughness);
    if (!c.inside) {
      sheen.albedo_o = sheen_albedo(tables, sheen.table, c.base.wo.z);
      const float albedo = sheen.strength * sheen.albedo_o.albedo;
      sheen.probability = c.coat_transmits * albedo;
      sheen_transmits = 1.0f - albedo;
    }
  }
  return c.coat_transmits * sheen_transmits;
}

/// What coat and sheen leave for the lobes below them.
/// @param wi  turned to wo's side
template <unsigned kFeatures>
RELIEF_KERNEL float closure_below(const SurfaceClosure& c, const BsdfTables& tables, Vec3f wi)
{
  if constexpr ((kFeatures & kFeatureLayers) == 0) return 1.0f;
  const CoatLobe& coat = c.lobes;
  const SheenLobe& sheen = c.lobes;
  float transmits = c.coat_transmits;
  float sheen_albedo_both = sheen.albedo_o.albedo;
  // From inside a solid the layers lie on the side that wi leaves on.
  const float outer_z = c.inside ? -wi.z : wi.z;
  if (outer_z > 0.0f) {
    if (c.inside && coat.strength > 0.0f) {
      transmits = coat_transmits(coat, tables, dot(coat.frame.n, {wi.x, wi.y, outer_z}));
    }
    if (sheen.strength > 0.0f) {
      sheen_albedo_both = max(sheen_albedo_both, sheen_albedo(tables, sheen.table, outer_z).albedo);
    }
  }
  return transmits * (1.0f - sheen.strength * sheen_albedo_both);
}

/// Solid glass of a hit, but for its probability.
/// @param base  wo and ggx are known
RELIEF_KERNEL GlassLobe
glass_lobe_make(const SurfaceParams& p, const BsdfTables& tables, const BaseInterface& base, bool inside, float weight)
{
  GlassLobe glass;
  glass.weight = weight;
  glass.eta = inside ? 1.0f / p.ior : p.ior;
  glass.delta = base.ggx.mirror || dielectric_is_matched(glass.eta);
  if (glass.delta) return glass;
  glass.table = glass_coordinate(glass.eta, p.roughness);
  glass.mean_near = glass_lost_mean(tables, glass.table, glass.table.side);
  glass.mean_far = glass_lost_mean(tables, glass.table, 1 - glass.table.side);
  if (min(glass.mean_near, glass.mean_far) > kLeastMeanLost) {
    glass.lost = glass_lost(tables, glass.table, glass.table.side, base.wo.z);
    glass.reflect_share = dielectric_multiple_reflect_share(glass.eta, glass.mean_near, glass.mean_far);
  }
  return glass;
}

/// Makes the lobes' probabilities sum to one, where there is anything.
template <unsigned kFeatures>
RELIEF_KERNEL void lobes_normalize(SurfaceLobes& lobes)
{
  float sum = 0.0f;
  lobes_visit<kFeatures>(lobes, [&](const Lobe& lobe) { sum += lobe.probability; });
  const float scale = sum > 0.0f ? 1.0f / sum : 0.0f;
  lobes_visit<kFeatures>(lobes, [&](Lobe& lobe) { lobe.probability *= scale; });
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
  BaseInterface& base = c.base;
  c.side = wo.z < 0.0f ? -1.0f : 1.0f;
  base.wo = {wo.x, wo.y, wo.z * c.side};
  if (p.unlit || !(base.wo.z > kMinCosine)) return c;

  const float metal = kMetal ? p.metallic : 0.0f;
  const float transmission = kTransmission ? (1.0f - metal) * p.transmission : 0.0f;
  const bool solid = transmission > 0.0f && !p.thin;
  const float glass_weight = solid ? transmission : 0.0f;
  const float thin_weight = transmission - glass_weight;
  const float diffuse_weight = 1.0f - metal - transmission;
  const float interface = 1.0f - metal - glass_weight;
  c.inside = solid && wo.z < 0.0f;
  base.ggx = ggx_coordinate(p.roughness);

  float below = 1.0f;
  if constexpr (kLayers) {
    if (p.clearcoat > 0.0f || !is_zero(p.sheen_color)) below = layers_closure_make(p, tables, c);
  }

  SpecularLobe& specular = c.lobes;
  const Vec3f dielectric_F0 = min(fresnel_F0(p.ior) * p.specular_color, splat3(1.0f)) * p.specular;
  specular.F0 = interface * dielectric_F0 + metal * p.base_color;
  specular.F90 = interface * p.specular + metal;

  GgxAlbedo e, mean;
  if (specular.F90 > 0.0f || thin_weight > 0.0f) {
    e = ggx_albedo(tables, base.ggx, base.wo.z);
    mean = ggx_albedo_mean(tables, base.ggx);
    specular.probability = below * ggx_albedo_with(max_component(specular.F0), specular.F90, e);
  }
  if (interface > 0.0f) {
    base.under_F0 = max_component(dielectric_F0);
    base.under_F90 = p.specular;
  }
  if (diffuse_weight > 0.0f) {
    DiffuseLobe& diffuse = c.lobes;
    const float transmits = 1.0f - ggx_albedo_with(base.under_F0, base.under_F90, e);
    diffuse.f = diffuse_coupled_eval(diffuse_weight * p.base_color, transmits, 1.0f,
                                     (1.0f - ggx_albedo_with(base.under_F0, base.under_F90, mean)));
    diffuse.probability = below * diffuse_weight * transmits * max_component(p.base_color);
  }

  const float mean_lost = mean.lost;
  // Nearly smooth surfaces lose less than rounding; without a mean there is nothing to divide by.
  if ((metal > 0.0f || thin_weight > 0.0f) && mean_lost > kLeastMeanLost) {
    const float lost = e.lost;
    base.scattering = multiple_scattering_make(base.ggx.alpha);
    MultipleLobe& multiple = c.lobes;
    if constexpr (kMetal) {
      // Kulla and Conty 2017, with the square of the mean Fresnel that Hill 2018 restored: the light meets the
      // metal at least twice.
      const Vec3f F = fresnel_schlick_mean(p.base_color, 1.0f);
      const Vec3f kept = F * F * (1.0f - mean_lost) / (splat3(1.0f) - F * mean_lost);
      multiple.f = diffuse_coupled_eval(metal * kept, lost, 1.0f, mean_lost);
      multiple.probability = below * lost * metal * max_component(kept);
    }
    if constexpr (kTransmission) {
      ThinMultipleLobe& thin_multiple = c.lobes;
      const float F = fresnel_schlick_mean(splat3(base.under_F0), base.under_F90).x;
      multiple.f += diffuse_coupled_eval(splat3(thin_weight * F), lost, 1.0f, mean_lost);
      multiple.probability += below * lost * thin_weight * F;
      thin_multiple.f = diffuse_coupled_eval(thin_weight * (1.0f - F) * p.base_color, lost, 1.0f, mean_lost);
      thin_multiple.probability = below * lost * thin_weight * (1.0f - F) * max_component(p.base_color);
    }
  }
  if constexpr (kTransmission) {
    base.transmission_color = p.base_color;
    if (thin_weight > 0.0f) {
      ThinLobe& thin = c.lobes;
      const float transmits = 1.0f - e.lost - ggx_albedo_with(base.under_F0, base.under_F90, e);
      thin.weight = thin_weight;
      thin.probability = below * thin_weight * transmits * max_component(p.base_color);
    }
    if (glass_weight > 0.0f) {
      GlassLobe& glass = c.lobes;
      glass = glass_lobe_make(p, tables, base, c.inside, glass_weight);
      if (glass.lost > 0.0f) base.scattering = multiple_scattering_make(base.ggx.alpha);
      glass.probability = below * glass_weight;
    }
  }
  lobes_normalize<kFeatures>(c.lobes);
  return c;
}

}  // namespace relief
