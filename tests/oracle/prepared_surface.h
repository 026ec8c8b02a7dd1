// A displaced triangle as a function of two parameters, with bounds over rectangles of them.
//
// The parameters are texel coordinates, so that rectangles fit the lattice on which h is smooth, or the barycentric
// coordinates b1 and b2 where the triangle has (almost) no area in uv. Points are relative to corner 0.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tests/oracle/displaced_triangle.h"
#include "tests/oracle/interval.h"

namespace relief::oracle {

struct Rectangle {
  Interval p, q;
};

/// c + p_slope · p + q_slope · q.
struct Linear {
  Interval c, p_slope, q_slope;
};

/// S and its derivatives, of a number type: double at a point, Interval over a rectangle.
template <typename T>
struct Patch {
  std::array<T, 3> S{}, S_p{}, S_q{};
  /// False: N may be zero or the rectangle covers many texels, and S is all there is.
  bool has_derivatives = false;
};

struct SurfaceNode {
  Rectangle domain;
  std::array<Interval, 3> box{};  ///< around S
  std::int32_t first_child = 0, num_children = 0;
  std::int32_t patch_index = -1;  ///< of a leaf within one texel
};

/// What a leaf's first test needs.
struct LeafPatch {
  std::array<Interval, 3> S_center{};  ///< S at the domain's centre
  Patch<Interval> patch;               ///< over all of the domain
};

struct PreparedSurface {
  PreparedSurface(const DisplacedTriangle& triangle_, const HeightMap& map_);

  /// @return  S over the rectangle and, if asked for and possible, hulls of its derivatives, one-sided ones included
  template <typename T>
  Patch<T> evaluate(const T& p, const T& q, bool with_derivatives) const;

  /// @return  bounds of b0, b1, b2
  std::array<Interval, 3> barycentric(const Rectangle& domain) const;
  /// Cuts off what is outside the triangle, as far as the rest is a rectangle.
  /// @return  false if nothing is left
  bool clip(Rectangle& domain) const;

  /// @return  true if the rectangle covers so many texels that it is to be split before anything else is tried
  bool is_large(const Rectangle& domain) const;
  /// Splits a large rectangle between texels, another one where S is longest.
  std::array<Rectangle, 2> split(const Rectangle& domain) const;

  /// d over a rectangle of a few texels.
  Interval displacement(const Rectangle& domain) const;
  /// P without displacement, relative to corner 0.
  std::array<Interval, 3> base_point(const Rectangle& domain) const;

  /// Direction to which all normals are perpendicular; zero if there is none, as unless N vanishes somewhere.
  Vector3 normals_axis() const;

  DisplacedTriangle triangle;
  const HeightMap& map;
  bool parameters_are_texels = false;
  bool is_mirrored = false;  ///< the parameters' orientation is opposite to that of (b1, b2)
  Rectangle root;
  std::vector<SurfaceNode> nodes;  ///< nodes[0] is the root; children follow their parent
  std::vector<LeafPatch> patches;

 private:
  void set_texel_parameters(const std::array<Interval, 3>& x, const std::array<Interval, 3>& y);
  void set_barycentric_parameters(const std::array<Interval, 3>& x, const std::array<Interval, 3>& y);
  void build();

  Rectangle texels_of(const Rectangle& domain) const;
  double texel(std::int64_t x, std::int64_t y) const;
  Interval height_range(const Rectangle& texels) const;
  void height(const Interval& x, const Interval& y, Interval& h, Interval& h_x, Interval& h_y) const;
  void height(double x, double y, double& h, double& h_x, double& h_y) const;

  std::int64_t origin_x_ = 0, origin_y_ = 0;  ///< texel coordinates are relative to this texel
  std::array<Linear, 3> b_{}, P_{}, N_{};
  Linear x_, y_;
  Interval map_range_{};
  double map_magnitude_ = 0;
};

/// @param b        barycentric coordinates of the corners 1 and 2
/// @param product  dS/db1 × dS/db2, times a positive number
/// @return         unit normal as in Hit; zero if the product is zero or not finite
Vector3 normal_oriented(const DisplacedTriangle& triangle, const Vector2& b, const Vector3& product);

}  // namespace relief::oracle
