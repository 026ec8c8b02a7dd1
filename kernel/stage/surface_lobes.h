// What stages ask of a hit's lobes, whether they are a list or lanes of columns.
#pragma once

#include "kernel/bsdf/lobe_pairs.h"
#include "kernel/bsdf/mixture_build.h"

namespace relief {

/// A denoiser is better told of what is behind or mirrored by a surface that scatters less than a quarter of its light by other
/// lobes than those up to this perceptual roughness, a width α of .075. The same bounds as Cycles'.
inline constexpr float kSeenThroughRoughness = 0.27386f;

/// Where closures put a hit's lobes. @return  null: those that are there are all
RELIEF_KERNEL MixtureLobes* lobes_begin(MixtureLobes& lobes)
{
  lobes.size = 0;
  return &lobes;
}
RELIEF_KERNEL MixtureLobes* lobes_begin(LobePairLane&) { return nullptr; }

/// Widens lobes as lobe_blur does. Those of columns are so already.
RELIEF_KERNEL void lobes_blur(MixtureLobes& lobes, float blur, float most_sharp)
{
  for (int i = 0; i < lobes.size; ++i) lobe_blur(lobes.lobes[i], blur, most_sharp);
}
RELIEF_KERNEL void lobes_blur(LobePairLane&, float, float) {}

/// Over all lobes of a hit.
struct LobesSum {
  float probability = 0;
  float sharp = 0;  ///< of those that a denoiser does not see, see kSeenThroughRoughness
  Vec3f weight{};
};

RELIEF_KERNEL LobesSum lobes_sum(const MixtureLobes& lobes)
{
  LobesSum sum;
  for (int i = 0; i < lobes.size; ++i) {
    const MixtureLobe& lobe = lobes.lobes[i];
    sum.probability += lobe.probability;
    sum.weight += lobe.weight;
    if (lobe.roughness <= kSeenThroughRoughness) sum.sharp += lobe.probability;
  }
  return sum;
}
RELIEF_KERNEL LobesSum lobes_sum(const LobePairLane& one)
{
  const LobePairs& h = *one.hits;
  const int k = one.lane;
  LobesSum sum;
  sum.probability = h.p_diffuse[k] + h.p_reflection[k];
  if (h.has_diffuse[k] != 0) sum.weight = load_lane(h.lobes.diffuse, k);
  if (h.has_reflection[k] != 0) sum.weight += load_lane(h.reflection, k);
  if (h.lobes.roughness[k] <= kSeenThroughRoughness) sum.sharp = h.p_reflection[k];
  return sum;
}

inline constexpr float kLeastLobeShare = 0.125f;

/// Makes the least chance of a lobe an eighth of all: where the camera looks, a faint reflection of something bright is seen.
/// The chances are Cycles'. They decide what counts as diffuse where limits of bounces end some kinds of path, and so the mean.
/// @param passing  chance of what passes through
RELIEF_KERNEL void lobes_defend(MixtureLobes& lobes, float passing)
{
  float sum = passing;
  for (int i = 0; i < lobes.size; ++i) sum += lobes.lobes[i].probability;
  for (int i = 0; i < lobes.size; ++i) {
    MixtureLobe& lobe = lobes.lobes[i];
    // What facets scatter more than once is part of their lobe.
    if (lobe.kind != MixtureLobeKind::kMultiple) lobe.probability = max(lobe.probability, kLeastLobeShare * sum);
  }
}
RELIEF_KERNEL void lobes_defend(LobePairLane& one, float passing)
{
  LobePairs& h = *one.hits;
  const int k = one.lane;
  const float least = kLeastLobeShare * (passing + h.p_diffuse[k] + h.p_reflection[k]);
  if (h.has_diffuse[k] != 0) h.p_diffuse[k] = max(h.p_diffuse[k], least);
  if (h.has_reflection[k] != 0) h.p_reflection[k] = max(h.p_reflection[k], least);
}

/// As lobes_are_delta of a list.
RELIEF_KERNEL bool lobes_are_delta(const LobePairLane& one)
{
  const LobePairs& h = *one.hits;
  return h.has_diffuse[one.lane] == 0 && (h.has_reflection[one.lane] == 0 || h.is_delta[one.lane] != 0);
}

/// Mean normal of lobes, by what they weigh.
/// @param otherwise  where there are none
/// @return           at most unit length; shorter where lobes disagree
RELIEF_KERNEL Vec3f lobes_normal(const MixtureLobes& lobes, Vec3f otherwise)
{
  Vec3f sum;
  float total = 0;
  for (int i = 0; i < lobes.size; ++i) {
    const Vec3f weight = lobes.lobes[i].weight;
    const float share = __builtin_fabsf(weight.x + weight.y + weight.z);
    sum += share * lobes.lobes[i].frame.n;
    total += share;
  }
  return is_zero(sum) ? otherwise : sum / total;
}
RELIEF_KERNEL Vec3f lobes_normal(const LobePairLane& one, Vec3f otherwise)
{
  const LobePairs& h = *one.hits;
  const bool is_there = (h.has_diffuse[one.lane] | h.has_reflection[one.lane]) != 0;
  return is_there ? load_lane(h.lobes.frame + 6, one.lane) : otherwise;
}

}  // namespace relief
