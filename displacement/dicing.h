// Dicing: a mesh with a height map as micro-triangles as long as pixels are wide, coarser where it is farther away. Their
// heights are those of the map's level whose texels are half as wide, and facets stand for what is lost (level_facets.h).
// (With texels as wide as the triangles, pictures were less sharp: errors of pixels were a quarter to a half larger.)
//
// The level is a function of the place on the undisplaced mesh alone, and the number of segments of a side of its ends, so
// neighbours agree to the last bit. Triangles that span much of the picture are cut into parts first (lattice_split.h).
#pragma once

#include <span>
#include <vector>

#include "displacement/displaced_triangle.h"
#include "displacement/lattice_split.h"
#include "displacement/seen_instances.h"
#include "displacement/tessellation.h"

namespace relief {

class Dicing {
 public:
  /// Texels of the level that heights are from, along a micro-triangle's side. A power of two.
  static constexpr int kTexelsASide = 2;

  /// @param mesh       without displacement
  /// @param triangles  of the displaced mesh; parts are made of them
  /// @param levels     of the map, the finest first
  /// @param texel      width of one of the finest, metres of object space
  /// @param instances  where the mesh is, the world from its own space; at least one
  /// @param pixels     that a micro-triangle's side may be long, > 0
  /// @param require    see lattices_make
  /// @cost  200 bytes a part
  Dicing(const MeshView& mesh,
         const DisplacedMeshView& triangles,
         std::span<const HeightFieldView* const> levels,
         double texel,
         const PictureView& view,
         std::span<const Affine3> instances,
         double pixels,
         const RequireBytes& require = {});

  /// What dicing a mesh takes at least, with its tessellation: a grid of one cell each, with Embree's box.
  static std::uint64_t least_bytes(const MeshView& mesh)
  {
    constexpr std::uint64_t kGrid = 4 * sizeof(Vec3f) + sizeof(RTCGrid) + 80;
    return mesh.num_triangles * (sizeof(TessellatedTriangle) + kGrid);
  }

  /// The parts, in place of the mesh's triangles; these themselves, where none is cut.
  const DisplacedMeshView& mesh() const { return mesh_; }
  /// Which parts of the mesh's triangles they are; empty: they are these triangles.
  std::span<const LatticeTriangle> parts() const { return parts_; }
  /// What a tessellation of the parts is made by.
  TessellationRule rule() const;

  /// Level of the map whose texels are as wide as sides of micro-triangles are long.
  /// @param P  of the undisplaced surface, object space
  double level(Vec3d P) const;
  /// Height at a lattice position on a level.
  double height(double x, double y, double level) const;
  /// Brings a point's place from a part to the mesh's triangle.
  void set_base_place(std::uint32_t* triangle, float* b1, float* b2) const;
  std::size_t bytes() const
  {
    return parts_.capacity() * sizeof(parts_[0]) + triangles_.capacity() * sizeof(triangles_[0]) + seen_.bytes();
  }

 private:
  bool has_long_sides(double most_a_metre) const;

  SeenInstances seen_;
  double pixels_, texel_;
  std::vector<const HeightFieldView*> levels_;
  std::vector<LatticeTriangle> parts_;
  std::vector<DisplacedTriangle> triangles_;
  DisplacedMeshView mesh_;
};

}  // namespace relief
