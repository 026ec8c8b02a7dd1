// Photons in media, and the search for those that a ray passes: the beam radiance estimate.
//
// A photon stands for light on its way through a medium: power times metres. It is spread over a disk across the ray that passes it, by
// Epanechnikov's kernel as on surfaces. So all photons along a ray count, each where the ray passes it, and no places on the ray have
// to be chosen.
//
// Photons lie in the order of a space-filling curve. Each eight of them that follow each other have a box, each eight of these boxes
// as well, and so on: a tree without pointers, which is the same however many threads make it.
//
// Source: Jarosz, Zwicker and Jensen 2008, "The Beam Radiance Estimate for Volumetric Photon Mapping" (Eq. 14), with photons that have a
// length of path in place of a collision each.
#pragma once

#include "kernel/math/lanes.h"
#include "kernel/photon/photon.h"

namespace relief {

/// Number of boxes that the nodes of a level hold.
RELIEF_KERNEL std::uint32_t photon_boxes_of_level(std::uint32_t num_photons, int level)
{
  std::uint32_t count = num_photons;
  for (int i = 0; i <= level; ++i) count = (count + kPhotonTreeWidth - 1) / kPhotonTreeWidth;
  return count;
}

/// A part of a ray as boxes ask for it.
struct PhotonRay {
  F8 O[3], inverse[3];
  F8 D[3];
  F8 length;
};

/// @param D       unit; in place of what would be infinite its inverse is 10³⁰: 0 times infinity is no place
/// @param length  metres, may be infinite
RELIEF_KERNEL PhotonRay photon_ray_make(Vec3f O, Vec3f D, float length)
{
  const auto inverse = [](float d) { return splat8(__builtin_fabsf(d) > 1e-30f ? 1.0f / d : 1e30f); };
  return {{splat8(O.x), splat8(O.y), splat8(O.z)},
          {inverse(D.x), inverse(D.y), inverse(D.z)},
          {splat8(D.x), splat8(D.y), splat8(D.z)},
          splat8(length)};
}

/// Children of a node that a part of a ray may meet.
/// @return  bit i: child i
RELIEF_KERNEL std::uint32_t photon_boxes_met(const PhotonBoxes& boxes, const PhotonRay& ray)
{
  F8 first = splat8(0.0f), last = ray.length;
  for (int axis = 0; axis < 3; ++axis) {
    const F8 a = (load8(boxes.low[axis]) - ray.O[axis]) * ray.inverse[axis];
    const F8 b = (load8(boxes.high[axis]) - ray.O[axis]) * ray.inverse[axis];
    first = max(first, min(a, b));
    last = min(last, max(a, b));
  }
  // A little more, for the rounding of what is compared.
  return mask_of(first <= last * splat8(1.0f + 1e-6f));
}

/// Visits the photons that a part of a ray passes within their radius, in an order that depends on nothing else.
/// @param O, D    world; D unit
/// @param length  metres, may be infinite
/// @param visit   of the number of a photon, the distance along the ray to where it passes it, and the squared distance of the two there
///                over the squared radius, < 1
template <typename Visit>
RELIEF_KERNEL void photons_along(const MediumPhotonsView& map, Vec3f O, Vec3f D, float length, const Visit& visit)
{
  if (map.num_levels == 0) return;
  const PhotonRay ray = photon_ray_make(O, D, length);
  std::uint32_t num_boxes[kMostPhotonLevels];
  for (int level = 0; level < map.num_levels; ++level) num_boxes[level] = photon_boxes_of_level(map.num_photons, level);
  struct Entry {
    std::int32_t level;
    std::uint32_t node;
  };
  Entry stack[kMostPhotonLevels * kPhotonTreeWidth];
  int size = 0;
  stack[size++] = {map.num_levels - 1, 0};
  while (size > 0) {
    const Entry entry = stack[--size];
    for (std::uint32_t met = photon_boxes_met(map.nodes[entry.level][entry.node], ray); met != 0; met &= met - 1) {
      const std::uint32_t child = entry.node * kPhotonTreeWidth + static_cast<std::uint32_t>(__builtin_ctz(met));
      if (child >= num_boxes[entry.level]) break;
      if (entry.level > 0) {
        stack[size++] = {entry.level - 1, child};
        continue;
      }
      const std::uint32_t begin = child * kPhotonTreeWidth;
      const F8 x = load8(map.x + begin) - ray.O[0], y = load8(map.y + begin) - ray.O[1],
               z = load8(map.z + begin) - ray.O[2];
      const F8 along = x * ray.D[0] + y * ray.D[1] + z * ray.D[2];
      const F8 dx = x - along * ray.D[0], dy = y - along * ray.D[1], dz = z - along * ray.D[2];
      const F8 squared = (dx * dx + dy * dy + dz * dz) * load8(map.inverse_radius_squared + begin);
      // Of what fills the last leaf the square is infinite, or no number.
      std::uint32_t passed = mask_of((squared < 1.0f) & (along >= 0.0f) & (along <= ray.length));
      for (; passed != 0; passed &= passed - 1) {
        const int k = __builtin_ctz(passed);
        visit(begin + static_cast<std::uint32_t>(k), along[k], squared[k]);
      }
    }
  }
}

}  // namespace relief
