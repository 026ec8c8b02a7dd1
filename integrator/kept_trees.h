// Embree's trees, and those of the scenes before: a mesh whose triangles stay has its tree built once, whatever becomes of
// cameras, lights, materials and other meshes; and a scene in which nothing moves has all of them.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "displacement/content_hash.h"
#include "displacement/embree.h"
#include "integrator/instance_geometry.h"
#include "integrator/light_geometry.h"
#include "scene/memory.h"

namespace relief {

/// A scene of Embree's, which holds its device.
using TreePointer = std::shared_ptr<RTCSceneTy>;

/// The tree of a whole scene with what its geometry refers to. Must stay where it is.
struct SceneTree {
  std::vector<std::unique_ptr<InstanceGeometry>> instances;  ///< an instance; null: in place, or Embree's own
  std::vector<std::unique_ptr<LightGeometry>> lights;        ///< those that are no rectangles, or move
  std::vector<TreePointer> parts;                            ///< that are instanced
  float pad = 0;                                             ///< of its boxes, metres
  Box3 target = box_empty();                                 ///< of all but lights that are far away, world
  float near_lengths = 0;  ///< of it, from which rays need not be moved: see RayTarget
  ContentHash content;                                       ///< of all that it is made of; unused if nothing is kept
  std::uint64_t num_in_place = 0;                            ///< meshes that are part of this tree itself
  std::uint64_t bytes = 0;
  double seconds = 0;      ///< that building it took
  TreePointer far_lights;  ///< lights that are far away, which are in the top tree too; null: none is
  TreePointer top;         ///< the last member: the others outlive it
};

class KeptTrees {
 public:
  /// @param keeps  false: for a single scene, whose buffers may then be shared with Embree
  /// @error std::runtime_error if Embree cannot start
  explicit KeptTrees(bool keeps);

  bool keeps() const { return keeps_; }
  RTCDevice device() const { return device_->device; }
  std::uint64_t bytes() const { return static_cast<std::uint64_t>(device_->bytes.load()); }  ///< allocated by Embree
  /// Why Embree was refused memory since this was asked last; empty: it was not.
  std::optional<OutOfMemory> refusal() const;
  /// An empty scene of Embree's. Its spatial splits are not for trees as tight as these.
  TreePointer scene_make() const;
  /// A scene of Embree's that somebody else has made with the device.
  TreePointer own(RTCScene scene) const;

  /// The tree of a mesh, from a scene before or new.
  /// @param build  makes and commits it
  TreePointer mesh_tree(const ContentHash& content, const std::function<TreePointer()>& build);
  /// The tree of the scene before if it has that content, otherwise null: then it is gone.
  std::unique_ptr<SceneTree> take(const ContentHash& content);
  /// Leaves a tree to the next scene.
  void put(std::unique_ptr<SceneTree> tree) { scene_ = std::move(tree); }

  struct Tally {
    std::uint64_t count = 0, bytes = 0;
    double seconds = 0;  ///< that building it took
  };
  /// Ends the questions of a scene: trees of meshes that it has not asked for go.
  /// @return  of those that were there
  Tally end_scene();

 private:
  struct Device {
    RTCDevice device = nullptr;
    std::atomic<std::ptrdiff_t> bytes{0}, unchecked{0};
    std::mutex mutex;
    std::optional<OutOfMemory> refusal;  ///< of memory that Embree asked for
    ~Device();
    static bool count(void* user, ssize_t more, bool after);
  };
  struct MeshTree {
    TreePointer tree;
    std::uint64_t bytes = 0;
    double seconds = 0;
    bool is_wanted = true;
  };

  bool keeps_;
  std::shared_ptr<Device> device_;
  std::map<ContentHash, MeshTree> meshes_;
  std::unique_ptr<SceneTree> scene_;
  Tally found_;
};

}  // namespace relief
