// Single queries against a scene, for `relief trace` and tests: the same acceleration structure, hit evaluation and path
// stages as a render.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "displacement/explain.h"
#include "integrator/render.h"
#include "integrator/scene_context.h"
#include "integrator/wavefront.h"

namespace relief {

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
};
TraceExplanation trace_explain(const SceneContext& context, const TraceRay& ray);

/// Rays of one sample of one pixel, in the order they were traced.
/// @param x, y  in the whole image
std::vector<RecordedRay> trace_path(const SceneContext& context,
                                    const RenderOptions& options,
                                    int x,
                                    int y,
                                    std::uint32_t sample_index);

}  // namespace relief
