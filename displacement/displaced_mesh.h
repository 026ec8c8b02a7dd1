// A mesh whose triangles are displaced by a height field: what is prepared once, per mesh and per change of scale.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "displacement/deformation.h"
#include "displacement/displaced_triangle.h"
#include "displacement/procedural_field.h"
#include "kernel/math/box.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

/// How a mesh is displaced by a map.
struct DisplacementMapping {
  TextureRef height;  ///< uv set and texture transform; the texture index is not used
  double scale = 1;   ///< metres of object space
  double midlevel = 0.5;
  bool weld_seams = false;  ///< walls close texture seams
};

/// What was met while triangles were prepared.
struct DisplacedMeshReport {
  std::uint32_t num_folded = 0;         ///< prisms in which the displacement lines may cross
  std::uint32_t num_short_normals = 0;  ///< |N| falls below a thousandth of its largest value
  std::uint32_t num_degenerate = 0;     ///< no area: nothing of them is ever hit
  std::uint32_t num_walls = 0;          ///< one a side of a seam that is welded
  std::uint32_t num_far_uv = 0;         ///< texture coordinates beyond kMostTexels, or not finite: all at uv (0, 0)
  std::uint32_t first_far_uv = 0;       ///< the first of these triangles, if there are any
};

/// Texels from a map's corner within which triangles are displaced by it: a double still tells a 256th of a texel there,
/// and nothing that is computed leaves 64-bit integers.
inline constexpr double kMostTexels = 0x1p44;

/// Texels along a triangle's side, about: the root of twice the mean of their areas in a map.
/// @param width, height  of the map, texels
double mean_texels_a_side(const MeshView& mesh, const TextureRef& mapping, int width, int height);

/// How densely a map lies on a mesh.
struct MapDensity {
  double u = 0, v = 0;  ///< sides of the map a metre, along its axes: root of the mean square over the mesh's area
};

/// @return  zero for a mesh without the uv set or without area
MapDensity map_density(const MeshView& mesh, const TextureRef& mapping);

/// Bounds of heights.
struct HeightBounds {
  double low = static_cast<double>(kInfinity), high = -low;
};

class DisplacedMesh {
 public:
  DisplacedMesh() = default;
  /// @param mesh   without normals its triangles move along their own; without the uv set all of it is at uv (0, 0), as
  ///               are triangles whose uv are beyond kMostTexels
  /// @param field   must outlive the mesh
  /// @param coarser levels of the same map that rays may see instead: prisms hold all of their surfaces
  /// @param steps   of the mesh while the shutter is open, which itself is as when that is half done; what they point to must
  ///                outlive this. None: it does not deform
  /// @cost  129 bytes a triangle, 24 more if it deforms, and 40 a side of a welded seam; parallel over triangles
  DisplacedMesh(const MeshView& mesh,
                const HeightFieldView& field,
                const DisplacementMapping& mapping,
                std::span<const HeightFieldView* const> coarser = {},
                std::span<const MeshShape> steps = {});

  /// A mesh whose heights are computed: its triangles are the lattices', which may be parts of the mesh's.
  /// @param field    must outlive the mesh
  /// @param mapping  scale and midlevel
  DisplacedMesh(const MeshView& mesh,
                const ProceduralField& field,
                const DisplacementMapping& mapping,
                std::span<const MeshShape> steps = {});

  DisplacedMeshView view() const;
  const DisplacedMeshReport& report() const { return report_; }
  /// Box around all prisms at all times, object space.
  const Box3& bounds() const { return box_; }
  /// Width of the widest texel on the base mesh, metres of object space: the root of its area. 0 without any.
  float widest_texel() const;
  std::size_t bytes() const
  {
    return triangles_.size() * (sizeof(DisplacedTriangle) + 1) + seam_edges_.size() + walls_.size() * sizeof(SeamWall) +
           (deformation_ != nullptr ? deformation_->bytes() : 0);
  }

 private:
  void set_steps(const MeshView& mesh, const LatticeTriangle* parts, std::span<const MeshShape> steps);
  void bound_triangles(const std::function<HeightBounds(std::uint32_t)>& heights);

  std::vector<DisplacedTriangle> triangles_;
  std::vector<std::uint8_t> unfolded_;
  std::vector<std::uint8_t> seam_edges_;  ///< empty: seams stay open
  std::vector<SeamWall> walls_;
  std::unique_ptr<Deformation> deformation_;  ///< null: there is none
  const HeightFieldView* field_ = nullptr;
  Box3 box_ = box_empty();
  float pad_ = 0;
  DisplacementMapping mapping_;
  DisplacedMeshReport report_;
};

/// Box around P + s·N for all of a triangle's prism, and at most as far from the base triangle as its displacement;
/// enlarged by the mesh's pad. Of meshes that do not deform; rounded outward.
Box3 displaced_triangle_bounds(const DisplacedMeshView& mesh, std::uint32_t triangle);

}  // namespace relief
