#include "displacement/level_facets.h"

#include <algorithm>

#include "kernel/sample/sobol.h"

namespace relief {

namespace {

constexpr int kSide = 4;
static_assert(kSide * kSide == kLevelFacets);

/// Cells at equal distances along a lattice axis, and the texels that their slopes are made of.
struct CellsAlongAxis {
  std::int64_t texel[kSide][4];  ///< before the cell, at its ends, and behind it; times the stride
  float place[kSide];            ///< within the cell
};

/// @param x       lattice coordinate in the middle
/// @param width   of the stretch they are from
/// @param jitter  [0, 1)
CellsAlongAxis cells_along(const LatticeAxis& axis, double x, double width, float jitter, std::int64_t stride)
{
  CellsAlongAxis cells;
  for (int k = 0; k < kSide; ++k) {
    const double at = x + width * ((k + static_cast<double>(jitter)) / kSide - 0.5), floor = std::floor(at);
    for (int j = 0; j < 4; ++j) {
      cells.texel[k][j] = lattice_texel(axis, static_cast<std::int64_t>(floor) - 1 + j) * stride;
    }
    cells.place[k] = static_cast<float>(at - floor);
  }
  return cells;
}

float mix(float a, float b, float t) { return a + (b - a) * t; }

/// Slopes of a map around a point of it, heights a texel.
struct Slopes {
  float x[kLevelFacets], y[kLevelFacets];
};

/// Slopes of texels, in units of theirs.
template <class Texel>
void slopes_of(const Texel* texels, const CellsAlongAxis& columns, const CellsAlongAxis& rows, bool smooth, Slopes* out)
{
  for (int k = 0; k < kLevelFacets; ++k) {
    const int c = k % kSide, r = k / kSide;
    const float fx = columns.place[c], fy = rows.place[r];
    const auto height = [&](int i, int j) {
      return static_cast<float>(texels[rows.texel[r][j] + columns.texel[c][i]]);
    };
    const float h00 = height(1, 1), h10 = height(2, 1), h01 = height(1, 2), h11 = height(2, 2);
    if (!smooth) {
      out->x[k] = mix(h10 - h00, h11 - h01, fy);
      out->y[k] = mix(h01 - h00, h11 - h10, fx);
      continue;
    }
    // Half the difference of what is interpolated one texel to either side.
    out->x[k] = 0.5f * mix(mix(h10 - height(0, 1), height(3, 1) - h00, fx),
                           mix(h11 - height(0, 2), height(3, 2) - h01, fx), fy);
    out->y[k] = 0.5f * mix(mix(h01 - height(1, 0), height(1, 3) - h00, fy),
                           mix(h11 - height(2, 0), height(2, 3) - h10, fy), fx);
  }
}

/// @param x, y           lattice coordinates
/// @param width, height  of the rectangle around them that is looked at
/// @param jitter         [0, 1)²
/// @param smooth         slopes are those that the map is shaded with, see surface_smooth_normal
Slopes
slopes_around(const HeightFieldView& f, double x, double y, double width, double height, Vec2f jitter, bool smooth)
{
  const CellsAlongAxis columns = cells_along(f.x, x, width, jitter.x, 1);
  const CellsAlongAxis rows = cells_along(f.y, y, height, jitter.y, f.map.width);
  Slopes slopes;
  float step = 1.0f;
  switch (f.map.format) {
    case HeightFormat::kU8:
      step = 1.0f / 255.0f;
      slopes_of(static_cast<const std::uint8_t*>(f.map.texels), columns, rows, smooth, &slopes);
      break;
    case HeightFormat::kU16:
      step = 1.0f / 65535.0f;
      slopes_of(static_cast<const std::uint16_t*>(f.map.texels), columns, rows, smooth, &slopes);
      break;
    case HeightFormat::kFloat:
      slopes_of(static_cast<const float*>(f.map.texels), columns, rows, smooth, &slopes);
      break;
  }
  for (int k = 0; k < kLevelFacets; ++k) {
    slopes.x[k] *= step;
    slopes.y[k] *= step;
  }
  return slopes;
}

float mean_of(const float* values)
{
  float sum = 0;
  for (int k = 0; k < kLevelFacets; ++k) sum += values[k];
  return sum / kLevelFacets;
}

}  // namespace

bool level_facets_make(const DisplacedGeometry& geometry, const LevelPlace& at, Vec2f jitter, LevelFacets* out)
{
  const HeightFieldView& map = geometry.facets->texels;
  const DisplacedTriangle tri = triangle_on_level(geometry.mesh.triangles[at.triangle], *geometry.mesh.field, map);
  const double b1 = at.b1, b2 = at.b2;
  const BasePoint base = base_point(tri, b1, b2);
  const double inverse_length = 1.0 / length(base.N);
  const Vec3d n = base.N * inverse_length;
  const double d = dot(to_double(at.P) - base.P, n);
  // As in surface_normal; what is affine in the slopes.
  const auto along = [&](Vec3d dP, Vec3d dN) { return dP + (d * inverse_length) * (dN - dot(n, dN) * n); };
  const Vec3d u = along(base.Pu, base.Nu), v = along(base.Pv, base.Nv);
  const double flat = dot(cross(u, v), n);
  const Vec3d by_u = cross(n, v), by_v = cross(u, n);
  // All facets show the same area along n.
  const double by_size = std::abs(dot(to_double(at.Ng), n)) / flat * geometry.mesh.scale;
  if (!(std::abs(by_size) < __builtin_huge_val())) return false;
  const auto to_world = [&](Vec3d a) {
    return transform_normal(at.placement.object_from_world, as_normal(to_float(by_size * a)));
  };
  const Vec3f normal = transform_normal(at.placement.object_from_world, as_normal(at.Ng));
  const float size = 1.0f / length(normal);
  if (!(size < kInfinity)) return false;
  out->normal = size * normal;

  const double x = tri.x[0] + b1 * base.xu + b2 * base.xv, y = tri.y[0] + b1 * base.yu + b2 * base.yv;
  const double width = geometry.facets->window * std::exp2(at.level);
  const Slopes slopes = slopes_around(map, x, y, width, width, jitter, geometry.smooth);
  const float mean_x = mean_of(slopes.x), mean_y = mean_of(slopes.y);
  for (int k = 0; k < kLevelFacets; ++k) {
    out->x[k] = slopes.x[k] - mean_x;
    out->y[k] = slopes.y[k] - mean_y;
  }
  const auto level = static_cast<int>(at.level);
  const float part = at.level - static_cast<float>(level);
  const Vec2f* const known = geometry.facets->spread + level;
  const Vec2f spread = part > 0.0f ? known[0] * (1.0f - part) + known[1] * part : known[0];
  out->per_x = size * spread.x * to_world(base.xu * by_u + base.xv * by_v);
  out->per_y = size * spread.y * to_world(base.yu * by_u + base.yv * by_v);
  return true;
}

Vec2f facet_spread(const HeightFieldView& map, const HeightFieldView& level, double spacing, double window, bool smooth)
{
  const auto square = [](double value) { return value * value; };
  constexpr std::uint32_t kPlaces = 4096;
  const double step = spacing > 0 ? spacing : 1.0;
  const double width = step * map.map.width / level.map.width, height = step * map.map.height / level.map.height;
  double all_x = 0, all_y = 0, around_x = 0, around_y = 0, level_x = 0, level_y = 0;
  for (std::uint32_t i = 0; i < kPlaces; ++i) {
    const Vec2f place = sample_2d(0, i, 0), jitter = sample_2d(0, i, 1);
    const double x = static_cast<double>(place.x) * map.map.width, y = static_cast<double>(place.y) * map.map.height;
    const Slopes slopes = slopes_around(map, x, y, window, window, jitter, smooth);
    const float mean_x = mean_of(slopes.x), mean_y = mean_of(slopes.y);
    for (int k = 0; k < kLevelFacets; ++k) {
      all_x += square(slopes.x[k]);
      all_y += square(slopes.y[k]);
      around_x += square(slopes.x[k] - mean_x);
      around_y += square(slopes.y[k] - mean_y);
    }
    double from_x = lattice_on_level(x, map.map.width, level.map.width),
           from_y = lattice_on_level(y, map.map.height, level.map.height);
    const double in_x = from_x, in_y = from_y;
    if (!(spacing > 0)) {
      from_x = std::floor(from_x);
      from_y = std::floor(from_y);
    }
    level_x +=
        kLevelFacets *
        square((interpolate_height(level, from_x + step, in_y) - interpolate_height(level, from_x, in_y)) / width);
    level_y +=
        kLevelFacets *
        square((interpolate_height(level, in_x, from_y + step) - interpolate_height(level, in_x, from_y)) / height);
  }
  const auto root = [](double lost, double around) {
    return around > 0 ? static_cast<float>(std::sqrt(std::clamp(lost / around, 0.0, 4.0))) : 0.0f;
  };
  return {root(all_x - level_x, around_x), root(all_y - level_y, around_y)};
}

FacetMoments facet_moments(const LevelFacets& facets)
{
  float xx = 0, xy = 0, yy = 0;
  for (int k = 0; k < kLevelFacets; ++k) {
    xx += facets.x[k] * facets.x[k];
    xy += facets.x[k] * facets.y[k];
    yy += facets.y[k] * facets.y[k];
  }
  constexpr float kEach = 1.0f / kLevelFacets;
  // The root of the covariance by Cholesky.
  const float x = std::sqrt(xx * kEach);
  const float both = x > 0.0f ? xy * kEach / x : 0.0f;
  const float y = std::sqrt(max(0.0f, yy * kEach - both * both));
  return {facets.normal, {x * facets.per_x + both * facets.per_y, y * facets.per_y}};
}

bool facet_choose(const LevelFacets& facets, Vec3f w, float u, Vec3f* normal)
{
  const float mean = dot(w, facets.normal), x = dot(w, facets.per_x), y = dot(w, facets.per_y);
  float shown[kLevelFacets], sum = 0;
  for (int k = 0; k < kLevelFacets; ++k) sum += shown[k] = max(0.0f, mean + facets.x[k] * x + facets.y[k] * y);
  if (!(sum > 0.0f)) return false;
  float left = u * sum;
  int chosen = 0;
  for (int k = 0; k < kLevelFacets; ++k) {
    if (!(shown[k] > 0.0f)) continue;
    chosen = k;
    left -= shown[k];
    if (left < 0.0f) break;
  }
  *normal = normalize(facets.normal + facets.x[chosen] * facets.per_x + facets.y[chosen] * facets.per_y);
  return true;
}

}  // namespace relief
