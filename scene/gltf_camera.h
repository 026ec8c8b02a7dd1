// Cameras: what a file has, or one that shows everything.
#pragma once

#include "scene/gltf_document.h"
#include "scene/scene.h"
#include "scene/transform.h"

namespace relief {

/// Camera of a node with its RELIEF_camera. The node's scale is left out: a camera has none.
/// @param image_aspect  width / height of the image, for cameras that do not say theirs
/// @error SceneError
SceneCamera gltf_camera(const GltfDocument& document,
                        int node_index,
                        const Transform& world,
                        float image_aspect,
                        Warnings& warnings);

/// Axis-aligned box in world space.
struct Bounds {
  Vec3f low{kInfinity, kInfinity, kInfinity}, high{-kInfinity, -kInfinity, -kInfinity};

  bool empty() const { return !(low.x <= high.x); }
};

Bounds bounds_of_points(const std::vector<Vec3f>& points);
/// Box of a transformed box.
Bounds bounds_transform(const Affine3& m, const Bounds& box);
Bounds bounds_union(const Bounds& a, const Bounds& b);

/// Perspective camera in front of, above and to the right of a box, so far that its circumscribed sphere fits the image.
/// @param bounds  an empty one stands for a cube of 2 m around the origin
SceneCamera framing_camera(const Bounds& bounds, float image_aspect);

}  // namespace relief
