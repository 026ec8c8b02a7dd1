// Single queries against a scene, for `relief trace` and tests: the same acceleration structure, hit evaluation and path
// stages as a render.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "displacement/explain.h"
#include "integrator/render.h"
#include "integrator/wavefront.h"

namespace relief {

struct SceneContext;  // integrator/scene_context.h

struct TraceRay {
  Vec3f O, D;  ///< world; D need not be unit: t counts in lengths of D
  float t_min = 0, t_max = kInfinity;
};

struct TraceHit {
  bool hit = false;
  float t = 0;
  Vec3f P, Ng;            ///< world; Ng unit, on the front side
  Vec3f O_front, O_back;  ///< origins of rays that leave on the front side and on the other
  float u = 0, v = 0;     ///< barycentric weights of vertices 1 and 2
  std::int32_t instance_index = -1, mesh_index = -1;
  std::uint32_t triangle_index = 0;
  /// Bounds and texels of displaced meshes that were tested; nothing if the ray entered no prism.
  std::optional<std::uint64_t> steps;
};

/// Closest hits with surfaces; area lights are passed through.
std::vector<TraceHit> trace_rays(const SceneContext& context, std::span<const TraceRay> rays);

/// A ray with every prism whose box it entered, in the order of the tracer.
struct TraceExplanation {
  TraceHit hit;
  std::vector<PrismVisit> visits;  ///< their geometries are the context's
  double t_unit = 1;               ///< of the visits, for prism_explain
};
TraceExplanation trace_explain(const SceneContext& context, const TraceRay& ray);

/// One sample of a render, followed again.
struct PathReplay {
  std::vector<RecordedRay> rays;  ///< in the order they were traced; those of forks among them
  Vec3f radiance;                 ///< what the sample adds to its pixel, finite or not; linear Rec.709
  std::vector<std::string> warnings;
};

/// Follows the very path that `render` follows with these options: with the photons that it meets, which takes as many passes
/// as it has predecessors, and in a batch as full of forks.
/// @param at  a pixel of the render's window, a sample below options.settings.samples
/// @error std::runtime_error out of memory and the like
PathReplay trace_path(const Scene& scene, const RenderOptions& options, const PixelSample& at);

}  // namespace relief
