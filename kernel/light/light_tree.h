// Choice among many lights by a tree of bounds. A child of a node is a light or a group of lights, known by a sphere around
// them and by their intensity and how it depends on the direction, which give an estimate of the irradiance they cause at
// a point; the walk goes down by these estimates. Read LightTreeBlock, light_tree_estimate, then light_tree_sample and its
// inverse light_tree_pdf.
//
// Nodes have up to 32 children in blocks of eight that SIMD evaluates together. An estimate of a large group is poor and
// every level multiplies by another one, so wide nodes choose better; and a level waits for memory, square root, division
// and the choice whatever its width. Among 20,000 triangles of a thousand lanterns, nodes of 8, 16 and 32 children leave
// relative variances of .38, .27 and .11 to a sample, shadows aside, and their walks take the same time.
// Up to 32 lights are a single node, so a scene with few lights chooses by the lights' own estimates and walks nothing.
//
// Instances of one emissive mesh share its lights and a part of the tree, both in object space: to the rest of the tree each
// of them is a single light, and a walk that gets there goes on at the point as the instance sees it. So 20,000 triangles of
// a thousand lanterns take .2 MiB instead of 3.6, which the second-level cache holds, and a picture of them .9 of the time.
//
// Source: Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting". We differ in
// the estimate: theirs bounds both cosines from above, ours is near their means over the group, which left a third of the
// variance at the same width, and needs one square root for their five. The build is in
// integrator/light_set.cpp.
#pragma once

#include "kernel/light/light_receiver.h"
#include "kernel/math/affine.h"
#include "kernel/sample/choice.h"

#ifdef __AVX__
#include <immintrin.h>
#endif

namespace relief {

inline constexpr int kLightTreeLanes = 8;  ///< children of a block
inline constexpr int kLightTreeMaxBlocks = 4;
inline constexpr int kLightTreeWidth = kLightTreeLanes * kLightTreeMaxBlocks;  ///< most children of a node

/// Bounds of up to eight lights or groups, one a lane; 32 bytes each. Unused lanes have intensity 0.
///
/// In a direction ω, unit, the lights of a child together send out intensity × min(1, constant + slope · ω), or nothing
/// where that is negative; with kLightTreeDimSide kLightTreeDim at least. Halves of words are upper halves of floats, named from the lower half up.
struct alignas(64) LightTreeBlock {
  float cx[kLightTreeLanes] = {}, cy[kLightTreeLanes] = {}, cz[kLightTreeLanes] = {};  ///< sphere's centre, world
  float intensity[kLightTreeLanes] = {};                                               ///< W/sr, mean of R, G, B
  std::uint32_t link[kLightTreeLanes] = {};      ///< light, or first block of a node; with the flags below
  std::uint32_t radii[kLightTreeLanes] = {};     ///< the sphere's × (|slope| + |constant|); the sphere's, rounded up
  std::uint32_t slope_xy[kLightTreeLanes] = {};  ///< slope.x; slope.y
  std::uint32_t slope_z_constant[kLightTreeLanes] = {};
};
static_assert(sizeof(LightTreeBlock) == 32 * kLightTreeLanes);

inline constexpr std::uint32_t kLightTreeTwoSided = 1u << 31;  ///< in `link`: |slope · ω|
inline constexpr std::uint32_t kLightTreeLeaf = 1u << 30;      ///< in `link`: a light, or
inline constexpr std::uint32_t kLightTreeCopy = 1u << 28;      ///< in `link` of a leaf: a LightCopy
inline constexpr int kLightTreeBlocksShift = 28;               ///< in `link` of a node: its blocks less one, two bits
inline constexpr std::uint32_t kLightTreeDimSide =
    1u << 27;  ///< in `link`: a little leaves in any direction, see Light::dark_side
inline constexpr std::uint32_t kLightTreeIndexMask = kLightTreeDimSide - 1;
inline constexpr float kLightTreeDim = 0x1p-5f;  ///< that little, as part of the intensity
static_assert(kLightTreeMaxBlocks <= 4);

/// A light's way down from the root: five bits a level, the first level's lowest.
using LightTrail = std::uint64_t;
inline constexpr int kLightTreeTrailBits = 5;
inline constexpr int kLightTreeMaxDepth = 12;
static_assert(1 << kLightTreeTrailBits == kLightTreeWidth && kLightTreeTrailBits * kLightTreeMaxDepth <= 64);

/// One of several instances of an emissive mesh. Its lights and its part of the tree are the mesh's, in object space.
struct alignas(64) LightCopy {
  Affine3 object_from_world;
  float scale = 1;         ///< of world_from_object, which is a similarity: lengths grow by this
  std::uint32_t root = 0;  ///< of the mesh's part, as LightTreeBlock::link: a node, or its only light
  LightTrail trail = 0;    ///< way down to this leaf
  Affine3 world_from_object;
  std::int32_t instance_index = -1;
};
static_assert(sizeof(LightCopy) == 128);

/// The tree's nodes; without blocks there is no finite light.
struct LightTreeView {
  const LightTreeBlock* blocks = nullptr;
  std::uint32_t root = 0;  ///< as LightTreeBlock::link
  const LightCopy* copies = nullptr;
};

/// Eight lanes; compilers that have no registers so wide split them.
using LightLanes [[gnu::vector_size(4 * kLightTreeLanes)]] = float;
using LightWords [[gnu::vector_size(4 * kLightTreeLanes)]] = std::uint32_t;

// The generic forms turn into a comparison and a blend where there is one instruction.
#ifdef __AVX__
RELIEF_KERNEL LightLanes light_lanes_max(LightLanes a, LightLanes b) { return _mm256_max_ps(a, b); }
RELIEF_KERNEL LightLanes light_lanes_min(LightLanes a, LightLanes b) { return _mm256_min_ps(a, b); }
RELIEF_KERNEL LightLanes light_lanes_sqrt(LightLanes a) { return _mm256_sqrt_ps(a); }
#else
RELIEF_KERNEL LightLanes light_lanes_max(LightLanes a, LightLanes b) { return a > b ? a : b; }
RELIEF_KERNEL LightLanes light_lanes_min(LightLanes a, LightLanes b) { return a < b ? a : b; }
RELIEF_KERNEL LightLanes light_lanes_sqrt(LightLanes a)
{
  for (int i = 0; i < kLightTreeLanes; ++i) a[i] = __builtin_sqrtf(a[i]);
  return a;
}
#endif
RELIEF_KERNEL LightLanes light_lanes_load(const float* from)
{
  LightLanes lanes;
  __builtin_memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}
RELIEF_KERNEL LightWords light_words_load(const std::uint32_t* from)
{
  LightWords lanes;
  __builtin_memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}
/// Floats whose upper halves are the lower, or the upper, halves of words.
RELIEF_KERNEL LightLanes light_lanes_low(LightWords words) { return __builtin_bit_cast(LightLanes, words << 16); }
RELIEF_KERNEL LightLanes light_lanes_high(LightWords words)
{
  return __builtin_bit_cast(LightLanes, words & 0xffff0000u);
}

/// Estimates for the children of one node.
struct LightEstimates {
  /// [0, 1e34]; 0: certainly nothing. Undefined for blocks that the node does not have.
  alignas(32) float value[kLightTreeMaxBlocks][kLightTreeLanes];
  alignas(32) float lane_sum[kLightTreeLanes];  ///< over the blocks
  float before[kLightTreeLanes];                ///< sum of `lane_sum` over the lanes before
  float sum = 0;
};

/// Estimates what each child's lights bring at a point, their irradiance where nothing is glossy: never 0 where one of them contributes.
///
/// The distance to the sphere's centre is softened by its radius, h² = d² + r²/4. A cosine, or a profile of the intensity,
/// is taken to the centre as c, and replaced by max(0, c, .3 (c + s) + .01) with s = r / h: near the mean of max(0, c) over
/// a sphere that reaches below the horizon, where light has c + s > 0. The .01 is a floor for whatever contributes, so
/// that rounding, a few thousandths at most, turns no sliver of a light into nothing nor its probability into one that
/// makes fireflies. Tuned on a thousand lanterns, where a third more of either constant costs up to a fifth of the variance.
/// @param link  the node
/// @param at    light from below its plane does not count
/// @cost        a square root, a division and forty other instructions a block; fifteen more and a division where it is glossy
RELIEF_KERNEL void light_tree_estimate(LightTreeView tree,
                                       std::uint32_t link,
                                       Vec3f P,
                                       const LightReceiver& at,
                                       LightEstimates& estimates)
{
  const Vec3f N = at.N;
  constexpr float kReaching = 0.3f, kFloor = 0.01f;
  const LightLanes zero = {}, one = zero + 1.0f, most = zero + 1e30f;
  // Without a normal, everything is received.
  const float least_received = is_zero(N) ? 1.0f : kFloor;
  const LightTreeBlock* blocks = tree.blocks + (link & kLightTreeIndexMask);
  const int last = static_cast<int>(link >> kLightTreeBlocksShift) % kLightTreeMaxBlocks;
  LightLanes lane_sum = zero;
  for (int b = 0; b <= last; ++b) {
    const LightTreeBlock& block = blocks[b];
    const LightLanes x = P.x - light_lanes_load(block.cx);
    const LightLanes y = P.y - light_lanes_load(block.cy);
    const LightLanes z = P.z - light_lanes_load(block.cz);
    const LightWords radii = light_words_load(block.radii);
    const LightLanes radius = light_lanes_high(radii), half_radius = radius * 0.5f;
    // A point light's own position would divide by zero; 1e-30 is far below any distance with a usable answer.
    const LightLanes inverse =
        1.0f / light_lanes_sqrt(x * x + (y * y + (z * z + (half_radius * half_radius + 1e-30f))));

    const LightWords slope_xy = light_words_load(block.slope_xy);
    const LightWords slope_z_constant = light_words_load(block.slope_z_constant);
    const LightLanes slope =
        light_lanes_low(slope_xy) * x + light_lanes_high(slope_xy) * y + light_lanes_low(slope_z_constant) * z;
    const LightWords sign_mask = light_words_load(block.link) & kLightTreeTwoSided;
    const LightLanes slope_folded = __builtin_bit_cast(LightLanes, __builtin_bit_cast(LightWords, slope) & ~sign_mask);
    const LightLanes profile = slope_folded * inverse + light_lanes_high(slope_z_constant);
    const LightLanes reaching = kReaching * inverse;
    const LightLanes profile_reaching = kReaching * profile + (reaching * light_lanes_low(radii) + kFloor);
    const LightWords has_dim_side = (light_words_load(block.link) & kLightTreeDimSide) != 0;
    const LightLanes least_emitted =
        __builtin_bit_cast(LightLanes, has_dim_side & __builtin_bit_cast(std::uint32_t, kLightTreeDim));
    const LightLanes emitted =
        light_lanes_max(least_emitted, light_lanes_min(one, light_lanes_max(profile, profile_reaching)));

    const LightLanes cosine = (-N.x * x - N.y * y - N.z * z) * inverse;
    const LightLanes cosine_reaching = kReaching * cosine + (reaching * radius + least_received);
    LightLanes received = light_lanes_max(zero, light_lanes_max(cosine, cosine_reaching));
    if (const LightGloss& gloss = at.gloss; gloss.share > 0.0f) {
      const LightLanes off = light_lanes_max(zero, one + (gloss.R.x * x + gloss.R.y * y + gloss.R.z * z) * inverse);
      const LightLanes seen = inverse * radius;
      const LightLanes shown = light_gloss_eval(gloss, off, seen * seen);
      // Nothing shows from below.
      received = (1.0f - gloss.share) * received + gloss.share * light_lanes_min(shown, received * 1e6f);
    }

    const LightLanes unshaded = light_lanes_min(light_lanes_load(block.intensity) * inverse * inverse, most);
    const LightLanes value = unshaded * (emitted * received);
    __builtin_memcpy(estimates.value[b], &value, sizeof(value));
    lane_sum += value;
  }
  __builtin_memcpy(estimates.lane_sum, &lane_sum, sizeof(lane_sum));
  estimates.sum = 0.0f;
  for (int i = 0; i < kLightTreeLanes; ++i) {
    estimates.before[i] = estimates.sum;
    estimates.sum += lane_sum[i];
  }
}

/// Takes a walk from the world to the mesh that a copy is of.
/// @param P, at  from world to object space; vectors stay of unit length, or zero
/// @return       where the walk goes on
RELIEF_KERNEL std::uint32_t light_copy_enter(const LightCopy& copy, Vec3f& P, LightReceiver& at)
{
  // The difference first: far from the origin little would be left of two large numbers.
  P = transform_vector(copy.object_from_world, P - copy.world_from_object.p);
  at.N = transform_vector(copy.object_from_world, at.N) * copy.scale;
  at.gloss.R = transform_vector(copy.object_from_world, at.gloss.R) * copy.scale;
  return copy.root;
}

struct LightChoice {
  std::uint32_t light_index = 0;
  std::int32_t copy_index = -1;  ///< −1: the light is no instance's
  float probability = 0;         ///< 0: none; the walk can end in a group none of whose members turns out to contribute
  double rest = 0;               ///< [0, 1): what the choice has left of its number, uniform again
};

/// Chooses one of the finite lights.
/// @param root  estimates of tree.root at the same point
/// @param u     [0, 1), double: each level uses up some of its bits
RELIEF_KERNEL LightChoice
light_tree_sample(LightTreeView tree, const LightEstimates& root, Vec3f P, LightReceiver receiver, double u)
{
  // Less than one by so much that its product with a float is less than that float.
  constexpr float kBelowOne = 1.0f - 0x1p-23f;
  LightEstimates below;
  const LightEstimates* at = &root;
  std::uint32_t link = tree.root;
  std::int32_t copy_index = -1;
  float probability = 1.0f;
  while (at->sum > 0.0f) {
    // First a lane, by the sums over the blocks, then the block. Counting running sums that are not above the target
    // needs no branch, which would be mispredicted half of the time, and never ends at a weight of zero.
    const float lane_target = min(static_cast<float>(u), kBelowOne) * at->sum;
    int lane = -1;
    for (int i = 0; i < kLightTreeLanes; ++i) lane += at->before[i] <= lane_target ? 1 : 0;
    const float block_target = min(lane_target - at->before[lane], at->lane_sum[lane] * kBelowOne);
    const int last = static_cast<int>(link >> kLightTreeBlocksShift) % kLightTreeMaxBlocks;
    int block = 0;
    float passed = 0.0f, block_running = 0.0f;
    for (int b = 0; b < last; ++b) {
      block_running += at->value[b][lane];
      const bool pass = block_running <= block_target;
      block += pass ? 1 : 0;
      passed = pass ? block_running : passed;
    }
    const float value = at->value[block][lane];
    // In double, for what is left of u has to choose at the levels below, and a place on the light.
    u = choice_rest(
        u * static_cast<double>(at->sum) - static_cast<double>(at->before[lane]) - static_cast<double>(passed),
        static_cast<double>(value));
    probability *= value / at->sum;
    link = tree.blocks[(link & kLightTreeIndexMask) + static_cast<std::uint32_t>(block)].link[lane];
    if ((link & (kLightTreeLeaf | kLightTreeCopy)) == (kLightTreeLeaf | kLightTreeCopy)) {
      copy_index = static_cast<std::int32_t>(link & kLightTreeIndexMask);
      link = light_copy_enter(tree.copies[copy_index], P, receiver);
    }
    if ((link & kLightTreeLeaf) != 0) return {link & kLightTreeIndexMask, copy_index, probability, u};
    light_tree_estimate(tree, link, P, receiver, below);
    at = &below;
  }
  return {};
}

/// Probability with which light_tree_sample chooses a light.
/// @param root        estimates of tree.root at the same point
/// @param trail       the light's: from the root, or from its mesh's part on
/// @param copy_index  −1: the light is no instance's
/// @return            0 for lights that are not in the tree
RELIEF_KERNEL float light_tree_pdf(LightTreeView tree,
                                   const LightEstimates& root,
                                   Vec3f P,
                                   LightReceiver receiver,
                                   std::uint32_t light_index,
                                   LightTrail trail,
                                   std::int32_t copy_index)
{
  LightEstimates below;
  const LightEstimates* at = &root;
  std::uint32_t link = tree.root;
  const std::uint32_t copy_leaf = kLightTreeLeaf | kLightTreeCopy | static_cast<std::uint32_t>(copy_index);
  LightTrail trail_below = 0;
  if (copy_index >= 0) {
    trail_below = trail;
    trail = tree.copies[copy_index].trail;
  }
  float probability = 1.0f;
  while (at->sum > 0.0f) {
    const auto child = static_cast<std::uint32_t>(trail % kLightTreeWidth);
    trail /= kLightTreeWidth;
    // Lights of zero intensity have no leaf; whatever trail they carry may lead to a block that is not there.
    if (child / kLightTreeLanes > (link >> kLightTreeBlocksShift) % kLightTreeMaxBlocks) return 0.0f;
    probability *= at->value[child / kLightTreeLanes][child % kLightTreeLanes] / at->sum;
    if (!(probability > 0.0f)) return 0.0f;
    link = tree.blocks[(link & kLightTreeIndexMask) + child / kLightTreeLanes].link[child % kLightTreeLanes];
    link &= ~(kLightTreeTwoSided | kLightTreeDimSide);
    if (copy_index >= 0 && link == copy_leaf) {
      link = light_copy_enter(tree.copies[copy_index], P, receiver);
      trail = trail_below;
      copy_index = -1;
    }
    if ((link & kLightTreeLeaf) != 0) {
      const bool found = copy_index < 0 && link == (kLightTreeLeaf | light_index);
      return found ? probability : 0.0f;
    }
    light_tree_estimate(tree, link, P, receiver, below);
    at = &below;
  }
  return 0.0f;
}

}  // namespace relief
