// Ray cones: how wide the bundle of rays is that one path stands for, and so how coarse a texture may be read.
//
// A path's samples are many, and each shows what it reads: so a third of the cone is read (kReadOfCone).
//
// A cone is followed from the camera (ray_cone_from_*), along rays (ray_cone_propagate), over bounces
// (ray_cone_scatter); at a hit it becomes a width on the surface and then in uv (ray_cone_footprint_*).
// Akenine-Möller, Crassin, Boksansky, Belcour, Panteleev, Wright 2021, "Improved Shader and Texture Level of Detail
// Using Ray Cones", JCGT 10(1); Akenine-Möller, Nilsson, Andersson, Barré-Brisebois, Toth, Karras 2019, "Texture Level
// of Detail Strategies for Real-Time Ray Tracing", Ray Tracing Gems ch. 20.
#pragma once

#include "kernel/math/trigonometry.h"

namespace relief {

/// Bundle of rays around one ray.
struct RayCone {
  float width = 0;   ///< metres, diameter at the ray's origin
  float spread = 0;  ///< radians, full opening angle; small angles are assumed
};

/// Widest spread a cone can have: beyond it "around one ray" means nothing, and coarser levels gain nothing.
inline constexpr float kMaxConeSpread = 1.0f;

/// Cone of one pixel of a perspective camera.
/// @param half_height   half the image window on the plane at distance 1 (Camera::half_height)
/// @param height_pixels  of the whole image
/// The lens is left out: its width counts only where the image is out of focus, and there the samples average.
/// @source Ray Tracing Gems ch. 20, for the image's centre
RELIEF_KERNEL RayCone ray_cone_from_perspective(float half_height, int height_pixels)
{
  return {0.0f, 2.0f * half_height / static_cast<float>(height_pixels)};
}

/// Cone of one pixel of an orthographic camera: a cylinder.
/// @param half_height  half the image window, metres
RELIEF_KERNEL RayCone ray_cone_from_orthographic(float half_height, int height_pixels)
{
  return {2.0f * half_height / static_cast<float>(height_pixels), 0.0f};
}

/// The cone at a point further along its ray.
/// @param t  metres from the cone's origin, along a unit direction
/// @source   Ray Tracing Gems ch. 20
RELIEF_KERNEL RayCone ray_cone_propagate(RayCone cone, float t) { return {cone.width + cone.spread * t, cone.spread}; }

/// Opening angle that a rough interaction adds: full angle of the cone that holds the median microfacet tilt. GGX tilts have
/// tan²θ = α² ξ/(1 − ξ), so the median is atan α; a quantile, because their variance is infinite. A mirror turns its ray by
/// twice the tilt; the tilt itself is taken, half of that, because many samples a pixel average what is left, while blur
/// cannot be undone. Refraction turns less; the same value is used, since what is seen through rough glass is blurred anyway.
/// @param alpha  GGX roughness, square of glTF's; >= 0. Diffuse reflection counts as 1
/// @return       radians, [0, π)
RELIEF_KERNEL float ray_cone_spread_from_roughness(float alpha) { return 2.0f * angle_of(alpha, 1.0f); }

/// The cone after an interaction, at the surface.
/// @param cone   at the hit (after ray_cone_propagate)
/// @param alpha  see ray_cone_spread_from_roughness
RELIEF_KERNEL RayCone ray_cone_scatter(RayCone cone, float alpha)
{
  return {cone.width, min(cone.spread + ray_cone_spread_from_roughness(alpha), kMaxConeSpread)};
}

/// Width of what is read of a texture, over the cone's. A whole cone blurs what its pixel's filter, or its lobe, blurs again: lines
/// as fine as pixels had .85 of their contrast, reflections in gloss were wider by a fifth.
inline constexpr float kReadOfCone = 1.0f / 3;

/// Width of the cone's footprint on a surface.
/// @param cone       at the hit
/// @param cos_theta  |cosine| between ray and geometric normal
/// @return           metres; the footprint is an ellipse with axes width and width / cos: this is their geometric mean,
///                   the circle of equal area. (The papers divide by cos: no aliasing without supersampling, but
///                   blur at grazing angles, which a path tracer's samples make needless.) Grazing rays: infinity
RELIEF_KERNEL float ray_cone_footprint_world(RayCone cone, float cos_theta)
{
  return cone.width / __builtin_sqrtf(max(cos_theta, 0.0f));
}

/// Width of a footprint in uv units.
/// @param width_world  metres, see ray_cone_footprint_world
/// @param area_world   of the triangle, m²
/// @param area_uv      of the same triangle in uv space, sign ignored
/// @return             0 (finest level) for degenerate triangles without world area, and for NaN
/// @source             Akenine-Möller et al. 2021: the root of the ratio of areas, without the logarithms
RELIEF_KERNEL float ray_cone_footprint_uv(float width_world, float area_world, float area_uv)
{
  const float width = width_world * __builtin_sqrtf(__builtin_fabsf(area_uv) / area_world);
  return area_world > 0.0f && width > 0.0f ? width : 0.0f;
}

}  // namespace relief
