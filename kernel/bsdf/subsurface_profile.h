// How far from where light enters a surface it leaves again, as a distribution of distances: what Blender's Christensen-Burley method
// takes in place of walks.
//
// Christensen, Burley 2015, "Approximate Reflectance Profiles for Efficient Subsurface Scattering"; King, Kulla, Conty, Fajardo 2013,
// "BSSRDF Importance Sampling" [K13].
#pragma once

#include <cmath>
#include <initializer_list>

#include "kernel/math/trigonometry.h"
#include "kernel/math/vec.h"

namespace relief {

/// Free paths behind which the profile is cut off, as in Cycles.
inline constexpr float kProfileEnd = 16.0f;
/// Share of the whole profile's light before that: 1 − (e^−16 + 3 e^(−16/3)) / 4.
inline constexpr float kProfileShare = 0.9963790094f;

/// Density of distances, per metre: 2π r R(r) of an albedo of 1, without what is cut off.
/// @param free_path  metres, above 0
/// @param r          metres
/// @source           Eq. 3, where s is 1: Cycles since 3.0 leaves the albedo's fit out
RELIEF_KERNEL float profile_pdf(float free_path, float r)
{
  if (!(r < kProfileEnd * free_path)) return 0.0f;
  const float third = std::exp(r / (-3.0f * free_path));
  return (third * third * third + third) / (4.0f * kProfileShare * free_path);
}

/// @param u  in [0, 1)
/// @return   a distance in free paths, up to kProfileEnd
/// @source   Eq. 11, solved: with y = e^(−r/3), y³ + 3 y = 4 (1 − ξ), whose one real root is 2 sinh(asinh(2 (1 − ξ)) / 3)
RELIEF_KERNEL float profile_sample(float u)
{
  const float y = 2.0f * std::sinh(std::asinh(2.0f - 2.0f * kProfileShare * u) * (1.0f / 3.0f));
  return clamp(-3.0f * std::log(y), 0.0f, kProfileEnd);
}

/// A line along which places are looked for where light leaves.
struct ProfileProbe {
  Frame frame;    ///< n is the normal where light has entered
  int axis;       ///< along which it goes: 0 n, 1 and 2 the tangents
  Vec3f O, D;     ///< world; D unit
  float length;   ///< metres
  float density;  ///< of its distance from P
};

/// Tangents of probes. As profile_probe_gain is not what areas say, pictures depend on them: these are Cycles', which of cubes lie
/// diagonally.
/// @param N  unit, in a world whose y is up
RELIEF_KERNEL Frame profile_probe_frame(Vec3f N)
{
  Vec3f s = cross(Vec3f{1, 1, -1}, N);
  if (is_zero(s)) s = cross(Vec3f{-1, 1, -1}, N);
  s = normalize(s);
  return {s, cross(N, s), N};
}

inline constexpr float kProbeChances[3] = {0.5f, 0.25f, 0.25f};

/// Density of a distance in each channel; 0 in those that have no free path.
RELIEF_KERNEL Vec3f profile_densities(Vec3f free_path, float r)
{
  const auto of = [r](float scale) { return scale > 0.0f ? profile_pdf(scale, r) : 0.0f; };
  return {of(free_path.x), of(free_path.y), of(free_path.z)};
}

/// @param free_path  metres, of each channel; above 0 in one of them
/// @param P, N       where light has entered, and the unit normal there, world
/// @source           [K13]: across a disk of distances, which lies across the normal or a tangent. The line is as long as the channel
///                   whose distance it is needs, as in Cycles: what other channels hold farther along it is missed
RELIEF_KERNEL ProfileProbe profile_probe_make(Vec3f free_path, Vec3f P, Vec3f N, Vec2f u)
{
  float paths[3];
  int num = 0;
  for (const float path : {free_path.x, free_path.y, free_path.z}) {
    if (path > 0.0f) paths[num++] = path;
  }
  const float place = u.x * static_cast<float>(num);
  const int channel = static_cast<int>(min(place, static_cast<float>(num - 1)));
  const float r = paths[channel] * profile_sample(place - static_cast<float>(channel));
  ProfileProbe probe;
  probe.frame = profile_probe_frame(N);
  probe.axis = u.y < 0.5f ? 0 : u.y < 0.75f ? 1 : 2;
  const float before = probe.axis == 0 ? 0.0f : probe.axis == 1 ? 0.5f : 0.75f;
  const SinCos turn = sin_cos_turn((u.y - before) / kProbeChances[probe.axis]);
  const Vec3f axes[3] = {probe.frame.n, probe.frame.s, probe.frame.t};
  const Vec3f across = axes[(probe.axis + 1) % 3] * turn.cos + axes[(probe.axis + 2) % 3] * turn.sin;
  const float half = __builtin_sqrtf(max(0.0f, sqr(kProfileEnd * paths[channel]) - sqr(r)));
  probe.O = P + half * axes[probe.axis] + r * across;
  probe.D = -axes[probe.axis];
  probe.length = 2.0f * half;
  const Vec3f densities = profile_densities(free_path, r);
  probe.density = (densities.x + densities.y + densities.z) / static_cast<float>(num);
  return probe;
}

/// Factor on what leaves where a probe meets the surface.
/// @param r   metres from where light has entered
/// @param Ng  of the surface there, unit
/// @source    [K13], by the power heuristic. As in Cycles it is of densities of distances where areas' are meant: what a bent surface
///            lets out is brighter by r over the distance along the disk
RELIEF_KERNEL Vec3f profile_probe_gain(const ProfileProbe& probe, Vec3f free_path, float r, Vec3f Ng)
{
  const Frame& f = probe.frame;
  const float pdf[3] = {kProbeChances[0] * dot(f.n, Ng), kProbeChances[1] * dot(f.s, Ng),
                        kProbeChances[2] * dot(f.t, Ng)};
  const float squares = sqr(pdf[0]) + sqr(pdf[1]) + sqr(pdf[2]);
  return profile_densities(free_path, r) * (__builtin_fabsf(pdf[probe.axis]) / (squares * probe.density));
}

}  // namespace relief
