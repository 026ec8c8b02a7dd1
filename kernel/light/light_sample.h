// What a kind of light is: a type in a file of its own, with these functions, and a line in light_kinds.inc. Functions of
// light_kinds.h ask those of a light's kind. A kind is of one of three forms, whose types it derives from, and need not
// say again what its form has said: BallLight (point.h), FlatLight and PlateLight (flat.h), FarLight (sun.h).
//
//   of all               light_sample      light that arrives at a point, from a direction chosen by chance
//                        light_pdf         how likely that direction was
//                        light_bounds      what the light tree needs to know (light_bounds.h)
//                        kBody             what of it rays can meet
//   of balls             light_falloff     part of the intensity that leaves under an angle
//   of flat ones         light_coordinates a place on it, uniform by area
//   all but of meshes    light_emit        some point of it and a direction from there
//                        light_place       where a value graph sees it shine
//                        light_uv          the texture coordinates there
//   that have a body     light_emitted     what it sends against a ray that meets it
//   bodies of their own  light_half_extent half the box around it
//                        light_distance    where a ray meets it
//                        light_is_met      whether it has a size
//                        kIsQuad           whether it is a parallelogram, which is known to Embree
#pragma once

#include "kernel/light/light.h"
#include "kernel/light/light_bounds.h"
#include "kernel/math/trigonometry.h"
#include "kernel/sample/warp.h"

namespace relief {

/// Light arriving at a point from one sampled direction. `pdf` 0: no sample (nothing arrives, or degenerate geometry).
struct LightSample {
  Vec3f wi{};          ///< unit, from the point to the light
  float distance = 0;  ///< metres; kInfinity for sun and environment
  Vec3f radiance{};    ///< incident, before visibility; delta kinds: times the solid angle, which is all there
                       ///< is to sample: intensity / distance², or irradiance
  float pdf = 0;       ///< solid angle × probability of the choice; delta kinds: probability of the choice alone
  bool delta = false;
  LightRef ref{};       ///< whose
  Vec2f barycentric{};  ///< triangle: weights of vertices 1 and 2
};

/// What of a kind of light rays can meet.
enum class LightBody : std::uint8_t {
  kNone,  ///< nothing, or what only rays meet that meet nothing else
  kOwn,   ///< a shape that shines and lets rays pass, if it has a size
  kMesh,  ///< the mesh that the light is part of
};

/// A place where a value graph sees a lamp shine.
struct LightPlace {
  Vec3f P{};  ///< world; of suns, the direction from which they shine
  Vec3f N{};  ///< unit
};

/// Some point of a lamp and a direction from there, and for how much light it stands beside others.
struct LightRay {
  Vec3f P{};   ///< world; of suns any
  Vec3f wo{};  ///< unit, from the lamp
  float weight = 1;
};

}  // namespace relief
