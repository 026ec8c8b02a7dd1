// What a mixture scatters of white light, by kinds of event: what Cycles' passes of colours show, and its passes of light are
// divided by.
#pragma once

#include "kernel/bsdf/mixture.h"

namespace relief {

/// What a lobe's microfacets reflect of white light, as Cycles since 4.0 estimates it: of dielectrics and coloured metals a mean
/// over those that are visible, of others as if they were smooth.
/// @return  [0, 1] each
/// @source  Cycles 4.3 and 5.2, bsdf_microfacet_estimate_albedo
RELIEF_KERNEL Vec3f lobe_reflected_color(const MixtureLobe& lobe, const BsdfTables& tables)
{
  const MicrofacetFresnel& f = lobe.fresnel;
  const bool is_tabulated_dielectric =
      f.kind == MixtureFresnel::kInterpolated ||
      (f.kind == MixtureFresnel::kDielectric && (lobe.maths >= Maths::k52 || lobe.kind == MixtureLobeKind::kGlass));
  if (is_tabulated_dielectric) {
    const Vec3f F0 = f.kind == MixtureFresnel::kInterpolated ? f.a : splat3(fresnel_F0(f.eta));
    return lerp(reflected_share(tables, lobe.roughness, f.eta, lobe.wo.z), F0, Vec3f{1, 1, 1});
  }
  if (f.kind == MixtureFresnel::kF82) {
    return lerp(schlick_share(tables, lobe.roughness, lobe.wo.z), f.a, Vec3f{1, 1, 1});
  }
  return min(max(mixture_fresnel(f, lobe.wo.z), Vec3f{}), splat3(1.0f));
}

/// Adds what the chosen lobes scatter of white light by kinds of event, as Cycles has it: up to 3.6 microfacets without their
/// reflectance.
/// @param colors  kNumEventKinds of them
RELIEF_KERNEL void mixture_event_colors(const Mixture& m, const BsdfTables& tables, Vec3f* colors)
{
  mixture_visit(m, [&](const MixtureLobe& lobe) {
    if (lobe.kind == MixtureLobeKind::kMultiple) return;
    const bool is_4_0 = lobe.maths >= Maths::k43;
    // Estimates leave nothing out, so that what is given back is not counted again.
    const Vec3f color = lobe.weight * (is_4_0 ? m.gain * lobe.first_share : m.gain);
    if (lobe.kind == MixtureLobeKind::kGlass) {
      const MicrofacetGlass& glass = lobe.shape.glass;
      const Vec3f as_smooth = min(max(mixture_fresnel(lobe.fresnel, lobe.wo.z), Vec3f{}), splat3(1.0f));
      const Vec3f F = is_4_0 ? lobe_reflected_color(lobe, tables) : as_smooth;
      // Of what goes through, versions before 5.0 know the smooth surface's share alone.
      const Vec3f F_through = lobe.maths >= Maths::k52 ? F : as_smooth;
      colors[static_cast<int>(EventKind::kGlossy)] += color * glass.reflection_tint * F;
      colors[static_cast<int>(EventKind::kTransmission)] +=
          color * glass.transmission_tint * (splat3(1.0f) - F_through);
      return;
    }
    colors[static_cast<int>(mixture_lobe_event(lobe.kind))] +=
        is_4_0 && mixture_traits(lobe.kind).has_fresnel ? color * lobe_reflected_color(lobe, tables) : color;
  });
}

}  // namespace relief
