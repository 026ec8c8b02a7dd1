// Smits, Shirley and Stark 2000, "Direct Ray Tracing of Displacement Mapped Triangles", as published, to be measured: N² flat
// micro-triangles over a base triangle, met by marching from cell to cell of its barycentric grid.
//
// A ray enters and leaves the volume {p + h·n} by its triangular caps and bilinear sides. From a cell it goes on through the side
// that the line c + s·n_c at the vertex ahead tells (their Fig. 7). Where a side is met twice the march starts again at the second
// entry (their section 3.3). That cells do not bound their micro-triangles, so that some are passed over, is theirs.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace relief {

template <class Real>
struct MarchVector {
  Real x = 0, y = 0, z = 0;
};
template <class Real>
MarchVector<Real> operator+(MarchVector<Real> a, MarchVector<Real> b)
{
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class Real>
MarchVector<Real> operator-(MarchVector<Real> a, MarchVector<Real> b)
{
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class Real>
MarchVector<Real> operator*(MarchVector<Real> a, Real s)
{
  return {a.x * s, a.y * s, a.z * s};
}
template <class Real>
Real dot(MarchVector<Real> a, MarchVector<Real> b)
{
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class Real>
MarchVector<Real> cross(MarchVector<Real> a, MarchVector<Real> b)
{
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// A base triangle with heights at the points of its grid.
struct MarchedTriangle {
  std::array<std::array<double, 3>, 3> P, N;
  int n = 1;                 ///< cells along a side
  std::vector<float> h;      ///< at (i, j, k), i + j + k = n: place j · (n + 1) + k
  double low = 0, high = 0;  ///< of the heights
};

/// Where a march ended.
struct MarchHit {
  bool hit = false;
  double t = 0;
  int num_cells = 0;
};

/// A triangle in one precision.
template <class Real>
class MicrotriangleMarch {
 public:
  using Vector = MarchVector<Real>;

  explicit MicrotriangleMarch(const MarchedTriangle& triangle) : triangle_(triangle), n_(triangle.n)
  {
    for (std::size_t k = 0; k < 3; ++k) {
      P_[k] = {static_cast<Real>(triangle.P[k][0]), static_cast<Real>(triangle.P[k][1]),
               static_cast<Real>(triangle.P[k][2])};
      N_[k] = {static_cast<Real>(triangle.N[k][0]), static_cast<Real>(triangle.N[k][1]),
               static_cast<Real>(triangle.N[k][2])};
    }
  }

  /// As published.
  MarchHit march(Vector O, Vector D) const
  {
    const std::vector<Crossing> crossings = volume(O, D);
    MarchHit out;
    for (std::size_t k = 0; k + 1 < crossings.size(); k += 2) {
      if (crossings[k + 1].t < Real{0}) continue;
      if (interval(O, D, crossings[k], crossings[k + 1], &out)) return out;
    }
    return out;
  }

  /// Every micro-triangle.
  MarchHit brute_force(Vector O, Vector D) const
  {
    MarchHit out;
    for (int j = 0; j < n_; ++j) {
      for (int k = 0; j + k < n_; ++k) {
        const int i = n_ - 1 - j - k;
        test(O, D, {i + 1, j, k}, {i, j + 1, k}, {i, j, k + 1}, &out);
        if (i > 0) test(O, D, {i - 1, j + 1, k + 1}, {i, j, k + 1}, {i, j + 1, k}, &out);
      }
    }
    return out;
  }

 private:
  using Place = std::array<int, 3>;
  /// Of the ray with the volume's border.
  struct Crossing {
    Real t;
    std::array<Real, 3> b;
    int side;  ///< whose barycentric coordinate is 0; −1: a cap
  };

  Vector base(const Place& at, const Vector* of) const
  {
    const Real d = Real{1} / static_cast<Real>(n_);
    return of[0] * (static_cast<Real>(at[0]) * d) + of[1] * (static_cast<Real>(at[1]) * d) +
           of[2] * (static_cast<Real>(at[2]) * d);
  }
  Vector vertex(const Place& at) const
  {
    const auto h = static_cast<Real>(triangle_.h[static_cast<std::size_t>(at[1] * (n_ + 1) + at[2])]);
    return base(at, P_) + base(at, N_) * h;
  }

  /// The triangle and a whole line. Möller and Trumbore 1997.
  static bool meets(Vector O, Vector D, Vector a, Vector b, Vector c, Real* t, Real* u, Real* v)
  {
    const Vector e1 = b - a, e2 = c - a, p = cross(D, e2);
    const Real determinant = dot(e1, p);
    if (determinant == Real{0}) return false;
    const Vector s = O - a;
    *u = dot(s, p) / determinant;
    if (!(*u >= Real{0} && *u <= Real{1})) return false;
    const Vector q = cross(s, e1);
    *v = dot(D, q) / determinant;
    if (!(*v >= Real{0} && *u + *v <= Real{1})) return false;
    *t = dot(e2, q) / determinant;
    return true;
  }

  bool test(Vector O, Vector D, const Place& a, const Place& b, const Place& c, MarchHit* out) const
  {
    Real t, u, v;
    if (!meets(O, D, vertex(a), vertex(b), vertex(c), &t, &u, &v) || !(t >= Real{0})) return false;
    if (out->hit && out->t <= static_cast<double>(t)) return true;
    out->hit = true;
    out->t = static_cast<double>(t);
    return true;
  }

  /// The line a + s·na to b + s·nb as it moves with s meets the ray where (D, a − O, na …) are in one plane: quadratic in s.
  void side_crossings(Vector O, Vector D, int k, std::vector<Crossing>* out) const
  {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const Vector a = P_[i] - O, b = P_[j] - O, na = N_[i], nb = N_[j];
    // D · (a + s·na) × (b + s·nb) = 0.
    const Real c0 = dot(D, cross(a, b)), c1 = dot(D, cross(a, nb) + cross(na, b)), c2 = dot(D, cross(na, nb));
    Real roots[2];
    int count = 0;
    if (c2 == Real{0}) {
      if (c1 != Real{0}) roots[count++] = -c0 / c1;
    } else {
      const Real discriminant = c1 * c1 - Real{4} * c0 * c2;
      if (discriminant < Real{0}) return;
      const Real q = Real{-0.5} * (c1 + std::copysign(std::sqrt(discriminant), c1));
      roots[count++] = q / c2;
      if (q != Real{0}) roots[count++] = c0 / q;
    }
    for (int r = 0; r < count; ++r) {
      const Real s = roots[r];
      if (!(s >= static_cast<Real>(triangle_.low) && s <= static_cast<Real>(triangle_.high))) continue;
      const Vector from = a + na * s, along = (b + nb * s) - from;
      // O + tD = from + u·along, both seen across the plane of D and along.
      const Vector normal = cross(D, along), other = cross(normal, D);
      const Real u = -dot(from, other) / dot(along, other);
      if (!(u >= Real{0} && u <= Real{1})) continue;
      const Vector at = from + along * u;
      Crossing crossing{dot(at, D) / dot(D, D), {}, k};
      crossing.b[static_cast<std::size_t>(i)] = Real{1} - u;
      crossing.b[static_cast<std::size_t>(j)] = u;
      out->push_back(crossing);
    }
  }

  /// Of the whole line: a ray that starts within the volume has entered it before.
  std::vector<Crossing> volume(Vector O, Vector D) const
  {
    std::vector<Crossing> all;
    for (int k = 0; k < 3; ++k) side_crossings(O, D, k, &all);
    for (const double h : {triangle_.low, triangle_.high}) {
      const auto s = static_cast<Real>(h);
      Real t, u, v;
      if (meets(O, D, P_[0] + N_[0] * s, P_[1] + N_[1] * s, P_[2] + N_[2] * s, &t, &u, &v))
        all.push_back({t, {Real{1} - u - v, u, v}, -1});
    }
    std::sort(all.begin(), all.end(), [](const Crossing& a, const Crossing& b) { return a.t < b.t; });
    return all;
  }

  /// The cell of a crossing: two of three places add up to n − 1 in a lower one, to n − 2 in an upper one.
  Place cell_of(const Crossing& crossing) const
  {
    Place cell;
    for (std::size_t k = 0; k < 3; ++k) {
      cell[k] = std::clamp(static_cast<int>(std::floor(crossing.b[k] * static_cast<Real>(n_))), 0, n_ - 1);
    }
    if (crossing.side >= 0) {
      // On a side all cells are lower ones, and begin at 0.
      const auto k = static_cast<std::size_t>(crossing.side), i = (k + 1) % 3, j = (k + 2) % 3;
      cell[k] = 0;
      cell[j] = n_ - 1 - cell[i];
      return cell;
    }
    while (cell[0] + cell[1] + cell[2] > n_ - 1) --*std::max_element(cell.begin(), cell.end());
    while (cell[0] + cell[1] + cell[2] < n_ - 2) ++*std::min_element(cell.begin(), cell.end());
    return cell;
  }
  bool is_lower(const Place& cell) const { return cell[0] + cell[1] + cell[2] == n_ - 1; }
  /// The vertex of a cell that is opposite to the side along which coordinate m is constant.
  Place vertex_of(const Place& cell, std::size_t m) const
  {
    Place at = cell;
    if (is_lower(cell)) {
      ++at[m];
    } else {
      ++at[(m + 1) % 3];
      ++at[(m + 2) % 3];
    }
    return at;
  }
  /// On which side of the line through a grid point along its normal the ray passes.
  bool is_right(Vector O, Vector D, const Place& at) const
  {
    return dot(cross(base(at, N_), O - base(at, P_)), D) > Real{0};
  }

  /// The side of a cell by which the ray came, where it came by a cap: either of the two that it does not leave by.
  std::size_t entry_side(Vector O, Vector D, const Place& cell, const Crossing& to) const
  {
    // Towards the end of the interval coordinates change: those that fall most leave by their side in a lower cell.
    std::size_t best = 0;
    Real most = -std::numeric_limits<Real>::max();
    bool right[3];
    for (std::size_t m = 0; m < 3; ++m) right[m] = is_right(O, D, vertex_of(cell, m));
    for (std::size_t m = 0; m < 3; ++m) {
      // The ray passes a side between vertices that it has to its left and its right.
      if (right[(m + 1) % 3] == right[(m + 2) % 3]) continue;
      const Real change = to.b[m] * static_cast<Real>(n_) - static_cast<Real>(cell[m]);
      const Real away = is_lower(cell) ? change : -change;
      if (away > most) {
        most = away;
        best = m;
      }
    }
    return best;
  }

  bool interval(Vector O, Vector D, const Crossing& from, const Crossing& to, MarchHit* out) const
  {
    Place cell = cell_of(from);
    const Place end = cell_of(to);
    std::size_t entered = from.side >= 0 ? static_cast<std::size_t>(from.side) : entry_side(O, D, cell, to);
    for (int step = 0; step <= 4 * n_; ++step) {
      ++out->num_cells;
      if (test(O, D, vertex_of(cell, 0), vertex_of(cell, 1), vertex_of(cell, 2), out)) return true;
      if (cell == end) return false;
      const std::size_t a = (entered + 1) % 3, b = (entered + 2) % 3;
      // Between the vertex ahead and the one on the ray's other side.
      const bool right = is_right(O, D, vertex_of(cell, entered));
      const std::size_t leaves = right == is_right(O, D, vertex_of(cell, a)) ? a : b;
      cell[leaves] += is_lower(cell) ? -1 : 1;
      if (cell[leaves] < 0 || cell[leaves] >= n_) return false;
      entered = leaves;
    }
    return false;
  }

  const MarchedTriangle& triangle_;
  int n_;
  Vector P_[3], N_[3];
};

}  // namespace relief
