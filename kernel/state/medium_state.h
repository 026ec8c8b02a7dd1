// What a path keeps of the media that it travels in.
#pragma once

#include <cstdint>

#include "kernel/math/vec.h"

namespace relief {

/// Media that a point is in at most; of more the last ones that are entered do not count.
inline constexpr int kMostMedia = 8;

/// In place of an instance: the medium that fills all space.
inline constexpr std::int32_t kWholeWorld = -1;

/// Boundaries that a path passes at most, as in Cycles: rounding may leave one between two.
inline constexpr std::uint32_t kMostBoundaries = 1024;

struct MediumState {
  std::int32_t inside
      [kMostMedia];  ///< instances that the ray starts in, or kWholeWorld; in the order in which they were entered
  std::int32_t size;
  std::uint32_t bounces;     ///< scattering events in media
  std::uint32_t boundaries;  ///< passed so far
  std::uint32_t stretches;   ///< of rays in media so far
  std::int32_t hit_inside;   ///< instance whose medium begins or ends at the present hit; kWholeWorld: none
  bool hit_front;            ///< the hit is on the outside
  Vec3f hit_P, hit_Ng;       ///< of such a hit, world; the geometric normal is on the ray's side, and not unit
  bool is_lit_first;         ///< the first event of the path was in a medium
  bool sky_is_asked;         ///< and the environment was asked for there in the path's place
  Vec3f before[2];           ///< if so, the path's direct and indirect light before it
  Vec3f lit;                 ///< else, light that was asked for in media before the first event
  Vec3f caustic;             ///< and what photons brought there
};

/// Enters or leaves what an instance bounds. Entered once more, or left without having been entered, nothing changes.
RELIEF_KERNEL void medium_cross(MediumState& m, std::int32_t instance, bool enters)
{
  int place = 0;
  while (place < m.size && m.inside[place] != instance) ++place;
  if (enters) {
    if (place == m.size && m.size < kMostMedia) m.inside[m.size++] = instance;
    return;
  }
  if (place == m.size) return;
  for (int i = place + 1; i < m.size; ++i) m.inside[i - 1] = m.inside[i];
  --m.size;
}

/// What media scattered to the camera, of a path's direct and indirect light, and of what photons brought it.
struct MediumLight {
  Vec3f direct, indirect;
};

RELIEF_KERNEL MediumLight medium_light(const MediumState& m, Vec3f direct, Vec3f indirect, Vec3f caustic)
{
  if (!m.is_lit_first) return {m.lit, m.caustic};
  return {m.lit + direct - m.before[0], indirect - m.before[1] + caustic};
}

/// Leaves all that has bounds: what a ray that meets nothing is still in was not closed.
RELIEF_KERNEL void medium_leave_all(MediumState& m) { m.size = m.size > 0 && m.inside[0] == kWholeWorld ? 1 : 0; }

/// Whether a ray that starts at a path's hit starts behind it.
/// @pre hit_inside is an instance
RELIEF_KERNEL bool medium_is_behind(const MediumState& m, Vec3f O) { return dot(O - m.hit_P, m.hit_Ng) < 0.0f; }

}  // namespace relief
