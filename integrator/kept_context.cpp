#include "integrator/kept_context.h"

#include <algorithm>
#include <chrono>
#include <cstring>

#include "displacement/displacement_choice.h"
#include "integrator/scene_context.h"

namespace relief {

namespace {

/// May take equal cameras for different ones, by the bytes between their fields.
bool is_same(const std::optional<Camera>& a, const std::optional<Camera>& b)
{
  if (!a || !b) return a.has_value() == b.has_value();
  return std::memcmp(&*a, &*b, sizeof *a) == 0;
}

/// Whether a scene's displaced meshes are prepared alike.
bool is_same(const Scene& scene, const DisplacementOptions& a, const DisplacementOptions& b)
{
  // All fields, or this does not compile.
  const auto& [method, lod, rmip, rate, error, auto_bytes, camera, height, num_rays, computed_bytes, fields, meshes,
               choices, require, dicing_bytes, tessellation_bytes] = a;
  const bool dices = error > 0 && !scene.displacements.empty();
  const bool follows_camera =
      dices || std::any_of(scene.displacements.begin(), scene.displacements.end(),
                           [](const DisplacementSettings& d) { return displacement_is_computed(d); });
  // What maps are made of, by the height of the picture, stays when the camera moves.
  const auto follows_height = [&](const Instance& instance) {
    const int index = scene.materials[static_cast<std::size_t>(instance.material_index)].displacement_index;
    return index >= 0 &&
           map_may_move_vertices(scene.displacements[static_cast<std::size_t>(index)],
                                 scene.meshes[static_cast<std::size_t>(instance.mesh_index)].triangles.size());
  };
  return method == b.method && lod == b.lod && rmip == b.rmip && rate == b.tessellation_rate && error == b.error &&
         auto_bytes == b.auto_bytes && computed_bytes == b.computed_bytes && fields == b.fields && meshes == b.meshes &&
         choices == b.choices && dicing_bytes == b.dicing_bytes && tessellation_bytes == b.tessellation_bytes &&
         ((auto_bytes == 0 && !dices) || num_rays == b.num_rays) &&
         (!follows_camera || (is_same(camera, b.camera) && height == b.picture_height)) &&
         (height == b.picture_height || std::none_of(scene.instances.begin(), scene.instances.end(), follows_height));
}

}  // namespace

SceneContext context_make(const Scene& scene, const ContextOptions& options)
{
  CausticSettings caustics;
  caustics.mode = options.caustics;
  caustics.kinds = options.caustic_kinds;
  return SceneContext(scene, options.displacement, options.environment_density, caustics, options.trees);
}

struct KeptContext::Made {
  ContextOptions options;
  SceneContext context;
};

KeptContext::KeptContext() = default;
KeptContext::~KeptContext() = default;

void KeptContext::reset() { made_.reset(); }

const SceneContext& KeptContext::get(const Scene& scene, const ContextOptions& options)
{
  is_kept_ = made_ != nullptr && is_same(scene, made_->options.displacement, options.displacement) &&
             made_->options.environment_density == options.environment_density &&
             made_->options.caustics == options.caustics && made_->options.trees == options.trees &&
             made_->options.caustic_kinds == options.caustic_kinds;
  if (is_kept_) return made_->context;
  made_.reset();
  const auto start = std::chrono::steady_clock::now();
  made_.reset(new Made{options, context_make(scene, options)});
  seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return made_->context;
}

}  // namespace relief
