#include "integrator/subsurface_stage.h"

#include <cmath>

#include "integrator/path_lod.h"
#include "kernel/bsdf/subsurface_profile.h"
#include "kernel/math/rounding.h"
#include "kernel/stage/subsurface_walk.h"
#include "kernel/stage/surface_interaction.h"

namespace relief {

namespace {

/// Probes of a profile give up after so many hits, as in Cycles.
constexpr int kMostProbed = 256;

/// What a ray has met.
struct Met {
  unsigned part;  ///< an instance; RTC_INVALID_GEOMETRY_ID: nothing
  RTCRayHit ray;
};

/// Takes the paths of a queue through what they have entered.
struct Walker {
  const KernelGlobals& g;
  const Accel& accel;
  const WalkStages& stages;
  PathState& state;
  const QueueView& queue;
  QueueView& left;
  std::uint32_t next = 0;  ///< of the queue
  EmbreeContext context{};

  /// The nearest hit on the object that a path is in, on whichever of its parts.
  /// @param t_min  0, or behind a hit
  /// @return       the part, an instance; RTC_INVALID_GEOMETRY_ID: none is met
  unsigned meet(std::uint32_t path, Vec3f P, Vec3f D, float t_min, float t_max, RTCRayHit& ray);
  /// All of them, eight walks at a time.
  void walk();
  /// Begins the walk of the next path that has one. @return  false: none is left
  bool begin(SubsurfaceWalks& walks, int lane, std::uint32_t& path);
  /// Looks along the way that a walk has chosen. @return  metres to what is met; infinite: nothing
  float meet_walk(std::uint32_t path, const SubsurfaceWalks& walks, int lane, Met& met);
  void leave_walk(std::uint32_t path, const SubsurfaceWalks& walks, int lane, const Met& met);
  bool leave_by_profile(std::uint32_t path);
  /// Takes a hit for the path's.
  void take(std::uint32_t path, unsigned part, const RTCRayHit& ray);
};

unsigned Walker::meet(std::uint32_t path, Vec3f P, Vec3f D, float t_min, float t_max, RTCRayHit& ray)
{
  ray.ray.org_x = P.x, ray.ray.org_y = P.y, ray.ray.org_z = P.z;
  ray.ray.dir_x = D.x, ray.ray.dir_y = D.y, ray.ray.dir_z = D.z;
  ray.ray.tnear = t_min;
  ray.ray.tfar = t_max;
  ray.ray.time = path_time(state, path);
  ray.ray.mask = ~0u;
  ray.ray.id = 0;
  ray.ray.flags = 0;
  const std::uint32_t own = state.hit_object[path];
  return accel.intersect_only(context, ray, [this, own](unsigned object) {
    return accel.are_of_one_object(object, own) && (g.instances[object].flags & kCurves) == 0;
  });
}

void Walker::take(std::uint32_t path, unsigned part, const RTCRayHit& ray)
{
  state.hit_object[path] = part;
  state.hit_triangle[path] = ray.hit.primID;
  state.hit_u[path] = ray.hit.u;
  state.hit_v[path] = ray.hit.v;
  path_resolve_hit(g, accel, state, path, ray.hit.Ng_x);
}

/// A path leaves by a profile: at one of the places where a probe meets its object, chosen by its share of what they carry together.
bool Walker::leave_by_profile(std::uint32_t path)
{
  const SubsurfaceState& below = state.subsurface.entries[path];
  const Vec3f free_path = below.surface.radius, P = path_origin(state, path);
  const std::uint32_t hash = state.pixel_hash[path], sample = state.sample_index[path];
  const int bounce = path_surface(state, path);
  const Vec2f u = sample_2d(hash, sample, dimension_below(bounce, 0));
  const ProfileProbe probe = profile_probe_make(free_path, P, -path_direction(state, path), u);
  float u_choice = sample_1d(hash, sample, dimension_below(bounce, 1)), sum = 0.0f, t_min = 0.0f;
  Vec3f P_left, N_left, carried;
  RTCRayHit ray, left{};
  unsigned left_part = RTC_INVALID_GEOMETRY_ID;
  for (int hit = 0; hit < kMostProbed; ++hit) {
    const unsigned part = meet(path, probe.O, probe.D, t_min, probe.length, ray);
    if (part == RTC_INVALID_GEOMETRY_ID) break;
    t_min = t_min_behind(ray.ray.tfar);
    take(path, part, ray);
    const Vec3f Ng = normalize(hit_plane(g, state, path, path_instance(g, state, path)).Ng);
    const Vec3f P_hit = probe.O + ray.ray.tfar * probe.D;
    const Vec3f gain = profile_probe_gain(probe, free_path, length(P_hit - P), Ng);
    const float weight = mean_component(gain);
    if (!(weight > 0.0f && weight < kInfinity)) continue;
    sum += weight;
    const float share = weight / sum;
    if (!(u_choice < share)) {
      u_choice = (u_choice - share) / (1.0f - share);
      continue;
    }
    u_choice /= share;
    left = ray;
    left_part = part;
    P_left = P_hit;
    N_left = below.front ? Ng : -Ng;
    carried = gain / weight;
  }
  if (!(sum > 0.0f)) return false;
  const float way = length(P_left - P);
  path_set_ray(state, path, P_left + way * N_left, -N_left);
  state.hit_t[path] = way;
  state.throughput[path] = path_throughput(state, path) * carried * sum;
  take(path, left_part, left);
  if (state.media != nullptr) state.media[path].hit_inside = kWholeWorld;
  return true;
}

float Walker::meet_walk(std::uint32_t path, const SubsurfaceWalks& walks, int lane, Met& met)
{
  LodCone cone;
  if (accel.displacements().has_levels()) {
    cone = PathLod(state, path).cone(state.cone_width[path], 0.0f);
    context.cones = &cone;
  }
  met.part = meet(path, lane_of(walks.P, lane), lane_of(walks.D, lane), 0.0f, walks.reach[lane], met.ray);
  context.cones = nullptr;
  return met.part != RTC_INVALID_GEOMETRY_ID ? met.ray.ray.tfar : kInfinity;
}

void Walker::leave_walk(std::uint32_t path, const SubsurfaceWalks& walks, int lane, const Met& met)
{
  // Paths come from outside to where they are shaded.
  const Vec3f D = lane_of(walks.D, lane);
  const float t = walks.t[lane];
  path_set_ray(state, path, lane_of(walks.P, lane) + t * D, -D);
  state.hit_t[path] = t;
  state.throughput[path] = lane_of(walks.throughput, lane);
  // What fills the object besides is not walked in.
  if (state.media != nullptr) state.media[path].hit_inside = kWholeWorld;
  take(path, met.part, met.ray);
  queue_push(left, path);
}

bool Walker::begin(SubsurfaceWalks& walks, int lane, std::uint32_t& path)
{
  while (next < queue.size) {
    path = queue.paths[next++];
    if (state.subsurface.entries[path].surface.entry == SubsurfaceEntry::kProfile) {
      if (leave_by_profile(path)) queue_push(left, path);
    } else if (stages.begin(state, path, walks, lane)) {
      return true;
    }
  }
  return false;
}

void Walker::walk()
{
  constexpr int kLanes = 8;
  SubsurfaceWalks walks{};
  std::uint32_t paths[kLanes];
  Met met[kLanes];
  unsigned active = 0;
  for (int lane = 0; lane < kLanes; ++lane) active |= static_cast<unsigned>(begin(walks, lane, paths[lane])) << lane;
  while (active != 0) {
    stages.choose(walks);
    for (unsigned rest = active; rest != 0; rest &= rest - 1) {
      const int lane = __builtin_ctz(rest);
      walks.met[lane] = meet_walk(paths[lane], walks, lane, met[lane]);
    }
    stages.go(walks);
    for (unsigned rest = active; rest != 0; rest &= rest - 1) {
      const int lane = __builtin_ctz(rest);
      if (walks.fate[lane] == kWalkGoesOn) continue;
      if (walks.fate[lane] == kWalkIsOut) leave_walk(paths[lane], walks, lane, met[lane]);
      if (!begin(walks, lane, paths[lane])) active &= ~(1u << lane);
    }
  }
}

}  // namespace

void walk_below_surfaces(const KernelGlobals& g,
                         const Accel& accel,
                         const WalkStages& stages,
                         PathState& state,
                         const QueueView& queue,
                         QueueView& left,
                         DisplacementWork& displacement)
{
  Walker walker{g, accel, stages, state, queue, left};
  embree_context_init(walker.context, false);
  walker.context.displacement = &displacement.total;
  walker.context.texels = accel.displacements().texels();
  walker.walk();
}

}  // namespace relief
