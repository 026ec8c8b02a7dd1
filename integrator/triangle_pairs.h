// Triangles in pairs that share an edge, which Embree has as quadrilaterals: half as many boxes for rays to pass, and to build.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernel/shape/mesh_view.h"

namespace relief {

/// How two triangles are the halves (a, b, d) and (c, d, b) of a quadrilateral (a, b, c, d).
struct PairTurns {
  int first = -1;  ///< which corner of the first triangle is a; −1: they share no edge, or do not wind alike
  int second = 0;  ///< which corner of the second one is c
};

PairTurns pair_turns(const TriangleIndices& first, const TriangleIndices& second);

/// Puts triangles that follow each other in pairs, where one box around both is smaller than one around each. Of all such ways it is the
/// one with the least area of boxes.
/// @param P  of the vertices
/// @return   of each pair, and of each triangle that stays alone, the first triangle; at the end the number of triangles
/// @cost     a byte a triangle while it runs; parallel
/// @pre      fewer than 2³² triangles
std::vector<std::uint32_t> triangle_pairs_make(std::span<const Vec3f> P, std::span<const TriangleIndices> triangles);

/// The corners of a pair as those of a quadrilateral.
/// @param pair  of triangle_pairs_make's
void pair_corners(std::span<const std::uint32_t> pairs,
                  std::span<const TriangleIndices> triangles,
                  std::size_t pair,
                  std::uint32_t corners[4]);

/// A place on a triangle.
struct TrianglePlace {
  std::uint32_t triangle = 0;
  float u = 0, v = 0;  ///< weights of vertices 1 and 2
};

/// Brings a place on a quadrilateral, as Embree has it, to the triangle.
/// @param u, v  weights of b and d on the first half; on the second one, u + v > 1, one less those of d and b
TrianglePlace pair_place(std::span<const std::uint32_t> pairs,
                         std::span<const TriangleIndices> triangles,
                         std::size_t pair,
                         float u,
                         float v);

}  // namespace relief
