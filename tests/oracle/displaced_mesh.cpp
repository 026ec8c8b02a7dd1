#include "tests/oracle/displaced_mesh.h"

#include <algorithm>
#include <array>

namespace relief::oracle {

namespace {

/// @return  false if the line surely passes by the box
bool may_meet(const std::array<Interval, 3>& box, const Ray& ray)
{
  Interval t{ray.t_min, ray.t_max};
  for (std::size_t k = 0; k < 3; ++k) {
    const double low = round_down(box[k].low - ray.O[k]), high = round_up(box[k].high - ray.O[k]);
    if (ray.D[k] == 0) {
      if (low > 0 || high < 0) return false;
      continue;
    }
    t.low = std::max(t.low, round_down(std::min(low / ray.D[k], high / ray.D[k])));
    t.high = std::min(t.high, round_up(std::max(low / ray.D[k], high / ray.D[k])));
  }
  return t.low <= t.high;
}

}  // namespace

Mesh::Mesh(const std::vector<DisplacedTriangle>& triangles, const HeightMap& map)
{
  for (const DisplacedTriangle& triangle : triangles) {
    bounds_.push_back(surfaces_.emplace_back(triangle, map).bounds());
  }
}

std::vector<MeshHit> Mesh::intersect_all(const Ray& ray) const
{
  std::vector<MeshHit> hits;
  for (std::size_t index = 0; index < surfaces_.size(); ++index) {
    if (!may_meet(bounds_[index], ray)) continue;
    for (const Hit& hit : surfaces_[index].intersect_all(ray)) hits.push_back({hit, index});
  }
  std::sort(hits.begin(), hits.end(), [](const MeshHit& a, const MeshHit& b) { return a.hit.t < b.hit.t; });
  return hits;
}

}  // namespace relief::oracle
