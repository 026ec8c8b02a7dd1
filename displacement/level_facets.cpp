#include "displacement/level_facets.h"

#include <algorithm>
#include <type_traits>

#include "displacement/deformation.h"
#include "kernel/sample/sobol.h"

namespace relief {

namespace {

constexpr int kSide = 4;
static_assert(kSide * kSide == kLevelFacets);

using F4 [[gnu::vector_size(16)]] = float;

/// Cells at equal distances along a lattice axis, and the texels that their slopes are made of.
struct CellsAlongAxis {
  std::int64_t texel[kSide][4];  ///< before the cell, at its ends, and behind it; times the stride
  F4 place;                      ///< within the cell
  bool in_a_row;                 ///< each cell's texels are neighbours in the map
};

/// @param x       lattice coordinate in the middle
/// @param width   of the stretch they are from
/// @param jitter  [0, 1)
CellsAlongAxis cells_along(const LatticeAxis& axis, double x, double width, float jitter, std::int64_t stride)
{
  CellsAlongAxis cells;
  std::int64_t before[kSide];
  for (int k = 0; k < kSide; ++k) {
    const double at = x + width * ((k + static_cast<double>(jitter)) / kSide - 0.5);
    auto cell = static_cast<std::int64_t>(at);
    cell -= at < static_cast<double>(cell) ? 1 : 0;
    before[k] = cell - 1;
    cells.place[k] = static_cast<float>(at - static_cast<double>(cell));
  }
  // Mostly none of them is beyond the end of a tile: then two divisions do.
  const std::int64_t length = before[kSide - 1] + 3 - before[0], first = lattice_texel(axis, before[0]);
  cells.in_a_row = lattice_texel(axis, before[0] + length) - first == length;
  for (int k = 0; k < kSide; ++k) {
    for (int j = 0; j < 4; ++j) {
      cells.texel[k][j] =
          stride * (cells.in_a_row ? first + (before[k] - before[0]) + j : lattice_texel(axis, before[k] + j));
    }
  }
  return cells;
}

/// Four texels of a row.
template <class Texel>
F4 load4(const Texel* row, const std::int64_t* columns, bool in_a_row)
{
  if (in_a_row) {
    using Texels [[gnu::vector_size(4 * sizeof(Texel))]] = Texel;
    using I4 [[gnu::vector_size(16)]] = std::int32_t;
    Texels texels;
    __builtin_memcpy(&texels, row + columns[0], sizeof texels);
    if constexpr (std::is_same_v<Texel, float>) return texels;
    return __builtin_convertvector(__builtin_convertvector(texels, I4), F4);
  }
  return F4{static_cast<float>(row[columns[0]]), static_cast<float>(row[columns[1]]),
            static_cast<float>(row[columns[2]]), static_cast<float>(row[columns[3]])};
}

/// Texels of a row, by their place beside a cell; a lane is a column of cells.
struct RowOfCells {
  F4 texel[4];
};

template <class Texel>
RowOfCells row_of_cells(const Texel* row, const CellsAlongAxis& columns)
{
  F4 c[kSide];
  for (int k = 0; k < kSide; ++k) c[k] = load4(row, columns.texel[k], columns.in_a_row);
  const F4 low01 = __builtin_shufflevector(c[0], c[1], 0, 4, 1, 5),
           high01 = __builtin_shufflevector(c[0], c[1], 2, 6, 3, 7);
  const F4 low23 = __builtin_shufflevector(c[2], c[3], 0, 4, 1, 5),
           high23 = __builtin_shufflevector(c[2], c[3], 2, 6, 3, 7);
  return {{__builtin_shufflevector(low01, low23, 0, 1, 4, 5), __builtin_shufflevector(low01, low23, 2, 3, 6, 7),
           __builtin_shufflevector(high01, high23, 0, 1, 4, 5), __builtin_shufflevector(high01, high23, 2, 3, 6, 7)}};
}

F4 mix(F4 a, F4 b, F4 t) { return a + (b - a) * t; }

F4 splat(float x) { return F4{x, x, x, x}; }

float sum_of(F4 a) { return (a[0] + a[2]) + (a[1] + a[3]); }

/// Slopes of a map around a point of it, heights a texel.
struct Slopes {
  F4 x[kSide], y[kSide];
};

/// Slopes of texels, in units of theirs.
template <class Texel>
void slopes_of(const Texel* texels, const CellsAlongAxis& columns, const CellsAlongAxis& rows, bool smooth, Slopes* out)
{
  const F4 fx = columns.place;
  for (int r = 0; r < kSide; ++r) {
    const auto row = [&](int j) { return row_of_cells(texels + rows.texel[r][j], columns); };
    const F4 fy = splat(rows.place[r]);
    const RowOfCells low = row(1), high = row(2);
    if (!smooth) {
      out->x[r] = mix(low.texel[2] - low.texel[1], high.texel[2] - high.texel[1], fy);
      out->y[r] = mix(high.texel[1] - low.texel[1], high.texel[2] - low.texel[2], fx);
      continue;
    }
    // Half the difference of what is interpolated one texel to either side.
    const RowOfCells below = row(0), above = row(3);
    F4 across[4], up[4];
    for (int k = 0; k < 4; ++k) {
      across[k] = mix(low.texel[k], high.texel[k], fy);
      up[k] = mix(high.texel[k] - below.texel[k], above.texel[k] - low.texel[k], fy);
    }
    out->x[r] = 0.5f * mix(across[2] - across[0], across[3] - across[1], fx);
    out->y[r] = 0.5f * mix(up[1], up[2], fx);
  }
}

/// Cells of a map around a point.
struct CellsAround {
  CellsAlongAxis columns, rows;
};

/// @param x, y           lattice coordinates
/// @param width, height  of the rectangle around them that is looked at
/// @param jitter         [0, 1)²
CellsAround cells_around(const HeightFieldView& f, double x, double y, double width, double height, Vec2f jitter)
{
  return {cells_along(f.x, x, width, jitter.x, 1), cells_along(f.y, y, height, jitter.y, f.map.width)};
}

/// Starts to fetch the texels that slopes in cells are made of.
void prefetch_cells(const HeightFieldView& f, const CellsAround& cells)
{
  static_assert(static_cast<int>(HeightFormat::kU8) == 0 && static_cast<int>(HeightFormat::kU16) == 1 &&
                static_cast<int>(HeightFormat::kFloat) == 2);
  const int log2_bytes = static_cast<int>(f.map.format);
  for (const auto& rows : cells.rows.texel) {
    for (const std::int64_t row : {rows[1], rows[2]})
      __builtin_prefetch(static_cast<const char*>(f.map.texels) + ((row + cells.columns.texel[0][1]) << log2_bytes));
  }
}

/// @param smooth  slopes are those that the map is shaded with, see surface_smooth_normal
Slopes slopes_in(const HeightFieldView& f, const CellsAround& cells, bool smooth)
{
  Slopes slopes;
  float step = 1.0f;
  switch (f.map.format) {
    case HeightFormat::kU8:
      step = 1.0f / 255.0f;
      slopes_of(static_cast<const std::uint8_t*>(f.map.texels), cells.columns, cells.rows, smooth, &slopes);
      break;
    case HeightFormat::kU16:
      step = 1.0f / 65535.0f;
      slopes_of(static_cast<const std::uint16_t*>(f.map.texels), cells.columns, cells.rows, smooth, &slopes);
      break;
    case HeightFormat::kFloat:
      slopes_of(static_cast<const float*>(f.map.texels), cells.columns, cells.rows, smooth, &slopes);
      break;
  }
  for (int r = 0; r < kSide; ++r) {
    slopes.x[r] *= step;
    slopes.y[r] *= step;
  }
  return slopes;
}

/// Of all facets.
float sum_of(const F4* values) { return sum_of((values[0] + values[1]) + (values[2] + values[3])); }
float sum_of_products(const F4* a, const F4* b)
{
  return sum_of((a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]));
}

Slopes slopes_of(const LevelFacets& facets)
{
  Slopes slopes;
  __builtin_memcpy(slopes.x, facets.x, sizeof slopes.x);
  __builtin_memcpy(slopes.y, facets.y, sizeof slopes.y);
  return slopes;
}

}  // namespace

bool level_facets_make(const DisplacedGeometry& geometry, const LevelPlace& at, Vec2f jitter, LevelFacets* out)
{
  const HeightFieldView& map = geometry.facets->texels;
  const MeshAtTime then(geometry.mesh, at.triangle, at.time);
  const DisplacedTriangle tri = triangle_on_level(then.tri(), *geometry.mesh.field, map);
  const double b1 = at.b1, b2 = at.b2;
  const auto [x, y] = lattice_point(tri, b1, b2);
  const double width = geometry.facets->window * static_cast<double>(std::exp2(at.level));
  const CellsAround cells = cells_around(map, x, y, width, width, jitter);
  prefetch_cells(map, cells);

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

  const Slopes slopes = slopes_in(map, cells, geometry.smooth);
  const float mean_x = sum_of(slopes.x) / kLevelFacets, mean_y = sum_of(slopes.y) / kLevelFacets;
  for (int r = 0; r < kSide; ++r) {
    const F4 less_x = slopes.x[r] - mean_x, less_y = slopes.y[r] - mean_y;
    __builtin_memcpy(out->x + kSide * r, &less_x, sizeof less_x);
    __builtin_memcpy(out->y + kSide * r, &less_y, sizeof less_y);
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
    const Slopes slopes = slopes_in(map, cells_around(map, x, y, window, window, jitter), smooth);
    const float mean_x = sum_of(slopes.x) / kLevelFacets, mean_y = sum_of(slopes.y) / kLevelFacets;
    for (int k = 0; k < kLevelFacets; ++k) {
      const float slope_x = slopes.x[k / kSide][k % kSide], slope_y = slopes.y[k / kSide][k % kSide];
      all_x += square(slope_x);
      all_y += square(slope_y);
      around_x += square(slope_x - mean_x);
      around_y += square(slope_y - mean_y);
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
  const Slopes slopes = slopes_of(facets);
  const float xx = sum_of_products(slopes.x, slopes.x), xy = sum_of_products(slopes.x, slopes.y),
              yy = sum_of_products(slopes.y, slopes.y);
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
  const Slopes slopes = slopes_of(facets);
  F4 lanes[kSide];
  for (int r = 0; r < kSide; ++r) {
    lanes[r] = mean + slopes.x[r] * x + slopes.y[r] * y;
    lanes[r] = lanes[r] > 0.0f ? lanes[r] : F4{};
  }
  const float sum = sum_of(lanes);
  if (!(sum > 0.0f)) return false;
  // First the row, then the facet.
  float left = u * sum;
  const auto choose = [&](F4 size) {
    const float first = size[0], second = first + size[1], third = second + size[2];
    const int k = (left >= first ? 1 : 0) + (left >= second ? 1 : 0) + (left >= third ? 1 : 0);
    left -= k == 0 ? 0.0f : (k == 1 ? first : (k == 2 ? second : third));
    return k;
  };
  const int r = choose(F4{sum_of(lanes[0]), sum_of(lanes[1]), sum_of(lanes[2]), sum_of(lanes[3])});
  int chosen = kSide * r + choose(lanes[r]);
  // Roundings may end at a facet that is not seen.
  float shown[kLevelFacets];
  __builtin_memcpy(shown, lanes, sizeof shown);
  while (!(shown[chosen] > 0.0f)) chosen = (chosen + kLevelFacets - 1) % kLevelFacets;
  *normal = normalize(facets.normal + facets.x[chosen] * facets.per_x + facets.y[chosen] * facets.per_y);
  return true;
}

}  // namespace relief
