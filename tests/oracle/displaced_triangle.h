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
#include <cstdint>
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
  Vector3 O, D;              ///< D of any length but zero
  double t_min = 0, t_max = 0;  ///< closed range, in lengths of D; may be infinite
};

struct Hit {
  double t_low = 0, t_high = 0;  ///< the root lies in between, if there is one
  double t = 0;                  ///< best value
  Vector2 b{};                   ///< barycentric coordinates of the corners 1 and 2
  Vector2 uv{};
  Vector3 P{};                   ///< S(b)
  Vector3 Ng{};                  ///< unit normal of S, on the side of N wherever the displacement does not fold the surface over
  bool certain = false;          ///< false: a root may or may not exist (tangent, on a triangle's edge or a limit of t, …)
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

  /// Box around S, rounded outward: lower and upper corner.
  const std::array<Interval, 3>& bounds() const { return bounds_; }

 private:
  class Solver;

  /// A function linear in the two parameters.
  struct Linear {
    Interval c{0, 0}, p{0, 0}, q{0, 0};
  };
  struct Rectangle {
    Interval p{0, 0}, q{0, 0};
  };
  /// S relative to corner 0, and its derivatives; of a number type: double at a point, Interval over a rectangle.
  template <typename T>
  struct Patch {
    std::array<T, 3> S{}, S_p{}, S_q{};
    bool has_derivatives = false;  ///< false where N may be zero or the rectangle covers too many texels
  };
  struct Node {
    Rectangle domain;
    std::array<Interval, 3> box{};    ///< around S relative to corner 0
    std::int32_t first_child = -1;    ///< the second follows it; −1: leaf
    Patch<Interval> center, patch{};  ///< leaves of one texel: S at the domain's centre, derivatives over all of it
  };

  template <typename T>
  T value(const Linear& f, T p, T q) const;
  std::array<Interval, 3> barycentric(const Rectangle& domain) const;
  bool is_outside_triangle(const Rectangle& domain) const;
  Rectangle texels(const Rectangle& domain) const;
  std::int64_t num_cells(const Rectangle& domain) const;
  bool split(const Rectangle& domain, Rectangle& first, Rectangle& second) const;
  double texel(std::int64_t x, std::int64_t y) const;
  Interval height_range(const Rectangle& texels) const;
  template <typename T>
  void height(const T& x, const T& y, T& h, T& h_x, T& h_y) const;
  template <typename T>
  Patch<T> evaluate(T p, T q, bool with_derivatives) const;
  void build(std::int32_t index, int depth);

  DisplacedTriangle triangle_;
  const HeightMap* map_;
  Interval map_range_{0, 0};
  bool parameters_are_texels_ = false;   ///< else they are b1 and b2
  std::int64_t origin_x_ = 0, origin_y_ = 0;  ///< texel coordinates below are relative to this texel
  std::array<Linear, 3> b_{}, P_{}, N_{};
  Linear x_, y_;
  std::vector<Node> nodes_;
  std::array<Interval, 3> bounds_{};
};

/// As Surface, for a single ray.
std::vector<Hit> intersect_all(const DisplacedTriangle& triangle, const HeightMap& map, const Ray& ray);

}  // namespace relief::oracle
