// What a ray meets of many plain triangles, in double precision: all of them that a tree of boxes does not rule out.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "tests/oracle/displaced_triangle.h"

namespace relief::oracle {

/// The nearest triangle on a ray, as far as doubles tell.
struct NearestTriangle {
  double t = std::numeric_limits<double>::infinity();  ///< of the nearest that is met clearly
  double maybe = std::numeric_limits<
      double>::infinity();   ///< of the nearest that may be met: of those beside whose edges the ray passes too
  std::size_t triangle = 0;  ///< that is met at t
  double u = 0, v = 0;       ///< weights of its corners 1 and 2
};

class TriangleTree {
 public:
  /// @param unclear       how near to an edge a ray is not said to meet or miss a triangle clearly, as a weight; triangles that are
  ///                      seen edge-on, whose determinant is less than a part in 10⁹ of what its factors allow, are met nowhere
  /// @param least_cosine  between ray and normal; triangles that are seen nearer to edge-on may be met wherever the ray comes near
  TriangleTree(std::vector<std::array<Vector3, 3>> triangles, double unclear, double least_cosine = 0);

  NearestTriangle nearest(const Vector3& O, const Vector3& D) const;
  /// The same without the tree.
  NearestTriangle nearest_of_all(const Vector3& O, const Vector3& D) const;

 private:
  struct Node {
    std::array<Interval, 3> box;  ///< outward of all places that are not clearly missed
    std::size_t begin, end;       ///< into order_
    std::size_t second = 0;       ///< child; the first one is the next node. 0: a leaf
  };
  void build(std::size_t begin, std::size_t end);
  void meet(std::size_t triangle, const Vector3& O, const Vector3& D, NearestTriangle* out) const;

  std::vector<std::array<Vector3, 3>> triangles_;
  double unclear_, least_cosine_;
  std::vector<std::size_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace relief::oracle
