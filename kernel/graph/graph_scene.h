// What value graphs read besides the surface: the ray that met it, the camera, and values of instances.
#pragma once

#include "kernel/camera/camera.h"
#include "kernel/graph/graph_registers.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

/// Kinds of rays, as bits of GraphRay::kinds. A ray is of several.
enum class GraphRayKind : std::uint8_t {
  kCamera,
  kShadow,
  kDiffuse,   ///< it left a diffuse lobe
  kGlossy,    ///< it left any other
  kSingular,  ///< it left a sharp one
  kReflection,
  kTransmission,
  kBlurred,  ///< what it shows is not sharp: it, or one before, has left a wide lobe
};

/// What GraphRay counts, bytes of `depths` but the last.
enum class GraphRayDepth : std::uint8_t { kAll, kDiffuse, kGlossy, kTransmission, kTransparent };

/// A ray that met a surface.
struct GraphRay {
  std::uint32_t kinds = 0;        ///< bit GraphRayKind
  std::uint32_t depths = 0;       ///< four 8-bit counts, as PathState::bounces
  std::uint32_t transparent = 0;  ///< surfaces that it has passed
  float length = 0;               ///< metres
  float time = 0;                 ///< see motion.h
};

/// Values of all instances by one name.
struct GraphInstanceColumn {
  std::uint16_t name;
  const float* values;  ///< four an instance: three components and alpha
};

/// What a light has besides whose emission a value graph multiplies, but for meshes.
struct Lamp {
  std::int32_t graph_index = -1;  ///< results 0 to 2 are the factor
  /// Of which the matrices count.
  InstanceView node{.world_from_object = {}, .object_from_world = {}, .index = kNoInstance};
};

/// What is the same for all surfaces.
struct GraphScene {
  const GraphInstanceColumn* columns = nullptr;
  std::uint32_t num_columns = 0;
  GraphRays rays;
  Camera camera;
  Affine3 camera_from_world;  ///< of the camera, which looks along −z there
};

}  // namespace relief
