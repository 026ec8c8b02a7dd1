#include "displacement/curved_heights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace relief {

namespace {

int next(int k) { return k == 2 ? 0 : k + 1; }

bool comes_before(Vec3d a, Vec3d b) { return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z); }

/// Numbers from low to high, rounded as they come: some more room is left in the end.
struct Range {
  double low, high;
};
Range operator+(Range a, Range b) { return {a.low + b.low, a.high + b.high}; }
Range operator-(Range a, Range b) { return {a.low - b.high, a.high - b.low}; }
Range operator*(Range a, Range b)
{
  const auto [low, high] = std::minmax({a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high});
  return {low, high};
}
Range operator/(Range a, Range b)
{
  if (!(b.low > 0) && !(b.high < 0)) return {-HUGE_VAL, HUGE_VAL};
  return a * Range{1 / b.high, 1 / b.low};
}
Range hull(Range a, Range b) { return {std::min(a.low, b.low), std::max(a.high, b.high)}; }
Range squared(Range a)
{
  const double most = std::max(a.low * a.low, a.high * a.high);
  return {a.low <= 0 && a.high >= 0 ? 0 : std::min(a.low * a.low, a.high * a.high), most};
}

struct RangeVec {
  Range x, y, z;
};
RangeVec operator+(RangeVec a, RangeVec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
RangeVec operator-(RangeVec a, RangeVec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
RangeVec operator*(RangeVec a, Range k) { return {a.x * k, a.y * k, a.z * k}; }
Range dot(RangeVec a, RangeVec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Range squared(RangeVec a) { return squared(a.x) + squared(a.y) + squared(a.z); }
RangeVec exactly(Vec3d a) { return {{a.x, a.x}, {a.y, a.y}, {a.z, a.z}}; }
/// Between two vectors, part of the way.
RangeVec between(Vec3d a, Vec3d b, Range t) { return exactly(a) + exactly(b - a) * t; }

/// Cubic with values 0 at both ends and slopes m0 and m1 there.
double hermite(double m0, double m1, double t) { return t * (1 - t) * (m0 * (1 - t) - m1 * t); }
double hermite_slope(double m0, double m1, double t) { return m0 * (1 - t) * (1 - 3 * t) + m1 * t * (3 * t - 2); }

/// Slope into the triangle, towards the vertex opposite to a side, at a point of the side. The same text for numbers and for
/// ranges, whose squares and quotients differ.
template <class Vector, class Number>
Number slope_across(Vector P, Vector N, Vector e, Vector dN, Number h, Number dh, Vector P_i, Vector N_i)
{
  const Vector T = e + N * dh + dN * h;
  Number T_squared, N_squared;
  if constexpr (std::is_same_v<Number, double>) {
    T_squared = dot(T, T);
    N_squared = dot(N, N);
  } else {
    T_squared = squared(T);
    N_squared = squared(N);
  }
  const Number part = dot(N, T) / T_squared;
  const Vector across = N - T * part;
  return Number{} - (dot(across, P_i - P) + h * dot(across, N_i - N)) / (N_squared - part * dot(N, T));
}

}  // namespace

CurvedTriangle::CurvedTriangle(const Vec3f* P, const Vec3f* N)
{
  for (int k = 0; k < 3; ++k) {
    P_[k] = to_double(P[k]);
    N_[k] = to_double(N[k]);
  }
}

/// Slope of h at vertex i in the direction of vertex j, which makes S perpendicular to the normal at i.
double CurvedTriangle::toward(int i, int j) const { return -dot(P_[j] - P_[i], N_[i]) / dot(N_[i], N_[i]); }

/// h on the side from vertex j to the next.
double CurvedTriangle::side_height(int j, double t) const
{
  const int k = next(j);
  // From the end that comes first, so that rounding is the same either way.
  if (comes_before(P_[k], P_[j])) return hermite(toward(k, j), -toward(j, k), 1 - t);
  return hermite(toward(j, k), -toward(k, j), t);
}

double CurvedTriangle::side_slope(int j, double t) const
{
  const int k = next(j);
  return hermite_slope(toward(j, k), -toward(k, j), t);
}

/// h along the line from vertex i to a point of the opposite side, at that point: its slope, from i on.
double CurvedTriangle::slope_from(int i, double t) const
{
  const int j = next(i), k = next(j);
  const Vec3d dN = N_[k] - N_[j], e = P_[k] - P_[j];
  return -slope_across<Vec3d, double>(P_[j] + t * e, N_[j] + t * dN, e, dN, side_height(j, t), side_slope(j, t), P_[i],
                                      N_[i]);
}

double CurvedTriangle::displacement(const double* b) const
{
  double h = 0, sum = 0;
  for (int side = 0; side < 3; ++side) {
    // The side from j to k, opposite to i.
    const int i = side, j = next(i), k = next(j);
    if (b[i] != 0) continue;
    const double length_j = b[j], length_k = b[k];
    const Vec3d N =
        comes_before(P_[j], P_[k]) ? N_[j] * length_j + N_[k] * length_k : N_[k] * length_k + N_[j] * length_j;
    return side_height(j, length_k / (length_j + length_k)) * length(N);
  }
  for (int i = 0; i < 3; ++i) {
    const int j = next(i), k = next(j);
    const double weight = b[j] * b[j] * b[k] * b[k], t = b[k] / (b[j] + b[k]), r = 1 - b[i];
    if (!(weight > 0)) continue;
    const double m0 = (1 - t) * toward(i, j) + t * toward(i, k), m1 = slope_from(i, t), end = side_height(j, t);
    // Hermite from 0 to `end`.
    h += weight * (end * r * r * (3 - 2 * r) + hermite(m0, m1, r));
    sum += weight;
  }
  const Vec3d N = b[0] * N_[0] + b[1] * N_[1] + b[2] * N_[2];
  return sum > 0 ? h / sum * length(N) : 0.0;
}

WeightSlopes CurvedTriangle::slopes(double b1, double b2) const
{
  // By points towards the two vertices that are farthest, which are within the triangle wherever this one is.
  constexpr double kStep = 1e-4;
  const double b[3] = {1 - b1 - b2, b1, b2};
  const int nearest = static_cast<int>(std::max_element(b, b + 3) - b);
  const int ends[2] = {next(nearest), next(next(nearest))};
  double change[2];
  for (int k = 0; k < 2; ++k) {
    const auto at = [&](double part) {
      double w[3];
      for (int i = 0; i < 3; ++i) w[i] = b[i] + part * ((i == ends[k] ? 1.0 : 0.0) - b[i]);
      return displacement(w);
    };
    change[k] = (4 * at(kStep) - 3 * at(0) - at(2 * kStep)) / (2 * kStep);
  }
  const auto towards = [&](int k) {
    return WeightSlopes{(ends[k] == 1 ? 1.0 : 0.0) - b1, (ends[k] == 2 ? 1.0 : 0.0) - b2};
  };
  const WeightSlopes s = towards(0), t = towards(1);
  const double inverse = 1 / (s.b1 * t.b2 - s.b2 * t.b1);
  return {(change[0] * t.b2 - change[1] * s.b2) * inverse, (change[1] * s.b1 - change[0] * t.b1) * inverse};
}

void CurvedTriangle::bounds(double* low, double* high) const
{
  // Blends are convex, and so are the Bernstein forms of the cubics: what these are made of bounds h.
  Range h{0, 0};
  constexpr int kPieces = 16;
  double longest = 0;
  for (int i = 0; i < 3; ++i) {
    const int j = next(i), k = next(j);
    longest = std::max(longest, length(N_[i]));
    for (const double start : {toward(i, j), toward(i, k)}) h = hull(h, {start / 3, start / 3});
    const double m0 = toward(j, k), m1 = -toward(k, j);
    for (int piece = 0; piece < kPieces; ++piece) {
      const Range t{static_cast<double>(piece) / kPieces, static_cast<double>(piece + 1) / kPieces};
      const Range left = Range{1, 1} - t;
      const Range end = t * left * (Range{m0, m0} * left - Range{m1, m1} * t);
      const Range slope =
          Range{m0, m0} * left * (Range{1, 1} - Range{3, 3} * t) + Range{m1, m1} * t * (Range{3, 3} * t - Range{2, 2});
      const Range across =
          slope_across<RangeVec, Range>(between(P_[j], P_[k], t), between(N_[j], N_[k], t), exactly(P_[k] - P_[j]),
                                        exactly(N_[k] - N_[j]), end, slope, exactly(P_[i]), exactly(N_[i]));
      h = hull(h, hull(end, end + across * Range{1.0 / 3, 1.0 / 3}));
    }
  }
  const double pad = 1e-9 * std::max(std::abs(h.low), std::abs(h.high)) * longest;
  *low = std::min(h.low * longest, 0.0) - pad;
  *high = std::max(h.high * longest, 0.0) + pad;
  if (!std::isfinite(*low) || !std::isfinite(*high)) {
    *low = -std::numeric_limits<double>::infinity();
    *high = -*low;
  }
}

namespace {

CurvedTriangle curved_triangle(const MeshView& mesh, std::uint32_t triangle)
{
  const TriangleIndices& v = mesh.triangles[triangle];
  const Vec3f P[3] = {mesh.P[v.v0], mesh.P[v.v1], mesh.P[v.v2]};
  const Vec3f N[3] = {as_vector(mesh.N[v.v0]), as_vector(mesh.N[v.v1]), as_vector(mesh.N[v.v2])};
  return {P, N};
}

void eval(const void* owner, std::uint32_t triangle, const float (*b)[8], float* h)
{
  const auto& heights = *static_cast<const CurvedHeights*>(owner);
  if (heights.on_top.eval != nullptr) {
    heights.on_top.eval(heights.on_top.owner, triangle, b, h);
  } else {
    std::fill_n(h, 8, static_cast<float>(heights.midlevel));
  }
  const CurvedTriangle curved = curved_triangle(heights.mesh, triangle);
  for (int lane = 0; lane < 8; ++lane) {
    const double w[3] = {b[0][lane], b[1][lane], b[2][lane]};
    h[lane] = static_cast<float>(h[lane] + curved.displacement(w) / heights.scale);
  }
}

void bounds(const void* owner, std::uint32_t triangle, const WeightPatches& patches, float* low, float* high)
{
  const auto& heights = *static_cast<const CurvedHeights*>(owner);
  if (heights.on_top.bounds != nullptr) {
    heights.on_top.bounds(heights.on_top.owner, triangle, patches, low, high);
  } else {
    std::fill_n(low, 8, static_cast<float>(heights.midlevel));
    std::fill_n(high, 8, static_cast<float>(heights.midlevel));
  }
  double from, to;
  curved_triangle(heights.mesh, triangle).bounds(&from, &to);
  from /= heights.scale;
  to /= heights.scale;
  if (from > to) std::swap(from, to);
  for (int lane = 0; lane < 8; ++lane) {
    low[lane] = std::nextafter(static_cast<float>(low[lane] + from), -HUGE_VALF);
    high[lane] = std::nextafter(static_cast<float>(high[lane] + to), HUGE_VALF);
  }
}

/// Of the smooth surface itself as they are: it goes on beyond its sides as its neighbours do.
void slopes(const void* owner,
            std::uint32_t triangle,
            const Vec2f* at,
            int count,
            Vec2f du,
            Vec2f dv,
            HeightSlopes* out)
{
  const auto& heights = *static_cast<const CurvedHeights*>(owner);
  std::fill_n(out, count, HeightSlopes{});
  if (heights.on_top.eval != nullptr) height_slopes(heights.on_top, triangle, at, count, du, dv, out);
  const CurvedTriangle curved = curved_triangle(heights.mesh, triangle);
  for (int k = 0; k < count; ++k) {
    const WeightSlopes change = curved.slopes(static_cast<double>(at[k].x), static_cast<double>(at[k].y));
    const auto along = [&](Vec2f d) {
      const double h = (change.b1 * d.x + change.b2 * d.y) / heights.scale;
      return std::isfinite(h) ? static_cast<float>(h) : 0.0f;
    };
    out[k].u += along(du);
    out[k].v += along(dv);
  }
}

}  // namespace

HeightSource CurvedHeights::source() const { return {this, eval, bounds, slopes}; }

}  // namespace relief
