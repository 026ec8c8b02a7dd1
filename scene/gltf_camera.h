// Cameras of a file; framing.h has those that are not in a file.
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
};

Bounds bounds_of_points(const std::vector<Vec3f>& points);
/// Box of a transformed box.
Bounds bounds_transform(const Affine3& m, const Bounds& box);
Bounds bounds_union(const Bounds& a, const Bounds& b);

}  // namespace relief
