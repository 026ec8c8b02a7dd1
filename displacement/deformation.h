// Displaced meshes that deform while the shutter is open. A ray meets the mesh that there is at its own time: vertices and
// normals go straight from step to step, as those of meshes that are not displaced do, and the triangles of that time are
// displaced and traced like those of any mesh. Nothing is prepared for a time but what holds for all of them: the bounds of
// a triangle's displacement, which is the same whatever becomes of the triangle, and boxes for the tree.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "displacement/displaced_triangle.h"
#include "kernel/math/box.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

struct LatticeTriangle;

/// What of a mesh differs from one time to another, at one of them; without ownership.
struct MeshShape {
  const Vec3f* P = nullptr;
  const Normal3f* N = nullptr;  ///< null: flat
};

/// What holds for a triangle at all times.
struct DeformingBounds {
  double d_low = 0, d_high = 0;  ///< of its displacement, metres
  float s_min = 1, s_max = 0;    ///< of d/|N|; crossed: not known, or much wider than it is at most times
};

struct Deformation {
  const TriangleIndices* triangles = nullptr;  ///< of the base mesh
  const LatticeTriangle* parts = nullptr;      ///< of base triangles, which are displaced; null: whole ones are
  std::vector<MeshShape> steps;                ///< two or more, at evenly spaced times
  std::vector<DeformingBounds> bounds;         ///< by displaced triangle

  std::size_t bytes() const { return steps.size() * sizeof(MeshShape) + bounds.size() * sizeof(DeformingBounds); }
};

/// @param d_low, d_high  of the triangle's displacement, metres
DeformingBounds deforming_bounds_make(const Deformation& deformation,
                                      std::uint32_t triangle,
                                      double d_low,
                                      double d_high);

/// P and N of a triangle at one of the steps; nothing else is set.
void deforming_triangle_at_step(const Deformation& deformation,
                                std::uint32_t triangle,
                                std::uint32_t step,
                                DisplacedTriangle* tri);

/// Box of a displaced triangle at one of the steps, object space, enlarged by the mesh's pad. What lies straight between this
/// and that of the next step holds the displaced triangle meanwhile.
Box3 deforming_triangle_bounds(const DisplacedMeshView& mesh, std::uint32_t triangle, std::uint32_t step);

/// A mesh of one triangle: one of a mesh that deforms, as it is at a time.
struct TriangleAtTime {
  DisplacedTriangle tri;
  std::uint8_t unfolded = 0;
  DisplacedMeshView mesh;

  /// @param time  0…1
  TriangleAtTime(const DisplacedMeshView& deforming, std::uint32_t triangle, float time);
  // The mesh points to the triangle.
  TriangleAtTime(const TriangleAtTime&) = delete;
  TriangleAtTime& operator=(const TriangleAtTime&) = delete;
};

/// A mesh at a time, as far as one of its triangles is concerned: itself, unless it deforms.
struct MeshAtTime {
  std::optional<TriangleAtTime> deformed;
  const DisplacedMeshView& mesh;
  std::uint32_t triangle;  ///< the one of that

  /// @param index  of the triangle in the mesh
  MeshAtTime(const DisplacedMeshView& of, std::uint32_t index, float time)
      : deformed(of.deformation != nullptr ? std::optional<TriangleAtTime>(std::in_place, of, index, time)
                                           : std::nullopt),
        mesh(deformed ? deformed->mesh : of),
        triangle(deformed ? 0 : index)
  {
  }
  const DisplacedTriangle& tri() const { return mesh.triangles[triangle]; }
};

}  // namespace relief
