// Sheen of Blender 4.x: a layer of fibres that stand up, with all their bounces, as a cosine lobe under a linear map.
//
// Zeltner, Burley and Chiang 2022, "Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines" [Z]; Heitz,
// Dupuy, Hill and Neubelt 2016, "Real-Time Polygonal-Light Shading with Linearly Transformed Cosines".
#pragma once

#include "kernel/bsdf/mixture_traits.h"
#include "kernel/sample/warp.h"

namespace relief {

inline constexpr int kMicrofibreNodes = 32;

/// Plain data, 12 kB.
inline constexpr float kMicrofibreTable[3][kMicrofibreNodes][kMicrofibreNodes] = {
#include "kernel/bsdf/sheen_microfibre_table.inc"
};

/// The map, about the plane of wo and the normal, and what the layer reflects. Where the albedo is 0 there is no lobe.
struct SheenMicrofibre {
  static constexpr MixtureTraits kTraits{};
  float A = 1, B = 0;
  float albedo = 0;
};

/// @param wo_z       (0, 1]
/// @param roughness  clamped to [0.001, 1]
/// @source           [Z]; tables are read bilinearly, and tiny entries count as none, as in Cycles
RELIEF_KERNEL SheenMicrofibre sheen_microfibre_make(float wo_z, float roughness)
{
  const auto position = [](float x) { return clamp(x, 0.0f, 1.0f) * static_cast<float>(kMicrofibreNodes - 1); };
  const float x = position(wo_z), y = position(clamp(roughness, 1e-3f, 1.0f));
  const auto lower = [](float at) {
    const int i = static_cast<int>(at);
    return i < kMicrofibreNodes - 2 ? i : kMicrofibreNodes - 2;
  };
  const int column = lower(x), row = lower(y);
  const float s = x - static_cast<float>(column), t = y - static_cast<float>(row);
  const auto read = [&](int which) {
    const auto& table = kMicrofibreTable[which];
    return lerp(t, lerp(s, table[row][column], table[row][column + 1]),
                lerp(s, table[row + 1][column], table[row + 1][column + 1]));
  };
  const SheenMicrofibre lobe{read(0), read(1), read(2)};
  return __builtin_fabsf(lobe.A) < 1e-5f || lobe.albedo < 1e-5f ? SheenMicrofibre{} : lobe;
}

/// f before the colour; its integral with the cosine is the albedo. Reciprocal only as far as the fit is.
/// @param lobe    of wo.z
/// @param wo, wi  unit; wo.z > 0
/// @param pdf     solid angle of wi under sheen_microfibre_sample: proportional to f · cos
RELIEF_KERNEL float sheen_microfibre_eval(const SheenMicrofibre& lobe, Vec3f wo, Vec3f wi, float* pdf)
{
  *pdf = 0.0f;
  if (!(wi.z > 0.0f && lobe.albedo > 0.0f)) return 0.0f;
  // Only the part of wi along wo's azimuth matters besides its height.
  const float across = __builtin_sqrtf(wo.x * wo.x + wo.y * wo.y);
  const float along = across > 1e-6f ? (wo.x * wi.x + wo.y * wi.y) / across : wi.x;
  const float side2 = max(0.0f, wi.x * wi.x + wi.y * wi.y - along * along);
  const float squared = sqr(lobe.A * along + lobe.B * wi.z) + sqr(lobe.A) * side2 + sqr(wi.z);
  const float density_over_cos = kInvPi * sqr(lobe.A / squared);
  *pdf = density_over_cos * wi.z;
  return lobe.albedo * density_over_cos;
}

/// @return unit, z >= 0; zero vector without a lobe
RELIEF_KERNEL Vec3f sheen_microfibre_sample(const SheenMicrofibre& lobe, Vec3f wo, Vec2f u)
{
  if (!(lobe.albedo > 0.0f)) return {};
  const Vec3f c = warp_cosine_hemisphere(u);
  const Vec3f w = normalize({c.x - c.z * lobe.B, c.y, c.z * lobe.A});
  const float across = __builtin_sqrtf(wo.x * wo.x + wo.y * wo.y);
  if (!(across > 1e-6f)) return w;
  const float cos_phi = wo.x / across, sin_phi = wo.y / across;
  return {cos_phi * w.x - sin_phi * w.y, sin_phi * w.x + cos_phi * w.y, w.z};
}

template <TransportMode>
RELIEF_KERNEL BsdfEval lobe_eval(const SheenMicrofibre& lobe, const LobeHit& hit, const BsdfTables&, Vec3f wi, bool)
{
  BsdfEval e;
  e.f = splat3(sheen_microfibre_eval(lobe, hit.wo, wi, &e.pdf));
  return e;
}

template <TransportMode>
RELIEF_KERNEL LobeSample lobe_sample(const SheenMicrofibre& lobe, const LobeHit& hit, float, Vec2f u)
{
  return lobe_sample_diffuse(sheen_microfibre_sample(lobe, hit.wo, u), false);
}

}  // namespace relief
