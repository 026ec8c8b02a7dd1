// Pre-tessellation: displaced triangles as micro-triangles with vertices on the surface, traced by Embree as quadrilaterals of
// two or as grids. Fast and large, and the one method that is an approximation: the surface is left between the vertices.
//
// Every base triangle is divided evenly, as finely as its share of the height map asks for. Neighbours use the same
// points along a shared edge: an edge has a number of segments of its own, the largest that one of its triangles wants,
// and where a triangle is finer inside, its rows along that edge are snapped to them. One of the two triangles computes
// the points, so they are equal to the last bit and no ray passes between.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "displacement/displaced_triangle.h"
#include "displacement/embree.h"
#include "kernel/math/box.h"

namespace relief {

enum class TessellationKind : std::uint8_t {
  /// An indexed mesh of pairs that share a side, and single ones at the ends of rows: n² micro-triangles a base triangle. Beside
  /// single triangles it takes half of the time to build, .7 of the memory, and rays are as fast.
  kQuads,
  kGrids,  ///< three grids a base triangle, one at each vertex, that meet at its centre; less memory, slower
  /// The micro-triangles of kQuads as grids of 8 × 8 cells (LatticeBlocks), for a quarter of the memory and a sixth of the time to
  /// build; rays take a tenth more.
  kBlocks
};

/// How a tessellation's tree is built.
struct TessellationBuild {
  RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;
  bool compact = false;  ///< leaves refer to the vertices instead of holding copies
};

/// How finely one base triangle is divided. Edge k runs from vertex k to vertex k + 1.
struct TessellatedTriangle {
  std::uint32_t segments = 1;                  ///< of each side; of kGrids: of half a side
  std::uint32_t edge_segments[3] = {1, 1, 1};  ///< at most `segments`; likewise
  std::uint32_t first_vertex = 0, first_primitive = 0;
};

struct LatticeVertex;  // tessellation_lattice.h

/// What will be built, before anything large is allocated.
struct TessellationLayout {
  TessellationKind kind = TessellationKind::kQuads;
  std::vector<TessellatedTriangle> triangles;
  /// For every edge (3 · triangle + edge): the one of its group that computes the points; for every corner likewise.
  /// Empty once the points are computed.
  std::vector<std::uint32_t> edge_owner, corner_owner;
  std::uint64_t num_vertices = 0, num_primitives = 0, num_micro_triangles = 0;

  std::uint64_t bytes() const;  ///< of the vertices and indices
};

/// What decides how a mesh is tessellated.
struct TessellationRule {
  /// Segments that an edge asks for, from its triangle's vertex k to the next; rounded up.
  std::function<double(const DisplacedTriangle&, int)> segments;
  /// Height over a point of the undisplaced surface at a lattice position; empty: the map's.
  std::function<double(Vec3d, double, double)> height;
};

/// @cost  36 bytes a base triangle; sorting of its edges
TessellationLayout tessellation_layout_make(const DisplacedMeshView& mesh,
                                            TessellationKind kind,
                                            const TessellationRule& rule);
/// @param rate  micro-triangle edges a texel, larger than 0: at 1, edges are at most a texel long along both axes
TessellationLayout tessellation_layout_make(const DisplacedMeshView& mesh, TessellationKind kind, double rate);

/// The counts of that at least: as if no triangle had a neighbour, which may divide their edge more finely. To weigh tessellating by.
/// @return  without owners
/// @cost    24 bytes a base triangle; nothing is compared or sorted
TessellationLayout tessellation_layout_least(const DisplacedMeshView& mesh, TessellationKind kind, double rate);

/// The same triangles with as many segments, in another order.
TessellationLayout tessellation_layout_as(TessellationKind kind, const TessellationLayout& layout);

/// Bytes in use while Embree builds the tree: vertices, indices, the tree and what building needs besides.
/// @source measured, see the definition
std::uint64_t tessellation_peak_bytes(const TessellationLayout& layout, const TessellationBuild& build);

/// A point on a micro-triangle.
struct MicroHit {
  std::uint32_t triangle = 0;  ///< base triangle
  double b1 = 0, b2 = 0;       ///< its barycentric weights of vertices 1 and 2
  Vec3d P{};                   ///< on the micro-triangle, object space
  Vec3d Ng{};                  ///< unit normal of the micro-triangle, on the side of the displacement normal
  double side_distance = 0;    ///< from the point to the nearest side of the micro-triangle
};

/// A vertex on a side of a base triangle.
struct SidePoint {
  double fraction = 0;  ///< along the side
  Vec3f P;              ///< object space
};

class Tessellation {
 public:
  /// Evaluates the surface at all vertices.
  /// @param mesh    what it refers to must outlive the tessellation
  /// @param layout  of the same mesh
  /// @param rule    by which it was made
  /// @error std::length_error if Embree's 32-bit indices are too short; std::bad_alloc
  Tessellation(const DisplacedMeshView& mesh, TessellationLayout layout, const TessellationRule& rule = {});

  const TessellationLayout& layout() const { return layout_; }
  Box3 bounds() const;  ///< of its vertices, object space
  std::size_t bytes() const
  {
    return layout_.bytes() + layout_.triangles.size() * sizeof(TessellatedTriangle) +
           owners_.size() * sizeof(owners_[0]);
  }

  RTCGeometryType geometry_type() const;
  /// A new Embree geometry, not committed. The tessellation must outlive it and stay where it is.
  RTCGeometry geometry_make(RTCDevice device) const;

  /// The base triangle of a hit and the weights of its vertices 1 and 2; the cheap part of `hit`.
  /// @param primitive, u, v  as Embree reports them
  MicroHit locate(std::uint32_t primitive, float u, float v) const;
  /// The whole point of a hit.
  MicroHit hit(std::uint32_t primitive, float u, float v) const;

  /// Where rays start that leave a hit near a side of its micro-triangle: clear of all micro-triangles around it. In a valley
  /// narrower than a right angle a move along the normal ends behind the other slope (test Dicing.LetsNoPathOut).
  /// @param scene      of this geometry as number 0
  /// @param primitive, u, v  of the hit
  /// @param error      per axis, of a point and of an origin, as in offset_ray_origin; object space
  /// @param reach      micro-triangles within this distance count, metres
  /// @return           to the side of the hit's normal; zero: no more is to be done than for any other hit
  Vec3d leave(RTCScene scene, std::uint32_t primitive, float u, float v, const MicroHit& hit, Vec3d error, double reach)
      const;

  /// The vertices along a side of a base triangle, from its vertex k to the next; some may be there twice.
  std::vector<SidePoint> side(std::uint32_t triangle, int k) const;

  Vec3f vertex(std::size_t index) const
  {
    return {vertices_[3 * index], vertices_[3 * index + 1], vertices_[3 * index + 2]};
  }

 private:
  struct MicroTriangle;
  struct Around;
  static bool add_planes_of(RTCPointQueryFunctionArguments* arguments);
  double winding(std::uint32_t triangle) const;
  std::uint32_t triangle_of(std::uint32_t primitive) const;
  MicroTriangle micro_triangle(std::uint32_t primitive, float u, float v) const;
  struct SharedPoints;
  Vec3f position(std::uint32_t index,
                 const LatticeVertex& vertex,
                 const TessellationRule& rule,
                 const SharedPoints& shared) const;
  void fill(const TessellationRule& rule);
  void fill_rows(std::uint32_t index, const TessellationRule& rule, const SharedPoints& shared, float* out) const;
  void fill_quads(std::uint32_t index, const TessellationRule& rule, const SharedPoints& shared);
  void fill_grids(std::uint32_t index, const TessellationRule& rule, const SharedPoints& shared);
  void fill_blocks(std::uint32_t index,
                   const TessellationRule& rule,
                   const SharedPoints& shared,
                   std::vector<float>* rows);

  DisplacedMeshView mesh_;
  TessellationLayout layout_;
  std::unique_ptr<float[]> vertices_;         ///< xyz
  std::unique_ptr<std::uint32_t[]> indices_;  ///< four a quadrilateral
  std::vector<RTCGrid> grids_;
  static constexpr int kLog2Owners = 8;
  std::vector<std::uint32_t> owners_;  ///< base triangle of every 2^kLog2Owners-th primitive
};

/// A scene for a tessellation, robust, not committed.
RTCScene tessellation_scene_make(RTCDevice device, const TessellationBuild& build);

}  // namespace relief
