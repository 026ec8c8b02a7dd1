// Cell noise in 1 to 4 dimensions, eight points at a time: a random point in each cell of a lattice, and what is near of them.
// The numbers are those of Blender's Voronoi Texture.
//
// Worley 1996, "A Cellular Texture Basis Function". Quilez 2012, "Voronoi edges": the distance to borders.
#pragma once

#include <cmath>

#include "kernel/graph/noise.h"

namespace relief {

enum class VoronoiFeature : std::uint16_t { kF1, kF2, kSmoothF1, kDistanceToEdge, kSphereRadius };
enum class VoronoiMetric : std::uint16_t { kEuclidean, kManhattan, kChebychev, kMinkowski };

enum VoronoiFlags : std::uint16_t {
  kVoronoiFar = 1u << 0,        ///< cells count however far they are (4.0 on), not to a distance of 8
  kVoronoiPcg = 1u << 1,        ///< the cells of 5.0 on
  kVoronoiNormalize = 1u << 2,  ///< distances and colours in 0…1
  kVoronoiBare = 1u << 3,       ///< nobody asks for colours and positions; set by the compiler of graphs
};

/// @tparam kPcg  the cells of 5.0 on; a parameter, as a choice in the innermost loop costs a third more
template <int kDims, bool kPcg = false>
struct VoronoiSettings {
  VoronoiFeature feature;
  VoronoiMetric metric;
  F8 smoothness;  ///< (0, ½]
  F8 exponent;    ///< of Minkowski's metric
  F8 randomness;  ///< [0, 1]: of the points in their cells
  unsigned flags = 0;

  F8 far() const { return splat8((flags & kVoronoiFar) != 0 ? 3.402823466e38f : 8.0f); }
};

template <int kDims>
struct Voronoi {
  F8 distance{};         ///< or radius
  F8 color[3]{};         ///< random colour of the cell
  F8 position[kDims]{};  ///< of its point
};

/// Numbers in [0, 1] of whole ones, as many.
/// @source Jarzynski and Olano 2020, "Hash Functions for GPU Rendering": pcg2d, pcg3d, pcg4d, with a signed shift
template <int kCount>
RELIEF_KERNEL void hash_pcg(const F8 (&key)[kCount], F8 (&unit)[kCount])
{
  W8 v[kCount];
  for (int i = 0; i < kCount; ++i) {
    const F8 bounded = clamp(key[i], -2147483648.0f, 2147483520.0f);
    v[i] = __builtin_bit_cast(W8, __builtin_convertvector(bounded, I8)) * 1664525u + 1013904223u;
  }
  const auto stir = [&v] {
    if constexpr (kCount == 2) {
      v[0] += v[1] * 1664525u;
      v[1] += v[0] * 1664525u;
    } else {
      v[0] += v[1] * v[kCount - 1];
      v[1] += v[2] * v[0];
      v[2] += v[0] * v[1];
      if constexpr (kCount == 4) v[3] += v[1] * v[2];
    }
  };
  stir();
  for (W8& x : v) x ^= __builtin_bit_cast(W8, __builtin_bit_cast(I8, x) >> 16);
  stir();
  for (int i = 0; i < kCount; ++i) {
    unit[i] = __builtin_convertvector(__builtin_bit_cast(I8, v[i] & 0x7fffffffu), F8) / 2147483648.0f;
  }
}

// What is done for each cell is inlined by force: the cells of 5.0 on are a second caller, and calls cost a third.

/// The point of a cell, [0, 1] along each axis.
/// @param cell  its lower corner
template <int kDims, bool kPcg>
[[gnu::always_inline]] RELIEF_KERNEL void voronoi_point(const F8 (&cell)[kDims], F8 (&point)[kDims])
{
  if constexpr (kPcg && kDims > 1) {
    hash_pcg<kDims>(cell, point);
  } else if constexpr (kDims == 1) {
    point[0] = hash_unit(cell);
  } else if constexpr (kDims == 4) {
    const F8 x = cell[0], y = cell[1], z = cell[2], w = cell[3];
    point[0] = hash_unit({x, y, z, w});
    point[1] = hash_unit({w, x, y, z});
    point[2] = hash_unit({z, w, x, y});
    point[3] = hash_unit({y, z, w, x});
  } else {
    point[0] = hash_unit(cell);
    for (int i = 1; i < kDims; ++i) {
      F8 key[kDims + 1];
      for (int k = 0; k < kDims; ++k) key[k] = cell[k];
      key[kDims] = splat8(static_cast<float>(i));
      point[i] = hash_unit(key);
    }
  }
}

/// The colour of a cell.
template <int kDims, bool kPcg>
RELIEF_KERNEL void voronoi_color(const F8 (&cell)[kDims], F8 (&color)[3])
{
  if constexpr (kPcg && kDims > 1) {
    constexpr int kCount = kDims == 4 ? 4 : 3;
    F8 key[kCount]{}, unit[kCount];
    for (int i = 0; i < kDims; ++i) key[i] = cell[i];
    hash_pcg<kCount>(key, unit);
    for (int i = 0; i < 3; ++i) color[i] = unit[i];
    return;
  }
  color[0] = hash_unit(cell);
  if constexpr (kDims == 4) {
    const F8 x = cell[0], y = cell[1], z = cell[2], w = cell[3];
    color[1] = hash_unit({z, x, w, y});
    color[2] = hash_unit({w, z, y, x});
  } else {
    for (int i = 1; i < 3; ++i) {
      F8 key[kDims + 1];
      for (int k = 0; k < kDims; ++k) key[k] = cell[k];
      key[kDims] = splat8(static_cast<float>(i));
      color[i] = hash_unit(key);
    }
  }
}

template <int kDims, bool kPcg>
[[gnu::always_inline]] RELIEF_KERNEL F8 voronoi_distance(const F8 (&a)[kDims],
                                                         const F8 (&b)[kDims],
                                                         const VoronoiSettings<kDims, kPcg>& settings)
{
  F8 sum{};
  if (kDims == 1) return abs(a[0] - b[0]);
  switch (settings.metric) {
    case VoronoiMetric::kEuclidean:
      for (int i = 0; i < kDims; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
      return sqrt(sum);
    case VoronoiMetric::kManhattan:
      for (int i = 0; i < kDims; ++i) sum += abs(a[i] - b[i]);
      return sum;
    case VoronoiMetric::kChebychev:
      for (int i = 0; i < kDims; ++i) sum = max(sum, abs(a[i] - b[i]));
      return sum;
    case VoronoiMetric::kMinkowski:
      break;
  }
  for (int lane = 0; lane < 8; ++lane) {
    const float exponent = settings.exponent[lane];
    float of_lane = 0.0f;
    for (int i = 0; i < kDims; ++i) of_lane += std::pow(__builtin_fabsf(a[i][lane] - b[i][lane]), exponent);
    sum[lane] = std::pow(of_lane, 1.0f / exponent);
  }
  return sum;
}

/// Calls visit(offset, point) for all cells up to `reach` away: the offset of a cell and its point from the corner of the
/// middle one. The first axis moves fastest.
/// @param is_left_out  (offset) -> whether a cell is
template <int kDims, bool kPcg, typename F, typename IsLeftOut>
[[gnu::always_inline]] RELIEF_KERNEL void voronoi_cells(const F8 (&cell)[kDims],
                                                        const VoronoiSettings<kDims, kPcg>& settings,
                                                        int reach,
                                                        F&& visit,
                                                        const IsLeftOut& is_left_out)
{
  const int side = 2 * reach + 1;
  int count = 1;
  for (int i = 0; i < kDims; ++i) count *= side;
  for (int n = 0; n < count; ++n) {
    F8 offset[kDims], corner[kDims], point[kDims];
    for (int i = 0, rest = n; i < kDims; ++i, rest /= side) {
      offset[i] = splat8(static_cast<float>(rest % side - reach));
      corner[i] = cell[i] + offset[i];
    }
    if (is_left_out(offset)) continue;
    voronoi_point<kDims, kPcg>(corner, point);
    for (int i = 0; i < kDims; ++i) point[i] = offset[i] + point[i] * settings.randomness;
    visit(offset, point);
  }
}

template <int kDims, bool kPcg, typename F>
[[gnu::always_inline]] RELIEF_KERNEL void voronoi_cells(const F8 (&cell)[kDims],
                                                        const VoronoiSettings<kDims, kPcg>& settings,
                                                        int reach,
                                                        F&& visit)
{
  voronoi_cells<kDims>(cell, settings, reach, visit, [](const F8(&)[kDims]) { return false; });
}

template <int kDims>
RELIEF_KERNEL void assign_where(I8 is, F8 (&to)[kDims], const F8 (&from)[kDims])
{
  for (int i = 0; i < kDims; ++i) to[i] = is ? from[i] : to[i];
}

/// The nearest point, or the second, and its cell.
template <bool kSecond, int kDims, bool kPcg>
RELIEF_KERNEL Voronoi<kDims> voronoi_nearest(const F8 (&cell)[kDims],
                                             const F8 (&local)[kDims],
                                             const VoronoiSettings<kDims, kPcg>& settings)
{
  // Roots are compared, not squares: of two points whose roots round to the same number the first counts, as in Cycles.
  F8 first = settings.far(), second = settings.far();
  F8 offset1[kDims]{}, offset2[kDims]{}, point1[kDims]{}, point2[kDims]{};
  voronoi_cells<kDims>(cell, settings, 1, [&](const F8(&offset)[kDims], const F8(&point)[kDims]) {
    const F8 distance = voronoi_distance<kDims>(point, local, settings);
    const I8 is_first = distance < first;
    if constexpr (kSecond) {
      const I8 is_second = ~is_first & (distance < second);
      second = is_first ? first : is_second ? distance : second;
      assign_where(is_first, offset2, offset1);
      assign_where(is_first, point2, point1);
      assign_where(is_second, offset2, offset);
      assign_where(is_second, point2, point);
    }
    first = is_first ? distance : first;
    assign_where(is_first, offset1, offset);
    assign_where(is_first, point1, point);
  });
  Voronoi<kDims> out;
  out.distance = kSecond ? second : first;
  F8 at[kDims];
  for (int i = 0; i < kDims; ++i) {
    at[i] = cell[i] + (kSecond ? offset2[i] : offset1[i]);
    out.position[i] = (kSecond ? point2[i] : point1[i]) + cell[i];
  }
  voronoi_color<kDims, kPcg>(at, out.color);
  return out;
}

/// Whether a cell's point is too far at all eight points to change a distance that smoothing reaches so far.
/// @param gaps  along each axis, of the offsets from −2 on: how far the cell is away at least
/// @param far   no distance of a point beyond counts
template <int kDims, bool kPcg>
RELIEF_KERNEL bool voronoi_is_far(const F8 (&gaps)[kDims][5],
                                  const F8 (&offset)[kDims],
                                  F8 far,
                                  const VoronoiSettings<kDims, kPcg>& settings)
{
  if (settings.metric == VoronoiMetric::kMinkowski) return false;  // as slow as to find the point
  F8 gap[kDims], none[kDims]{};
  for (int i = 0; i < kDims; ++i) gap[i] = gaps[i][static_cast<int>(offset[i][0]) + 2];
  // Less than what rounding changes of numbers up to 8.
  constexpr float kRounding = 1e-5f;
  return mask_of(voronoi_distance<kDims>(gap, none, settings) > far + kRounding) == 0xffu;
}

/// All points near, the nearer the more.
template <int kDims, bool kPcg>
RELIEF_KERNEL Voronoi<kDims> voronoi_smooth(const F8 (&cell)[kDims],
                                            const F8 (&local)[kDims],
                                            const VoronoiSettings<kDims, kPcg>& settings)
{
  Voronoi<kDims> out;
  // Where no distance is too far, the first cell counts whole.
  const bool counts_first = (settings.flags & kVoronoiFar) != 0;
  F8 least = splat8(counts_first ? 1.0f : 0.0f);
  out.distance = splat8(counts_first ? 0.0f : 8.0f);
  const F8 smoothness = settings.smoothness;
  const bool is_bare = (settings.flags & kVoronoiBare) != 0;
  F8 gaps[kDims][5];
  for (int i = 0; i < kDims; ++i) {
    for (int n = 0; n < 5; ++n) {
      const F8 low = splat8(static_cast<float>(n - 2));
      gaps[i][n] = max(max(low - local[i], local[i] - (low + settings.randomness)), F8{});
    }
  }
  // What is farther has no share at all, not even of a rounding. The first may count whole.
  bool is_first = counts_first;
  const auto is_far = [&](const F8(&offset)[kDims]) {
    return !is_first && voronoi_is_far<kDims>(gaps, offset, out.distance + smoothness, settings);
  };
  const auto blend = [&](const F8(&offset)[kDims], const F8(&point)[kDims]) {
    is_first = false;
    const F8 distance = voronoi_distance<kDims>(point, local, settings);
    const F8 t = max(clamp(0.5f + 0.5f * (out.distance - distance) / smoothness, 0.0f, 1.0f), least);
    const F8 h = t * t * (3.0f - 2.0f * t);
    least = F8{};
    F8 correction = smoothness * h * (1.0f - h);
    out.distance = (out.distance + h * (distance - out.distance)) - correction;
    if (is_bare) return;
    correction /= 1.0f + 3.0f * smoothness;
    F8 corner[kDims], color[3];
    for (int i = 0; i < kDims; ++i) corner[i] = cell[i] + offset[i];
    voronoi_color<kDims, kPcg>(corner, color);
    for (int i = 0; i < 3; ++i) out.color[i] = (out.color[i] + h * (color[i] - out.color[i])) - correction;
    for (int i = 0; i < kDims; ++i) out.position[i] = (out.position[i] + h * (point[i] - out.position[i])) - correction;
  };
  voronoi_cells<kDims>(cell, settings, 2, blend, is_far);
  for (int i = 0; i < kDims; ++i) out.position[i] += cell[i];
  return out;
}

/// Points whose squared distance is no more than this are one when it comes to borders.
inline constexpr float kVoronoiTwins = 1e-4f;

/// Distance to the nearest border between two cells.
template <int kDims, bool kPcg>
RELIEF_KERNEL F8 voronoi_edge(const F8 (&cell)[kDims],
                              const F8 (&local)[kDims],
                              const VoronoiSettings<kDims, kPcg>& settings)
{
  F8 nearest = settings.far();
  F8 to_nearest[kDims]{};
  const auto squared = [](const F8(&v)[kDims]) {
    F8 sum{};
    for (int i = 0; i < kDims; ++i) sum += v[i] * v[i];
    return sum;
  };
  voronoi_cells<kDims>(cell, settings, 1, [&](const F8(&)[kDims], const F8(&point)[kDims]) {
    F8 to_point[kDims];
    for (int i = 0; i < kDims; ++i) to_point[i] = point[i] - local[i];
    const F8 distance = squared(to_point);
    const I8 is_nearer = distance < nearest;
    nearest = is_nearer ? distance : nearest;
    assign_where(is_nearer, to_nearest, to_point);
  });
  F8 edge = settings.far();
  voronoi_cells<kDims>(cell, settings, 1, [&](const F8(&)[kDims], const F8(&point)[kDims]) {
    F8 across[kDims], middle[kDims];
    for (int i = 0; i < kDims; ++i) {
      const F8 to_point = point[i] - local[i];
      across[i] = to_point - to_nearest[i];
      middle[i] = 0.5f * (to_nearest[i] + to_point);
    }
    const F8 length_squared = squared(across);
    F8 distance{};
    for (int i = 0; i < kDims; ++i) distance += middle[i] * across[i];
    distance /= sqrt(length_squared);
    edge = length_squared > kVoronoiTwins ? min(edge, distance) : edge;
  });
  return edge;
}

/// Half the distance from the nearest point to the point nearest to that.
template <int kDims, bool kPcg>
RELIEF_KERNEL F8 voronoi_radius(const F8 (&cell)[kDims],
                                const F8 (&local)[kDims],
                                const VoronoiSettings<kDims, kPcg>& settings)
{
  const auto distance_of = [](const F8(&a)[kDims], const F8(&b)[kDims]) {
    F8 sum{};
    for (int i = 0; i < kDims; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum);
  };
  F8 nearest = settings.far();
  F8 own_offset[kDims]{}, own_point[kDims]{};
  voronoi_cells<kDims>(cell, settings, 1, [&](const F8(&offset)[kDims], const F8(&point)[kDims]) {
    const F8 distance = distance_of(point, local);
    const I8 is_nearer = distance < nearest;
    nearest = is_nearer ? distance : nearest;
    assign_where(is_nearer, own_offset, offset);
    assign_where(is_nearer, own_point, point);
  });
  // Offsets of cells are whole numbers, which are exact; sums with a cell far away are not, so there is one alone.
  F8 radius = settings.far();
  int count = 1;
  for (int i = 0; i < kDims; ++i) count *= 3;
  for (int n = 0; n < count; ++n) {
    F8 offset[kDims], corner[kDims], point[kDims];
    for (int i = 0, rest = n; i < kDims; ++i, rest /= 3) {
      offset[i] = own_offset[i] + static_cast<float>(rest % 3 - 1);
      corner[i] = cell[i] + offset[i];
    }
    if (n == count / 2) continue;  // its own
    voronoi_point<kDims, kPcg>(corner, point);
    for (int i = 0; i < kDims; ++i) point[i] = offset[i] + point[i] * settings.randomness;
    radius = min(radius, distance_of(point, own_point));
  }
  return 0.5f * radius;
}

/// @param p  any floats
template <int kDims, bool kPcg>
RELIEF_KERNEL Voronoi<kDims> voronoi_eval(const F8 (&p)[kDims], const VoronoiSettings<kDims, kPcg>& settings)
{
  F8 cell[kDims], local[kDims];
  for (int i = 0; i < kDims; ++i) {
    cell[i] = floor(p[i]);
    const F8 rest = p[i] - cell[i];
    local[i] = rest == rest ? rest : F8{};  // of infinity there is none
  }
  Voronoi<kDims> out;
  switch (settings.feature) {
    case VoronoiFeature::kF1:
      return voronoi_nearest<false, kDims>(cell, local, settings);
    case VoronoiFeature::kF2:
      return voronoi_nearest<true, kDims>(cell, local, settings);
    case VoronoiFeature::kSmoothF1:
      return voronoi_smooth<kDims>(cell, local, settings);
    case VoronoiFeature::kDistanceToEdge:
      out.distance = voronoi_edge<kDims>(cell, local, settings);
      break;
    case VoronoiFeature::kSphereRadius:
      out.distance = voronoi_radius<kDims>(cell, local, settings);
      break;
  }
  return out;
}

RELIEF_KERNEL F8 mixed(F8 a, F8 b, F8 t) { return a + t * (b - a); }

/// Octaves of cells, each finer than the one before: sums of distances and colours, mixes of positions; the least distance
/// to a border.
template <int kDims, bool kPcg>
RELIEF_KERNEL Voronoi<kDims> voronoi_fractal(const F8 (&p)[kDims],
                                             const VoronoiSettings<kDims, kPcg>& settings,
                                             const NoiseOctaves& octaves)
{
  const bool is_edge = settings.feature == VoronoiFeature::kDistanceToEdge;
  const bool is_radius = settings.feature == VoronoiFeature::kSphereRadius;
  const F8 detail = octaves.roughness == 0.0f || is_radius ? F8{} : octaves.detail;
  const I8 is_single = detail == 0.0f;
  const F8 rest = detail - floor(detail), last_octave = -floor(-detail);
  float last = 0.0f;
  for (int k = 0; k < 8; ++k) last = last_octave[k] > last ? last_octave[k] : last;
  F8 corner[kDims], origin[kDims]{};
  for (F8& x : corner) x = 0.5f + 0.5f * settings.randomness;
  F8 most = is_edge ? corner[0] : voronoi_distance<kDims>(origin, corner, settings);
  if (settings.feature == VoronoiFeature::kF2) most *= 2.0f;
  F8 amplitude = splat8(1.0f), scale = splat8(1.0f), size = is_edge ? most : F8{};
  Voronoi<kDims> sum;
  if (is_edge) sum.distance = splat8(8.0f);
  for (int n = 0; n <= static_cast<int>(last); ++n) {
    F8 scaled[kDims];
    for (int i = 0; i < kDims; ++i) scaled[i] = p[i] * scale;
    Voronoi<kDims> octave = voronoi_eval<kDims>(scaled, settings);
    const F8 number = splat8(static_cast<float>(n));
    const I8 is_whole = number <= detail, is_there = number <= last_octave;
    const F8 share = is_whole ? splat8(1.0f) : is_there ? rest : F8{};
    if (is_edge) {
      const F8 distance = mixed(sum.distance, min(sum.distance, octave.distance / scale), amplitude);
      const F8 mixed_distance = is_whole ? distance : mixed(sum.distance, min(sum.distance, distance), share);
      const F8 mixed_size = mixed(size, mixed(size, most / scale, amplitude), share);
      sum.distance = is_single ? (n == 0 ? octave.distance : sum.distance) : is_there ? mixed_distance : sum.distance;
      size = is_single | ~is_there ? size : mixed_size;
    } else {
      sum.distance += share * octave.distance * amplitude;
      for (int c = 0; c < 3; ++c) sum.color[c] += share * octave.color[c] * amplitude;
      for (int i = 0; i < kDims; ++i) {
        const F8 position = mixed(sum.position[i], octave.position[i] / scale, amplitude);
        // Of octaves that other points have, scales may be 0.
        sum.position[i] = is_whole ? position : is_there ? mixed(sum.position[i], position, share) : sum.position[i];
      }
      size += share * amplitude;
    }
    amplitude = is_whole ? amplitude * octaves.roughness : amplitude;
    scale = is_whole ? scale * octaves.lacunarity : scale;
  }
  if ((settings.flags & kVoronoiNormalize) != 0 && !is_radius) {
    sum.distance /= is_edge ? size : size * most;
    for (F8& c : sum.color) c /= size;
  }
  return sum;
}

}  // namespace relief
