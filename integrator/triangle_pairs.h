// Triangles in pairs that share an edge, which Embree has as quadrilaterals: half as many boxes for rays to pass, and to build.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernel/shape/mesh_view.h"

namespace relief {

/// How two triangles are the halves (a, b, d) and (c, d, b) of a quadrilateral (a, b, c, d).
struct PairTurns {
  std::int16_t first = -1;  ///< which corner of the first triangle is a; −1: they share no edge, or do not wind alike
  std::int16_t second = 0;  ///< which corner of the second one is c
};

/// A pair of triangles, or one that stays alone. It knows its turns, because each hit asks for them.
struct TrianglePair {
  std::uint32_t first = 0;  ///< its first triangle; the second one follows
  PairTurns turns;          ///< first is −1: there is no second one
};

PairTurns pair_turns(const TriangleIndices& first, const TriangleIndices& second);

/// Puts triangles that follow each other in pairs, where one box around both is smaller than one around each. Of all such ways it is the
/// one with the least area of boxes.
/// @param P  of the vertices
/// @return   in the order of the triangles
/// @cost     a byte a triangle while it runs; parallel
/// @pre      fewer than 2³² triangles
std::vector<TrianglePair> triangle_pairs_make(std::span<const Vec3f> P, std::span<const TriangleIndices> triangles);

/// The corners of a pair as those of a quadrilateral.
void pair_corners(const TrianglePair& pair, std::span<const TriangleIndices> triangles, std::uint32_t corners[4]);

/// A place on a triangle.
struct TrianglePlace {
  std::uint32_t triangle = 0;
  float u = 0, v = 0;  ///< weights of vertices 1 and 2
};

/// Brings a place on a quadrilateral, as Embree has it, to the triangle.
/// @param u, v  weights of b and d on the first half; on the second one, u + v > 1, one less those of d and b
TrianglePlace pair_place(const TrianglePair& pair, float u, float v);

}  // namespace relief
