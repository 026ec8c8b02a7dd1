// What was built of a scene, for renders that follow of the same scene: with another camera, seed, size or number of samples
// nothing of it changes.
#pragma once

#include <memory>

#include "displacement/displacement_set.h"
#include "integrator/environment_tables.h"
#include "scene/render_settings.h"

namespace relief {

class KeptTrees;      // integrator/kept_trees.h
struct Scene;         // scene/scene.h
struct SceneContext;  // integrator/scene_context.h

/// What SceneContext is made of besides the scene.
struct ContextOptions {
  DisplacementOptions displacement;
  EnvironmentDensity environment_density = EnvironmentDensity::kExcess;
  CausticsMode caustics = CausticsMode::kOff;
  std::shared_ptr<KeptTrees> trees;  ///< of the scenes before; null: none
  CausticKinds caustic_kinds = CausticKinds::kBoth;
};

/// @error as SceneContext
SceneContext context_make(const Scene& scene, const ContextOptions& options);

class KeptContext {
 public:
  KeptContext();
  ~KeptContext();
  /// The context of before if one made now would be the same, or a new one.
  /// @param scene  must outlive the context. If it is another than before, or not the same any more, reset() has been called
  /// @error as SceneContext; then nothing is kept
  const SceneContext& get(const Scene& scene, const ContextOptions& options);
  void reset();

  /// Whether the last get found the context of before.
  bool is_kept() const { return is_kept_; }
  double seconds() const { return seconds_; }  ///< that making it took

 private:
  struct Made;
  std::unique_ptr<Made> made_;
  bool is_kept_ = false;
  double seconds_ = 0;
};

}  // namespace relief
