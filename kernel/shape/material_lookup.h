// Material quantities at a point of a triangle, for callers that need one of them without a whole surface evaluation.
#pragma once

#include "kernel/bsdf/material.h"
#include "kernel/shape/mesh_view.h"
#include "kernel/texture/texture.h"

namespace relief {

/// uv of a texture reference at a point of a triangle, texture transform applied.
RELIEF_KERNEL Vec2f
triangle_texture_uv(const MeshView& mesh, TriangleIndices tri, float bary_u, float bary_v, const TextureRef& ref)
{
  const Vec2f* uv = mesh.uv[ref.uv_set];
  if (uv == nullptr) return texture_ref_uv(ref, {});
  return texture_ref_uv(ref, (1.0f - bary_u - bary_v) * uv[tri.v0] + bary_u * uv[tri.v1] + bary_v * uv[tri.v2]);
}

/// Opacity at a point of a triangle, finest texture level: 0 lets everything through.
RELIEF_KERNEL float triangle_alpha(const Material& material,
                                   const TextureView* textures,
                                   const MeshView& mesh,
                                   std::uint32_t triangle_index,
                                   float bary_u,
                                   float bary_v)
{
  if (material.alpha_mode == AlphaMode::kOpaque) return 1.0f;
  const TriangleIndices tri = mesh.triangles[triangle_index];
  float alpha = material.base_alpha;
  if (mesh.color != nullptr) {
    alpha *=
        (1.0f - bary_u - bary_v) * mesh.color[tri.v0].w + bary_u * mesh.color[tri.v1].w + bary_v * mesh.color[tri.v2].w;
  }
  const TextureRef& ref = material.base_color_texture;
  if (ref.texture_index >= 0) {
    alpha *= texture_sample(textures[ref.texture_index], triangle_texture_uv(mesh, tri, bary_u, bary_v, ref), 0.0f).w;
  }
  if (material.alpha_mode == AlphaMode::kMask) return alpha >= material.alpha_cutoff ? 1.0f : 0.0f;
  return clamp(alpha, 0.0f, 1.0f);
}

/// Whether emission is the same at all points of a material's triangles.
RELIEF_KERNEL bool emission_is_even(const Material& material)
{
  return material.emission_texture.texture_index < 0 && material.emission_index < 0 &&
         (material.has_closures || material.alpha_mode == AlphaMode::kOpaque);
}

/// Radiance that a point of a triangle sends out besides what a graph gives, finest texture level: what is transparent emits as
/// little as it stops, unless closures say what emits.
RELIEF_KERNEL Vec3f triangle_emission(const Material& material,
                                      const TextureView* textures,
                                      const MeshView& mesh,
                                      std::uint32_t triangle_index,
                                      Vec2f barycentric)
{
  const float alpha = material.has_closures
                          ? 1.0f
                          : triangle_alpha(material, textures, mesh, triangle_index, barycentric.x, barycentric.y);
  const TextureRef& ref = material.emission_texture;
  if (ref.texture_index < 0) return material.emission * alpha;
  const Vec2f uv = triangle_texture_uv(mesh, mesh.triangles[triangle_index], barycentric.x, barycentric.y, ref);
  return material.emission * xyz(texture_sample(textures[ref.texture_index], uv, 0.0f)) * alpha;
}

}  // namespace relief
