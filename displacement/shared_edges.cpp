#include "displacement/shared_edges.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

namespace relief {

namespace {

/// @param key  a function of an index; equal keys are one
/// @return     for every index the first one with the same key
template <typename Key>
std::vector<std::uint32_t> first_equals(std::size_t count, const Key& key)
{
  std::vector<std::uint32_t> order(count), first(count);
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const auto ka = key(a), kb = key(b);
    return ka != kb ? ka < kb : a < b;
  });
  for (std::size_t k = 0; k < count; ++k) {
    first[order[k]] = k > 0 && key(order[k]) == key(order[k - 1]) ? first[order[k - 1]] : order[k];
  }
  return first;
}

}  // namespace

std::vector<std::uint32_t> weld_corners(std::span<const DisplacedTriangle> triangles)
{
  return first_equals(3 * triangles.size(), [&](std::uint32_t corner) {
    const DisplacedTriangle& tri = triangles[corner / 3];
    const Vec3f P = tri.P[corner % 3], N = tri.N[corner % 3];
    // −0 and 0 are one place.
    return std::array<float, 6>{P.x + 0.0f, P.y + 0.0f, P.z + 0.0f, N.x + 0.0f, N.y + 0.0f, N.z + 0.0f};
  });
}

std::vector<std::uint32_t> weld_edges(std::span<const std::uint32_t> corners)
{
  return first_equals(corners.size(), [&](std::uint32_t edge) {
    const std::uint32_t a = corners[edge], b = corners[edge_end(edge)];
    return std::pair(std::min(a, b), std::max(a, b));
  });
}

}  // namespace relief
