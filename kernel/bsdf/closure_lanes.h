// What closures of eight hits are resolved with: what mixture_build.h, reflectances and tables of energy are for one. Numbers are
// those, by the same operations in the same order.
#pragma once

#include "kernel/bsdf/mixture_build.h"
#include "kernel/math/vec_lanes.h"

namespace relief {

/// What they are resolved for: see MixtureBuild.
struct MixtureBuildLanes {
  Vec3x8 wo, Ng, Ns;
  const BsdfTables* tables = nullptr;  ///< for closures since 4.0
  I8 is_front = ~I8{};
  bool on_curves = false;  ///< they are met on strands
};

RELIEF_KERNEL F8 lerp(F8 t, F8 a, F8 b) { return (1.0f - t) * a + t * b; }
RELIEF_KERNEL Vec3x8 lerp(F8 t, const Vec3x8& a, const Vec3x8& b) { return (1.0f - t) * a + t * b; }
RELIEF_KERNEL F8 saturated(F8 x) { return clamp(x, 0.0f, 1.0f); }
RELIEF_KERNEL Vec3x8 saturated(const Vec3x8& c) { return {saturated(c.x), saturated(c.y), saturated(c.z)}; }
RELIEF_KERNEL F8 not_negative(F8 x) { return max(x, splat8(0.0f)); }
RELIEF_KERNEL Vec3x8 not_negative(const Vec3x8& c) { return {not_negative(c.x), not_negative(c.y), not_negative(c.z)}; }
RELIEF_KERNEL F8 mean_component(const Vec3x8& c) { return (c.x + c.y + c.z) * (1.0f / 3.0f); }
RELIEF_KERNEL F8 max_component(const Vec3x8& c) { return max(c.x, max(c.y, c.z)); }
RELIEF_KERNEL F8 safe_sqrt(F8 x) { return sqrt(x > 0.0f ? x : splat8(0.0f)); }

/// As closure_normal_as_given.
RELIEF_KERNEL Vec3x8 closure_normal_as_given(const MixtureBuildLanes& b, const Vec3x8& given)
{
  const F8 squared = dot(given, given);
  const Vec3x8 turned = Vec3x8{given.x, given.z, -given.y} / sqrt(squared);
  return select((squared > 0.0f) & (squared < kInfinity), turned, b.Ns);
}

/// Rays may always leave as shallow as they come.
RELIEF_KERNEL F8 least_reflected_height(F8 height_o) { return min(0.9f * height_o, splat8(0.01f)); }

/// As normal_with_reflection_above.
/// @param is_above  the reflections of these normals are
[[gnu::noinline]] RELIEF_KERNEL Vec3x8 normal_with_reflection_above(const MixtureBuildLanes& b,
                                                                    const Vec3x8& N,
                                                                    I8 is_above)
{
  const F8 height_o = dot(b.Ng, b.wo), height = least_reflected_height(height_o);
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

/// As closure_normal.
RELIEF_KERNEL Vec3x8 closure_normal(const MixtureBuildLanes& b, const Vec3x8& given)
{
  const Vec3x8 N = closure_normal_as_given(b, given);
  if (b.on_curves) return N;
  const F8 height_o = dot(b.Ng, b.wo);
  const I8 is_above = 2.0f * dot(N, b.wo) * dot(N, b.Ng) - height_o >= least_reflected_height(height_o);
  if (mask_of(is_above) == 0xffu) [[likely]]
    return N;
  return normal_with_reflection_above(b, N, is_above);
}

RELIEF_KERNEL F8 fresnel_F0(F8 ior)
{
  const F8 root = (ior - 1.0f) / (ior + 1.0f);
  return root * root;
}

RELIEF_KERNEL F8 ior_of_F0(F8 F0)
{
  const F8 root = sqrt(clamp(F0, 0.0f, 0.99f));
  return (1.0f + root) / (1.0f - root);
}

/// As fresnel_dielectric_at.
RELIEF_KERNEL F8 fresnel_dielectric_at(F8 cos_i, F8 eta)
{
  const F8 cos_t = safe_sqrt(1.0f - (1.0f - cos_i * cos_i) / (eta * eta));
  const F8 parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  const F8 perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  return cos_t > 0.0f ? 0.5f * (parallel * parallel + perpendicular * perpendicular) : splat8(1.0f);
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

/// As fresnel_interpolated up to 1.
RELIEF_KERNEL Vec3x8 fresnel_interpolated(const Vec3x8& F0, F8 cos_i, F8 eta)
{
  const F8 w = fresnel_dielectric_weight(cos_i, eta);
  return F0 * (1.0f - w) + Vec3x8{w, w, w};
}

/// As fresnel_interpolated_mean up to 1.
RELIEF_KERNEL Vec3x8 fresnel_interpolated_mean(const Vec3x8& F0, F8 eta)
{
  const F8 thin = (eta - 1.0f) / (4.08567f + 1.00071f * eta);
  const F8 dense = 0.997118f + eta * (0.1014f - eta * (0.965241f + eta * 0.130607f));
  const F8 mean = eta < 1.0f ? dense : thin, at_normal = fresnel_F0(eta);
  return lerp(clamp((mean - at_normal) / (1.0f - at_normal), 0.0f, 1.0f), F0, splat8(Vec3f{1, 1, 1}));
}

/// As fresnel_f82.
RELIEF_KERNEL Vec3x8 fresnel_f82(const Vec3x8& F0, const Vec3x8& B, F8 cos_i)
{
  const F8 x = clamp(1.0f - cos_i, 0.0f, 1.0f), x2 = x * x, x5 = x2 * x2 * x, bend = cos_i * x5 * x;
  return saturated(F0 * (1.0f - x5) + Vec3x8{x5, x5, x5} - B * bend);
}

/// Places on an axis of a table, as TableCoordinate.
struct TableCoordinate8 {
  alignas(32) std::int32_t index[8];
  F8 t;
};

RELIEF_KERNEL TableCoordinate8 table_coordinate(F8 x, int size)
{
  const F8 scaled = clamp(x, 0.0f, 1.0f) * static_cast<float>(size - 1);
  const I8 index = __builtin_convertvector(scaled, I8), last = I8{} + (size - 2);
  const I8 lower = index < last ? index : last;
  TableCoordinate8 at;
  store8(at.index, lower);
  at.t = scaled - __builtin_convertvector(lower, F8);
  return at;
}

/// What GGX loses, from wo and on the mean.
struct GgxLost8 {
  F8 lost, lost_mean;
};

/// As ggx_albedo and ggx_albedo_mean of ggx_coordinate.
RELIEF_KERNEL GgxLost8 ggx_lost(const BsdfTables& tables, F8 roughness, F8 cos_o)
{
  const F8 alpha = roughness * roughness;
  const TableCoordinate8 r = table_coordinate(roughness, kGgxRoughnesses);
  const TableCoordinate8 c = table_coordinate(sqrt(cos_o * (1.0f + alpha) / (cos_o + alpha)), kGgxCosines);
  alignas(32) float node[2][2][8], mean[2][8];
  for (int k = 0; k < 8; ++k) {
    for (int i = 0; i < 2; ++i) {
      const GgxEntry* const row = tables.ggx[r.index[k] + i] + c.index[k];
      node[i][0][k] = row[0].root_lost;
      node[i][1][k] = row[1].root_lost;
      mean[i][k] = tables.ggx_mean[r.index[k] + i].lost;
    }
  }
  const F8 root =
      lerp(r.t, lerp(c.t, load8(node[0][0]), load8(node[0][1])), lerp(c.t, load8(node[1][0]), load8(node[1][1])));
  const F8 none = splat8(0.0f);
  const I8 is_mirror = alpha < kDeltaAlpha;
  return {is_mirror ? none : root * root, is_mirror ? none : alpha * alpha * lerp(r.t, load8(mean[0]), load8(mean[1]))};
}

/// As ggx_energy_factor of EnergyModel::kTable.
RELIEF_KERNEL Vec3x8 ggx_energy_factor(const Vec3x8& F_mean, const GgxLost8& ggx)
{
  const F8 E = max(1.0f - ggx.lost, splat8(1e-3f)), later = 1.0f - ggx.lost_mean, again = (1.0f - E) / E;
  const auto axis = [&](F8 F) { return 1.0f + F * later / (1.0f - F * (1.0f - later)) * again; };
  return {axis(F_mean.x), axis(F_mean.y), axis(F_mean.z)};
}

/// As reflected_share of one.
RELIEF_KERNEL F8 reflected_share(const BsdfTables& tables, F8 roughness, F8 eta, F8 cos_o)
{
  const TableCoordinate8 r = table_coordinate(roughness, kShareNodes);
  const TableCoordinate8 f = table_coordinate(sqrt(abs((eta - 1.0f) / (eta + 1.0f))), kShareNodes);
  const TableCoordinate8 c = table_coordinate(cos_o, kShareNodes);
  alignas(32) float node[2][2][2][8];
  for (int k = 0; k < 8; ++k) {
    for (int i = 0; i < 4; ++i) {
      const float* const row = tables.reflected_share[r.index[k] + i / 2][f.index[k] + i % 2] + c.index[k];
      node[i / 2][i % 2][0][k] = row[0];
      node[i / 2][i % 2][1][k] = row[1];
    }
  }
  const auto along_c = [&](int i, int j) { return lerp(c.t, load8(node[i][j][0]), load8(node[i][j][1])); };
  return lerp(r.t, lerp(f.t, along_c(0, 0), along_c(0, 1)), lerp(f.t, along_c(1, 0), along_c(1, 1)));
}

}  // namespace relief
