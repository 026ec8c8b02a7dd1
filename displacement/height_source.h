// Heights that nobody has stored: computed where a ray asks for them, from the place on a base triangle.
#pragma once

#include <cstdint>

namespace relief {

/// Eight parallelograms in the barycentric weights of vertices 1 and 2: center + ε₁·du + ε₂·dv with |ε| ≤ 1. They may
/// reach beyond the triangle.
struct WeightPatches {
  float center[2][8], du[2][8], dv[2][8];
};

/// What gives a mesh's heights, without ownership. Called from many threads at once.
struct HeightSource {
  const void* owner = nullptr;
  /// Heights at eight points of one triangle; what is not finite counts as `midlevel`. Equal weights of equal corners give
  /// equal bits, whichever of an edge's triangles asks: so the surface is closed there.
  /// @param b  weights of vertices 0, 1 and 2
  void (*eval)(const void* owner, std::uint32_t triangle, const float (*b)[8], float* h) = nullptr;
  /// Bounds of all that `eval` may give over eight parallelograms of one triangle; infinite where none are known.
  void (*bounds)(const void* owner, std::uint32_t triangle, const WeightPatches& patches, float* low, float* high) =
      nullptr;
};

}  // namespace relief
