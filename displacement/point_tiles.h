// A mesh whose points move, anywhere or along its normals, traced without being tessellated: the triangles of its lattices as
// DividedMesh has them, to the bit, but in tiles that are made when rays ask for them (point_tile.h). What is kept of a tile that is not there is its box.
//
// Embree has a primitive a tile, with a box that holds it exactly; all points are evaluated once for that, a tenth of what building
// a tree over their triangles takes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "displacement/embree_geometry.h"
#include "displacement/moved_mesh.h"
#include "displacement/point_tile.h"

namespace relief {

/// Corners, or sides, of a mesh's parts that are the same: 3 · part + k.
struct SharedByParts {
  std::vector<std::uint32_t> first;  ///< of those that are the same, the first
  std::vector<std::uint32_t> next;   ///< the next of them; ~0: there is none
};

class PointTiles {
 public:
  /// @param mesh    like what moves it must outlive the tiles; with normals, if it moves along them
  /// @param parts   of its triangles
  /// @param smooth  it has normals, as VertexDisplacement::smooth
  /// @param cache   of all such meshes of a scene; must outlive the tiles
  /// @param keys    those of its tiles are the ones from here on
  /// @error std::length_error if there are more tiles than Embree can count
  /// @cost  evaluates all points; parallel over tiles
  PointTiles(const MeshView& mesh,
             PointMover mover,
             std::vector<LatticeTriangle> parts,
             bool smooth,
             PointTileCache& cache,
             std::uint64_t keys);

  std::uint32_t num_tiles() const { return static_cast<std::uint32_t>(tiles_.size()); }
  /// What holds all that rays may meet of a tile, and what single precision errs by.
  Box3 padded_box(std::uint32_t tile) const;
  Box3 bounds() const { return bounds_; }  ///< of all points
  PointTileCache::Pin pin(std::uint32_t tile) const;

  /// Where a hit is.
  /// @param tile    Embree's primitive
  /// @param record  u, v: weights of the triangle's second and third vertex; Ng_x: its number in the tile, twice the number of its cell,
  ///                j · kCells + i, and one more for a cell's second triangle
  DisplacedPoint locate(std::uint32_t tile, EmbreeHitRecord record) const;
  /// The same with all that shading asks.
  DisplacedPoint resolve(const InstanceView& placement, std::uint32_t tile, EmbreeHitRecord record) const;

  std::span<const LatticeTriangle> parts() const { return parts_; }
  /// A point of a part's lattice; evaluated each time.
  Vec3f point(std::uint32_t part, std::int32_t i, std::int32_t j) const;

  std::size_t bytes() const;  ///< besides the cache
  /// The same before it is made, with the tree over its tiles.
  static std::uint64_t bytes(std::span<const LatticeTriangle> parts);

 private:
  struct Tile {
    std::uint32_t part;
    std::int32_t i, j;  ///< of its first point
  };
  /// By what a lattice point is evaluated.
  struct Source {
    std::uint32_t base;  ///< triangle of the mesh
    Vec2f weights;       ///< of its vertices 1 and 2
  };
  /// A point of a part's lattice that is on one of its sides: which of the side's own points it is.
  struct OnSide {
    int side = -1;          ///< −1: it is inside
    std::int32_t step = 0;  ///< from the corner of that number on, of side_n
  };
  struct MicroTriangle;
  class Points;

  static OnSide on_side(const LatticeTriangle& part, std::int32_t i, std::int32_t j);
  Vec2f place(const LatticeTriangle& part, std::int32_t i, std::int32_t j) const;
  Source source(std::uint32_t part, std::int32_t i, std::int32_t j) const;
  void eval(const Source* sources, std::size_t count, Vec3f* P) const;
  void make(const Tile& at, PointTile* tile) const;
  /// Whether a part's corners move apart. Others are lines, and have no tiles.
  bool has_area(std::uint32_t part) const;
  std::uint32_t tile_of(std::uint32_t part, std::int32_t i, std::int32_t j) const;
  MicroTriangle micro_triangle(std::uint32_t tile, EmbreeHitRecord record) const;
  template <class Visit>
  void visit_part(Points& points, std::uint32_t part, std::int32_t i, std::int32_t j, const Visit& visit) const;
  template <class Visit>
  void visit_around(Points& points,
                    const SharedByParts& corners,
                    const SharedByParts& sides,
                    std::uint32_t part,
                    std::int32_t i,
                    std::int32_t j,
                    const Visit& visit) const;
  Vec3d smooth_normal(Points& points, std::uint32_t part, std::int32_t i, std::int32_t j) const;

  MeshView mesh_;
  PointMover mover_;
  std::vector<LatticeTriangle> parts_;
  std::vector<std::uint32_t> first_tile_;  ///< of each part
  std::vector<Tile> tiles_;
  std::vector<Box3> boxes_;
  SharedByParts corners_, sides_;  ///< whose points move together: those at one place, or along one normal there
  SharedByParts smooth_corners_, smooth_sides_;  ///< with one normal there; empty: those are the same
  bool smooth_;
  Box3 bounds_;
  float pad_ = 0;
  PointTileCache& cache_;
  std::uint64_t keys_;
};

namespace baseline {
void tiles_intersect(const RTCIntersectFunctionNArguments* arguments);
void tiles_occluded(const RTCOccludedFunctionNArguments* arguments);
}  // namespace baseline
namespace avx2 {
void tiles_intersect(const RTCIntersectFunctionNArguments* arguments);
void tiles_occluded(const RTCOccludedFunctionNArguments* arguments);
}  // namespace avx2

}  // namespace relief
