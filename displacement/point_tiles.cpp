#include "displacement/point_tiles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include "displacement/far_ray.h"
#include "displacement/plane_clearance.h"
#include "displacement/shared_edges.h"
#include "kernel/shape/surface_hit.h"

namespace relief {

namespace {

constexpr std::int32_t kCells = PointTile::kCells;
constexpr std::uint32_t kNone = ~0u;

std::int32_t tiles_a_side(std::int32_t n) { return (n - 1) / kCells + 1; }

std::uint64_t num_tiles_of(const LatticeTriangle& part)
{
  const auto side = static_cast<std::uint64_t>(tiles_a_side(part.n));
  return side * (side + 1) / 2;
}

/// Where the point `at` of a part's side, in cells from the corner of that number on, is in its lattice.
std::array<std::int32_t, 2> along_side(std::int32_t n, int side, std::int32_t at)
{
  if (side == 0) return {at, 0};
  if (side == 1) return {n - at, at};
  return {0, n - at};
}

SharedByParts shared(std::vector<std::uint32_t> first)
{
  SharedByParts out;
  out.next.assign(first.size(), kNone);
  std::vector<std::uint32_t> last = first;
  for (std::uint32_t k = 0; k < first.size(); ++k) {
    if (first[k] == k) continue;
    out.next[last[first[k]]] = k;
    last[first[k]] = k;
  }
  out.first = std::move(first);
  return out;
}

Vec3f corner_of(const Vec3f* at, TriangleIndices t, Vec2f weights)
{
  return lattice_corner(weights, at[t.v0], at[t.v1], at[t.v2]);
}

Normal3f corner_of(const Normal3f* at, TriangleIndices t, Vec2f weights)
{
  return as_normal(lattice_corner(weights, as_vector(at[t.v0]), as_vector(at[t.v1]), as_vector(at[t.v2])));
}

}  // namespace

/// A triangle of a tile, and a place on it.
struct PointTiles::MicroTriangle {
  std::uint32_t part;
  std::int32_t at[3][2];  ///< of its vertices, in the part's lattice
  double weight[3];       ///< of the place
};

/// Points of lattices one by one, by the tiles that they are in.
class PointTiles::Points {
 public:
  explicit Points(const PointTiles& tiles) : tiles_(tiles) {}

  Vec3d at(std::uint32_t part, std::int32_t i, std::int32_t j)
  {
    const std::uint32_t wanted = tiles_.tile_of(part, i, j);
    const Tile& from = tiles_.tiles_[wanted];
    return to_double(tile(wanted).point(i - from.i, j - from.j));
  }

 private:
  const PointTile& tile(std::uint32_t wanted)
  {
    for (Held& held : held_) {
      if (held.number == wanted) return held.pin.tile();
    }
    Held& held = held_[next_];
    next_ = (next_ + 1) % kHeld;
    held.pin = {};
    held.pin = tiles_.pin(wanted);
    held.number = wanted;
    return held.pin.tile();
  }

  static constexpr std::size_t kHeld = 4;
  struct Held {
    std::uint32_t number = kNone;
    PointTileCache::Pin pin;
  };
  const PointTiles& tiles_;
  Held held_[kHeld];
  std::size_t next_ = 0;
};

PointTiles::PointTiles(const MeshView& mesh,
                       PointMover mover,
                       std::vector<LatticeTriangle> parts,
                       bool smooth,
                       PointTileCache& cache,
                       std::uint64_t keys)
    : mesh_(mesh),
      mover_(std::move(mover)),
      parts_(std::move(parts)),
      smooth_(smooth && mesh.N != nullptr),
      bounds_(box_empty()),
      cache_(cache),
      keys_(keys)
{
  std::uint64_t count = 0;
  for (const LatticeTriangle& part : parts_) count += num_tiles_of(part);
  if (count >= kNone || parts_.size() >= kNone / 3)
    throw std::length_error("a displaced mesh has more tiles than Embree can count: fewer cells are needed");
  std::vector<Vec3f> P(3 * parts_.size());
  std::vector<Normal3f> N(P.size());
  tbb::parallel_for(std::size_t{0}, P.size(), [&](std::size_t k) {
    const LatticeTriangle& part = parts_[k / 3];
    P[k] = corner_of(mesh_.P, mesh_.triangles[part.base], part.corner[k % 3]);
    if (smooth_ || mover_.along) N[k] = corner_of(mesh_.N, mesh_.triangles[part.base], part.corner[k % 3]);
  });
  corners_ = shared(weld_vertices(P, mover_.along ? N : std::vector<Normal3f>(P.size())));
  sides_ = shared(weld_edges(corners_.first));
  if (smooth_ && !mover_.along) {
    SharedByParts with_normals = shared(weld_vertices(P, N));
    if (with_normals.first != corners_.first) {
      smooth_sides_ = shared(weld_edges(with_normals.first));
      smooth_corners_ = std::move(with_normals);
    }
  }
  tiles_.reserve(count);
  first_tile_.reserve(parts_.size());
  for (std::uint32_t part = 0; part < parts_.size(); ++part) {
    first_tile_.push_back(num_tiles());
    if (!has_area(part)) continue;
    const std::int32_t side = tiles_a_side(parts_[part].n);
    for (std::int32_t y = 0; y < side; ++y) {
      for (std::int32_t x = 0; x + y < side; ++x) tiles_.push_back({part, x * kCells, y * kCells});
    }
  }
  boxes_.resize(tiles_.size());
  using Range = tbb::blocked_range<std::size_t>;
  const auto box_of = [&](const Range& range, Box3 sum) {
    PointTile tile;
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      make(tiles_[k], &tile);
      Box3 box = box_empty();
      for (int at = 0; at < PointTile::kPoints; ++at) {
        const Vec3f point{tile.P[0][at], tile.P[1][at], tile.P[2][at]};
        box = box_union(box, {point, point});
      }
      boxes_[k] = box;
      sum = box_union(sum, box);
    }
    return sum;
  };
  bounds_ = tbb::parallel_reduce(Range(0, tiles_.size()), box_empty(), box_of, box_union);
  if (!tiles_.empty()) pad_ = ray_target_pad(ray_target_make(bounds_));
}

Box3 PointTiles::padded_box(std::uint32_t tile) const
{
  const Box3& box = boxes_[tile];
  const Vec3f size = box.high - box.low;
  // What tests of triangles round: see kRounding in tile_traversal.cpp.
  const Vec3f pad = splat3(pad_ + 0x1p-20f * (size.x + size.y + size.z));
  return {box.low - pad, box.high + pad};
}

PointTileCache::Pin PointTiles::pin(std::uint32_t tile) const
{
  return cache_.get(keys_ + tile, [&](PointTile* out) {
    make(tiles_[tile], out);
    const Tile& at = tiles_[tile];
    point_tile_finish(out, parts_[at.part].n - at.i - at.j);
  });
}

bool PointTiles::has_area(std::uint32_t part) const
{
  const std::uint32_t* const at = corners_.first.data() + 3 * std::size_t{part};
  return at[0] != at[1] && at[1] != at[2] && at[2] != at[0];
}

/// As lattice_weights of moved_mesh.cpp: the points of a lattice along a side that has fewer are the nearest of the side's own.
PointTiles::OnSide PointTiles::on_side(const LatticeTriangle& part, std::int32_t i, std::int32_t j)
{
  const auto on = [&](int side, std::int32_t at) {
    const std::int32_t step = part.n / part.side_n[side];
    return OnSide{side, (at + step / 2) / step};
  };
  if (j == 0) return on(0, i);
  if (i + j == part.n) return on(1, j);
  if (i == 0) return on(2, part.n - j);
  return {};
}

/// Weights of the base triangle's vertices 1 and 2.
Vec2f PointTiles::place(const LatticeTriangle& part, std::int32_t i, std::int32_t j) const
{
  const OnSide on = on_side(part, i, j);
  if (on.side >= 0) {
    const auto [x, y] = along_side(part.n, on.side, on.step * (part.n / part.side_n[on.side]));
    i = x;
    j = y;
  }
  const auto n = static_cast<float>(part.n);
  return part.base_weights(static_cast<float>(i) / n, static_cast<float>(j) / n);
}

PointTiles::Source PointTiles::source(std::uint32_t index, std::int32_t i, std::int32_t j) const
{
  const LatticeTriangle& part = parts_[index];
  const OnSide on = on_side(part, i, j);
  const auto of = [&](std::uint32_t other, std::array<std::int32_t, 2> at) {
    return Source{parts_[other].base, place(parts_[other], at[0], at[1])};
  };
  if (on.side < 0) return of(index, {i, j});
  const std::uint32_t side = 3 * index + static_cast<std::uint32_t>(on.side);
  const std::uint32_t begin = corners_.first[side], end = corners_.first[edge_end(side)];
  // A side without length is one point.
  const std::int32_t count = part.side_n[on.side];
  if (on.step == 0 || on.step == count || begin == end) {
    const std::uint32_t owner = on.step == count ? end : begin;
    return of(owner / 3, along_side(parts_[owner / 3].n, static_cast<int>(owner % 3), 0));
  }
  const std::uint32_t owner = sides_.first[side];
  const LatticeTriangle& other = parts_[owner / 3];
  const int other_side = static_cast<int>(owner % 3);
  // Sides are divided by their ends alone, but for those of parts that cannot be halved again.
  if (owner == side || other.side_n[other_side] != count) return of(index, {i, j});
  const std::int32_t step = corners_.first[owner] == begin ? on.step : count - on.step;
  return of(owner / 3, along_side(other.n, other_side, step * (other.n / count)));
}

/// The points of sources, eight at a time of one triangle.
void PointTiles::eval(const Source* sources, std::size_t count, Vec3f* P) const
{
  for (std::size_t first = 0; first < count;) {
    const std::uint32_t base = sources[first].base;
    std::size_t end = first + 1;
    while (end < count && end < first + 8 && sources[end].base == base) ++end;
    float b[3][8];
    Vec3f P_base[8], moved[8];
    Normal3f N[8];
    for (std::size_t lane = 0; lane < 8; ++lane) {
      const Vec2f w = sources[std::min(first + lane, end - 1)].weights;
      b[0][lane] = static_cast<float>(1.0 - static_cast<double>(w.x) - static_cast<double>(w.y));
      b[1][lane] = w.x;
      b[2][lane] = w.y;
      P_base[lane] = corner_of(mesh_.P, mesh_.triangles[base], w);
      if (mover_.along) N[lane] = corner_of(mesh_.N, mesh_.triangles[base], w);
    }
    mover_.move(base, b, P_base, N, moved);
    for (std::size_t k = first; k < end; ++k) P[k] = moved[k - first];
    first = end;
  }
}

Vec3f PointTiles::point(std::uint32_t part, std::int32_t i, std::int32_t j) const
{
  const Source at = source(part, i, j);
  Vec3f P;
  eval(&at, 1, &P);
  return P;
}

void PointTiles::make(const Tile& at, PointTile* tile) const
{
  const LatticeTriangle& part = parts_[at.part];
  const std::int32_t rows = part.n - at.i - at.j;
  // Those of other triangles last, so that the rest are eight at a time.
  Source sources[PointTile::kPoints];
  std::int32_t places[PointTile::kPoints];
  std::size_t num = 0;
  for (const bool own : {true, false}) {
    for (std::int32_t r = 0; r <= kCells; ++r) {
      for (std::int32_t c = 0; c <= kCells && c + r <= rows; ++c) {
        const Source from = source(at.part, at.i + c, at.j + r);
        if ((from.base == part.base) != own) continue;
        sources[num] = from;
        places[num++] = r * PointTile::kRow + c;
      }
    }
  }
  Vec3f P[PointTile::kPoints];
  eval(sources, num, P);
  for (std::size_t k = 0; k < num; ++k) {
    tile->P[0][places[k]] = P[k].x;
    tile->P[1][places[k]] = P[k].y;
    tile->P[2][places[k]] = P[k].z;
  }
  for (std::int32_t r = 0; r <= kCells; ++r) {
    for (std::int32_t c = std::max(rows - r + 1, 0); c <= kCells; ++c) {
      const std::int32_t to = r * PointTile::kRow + c, from = c > 0 ? to - 1 : to - PointTile::kRow;
      for (auto& axis : tile->P) axis[to] = axis[from];
    }
  }
}

std::uint32_t PointTiles::tile_of(std::uint32_t part, std::int32_t i, std::int32_t j) const
{
  const std::int32_t side = tiles_a_side(parts_[part].n);
  std::int32_t x = std::min(i / kCells, side - 1), y = std::min(j / kCells, side - 1);
  // Where the third side meets corners of tiles.
  if (x + y == side) --(x > 0 && i == kCells * x ? x : y);
  return first_tile_[part] + static_cast<std::uint32_t>(y * side - y * (y - 1) / 2 + x);
}

PointTiles::MicroTriangle PointTiles::micro_triangle(std::uint32_t tile, EmbreeHitRecord record) const
{
  const Tile& from = tiles_[tile];
  const int number = static_cast<int>(record.Ng_x), cell = number / 2;
  const std::int32_t i = from.i + cell % kCells, j = from.j + cell / kCells, second = number % 2;
  const double u = static_cast<double>(record.u), v = static_cast<double>(record.v);
  return {from.part,
          {{i + second, j + second}, {second == 0 ? i + 1 : i, j + second}, {i + second, second == 0 ? j + 1 : j}},
          {1 - u - v, u, v}};
}

DisplacedPoint PointTiles::locate(std::uint32_t tile, EmbreeHitRecord record) const
{
  const MicroTriangle micro = micro_triangle(tile, record);
  const LatticeTriangle& part = parts_[micro.part];
  double b1 = 0, b2 = 0;
  for (int k = 0; k < 3; ++k) {
    const Vec2f w = place(part, micro.at[k][0], micro.at[k][1]);
    b1 += micro.weight[k] * static_cast<double>(w.x);
    b2 += micro.weight[k] * static_cast<double>(w.y);
  }
  return {part.base, static_cast<float>(b1), static_cast<float>(b2)};
}

/// Calls visit(a, b, c) with the triangles of a part that have a point of its lattice.
template <class Visit>
void PointTiles::visit_part(Points& points, std::uint32_t part, std::int32_t i, std::int32_t j, const Visit& visit)
    const
{
  if (!has_area(part)) return;
  const std::int32_t n = parts_[part].n;
  constexpr int kAround[6][2] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
  Vec3d around[6];
  const auto is_there = [&](int k) {
    const std::int32_t x = i + kAround[k][0], y = j + kAround[k][1];
    return x >= 0 && y >= 0 && x + y <= n;
  };
  bool there[6];
  for (int k = 0; k < 6; ++k) {
    there[k] = is_there(k);
    if (there[k]) around[k] = points.at(part, i + kAround[k][0], j + kAround[k][1]);
  }
  const Vec3d P = points.at(part, i, j);
  for (int k = 0; k < 6; ++k) {
    const int next = (k + 1) % 6;
    if (!there[k] || !there[next]) continue;
    // From the first vertex that the triangle has, whichever is asked for: what has hardly any area has one normal then.
    if (k < 2) {
      visit(P, around[k], around[next]);
    } else if (k < 4) {
      visit(around[next], P, around[k]);
    } else {
      visit(around[k], around[next], P);
    }
  }
}

/// The same with all parts that have the point. In one order, whichever of them asks.
template <class Visit>
void PointTiles::visit_around(Points& points,
                              const SharedByParts& corners,
                              const SharedByParts& sides,
                              std::uint32_t index,
                              std::int32_t i,
                              std::int32_t j,
                              const Visit& visit) const
{
  const LatticeTriangle& part = parts_[index];
  const OnSide on = on_side(part, i, j);
  if (on.side < 0) return visit_part(points, index, i, j, visit);
  // Those points of a side that are the step of its own.
  const auto visit_step = [&](std::uint32_t side, std::int32_t step) {
    const LatticeTriangle& there = parts_[side / 3];
    const int k = static_cast<int>(side % 3);
    const std::int32_t width = there.n / there.side_n[k], begin = step * width - width / 2;
    for (std::int32_t at = std::max(begin, 0); at < begin + width && at <= there.n; ++at) {
      const auto [x, y] = along_side(there.n, k, at);
      visit_part(points, side / 3, x, y, visit);
    }
  };
  const std::uint32_t side = 3 * index + static_cast<std::uint32_t>(on.side);
  const std::int32_t count = part.side_n[on.side];
  if (on.step == 0 || on.step == count) {
    for (std::uint32_t k = corners.first[on.step == 0 ? side : edge_end(side)]; k != kNone; k = corners.next[k]) {
      visit_step(k, 0);
      // Along the side that ends there, but for the corner.
      const std::uint32_t before = k % 3 == 0 ? k + 2 : k - 1;
      const LatticeTriangle& there = parts_[k / 3];
      const std::int32_t width = there.n / there.side_n[before % 3];
      for (std::int32_t at = there.n - width / 2; at < there.n; ++at) {
        const auto [x, y] = along_side(there.n, static_cast<int>(before % 3), at);
        visit_part(points, k / 3, x, y, visit);
      }
    }
    return;
  }
  const std::uint32_t begin = corners.first[side];
  for (std::uint32_t k = sides.first[side]; k != kNone; k = sides.next[k]) {
    if (parts_[k / 3].side_n[k % 3] != count) continue;
    visit_step(k, corners.first[k] == begin ? on.step : count - on.step);
  }
}

/// The mean of the unit normals of the triangles around a point; as smooth_normals of moved_mesh.cpp.
Vec3d PointTiles::smooth_normal(Points& points, std::uint32_t part, std::int32_t i, std::int32_t j) const
{
  const bool same = smooth_corners_.first.empty();
  Vec3d sum{};
  visit_around(points, same ? corners_ : smooth_corners_, same ? sides_ : smooth_sides_, part, i, j,
               [&](Vec3d a, Vec3d b, Vec3d c) {
                 const Vec3d normal = cross(b - a, c - a);
                 const double size = length(normal);
                 if (size > 0) sum = sum + normal * (1 / size);
               });
  const double size = length(sum);
  if (size > 0) return sum * (1 / size);
  const TriangleIndices& t = mesh_.triangles[parts_[part].base];
  const Vec3d N = to_double(as_vector(corner_of(mesh_.N, t, place(parts_[part], i, j))));
  return N * (1 / std::max(length(N), 1e-300));
}

DisplacedPoint PointTiles::resolve(const InstanceView& placement, std::uint32_t tile, EmbreeHitRecord record) const
{
  const MicroTriangle micro = micro_triangle(tile, record);
  DisplacedPoint out = locate(tile, record);
  Points points(*this);
  Vec3d P[3], at{};
  for (int k = 0; k < 3; ++k) {
    P[k] = points.at(micro.part, micro.at[k][0], micro.at[k][1]);
    at = at + micro.weight[k] * P[k];
  }
  const Vec3d normal = cross(P[1] - P[0], P[2] - P[0]);
  const double double_area = length(normal);
  const Vec3d Ng = normal * (1 / std::max(double_area, 1e-300));
  out.P = to_float(at);
  out.Ng = out.Ns = to_float(Ng);
  if (smooth_) {
    Vec3d N[3], Ns{};
    for (int k = 0; k < 3; ++k) {
      N[k] = smooth_normal(points, micro.part, micro.at[k][0], micro.at[k][1]);
      Ns = Ns + micro.weight[k] * N[k];
    }
    // As on plain meshes, like what follows.
    constexpr double kCancelled = 1e-6;
    if (length(Ns) > kCancelled) out.Ns = to_float(Ns * (1 / length(Ns)));
    const auto edge = [&](int k) { return transform_vector(placement.world_from_object, to_float(P[k] - P[0])); };
    const auto N_world = [&](int k) {
      return normalize(transform_normal(placement.object_from_world, as_normal(to_float(N[k]))));
    };
    const auto weight = [&](int k) { return static_cast<float>(micro.weight[k]); };
    const Vec3f N0 = N_world(0), N1 = N_world(1), N2 = N_world(2);
    const LiftHeights<float> lift = triangle_lift(weight(0), weight(1), weight(2), edge(1), edge(2), N0, N1, N2);
    out.lift = {weight(0) * N0 + weight(1) * N1 + weight(2) * N2, lift.front, lift.back};
  }
  // Rays that leave from beside a side of the triangle start clear of those around it, as Tessellation::leave has it.
  const LeavingErrors errors = leaving_errors(placement, out.P, out.Ng);
  const double reach = 2 * length(errors.reach);
  double side_distance = static_cast<double>(kInfinity), longest = 0;
  for (int k = 0; k < 3; ++k) {
    const double side = length(P[(k + 2) % 3] - P[(k + 1) % 3]);
    longest = std::max(longest, side);
    side_distance = std::min(side_distance, micro.weight[k] * double_area / std::max(side, 1e-300));
  }
  if (!(side_distance <= reach) || !(reach < kMostSidesAround * longest)) return out;
  NearPlanes around{at, errors.error, reach, {}};
  for (int k = 0; k < 3; ++k) {
    visit_around(points, corners_, sides_, micro.part, micro.at[k][0], micro.at[k][1],
                 [&](Vec3d a, Vec3d b, Vec3d c) { around.add(1, a, b, c); });
  }
  out.leave = to_float(planes_leave(around.planes, Ng));
  return out;
}

std::size_t PointTiles::bytes() const
{
  std::size_t sum = parts_.size() * sizeof(LatticeTriangle) + first_tile_.size() * sizeof(std::uint32_t) +
                    tiles_.size() * (sizeof(Tile) + sizeof(Box3));
  for (const SharedByParts* shared : {&corners_, &sides_, &smooth_corners_, &smooth_sides_})
    sum += (shared->first.size() + shared->next.size()) * sizeof(std::uint32_t);
  return sum;
}

std::uint64_t PointTiles::bytes(std::span<const LatticeTriangle> parts)
{
  // While they are made; of the tree 110 bytes a tile were measured.
  constexpr std::uint64_t kPart =
      sizeof(LatticeTriangle) + 3 * (sizeof(Vec3f) + sizeof(Normal3f)) + 24 * sizeof(std::uint32_t);
  constexpr std::uint64_t kTile = sizeof(Tile) + sizeof(Box3) + 200;
  std::uint64_t tiles = 0;
  for (const LatticeTriangle& part : parts) tiles += num_tiles_of(part);
  return parts.size() * kPart + tiles * kTile;
}

}  // namespace relief
