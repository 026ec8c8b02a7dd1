// The kinds of light as plain data. One file a kind (point.h, spot.h, …) says all that is particular to it (light_sample.h);
// light_sampler.h chooses among many.
#pragma once

#include "kernel/math/affine.h"
#include "kernel/state/path_event.h"

namespace relief {

enum class LightKind : std::uint8_t {
#define LIGHT_KIND(name, Type) name,
#include "kernel/light/light_kinds.inc"
};

/// How a spot fades from its inner to its outer cone, by t = (cos − cos outer) / (cos inner − cos outer) in [0, 1].
enum class SpotFalloff : std::uint8_t {
  kSquare,        ///< t², of KHR_lights_punctual
  kSmooth,        ///< t²(3 − 2t)
  kSmoothCosine,  ///< the same times the cosine of the angle to the axis
};

/// One emitter, in world space or, if instances share it, in object space. Which fields mean something depends on `kind`.
/// Two cache lines.
struct alignas(64) Light {
  LightKind kind = LightKind::kPoint;
  SpotFalloff falloff = SpotFalloff::kSquare;
  bool two_sided = false;         ///< rectangle, disk, triangle
  bool visible_to_camera = true;  ///< rectangle, disk, ball, sun of an angle
  bool is_even = true;            ///< all its points send out `emission`: see emission_is_even, and lamp_index
  bool casts_caustics = true;     ///< photons start from it, where there is a photon pass
  bool faces_viewer = false;  ///< point, spot with a radius: a disk that faces whoever looks at it instead of a ball;
                              ///< sun of an angle: a flat disk, see sun.h
  std::int8_t dark_side = 0;     ///< of a mesh's light: what its front (> 0) or back (< 0) sends out ends on the mesh
                                 ///< itself, all (±2) or nearly all of it (±1); see light_sides_find
  std::uint8_t hidden_from = 0;  ///< bit PathEvent, or kHiddenFromScattered: what scatters so is not lit, see light_hides
  std::uint8_t light_group = 0;  ///< number of a group from 1 on; 0: none
  bool multiple_importance = true;  ///< rays that scatter meet it; else it is only asked for
  bool in_footage = true;        ///< it lights shadow catchers where they are alone, too
  Vec3f P{};                     ///< position or centre, metres (triangle: first vertex)
  Vec3f axis{0, 0, -1};          ///< unit: spot and sun: direction of travel; rectangle, disk, triangle: emitting side
  Vec3f edge_u{}, edge_v{};      ///< rectangle, disk: *half* axes, any two independent vectors (disk: an ellipse);
                                 ///< triangle: P1−P0 and P2−P0
  Vec3f emission{};              ///< point, spot: radiant intensity (W/sr, on the spot's axis); sun: irradiance on a
                                 ///< plane across the axis (W/m²); area kinds: radiance (W/m²/sr)
  float cos_inner = 1, cos_outer = 0;  ///< spot cone
  float radius = 0;                    ///< point, spot: of the ball or disk that shines in the point's place, metres
  float area = 0;                      ///< m², area kinds
  std::int32_t instance_index = -1;    ///< triangle, and rectangle that two triangles of a mesh are: whose mesh (of
                                       ///< shared ones, the first of the instances)
  std::int32_t triangle_index = -1;    ///< likewise (the first of two)
  std::int32_t whole_index = -1;       ///< second triangle of such a rectangle: that light; nothing else of it counts
  std::int32_t lamp_index = -1;        ///< of what a value graph makes uneven, but for meshes: see Lamp
  std::int32_t motion_index = -1;  ///< of one that moves while the shutter is open, into LightsView::motions; −1: none
  float lamp_scale = 1;            ///< factor on what the graph gives; `emission` is divided by it, so as to be a mean
  float spread_tan = 0;  ///< rectangle, disk: tangent of the widest angle to the axis; 0: it shines to all of its side
  float spread_scale = 0;  ///< see light_spread
  float cone = 0;          ///< sun: one minus the cosine of half the angle that it is seen under; 0: it is a point
};

/// Whether a light is infinitely far away, so that it has a direction and no place.
RELIEF_KERNEL bool light_is_sun(const Light& light) { return light.kind == LightKind::kSun; }

/// Whether a light is a sun that is more than a point.
RELIEF_KERNEL bool light_is_sun_disk(const Light& light) { return light_is_sun(light) && light.cone > 0.0f; }

/// What on one side of a surface does not see a light: what scatters diffusely, and what microfacets make.
struct LightHides {
  bool diffuse = false, sharp = false;

  bool any() const { return diffuse || sharp; }
  /// One of the two alone: paths cannot tell which of them they follow, so that lights are asked alone.
  bool differs() const { return diffuse != sharp; }
};

/// @param transmits  the side is that behind the surface
RELIEF_KERNEL LightHides light_hides(const Light& light, bool transmits)
{
  const auto hides = [&light](PathEvent event) { return (light.hidden_from >> static_cast<int>(event) & 1u) != 0; };
  return {hides(PathEvent::kDiffuse), hides(transmits ? PathEvent::kTransmission : PathEvent::kGlossy)};
}

/// Names a light: the environment, a light of the scene, or one that an instance shares with others.
struct LightRef {
  std::int32_t light_index = -1;  ///< −1: environment
  std::int32_t copy_index = -1;   ///< −1: the light is no copy's
};

}  // namespace relief
