// What frames of a run, or requests to one process, share.
#pragma once

#include <filesystem>
#include <memory>

#include "cli/kept_scene.h"
#include "displacement/displacement_set.h"
#include "integrator/kept_trees.h"
#include "integrator/render.h"
#include "scene/kept_images.h"

namespace relief {

struct KeptFrames {
  KeptImages images;
  std::shared_ptr<HeightFields> fields = std::make_shared<HeightFields>();
  std::shared_ptr<KeptMeshes> meshes = std::make_shared<KeptMeshes>();
  std::shared_ptr<DicingChoices> choices = std::make_shared<DicingChoices>();
  std::shared_ptr<KeptTrees> trees = std::make_shared<KeptTrees>(true);
  KeptScene scene;

  /// What a render takes and leaves, besides its scene.
  void join(RenderOptions* options) const
  {
    options->displacement.fields = fields;
    options->displacement.meshes = meshes;
    options->displacement.choices = choices;
    options->trees = trees;
  }

  /// Loads a frame's scene, as far as it is not there.
  /// @param stats  counts what is
  /// @error as scene_load
  std::shared_ptr<const Scene> load(const std::filesystem::path& path, LoadOptions options, KeptStatistics* stats)
  {
    options.kept = &images;
    std::shared_ptr<const Scene> loaded = scene.get(path, options, stats);
    if (stats->scene) return loaded;
    const KeptTally tally = images.end_frame();
    stats->images += tally.count;
    stats->bytes += tally.bytes;
    stats->seconds += tally.seconds;
    return loaded;
  }
};

}  // namespace relief
