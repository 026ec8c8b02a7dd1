// What displaced materials need to be traced: height fields shared by meshes, and one displaced geometry for each mesh
// and displacement that occur together.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "displacement/embree_geometry.h"
#include "displacement/height_level.h"
#include "integrator/displacement_cost.h"
#include "scene/scene.h"

namespace relief {

/// What overrides the scene's own settings.
struct DisplacementOptions {
  std::optional<DisplacementMethod> method;  ///< of all materials
  std::optional<float> lod;                  ///< of all height maps, see DisplacementSettings::lod
  double tessellation_rate = 1;              ///< micro-triangle edges a texel
  std::uint64_t auto_bytes = 0;              ///< what `auto` may use while it builds tessellations; 0: it builds none
  double num_rays = 0;                   ///< that will be traced, about, for `auto` to weigh building against tracing
  std::uint64_t tessellation_bytes = 0;  ///< all tessellations may take while they are built; 0: half of the machine's
};

/// A hit on a displaced instance.
struct DisplacedPoint {
  std::uint32_t triangle = 0;  ///< base triangle
  float u = 0, v = 0;          ///< its barycentric weights of vertices 1 and 2
  float width = kInfinity;     ///< widest cone that meets the surface again as it is here, see lod_width_of_level
  Vec3f P = {}, Ng = {};       ///< on the traced surface, object space; Ng unit, on the side of the displacement normal
  Vec3f Ns = {};               ///< unit shading normal, object space: Ng, or that of the smoothed map
  Vec3f leave = {};            ///< see SurfaceHit::leave; object space
};

/// What a method is traced by; nothing if it tessellates, or if this version cannot.
std::optional<TraversalMethod> traversal_method(DisplacementMethod method);

/// What a method tessellates into; nothing if it does not.
std::optional<TessellationKind> tessellation_kind(DisplacementMethod method);

/// Names of the methods that can be chosen.
std::vector<std::string> displacement_method_names();

/// Settings of the scene that are not followed as they are written: what is done instead, a line each.
std::vector<std::string> displacement_warnings(const Scene& scene, const DisplacementOptions& options);

class DisplacementSet {
 public:
  /// @param scene  must outlive the set
  /// @error std::runtime_error with the estimate if tessellations would need more memory than they may
  DisplacementSet(const Scene& scene, const DisplacementOptions& options);

  /// @return  index of the displaced geometry of an instance; −1: it is not displaced
  int geometry_index(std::size_t instance) const { return geometry_of_instance_[instance]; }
  std::size_t size() const { return geometries_.size(); }
  /// Whether rays must say what detail they ask for.
  bool has_levels() const { return has_levels_; }
  /// Widths of finest texels by instance, metres, world; 0 where it is not displaced.
  const float* texels() const { return texel_of_instance_.data(); }
  DisplacedGeometry& geometry(std::size_t index) { return geometries_[index]->geometry; }
  /// @return null if the geometry is traversed as it is
  const Tessellation* tessellation(std::size_t index) const { return geometries_[index]->tessellation.get(); }
  /// The point of a hit on a displaced instance.
  /// @param placement              the instance's
  /// @param primitive, u, v, Ng_x  as Embree reports them
  DisplacedPoint point(std::size_t instance,
                       const InstanceView& placement,
                       std::uint32_t primitive,
                       float u,
                       float v,
                       float Ng_x) const;
  /// The same without P and normals.
  DisplacedPoint locate(std::size_t instance, std::uint32_t primitive, float u, float v) const;
  std::size_t bytes() const;            ///< besides the maps
  std::uint64_t num_triangles() const;  ///< of all geometries
  DisplacedMeshReport report() const;   ///< sums over all geometries
  std::string method_names() const;     ///< of the geometries, separated by commas
  /// What `auto` chose by, a line a geometry.
  const std::vector<std::string>& reasons() const { return reasons_; }
  /// Parts of the surfaces that are missing.
  std::vector<std::string> warnings() const;

 private:
  struct Displaced {
    std::string name;     ///< of the mesh
    bool smooth = false;  ///< shading normals come from the map's filtered gradient
    DisplacedMesh mesh;
    DisplacedGeometry geometry;
    std::unique_ptr<Tessellation> tessellation;
  };
  const Displaced& displaced(std::size_t instance) const
  {
    return *geometries_[static_cast<std::size_t>(geometry_of_instance_[instance])];
  }
  /// Levels that the rays of a geometry may see, from the map's own or a coarser one on.
  struct Levels {
    int first = 0, count = 1;
    bool by_cone = false;
    float fixed = 0;  ///< above `first`
  };
  static Levels levels_of(const Scene& scene,
                          const Mesh& mesh,
                          const DisplacementSettings& settings,
                          const DisplacementOptions& options);
  /// A mesh and a displacement that occur together, on one or more instances.
  struct Use {
    const Mesh& mesh;
    const DisplacementSettings& settings;
    double scale = 1;       ///< metres of object space
    double steepening = 1;  ///< how much steeper its instances' slopes are in the world than in object space, at most
  };
  std::unique_ptr<Displaced> make_displaced(const Scene& scene, const Use& use, const DisplacementOptions& options);
  /// How many levels of a map, the finest first, look like the map on a mesh and all its instances: what they lose of its
  /// slopes and heights is little.
  int num_faithful_levels(const Scene& scene, const Use& use, int most);
  /// A tessellation's layout where the method, or `auto`, wants one.
  /// @param used_bytes  by all tessellations so far; grows
  std::unique_ptr<Tessellation> tessellate(const DisplacedGeometry& geometry,
                                           const std::string& mesh,
                                           DisplacementMethod method,
                                           const DisplacementOptions& options,
                                           double num_rays,
                                           std::uint64_t* used_bytes);
  std::vector<int> geometry_of_instance_;
  std::vector<float> texel_of_instance_;
  bool has_levels_ = false;
  std::vector<std::string> reasons_;
  /// A level of a height map with its bounds.
  struct Field {
    HeightLevel level;  ///< empty at level 0, which is the map itself
    HeightField bounds;
    std::optional<LevelLoss> loss;         ///< against the level before; where it was asked for
    std::unique_ptr<Rmip> rmip;            ///< where a method asks for it
    std::unique_ptr<MinmaxMipmap> mipmap;  ///< likewise
  };
  Field& field(const Scene& scene, int map_index, int level);
  /// A level with the tables that a method needs, made once a field.
  DisplacementLevel level(const Scene& scene, int map_index, int level, TraversalMethod method);
  std::map<std::pair<int, int>, Field> fields_;  ///< by height map and level
  std::vector<std::unique_ptr<Displaced>> geometries_;
};

/// The best traversals for this machine; $RELIEF_ISA overrides, as for the stages.
const TraversalTable& traversal_table_select();

}  // namespace relief
