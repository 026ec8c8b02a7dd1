// A scene's meshes, instances and attributes as the kernel sees them.
#pragma once

#include <vector>

#include "integrator/scene_motion.h"
#include "kernel/graph/graph_scene.h"
#include "kernel/shape/mesh_view.h"
#include "scene/scene.h"

namespace relief {

struct SceneViews {
  /// @param scene  must outlive the views
  explicit SceneViews(const Scene& scene);
  SceneViews(const SceneViews&) = delete;
  SceneViews& operator=(const SceneViews&) = delete;

  SceneMotion motion;
  std::vector<MeshView>
      meshes;  ///< those of the scene; a context has moved ones (displacement/moved_mesh.h) behind them
  std::vector<InstanceView> instances;
  std::vector<MeshColumn> mesh_columns;             ///< of all meshes, one mesh's side by side
  std::vector<std::vector<float>> instance_values;  ///< columns that do not reach all instances in the scene
  std::vector<GraphInstanceColumn> instance_columns;
};

}  // namespace relief
