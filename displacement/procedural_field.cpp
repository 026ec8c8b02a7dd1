#include "displacement/procedural_field.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "kernel/assert.h"

namespace relief {

namespace {

/// Bits of heights along sides that are left for sums of three of them.
constexpr int kBitsOfSums = 2;

constexpr float kNoBound = std::numeric_limits<float>::max();

bool is_known(LatticeRange r) { return std::abs(r.low) < kNoBound && std::abs(r.high) < kNoBound; }

LatticeRange merge(LatticeRange a, LatticeRange b) { return {std::min(a.low, b.low), std::max(a.high, b.high)}; }

std::int32_t divide_up(std::int32_t a, std::int32_t b) { return (a + b - 1) / b; }

/// A rectangle of a triangle's lattice as the source takes it.
void set_patch(const LatticeTriangle& t, double x0, double y0, double x1, double y1, int lane, WeightPatches* out)
{
  const double scale = 0.5 / t.n;
  const double u = (x0 + x1) * scale, v = (y0 + y1) * scale, half_u = (x1 - x0) * scale, half_v = (y1 - y0) * scale;
  for (int axis = 0; axis < 2; ++axis) {
    const auto at = [&](int k) { return static_cast<double>(axis == 0 ? t.corner[k].x : t.corner[k].y); };
    const double e1 = at(1) - at(0), e2 = at(2) - at(0);
    out->center[axis][lane] = static_cast<float>(at(0) + u * e1 + v * e2);
    // A rounding of the center is made good for.
    const auto half = [](double size) { return static_cast<float>(size + std::copysign(1e-7, size)); };
    out->du[axis][lane] = half(half_u * e1);
    out->dv[axis][lane] = half(half_v * e2);
  }
}

}  // namespace

/// A point of a base triangle whose height is wanted.
struct ProceduralField::Request {
  float b[3];
};

ProceduralField::ProceduralField(const HeightSource& source,
                                 std::vector<LatticeTriangle> triangles,
                                 float midlevel,
                                 LatticeCache& cache)
    : source_(source),
      triangles_(std::move(triangles)),
      midlevel_(midlevel),
      cache_(cache),
      first_triangle_(cache.num_triangles)
{
  cache.num_triangles += triangles_.size();
  int log2_ratio = 0;
  for (const LatticeTriangle& t : triangles_) {
    for (const std::int32_t side : t.side_n) log2_ratio = std::max(log2_ratio, std::ilogb(t.n / side));
  }
  find_ranges();
  const float largest = std::max(std::abs(all_.low), std::abs(all_.high));
  side_grid_ = std::ldexp(1.0f, std::ilogb(std::max(largest, 1e-30f)) - 23 + kBitsOfSums + log2_ratio);
  for (LatticeRange& r : ranges_) r = {r.low - side_grid_, r.high + side_grid_};
}

void ProceduralField::find_ranges()
{
  ranges_.resize(triangles_.size());
  std::atomic<bool> all_known{true};
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles_.size()), [&](const auto& part) {
    for (std::size_t k = part.begin(); k < part.end(); ++k) {
      const LatticeTriangle& t = triangles_[k];
      WeightPatches patches;
      // Quarters, of which one lies outside: tighter than the whole, for as much work.
      const double half = 0.5 * t.n;
      for (int lane = 0; lane < 8; ++lane) {
        const double x = lane % 3 == 1 ? half : 0, y = lane % 3 == 2 ? half : 0;
        set_patch(t, x, y, x + half, y + half, lane, &patches);
      }
      float low[8], high[8];
      source_.bounds(source_.owner, t.base, patches, low, high);
      ranges_[k] = merge(merge({low[0], high[0]}, {low[1], high[1]}), {low[2], high[2]});
      if (!is_known(ranges_[k])) all_known.store(false, std::memory_order_relaxed);
    }
  });
  if (!all_known) {
    // What some points have, and as much more to either side: heights beyond are cut off.
    is_sampled_ = true;
    constexpr int kPoints = 16;
    all_ = {-kNoBound, kNoBound};
    LatticeRange seen{kNoBound, -kNoBound};
    std::mutex mutex;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles_.size()), [&](const auto& part) {
      LatticeRange here{kNoBound, -kNoBound};
      for (std::size_t k = part.begin(); k < part.end(); ++k) {
        Request requests[kPoints * kPoints];
        float h[kPoints * kPoints];
        std::size_t count = 0;
        for (int j = 0; j < kPoints; ++j) {
          for (int i = 0; i + j < kPoints; ++i) {
            const float b1 = static_cast<float>(i) / (kPoints - 1), b2 = static_cast<float>(j) / (kPoints - 1);
            requests[count++] = {{1.0f - b1 - b2, b1, b2}};
          }
        }
        eval(triangles_[k].base, requests, count, h);
        for (std::size_t p = 0; p < count; ++p) here = merge(here, {h[p], h[p]});
      }
      const std::lock_guard lock(mutex);
      seen = merge(seen, here);
    });
    const float more = seen.high - seen.low;
    ranges_.assign(ranges_.size(), {seen.low - more, seen.high + more});
  }
  all_ = {kNoBound, -kNoBound};
  for (const LatticeRange& r : ranges_) all_ = merge(all_, r);
  if (ranges_.empty()) all_ = {};
}

float ProceduralField::rounded(float h) const { return std::nearbyint(h / side_grid_) * side_grid_; }

ProceduralField::Request ProceduralField::request(const LatticeTriangle& t, std::int32_t i, std::int32_t j) const
{
  // Corners of parts are dyadic fractions, so that the weights of a point are the same for all triangles that have it.
  const double w[3] = {static_cast<double>(t.n - i - j), static_cast<double>(i), static_cast<double>(j)};
  double b[3] = {0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    const double x = t.corner[k].x, y = t.corner[k].y;
    b[0] += w[k] * (1.0 - x - y);
    b[1] += w[k] * x;
    b[2] += w[k] * y;
  }
  const double n = t.n;
  return {{static_cast<float>(b[0] / n), static_cast<float>(b[1] / n), static_cast<float>(b[2] / n)}};
}

void ProceduralField::eval(std::uint32_t base, const Request* requests, std::size_t count, float* h) const
{
  for (std::size_t first = 0; first < count; first += 8) {
    float b[3][8], out[8];
    const std::size_t num = std::min<std::size_t>(8, count - first);
    for (std::size_t lane = 0; lane < 8; ++lane) {
      const Request& r = requests[first + std::min(lane, num - 1)];
      for (int k = 0; k < 3; ++k) b[k][lane] = r.b[k];
    }
    source_.eval(source_.owner, base, b, out);
    for (std::size_t lane = 0; lane < num; ++lane) {
      const float height = std::isfinite(out[lane]) ? out[lane] : midlevel_;
      h[first + lane] = std::clamp(height, all_.low, all_.high);
    }
  }
}

float ProceduralField::lattice_height(std::uint32_t triangle, std::int32_t i, std::int32_t j) const
{
  const LatticeTriangle& t = triangles_[triangle];
  const std::int32_t k = t.n - i - j;
  RELIEF_ASSERT(i >= 0 && j >= 0 && k >= 0);
  // Along side 0 i counts, along side 1 j, along side 2 k.
  const std::int32_t along[3] = {i, j, k};
  const bool on[3] = {j == 0, k == 0, i == 0};
  for (int side = 0; side < 3; ++side) {
    const std::int32_t step = t.n / t.side_n[side], rest = along[side] % step;
    if (!on[side] || rest == 0) continue;
    // Between two points of the side.
    const auto point = [&](std::int32_t at) {
      return side == 0 ? request(t, at, 0) : side == 1 ? request(t, t.n - at, at) : request(t, 0, t.n - at);
    };
    const Request ends[2] = {point(along[side] - rest), point(along[side] - rest + step)};
    float h[2];
    eval(t.base, ends, 2, h);
    const double from = rounded(h[0]), to = rounded(h[1]);
    return static_cast<float>(from + (to - from) * rest / step);
  }
  const Request one = request(t, i, j);
  float h;
  eval(t.base, &one, 1, &h);
  return on[0] || on[2] || k <= 1 ? rounded(h) : h;
}

LatticeSlopes ProceduralField::smooth_slopes(std::uint32_t triangle,
                                             double b1,
                                             double b2,
                                             const HeightFieldView& tile,
                                             std::int32_t tile_i,
                                             std::int32_t tile_j) const
{
  const LatticeTriangle& t = triangles_[triangle];
  const double x = b1 * t.n, y = b2 * t.n;
  const std::int32_t i = std::clamp(static_cast<std::int32_t>(std::floor(x)), 0, t.n - 1),
                     j = std::clamp(static_cast<std::int32_t>(std::floor(y)), 0, t.n - 1 - i);
  const double fx = std::clamp(x - i, 0.0, 1.0), fy = std::clamp(y - j, 0.0, 1.0);
  // The third side cuts the last cells.
  const bool is_cut = i + j == t.n - 1;
  const double weights[4] = {is_cut ? std::max(1 - fx - fy, 0.0) : (1 - fx) * (1 - fy), is_cut ? fx : fx * (1 - fy),
                             is_cut ? fy : (1 - fx) * fy, is_cut ? 0.0 : fx * fy};
  LatticeSlopes sum;
  Vec2f beyond[4];
  double beyond_weight[4];
  int num_beyond = 0;
  for (int k = 0; k < 4; ++k) {
    if (!(weights[k] > 0)) continue;
    const std::int32_t at_i = i + (k & 1), at_j = j + (k >> 1);
    // Texels of the tile.
    const std::int32_t c = at_i - tile_i * kTileCells + 1, r = at_j - tile_j * kTileCells + 1;
    const bool is_within =
        at_i > 0 && at_j > 0 && at_i + at_j < t.n && c > 0 && r > 0 && c < kTileTexels - 1 && r < kTileTexels - 1;
    if (is_within) {
      const auto h = [&](int at_c, int at_r) { return relief::lattice_height(tile, at_c, at_r); };
      sum.x += weights[k] * 0.5 * (h(c + 1, r) - h(c - 1, r));
      sum.y += weights[k] * 0.5 * (h(c, r + 1) - h(c, r - 1));
      continue;
    }
    const Request at = request(t, at_i, at_j);
    beyond[num_beyond] = {at.b[1], at.b[2]};
    beyond_weight[num_beyond++] = weights[k];
  }
  if (num_beyond == 0) return sum;
  const float unit = 1.0f / static_cast<float>(t.n);
  HeightSlopes slopes[4];
  height_slopes(source_, t.base, beyond, num_beyond, (t.corner[1] - t.corner[0]) * unit,
                (t.corner[2] - t.corner[0]) * unit, slopes);
  for (int k = 0; k < num_beyond; ++k) {
    sum.x += beyond_weight[k] * static_cast<double>(slopes[k].u);
    sum.y += beyond_weight[k] * static_cast<double>(slopes[k].v);
  }
  return sum;
}

LatticeNode ProceduralField::root(std::uint32_t triangle) const
{
  const std::int32_t tiles = divide_up(triangles_[triangle].n, kTileCells);
  LatticeNode node;
  while ((1 << node.level) < tiles) ++node.level;
  return node;
}

void ProceduralField::make_tile(std::uint32_t triangle,
                                std::int32_t tile_i,
                                std::int32_t tile_j,
                                HeightTile* tile) const
{
  const LatticeTriangle& t = triangles_[triangle];
  const std::int32_t i0 = tile_i * kTileCells - 1, j0 = tile_j * kTileCells - 1;
  Request requests[kTileTexels * kTileTexels];
  std::uint16_t place[kTileTexels * kTileTexels];
  float h[kTileTexels * kTileTexels];
  std::size_t count = 0;
  const auto is_stitched = [&](std::int32_t i, std::int32_t j) {
    return (j == 0 && t.side_n[0] < t.n) || (i + j == t.n && t.side_n[1] < t.n) || (i == 0 && t.side_n[2] < t.n);
  };
  for (std::int32_t r = 0; r < kTileTexels; ++r) {
    for (std::int32_t c = 0; c < kTileTexels; ++c) {
      const std::int32_t i = i0 + c, j = j0 + r;
      if (i < 0 || j < 0 || i + j > t.n || is_stitched(i, j)) continue;
      requests[count] = request(t, i, j);
      place[count++] = static_cast<std::uint16_t>(r * kTileTexels + c);
    }
  }
  eval(t.base, requests, count, h);
  for (std::size_t k = 0; k < count; ++k) {
    const std::int32_t i = i0 + place[k] % kTileTexels, j = j0 + place[k] / kTileTexels;
    tile->texels[place[k]] = i == 0 || j == 0 || i + j >= t.n - 1 ? rounded(h[k]) : h[k];
  }
  const auto texel = [&](std::int32_t i, std::int32_t j) -> float& {
    return tile->texels[(j - j0) * kTileTexels + (i - i0)];
  };
  for (std::int32_t r = 0; r < kTileTexels; ++r) {
    for (std::int32_t c = 0; c < kTileTexels; ++c) {
      const std::int32_t i = i0 + c, j = j0 + r;
      if (i >= 0 && j >= 0 && i + j <= t.n && is_stitched(i, j)) texel(i, j) = lattice_height(triangle, i, j);
    }
  }
  // Beyond the triangle: across the third side the plane of the cell that it cuts; elsewhere nothing is met.
  for (std::int32_t r = 0; r < kTileTexels; ++r) {
    for (std::int32_t c = 0; c < kTileTexels; ++c) {
      const std::int32_t i = i0 + c, j = j0 + r;
      if (i < 0 || j < 0 || i + j <= t.n) continue;
      if (i + j == t.n + 1 && c > 0 && r > 0 && i > 0 && j > 0) {
        texel(i, j) = texel(i - 1, j) + texel(i, j - 1) - texel(i - 1, j - 1);
      } else if (i + j == t.n + 1 && i > 0) {
        texel(i, j) = lattice_height(triangle, i - 1, j);
      } else {
        texel(i, j) = c > 0 ? texel(i - 1, j) : r > 0 ? texel(i, j - 1) : midlevel_;
      }
    }
  }
  if (i0 < 0) {
    for (std::int32_t r = 0; r < kTileTexels; ++r) tile->texels[r * kTileTexels] = tile->texels[r * kTileTexels + 1];
  }
  if (j0 < 0) std::copy_n(tile->texels + kTileTexels, kTileTexels, tile->texels);
  height_tile_finish(tile);
  LatticeRange range{kNoBound, -kNoBound};
  for (std::int32_t r = 1; r < kTileTexels - 1; ++r) {
    for (std::int32_t c = 1; c < kTileTexels - 1; ++c) {
      if (i0 + c + j0 + r > t.n) break;
      const float h_here = tile->texels[r * kTileTexels + c];
      range = merge(range, {h_here, h_here});
    }
  }
  // Heights that are there bound a tile better than the source does.
  const LatticeNode parent{1, tile_i / 2, tile_j / 2};
  if (root(triangle).level > 0) {
    cache_.nodes.improve(node_key(triangle, parent), 2 * (tile_j & 1) + (tile_i & 1), range);
  }
}

std::uint64_t ProceduralField::tile_key(std::uint32_t triangle, std::int32_t i, std::int32_t j) const
{
  return (first_triangle_ + triangle) << 28 | static_cast<std::uint64_t>(i) << 14 | static_cast<std::uint64_t>(j);
}

std::uint64_t ProceduralField::node_key(std::uint32_t triangle, const LatticeNode& node) const
{
  // 2³² triangles would take half a terabyte.
  return (first_triangle_ + triangle) << 32 | static_cast<std::uint64_t>(node.level) << 28 |
         static_cast<std::uint64_t>(node.i) << 14 | static_cast<std::uint64_t>(node.j);
}

HeightTileCache::Pin ProceduralField::tile(std::uint32_t triangle, std::int32_t i, std::int32_t j) const
{
  return cache_.tiles.get(tile_key(triangle, i, j), [&](HeightTile* tile) { make_tile(triangle, i, j, tile); });
}

void ProceduralField::find_children(std::uint32_t triangle, const LatticeNode& node, LatticeRange* out) const
{
  const LatticeTriangle& t = triangles_[triangle];
  const std::int32_t size = kTileCells << (node.level - 1);
  WeightPatches patches;
  bool is_inside[4];
  for (int lane = 0; lane < 8; ++lane) {
    const std::int32_t child_i = 2 * node.i + (lane & 1), child_j = 2 * node.j + (lane >> 1 & 1);
    std::int32_t i0 = child_i * size, j0 = child_j * size;
    const bool inside = i0 + j0 < t.n;
    if (lane < 4) is_inside[lane] = inside;
    std::int32_t i1 = std::min(i0 + size, t.n), j1 = std::min(j0 + size, t.n);
    // Points of a side between two others have heights of these, which may be farther away.
    const auto widen = [&](int side, std::int32_t* low, std::int32_t* high) {
      const std::int32_t step = t.n / t.side_n[side];
      *low = *low / step * step;
      *high = divide_up(*high, step) * step;
    };
    if (inside && child_j == 0) widen(0, &i0, &i1);
    if (inside && child_i == 0) widen(2, &j0, &j1);
    if (inside && i1 + j1 >= t.n - 1) {
      widen(1, &i0, &i1);
      widen(1, &j0, &j1);
    }
    set_patch(t, i0, j0, i1, j1, lane, &patches);
  }
  float low[8], high[8];
  source_.bounds(source_.owner, t.base, patches, low, high);
  const LatticeRange whole = ranges_[triangle];
  for (int child = 0; child < 4; ++child) {
    out[child] = {std::max(low[child] - side_grid_, whole.low), std::min(high[child] + side_grid_, whole.high)};
    if (!is_known({low[child], high[child]})) out[child] = whole;
    if (!is_inside[child]) out[child] = {kNoBound, -kNoBound};
  }
}

void ProceduralField::children(std::uint32_t triangle, const LatticeNode& node, LatticeRange* out) const
{
  const std::uint64_t key = node_key(triangle, node);
  if (cache_.nodes.find(key, out)) return;
  find_children(triangle, node, out);
  cache_.nodes.keep(key, out);
}

}  // namespace relief
