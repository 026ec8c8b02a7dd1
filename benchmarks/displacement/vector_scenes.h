// Scenes whose points vectors move, by script: overhangs that no height over the base has.
#pragma once

#include <span>

#include "benchmarks/displacement/scenes.h"
#include "displacement/moved_mesh.h"
#include "displacement/vec3d.h"

namespace relief {

/// Where a point goes.
/// @param P, N  of the base, N unit
using BenchMove = Vec3d (*)(Vec3d P, Vec3d N);

struct VectorSceneSpec {
  BenchSceneSpec base;      ///< without its map
  std::int32_t cells = 64;  ///< along a side of every triangle, a power of two
  BenchMove move = nullptr;
};

std::span<const VectorSceneSpec> vector_scene_specs();

/// A scene in memory.
class VectorScene {
 public:
  /// @param spec   must outlive the scene
  /// @param cells  along a side of every triangle, a power of two
  VectorScene(const VectorSceneSpec& spec, std::int32_t cells);
  VectorScene(const VectorScene&) = delete;
  VectorScene& operator=(const VectorScene&) = delete;

  const BenchScene& base() const { return base_; }  ///< with the width of a cell for that of a texel
  std::int32_t cells() const { return cells_; }
  PointMoves moves() const { return {this, eval, nullptr}; }

 private:
  static void eval(const void* owner, std::uint32_t triangle, const float (*b)[8], Vec3f* moves);

  BenchScene base_;
  std::int32_t cells_;
  BenchMove move_;
};

}  // namespace relief
