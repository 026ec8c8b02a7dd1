// The plain Principled closure up to Blender 3.6, of eight hits at once: its diffuse base and its reflection by GGX. Most surfaces
// of most files are this and no more. The numbers are those of principled3.h, by the same operations in the same order.
#pragma once

#include "kernel/bsdf/mixture_build.h"
#include "kernel/math/vec_lanes.h"

namespace relief {

/// Inputs of eight hits. What is not here is nothing: see closure_is_plain.
struct Principled3Lanes {
  F8 weight;
  Vec3x8 base_color;
  F8 metallic, specular, specular_tint, roughness, anisotropic;
  Vec3x8 normal;  ///< Z up; 0: the surface's
};

/// What they are resolved for: see MixtureBuild.
struct MixtureBuildLanes {
  Vec3x8 wo, Ng, Ns;
};

/// Numbers of the lobes, a column of eight hits each.
struct alignas(32) Principled3Columns {
  int first_result;  ///< of the closure, see SurfaceClosureSpec
  alignas(32) float frame[9][8], wo[3][8], surface_N[3][8];
  float cos_bend[8];  ///< between the normals of lobes and surface
  float diffuse[3][8], F0[3][8], specular_weight[8], seen[8], eta[8], alpha[2][8], roughness[8], given_roughness[8];
  float strength[8];  ///< above kLeastClosureWeight: there is a reflection
};

RELIEF_KERNEL Vec3x8 lerp(F8 t, const Vec3x8& a, const Vec3x8& b) { return (1.0f - t) * a + t * b; }
RELIEF_KERNEL Vec3x8 saturated(const Vec3x8& c)
{
  return {clamp(c.x, 0.0f, 1.0f), clamp(c.y, 0.0f, 1.0f), clamp(c.z, 0.0f, 1.0f)};
}
RELIEF_KERNEL F8 safe_sqrt(F8 x) { return sqrt(x > 0.0f ? x : splat8(0.0f)); }

/// As closure_normal on triangles.
RELIEF_KERNEL Vec3x8 closure_normal(const MixtureBuildLanes& b, const Vec3x8& given)
{
  const F8 squared = dot(given, given);
  const Vec3x8 turned = Vec3x8{given.x, given.z, -given.y} / sqrt(squared);
  const Vec3x8 N = select((squared > 0.0f) & (squared < kInfinity), turned, b.Ns);
  // As normal_with_reflection_above, which seldom has anything to do.
  const F8 height_o = dot(b.Ng, b.wo);
  const F8 height = min(0.9f * height_o, splat8(0.01f));
  const I8 is_above = 2.0f * dot(N, b.wo) * dot(N, b.Ng) - height_o >= height;
  if (mask_of(is_above) == 0xffu) [[likely]]
    return N;
  const Vec3x8 aside = N - dot(N, b.Ng) * b.Ng;
  const F8 aside_squared = dot(aside, aside);
  const Vec3x8 X = aside / sqrt(aside_squared);
  const F8 x = dot(b.wo, X);
  const F8 inv_length = 1.0f / sqrt(x * x + height_o * height_o);
  const F8 reflected_z = height * inv_length;
  const Vec3x8 middle =
      (x * inv_length + safe_sqrt(1.0f - reflected_z * reflected_z)) * X + (height_o * inv_length + reflected_z) * b.Ng;
  return select(is_above, N, select(aside_squared > 1e-12f, normalize(middle), b.Ng));
}

/// As fresnel_dielectric_weight.
RELIEF_KERNEL F8 fresnel_dielectric_weight(F8 cos_i, F8 eta)
{
  const F8 eta2 = eta * eta;
  const F8 t2 = eta2 - 1.0f + cos_i * cos_i;
  const F8 t = sqrt(t2);
  const F8 parallel = (eta2 * cos_i - t) / (eta2 * cos_i + t);
  const F8 perpendicular = (cos_i - t) / (cos_i + t);
  const F8 eta_up = eta + 1.0f, eta_down = eta - 1.0f;
  const F8 rise =
      0.5f * (eta_up * eta_up) * (parallel * parallel + perpendicular * perpendicular) - eta_down * eta_down;
  return t2 > 0.0f ? clamp(0.25f * rise / eta, 0.0f, 1.0f) : splat8(1.0f);
}

/// Resolves the closure.
[[gnu::noinline]] RELIEF_KERNEL void principled3_columns_make(const MixtureBuildLanes& b,
                                                              const Principled3Lanes& in,
                                                              Principled3Columns& columns)
{
  const F8 zero = splat8(0.0f);
  const Frame8 frame = frame_from_normal(closure_normal(b, in.normal));
  const Vec3x8 wo = to_local(frame, b.wo);
  store8(columns.frame, frame);
  store8(columns.wo, wo);
  store8(columns.surface_N, to_local(frame, b.Ns));
  store8(columns.cos_bend, dot(frame.n, b.Ns));

  const F8 metallic = clamp(in.metallic, 0.0f, 1.0f);
  const Vec3x8 color = in.base_color;
  const F8 base_weight = 1.0f - metallic;
  const Vec3x8 diffuse = Vec3x8{max(color.x, zero), max(color.y, zero), max(color.z, zero)} * (in.weight * base_weight);
  store8(columns.diffuse, select(base_weight > kLeastClosureWeight, diffuse, Vec3x8{}));
  store8(columns.given_roughness, in.roughness);

  const F8 roughness = clamp(abs(in.roughness), 0.0f, 1.0f), alpha = roughness * roughness;
  const F8 aspect = safe_sqrt(1.0f - 0.9f * in.anisotropic);
  store8(columns.roughness, roughness);
  store8(columns.alpha[0], clamp(alpha / aspect, kDeltaAlpha, 1.0f));
  store8(columns.alpha[1], clamp(alpha * aspect, kDeltaAlpha, 1.0f));
  const F8 luminance = 0.3f * color.x + 0.6f * color.y + 0.1f * color.z;
  const Vec3x8 white = splat8(Vec3f{1, 1, 1});
  const Vec3x8 tint = lerp(in.specular_tint, white, select(luminance > 0.0f, color / luminance, white));
  const Vec3x8 F0 = saturated(lerp(in.metallic, tint * (0.08f * in.specular), color));
  const F8 eta = 2.0f / (1.0f - safe_sqrt(0.08f * min(max(in.specular, zero), splat8(12.4f)))) - 1.0f;
  store8(columns.F0, F0);
  store8(columns.eta, eta);
  store8(columns.specular_weight, in.weight);
  const F8 w = fresnel_dielectric_weight(wo.z, eta);
  const auto reflectance = [&](F8 at_normal) { return at_normal * (1.0f - w) + w; };
  store8(columns.seen, (reflectance(F0.x) + reflectance(F0.y) + reflectance(F0.z)) * (1.0f / 3.0f));
  store8(columns.strength, max(in.specular, in.metallic));
}

/// Adds the lobes of one hit that the closure has a weight at, as closure_add does.
RELIEF_KERNEL void principled3_lane_add(MixtureBuild& b, const Principled3Columns& columns, int lane)
{
  const auto vector = [lane](const float(*from)[8]) { return load_lane(from, lane); };
  const Vec3f wo = vector(columns.wo);
  if (!(wo.z > kMinCosine)) return;
  const bool is_bent = !(columns.cos_bend[lane] > kUnbentLobe);
  const auto add = [&](Vec3f weight) -> MixtureLobe* {
    const Vec3f bounded = max(weight, Vec3f{});
    const float mean = mean_component(bounded);
    MixtureLobes& all = *b.lobes;
    if (!(mean > kLeastClosureWeight && mean < kInfinity && all.size < kMostMixtureLobes)) return nullptr;
    MixtureLobe& lobe = *new (&all.lobes[all.size++]) MixtureLobe;
    lobe.weight = bounded;
    lobe.probability = mean;
    lobe.frame = {vector(columns.frame), vector(columns.frame + 3), vector(columns.frame + 6)};
    lobe.wo = wo;
    lobe.maths = b.maths;
    lobe.is_bent = is_bent;
    if (is_bent) lobe.surface_N = vector(columns.surface_N);
    return &lobe;
  };
  if (MixtureLobe* lobe = add(vector(columns.diffuse))) {
    lobe->kind = MixtureLobeKind::kPrincipledDiffuse;
    lobe->shape.principled_diffuse = {columns.given_roughness[lane]};
  }
  if (!(columns.strength[lane] > kLeastClosureWeight)) return;
  if (MixtureLobe* lobe = add(splat3(columns.specular_weight[lane]))) {
    lobe->kind = MixtureLobeKind::kGgx;
    lobe->roughness = columns.roughness[lane];
    lobe->is_delta = sqr(lobe->roughness) < kDeltaAlpha;
    lobe->mirrors_below = true;
    lobe->shape.ggx = {{columns.alpha[0][lane], columns.alpha[1][lane]}, SmithMasking::kSeparable};
    lobe->fresnel = {MixtureFresnel::kInterpolated, columns.eta[lane], vector(columns.F0), {}, 1.0f, 0.0f};
    lobe->probability *= columns.seen[lane];
  }
}

}  // namespace relief
