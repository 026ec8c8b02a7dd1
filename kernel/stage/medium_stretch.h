// A part of a ray that lies in the same media: of a path, or of a photon.
#pragma once

#include "kernel/stage/surface_interaction.h"
#include "kernel/volume/distance.h"
#include "kernel/volume/medium_walk.h"

namespace relief {

/// What a stretch of a ray through media is.
struct MediumStretch {
  Vec3f O, D;                          ///< where it begins, world
  float length;                        ///< metres; may be infinite
  std::uint32_t hash, sample, number;  ///< for random numbers
  Vec3f chances;                       ///< of channels
};

RELIEF_KERNEL MediaSum path_media(const KernelGlobals& g, const MediumState& m)
{
  MediaSum sum;
  for (int i = 0; i < m.size; ++i) {
    media_add(sum, g.media[medium_of_instance(g, m.inside[i])]);
  }
  return sum;
}

RELIEF_KERNEL Vec3f medium_albedo(const MediaSum& media)
{
  const auto albedo = [](float scattered, float all) { return all > 0.0f ? scattered / all : 0.0f; };
  return {albedo(media.sigma_s.x, media.sigma_t.x), albedo(media.sigma_s.y, media.sigma_t.y),
          albedo(media.sigma_s.z, media.sigma_t.z)};
}

/// A number by which photons in media are told from those in others, wherever these meet. It does not depend on the order in which they
/// were entered.
RELIEF_KERNEL std::uint32_t media_name(const MediumState& m)
{
  std::uint32_t name = 0;
  for (int i = 0; i < m.size; ++i) name += hash_mix_32(static_cast<std::uint32_t>(m.inside[i]));
  return name;
}

/// The next stretch of a path: from where its ray is searched to what it has met.
RELIEF_KERNEL MediumStretch medium_stretch_next(PathState& state, std::uint32_t path)
{
  const Vec3f D = path_direction(state, path);
  const float start = state.t_min[path];
  return {path_origin(state, path) + D * start,
          D,
          max(0.0f, state.hit_t[path] - start),
          state.pixel_hash[path],
          state.sample_index[path],
          state.media[path].stretches++,
          {}};
}

/// Of random numbers along a stretch through media that vary.
RELIEF_KERNEL std::uint32_t medium_seed(const MediumStretch& at)
{
  return hash_mix_32(at.hash ^ hash_mix_32(at.sample * 0x9e3779b9u + at.number));
}

/// What graphs of media may read of a path's ray.
RELIEF_KERNEL GraphRay medium_graph_ray(const PathState& state, std::uint32_t path)
{
  return {path_ray_kinds(state, path), state.bounces[path], state.flags[path] >> kPathTransparentShift, 0.0f,
          path_time(state, path)};
}

enum class MediumHit : std::uint8_t { kSurface, kLight, kNothing };

/// Notes what begins or ends at what a path has met.
/// @return  whether it is a boundary alone
RELIEF_KERNEL bool medium_meet(const KernelGlobals& g, PathState& state, std::uint32_t path, MediumHit hit)
{
  MediumState& m = state.media[path];
  m.hit_inside = kWholeWorld;
  if (hit == MediumHit::kNothing) medium_leave_all(m);
  if (hit != MediumHit::kSurface) return false;
  const InstanceView& instance = path_instance(g, state, path);
  const Material& material = g.materials[instance.material_index];
  if (material.medium_index < 0) return false;
  const PrimitivePlane plane = hit_plane(g, state, path, instance);
  m.hit_inside = static_cast<std::int32_t>(state.hit_object[path]);
  m.hit_front = dot(path_direction(state, path), plane.Ng) <= 0.0f;
  m.hit_P = plane.P;
  m.hit_Ng = m.hit_front ? plane.Ng : -plane.Ng;
  return material.is_boundary;
}

/// Sends a path on behind a boundary, or ends it.
RELIEF_KERNEL void medium_pass_boundary(PathState& state, std::uint32_t path, QueueView& next)
{
  if (++state.media[path].boundaries > kMostBoundaries) return;
  state.t_min[path] = t_min_behind(state.hit_t[path]);
  queue_push(next, path);
}

/// Takes a path through media to what it has met.
/// @param stretch  called without arguments where there are any on the way; whether the path gets through
/// @return         whether what it has met is shaded; else it has passed a boundary (pushed on `next`), or stretch() has done with it
template <typename Stretch>
RELIEF_KERNEL bool medium_travel(const KernelGlobals& g,
                                 PathState& state,
                                 std::uint32_t path,
                                 MediumHit hit,
                                 QueueView& next,
                                 const Stretch& stretch)
{
  MediumState& m = state.media[path];
  const bool is_boundary = medium_meet(g, state, path, hit);
  if (m.size > 0 && !stretch()) {
    m.hit_inside = kWholeWorld;
    return false;
  }
  if (!is_boundary) return true;
  medium_pass_boundary(state, path, next);
  return false;
}

}  // namespace relief
