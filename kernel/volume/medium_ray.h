// A part of a ray in media, and the boxes of their grids on its way.
#pragma once

#include "kernel/state/medium_state.h"
#include "kernel/volume/varying_medium.h"

namespace relief {

/// Random numbers by a count, for places of which there is no telling how many there are.
struct CountedNumbers {
  std::uint32_t state = 0;
};

RELIEF_KERNEL float counted_next(CountedNumbers& numbers)
{
  numbers.state = numbers.state * 747796405u + 2891336453u;
  return unit_float(hash_mix_32(numbers.state));
}

RELIEF_KERNEL std::int32_t medium_of_instance(const KernelGlobals& g, std::int32_t instance)
{
  return instance == kWholeWorld ? g.world_medium : g.materials[g.instances[instance].material_index].medium_index;
}

/// What an instance, or the world, is filled with that varies; null: nothing.
RELIEF_KERNEL const VaryingMedium* medium_that_varies(const KernelGlobals& g, std::int32_t instance)
{
  const VaryingMedium& medium = g.varying_media[medium_of_instance(g, instance)];
  return medium.num_closures > 0 && varying_place(medium, instance).rates.boxes != nullptr ? &medium : nullptr;
}

/// Whether one of the media that a point is in varies.
RELIEF_KERNEL bool media_vary(const KernelGlobals& g, const MediumState& m)
{
  if (g.varying_media == nullptr) return false;
  for (int i = 0; i < m.size; ++i) {
    if (medium_that_varies(g, m.inside[i]) != nullptr) return true;
  }
  return false;
}

/// The media along a part of a ray.
struct MediumRay {
  MediumRay() {}
  Vec3f O, D;
  float length = 0;  ///< metres; may be infinite
  MediaSum even;     ///< those that are even
  std::int32_t instances[kMostMedia];
  const VaryingMedium* media[kMostMedia];  ///< those that vary
  int size = 0;
};

/// Gives a ray the media that it is in; what else it is it has.
RELIEF_KERNEL void medium_ray_enter(const KernelGlobals& g, const MediumState& m, MediumRay& ray)
{
  for (int i = 0; i < m.size; ++i) {
    const VaryingMedium* varying = medium_that_varies(g, m.inside[i]);
    if (varying == nullptr) {
      media_add(ray.even, g.media[medium_of_instance(g, m.inside[i])]);
    } else {
      ray.instances[ray.size] = m.inside[i];
      ray.media[ray.size++] = varying;
    }
  }
  // What shines on an infinite way, and takes nothing away, has no radiance.
  if (!(ray.length < kInfinity) && !(max_component(ray.even.sigma_t) > 0.0f)) ray.even.emission = {};
}

/// @param D  unit
RELIEF_KERNEL MediumRay medium_ray_make(const KernelGlobals& g, const MediumState& m, Vec3f O, Vec3f D, float length)
{
  MediumRay ray;
  ray.O = O;
  ray.D = D;
  ray.length = length;
  medium_ray_enter(g, m, ray);
  return ray;
}

/// What is everywhere along a ray, beside what varies.
RELIEF_KERNEL RateBox medium_ray_even(const MediumRay& ray)
{
  const float most = max_component(ray.even.sigma_t);
  RateBox even{ray.even.sigma_t, 0.0f, most, most};
  // What only shines has to be met as well.
  if (!is_zero(ray.even.emission) && !(most > 0.0f)) even.shows = 1.0f / ray.length;
  return even;
}

RELIEF_KERNEL RateBox operator+(const RateBox& a, const RateBox& b)
{
  return {a.sigma_t + b.sigma_t, a.residual + b.residual, a.shows + b.shows, a.most + b.most};
}

/// Visits the boxes along a ray through one grid of one level. Which side of a box a ray leaves by is not to be foretold, so this does
/// not branch by it.
/// @param even  what is everywhere besides
/// @param step  see rate_boxes_visit
template <typename Step>
RELIEF_KERNEL void rate_boxes_visit_in_grid(const MediumRay& ray,
                                            const RateGrid& grid,
                                            const RateBox& even,
                                            const Step& step)
{
  using F4 [[gnu::vector_size(16)]] = float;
  using I4 [[gnu::vector_size(16)]] = std::int32_t;
  const Vec3f D = ray.D / grid.cell, O = (ray.O - rate_grid_middle(grid)) / grid.cell;
  const float half = 0.5f * static_cast<float>(grid.size), from[3] = {O.x, O.y, O.z}, to[3] = {D.x, D.y, D.z};
  float enters = 0, leaves = ray.length;
  for (int i = 0; i < 3; ++i) {
    if (to[i] == 0.0f) {
      if (!(__builtin_fabsf(from[i]) <= half)) leaves = 0;
      continue;
    }
    const float inverse = 1.0f / to[i], a = (-half - from[i]) * inverse, b = (half - from[i]) * inverse;
    enters = max(enters, min(a, b));
    leaves = min(leaves, max(a, b));
  }
  if (!(enters < leaves)) {
    step(ray.length, even);
    return;
  }
  if (enters > 0.0f && !step(enters, even)) return;
  // Where the ray gets to along each axis next, and what that changes; of lane 3 and of axes that it does not go along: never.
  F4 border{}, origin{}, inverse{}, side{};
  std::ptrdiff_t strides[3];
  border += kInfinity;
  inverse += 1.0f;
  const RateBox* box = grid.boxes;
  std::ptrdiff_t stride = 1;
  for (int i = 0; i < 3; ++i, stride *= grid.size) {
    const int n = static_cast<int>(clamp(from[i] + to[i] * enters + half, 0.0f, 2.0f * half - 1.0f));
    const bool up = to[i] > 0.0f;
    box += stride * n;
    strides[i] = up ? stride : -stride;
    if (to[i] == 0.0f) continue;
    border[i] = static_cast<float>(up ? n + 1 : n) - half;
    origin[i] = from[i];
    inverse[i] = 1.0f / to[i];
    side[i] = up ? 1.0f : -1.0f;
  }
  std::ptrdiff_t moves[8];
  for (int i = 0; i < 8; ++i) {
    moves[i] = (i & 1 ? strides[0] : 0) + (i & 2 ? strides[1] : 0) + (i & 4 ? strides[2] : 0);
  }
  for (float t = enters;;) {
    // The same sum as that by which it leaves the grid: no box is beyond.
    const F4 next = (border - origin) * inverse;
    const float end = min(min(next[0], next[1]), next[2]);
    const float until = min(end, leaves);
    if (until > t) {
      if (!step(until, *box + even)) return;
      t = until;
    }
    if (!(end < leaves)) break;
    const I4 crosses = next == F4{} + end;
    border += __builtin_bit_cast(F4, __builtin_bit_cast(I4, side) & crosses);
    box += moves[_mm_movemask_ps(__builtin_bit_cast(__m128, crosses)) & 7];
  }
  if (leaves < ray.length) step(ray.length, even);
}

/// Visits what media are known to be along a ray, box by box.
/// @param step  (metres along the ray, the box up to there) -> whether to go on
template <typename Step>
RELIEF_KERNEL void rate_boxes_visit(const MediumRay& ray, const Step& step)
{
  const RateBox even = medium_ray_even(ray);
  if (ray.size == 1) {
    const RateGrid& grid = varying_place(*ray.media[0], ray.instances[0]).rates;
    if (grid.num_levels == 1) return rate_boxes_visit_in_grid(ray, grid, even, step);
  }
  struct Ways {
    Ways() {}
    union {
      RateWay of[kMostMedia];
    };
  } ways;
  for (int i = 0; i < ray.size; ++i) {
    ways.of[i] = rate_way_make(varying_place(*ray.media[i], ray.instances[i]).rates, ray.O, ray.D);
  }
  for (float t = 0; t < ray.length;) {
    float end = ray.length;
    RateBox box = even;
    for (int i = 0; i < ray.size; ++i) {
      const RateWay& way = ways.of[i];
      end = min(end, way.end);
      if (way.box != nullptr) box = box + *way.box;
    }
    if (end > t && !step(end, box)) return;
    t = end;
    for (int i = 0; i < ray.size; ++i) {
      if (!(ways.of[i].end > t)) rate_way_go(ways.of[i]);
    }
  }
}

}  // namespace relief
