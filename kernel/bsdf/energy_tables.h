// Directional albedos of the microfacet lobes, made once at start. They say how much a lobe loses to bounces that it
// does not follow, which the surface model puts back, and how much of the light reaches what lies below.
//
// Read GgxAlbedo and the look-ups first; bsdf_tables_make and its quadratures fill them. Cosines are tabulated at
// √cosine, because albedos bend near the horizon, and roughness is perceptual (alpha = roughness²).
#pragma once

#include "kernel/assert.h"
#include "kernel/bsdf/dielectric.h"
#include "kernel/bsdf/sheen.h"
#include "kernel/feature_mask.h"

namespace relief {

inline constexpr int kTableCosines = 32, kTableRoughnesses = 32;
inline constexpr int kGlassCosines = 16, kGlassRoughnesses = 16, kGlassIors = 9;
inline constexpr int kSheenCosines = 32, kSheenRoughnesses = 16;
/// Glass is tabulated over (ior − 1) / (ior + 1) up to ior 3; denser glass uses the last entry.
inline constexpr float kGlassMaxRootF0 = 0.5f;

/// Albedo of GGX reflection, split so that any Schlick Fresnel can be put in afterwards: the albedo of a lobe is
/// F0·(total − grazing) + F90·grazing.
struct GgxAlbedo {
  float total = 1;    ///< with F = 1
  float grazing = 0;  ///< with F = (1 − cos)⁵
};

/// Sheen at one direction.
struct SheenAlbedo {
  float albedo = 0;  ///< with white sheen colour, after `bound`
  float bound = 1;   ///< 1, or less where the published model would reflect more than it receives
};

/// About 52 kB; a render needs one. Glass and sheen are filled only if asked for.
struct BsdfTables {
  GgxAlbedo ggx[kTableRoughnesses][kTableCosines];
  GgxAlbedo ggx_mean[kTableRoughnesses];                         ///< over the cosine-weighted hemisphere
  float glass[2][kGlassIors][kGlassRoughnesses][kGlassCosines];  ///< reflection + refraction; [0] from the thin side
  float glass_mean[2][kGlassIors][kGlassRoughnesses];
  SheenAlbedo sheen[kSheenRoughnesses][kSheenCosines];
};

/// Position between two nodes of a table's axis.
struct TableCoordinate {
  int index = 0;  ///< of the lower node
  float t = 0;    ///< weight of the upper one
};

/// @param x     in [0, 1] over the whole axis; outside and NaN are clamped
/// @param size  nodes, >= 2
RELIEF_KERNEL TableCoordinate table_coordinate(float x, int size)
{
  const float scaled = clamp(x, 0.0f, 1.0f) * static_cast<float>(size - 1);
  const int index = static_cast<int>(scaled);
  const int lower = index < size - 2 ? index : size - 2;
  return {lower, scaled - static_cast<float>(lower)};
}

RELIEF_KERNEL TableCoordinate table_cosine(float cos_theta, int size)
{
  return table_coordinate(__builtin_sqrtf(max(cos_theta, 0.0f)), size);
}

RELIEF_KERNEL GgxAlbedo lerp(float t, GgxAlbedo a, GgxAlbedo b)
{
  return {lerp(t, a.total, b.total), lerp(t, a.grazing, b.grazing)};
}

RELIEF_KERNEL SheenAlbedo lerp(float t, SheenAlbedo a, SheenAlbedo b)
{
  return {lerp(t, a.albedo, b.albedo), lerp(t, a.bound, b.bound)};
}

/// @param roughness  table_coordinate(roughness, kTableRoughnesses)
RELIEF_KERNEL GgxAlbedo ggx_albedo(const BsdfTables& tables, TableCoordinate roughness, float cos_theta)
{
  const TableCoordinate c = table_cosine(cos_theta, kTableCosines);
  const auto row = [&](int r) { return lerp(c.t, tables.ggx[r][c.index], tables.ggx[r][c.index + 1]); };
  return lerp(roughness.t, row(roughness.index), row(roughness.index + 1));
}

RELIEF_KERNEL GgxAlbedo ggx_albedo_mean(const BsdfTables& tables, TableCoordinate roughness)
{
  return lerp(roughness.t, tables.ggx_mean[roughness.index], tables.ggx_mean[roughness.index + 1]);
}

/// Roughness axis of the sheen table, which starts at kSheenMinRoughness.
RELIEF_KERNEL TableCoordinate sheen_table_roughness(float roughness)
{
  return table_coordinate((roughness - kSheenMinRoughness) / (1.0f - kSheenMinRoughness), kSheenRoughnesses);
}

RELIEF_KERNEL SheenAlbedo sheen_albedo(const BsdfTables& tables, TableCoordinate roughness, float cos_theta)
{
  const TableCoordinate c = table_cosine(cos_theta, kSheenCosines);
  const auto row = [&](int r) { return lerp(c.t, tables.sheen[r][c.index], tables.sheen[r][c.index + 1]); };
  return lerp(roughness.t, row(roughness.index), row(roughness.index + 1));
}

/// Axes of the glass table for one interface.
struct GlassCoordinate {
  TableCoordinate ior, roughness;
  int side = 0;  ///< 0: seen from the thin side
};

/// @param eta  index far / near
RELIEF_KERNEL GlassCoordinate glass_coordinate(float eta, float roughness)
{
  const float root_F0 = __builtin_fabsf(eta - 1.0f) / (eta + 1.0f);
  return {table_coordinate(root_F0 / kGlassMaxRootF0, kGlassIors), table_coordinate(roughness, kGlassRoughnesses),
          eta < 1.0f ? 1 : 0};
}

/// Energy that one scattering by rough glass keeps, reflected and refracted together.
RELIEF_KERNEL float glass_albedo(const BsdfTables& tables, const GlassCoordinate& g, int side, float cos_theta)
{
  const TableCoordinate c = table_cosine(cos_theta, kGlassCosines);
  const auto row = [&](int i, int r) {
    const float* cosines = tables.glass[side][i][r];
    return lerp(c.t, cosines[c.index], cosines[c.index + 1]);
  };
  const auto plane = [&](int i) {
    return lerp(g.roughness.t, row(i, g.roughness.index), row(i, g.roughness.index + 1));
  };
  return lerp(g.ior.t, plane(g.ior.index), plane(g.ior.index + 1));
}

RELIEF_KERNEL float glass_albedo_mean(const BsdfTables& tables, const GlassCoordinate& g, int side)
{
  const auto plane = [&](int i) {
    const float* roughnesses = tables.glass_mean[side][i];
    return lerp(g.roughness.t, roughnesses[g.roughness.index], roughnesses[g.roughness.index + 1]);
  };
  return lerp(g.ior.t, plane(g.ior.index), plane(g.ior.index + 1));
}

/// Cosine of a table's node; the horizon itself, where lobes have no value, is replaced by a direction next to it.
RELIEF_KERNEL float table_node_cosine(int i, int size)
{
  return max(1e-5f, sqr(static_cast<float>(i) / static_cast<float>(size - 1)));
}

/// Mean over the cosine-weighted hemisphere of a function tabulated at √cosine and interpolated linearly there:
/// 2∫ f µ dµ = 4∫ f(x) x³ dx, exact for the interpolant, so that energy balances with the values looked up.
template <int kSize, typename F>
RELIEF_KERNEL float table_mean(F&& value)
{
  constexpr float h = 1.0f / static_cast<float>(kSize - 1);
  float sum = 0;
  for (int i = 0; i + 1 < kSize; ++i) {
    const float a = static_cast<float>(i) * h;
    // ∫ x³ over the cell, and ∫ x³ (x − a)/h: Gauss–Legendre with three points is exact for degree five.
    const float offsets[3] = {0.5f - 0.38729833462f, 0.5f, 0.5f + 0.38729833462f};
    const float weights[3] = {5.0f / 18.0f, 4.0f / 9.0f, 5.0f / 18.0f};
    for (int k = 0; k < 3; ++k) {
      const float x = a + h * offsets[k];
      sum += 4.0f * h * weights[k] * x * x * x * lerp(offsets[k], value(i), value(i + 1));
    }
  }
  return sum;
}

/// Albedo of GGX reflection by quadrature over visible normals: the mean of G2/G1, with and without Schlick's weight.
/// @cost 512 evaluations
RELIEF_KERNEL GgxAlbedo ggx_albedo_integrate(float cos_o, float alpha)
{
  constexpr int kPhi = 16, kCap = 32;
  const Vec3f wo{safe_sqrt(1.0f - cos_o * cos_o), 0.0f, cos_o};
  const float lambda_o = ggx_lambda(cos_o, alpha);
  GgxAlbedo sum{0, 0};
  for (int i = 0; i < kPhi; ++i) {
    for (int j = 0; j < kCap; ++j) {
      // Half the azimuths: the other half mirrors them.
      const Vec2f u{0.5f * (static_cast<float>(i) + 0.5f) / kPhi, (static_cast<float>(j) + 0.5f) / kCap};
      const Vec3f wm = warp_ggx_visible_normal(wo, alpha, u);
      const float cos_d = dot(wo, wm);
      const float z = 2.0f * cos_d * wm.z - wo.z;
      if (!(z > 0.0f)) continue;
      const float share = ggx_visible_share(lambda_o, ggx_lambda(z, alpha));
      sum.total += share;
      sum.grazing += share * schlick_weight(cos_d);
    }
  }
  return {sum.total / (kPhi * kCap), sum.grazing / (kPhi * kCap)};
}

/// Energy kept by one scattering of rough glass.
/// @param eta  index far / near
/// @cost       192 evaluations
RELIEF_KERNEL float glass_albedo_integrate(float cos_o, float alpha, float eta)
{
  constexpr int kPhi = 12, kCap = 16;
  const Vec3f wo{safe_sqrt(1.0f - cos_o * cos_o), 0.0f, cos_o};
  const float lambda_o = ggx_lambda(cos_o, alpha);
  float sum = 0;
  for (int i = 0; i < kPhi; ++i) {
    for (int j = 0; j < kCap; ++j) {
      const Vec2f u{0.5f * (static_cast<float>(i) + 0.5f) / kPhi, (static_cast<float>(j) + 0.5f) / kCap};
      const Vec3f wm = warp_ggx_visible_normal(wo, alpha, u);
      const float cos_d = min(1.0f, dot(wo, wm));
      const float cos_t = refracted_cosine(cos_d, eta);
      const float F = fresnel_dielectric(cos_d, cos_t, eta);
      const float reflected_z = 2.0f * cos_d * wm.z - wo.z;
      if (reflected_z > 0.0f) sum += F * ggx_visible_share(lambda_o, ggx_lambda(reflected_z, alpha));
      const float depth = -refract(wo, wm, cos_d, cos_t, eta).z;
      if (F < 1.0f && depth > 0.0f) sum += (1.0f - F) * ggx_visible_share(lambda_o, ggx_lambda(depth, alpha));
    }
  }
  return sum / (kPhi * kCap);
}

RELIEF_KERNEL void ggx_tables_make(BsdfTables& tables)
{
  for (int r = 0; r < kTableRoughnesses; ++r) {
    const float alpha = sqr(static_cast<float>(r) / (kTableRoughnesses - 1));
    for (int c = 0; c < kTableCosines; ++c) {
      const float cos_theta = table_node_cosine(c, kTableCosines);
      // Mirrors lose nothing: no quadrature, no error.
      tables.ggx[r][c] =
          alpha < kDeltaAlpha ? GgxAlbedo{1.0f, schlick_weight(cos_theta)} : ggx_albedo_integrate(cos_theta, alpha);
    }
    const GgxAlbedo* row = tables.ggx[r];
    tables.ggx_mean[r] = {table_mean<kTableCosines>([row](int c) { return row[c].total; }),
                          table_mean<kTableCosines>([row](int c) { return row[c].grazing; })};
  }
}

RELIEF_KERNEL void glass_tables_make(BsdfTables& tables)
{
  for (int side = 0; side < 2; ++side) {
    for (int i = 0; i < kGlassIors; ++i) {
      const float root_F0 = kGlassMaxRootF0 * static_cast<float>(i) / (kGlassIors - 1);
      const float ior = (1.0f + root_F0) / (1.0f - root_F0);
      for (int r = 0; r < kGlassRoughnesses; ++r) {
        const float alpha = sqr(static_cast<float>(r) / (kGlassRoughnesses - 1));
        float* row = tables.glass[side][i][r];
        for (int c = 0; c < kGlassCosines; ++c) {
          const float cos_theta = table_node_cosine(c, kGlassCosines);
          const float eta = side == 0 ? ior : 1.0f / ior;
          row[c] = alpha < kDeltaAlpha ? 1.0f : glass_albedo_integrate(cos_theta, alpha, eta);
        }
        tables.glass_mean[side][i][r] = table_mean<kGlassCosines>([row](int c) { return row[c]; });
      }
    }
  }
}

/// One row of the sheen table: the published model's albedo, the bound that keeps it at most one, and the albedo within
/// that bound.
/// @cost 32 × 32 × 16 evaluations of the distribution
RELIEF_KERNEL void sheen_row_make(SheenAlbedo (&row)[kSheenCosines], float roughness)
{
  constexpr int kZ = 32, kPhi = 16;
  const float alpha = sheen_alpha(roughness);
  float gathered[kSheenCosines][kZ];  // what each direction receives from a ring of directions of height x²
  float x[kZ], lambda[kZ];
  for (int i = 0; i < kZ; ++i) {
    // z = x²: the lobe lives near the horizon.
    x[i] = (static_cast<float>(i) + 0.5f) / kZ;
    lambda[i] = sheen_lambda(x[i] * x[i], alpha);
  }
  for (int c = 0; c < kSheenCosines; ++c) {
    const float cos_o = table_node_cosine(c, kSheenCosines);
    const Vec3f wo{safe_sqrt(1.0f - cos_o * cos_o), 0.0f, cos_o};
    const float lambda_o = sheen_lambda(cos_o, alpha);
    row[c].albedo = 0.0f;
    for (int i = 0; i < kZ; ++i) {
      float D = 0;
      for (int j = 0; j < kPhi; ++j) {
        D += sheen_D(sheen_half_sine(wo, direction_from_z(x[i] * x[i], 0.5f * (static_cast<float>(j) + 0.5f) / kPhi)),
                     alpha);
      }
      const float solid_angle = 2.0f * kPi / kPhi * 2.0f * x[i] / kZ;
      gathered[c][i] = D * solid_angle / (4.0f * (1.0f + lambda_o + lambda[i]) * cos_o);
      row[c].albedo += gathered[c][i];
    }
    row[c].bound = 1.0f / max(1.0f, row[c].albedo);
  }
  for (int c = 0; c < kSheenCosines; ++c) {
    float sum = 0;
    for (int i = 0; i < kZ; ++i) {
      const TableCoordinate at = table_coordinate(x[i], kSheenCosines);
      sum += gathered[c][i] * min(row[c].bound, lerp(at.t, row[at.index].bound, row[at.index + 1].bound));
    }
    row[c].albedo = min(1.0f, sum);
  }
}

RELIEF_KERNEL void sheen_tables_make(BsdfTables& tables)
{
  for (int r = 0; r < kSheenRoughnesses; ++r) {
    const float roughness =
        kSheenMinRoughness + (1.0f - kSheenMinRoughness) * static_cast<float>(r) / (kSheenRoughnesses - 1);
    sheen_row_make(tables.sheen[r], roughness);
  }
}

/// Fills the tables; the same bits on every run.
/// @param features  FeatureBit mask of the scene: without transmission there is no glass table, without layers no sheen
/// @cost            see the test BsdfTables.AreMadeWithinTheirBudget
RELIEF_KERNEL void bsdf_tables_make(BsdfTables& tables, unsigned features = kFeatureAll)
{
  ggx_tables_make(tables);
  if ((features & kFeatureTransmission) != 0) glass_tables_make(tables);
  if ((features & kFeatureLayers) != 0) sheen_tables_make(tables);
}

}  // namespace relief
