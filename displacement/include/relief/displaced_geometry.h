// Displaced triangles in an Embree scene of your own: the one header of relief that other programs include (docs/embedding.md). It
// includes nothing else of relief and defines no macros. The interface may change with every minor version.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace relief {

/// Triangles and the heights that displace them. All of it is copied.
///
/// A point moves from P to P + scale · (h − midlevel) · N / |N|, with P and N interpolated between the corners and h bilinear between the
/// centres of the map's texels.
struct DisplacementSource {
  std::span<const float> positions;          ///< x, y, z a vertex
  std::span<const float> normals;            ///< likewise; of any length, but not zero
  std::span<const float> uv;                 ///< u, v a vertex; (0, 0) is the corner of the map's first texel, v grows with the rows
  std::span<const std::uint32_t> triangles;  ///< three vertices each
  std::span<const float> heights;            ///< map_width · map_height, row by row
  std::size_t map_width = 0, map_height = 0;
  bool map_repeats = true;  ///< beyond 0…1; otherwise its border goes on
  float scale = 1;          ///< in the unit of the positions
  float midlevel = 0;
};

/// A point of the displaced surface.
struct DisplacedSurfacePoint {
  float P[3];   ///< in the space of the positions
  float Ng[3];  ///< unit, on the side to which heights displace
  float uv[2];
};

/// A user geometry of Embree that is met as if every texel of its map were tessellated, without being so: its memory is about 130 bytes a
/// triangle and 4.3 a texel. Threads may trace it and call its const functions at the same time.
class DisplacedEmbreeGeometry {
 public:
  /// @param device  not null; its error function hears what Embree has to say
  /// @error std::invalid_argument, which names the member and the entry: a wrong size, an index without a vertex, a number that is not
  ///        finite; a surface 1e18 from the origin or farther. std::runtime_error: a processor that relief was not built for. std::bad_alloc
  DisplacedEmbreeGeometry(RTCDevice device, const DisplacementSource& source);
  ~DisplacedEmbreeGeometry();
  DisplacedEmbreeGeometry(DisplacedEmbreeGeometry&&) noexcept;
  DisplacedEmbreeGeometry& operator=(DisplacedEmbreeGeometry&&) noexcept;

  /// To be attached to a scene, committed already. Hits have u, v and Ng as Embree's own triangles have them, of the surface, Ng unit; primID
  /// is the triangle. From a scene that is traced after this has ended, the surface is gone.
  RTCGeometry geometry() const noexcept;

  /// The point that a hit's primID, u and v stand for, rounded once from double precision.
  DisplacedSurfacePoint point(unsigned triangle, float u, float v) const noexcept;

  /// Memory besides Embree's.
  std::size_t bytes() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace relief
