// A scene, and what was built of it, that stay for the frames or requests after as long as the scene's files are what they
// were.
#pragma once

#include <filesystem>
#include <memory>

#include "integrator/kept_context.h"
#include "kernel/statistics.h"
#include "scene/load.h"

namespace relief {

class KeptScene {
 public:
  /// The scene of before if it would be loaded from the same files with the same options, or a new one.
  /// @param kept  counts what did not have to be loaded; images are counted by those who keep them
  /// @error as scene_load; then nothing is kept
  std::shared_ptr<const Scene> get(const std::filesystem::path& path, const LoadOptions& options, KeptStatistics* kept);
  /// What was built of the scene of the last get.
  KeptContext& context() { return context_; }

 private:
  std::filesystem::path path_;
  LoadOptions options_;
  std::shared_ptr<const Scene> scene_;
  KeptContext context_;
  double seconds_ = 0;  ///< that loading took
};

}  // namespace relief
