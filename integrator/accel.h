// The scene as Embree sees it: one geometry an instance or area light in the top-level scene, so that a hit's geometry
// (or instance) number is the object index of the path state.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "displacement/displacement_set.h"
#include "displacement/embree.h"
#include "displacement/far_ray.h"
#include "integrator/kept_trees.h"
#include "integrator/scene_views.h"
#include "integrator/triangle_pairs.h"
#include "kernel/light/light.h"
#include "kernel/math/rounding.h"
#include "kernel/photon/box_aim.h"
#include "scene/scene.h"

namespace relief {

/// Ray kinds as Embree mask bits. Those of bounced rays lie as in InstanceFlag's kHiddenFrom.
enum RayMask : std::uint32_t {
  kRayCamera = 1u << 0,
  kRayShadow = 1u << 1,
  kRayBounceShift = 2,
  kRayBounce = 0xfu << kRayBounceShift,
  kRayCatchersShift = 8  ///< position of the same bits of rays that meet shadow catchers and lights only
};

/// Number of the object that a ray has met; RTC_INVALID_GEOMETRY_ID: none.
inline unsigned met_object(const RTCRayHit& ray)
{
  return ray.hit.instID[0] != RTC_INVALID_GEOMETRY_ID ? ray.hit.instID[0] : ray.hit.geomID;
}

/// What a tree holds of a mesh, without ownership.
struct TreeMesh {
  std::string_view name;
  const std::vector<Vec3f>* P = nullptr;         ///< object space
  std::vector<const std::vector<Vec3f>*> steps;  ///< P at evenly spaced times; none: it does not deform
  std::span<const TriangleIndices> triangles;
  std::span<const float> radius;  ///< of curves and points, see Mesh; empty: these are triangles
  bool are_ribbons = false;
  bool are_points = false;
};

/// Builds and owns the acceleration structure. Meshes that occur once are placed in world space; a mesh that occurs more
/// often, or is displaced, has one scene of its own and instances of it: Embree's, or where single precision would not do,
/// those of instance_geometry.h. So have curves; and one that moves or deforms while the shutter is open, with instances of the latter,
/// as have displaced meshes that are not tessellated.
class Accel {
 public:
  /// @param scene         must outlive the Accel: if no trees are kept, buffers are shared where they can be
  /// @param lights        of which `area_lights` picks those that rays can hit; object num_instances + i is area_lights[i]
  /// @param displacements of the scene; must outlive the Accel
  /// @param views         of the scene; must outlive the Accel
  /// @param shadow_filter called for hits of shadow rays on surfaces that may let light through
  /// @param trees         of the scenes before, and where those of this one stay; null: none are kept
  /// @error std::runtime_error with Embree's message when the build fails (out of memory)
  Accel(const Scene& scene,
        std::span<const Light> lights,
        std::span<const std::uint32_t> area_lights,
        DisplacementSet& displacements,
        const SceneViews& views,
        RTCFilterFunctionN shadow_filter,
        std::shared_ptr<KeptTrees> trees = nullptr);
  /// Leaves its trees to the scenes after, if they are kept.
  ~Accel();
  Accel(const Accel&) = delete;
  Accel& operator=(const Accel&) = delete;

  /// Nearest hit. A ray may start anywhere; one that is not finite, or has no direction, hits nothing.
  /// @param ray  world space; D need not be unit, but within 1e18
  void intersect(EmbreeContext& context, RTCRayHit& ray) const;
  /// Nearest hit on an object that is asked for; others are passed, however many stand in the way.
  /// @param is_wanted  told of an object by its number
  /// @param ray        as above, its hit need not be set; its tnear is that of the last search
  /// @return           number of the object; RTC_INVALID_GEOMETRY_ID: none is met
  template <typename IsWanted>
  unsigned intersect_only(const EmbreeContext& context, RTCRayHit& ray, const IsWanted& is_wanted) const
  {
    return intersect_wanted(context, ray, {&is_wanted, [](const void* asked, unsigned object) -> bool {
                                             return (*static_cast<const IsWanted*>(asked))(object);
                                           }});
  }
  /// All hits on one object, on whichever of its parts, in no order.
  /// @param ray   as above
  /// @param hits  get the ray's words too, with its tfar where it met the surface; once they are full, others are left out
  /// @return      how many
  std::size_t gather_hits(unsigned instance, const RTCRayHit& ray, std::span<RTCRayHit> hits) const;
  /// The same as intersect for a packet.
  void intersect8(EmbreeContext& context, RTCRayHit8& rays) const;
  /// Brings a hit of Embree's on quadrilaterals to the mesh's triangles, see triangle_pairs.h. What the above say is that already;
  /// filters are told of quadrilaterals.
  void to_triangle(unsigned object, std::uint32_t* primitive, float* u, float* v) const;
  /// Whether anything is hit: tfar is negative then.
  void occluded(EmbreeContext& context, RTCRay& ray) const;

  const DisplacementSet& displacements() const { return *displacements_; }
  const SceneMotion& motion() const { return views_->motion; }
  Box3 bounds() const;  ///< of all that rays can hit, world
  bool has_curves() const { return has_curves_; }
  /// Whether two numbers are of parts of one object, which has one a material. @param b  an instance's
  bool are_of_one_object(unsigned a, unsigned b) const
  {
    if (a == b) return true;
    return a < instances_.size() && instances_[a].object_index >= 0 &&
           instances_[a].object_index == instances_[b].object_index;
  }
  /// Of a displaced geometry's prisms or micro-triangles, object space.
  Box3 displaced_bounds(std::size_t geometry) const { return displaced_[geometry].box; }
  std::size_t bytes() const { return trees_->bytes(); }   ///< allocated by Embree
  const KeptTrees::Tally& kept() const { return kept_; }  ///< of the scenes before

 private:
  /// A callable that tells whether an object is asked for, without its type.
  struct Wanted {
    const void* asked;
    bool (*asks)(const void* asked, unsigned object);
  };
  struct SelectingContext;
  unsigned intersect_wanted(const EmbreeContext& context, RTCRayHit& ray, const Wanted& wanted) const;
  static void selecting_filter(const RTCFilterFunctionNArguments* arguments);
  void trace(EmbreeContext& context, RTCRayHit& ray) const;
  static void intersect_far(const RayTarget& target,
                            RTCScene scene,
                            EmbreeContext& context,
                            RTCRayHit& ray,
                            double* nearest);
  void pair_triangles();
  void place_instances(const Scene& scene, std::span<const Light> lights, std::span<const std::uint32_t> area_lights);
  void build_meshes();
  void build_displaced(DisplacementSet& displacements);
  void build_tessellated(DisplacementSet& displacements);
  void build_top(const Scene& scene, std::span<const Light> lights, std::span<const std::uint32_t> area_lights);
  const TreePointer& tree_of(std::size_t instance) const;  ///< null: it is in place
  ContentHash top_content(const Scene& scene,
                          std::span<const Light> lights,
                          std::span<const std::uint32_t> area_lights) const;
  struct MeshUse;
  RTCGeometry new_curves(const TreeMesh& mesh, bool transparent);
  void set_round_vertices(RTCGeometry geometry, const TreeMesh& mesh);
  RTCGeometry new_mesh(const MeshUse& use, const Affine3* world_from_object);
  void set_corners(RTCGeometry geometry, const MeshUse& use);
  void attach_corners(RTCScene target, const Box3& box, Vec3f pad, RTCGeometryType type);
  RTCGeometry new_instance(RTCScene instanced, const Affine3& world_from_object);
  Box3 light_box(const Light& light) const;
  RTCGeometry new_rectangle(const Light& light);
  RTCGeometry new_light(const Light& light);
  void attach(RTCScene target, RTCGeometry geometry, unsigned id, std::uint32_t mask);
  void commit(RTCScene target);

  /// What a mesh needs of a tree of its own.
  struct MeshUse {
    TreeMesh mesh;
    int count = 0;             ///< of instances that are not displaced
    bool transparent = false;  ///< one of them
    bool takes_time = false;   ///< one of them moves or deforms while the shutter is open
    bool at_border = false;    ///< it meets walls, or is some: in object space both sides of an edge round alike
    Box3 box;                  ///< object space, of meshes with a tree; over all time
    Vec3f pad;                 ///< by which it is enlarged
    TreePointer tree;          ///< null: it is in place
    std::vector<TrianglePair> pairs;  ///< quadrilaterals of the tree; empty: it has triangles

    bool has_tree() const { return count > 1 || takes_time || at_border || !mesh.radius.empty(); }
  };

  const MeshUse& use_of(std::size_t instance) const
  {
    return meshes_[static_cast<std::size_t>(views_->instances[instance].mesh_index)];
  }
  MeshUse& use_of(std::size_t instance)
  {
    return meshes_[static_cast<std::size_t>(views_->instances[instance].mesh_index)];
  }

  /// A displaced geometry.
  struct DisplacedUse {
    Box3 box;          ///< object space
    Vec3f pad;         ///< by which it is enlarged, of a tessellation
    TreePointer tree;  ///< of a tessellation it comes later: it depends on the pad
  };

  /// What moves is known by its place in the scene: no other has it.
  bool keeps_top() const { return trees_->keeps() && !views_->motion.is_open(); }

  RTCFilterFunctionN shadow_filter_;
  const DisplacementSet* displacements_;
  const SceneViews* views_;
  std::span<const Instance> instances_;  ///< of the scene
  std::shared_ptr<KeptTrees> trees_;
  KeptTrees::Tally kept_;
  RayTarget target_;                     ///< all that rays can hit, but for lights that are far away; world
  RayTarget far_lights_target_;          ///< these lights
  std::vector<MeshUse> meshes_;          ///< a mesh of views_
  std::vector<DisplacedUse> displaced_;  ///< a geometry of displacements_
  std::unique_ptr<SceneTree> scene_;
  RTCScene top_ = nullptr;  ///< of scene_
  bool has_curves_ = false, has_pairs_ = false;
};

}  // namespace relief
