// All intersections of a ray with a displaced triangle, in double precision and with proof: what the traversals of
// displacement/ are judged by. It shares neither code nor derivation with them.
//
// The surface is S(b) = P(b) + scale · (h(uv(b)) − midlevel) · N(b)/|N(b)|, with P, N and uv linear in the barycentric
// coordinates b and h bilinear between texel centres. The parameter domain is halved until interval arithmetic shows
// that a piece misses the ray, or that the three equations S = O + tD have exactly one solution in it. What double
// precision cannot decide is reported as such.
//
// R. Krawczyk, "Newton-Algorithmen zur Bestimmung von Nullstellen mit Fehlerschranken", Computing 4, 1969.
// E. Hansen and S. Sengupta, "Bounding solutions of systems of equations using interval analysis", BIT 21, 1981.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "tests/oracle/interval.h"

namespace relief::oracle {

using Vector2 = std::array<double, 2>;
using Vector3 = std::array<double, 3>;

struct DisplacedTriangle {
  std::array<Vector3, 3> P;   ///< corners, object space
  std::array<Vector3, 3> N;   ///< normals at the corners, any length; interpolated, then normalized
  std::array<Vector2, 3> uv;  ///< after the texture's transform; any size and orientation, degenerate too
};

enum class Wrap { kRepeat, kMirror, kClamp };

/// Texel (i, j) lies at u = (i + ½) / width, v = (j + ½) / height; row 0 is the top one, at v = 0.
struct HeightMap {
  int width = 1, height = 1;
  std::vector<double> h;  ///< width × height finite values, row by row
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
  double scale = 1, midlevel = 0;
};

struct Ray {
  Vector3 O, D;                 ///< D of any length but zero
  double t_min = 0, t_max = 0;  ///< closed range, in lengths of D; may be infinite
};

struct Hit {
  double t_low = 0, t_high = 0;  ///< the root lies in between, if there is one
  double t = 0;                  ///< best value
  Vector2 b{};                   ///< barycentric coordinates of the corners 1 and 2
  Vector2 uv{};
  Vector3 P{};   ///< S(b)
  Vector3 Ng{};  ///< unit normal of S, on the side of N wherever the displacement does not fold the surface over
  bool certain = false;  ///< false: a root may or may not exist (tangent, on a triangle's edge or a limit of t, …)
};

/// A point of the surface, evaluated without bounds.
struct SurfacePoint {
  Vector3 P{}, Ng{};  ///< Ng as in Hit; zero where the surface has no normal
  Vector2 uv{};
  double h = 0;
};

/// Height map between texel centres.
/// @param uv  any finite value; wrapped
double height_eval(const HeightMap& map, const Vector2& uv);

/// S and its normal in plain double arithmetic.
/// @param b    barycentric coordinates of the corners 1 and 2
/// @return     not finite where N(b) = 0: such points are not part of the surface
SurfacePoint surface_eval(const DisplacedTriangle& triangle, const HeightMap& map, const Vector2& b);

struct PreparedSurface;

/// A displaced triangle prepared for many rays: a tree of parameter rectangles with boxes around their part of S.
class Surface {
 public:
  /// @param map  must outlive the surface
  /// @cost  at most some thousand boxes, about half a microsecond each
  Surface(const DisplacedTriangle& triangle, const HeightMap& map);

  /// All roots in [t_min, t_max], in the order of t.
  /// @return  certain hits exist, each once, and lie in their bracket; every root that is not among them lies in the
  ///          bracket of an uncertain one. A root on a texel's border is found once.
  std::vector<Hit> intersect_all(const Ray& ray) const;

  /// Box around S, rounded outward.
  std::array<Interval, 3> bounds() const;

 private:
  std::shared_ptr<const PreparedSurface> prepared_;
};

/// As Surface, for a single ray.
std::vector<Hit> intersect_all(const DisplacedTriangle& triangle, const HeightMap& map, const Ray& ray);

}  // namespace relief::oracle
