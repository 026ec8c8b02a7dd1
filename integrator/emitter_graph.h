// What lights send out that shine by value graphs. Compiled once, not in every stage that samples lights.
#pragma once

#include <span>

#include "kernel/globals.h"

namespace relief {

/// Radiance of a point of a mesh light, or factor on another's emission, as KernelGlobals::emitter_radiance.
Vec3f emitter_graph_radiance(const KernelGlobals& g, const Light& emitter, const EmitterPoint& at);

/// Whether what a graph gives depends on the length of a ray or on the events before it, which photons do not know of.
bool emitter_graph_asks_for_path(const GraphProgramView& program);

/// Mean radiance of triangles of an instance, by few points: what choosing among lights needs.
/// @param g       meshes, instances, materials, graphs and textures are filled in
/// @param means   one a triangle of the instance's mesh; those at which no point shone get a hundredth of the mesh's mean, for
///                other points of theirs may
void emitter_graph_means(const KernelGlobals& g, std::size_t instance, std::span<Vec3f> means);

/// Mean of what the graph of a lamp gives, over its points and the directions in which it shines, of the three channels. The
/// length of rays is a metre there.
/// @param light  with a lamp_index
float emitter_graph_lamp_mean(const KernelGlobals& g, const Light& light);

}  // namespace relief
