#include "integrator/shadow_passages.h"

#include <algorithm>

#include "integrator/scene_motion.h"
#include "kernel/stage/path_access.h"
#include "kernel/stage/shadow_surfaces.h"

namespace relief {

namespace {

constexpr std::size_t kLanes = 8;

/// Events before a shadow ray, as GraphRay::depths: it counts as one more, of no kind. Its path may have gone on since.
std::uint32_t shadow_ray_depths(const PathState& state, const ShadowQueue& shadow, std::uint32_t ray)
{
  const std::uint32_t path = shadow.path[ray], depths = state.bounces[path];
  const bool has_gone_on = static_cast<std::uint32_t>(path_bounces(depths, BounceKind::kAll)) ==
                           (shadow.scatterings[ray] & kShadowScatterings);
  if (!has_gone_on) return depths + 1u;
  if ((state.flags[path] & kPathScattered) != 0) return depths;
  const auto event = static_cast<PathEvent>(path_event(state.flags[path]));
  const BounceKind kind = event == PathEvent::kDiffuse  ? BounceKind::kDiffuse
                          : event == PathEvent::kGlossy ? BounceKind::kGlossy
                                                        : BounceKind::kTransmission;
  return depths - (1u << static_cast<int>(kind));
}

}  // namespace

GraphRay shadow_graph_ray(const PathState& state, const ShadowQueue& shadow, std::uint32_t ray)
{
  return {1u << static_cast<int>(GraphRayKind::kShadow), shadow_ray_depths(state, shadow, ray),
          shadow_ray_passed(shadow, ray)};
}

void shadow_passages_apply(const KernelGlobals& g,
                           const SceneMotion& motion,
                           const PathState& state,
                           const ShadowQueue& shadow,
                           std::span<ShadowPassage> passages,
                           Vec3f* visibility)
{
  const auto material_of = [&](const ShadowPassage& p) { return g.instances[p.object].material_index; };
  // Those of a ray keep their order, so that its light does not depend on what other rays meet.
  if (passages.size() > 1) std::ranges::stable_sort(passages, {}, material_of);
  InstanceView moved[kLanes];
  MeshView deformed[kLanes];
  ShadowSurfaces surfaces{};
  for (std::size_t first = 0, count = 0; first < passages.size(); first += count) {
    const std::int32_t material = material_of(passages[first]);
    for (count = 0; count < kLanes && first + count < passages.size(); ++count) {
      const ShadowPassage& passage = passages[first + count];
      if (material_of(passage) != material) break;
      const InstanceView* instance = &g.instances[passage.object];
      const MeshView* mesh = &g.meshes[instance->mesh_index];
      if ((instance->flags & (kMoves | kDeforms)) != 0) {
        const float time = path_time(state, shadow.path[passage.ray]);
        moved[count] = motion.instance_at(*instance, time);
        deformed[count] = motion.mesh_at(*instance, *mesh, time);
        instance = &moved[count];
        mesh = &deformed[count];
      }
      surfaces.places.mesh[count] = mesh;
      surfaces.places.instance[count] = instance;
      surfaces.places.triangle[count] = passage.triangle;
      surfaces.places.bary_u[count] = passage.u;
      surfaces.places.bary_v[count] = passage.v;
      surfaces.O[count] = shadow.O[passage.ray];
      surfaces.D[count] = shadow.D[passage.ray];
      surfaces.t[count] = passage.t;
      surfaces.rays[count] = shadow_graph_ray(state, shadow, passage.ray);
    }
    surfaces.material = &g.materials[material];
    surfaces.count = static_cast<int>(count);
    Vec3f passes[kLanes];
    g.shadow_surfaces(g, surfaces, passes);
    for (std::size_t k = 0; k < count; ++k) visibility[passages[first + k].ray] *= passes[k];
  }
}

}  // namespace relief
