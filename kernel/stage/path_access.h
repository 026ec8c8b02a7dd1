// Reading and writing groups of path columns, and adding to the columns of shadow rays.
#pragma once

#include "kernel/globals.h"
#include "kernel/math/rounding.h"
#include "kernel/sample/mis.h"
#include "kernel/state/path_state.h"
#include "kernel/texture/ray_cone.h"

namespace relief {

RELIEF_KERNEL Vec3f path_origin(const PathState& s, std::uint32_t i) { return s.O[i]; }
RELIEF_KERNEL Vec3f path_direction(const PathState& s, std::uint32_t i) { return s.D[i]; }
RELIEF_KERNEL Vec3f path_throughput(const PathState& s, std::uint32_t i) { return s.throughput[i]; }
/// What the path's last scattering event told the choice of a light.
RELIEF_KERNEL LightReceiver path_scattered_at(const PathState& s, std::uint32_t i)
{
  return s.scatter_gloss != nullptr ? LightReceiver{s.scatter_N[i], s.scatter_gloss[i]} : LightReceiver{s.scatter_N[i]};
}
RELIEF_KERNEL void path_set_scattered_at(PathState& s, std::uint32_t i, const LightReceiver& at)
{
  s.scatter_N[i] = at.N;
  if (s.scatter_gloss != nullptr) s.scatter_gloss[i] = at.gloss;
}

/// When the path is, see motion.h.
RELIEF_KERNEL float path_time(const PathState& s, std::uint32_t i)
{
  return s.motion.time != nullptr ? s.motion.time[i] : 0.0f;
}

/// The instance that a path has hit, as it is at the path's time.
RELIEF_KERNEL const InstanceView& path_instance(const KernelGlobals& g, const PathState& s, std::uint32_t i)
{
  const InstanceView& instance = g.instances[s.hit_object[i]];
  return (instance.flags & (kMoves | kDeforms)) != 0 ? s.motion.instances[i] : instance;
}

/// Its mesh, likewise.
RELIEF_KERNEL const MeshView& path_mesh(const KernelGlobals& g,
                                        const PathState& s,
                                        std::uint32_t i,
                                        const InstanceView& instance)
{
  return (instance.flags & kDeforms) != 0 ? s.motion.meshes[i] : g.meshes[instance.mesh_index];
}

/// Where on a mesh a path's hit is.
RELIEF_KERNEL PrimitivePlace path_place(const KernelGlobals& g,
                                        const PathState& s,
                                        std::uint32_t i,
                                        const InstanceView& instance)
{
  return {&path_mesh(g, s, i, instance), s.hit_triangle[i], s.hit_u[i], s.hit_v[i]};
}

/// Gives a path a new ray, to be searched from its origin on.
/// @param D  unit
RELIEF_KERNEL void path_set_ray(PathState& s, std::uint32_t i, Vec3f O, Vec3f D)
{
  s.O[i] = O;
  s.D[i] = D;
  s.t_min[i] = kLeastDistance;
  s.t_max[i] = kInfinity;
}

/// Queues a shadow ray.
/// @param O, D         world; D unit
/// @param t_max        metres
/// @param cone         at O
/// @param gain         of the path if nothing is in between: radiance × throughput, MIS weight included
/// @param scatterings  of path_shadow_scatterings, or kAmbientRay
RELIEF_KERNEL void shadow_queue_push(ShadowQueue& shadow,
                                     std::uint32_t path,
                                     Vec3f O,
                                     Vec3f D,
                                     float t_max,
                                     RayCone cone,
                                     Vec3f gain,
                                     std::uint32_t scatterings)
{
  const std::uint32_t ray = shadow.size++;
  shadow.O[ray] = O;
  shadow.D[ray] = D;
  shadow.t_max[ray] = t_max;
  shadow.cone_width[ray] = cone.width;
  shadow.cone_spread[ray] = cone.spread;
  shadow.gain[ray] = gain;
  shadow.path[ray] = path;
  shadow.scatterings[ray] = scatterings;
}

/// What a shadow ray is told of its path, which may go on before the ray is traced: ShadowQueue::scatterings.
/// @param scatterings  events between the camera and the light
/// @param light_group  of the light
RELIEF_KERNEL std::uint32_t path_shadow_scatterings(const PathState& s,
                                                    std::uint32_t i,
                                                    int scatterings,
                                                    std::uint32_t light_group)
{
  constexpr std::uint32_t kMost = (kMediumRay >> kShadowTransparentShift) - 1u;
  const std::uint32_t passed = s.flags[i] >> kPathTransparentShift;
  return static_cast<std::uint32_t>(scatterings) | light_group << kShadowLightGroupShift |
         (passed < kMost ? passed : kMost) << kShadowTransparentShift;
}

/// Transparent surfaces before a shadow ray.
RELIEF_KERNEL std::uint32_t shadow_ray_passed(const ShadowQueue& shadow, std::uint32_t ray)
{
  const std::uint32_t events = shadow.scatterings[ray];
  return events != kAmbientRay ? (events & ~kMediumRay) >> kShadowTransparentShift : 0u;
}

/// What an event counts as, and where its count is. Of those in media only the sum of all events is told.
enum class BounceKind : int { kAll = 0, kDiffuse = 8, kGlossy = 16, kTransmission = 24, kMedium = 32 };

RELIEF_KERNEL int path_bounces(std::uint32_t bounces, BounceKind kind)
{
  return static_cast<int>(bounces >> static_cast<int>(kind) & 0xffu);
}

/// PathEvent of a path's present ray, as an index.
RELIEF_KERNEL std::uint32_t path_event(std::uint32_t flags) { return flags >> kPathEventShift & 3u; }

/// Its bit in sets of rays that do not see something, as Light::hidden_from.
RELIEF_KERNEL std::uint32_t path_ray_kind(std::uint32_t flags)
{
  return (flags & kPathScattered) != 0 ? kHiddenFromScattered : 1u << path_event(flags);
}

RELIEF_KERNEL std::uint32_t path_flags_after(std::uint32_t flags, PathEvent event)
{
  return (flags & ~(3u << kPathEventShift | kPathScattered | kPathTranslucent)) |
         static_cast<std::uint32_t>(event) << kPathEventShift;
}

/// Whether the present ray started from a diffuse lobe of a surface, on either side.
RELIEF_KERNEL bool path_is_after_diffuse(std::uint32_t flags)
{
  return (flags & kPathScattered) == 0 &&
         (path_event(flags) == static_cast<std::uint32_t>(PathEvent::kDiffuse) || (flags & kPathTranslucent) != 0);
}

/// Microfacets that a path does not see: after a diffuse event those by which there are to be no caustics.
/// @return  bits PathEvent
RELIEF_KERNEL std::uint32_t path_does_without(const KernelGlobals& g, std::uint32_t flags)
{
  return path_is_after_diffuse(flags) ? g.caustics.switched_off : 0;
}

/// Whether bits PathEvent have that of light that microfacets send on.
RELIEF_KERNEL bool events_have(std::uint32_t events, bool transmitted)
{
  return (events >> static_cast<int>(transmitted ? PathEvent::kTransmission : PathEvent::kGlossy) & 1u) != 0;
}

/// Surfaces the path has met before, transparent ones included: what dimension_bounce counts by, so that no two
/// surfaces share random numbers. A photon's first scattering is not among its bounces.
RELIEF_KERNEL int path_surface(const PathState& s, std::uint32_t i)
{
  constexpr std::uint32_t kScatteredPhoton = kPathPhoton | kPathCaustic;
  const int first = (s.flags[i] & kScatteredPhoton) == kScatteredPhoton ? 1 : 0;
  return first + path_bounces(s.bounces[i], BounceKind::kAll) + static_cast<int>(s.flags[i] >> kPathTransparentShift);
}

/// Whether the facet that a path has hit is next to the one that it left (displacement/level_facets.h).
RELIEF_KERNEL bool path_is_among_facets(const PathState& s, std::uint32_t i)
{
  return s.facets != nullptr && s.hit_t[i] == 0.0f;
}

/// A sample's radiance, scaled until the mean of its channels is within a limit, as Cycles clamps it.
/// @param limit  0: none
RELIEF_KERNEL Vec3f radiance_clamped(Vec3f contribution, float limit)
{
  const Vec3f size = abs(contribution);
  const float mean = (size.x + size.y + size.z) * (1.0f / 3.0f);
  return limit > 0.0f && mean > limit ? contribution * (limit / mean) : contribution;
}

/// How a path came to light: it met it, or asked for it at a surface or in a medium.
enum class LightRoad : std::uint8_t { kFound, kAsked, kAskedInMedium };

/// Adds light of a path to the layers that tell it apart by the path's first event. What that was in a medium is in none.
/// @param light  clamped
[[gnu::noinline]] RELIEF_KERNEL void path_add_by_event(PathState& s,
                                                       std::uint32_t i,
                                                       int scatterings,
                                                       Vec3f light,
                                                       LightRoad road)
{
  if (scatterings == 0 || (scatterings == 1 && road == LightRoad::kAskedInMedium)) return;
  LightPassState& passes = s.light_passes[i];
  const bool is_first = scatterings == 1 && road == LightRoad::kAsked;
  light_passes_add(passes, is_first ? passes.asked : passes.found, scatterings > 1, light);
}

/// Adds radiance that arrives along the path's present ray, which left its last scattering event: direct light after
/// at most one event, indirect after more.
/// @param scatterings   events between the camera and the emitter
/// @param contribution  to the picture, W/m²/sr
/// @param light_group   of the light that it comes from; 0: none
RELIEF_KERNEL void path_add_radiance(const KernelGlobals& g,
                                     PathState& s,
                                     std::uint32_t i,
                                     int scatterings,
                                     Vec3f contribution,
                                     std::uint32_t light_group,
                                     LightRoad road = LightRoad::kFound)
{
  const bool is_direct = scatterings <= 1;
  const Vec3f light = radiance_clamped(contribution, is_direct ? g.clamp_direct : g.clamp_indirect);
  PathColumn<Vec3f>& sum = is_direct ? s.direct : s.indirect;
  sum[i] = sum[i] + light;
  if (__builtin_expect(s.light_passes != nullptr, 0)) path_add_by_event(s, i, scatterings, light, road);
  film_add_light_group(g.film, s.pixel[i], light_group, light);
}

/// Group of the light that has been asked.
/// @param emitter  null: the environment
RELIEF_KERNEL std::uint32_t asked_light_group(const KernelGlobals& g, const Light* emitter)
{
  return emitter != nullptr ? emitter->light_group : g.environment_light_group;
}

/// Adds light to the albedo that a denoiser is told of, where it is seen by the camera or in mirrors alone.
RELIEF_KERNEL void path_add_denoising(const KernelGlobals& g, const PathState& s, std::uint32_t i, Vec3f contribution)
{
  if (!g.film.layout.denoising || (s.flags[i] & kPathSawFeature) != 0) return;
  film_add_denoising(g.film, s.pixel[i], sample_is_even(s.sample_index[i], g.log2_stream), contribution, {});
}

/// Least width α of microfacets that a path meets: where it has come by unlikely directions, what it sees is blurred, in place
/// of noise. As in Cycles ("Filter Glossy").
/// @return  0: they are as they are
RELIEF_KERNEL float path_blur(const KernelGlobals& g, const PathState& s, std::uint32_t i)
{
  constexpr float kWidest = 0.5f;
  return s.least_pdf[i] < g.filter_glossy ? kWidest * __builtin_sqrtf(1.0f - s.least_pdf[i] / g.filter_glossy) : 0.0f;
}

/// Weight of light found by following the BSDF against finding it by light sampling.
/// @param pdf_bsdf   of the direction at the last scattering event; 0: delta event or camera, no other way
/// @param pdf_light  of next-event estimation for the same direction
RELIEF_KERNEL float path_bsdf_weight(LightTechnique technique, float pdf_bsdf, float pdf_light)
{
  if (!(pdf_bsdf > 0.0f) || !(pdf_light > 0.0f) || technique == LightTechnique::kBsdfSampling) return 1.0f;
  return technique == LightTechnique::kMis ? mis_power(pdf_bsdf, pdf_light) : 0.0f;
}

/// Weight of light found by next-event estimation.
/// @param delta_light  the BSDF cannot find it
RELIEF_KERNEL float path_light_weight(LightTechnique technique, float pdf_light, float pdf_bsdf, bool delta_light)
{
  if (delta_light || technique == LightTechnique::kLightSampling) return 1.0f;
  return technique == LightTechnique::kMis ? mis_power(pdf_light, pdf_bsdf) : 0.0f;
}

/// Whether a path that meets a light adds it, or none of it comes this way, or all of it is for next-event estimation to find.
RELIEF_KERNEL bool path_sees_light(const PathState& s, std::uint32_t i, const Light& light)
{
  const auto event = static_cast<PathEvent>(path_event(s.flags[i]));
  const bool is_scattered = (s.flags[i] & kPathScattered) != 0;
  if (!is_scattered && event == PathEvent::kCamera) return light.visible_to_camera;
  if (!light.multiple_importance) return false;
  if (is_scattered) return (light.hidden_from & kHiddenFromScattered) == 0;
  if (light.hidden_from == 0) return true;
  // Of single directions the event is known.
  if (!(s.pdf[i] > 0.0f)) return (light.hidden_from >> static_cast<int>(event) & 1u) == 0;
  return !light_hides(light, event == PathEvent::kTransmission).any();
}

/// Lets a path that goes on from its hit enter or leave what the surface there bounds, if it has passed that.
RELIEF_KERNEL void medium_follow(PathState& state, std::uint32_t path)
{
  MediumState& m = state.media[path];
  if (m.hit_inside == kWholeWorld) return;
  // A new ray is searched from its start on.
  const bool has_passed = state.t_min[path] != kLeastDistance || medium_is_behind(m, path_origin(state, path));
  if (has_passed) medium_cross(m, m.hit_inside, m.hit_front);
}

/// Copies all that a path's way on depends on, but what is at its present hit while the shutter is open; the copy has brought nothing
/// yet.
RELIEF_KERNEL void path_copy(const PathState& from, std::uint32_t i, PathState& to, std::uint32_t copy)
{
#define X(type, name) to.name[copy] = from.name[i];
#include "kernel/state/path_state_fields.inc"
#undef X
  if (from.motion.time != nullptr) to.motion.time[copy] = from.motion.time[i];
  if (from.facets != nullptr) to.facets[copy] = from.facets[i];
  if (from.scatter_gloss != nullptr) to.scatter_gloss[copy] = from.scatter_gloss[i];
  if (from.media != nullptr) {
    to.media[copy] = from.media[i];
    MediumState& m = to.media[copy];
    m.lit = m.caustic = m.before[0] = m.before[1] = Vec3f{};
  }
  to.direct[copy] = to.indirect[copy] = Vec3f{};
}

/// Copies a path that can go on in two ways; the copy has brought nothing yet.
/// @pre there is room, see path_has_room
RELIEF_KERNEL std::uint32_t path_fork(PathState& s, std::uint32_t i)
{
  const std::uint32_t copy = s.caustic.num_paths++;
  path_copy(s, i, s, copy);
  s.caustic.root[copy] = s.caustic.root[i];
  if (s.light_passes != nullptr) {
    s.light_passes[copy] = s.light_passes[i];
    for (Vec3f& light : s.light_passes[copy].light) light = {};
  }
  (*s.caustic.radiance)[copy] = Vec3f{};
  return copy;
}

/// Whether a path can become `count` of them.
RELIEF_KERNEL bool path_has_room(const PathState& s, std::uint32_t count)
{
  return s.caustic.num_paths + count - 1 <= kBatchPaths;
}

/// Adds what a forked path has brought to its root.
RELIEF_KERNEL void path_add_to_root(PathState& s, std::uint32_t i)
{
  const std::uint32_t root = s.caustic.root[i];
  s.direct[root] = s.direct[root] + s.direct[i];
  s.indirect[root] = s.indirect[root] + s.indirect[i];
  PathColumn<Vec3f>& caustic = *s.caustic.radiance;
  caustic[root] = caustic[root] + caustic[i];
  if (s.light_passes != nullptr) {
    for (int k = 0; k < kNumLightPasses; ++k) s.light_passes[root].light[k] += s.light_passes[i].light[k];
  }
}

/// Whether light that a sharp lobe of this surface brings to the path is the photon pass's.
RELIEF_KERNEL bool path_caustic_after(std::uint32_t flags, const InstanceView& instance)
{
  return (flags & (kPathAfterSoft | kPathCaustic)) != 0 && (instance.flags & kCausticCaster) != 0;
}

/// Whether this path looks for photons by the tails of a rough caster's lobes, as if these were soft. A path on its own goes
/// there seldom, and to a lamp in a second mirror or glass seldom again, which then shines a hundred times too bright: on
/// benchmarks/caustics' `rough` ten such pixels of 30,000 had more than half of the squared error. Only paths decide: photons
/// are kept there whoever looks, and go on as before, which after a soft event of the path is to where that was.
RELIEF_KERNEL bool path_gathers_tails(std::uint32_t flags, const InstanceView& instance)
{
  return (instance.flags & kGathersTails) != 0 && (flags & (kPathAfterSoft | kPathCaustic)) == 0;
}

/// Bounces that photons gathered at a path's present hit may have, so that camera path and photon together keep the limits.
/// @param event  what gathering counts as; kAll: only the limit of all bounces is asked
/// @return       false: none may
RELIEF_KERNEL bool photon_bounces_left(const BounceLimits& limits,
                                       std::uint32_t bounces,
                                       BounceKind event,
                                       std::uint32_t* left)
{
  const auto rest = [&](int limit, BounceKind kind) {
    return limit - path_bounces(bounces, kind) - (event == kind || kind == BounceKind::kAll ? 1 : 0);
  };
  const int total = rest(limits.total, BounceKind::kAll);
  const bool only_total = event == BounceKind::kAll;
  const int diffuse = only_total ? total : rest(limits.diffuse, BounceKind::kDiffuse);
  const int glossy = only_total ? total : rest(limits.glossy, BounceKind::kGlossy);
  const int transmission = only_total ? total : rest(limits.transmission, BounceKind::kTransmission);
  if (total < 0 || diffuse < 0 || glossy < 0 || transmission < 0) return false;
  const auto byte = [](int count, BounceKind kind) {
    constexpr int kMost = 127;
    return static_cast<std::uint32_t>(count < kMost ? count : kMost) << static_cast<int>(kind);
  };
  *left = byte(total, BounceKind::kAll) | byte(diffuse, BounceKind::kDiffuse) | byte(glossy, BounceKind::kGlossy) |
          byte(transmission, BounceKind::kTransmission);
  return true;
}

/// The flags of a path after an event that photons cannot take: whatever lies ahead is the path tracer's.
RELIEF_KERNEL std::uint32_t path_flags_left_to_paths(std::uint32_t flags)
{
  return flags & ~std::uint32_t{kPathAfterSoft | kPathCaustic};
}

/// Whether light that a sharp event takes to where a path comes from is no photon's: such caustics are switched off, and what sees
/// them nevertheless, after an event that is no diffuse one, is the path alone.
RELIEF_KERNEL bool path_is_alone(const KernelGlobals& g, std::uint32_t flags, bool transmitted)
{
  return (flags & kPathAfterSoft) != 0 && events_have(g.caustics.switched_off, transmitted);
}

/// The flags of a path after a scattering event.
/// @param sharp  the event's lobe, see sharp_lobes
RELIEF_KERNEL std::uint32_t path_caustic_flags(std::uint32_t flags, const InstanceView& instance, bool sharp)
{
  const std::uint32_t others = path_flags_left_to_paths(flags);
  if (sharp) return others | (path_caustic_after(flags, instance) ? kPathCaustic : 0u);
  return others | ((instance.flags & (kGathersPhotons | kGathersTails)) != 0 ? kPathAfterSoft : 0u);
}

/// Whether photons bring the light that lies ahead of the path.
/// @param light_index  −1: environment
RELIEF_KERNEL bool path_leaves_to_photons(const KernelGlobals& g, std::uint32_t flags, std::int32_t light_index)
{
  return (flags & kPathCaustic) != 0 && light_casts_caustics(g.lights, light_index);
}

/// How far a path's ray has come to its present hit, metres; a camera's from the near clipping plane, as Cycles has it.
RELIEF_KERNEL float path_ray_length(const KernelGlobals& g, const PathState& state, std::uint32_t path)
{
  const bool is_camera = static_cast<PathEvent>(path_event(state.flags[path])) == PathEvent::kCamera;
  if (!is_camera || !(g.camera.clip_start > 0.0f)) return state.hit_t[path];
  const bool is_panoramic = g.camera.projection == Projection::kPanoramic;
  const float axial = is_panoramic ? 1.0f : dot(path_direction(state, path), g.camera_forward);
  return state.hit_t[path] - g.camera.clip_start / axial;
}

}  // namespace relief
