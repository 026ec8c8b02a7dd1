// What `auto` chooses displacement methods by: the seconds that a render would take by each.
#pragma once

#include <cstdint>
#include <string>

#include "displacement/tessellation.h"
#include "scene/scene.h"

namespace relief {

/// Processor time of the ways to trace a displaced mesh, nanoseconds. How long a ray takes in a tessellation grows with the
/// logarithm of its micro-triangles, as the tree and the cache misses do.
struct TessellationCost {
  double ray = 0;           ///< with a million micro-triangles
  double ray_doubling = 0;  ///< more with every doubling of their number
  double build = 0;         ///< a micro-triangle
};
struct DisplacementCosts {
  double exact_ray = 0;
  TessellationCost triangles, grids;
};

/// @source `relief bench displacement --parts costs`, a mean over its scenes and kinds of rays
inline constexpr DisplacementCosts kDisplacementCosts{930, {345, 63, 640}, {430, 77, 130}};

/// Rays of a render, about.
double expected_rays(const RenderSettings& settings);

/// Seconds that all rays take by the exact method.
double exact_seconds(const DisplacementCosts& costs, double num_rays);

/// Seconds that building a tessellation and tracing all rays in it take.
double tessellation_seconds(const TessellationCost& cost, std::uint64_t num_micro_triangles, double num_rays);

/// What a mesh is traced by, and why.
struct DisplacementChoice {
  bool tessellates = false;
  TessellationKind kind = TessellationKind::kTriangles;
  std::string reason;  ///< "0.9 s by tessellate, in 210 MiB, against 2.1 s by chord"
};

/// The method that takes the least time; tessellations count if building them needs no more than what is left of the
/// allowance.
/// @param triangles, grids  layouts of the same mesh
DisplacementChoice displacement_choose(const DisplacementCosts& costs,
                                       const TessellationLayout& triangles,
                                       const TessellationLayout& grids,
                                       double num_rays,
                                       std::uint64_t allowance_bytes);

/// How tessellations of a render are built.
inline constexpr TessellationBuild kRenderTessellation{RTC_BUILD_QUALITY_MEDIUM, false};

}  // namespace relief
