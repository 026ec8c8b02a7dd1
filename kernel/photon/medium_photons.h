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

#include "kernel/photon/photon.h"

namespace relief {

/// Number of boxes that the nodes of a level hold.
RELIEF_KERNEL std::uint32_t photon_boxes_of_level(std::uint32_t num_photons, int level)
{
  std::uint32_t count = num_photons;
  for (int i = 0; i <= level; ++i) count = (count + kPhotonTreeWidth - 1) / kPhotonTreeWidth;
  return count;
}

/// Axis by axis a ray's inverse direction, and 10³⁰ in place of what would be infinite: 0 times infinity is no place.
RELIEF_KERNEL Vec3f photon_ray_inverse(Vec3f D)
{
  const auto axis = [](float d) { return __builtin_fabsf(d) > 1e-30f ? 1.0f / d : 1e30f; };
  return {axis(D.x), axis(D.y), axis(D.z)};
}

/// Children of a node that a part of a ray may meet.
/// @return  bit i: child i
RELIEF_KERNEL std::uint32_t photon_boxes_met(const PhotonBoxes& boxes, Vec3f O, Vec3f inverse, float length)
{
  const float o[3] = {O.x, O.y, O.z}, inv[3] = {inverse.x, inverse.y, inverse.z};
  float first[kPhotonTreeWidth], last[kPhotonTreeWidth];
  for (int i = 0; i < kPhotonTreeWidth; ++i) {
    first[i] = 0.0f;
    last[i] = length;
  }
  for (int axis = 0; axis < 3; ++axis) {
    for (int i = 0; i < kPhotonTreeWidth; ++i) {
      const float a = (boxes.low[axis][i] - o[axis]) * inv[axis], b = (boxes.high[axis][i] - o[axis]) * inv[axis];
      first[i] = max(first[i], min(a, b));
      last[i] = min(last[i], max(a, b));
    }
  }
  std::uint32_t met = 0;
  // A little more, for the rounding of what is compared.
  for (int i = 0; i < kPhotonTreeWidth; ++i) met |= (first[i] <= last[i] * (1.0f + 1e-6f) ? 1u : 0u) << i;
  return met;
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
  const Vec3f inverse = photon_ray_inverse(D);
  struct Entry {
    std::int32_t level;
    std::uint32_t node;
  };
  Entry stack[kMostPhotonLevels * kPhotonTreeWidth];
  int size = 0;
  stack[size++] = {map.num_levels - 1, 0};
  while (size > 0) {
    const Entry entry = stack[--size];
    std::uint32_t met = photon_boxes_met(map.nodes[entry.level][entry.node], O, inverse, length);
    const std::uint32_t num_boxes = photon_boxes_of_level(map.num_photons, entry.level);
    for (; met != 0; met &= met - 1) {
      const std::uint32_t child = entry.node * kPhotonTreeWidth + static_cast<std::uint32_t>(__builtin_ctz(met));
      if (child >= num_boxes) break;
      if (entry.level > 0) {
        stack[size++] = {entry.level - 1, child};
        continue;
      }
      const std::uint32_t begin = child * kPhotonTreeWidth;
      const std::uint32_t left = map.num_photons - begin, count = left < kPhotonTreeWidth ? left : kPhotonTreeWidth;
      float along[kPhotonTreeWidth], squared[kPhotonTreeWidth];
      for (std::uint32_t k = 0; k < kPhotonTreeWidth; ++k) {
        const std::uint32_t i = begin + (k < count ? k : count - 1);
        const float x = map.x[i] - O.x, y = map.y[i] - O.y, z = map.z[i] - O.z;
        along[k] = x * D.x + y * D.y + z * D.z;
        squared[k] = (sqr(x - along[k] * D.x) + sqr(y - along[k] * D.y) + sqr(z - along[k] * D.z)) *
                     map.inverse_radius_squared[i];
      }
      for (std::uint32_t k = 0; k < count; ++k) {
        if (squared[k] < 1.0f && along[k] >= 0.0f && along[k] <= length) visit(begin + k, along[k], squared[k]);
      }
    }
  }
}

}  // namespace relief
