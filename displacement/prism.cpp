#include "displacement/prism.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "displacement/lattice_split.h"

namespace relief {

namespace {

/// |N| this many times smaller than at a vertex is taken no smaller: around a point where N vanishes there is no surface.
constexpr double kLeastNormal = 1e-3;

/// Least distance of the triangle abc from the origin.
/// @source Ericson 2005, "Real-Time Collision Detection", §5.1.5, for the origin
double distance_to_origin(Vec3d a, Vec3d b, Vec3d c)
{
  const auto segment = [](Vec3d p, Vec3d q) {
    const Vec3d pq = q - p;
    const double squared = dot(pq, pq);
    const double u = squared > 0 ? std::clamp(-dot(p, pq) / squared, 0.0, 1.0) : 0.0;
    return length(p + u * pq);
  };
  const double edges = std::min({segment(a, b), segment(b, c), segment(c, a)});
  const Vec3d n = cross(b - a, c - a);
  const double squared = dot(n, n);
  if (!(squared > 0)) return edges;
  // Is the origin's projection inside?
  const Vec3d foot = n * (dot(a, n) / squared);
  const bool inside =
      dot(cross(b - a, foot - a), n) >= 0 && dot(cross(c - b, foot - b), n) >= 0 && dot(cross(a - c, foot - c), n) >= 0;
  return inside ? std::min(edges, length(foot)) : edges;
}

/// Whether det(∂/∂b1, ∂/∂b2, ∂/∂s) of P + sN keeps its sign over the prism: it is linear in b and quadratic in s, so its
/// Bernstein coefficients at the three vertices bound it.
bool is_unfolded(const DisplacedTriangle& tri)
{
  const Vec3d Pu = to_double(tri.P[1]) - to_double(tri.P[0]), Pv = to_double(tri.P[2]) - to_double(tri.P[0]);
  const Vec3d Nu = to_double(tri.N[1]) - to_double(tri.N[0]), Nv = to_double(tri.N[2]) - to_double(tri.N[0]);
  const double s0 = tri.s_min, s1 = tri.s_max;
  // At s0, at both (blossom) and at s1.
  const Vec3d c0 = cross(Pu + s0 * Nu, Pv + s0 * Nv), c2 = cross(Pu + s1 * Nu, Pv + s1 * Nv);
  const Vec3d c1 = 0.5 * (cross(Pu + s0 * Nu, Pv + s1 * Nv) + cross(Pu + s1 * Nu, Pv + s0 * Nv));
  bool positive = true, negative = true;
  for (const Vec3f& n : tri.N) {
    for (const Vec3d& c : {c0, c1, c2}) {
      const double det = dot(c, to_double(n));
      const double margin = 1e-9 * length(c) * length(to_double(n));
      positive &= det > margin;
      negative &= det < -margin;
    }
  }
  return positive || negative;
}

}  // namespace

float round_down(double x)
{
  const auto f = static_cast<float>(x);
  return std::nextafter(f, -kInfinity);
}

float round_up(double x)
{
  const auto f = static_cast<float>(x);
  return std::nextafter(f, kInfinity);
}

PrismReport prism_bound(double d_low, double d_high, DisplacedTriangle* tri)
{
  PrismReport report;
  const Vec3d N[3] = {to_double(tri->N[0]), to_double(tri->N[1]), to_double(tri->N[2])};
  const double longest = std::max({length(N[0]), length(N[1]), length(N[2])});
  const double shortest = distance_to_origin(N[0], N[1], N[2]) * (1 - 1e-9);
  if (!(longest > 0)) {
    report.degenerate = true;
    tri->s_min = 1;
    tri->s_max = 0;
    return report;
  }
  report.short_normals = shortest < kLeastNormal * longest;
  const double least = std::max(shortest, kLeastNormal * longest);
  tri->s_min = round_down(std::min(d_low / least, d_low / longest));
  tri->s_max = round_up(std::max(d_high / least, d_high / longest));
  report.unfolded = is_unfolded(*tri);
  return report;
}

void corners_place(const Vec3f* P, const Vec3f* N, const LatticeTriangle* part, DisplacedTriangle* tri)
{
  const Vec3d facet = cross(to_double(P[1]) - to_double(P[0]), to_double(P[2]) - to_double(P[0]));
  const double area = length(facet);
  const Vec3f flat = area > 0 ? to_float(facet * (1.0 / area)) : Vec3f{0, 0, 0};
  const Vec3f own[3] = {flat, flat, flat};
  if (N == nullptr) N = own;
  for (int k = 0; k < 3; ++k) {
    tri->P[k] = part != nullptr ? lattice_corner(part->corner[k], P[0], P[1], P[2]) : P[k];
    tri->N[k] = part != nullptr ? lattice_corner(part->corner[k], N[0], N[1], N[2]) : N[k];
  }
}

}  // namespace relief
