// What stages ask of a hit's lobes, whether they are a list or lanes of columns.
#pragma once

#include "kernel/bsdf/hit_columns.h"
#include "kernel/bsdf/mixture_build.h"
#include "kernel/light/light_receiver.h"

namespace relief {

/// Where closures put a hit's lobes. @return  null: those that are there are all
RELIEF_KERNEL MixtureLobes* lobes_begin(MixtureLobes& lobes)
{
  lobes.size = 0;
  return &lobes;
}
RELIEF_KERNEL MixtureLobes* lobes_begin(HitLane&) { return nullptr; }

/// Frame about a hit's shading normal. Columns have it.
RELIEF_KERNEL Frame lobes_side(const MixtureLobes&, Vec3f Ns) { return frame_from_normal(Ns); }
RELIEF_KERNEL Frame lobes_side(const HitLane& one, Vec3f)
{
  const auto& side = one.hits->side;
  return {load_lane(side, one.lane), load_lane(side + 3, one.lane), load_lane(side + 6, one.lane)};
}

/// Widens lobes as lobe_blur does. Those of columns are so already.
RELIEF_KERNEL void lobes_blur(MixtureLobes& lobes, float blur, float most_sharp)
{
  for (int i = 0; i < lobes.size; ++i) lobe_blur(lobes.lobes[i], blur, most_sharp);
}
RELIEF_KERNEL void lobes_blur(HitLane&, float, float) {}

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
/// @pre  the hit's lobes are as hit_columns_begin has left them
RELIEF_KERNEL LobesSum lobes_sum(const HitLane& one)
{
  const LobesSum8& sum = one.hits->sum;
  return {sum.probability[one.lane], sum.sharp[one.lane], load_lane(sum.weight, one.lane)};
}

/// Whether some lobe sends light through the surface. Of lists their closures know.
RELIEF_KERNEL bool lobes_transmit(const MixtureLobes&) { return false; }
RELIEF_KERNEL bool lobes_transmit(const HitLane& one)
{
  const LobeColumns& c = one.hits->lobes;
  for (int i = 0; i < c.num_lobes; ++i) {
    if (mixture_traits(c.lobes[i].is.kind).sides != LobeSides::kReflect && c.lobes[i].is_there[one.lane] != 0) {
      return true;
    }
  }
  return false;
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
RELIEF_KERNEL void lobes_defend(HitLane& one, float passing)
{
  LobeColumns& c = one.hits->lobes;
  const int k = one.lane;
  float sum = passing;
  for (int i = 0; i < c.num_lobes; ++i) sum += c.lobes[i].probability[k];
  for (int i = 0; i < c.num_lobes; ++i) {
    LobeColumn& lobe = c.lobes[i];
    if (lobe.is_there[k] != 0) lobe.probability[k] = max(lobe.probability[k], kLeastLobeShare * sum);
  }
}

/// A lobe that reflects, as the choice of a light sees it.
/// @param probability, sum  of it and of all lobes
RELIEF_KERNEL LightGloss lobe_gloss(const Frame& frame, Vec3f wo, float roughness, float probability, float sum)
{
  const float alpha2 = sqr(sqr(roughness));
  if (!(probability >= kLeastGlossShare * sum) || alpha2 < kLeastGlossAlpha2) return {};
  const Vec3f R = from_local(frame, {-wo.x, -wo.y, wo.z});
  return {R, min(probability / sum, kMostGlossShare), min(alpha2, 1.0f)};
}

/// The strongest of lobes that reflect and have a width.
RELIEF_KERNEL LightGloss lobes_gloss(const MixtureLobes& lobes)
{
  const MixtureLobe* strongest = nullptr;
  float sum = 0;
  for (int i = 0; i < lobes.size; ++i) {
    const MixtureLobe& lobe = lobes.lobes[i];
    sum += lobe.probability;
    const bool is_glossy =
        mixture_lobe_event(lobe.kind) == EventKind::kGlossy && lobe.roughness < kInfinity && !lobe.is_delta;
    if (is_glossy && lobe.probability > (strongest != nullptr ? strongest->probability : 0.0f)) strongest = &lobe;
  }
  if (strongest == nullptr) return {};
  return lobe_gloss(strongest->frame, strongest->wo, strongest->roughness, strongest->probability, sum);
}
RELIEF_KERNEL LightGloss lobes_gloss(const HitLane& one)
{
  const LobeColumns& c = one.hits->lobes;
  const int k = one.lane;
  const LobeColumn* strongest = nullptr;
  float sum = 0;
  for (int i = 0; i < c.num_lobes; ++i) {
    const LobeColumn& lobe = c.lobes[i];
    sum += lobe.probability[k];
    const bool is_glossy = mixture_lobe_event(lobe.is.kind) == EventKind::kGlossy && lobe.roughness[k] < kInfinity &&
                           lobe.is_delta[k] == 0;
    if (is_glossy && lobe.probability[k] > (strongest != nullptr ? strongest->probability[k] : 0.0f)) strongest = &lobe;
  }
  if (strongest == nullptr) return {};
  const LobeFrames& f = c.frames[strongest->frame];
  const Frame frame{load_lane(f.frame, k), load_lane(f.frame + 3, k), load_lane(f.frame + 6, k)};
  return lobe_gloss(frame, load_lane(f.wo, k), strongest->roughness[k], strongest->probability[k], sum);
}

/// As lobes_are_delta of a list.
RELIEF_KERNEL bool lobes_are_delta(const HitLane& one)
{
  const LobeColumns& c = one.hits->lobes;
  bool are_delta = true;
  for (int i = 0; i < c.num_lobes; ++i) {
    are_delta = are_delta && (c.lobes[i].is_there[one.lane] == 0 || c.lobes[i].is_delta[one.lane] != 0);
  }
  return are_delta;
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
RELIEF_KERNEL Vec3f lobes_normal(const HitLane& one, Vec3f otherwise)
{
  const LobeColumns& c = one.hits->lobes;
  Vec3f sum;
  float total = 0;
  for (int i = 0; i < c.num_lobes; ++i) {
    const Vec3f weight = load_lane(c.lobes[i].weight, one.lane);
    const float share = weight.x + weight.y + weight.z;
    if (!(share > 0.0f)) continue;
    sum += share * load_lane(c.frames[c.lobes[i].frame].frame + 6, one.lane);
    total += share;
  }
  return is_zero(sum) ? otherwise : sum / total;
}

}  // namespace relief
