// What the lobes of columns scatter, eight at a time: each as in the file of its kind, by the same operations.
#pragma once

#include "kernel/bsdf/lobe_columns.h"
#include "kernel/math/lanes_functions.h"

namespace relief {

/// As bump_shadowing.
RELIEF_KERNEL F8 bump_shadowing(const Vec3x8& N, const Vec3x8& wi)
{
  const F8 g = dot(N, wi) / (wi.z * N.z);
  return g >= 1.0f ? splat8(1.0f) : g > 0.0f ? g + g * g * (1.0f - g) : splat8(0.0f);
}

/// As bump_shadowing_ggx.
RELIEF_KERNEL F8 bump_shadowing_ggx(const Vec3x8& N, const Vec3x8& wi)
{
  const F8 one = splat8(1.0f), none = splat8(0.0f), cos_N = abs(N.z), cos_i = abs(dot(N, wi));
  const auto tan_squared = [&](F8 cosine) { return max(1.0f / (cosine * cosine) - 1.0f, none); };
  const F8 alpha_squared = min(0.125f * tan_squared(cos_N), one);
  const F8 seen = 2.0f / (1.0f + sqrt(1.0f + alpha_squared * tan_squared(cos_i)));
  return cos_i >= 1e-6f ? seen : cos_N < 1.0f ? none : one;
}

RELIEF_KERNEL F8 schlick_weight(F8 cos_theta)
{
  const F8 x = clamp(1.0f - cos_theta, 0.0f, 1.0f);
  return x * x * (x * x) * x;
}

/// As principled_diffuse_eval.
RELIEF_KERNEL F8 principled_diffuse_eval(F8 roughness, const Vec3x8& wo, const Vec3x8& wi)
{
  const F8 F_o = schlick_weight(wo.z), F_i = schlick_weight(wi.z);
  const F8 retro = roughness * (1.0f + dot(wo, wi));
  const F8 lambert = (1.0f - 0.5f * F_o) * (1.0f - 0.5f * F_i);
  const F8 back = retro * (F_o + F_i + F_o * F_i * (retro - 1.0f));
  return kInvPi * (lambert + back);
}

/// As half_angle_cosine.
RELIEF_KERNEL F8 half_angle_cosine(const Vec3x8& wo, const Vec3x8& wi)
{
  return min(splat8(1.0f), 0.5f * length(wo + wi));
}

/// As sheen_microfibre_make. @return  its A, B, albedo
RELIEF_KERNEL Vec3x8 sheen_microfibre_make(F8 wo_z, F8 roughness)
{
  const TableCoordinate8 column = table_coordinate(wo_z, kMicrofibreNodes);
  const TableCoordinate8 row = table_coordinate(clamp(roughness, 1e-3f, 1.0f), kMicrofibreNodes);
  const auto read = [&](int which) {
    alignas(32) float node[2][2][8];
    for (int k = 0; k < 8; ++k) {
      for (int i = 0; i < 2; ++i) {
        const float* const from = kMicrofibreTable[which][row.index[k] + i] + column.index[k];
        node[i][0][k] = from[0];
        node[i][1][k] = from[1];
      }
    }
    return lerp(row.t, lerp(column.t, load8(node[0][0]), load8(node[0][1])),
                lerp(column.t, load8(node[1][0]), load8(node[1][1])));
  };
  const Vec3x8 lobe{read(0), read(1), read(2)};
  return select((abs(lobe.x) < 1e-5f) | (lobe.z < 1e-5f), splat8(Vec3f{1, 0, 0}), lobe);
}

/// As sheen_microfibre_eval. @param fibres  of sheen_microfibre_make
RELIEF_KERNEL F8 sheen_microfibre_eval(const Vec3x8& fibres, const Vec3x8& wo, const Vec3x8& wi, F8& pdf)
{
  const F8 A = fibres.x, B = fibres.y, none = splat8(0.0f);
  const F8 across = sqrt(wo.x * wo.x + wo.y * wo.y);
  const F8 along = across > 1e-6f ? (wo.x * wi.x + wo.y * wi.y) / across : wi.x;
  const F8 side2 = max(none, wi.x * wi.x + wi.y * wi.y - along * along);
  const F8 tilted = A * along + B * wi.z;
  const F8 ratio = A / (tilted * tilted + A * A * side2 + wi.z * wi.z);
  const F8 density_over_cos = wi.z > 0.0f ? kInvPi * (ratio * ratio) : none;
  pdf = density_over_cos * wi.z;
  return fibres.z * density_over_cos;
}

/// As ggx_anisotropic_eval.
RELIEF_KERNEL F8
ggx_anisotropic_eval(F8 alpha_x, F8 alpha_y, SmithMasking masking, const Vec3x8& wo, const Vec3x8& wi, F8& pdf)
{
  const Vec3x8 h = wo + wi;
  const F8 hx = h.x / alpha_x, hy = h.y / alpha_y;
  const F8 ratio = dot(h, h) / (hx * hx + hy * hy + h.z * h.z);
  const F8 D = kInvPi / (alpha_x * alpha_y) * (ratio * ratio);
  const auto stretched = [&](const Vec3x8& w) {
    const F8 x = alpha_x * w.x, y = alpha_y * w.y;
    return sqrt(w.z * w.z + x * x + y * y);
  };
  const F8 cos_i = abs(wi.z), o_length = stretched(wo), i_length = stretched(wi);
  pdf = 0.5f * D / (wo.z + o_length);
  return masking == SmithMasking::kSeparable ? D / ((wo.z + o_length) * (cos_i + i_length))
                                             : 0.5f * D / (wo.z * i_length + cos_i * o_length);
}

/// As clearcoat_gtr1_eval.
RELIEF_KERNEL F8 clearcoat_gtr1_eval(F8 alpha, const Vec3x8& wo, const Vec3x8& wi, F8& pdf)
{
  const Vec3x8 h = wo + wi;
  const F8 sine2 = (h.x * h.x + h.y * h.y) / dot(h, h), a2 = alpha * alpha;
  const F8 spread = (a2 - 1.0f) * kInvPi / (log8(a2) * (a2 + (1.0f - a2) * sine2));
  const F8 D = alpha >= 0.999f ? splat8(kInvPi) : spread;
  constexpr float kMaskingAlpha2 = 0.25f * 0.25f;
  const auto masked = [&](F8 z) { return abs(z) + sqrt(z * z + kMaskingAlpha2 * (1.0f - z * z)); };
  const F8 masked_o = masked(wo.z);
  pdf = 0.5f * D / masked_o;
  return D / (masked_o * masked(wi.z));
}

/// As warp_cosine_hemisphere.
RELIEF_KERNEL Vec3x8 warp_cosine_hemisphere(F8 u_x, F8 u_y)
{
  const F8 x = 2.0f * u_x - 1.0f, y = 2.0f * u_y - 1.0f;
  const I8 is_x = abs(x) > abs(y);
  const F8 radius = is_x ? x : y, other = is_x ? y : x;
  const F8 turn = radius == 0.0f ? radius : 0.25f * kPi * (other / radius);
  const SinCos8 phi = sin_cos_octant(turn, splat8(0.0f));
  const F8 along = radius * phi.cos, across = radius * phi.sin;
  const F8 dx = is_x ? along : across, dy = is_x ? across : along;
  return {dx, dy, safe_sqrt(1.0f - (dx * dx + dy * dy))};
}

/// As sheen_microfibre_sample of a cosine sample.
RELIEF_KERNEL Vec3x8 sheen_microfibre_sample(const Vec3x8& fibres, const Vec3x8& wo, const Vec3x8& cosine)
{
  const Vec3x8 w = normalize(Vec3x8{cosine.x - cosine.z * fibres.y, cosine.y, cosine.z * fibres.x});
  const F8 across = sqrt(wo.x * wo.x + wo.y * wo.y);
  const F8 cos_phi = wo.x / across, sin_phi = wo.y / across;
  return select(across > 1e-6f, {cos_phi * w.x - sin_phi * w.y, sin_phi * w.x + cos_phi * w.y, w.z}, w);
}

/// As ggx_anisotropic_visible_normal.
RELIEF_KERNEL Vec3x8 ggx_anisotropic_visible_normal(F8 alpha_x, F8 alpha_y, const Vec3x8& wo, F8 u_x, F8 u_y)
{
  const Vec3x8 wo_std = normalize(Vec3x8{wo.x * alpha_x, wo.y * alpha_y, wo.z});
  const F8 z = 1.0f - u_y * (1.0f + wo_std.z);
  const F8 r = safe_sqrt((1.0f - z) * (1.0f + z));
  const SinCos8 phi = sin_cos_turn(u_x);
  const Vec3x8 m = Vec3x8{r * phi.cos, r * phi.sin, z} + wo_std;
  return normalize(Vec3x8{m.x * alpha_x, m.y * alpha_y, max(m.z, splat8(0.0f))});
}

/// As ggx_anisotropic_sample.
RELIEF_KERNEL Vec3x8 ggx_anisotropic_sample(F8 alpha_x, F8 alpha_y, const Vec3x8& wo, F8 u_x, F8 u_y)
{
  const Vec3x8 wm = ggx_anisotropic_visible_normal(alpha_x, alpha_y, wo, u_x, u_y);
  return 2.0f * dot(wo, wm) * wm - wo;
}

}  // namespace relief
