// Heights that nobody has stored: computed where a ray asks for them, from the place on a base triangle.
#pragma once

#include <cstdint>

#include "kernel/math/vec.h"

namespace relief {

/// Eight parallelograms in the barycentric weights of vertices 1 and 2: center + ε₁·du + ε₂·dv with |ε| ≤ 1. They may
/// reach beyond the triangle.
struct WeightPatches {
  float center[2][8], du[2][8], dv[2][8];
};

/// How heights change along two directions of a triangle's plane.
struct HeightSlopes {
  float u = 0, v = 0;
};

/// What gives a mesh's heights, without ownership. Called from many threads at once.
struct HeightSource {
  const void* owner = nullptr;
  /// Heights at eight points of one triangle; what is not finite counts as `midlevel`. Equal weights of equal corners give
  /// equal bits, whichever of an edge's triangles asks: so the surface is closed there.
  /// @param b  weights of vertices 0, 1 and 2; without `slopes` also of points beyond the triangle's sides
  void (*eval)(const void* owner, std::uint32_t triangle, const float (*b)[8], float* h) = nullptr;
  /// Bounds of all that `eval` may give over eight parallelograms of one triangle; infinite where none are known.
  void (*bounds)(const void* owner, std::uint32_t triangle, const WeightPatches& patches, float* low, float* high) =
      nullptr;
  /// As height_slopes; null: by heights beyond the sides.
  void (*slopes)(const void* owner,
                 std::uint32_t triangle,
                 const Vec2f* at,
                 int count,
                 Vec2f du,
                 Vec2f dv,
                 HeightSlopes* out) = nullptr;
};

/// What heights change by along du and dv at points of one triangle: half of what they do from as far before the point to as
/// far behind it, also where that is beyond the triangle. There they are those of its plane, which are its neighbour's
/// about. (With what a triangle has on its own side alone, slopes at its sides were half of what they are; triangles of one
/// cell have nothing else, and were shaded as if they leaned: test ComputedHeights.AreShadedAlikeHoweverFewTheirCells.)
/// @param at      weights of vertices 1 and 2, like du and dv
/// @param count   of the points
void height_slopes(const HeightSource& source,
                   std::uint32_t triangle,
                   const Vec2f* at,
                   int count,
                   Vec2f du,
                   Vec2f dv,
                   HeightSlopes* out);

}  // namespace relief
