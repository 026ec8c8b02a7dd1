// The scene as Embree sees it: one geometry an instance or area light in the top-level scene, so that a hit's geometry
// (or instance) number is the object index of the path state.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "displacement/displacement_set.h"
#include "displacement/embree.h"
#include "displacement/far_ray.h"
#include "integrator/instance_geometry.h"
#include "kernel/light/light.h"
#include "kernel/math/rounding.h"
#include "kernel/photon/box_aim.h"
#include "scene/scene.h"

namespace relief {

/// Ray kinds as Embree mask bits.
enum RayMask : std::uint32_t { kRayCamera = 1u << 0, kRayBounce = 1u << 1, kRayShadow = 1u << 2 };

/// Builds and owns the acceleration structure. Meshes that occur once are placed in world space; a mesh that occurs more
/// often, or is displaced, has one scene of its own and instances of it: Embree's, or where single precision would not do,
/// those of instance_geometry.h.
class Accel {
 public:
  /// @param scene         must outlive the Accel: vertex and index buffers are shared where they can be
  /// @param lights        of which `area_lights` picks those that rays can hit; object num_instances + i is area_lights[i]
  /// @param displacements of the scene; must outlive the Accel
  /// @param shadow_filter called for hits of shadow rays on surfaces that may let light through
  /// @error std::runtime_error with Embree's message when the build fails (out of memory)
  Accel(const Scene& scene,
        std::span<const Light> lights,
        std::span<const std::uint32_t> area_lights,
        DisplacementSet& displacements,
        RTCFilterFunctionN shadow_filter);
  ~Accel();
  Accel(const Accel&) = delete;
  Accel& operator=(const Accel&) = delete;

  /// Nearest hit. A ray may start anywhere; one that is not finite, or has no direction, hits nothing.
  /// @param ray  world space; D need not be unit, but within 1e18
  void intersect(EmbreeContext& context, RTCRayHit& ray) const;
  /// The same for a packet.
  void intersect8(EmbreeContext& context, RTCRayHit8& rays) const;
  /// Whether anything is hit: tfar is negative then.
  void occluded(EmbreeContext& context, RTCRay& ray) const;

  const DisplacementSet& displacements() const { return *displacements_; }
  Box3 bounds() const;                                ///< of all that rays can hit, world
  Box3 displaced_bounds(std::size_t geometry) const;  ///< of a displaced geometry's prisms or triangles, object space
  std::size_t bytes() const { return static_cast<std::size_t>(bytes_.load()); }  ///< allocated by Embree

 private:
  RTCScene new_scene(RTCBuildQuality quality);
  RTCGeometry new_mesh(const Mesh& mesh, const Affine3* world_from_object, bool transparent);
  RTCGeometry new_corners(const Box3& box);
  RTCGeometry new_instance(RTCScene instanced, const Affine3& world_from_object);
  RTCGeometry new_rectangle(const Light& light);
  RTCGeometry new_round(const Light& light, RTCBoundsFunction bounds_of, RTCIntersectFunctionN intersect_of);
  void build(const Scene& scene,
             std::span<const Light> lights,
             std::span<const std::uint32_t> area_lights,
             DisplacementSet& displacements);
  void release();
  void attach(RTCScene target, RTCGeometry geometry, unsigned id, std::uint32_t mask);
  void commit(RTCScene target);

  std::atomic<std::ptrdiff_t> bytes_{0};
  RTCFilterFunctionN shadow_filter_;
  const DisplacementSet* displacements_;
  RayTarget target_;                                          ///< all that rays can hit, world
  float pad_ = 0;                                             ///< of its boxes, metres
  std::vector<std::unique_ptr<InstanceGeometry>> instances_;  ///< an instance; null: in place, or Embree's own
  RTCDevice device_ = nullptr;
  RTCScene top_ = nullptr;
  std::vector<RTCScene> mesh_scenes_;                 ///< null for meshes that occur once
  std::vector<RTCScene> displaced_scenes_;            ///< a displaced geometry
  std::vector<std::unique_ptr<Light>> round_lights_;  ///< user data of disks and balls: stable addresses
};

}  // namespace relief
