#include "integrator/triangle_pairs.h"

#include <algorithm>

#include <tbb/parallel_for.h>

#include "kernel/math/box.h"

namespace relief {

namespace {

/// Triangles that one thread puts in pairs at a time. No pair reaches over the end.
constexpr std::size_t kStretch = std::size_t{1} << 15;

std::uint32_t corner(const TriangleIndices& t, int i) { return i % 3 == 0 ? t.v0 : i % 3 == 1 ? t.v1 : t.v2; }

Box3 triangle_box(std::span<const Vec3f> P, const TriangleIndices& t)
{
  return {min(min(P[t.v0], P[t.v1]), P[t.v2]), max(max(P[t.v0], P[t.v1]), P[t.v2])};
}

float half_area(const Box3& box)
{
  const Vec3f size = box.high - box.low;
  return size.x * size.y + size.y * size.z + size.z * size.x;
}

/// The best pairs of a stretch of triangles.
/// @param is_second  zeros; of each triangle, receives whether it is the second one of a pair
/// @return           pairs and single triangles
std::uint32_t pair_stretch(std::span<const Vec3f> P,
                           std::span<const TriangleIndices> triangles,
                           std::span<std::uint8_t> is_second)
{
  // The least area of boxes of all triangles so far follows from that of all but the last one, and of all but the last two.
  double least = 0, least_before = 0;
  Box3 box_before;
  for (std::size_t k = 0; k < triangles.size(); ++k) {
    const Box3 box = triangle_box(P, triangles[k]);
    double with_this = least + static_cast<double>(half_area(box));
    if (k > 0) {
      const double as_pair = least_before + static_cast<double>(half_area(box_union(box_before, box)));
      if (as_pair <= with_this && pair_turns(triangles[k - 1], triangles[k]).first >= 0) {
        with_this = as_pair;
        is_second[k] = 1;
      }
    }
    least_before = least;
    least = with_this;
    box_before = box;
  }
  std::uint32_t count = 0;
  for (std::size_t k = triangles.size(); k > 0; ++count) {
    k -= 1;
    if (is_second[k] == 0) continue;
    k -= 1;
    is_second[k] = 0;
  }
  return count;
}

}  // namespace

PairTurns pair_turns(const TriangleIndices& first, const TriangleIndices& second)
{
  // By bits, the first of which is the answer: branches would be mispredicted half of the time.
  unsigned shared = 0;
  for (int i = 0; i < 3; ++i) {
    const std::uint32_t b = corner(first, i + 1), d = corner(first, i + 2);
    for (int k = 0; k < 3; ++k) {
      const bool is_edge = (corner(second, k + 1) == d) & (corner(second, k + 2) == b);
      shared |= (is_edge ? 1u : 0u) << (3 * i + k);
    }
  }
  if (shared == 0) return {};
  const int at = __builtin_ctz(shared);
  return {static_cast<std::int16_t>(at / 3), static_cast<std::int16_t>(at % 3)};
}

std::vector<TrianglePair> triangle_pairs_make(std::span<const Vec3f> P, std::span<const TriangleIndices> triangles)
{
  const std::size_t num_stretches = (triangles.size() + kStretch - 1) / kStretch;
  std::vector<std::uint8_t> is_second(triangles.size());
  std::vector<std::uint32_t> begins(num_stretches + 1);
  const auto length = [&](std::size_t stretch) { return std::min(kStretch, triangles.size() - stretch * kStretch); };
  tbb::parallel_for(std::size_t{0}, num_stretches, [&](std::size_t s) {
    begins[s + 1] = pair_stretch(P, triangles.subspan(s * kStretch, length(s)),
                                 std::span(is_second).subspan(s * kStretch, length(s)));
  });
  for (std::size_t s = 0; s < num_stretches; ++s) begins[s + 1] += begins[s];
  std::vector<TrianglePair> pairs(begins.back());
  tbb::parallel_for(std::size_t{0}, num_stretches, [&](std::size_t s) {
    TrianglePair* out = pairs.data() + begins[s];
    const std::size_t end = s * kStretch + length(s);
    for (std::size_t k = s * kStretch; k < end; ++k) {
      if (is_second[k] != 0) continue;
      *out++ = {static_cast<std::uint32_t>(k),
                k + 1 < end && is_second[k + 1] != 0 ? pair_turns(triangles[k], triangles[k + 1]) : PairTurns{}};
    }
  });
  return pairs;
}

void pair_corners(const TrianglePair& pair, std::span<const TriangleIndices> triangles, std::uint32_t corners[4])
{
  const TriangleIndices& t = triangles[pair.first];
  if (pair.turns.first < 0) {
    // Embree takes a quadrilateral whose last two vertices are one for a triangle.
    corners[0] = t.v0, corners[1] = t.v1, corners[2] = corners[3] = t.v2;
    return;
  }
  for (int i = 0; i < 3; ++i) corners[i < 2 ? i : 3] = corner(t, pair.turns.first + i);
  corners[2] = corner(triangles[pair.first + 1], pair.turns.second);
}

TrianglePlace pair_place(const TrianglePair& pair, float u, float v)
{
  if (pair.turns.first < 0) return {pair.first, u, v};
  const bool on_second = u + v > 1.0f;
  const float on[2][3] = {{1.0f - (u + v), u, v}, {u + v - 1.0f, 1.0f - u, 1.0f - v}};
  const float* weights = on[on_second ? 1 : 0];
  const int turn = on_second ? pair.turns.second : pair.turns.first;
  return {pair.first + (on_second ? 1u : 0u), weights[(4 - turn) % 3], weights[(5 - turn) % 3]};
}

}  // namespace relief
