#include "displacement/lattice_split.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "displacement/vec3d.h"

namespace relief {

namespace {

/// Weights then have at most 14 + 8 bits, and are exact in single precision.
constexpr int kMostHalvings = 14;

/// Counts parts, and asks for room from time to time.
class PartCount {
 public:
  explicit PartCount(const RequireBytes& require) : require_(require) {}
  void add()
  {
    // Itself, once more where all are put together, its triangle, and what Embree's tree has of it.
    constexpr std::uint64_t kPartBytes = 350, kStep = 1 << 14;
    if ((num_.fetch_add(1, std::memory_order_relaxed) + 1) % kStep == 0 && require_) require_(kPartBytes * num_);
  }

 private:
  const RequireBytes& require_;
  std::atomic<std::uint64_t> num_{0};
};

/// Triangles whose sides are long are cut into two, three or four.
class Splitter {
 public:
  Splitter(const MeshView& mesh,
           std::uint32_t base,
           const CellsAlong& cells,
           double most_cells,
           PartCount& count,
           std::vector<LatticeTriangle>* out)
      : base_(base), cells_(cells), most_cells_(most_cells), count_(count), out_(out)
  {
    const TriangleIndices& v = mesh.triangles[base];
    P_[0] = mesh.P[v.v0];
    P_[1] = mesh.P[v.v1];
    P_[2] = mesh.P[v.v2];
  }

  void split(Vec2f a, Vec2f b, Vec2f c, int halvings)
  {
    const Vec2f corner[3] = {a, b, c};
    double cells[3];
    int num_long = 0;
    for (int k = 0; k < 3; ++k) {
      const Vec2f from = corner[k], to = corner[(k + 1) % 3];
      cells[k] = std::min(cells_(at(from), at(to)), most_cells_ * part_of_side(from, to));
      if (cells[k] > kMostLatticeCells && halvings < kMostHalvings) ++num_long;
    }
    if (num_long == 0) {
      add(corner, cells);
      return;
    }
    const auto is_long = [&](int k) { return cells[k] > kMostLatticeCells; };
    const auto middle = [&](int k) { return 0.5f * (corner[k] + corner[(k + 1) % 3]); };
    const int next = halvings + 1;
    if (num_long == 3) {
      const Vec2f ab = middle(0), bc = middle(1), ca = middle(2);
      split(a, ab, ca, next);
      split(ab, b, bc, next);
      split(ca, bc, c, next);
      split(bc, ca, ab, next);
      return;
    }
    // Side 0 is long, and with two of them side 1 is too.
    int first = 0;
    while (!is_long(first) || (num_long == 2 && !is_long((first + 1) % 3))) ++first;
    const Vec2f p = corner[first], q = corner[(first + 1) % 3], r = corner[(first + 2) % 3], pq = middle(first);
    if (num_long == 1) {
      split(p, pq, r, next);
      split(pq, q, r, next);
      return;
    }
    const Vec2f qr = middle((first + 1) % 3);
    split(pq, q, qr, next);
    split(p, pq, qr, next);
    split(p, qr, r, next);
  }

 private:
  Vec3f at(Vec2f weights) const { return lattice_corner(weights, P_[0], P_[1], P_[2]); }
  /// How much of a triangle's side a line is: exact where it lies on one, so both triangles agree.
  static double part_of_side(Vec2f from, Vec2f to)
  {
    const double x = static_cast<double>(to.x) - static_cast<double>(from.x);
    const double y = static_cast<double>(to.y) - static_cast<double>(from.y);
    return std::max({std::abs(x), std::abs(y), std::abs(x + y)});
  }

  void add(const Vec2f* corner, const double* cells)
  {
    LatticeTriangle t;
    t.base = base_;
    for (int k = 0; k < 3; ++k) {
      t.corner[k] = corner[k];
      t.side_n[k] = 1;
      while (t.side_n[k] < cells[k] && t.side_n[k] < kMostLatticeCells) t.side_n[k] *= 2;
      t.n = std::max(t.n, t.side_n[k]);
    }
    count_.add();
    out_->push_back(t);
  }

  std::uint32_t base_;
  const CellsAlong& cells_;
  double most_cells_;
  PartCount& count_;
  std::vector<LatticeTriangle>* out_;
  Vec3f P_[3];
};

}  // namespace

std::vector<LatticeTriangle> lattices_make(const MeshView& mesh, std::int32_t n)
{
  std::vector<LatticeTriangle> out(mesh.num_triangles);
  for (std::uint32_t base = 0; base < mesh.num_triangles; ++base) {
    LatticeTriangle& t = out[base];
    t.base = base;
    t.n = n;
    std::fill_n(t.side_n, 3, n);
  }
  return out;
}

std::vector<LatticeTriangle> lattices_make(const MeshView& mesh,
                                           const CellsAlong& cells,
                                           const RequireBytes& require,
                                           std::int32_t most_cells)
{
  const double most = most_cells > 0 ? most_cells : HUGE_VAL;
  PartCount count(require);
  // In pieces, so that the order does not depend on the threads.
  constexpr std::size_t kPiece = 1024;
  std::vector<std::vector<LatticeTriangle>> pieces((mesh.num_triangles + kPiece - 1) / kPiece);
  tbb::parallel_for(std::size_t{0}, pieces.size(), [&](std::size_t piece) {
    const std::size_t end = std::min<std::size_t>((piece + 1) * kPiece, mesh.num_triangles);
    for (std::size_t base = piece * kPiece; base < end; ++base) {
      Splitter(mesh, static_cast<std::uint32_t>(base), cells, most, count, &pieces[piece])
          .split({0, 0}, {1, 0}, {0, 1}, 0);
    }
  });
  std::vector<LatticeTriangle> out;
  for (const auto& piece : pieces) out.insert(out.end(), piece.begin(), piece.end());
  return out;
}

Vec3f lattice_corner(Vec2f weights, Vec3f v0, Vec3f v1, Vec3f v2)
{
  // On a side one weight is zero and the others' products are exact: one rounding, in whichever order.
  const double x = weights.x, y = weights.y;
  return to_float((1.0 - x - y) * to_double(v0) + x * to_double(v1) + y * to_double(v2));
}

}  // namespace relief
