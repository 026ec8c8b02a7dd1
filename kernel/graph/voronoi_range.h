// Bounds of Worley's cells over small parallelograms.
//
// A distance to points changes by no more than the way that is gone, as long as the points that count are the same: those
// around one cell of the lattice. From one cell to the next they change, but only farther away than a cell. So does the
// distance to the nearest border, unless the nearest of two points that count as one changes.
#pragma once

#include "kernel/graph/graph_range.h"
#include "kernel/graph/voronoi.h"

namespace relief {

/// What distances to borders are off by: differences of points a hundredth apart, each off by 2⁻²³, divide sums of size 2.
inline constexpr float kVoronoiEdgeRounding = 2e-4f;

/// Where two points that voronoi_edge takes for one may both be the nearest: the borders around them are then others on
/// either side of the line between them.
/// @param cell, local  as voronoi_edge's
/// @param way          how far from there, at most
template <int kDims, bool kPcg>
RELIEF_KERNEL I8 voronoi_has_twins(const F8 (&cell)[kDims],
                                   const F8 (&local)[kDims],
                                   F8 way,
                                   const VoronoiSettings<kDims, kPcg>& settings)
{
  constexpr int kPoints = kDims == 1 ? 3 : kDims == 2 ? 9 : kDims == 3 ? 27 : 81;
  const auto squared_apart = [](const F8(&a)[kDims], const F8(&b)[kDims]) {
    F8 sum{};
    for (int i = 0; i < kDims; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sum;
  };
  F8 points[kPoints][kDims], distances[kPoints], nearest = splat8(kInfinity);
  int count = 0;
  voronoi_cells<kDims>(cell, settings, 1, [&](const F8(&)[kDims], const F8(&point)[kDims]) {
    for (int i = 0; i < kDims; ++i) points[count][i] = point[i];
    distances[count] = sqrt(squared_apart(point, local));
    nearest = min(nearest, distances[count++]);
  });
  // Rounding of differences changes their squares by less than a hundredth part.
  constexpr float kMostApart = 1.01f * kVoronoiTwins;
  const F8 reach = nearest + 2.0f * way + 1e-5f;
  I8 has_twins{};
  for (int a = 1; a < kPoints; ++a) {
    const I8 may_be_nearest = distances[a] <= reach;
    if (mask_of(may_be_nearest) == 0) continue;
    for (int b = 0; b < a; ++b) {
      has_twins |= may_be_nearest & (distances[b] <= reach) & (squared_apart(points[a], points[b]) <= kMostApart);
    }
  }
  return has_twins;
}

/// Distance of one octave; unknown where the points that count may change.
/// @param settings  the same all over
template <int kDims, bool kPcg>
RELIEF_KERNEL GraphRange voronoi_distance_range(const GraphRange (&p)[kDims],
                                                const VoronoiSettings<kDims, kPcg>& settings)
{
  // Radii jump from cell to cell; what is mixed smoothly has no slope that is known.
  if (settings.feature == VoronoiFeature::kSphereRadius || settings.feature == VoronoiFeature::kSmoothF1)
    return range_unknown();
  constexpr float kMostNear = 90000.0f;
  // A tall sum of small ways for Minkowski's metric, whose exponents below 1 are no metric.
  const bool is_sum = settings.metric == VoronoiMetric::kManhattan || settings.metric == VoronoiMetric::kMinkowski;
  F8 c[kDims], way{}, squares{}, largest{}, ones[kDims], zeros[kDims]{};
  I8 is_near = splat8(0.0f) == 0.0f, in_cell = is_near;
  for (int i = 0; i < kDims; ++i) {
    const F8 radius = range_radius(p[i]) + 4.0f * kRangeRounding * abs(p[i].c);
    is_near &= abs(p[i].c) + radius <= kMostNear;
    in_cell &= floor(p[i].c - radius) == floor(p[i].c + radius);
    way += radius;
    squares += radius * radius;
    largest = max(largest, radius);
    ones[i] = splat8(1.0f);
  }
  is_near &= way <= 1.0f;
  const bool is_edge = settings.feature == VoronoiFeature::kDistanceToEdge;
  const bool is_euclidean = settings.metric == VoronoiMetric::kEuclidean || is_edge;
  way = is_euclidean ? sqrt(squares) : is_sum ? way : largest;
  F8 corner[kDims], local[kDims];
  for (int i = 0; i < kDims; ++i) {
    c[i] = is_near ? p[i].c : F8{};
    corner[i] = floor(c[i]);
    local[i] = c[i] - corner[i];
  }
  const F8 at = voronoi_eval<kDims>(c, settings).distance;
  // The cell's own point is no farther away than the cell is long, nor the second one than two.
  const F8 cell = is_edge ? splat8(2.0f) : voronoi_distance<kDims>(zeros, ones, settings);
  const bool is_first = settings.feature == VoronoiFeature::kF1;
  const F8 most = (is_first ? 1.0001f : 3.0f) * cell;
  const I8 is_metric = settings.metric == VoronoiMetric::kMinkowski && !is_edge ? settings.exponent >= 1.0f : is_near;
  I8 is_known = is_near & is_metric & (is_first ? in_cell | (at + way < 0.999f) : in_cell);
  if (is_edge) is_known &= ~voronoi_has_twins<kDims, kPcg>(corner, local, way, settings);
  const float rounding = is_edge ? kVoronoiEdgeRounding : 1e-5f;
  const F8 least = splat8(is_edge ? -rounding : 0.0f);
  const GraphRange near = range_padded(max(at - way - rounding, least), min(at + way + rounding, most));
  const I8 is_within = (settings.randomness >= 0.0f) & (settings.randomness <= 1.0f);
  return range_select(is_known & is_within, near, range_unknown());
}

/// Bounds by the size of cells alone, of any octaves, which hold wherever a point is and however its settings vary: the cell's
/// own point is no farther away than the cell is long.
/// @param s    smoothness, exponent, randomness, detail, roughness, lacunarity
/// @param out  distance, three of colour, four of position, radius
template <int kDims>
RELIEF_KERNEL void voronoi_whole(const GraphRange (&p)[kDims],
                                 VoronoiFeature feature,
                                 VoronoiMetric metric,
                                 bool normalizes,
                                 const GraphRange (&s)[6],
                                 GraphRange* out)
{
  const GraphRange &smoothness = s[0], &exponent = s[1], &randomness = s[2], &lacunarity = s[5];
  const bool is_edge = feature == VoronoiFeature::kDistanceToEdge, is_radius = feature == VoronoiFeature::kSphereRadius;
  const bool is_smooth = feature == VoronoiFeature::kSmoothF1;
  const bool has_exponent = metric == VoronoiMetric::kMinkowski && kDims > 1 && !is_edge && !is_radius;
  F8 ones[kDims], zeros[kDims]{};
  for (F8& x : ones) x = splat8(1.0f);
  // The smaller an exponent, the longer a cell; below 0 it has no length.
  const VoronoiSettings<kDims, false> settings{feature, metric, F8{}, exponent.low, F8{}};
  const F8 length = is_edge ? splat8(2.0f) : is_radius ? splat8(1.0f) : voronoi_distance<kDims>(zeros, ones, settings);
  const F8 most = (feature == VoronoiFeature::kF1 ? 1.0001f : 3.0f) * length;
  float num_cells = 1.0f;
  for (int i = 0; i < kDims; ++i) num_cells *= 5.0f;
  // Each of the cells that are mixed takes a quarter of the smoothness away at most.
  const F8 mixed_away = is_smooth ? 0.25f * num_cells * max(abs(smoothness.low), abs(smoothness.high)) : F8{};
  const GraphRange distance = range_between(is_edge ? splat8(-kVoronoiEdgeRounding) : -mixed_away, most);
  const GraphRange color = range_between(-mixed_away, splat8(1.0f));
  const F8 detail = is_radius ? F8{} : clamp(s[3].high, 0.0f, 15.0f), roughness = clamp(s[4].high, 0.0f, 1.0f);
  F8 sum = splat8(1.0f), amplitude = sum, finest = sum;
  for (int n = 1; n < 16; ++n) {
    const I8 is_there = detail > static_cast<float>(n - 1);
    amplitude *= roughness;
    sum += is_there ? amplitude : F8{};
    finest *= is_there ? max(lacunarity.high, splat8(1.0f)) : splat8(1.0f);
  }
  const GraphRange octaves = range_between(splat8(1.0f), sum);
  I8 is_known = (randomness.low >= 0.0f) & (randomness.high <= 1.0f);
  // Of exponents near 0 lengths are infinite, and what is made of them is no number.
  if (has_exponent) is_known &= (exponent.low > 0.0f) & (most < kInfinity);
  if (is_smooth) is_known &= smoothness.low > 0.0f;
  // Coarser octaves than the first are divided by less than 1.
  const I8 gets_finer = (detail == 0.0f) | (lacunarity.low >= 1.0f);
  out[0] = is_edge ? distance : distance * octaves;
  if (normalizes && !is_radius) {
    // Divided by how far a corner is from the middle of the points there may be, which is as far as along an axis at least.
    const F8 corner = (0.5f + 0.5f * randomness.low) * (feature == VoronoiFeature::kF2 ? 2.0f : 1.0f);
    out[0] =
        (is_edge ? distance * range_between(splat8(1.0f), finest) : distance) * range_reciprocal(range_point(corner));
  }
  out[0] = range_select(is_edge ? is_known & gets_finer : is_known, out[0], range_unknown());
  // Borders have no colour; it is divided by a size that may be 0 where octaves get coarser.
  const I8 has_color = is_edge ? is_known & gets_finer : is_known;
  for (int c = 0; c < 3; ++c) {
    out[1 + c] = range_select(has_color, normalizes ? color : color * octaves, range_unknown());
  }
  for (int i = 0; i < 4; ++i) {
    const int axis = kDims == 1 ? i - 3 : i;
    out[4 + i] = range_point(F8{});
    if (axis < 0 || axis >= kDims || is_edge || is_radius) continue;
    const GraphRange& x = p[axis];
    // The farthest of the cells that are looked at ends three away.
    const F8 away = 3.0f + mixed_away + 8.0f * kRangeRounding * max(abs(x.low), abs(x.high));
    out[4 + i] = range_select(is_known & gets_finer, range_between(x.low - away, x.high + away), range_unknown());
  }
  out[8] = out[0];
}

/// Distance of voronoi_fractal, with settings that are the same all over; unknown where one octave's is.
template <int kDims, bool kPcg>
RELIEF_KERNEL GraphRange voronoi_range(const GraphRange (&p)[kDims],
                                       const VoronoiSettings<kDims, kPcg>& settings,
                                       const NoiseOctaves& octaves)
{
  const bool is_edge = settings.feature == VoronoiFeature::kDistanceToEdge;
  const bool is_radius = settings.feature == VoronoiFeature::kSphereRadius;
  const bool normalizes = (settings.flags & kVoronoiNormalize) != 0 && !is_radius;
  const bool is_single = mask_of((octaves.detail == 0.0f) | (octaves.roughness == 0.0f)) == 0xffu || is_radius;
  F8 corner[kDims], origin[kDims]{};
  for (F8& x : corner) x = 0.5f + 0.5f * settings.randomness;
  F8 most = is_edge ? corner[0] : voronoi_distance<kDims>(origin, corner, settings);
  if (settings.feature == VoronoiFeature::kF2) most *= 2.0f;
  if (is_single) {
    const GraphRange distance = voronoi_distance_range<kDims, kPcg>(p, settings);
    return normalizes ? distance * range_reciprocal(range_point(most)) : distance;
  }
  if (is_edge) return range_unknown();
  const F8 detail = octaves.detail, rest = detail - floor(detail), last_octave = -floor(-detail);
  float last = 0.0f;
  for (int k = 0; k < 8; ++k) last = last_octave[k] > last ? last_octave[k] : last;
  F8 amplitude = splat8(1.0f), scale = splat8(1.0f), size{};
  GraphRange sum = range_point(F8{});
  for (int n = 0; n <= static_cast<int>(last); ++n) {
    GraphRange scaled[kDims];
    for (int i = 0; i < kDims; ++i) scaled[i] = p[i] * range_point(scale);
    const F8 number = splat8(static_cast<float>(n));
    const I8 is_whole = number <= detail, is_there = number <= last_octave;
    const F8 share = is_whole ? splat8(1.0f) : is_there ? rest : F8{};
    sum = sum + voronoi_distance_range<kDims, kPcg>(scaled, settings) * range_point(share * amplitude);
    size += share * amplitude;
    amplitude = is_whole ? amplitude * octaves.roughness : amplitude;
    scale = is_whole ? scale * octaves.lacunarity : scale;
  }
  return normalizes ? sum * range_reciprocal(range_point(size * most)) : sum;
}

}  // namespace relief
