// What displaced materials need to be traced: height fields shared by meshes, and one displaced geometry for each mesh
// and displacement that occur together.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "displacement/embree_geometry.h"
#include "scene/scene.h"

namespace relief {

/// What overrides the scene's own settings.
struct DisplacementOptions {
  std::optional<TraversalMethod> method;
};

class DisplacementSet {
 public:
  /// @param scene  must outlive the set
  DisplacementSet(const Scene& scene, const DisplacementOptions& options);

  /// @return  index of the displaced geometry of an instance; −1: it is not displaced
  int geometry_index(std::size_t instance) const { return geometry_of_instance_[instance]; }
  std::size_t size() const { return geometries_.size(); }
  DisplacedGeometry& geometry(std::size_t index) { return geometries_[index]->geometry; }
  /// The point of a hit on a displaced instance.
  SurfacePoint point(std::size_t instance, std::uint32_t triangle, float u, float v) const
  {
    const DisplacedMeshView& mesh =
        geometries_[static_cast<std::size_t>(geometry_of_instance_[instance])]->geometry.mesh;
    return surface_point(mesh, mesh.triangles[triangle], u, v);
  }
  std::size_t bytes() const;            ///< besides the maps
  std::uint64_t num_triangles() const;  ///< of all geometries

 private:
  struct Displaced {
    DisplacedMesh mesh;
    DisplacedGeometry geometry;
  };
  std::vector<int> geometry_of_instance_;
  std::vector<std::unique_ptr<HeightField>> fields_;  ///< a height map; null where no instance uses it
  std::vector<std::unique_ptr<Displaced>> geometries_;
};

/// The best traversals for this machine; $RELIEF_ISA overrides, as for the stages.
const TraversalTable& traversal_table_select();

}  // namespace relief
