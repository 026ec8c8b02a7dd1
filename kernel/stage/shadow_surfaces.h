// Surfaces that shadow rays may pass, as far as a graph says: up to eight of one material at a time.
#pragma once

#include "kernel/globals.h"
#include "kernel/graph/graph_load.h"
#include "kernel/shape/surface_hits.h"

namespace relief {

/// Where shadow rays have met surfaces of one material.
struct ShadowSurfaces {
  const Material* material;
  int count;                   ///< 1 to 8
  SurfaceHitQuestions places;  ///< of instances and meshes as they are at the rays' times
  Vec3f O[8], D[8];            ///< of the rays, world; D unit
  float t[8];                  ///< along them
  GraphRay rays[8];            ///< whose length is left open
};

RELIEF_KERNEL void shadow_surfaces_locate(const ShadowSurfaces& s, SurfaceHit hits[8])
{
  bool are_triangles = s.count > 2;  // fewer are not worth it
  for (int k = 0; k < s.count; ++k) are_triangles = are_triangles && (s.places.instance[k]->flags & kCurves) == 0;
  if (are_triangles) {
    SurfaceHit* found[8];
    for (int k = 0; k < s.count; ++k) found[k] = &hits[k];
    surface_hits_make(s.places, s.count, found);
    return;
  }
  for (int k = 0; k < s.count; ++k) {
    const PrimitivePlace place{s.places.mesh[k], s.places.triangle[k], s.places.bary_u[k], s.places.bary_v[k]};
    hits[k] = primitive_hit(place, *s.places.instance[k], s.O[k] + s.D[k] * s.t[k], -s.D[k]);
  }
}

/// What surfaces let through of light, by the graph of their transparent closures, or of their alpha.
/// @param passes  gets that of each
RELIEF_KERNEL void shadow_surfaces_pass(const KernelGlobals& g, const ShadowSurfaces& s, Vec3f passes[8])
{
  const Material& material = *s.material;
  const bool has_closures = material.transparency_index >= 0;
  const GraphProgramView& program = g.graphs[has_closures ? material.transparency_index : material.graph_index];
  SurfaceHit hits[8];
  shadow_surfaces_locate(s, hits);
  // As in Cycles, what shadow rays meet does not look around: there are no rays for its graphs.
  GraphRegisters registers;
  const auto point_of = [&](int k) {
    const PrimitivePlace place{s.places.mesh[k], s.places.triangle[k], s.places.bary_u[k], s.places.bary_v[k]};
    GraphRay ray = s.rays[k];
    ray.length = length(hits[k].P - s.O[k]);
    return GraphPoint{place, s.places.instance[k], &hits[k], -s.D[k], {0.0f, 0.0f}, 0.0f, &g.graph_scene, ray};
  };
  if (s.count > 2) {
    GraphPlaces places{};
    for (int k = 0; k < 8; ++k) {
      const int i = k < s.count ? k : 0;
      places.hit[k] = &hits[i];
      places.instance[k] = s.places.instance[i];
      places.wo[k] = -s.D[i];
    }
    graph_load_points(program, places, s.count, point_of, registers);
  } else {
    for (int k = 0; k < s.count; ++k) graph_load_point(program, point_of(k), k, registers);
  }
  registers.used = (1u << s.count) - 1;
  g.run_graph(program, g.textures, registers);
  for (int k = 0; k < s.count; ++k) {
    const GraphLane lane{&program, &registers, k};
    passes[k] =
        has_closures ? closures_transparency(lane) : splat3(1.0f - graph_alpha(material, lane, g.textures, hits[k]));
  }
}

}  // namespace relief
