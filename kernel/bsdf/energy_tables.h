// Directional albedos of the microfacet lobes, made once at start. They say how much a lobe loses to bounces that it
// does not follow, which the surface model puts back, and how much of the light reaches what lies below.
//
// Read the structs and the look-ups first; bsdf_tables_make and its quadratures fill them. Roughness is perceptual
// (alpha = roughness²). The cosine's axis is √(µ(1 + alpha)/(µ + alpha)): losses happen where µ is about alpha, and
// along that axis the tables hardly depend on roughness. (√µ alone left 5 % of error for smooth metal at grazing
// angles.)
#pragma once

#include "kernel/assert.h"
#include "kernel/bsdf/dielectric.h"
#include "kernel/bsdf/sheen.h"
#include "kernel/bsdf/thin_film.h"
#include "kernel/feature_mask.h"

namespace relief {

inline constexpr int kGgxCosines = 32, kGgxRoughnesses = 32;
inline constexpr int kGlassCosines = 24, kGlassRoughnesses = 12, kGlassIors = 13;
inline constexpr int kSheenCosines = 32, kSheenRoughnesses = 16;
/// Glass is tabulated over √((ior − 1) / (ior + 1)) up to ior 3; denser glass uses the last entry.
inline constexpr float kGlassMaxRootF0 = 0.5f;

/// Albedo of GGX reflection, split so that any Schlick Fresnel can be put in afterwards.
struct GgxAlbedo {
  float lost = 0;     ///< 1 − albedo with F = 1
  float grazing = 0;  ///< albedo with F = (1 − cos)⁵
};

/// The same as stored: numbers that vary slowly.
struct GgxEntry {
  float root_lost = 0;  ///< √lost: losses fall with the square of alpha / µ, their root linearly along the axis
  float extra = 0;      ///< grazing − (1 − lost) (1 − µ)⁵
};

/// Sheen at one direction.
struct SheenAlbedo {
  float albedo = 0;  ///< with white sheen colour, after `bound`
  float bound = 1;   ///< 1, or less where the published model would reflect more than it receives
};

/// Nodes along each axis of BsdfTables::reflected_share.
inline constexpr int kShareNodes = 16;

/// About 75 kB; a render needs one. Glass, sheen and what closures ask for are filled only if asked for.
struct BsdfTables {
  GgxEntry ggx[kGgxRoughnesses][kGgxCosines];
  /// Means over the cosine-weighted hemisphere. Losses grow with alpha² and are stored divided by it, so that rows can
  /// be interpolated.
  GgxAlbedo ggx_mean[kGgxRoughnesses];
  float glass_root_lost[2][kGlassIors][kGlassRoughnesses][kGlassCosines];  ///< √(1 − albedo); [0]: from the thin side
  float glass_lost_mean[2][kGlassIors][kGlassRoughnesses];                 ///< over alpha²
  SheenAlbedo sheen[kSheenRoughnesses][kSheenCosines];
  /// How far the reflectance of visible microfacets has risen from F0 to 1 along a dielectric's curve, on the mean, those that
  /// lose the ray not at all: by roughness, fourth root of F0, cosine; axes from 0 to 1, linear.
  float reflected_share[kShareNodes][kShareNodes][kShareNodes];
  /// The same along Schlick's curve, which is that of any F0: by roughness, cosine.
  float schlick_share[kShareNodes][kShareNodes];
  ThinFilmTable thin_film;
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

/// Cosine axis of the microfacet tables.
RELIEF_KERNEL TableCoordinate microfacet_cosine(float cos_theta, float alpha, int size)
{
  return table_coordinate(__builtin_sqrtf(cos_theta * (1.0f + alpha) / (cos_theta + alpha)), size);
}

/// Cosine of node i of that axis; the horizon itself, where lobes have no value, becomes a direction next to it.
RELIEF_KERNEL float microfacet_node_cosine(int i, float alpha, int size)
{
  const float x2 = sqr(static_cast<float>(i) / static_cast<float>(size - 1));
  return min(1.0f, max(1e-3f, x2) * alpha / (1.0f + alpha - x2));
}

/// Albedo of a GGX lobe with Schlick's Fresnel.
RELIEF_KERNEL float ggx_albedo_with(float F0, float F90, GgxAlbedo e)
{
  return F0 * (1.0f - e.lost - e.grazing) + F90 * e.grazing;
}

/// Roughness axis of one surface.
struct GgxCoordinate {
  TableCoordinate roughness;
  float alpha = 1;
  bool mirror = false;  ///< alpha below kDeltaAlpha: loses nothing, needs no table
};

RELIEF_KERNEL GgxCoordinate ggx_coordinate(float roughness)
{
  const float alpha = sqr(roughness);
  return {table_coordinate(roughness, kGgxRoughnesses), alpha, alpha < kDeltaAlpha};
}

/// @param cos_theta  (0, 1]
RELIEF_KERNEL GgxAlbedo ggx_albedo(const BsdfTables& tables, const GgxCoordinate& g, float cos_theta)
{
  if (g.mirror) return {0.0f, schlick_weight(cos_theta)};
  const TableCoordinate c = microfacet_cosine(cos_theta, g.alpha, kGgxCosines);
  const GgxEntry* row0 = tables.ggx[g.roughness.index] + c.index;
  const GgxEntry* row1 = tables.ggx[g.roughness.index + 1] + c.index;
  const float root_lost = lerp(g.roughness.t, lerp(c.t, row0[0].root_lost, row0[1].root_lost),
                               lerp(c.t, row1[0].root_lost, row1[1].root_lost));
  const float extra =
      lerp(g.roughness.t, lerp(c.t, row0[0].extra, row0[1].extra), lerp(c.t, row1[0].extra, row1[1].extra));
  const float lost = sqr(root_lost);
  return {lost, (1.0f - lost) * schlick_weight(cos_theta) + extra};
}

RELIEF_KERNEL GgxAlbedo ggx_albedo_mean(const BsdfTables& tables, const GgxCoordinate& g)
{
  if (g.mirror) return {0.0f, 1.0f / 21.0f};
  const GgxAlbedo a = tables.ggx_mean[g.roughness.index], b = tables.ggx_mean[g.roughness.index + 1];
  return {sqr(g.alpha) * lerp(g.roughness.t, a.lost, b.lost), lerp(g.roughness.t, a.grazing, b.grazing)};
}

/// Axes of the sheen table. Roughness starts at kSheenMinRoughness and is denser there.
RELIEF_KERNEL TableCoordinate sheen_table_roughness(float roughness)
{
  const float x = (roughness - kSheenMinRoughness) / (1.0f - kSheenMinRoughness);
  return table_coordinate(safe_sqrt(x), kSheenRoughnesses);
}

RELIEF_KERNEL SheenAlbedo sheen_albedo(const BsdfTables& tables, TableCoordinate roughness, float cos_theta)
{
  const TableCoordinate c = table_coordinate(safe_sqrt(cos_theta), kSheenCosines);
  const auto row = [&](int r) {
    const SheenAlbedo a = tables.sheen[r][c.index], b = tables.sheen[r][c.index + 1];
    return SheenAlbedo{lerp(c.t, a.albedo, b.albedo), lerp(c.t, a.bound, b.bound)};
  };
  const SheenAlbedo a = row(roughness.index), b = row(roughness.index + 1);
  return {lerp(roughness.t, a.albedo, b.albedo), lerp(roughness.t, a.bound, b.bound)};
}

/// Axes of the glass table for one interface.
struct GlassCoordinate {
  TableCoordinate ior, roughness;
  float alpha = 1;
  int side = 0;  ///< 0: seen from the thin side
};

/// @param eta  index far / near
RELIEF_KERNEL GlassCoordinate glass_coordinate(float eta, float roughness)
{
  const float root_F0 = __builtin_fabsf(eta - 1.0f) / (eta + 1.0f);
  return {table_coordinate(__builtin_sqrtf(root_F0 / kGlassMaxRootF0), kGlassIors),
          table_coordinate(roughness, kGlassRoughnesses), sqr(roughness), eta < 1.0f ? 1 : 0};
}

/// Energy that one scattering by rough glass loses, reflection and refraction together.
/// @param side  0: seen from the thin side, 1: from the dense one
RELIEF_KERNEL float glass_lost(const BsdfTables& tables, const GlassCoordinate& g, int side, float cos_theta)
{
  const TableCoordinate c = microfacet_cosine(cos_theta, g.alpha, kGlassCosines);
  const auto row = [&](int i, int r) {
    const float* cosines = tables.glass_root_lost[side][i][r];
    return lerp(c.t, cosines[c.index], cosines[c.index + 1]);
  };
  const auto plane = [&](int i) {
    return lerp(g.roughness.t, row(i, g.roughness.index), row(i, g.roughness.index + 1));
  };
  return sqr(lerp(g.ior.t, plane(g.ior.index), plane(g.ior.index + 1)));
}

RELIEF_KERNEL float glass_lost_mean(const BsdfTables& tables, const GlassCoordinate& g, int side)
{
  const auto plane = [&](int i) {
    const float* roughnesses = tables.glass_lost_mean[side][i];
    return lerp(g.roughness.t, roughnesses[g.roughness.index], roughnesses[g.roughness.index + 1]);
  };
  return sqr(g.alpha) * lerp(g.ior.t, plane(g.ior.index), plane(g.ior.index + 1));
}

/// Mean over the cosine-weighted hemisphere, 2∫ f µ dµ, of a look-up: energy then balances with the values looked up.
template <typename F>
RELIEF_KERNEL float cosine_mean(F&& lookup)
{
  constexpr int kSteps = 128;
  float sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    // µ = y³: look-ups vary most near the horizon.
    const float y = (static_cast<float>(i) + 0.5f) / kSteps;
    const float mu = y * y * y;
    sum += lookup(mu) * mu * y * y;
  }
  return sum * (6.0f / kSteps);
}

/// Visible normals that a quadrature visits, the cosines and sines of its azimuths shared by all.
template <int kPhi, int kCap>
struct VisibleNormals {
  float cos_phi[kPhi], sin_phi[kPhi];

  /// Calls visit(wm, weight) for kPhi × kCap normals visible from wo; the weights add up to about 1.
  template <typename F>
  void for_each(Vec3f wo, float alpha, F&& visit) const
  {
    const Vec3f wo_std = normalize({wo.x * alpha, wo.y * alpha, wo.z});
    for (int j = 0; j < kCap; ++j) {
      // u = 1 − w²: denser in the tail of the distribution, where rays are lost and reflection becomes total.
      const float w = (static_cast<float>(j) + 0.5f) / kCap;
      const float z = 1.0f - (1.0f - w * w) * (1.0f + wo_std.z);
      const float r = safe_sqrt((1.0f - z) * (1.0f + z));
      for (int i = 0; i < kPhi; ++i) {
        const Vec3f wm_std{r * cos_phi[i] + wo_std.x, r * sin_phi[i] + wo_std.y, z + wo_std.z};
        visit(normalize({wm_std.x * alpha, wm_std.y * alpha, max(0.0f, wm_std.z)}), 2.0f * w / (kPhi * kCap));
      }
    }
  }
};

template <int kPhi, int kCap>
RELIEF_KERNEL VisibleNormals<kPhi, kCap> visible_normals_make()
{
  VisibleNormals<kPhi, kCap> v;
  for (int i = 0; i < kPhi; ++i) {
    // Half the azimuths: the other half mirrors them.
    const float phi = kPi * (static_cast<float>(i) + 0.5f) / kPhi;
    v.cos_phi[i] = std::cos(phi);
    v.sin_phi[i] = std::sin(phi);
  }
  return v;
}

using GgxQuadrature = VisibleNormals<16, 32>;
using GlassQuadrature = VisibleNormals<8, 24>;

/// Albedo of GGX reflection by quadrature over visible normals. The loss is what is summed: of smooth surfaces it is
/// far below the rounding of a sum near 1.
RELIEF_KERNEL GgxAlbedo ggx_albedo_integrate(const GgxQuadrature& normals, float cos_o, float alpha)
{
  const Vec3f wo{safe_sqrt(1.0f - cos_o * cos_o), 0.0f, cos_o};
  const float lambda_o = ggx_lambda(cos_o, alpha);
  GgxAlbedo e;
  normals.for_each(wo, alpha, [&](Vec3f wm, float weight) {
    const float cos_d = dot(wo, wm);
    const float z = 2.0f * cos_d * wm.z - wo.z;
    const float hidden = z > 0.0f ? ggx_hidden_share(lambda_o, ggx_lambda(z, alpha)) : 1.0f;
    e.lost += weight * hidden;
    e.grazing += weight * (1.0f - hidden) * schlick_weight(cos_d);
  });
  return e;
}

/// Energy lost by one scattering of rough glass.
/// @param eta  index far / near
RELIEF_KERNEL float glass_lost_integrate(const GlassQuadrature& normals, float cos_o, float alpha, float eta)
{
  const Vec3f wo{safe_sqrt(1.0f - cos_o * cos_o), 0.0f, cos_o};
  const float lambda_o = ggx_lambda(cos_o, alpha);
  float lost = 0;
  normals.for_each(wo, alpha, [&](Vec3f wm, float weight) {
    const float cos_d = min(1.0f, dot(wo, wm));
    const float cos_t = refracted_cosine(cos_d, eta);
    const float F = fresnel_dielectric(cos_d, cos_t, eta);
    const float height = 2.0f * cos_d * wm.z - wo.z;
    const float depth = -refract(wo, wm, cos_d, cos_t, eta).z;
    const float reflected_lost = height > 0.0f ? ggx_hidden_share(lambda_o, ggx_lambda(height, alpha)) : 1.0f;
    const float refracted_lost = depth > 0.0f ? ggx_hidden_share(lambda_o, ggx_lambda(depth, alpha)) : 1.0f;
    lost += weight * lerp(F, refracted_lost, reflected_lost);
  });
  return lost;
}

RELIEF_KERNEL void ggx_tables_make(BsdfTables& tables)
{
  const GgxQuadrature normals = visible_normals_make<16, 32>();
  for (int r = 0; r < kGgxRoughnesses; ++r) {
    // Mirrors are not looked up; the first row serves the interpolation towards them.
    const float alpha = max(kDeltaAlpha, sqr(static_cast<float>(r) / (kGgxRoughnesses - 1)));
    for (int c = 0; c < kGgxCosines; ++c) {
      const float cos_theta = microfacet_node_cosine(c, alpha, kGgxCosines);
      const GgxAlbedo e = ggx_albedo_integrate(normals, cos_theta, alpha);
      tables.ggx[r][c] = {__builtin_sqrtf(e.lost), e.grazing - (1.0f - e.lost) * schlick_weight(cos_theta)};
    }
  }
  for (int r = 0; r < kGgxRoughnesses; ++r) {
    const GgxCoordinate g{{r < kGgxRoughnesses - 1 ? r : r - 1, r < kGgxRoughnesses - 1 ? 0.0f : 1.0f},
                          max(kDeltaAlpha, sqr(static_cast<float>(r) / (kGgxRoughnesses - 1)))};
    tables.ggx_mean[r] = {cosine_mean([&](float mu) { return ggx_albedo(tables, g, mu).lost; }) / sqr(g.alpha),
                          cosine_mean([&](float mu) { return ggx_albedo(tables, g, mu).grazing; })};
  }
}

RELIEF_KERNEL void glass_tables_make(BsdfTables& tables)
{
  const GlassQuadrature normals = visible_normals_make<8, 24>();
  for (int side = 0; side < 2; ++side) {
    for (int i = 0; i < kGlassIors; ++i) {
      const float root_F0 = kGlassMaxRootF0 * sqr(static_cast<float>(i) / (kGlassIors - 1));
      const float ior = (1.0f + root_F0) / (1.0f - root_F0);
      for (int r = 0; r < kGlassRoughnesses; ++r) {
        const float alpha = max(kDeltaAlpha, sqr(static_cast<float>(r) / (kGlassRoughnesses - 1)));
        float* row = tables.glass_root_lost[side][i][r];
        for (int c = 0; c < kGlassCosines; ++c) {
          const float cos_theta = microfacet_node_cosine(c, alpha, kGlassCosines);
          row[c] = __builtin_sqrtf(glass_lost_integrate(normals, cos_theta, alpha, side == 0 ? ior : 1.0f / ior));
        }
        const float mean = cosine_mean([&](float mu) {
          const TableCoordinate at = microfacet_cosine(mu, alpha, kGlassCosines);
          return sqr(lerp(at.t, row[at.index], row[at.index + 1]));
        });
        tables.glass_lost_mean[side][i][r] = mean / sqr(alpha);
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
    const float cos_o = max(1e-5f, sqr(static_cast<float>(c) / (kSheenCosines - 1)));
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
    const float x = sqr(static_cast<float>(r) / (kSheenRoughnesses - 1));
    const float roughness = kSheenMinRoughness + (1.0f - kSheenMinRoughness) * x;
    sheen_row_make(tables.sheen[r], roughness);
  }
}

/// Both tables of shares.
RELIEF_KERNEL void reflected_share_make(BsdfTables& tables)
{
  // Points of a lattice: a grid of as many missed by three times as much.
  constexpr int kPoints = 128, kStep = 79;
  const auto node = [](int i) { return static_cast<float>(i) / (kShareNodes - 1); };
  for (int r = 0; r < kShareNodes; ++r) {
    const float alpha = max(1e-4f, sqr(node(r)));
    for (int c = 0; c < kShareNodes; ++c) {
      const float cos_o = max(1e-4f, node(c));
      const Vec3f wo{__builtin_sqrtf(1.0f - sqr(cos_o)), 0.0f, cos_o};
      float met[kPoints];  // cosines to microfacets that reflect upwards
      int num_met = 0;
      for (int i = 0; i < kPoints; ++i) {
        const Vec2f u{(static_cast<float>(i * kStep % kPoints) + 0.5f) / kPoints,
                      (static_cast<float>(i) + 0.5f) / kPoints};
        const Vec3f wm = warp_ggx_visible_normal(wo, alpha, u);
        const float cos_d = dot(wo, wm);
        if (2.0f * cos_d * wm.z > wo.z) met[num_met++] = min(1.0f, cos_d);
      }
      float along_schlick = 0.0f;
      for (int i = 0; i < num_met; ++i) along_schlick += schlick_weight(met[i]);
      tables.schlick_share[r][c] = along_schlick / kPoints;
      for (int f = 0; f < kShareNodes; ++f) {
        const float F0 = min(sqr(sqr(clamp(node(f), 1e-4f, 0.99f))), 0.99f);
        const float eta = (1.0f + __builtin_sqrtf(F0)) / (1.0f - __builtin_sqrtf(F0));
        float sum = 0.0f;
        for (int i = 0; i < num_met; ++i) {
          const float F = fresnel_dielectric(met[i], refracted_cosine(met[i], eta), eta);
          sum += clamp((F - F0) / (1.0f - F0), 0.0f, 1.0f);
        }
        tables.reflected_share[r][f][c] = sum / kPoints;
      }
    }
  }
}

/// How far a rough dielectric's albedo lies between its F0 and 1, as the Principled BSDF of 4.x takes it.
/// @param eta    index of the far side / index of wo's side
/// @param cos_o  (0, 1]
RELIEF_KERNEL float reflected_share(const BsdfTables& tables, float roughness, float eta, float cos_o)
{
  const float root = __builtin_sqrtf(__builtin_fabsf((eta - 1.0f) / (eta + 1.0f)));
  const TableCoordinate r = table_coordinate(roughness, kShareNodes), f = table_coordinate(root, kShareNodes),
                        c = table_coordinate(cos_o, kShareNodes);
  const auto along_c = [&](int i, int j) {
    const float* row = tables.reflected_share[r.index + i][f.index + j] + c.index;
    return lerp(c.t, row[0], row[1]);
  };
  return lerp(r.t, lerp(f.t, along_c(0, 0), along_c(0, 1)), lerp(f.t, along_c(1, 0), along_c(1, 1)));
}

/// The same of a metal, whose reflectance rises along Schlick's curve.
RELIEF_KERNEL float schlick_share(const BsdfTables& tables, float roughness, float cos_o)
{
  const TableCoordinate r = table_coordinate(roughness, kShareNodes), c = table_coordinate(cos_o, kShareNodes);
  const auto along_c = [&](int i) {
    const float* row = tables.schlick_share[r.index + i] + c.index;
    return lerp(c.t, row[0], row[1]);
  };
  return lerp(r.t, along_c(0), along_c(1));
}

/// Fills the tables; the same bits on every run.
/// @param features  FeatureBit mask of the scene: without transmission there is no glass table, without layers no sheen,
///                  without closures nothing of theirs
/// @cost            see the test BsdfTables.AreMadeWithinTheirBudget
RELIEF_KERNEL void bsdf_tables_make(BsdfTables& tables, unsigned features = kFeatureAll)
{
  ggx_tables_make(tables);
  if ((features & kFeatureTransmission) != 0) glass_tables_make(tables);
  if ((features & kFeatureLayers) != 0) sheen_tables_make(tables);
  if ((features & kFeatureMixture) != 0) {
    reflected_share_make(tables);
    thin_film_table_make(tables.thin_film);
  }
}

}  // namespace relief
