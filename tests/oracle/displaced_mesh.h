// Many displaced triangles that share a height map, for tests of closed surfaces.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "tests/oracle/displaced_triangle.h"

namespace relief::oracle {

struct MeshHit {
  Hit hit;
  std::size_t triangle_index = 0;
};

class Mesh {
 public:
  /// @param map  must outlive the mesh
  Mesh(const std::vector<DisplacedTriangle>& triangles, const HeightMap& map);

  /// All roots on all triangles, in the order of t.
  /// @return  as Surface::intersect_all. A root on an edge that triangles share is an uncertain hit of each of them.
  std::vector<MeshHit> intersect_all(const Ray& ray) const;

  std::size_t num_triangles() const { return surfaces_.size(); }
  const Surface& surface(std::size_t triangle_index) const { return surfaces_[triangle_index]; }

 private:
  std::vector<Surface> surfaces_;
  std::vector<std::array<Interval, 3>> bounds_;
};

}  // namespace relief::oracle
