// Single queries against a scene, for `relief trace` and tests: the same acceleration structure, hit evaluation and path
// stages as a render.
#pragma once

#include <span>
#include <vector>

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
  Vec3f P, Ng;         ///< world; Ng unit, on the front side
  float u = 0, v = 0;  ///< barycentric weights of vertices 1 and 2
  std::int32_t instance_index = -1, mesh_index = -1;
  std::uint32_t triangle_index = 0;
};

/// Closest hits with surfaces; area lights are passed through.
std::vector<TraceHit> trace_rays(const SceneContext& context, std::span<const TraceRay> rays);

/// Rays of one sample of one pixel, in the order they were traced.
/// @param x, y  in the whole image
std::vector<RecordedRay> trace_path(const SceneContext& context,
                                    const RenderOptions& options,
                                    int x,
                                    int y,
                                    std::uint32_t sample_index);

}  // namespace relief
