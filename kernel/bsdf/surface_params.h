// Parameters of the surface model at one point: a material's constants times its textures. layered.h scatters light by
// them. Also what normal maps need: the decoded normal, and keeping it consistent with the direction looked from.
#pragma once

#include "kernel/feature_mask.h"
#include "kernel/texture/texture.h"

namespace relief {

/// Everything the surface model depends on. Ranges are enforced by surface_params_eval.
struct SurfaceParams {
  Vec3f base_color{1, 1, 1};      ///< [0, 1]
  float alpha = 1;                ///< coverage, [0, 1]: 1 for opaque materials, 0 or 1 for masks
  float metallic = 0;             ///< [0, 1]
  float roughness = 1;            ///< [0, 1], perceptual: GGX alpha = roughness²
  float transmission = 0;         ///< [0, 1], share of the dielectric base that is glass instead of diffuse
  float ior = 1.5f;               ///< inside over outside, >= 1 (KHR_materials_ior's 0 becomes a very large one)
  float specular = 1;             ///< F90 of the dielectric base and factor on its F0, [0, 1]
  Vec3f specular_color{1, 1, 1};  ///< factor on the dielectric F0, >= 0
  float clearcoat = 0;            ///< [0, 1]
  float clearcoat_roughness = 0;  ///< [0, 1]
  Vec3f clearcoat_N{0, 0, 1};     ///< unit, local shading frame; set by the caller where the coat has its own normal
  Vec3f sheen_color{0, 0, 0};     ///< [0, 1]
  float sheen_roughness = 0;      ///< [0, 1]
  Vec3f emission{0, 0, 0};        ///< radiance
  bool thin = true;               ///< transmission passes a wall without refraction; otherwise the mesh bounds a solid
  bool unlit = false;             ///< the base colour is emitted (already added to `emission`), nothing is scattered
};

/// Value of a material's texture at a point.
/// @param uv        the mesh's texture coordinate sets
/// @param uv_width  footprint in each set's uv units
/// @return          linear RGBA; white where the material has no such texture
template <unsigned kFeatures>
RELIEF_KERNEL Vec4f
material_texture_sample(const TextureRef& ref, const TextureView* textures, const Vec2f uv[2], const float uv_width[2])
{
  if constexpr ((kFeatures & (kFeatureTextures | kFeatureNormalMaps)) != 0) {
    if (ref.texture_index >= 0) {
      return texture_sample(textures[ref.texture_index], texture_ref_uv(ref, uv[ref.uv_set]),
                            texture_ref_width(ref, uv_width[ref.uv_set]));
    }
  }
  return {1, 1, 1, 1};
}

/// Evaluates a material at a point.
/// @param textures      indexed by TextureRef::texture_index
/// @param uv            the mesh's texture coordinate sets
/// @param vertex_color  COLOR_0, white where absent
/// @param uv_width      texture footprint in each set's uv units; 0: finest level
/// @return              values in the ranges of SurfaceParams, whatever the textures hold
template <unsigned kFeatures>
RELIEF_KERNEL SurfaceParams surface_params_eval(const Material& m,
                                                const TextureView* textures,
                                                const Vec2f uv[2],
                                                Vec4f vertex_color,
                                                const float uv_width[2])
{
  const auto texel = [&](const TextureRef& ref) {
    return material_texture_sample<kFeatures>(ref, textures, uv, uv_width);
  };
  const auto saturate = [](float x) { return clamp(x, 0.0f, 1.0f); };
  const auto saturate_color = [&](Vec3f c) { return Vec3f{saturate(c.x), saturate(c.y), saturate(c.z)}; };

  SurfaceParams p;
  const Vec4f base = texel(m.base_color_texture);
  p.base_color = saturate_color(m.base_color * xyz(base) * xyz(vertex_color));
  if constexpr ((kFeatures & kFeatureTransparency) != 0) {
    const float alpha = saturate(m.base_alpha * base.w * vertex_color.w);
    if (m.alpha_mode == AlphaMode::kMask) p.alpha = alpha >= m.alpha_cutoff ? 1.0f : 0.0f;
    if (m.alpha_mode == AlphaMode::kBlend) p.alpha = alpha;
  }
  p.emission = m.emission * xyz(texel(m.emission_texture));
  if (m.unlit) {
    p.unlit = true;
    p.emission = p.base_color;
    return p;
  }

  const Vec4f metallic_roughness = texel(m.metallic_roughness_texture);
  p.roughness = saturate(m.roughness * metallic_roughness.y);
  if constexpr ((kFeatures & kFeatureMetal) != 0) p.metallic = saturate(m.metallic * metallic_roughness.z);
  p.ior = m.ior >= 1.0f ? m.ior : 1e4f;
  p.specular = saturate(m.specular * texel(m.specular_texture).w);
  p.specular_color = max(Vec3f{}, m.specular_color * xyz(texel(m.specular_color_texture)));

  if constexpr ((kFeatures & kFeatureTransmission) != 0) {
    p.transmission = saturate(m.transmission * texel(m.transmission_texture).x);
    p.thin = !(m.thickness > 0.0f);
  }
  if constexpr ((kFeatures & kFeatureLayers) != 0) {
    if (m.clearcoat > 0.0f) {
      p.clearcoat = saturate(m.clearcoat * texel(m.clearcoat_texture).x);
      p.clearcoat_roughness = saturate(m.clearcoat_roughness * texel(m.clearcoat_roughness_texture).y);
    }
    if (max_component(m.sheen_color) > 0.0f) {
      p.sheen_color = saturate_color(m.sheen_color * xyz(texel(m.sheen_color_texture)));
      p.sheen_roughness = saturate(m.sheen_roughness * texel(m.sheen_roughness_texture).w);
    }
  }
  return p;
}

/// Normal from a tangent-space normal map, of its finest level: the mean of normals that spread is a mirror where there was
/// none, and metal seen from afar was a fifth as bright. Samples of a pixel see the spread themselves.
/// @param scale  factor on x and y (normalTexture.scale)
/// @return       unit, tangent space (x along the tangent, z along the surface's normal); +z without a map, or where
///               the map holds no direction
RELIEF_KERNEL Vec3f normal_map_eval(const TextureRef& ref, float scale, const TextureView* textures, const Vec2f uv[2])
{
  if (ref.texture_index < 0) return {0, 0, 1};
  constexpr float kFinest[2] = {0, 0};
  const Vec4f texel = material_texture_sample<kFeatureNormalMaps>(ref, textures, uv, kFinest);
  const Vec3f n{scale * (2.0f * texel.x - 1.0f), scale * (2.0f * texel.y - 1.0f), 2.0f * texel.z - 1.0f};
  // A tangent-space normal never points into the surface; the bound keeps it from lying in it.
  const Vec3f outward{n.x, n.y, max(n.z, 1e-3f)};
  const float squared = length_squared(outward);
  return is_finite(squared) ? outward / __builtin_sqrtf(squared) : Vec3f{0, 0, 1};
}

/// The material's normal map (normalTexture).
RELIEF_KERNEL Vec3f normal_map_eval(const Material& m, const TextureView* textures, const Vec2f uv[2])
{
  return normal_map_eval(m.normal_texture, m.normal_scale, textures, uv);
}

/// The coat's normal map (clearcoatNormalTexture).
RELIEF_KERNEL Vec3f clearcoat_normal_map_eval(const Material& m, const TextureView* textures, const Vec2f uv[2])
{
  return normal_map_eval(m.clearcoat_normal_texture, m.clearcoat_normal_scale, textures, uv);
}

/// Shading normal bent no further than needed for a mirror to reflect wo above the true surface.
///
/// A perturbed normal can send the reflection of wo below the surface, where it finds no light: polished metal with a
/// normal map gets black patches. The reflected direction is lifted to just above the horizon, and the normal becomes
/// the half vector between it and wo.
/// @param Ng  unit geometric normal, dot(Ng, wo) > 0 (turn both normals for a back side)
/// @param Ns  unit shading normal
/// @param wo  unit, same space
/// @return    unit; Ns itself where it needs no help; always dot(result, wo) > 0
/// @source    the idea of Keller et al. 2017, "The Iray Light Transport Simulation and Rendering System", §A.3
RELIEF_KERNEL Vec3f shading_normal_consistent(Vec3f Ng, Vec3f Ns, Vec3f wo)
{
  // Height of the lifted reflection above the horizon: 0.6°, and never higher than wo, so that Ng itself always passes.
  constexpr float kLift = 0.01f;
  const float height = min(kLift, 0.9f * dot(Ng, wo));
  const float cos_o = dot(Ns, wo);
  const Vec3f reflected = 2.0f * cos_o * Ns - wo;
  const float reflected_height = dot(Ng, reflected);
  if (cos_o > 0.0f && reflected_height >= height) return Ns;

  const Vec3f in_plane = reflected - reflected_height * Ng;
  const float squared = length_squared(in_plane);
  // Straight down: no side to lift to.
  if (!(squared > 1e-12f)) return Ng;
  const Vec3f lifted = in_plane * (safe_sqrt(1.0f - sqr(height)) / __builtin_sqrtf(squared)) + height * Ng;
  const Vec3f N = normalize(wo + lifted);
  // Where wo grazes and is reflected back on itself, the sum cancels and its rounding may tilt N too far.
  return 2.0f * dot(N, wo) * dot(N, Ng) > dot(wo, Ng) ? N : Ng;
}

/// A normal turned towards the geometric one, in the plane of both, until a mirror reflects wo above the true surface: as Cycles
/// has it, where shading_normal_consistent leaves that plane.
///
/// In that plane mirroring adds angles: the normal lies half way between wo's projection and the reflected direction's, and only
/// the height of the latter is asked for.
/// @param Ng, N, wo  unit, dot(Ng, wo) > 0
RELIEF_KERNEL Vec3f normal_with_reflection_above(Vec3f Ng, Vec3f N, Vec3f wo)
{
  const float height_o = dot(Ng, wo);
  // Rays may always leave as shallow as they come.
  const float height = min(0.9f * height_o, 0.01f);
  if (2.0f * dot(N, wo) * dot(N, Ng) - height_o >= height) return N;
  const Vec3f aside = N - dot(N, Ng) * Ng;
  const float squared = length_squared(aside);
  if (!(squared > 1e-12f)) return Ng;
  const Vec3f X = aside / __builtin_sqrtf(squared);
  const float x = dot(wo, X);
  const float inv_length = 1.0f / __builtin_sqrtf(x * x + height_o * height_o);
  const float reflected_z = height * inv_length;
  const Vec3f middle =
      (x * inv_length + safe_sqrt(1.0f - sqr(reflected_z))) * X + (height_o * inv_length + reflected_z) * Ng;
  return normalize(middle);
}

/// What a denoiser or compositor calls the surface's colour.
/// @return base colour, linear; for unlit surfaces what they emit
RELIEF_KERNEL Vec3f surface_albedo(const SurfaceParams& p) { return p.base_color; }

}  // namespace relief
