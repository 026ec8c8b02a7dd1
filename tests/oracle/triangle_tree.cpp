#include "tests/oracle/triangle_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace relief::oracle {

namespace {

Vector3 minus(const Vector3& a, const Vector3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector3 cross(const Vector3& a, const Vector3& b)
{
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Of all points of a triangle's plane with weights of at least -unclear.
std::array<Interval, 3> box_of(const std::array<Vector3, 3>& triangle, double unclear)
{
  std::array<Interval, 3> box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax({triangle[0][axis], triangle[1][axis], triangle[2][axis]});
    box[axis] = widened({low, high}, 3 * unclear * (high - low) + 1e-12 * (std::abs(low) + std::abs(high)));
  }
  return box;
}

/// @return  where the ray enters the box, outward; infinity if it surely passes by it, before `farthest`
double enters(const std::array<Interval, 3>& box, const Vector3& O, const Vector3& D, double farthest)
{
  Interval t{0, farthest};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double low = round_down(box[axis].low - O[axis]), high = round_up(box[axis].high - O[axis]);
    if (D[axis] == 0) {
      if (low > 0 || high < 0) return kInfinity;
      continue;
    }
    t.low = std::max(t.low, round_down(std::min(low / D[axis], high / D[axis])));
    t.high = std::min(t.high, round_up(std::max(low / D[axis], high / D[axis])));
  }
  return t.low <= t.high ? t.low : kInfinity;
}

}  // namespace

TriangleTree::TriangleTree(std::vector<std::array<Vector3, 3>> triangles, double unclear, double least_cosine)
    : triangles_(std::move(triangles)), unclear_(unclear), least_cosine_(least_cosine), order_(triangles_.size())
{
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  if (!order_.empty()) build(0, order_.size());
}

void TriangleTree::build(std::size_t begin, std::size_t end)
{
  Node node{box_of(triangles_[order_[begin]], unclear_), begin, end};
  for (std::size_t k = begin + 1; k < end; ++k) {
    const std::array<Interval, 3> box = box_of(triangles_[order_[k]], unclear_);
    for (std::size_t axis = 0; axis < 3; ++axis) node.box[axis] = hull(node.box[axis], box[axis]);
  }
  const std::size_t index = nodes_.size();
  nodes_.push_back(node);
  if (end - begin <= 4) return;
  const auto wider = [](const Interval& a, const Interval& b) { return a.width() < b.width(); };
  const auto axis =
      static_cast<std::size_t>(std::max_element(node.box.begin(), node.box.end(), wider) - node.box.begin());
  const auto at = [&](std::size_t k) {
    return triangles_[k][0][axis] + triangles_[k][1][axis] + triangles_[k][2][axis];
  };
  const std::size_t middle = begin + (end - begin) / 2;
  const auto first = order_.begin();
  std::nth_element(first + static_cast<std::ptrdiff_t>(begin), first + static_cast<std::ptrdiff_t>(middle),
                   first + static_cast<std::ptrdiff_t>(end),
                   [&](std::size_t a, std::size_t b) { return at(a) < at(b); });
  build(begin, middle);
  nodes_[index].second = nodes_.size();
  build(middle, end);
}

void TriangleTree::meet(std::size_t triangle, const Vector3& O, const Vector3& D, NearestTriangle* out) const
{
  const std::array<Vector3, 3>& P = triangles_[triangle];
  const Vector3 e1 = minus(P[1], P[0]), e2 = minus(P[2], P[0]), p = cross(D, e2);
  const double determinant = dot(p, e1);
  const Vector3 normal = cross(e1, e2);
  if (std::abs(determinant) < least_cosine_ * std::sqrt(dot(D, D) * dot(normal, normal))) {
    // Seen edge-on: rounding of a corner moves the place that is met along all of it.
    out->maybe = std::min(out->maybe, enters(box_of(P, unclear_), O, D, kInfinity));
    return;
  }
  if (!(std::abs(determinant) > 1e-9 * std::sqrt(dot(D, D) * dot(e1, e1) * dot(e2, e2)))) return;
  const Vector3 from = minus(O, P[0]), q = cross(from, e1);
  const double u = dot(from, p) / determinant, v = dot(D, q) / determinant, t = dot(e2, q) / determinant;
  const double least = std::min({u, v, 1 - u - v});
  if (!(t >= 0 && least >= -unclear_)) return;
  out->maybe = std::min(out->maybe, t);
  if (!(least > unclear_ && t < out->t)) return;
  out->t = t;
  out->triangle = triangle;
  out->u = u;
  out->v = v;
}

NearestTriangle TriangleTree::nearest(const Vector3& O, const Vector3& D) const
{
  NearestTriangle out;
  std::vector<std::size_t> open;
  if (!nodes_.empty()) open.push_back(0);
  while (!open.empty()) {
    const std::size_t index = open.back();
    open.pop_back();
    const Node& node = nodes_[index];
    if (enters(node.box, O, D, out.t) == kInfinity) continue;
    if (node.second == 0) {
      for (std::size_t k = node.begin; k < node.end; ++k) meet(order_[k], O, D, &out);
      continue;
    }
    open.push_back(node.second);
    open.push_back(index + 1);
  }
  return out;
}

NearestTriangle TriangleTree::nearest_of_all(const Vector3& O, const Vector3& D) const
{
  NearestTriangle out;
  for (std::size_t k = 0; k < triangles_.size(); ++k) meet(k, O, D, &out);
  return out;
}

}  // namespace relief::oracle
