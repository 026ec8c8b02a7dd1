// Choice among many lights by a tree of bounds. A child of a node is a light or a group of lights, known by a sphere around
// them, a cone around their axes and their summed intensity, which give an estimate of the irradiance they cause at a
// point; the walk goes down by these estimates. Read LightTreeNode, light_tree_estimate, then light_tree_sample and its
// inverse light_tree_pdf.
//
// Nodes have eight children, evaluated together: an estimate of a large group is poor, and where binary trees multiply
// three poor choices this one compares eight smaller groups at once, in SIMD. Up to eight lights are a single node, so a
// scene with few lights chooses by the lights' own estimates and walks nothing.
//
// Source: Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting", with the
// angles handled by their cosines as in pbrt-v4 §12.6.3. The build is in integrator/light_set.cpp.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

inline constexpr int kLightTreeWidth = 8;

/// Bounds of up to eight lights or groups, one a lane; 32 bytes each. Unused lanes have intensity 0.
struct alignas(64) LightTreeNode {
  float cx[kLightTreeWidth] = {}, cy[kLightTreeWidth] = {}, cz[kLightTreeWidth] = {};  ///< sphere's centre, world
  float intensity[kLightTreeWidth] = {};     ///< W/sr in the strongest direction, mean of R, G, B, summed
  std::uint32_t link[kLightTreeWidth] = {};  ///< leaf: light index; otherwise node index; with the flags below
  std::int16_t ax[kLightTreeWidth] = {}, ay[kLightTreeWidth] = {}, az[kLightTreeWidth] = {};  ///< cone's axis × 32767
  std::uint16_t radius_bits[kLightTreeWidth] = {};  ///< sphere's radius: upper half of the float, rounded up
  std::uint16_t cos_spread[kLightTreeWidth] = {};   ///< θo, half angle of the cone that holds all axes
  std::uint16_t cos_falloff[kLightTreeWidth] = {};  ///< θe, how far from its own axis a light emits
};
static_assert(sizeof(LightTreeNode) == 32 * kLightTreeWidth);

inline constexpr std::uint32_t kLightTreeLeaf = 1u << 31;      ///< in `link`
inline constexpr std::uint32_t kLightTreeTwoSided = 1u << 30;  ///< in `link`: emits along −axis as along +axis
inline constexpr std::uint32_t kLightTreeIndexMask = kLightTreeTwoSided - 1;

/// A light's way down from the root: three bits a level, the first level's lowest.
using LightTrail = std::uint64_t;
inline constexpr int kLightTreeMaxDepth = 21;

/// Cosine in 16 bits, rounded down so that the decoded angle is never the smaller one.
RELIEF_KERNEL std::uint16_t light_tree_encode_cos(float cosine)
{
  return static_cast<std::uint16_t>(clamp((cosine + 1.0f) * 32767.5f, 0.0f, 65535.0f));
}
RELIEF_KERNEL float light_tree_decode_cos(std::uint16_t bits)
{
  return static_cast<float>(bits) * (1.0f / 32767.5f) - 1.0f;
}

/// Radius in 16 bits (sign, exponent, 7 bits of mantissa), rounded up.
RELIEF_KERNEL std::uint16_t light_tree_encode_radius(float radius)
{
  return static_cast<std::uint16_t>((__builtin_bit_cast(std::uint32_t, radius) + 0xffffu) >> 16);
}
RELIEF_KERNEL float light_tree_decode_radius(std::uint16_t bits)
{
  return __builtin_bit_cast(float, static_cast<std::uint32_t>(bits) << 16);
}

/// An angle in [0, π] by its cosine and sine.
struct CosSin {
  float cos = 1, sin = 0;
};

/// max(0, a − b).
RELIEF_KERNEL CosSin angle_subtract_clamped(CosSin a, CosSin b)
{
  const float cosine = a.cos * b.cos + a.sin * b.sin;
  const float sine = a.sin * b.cos - a.cos * b.sin;
  return {a.cos > b.cos ? 1.0f : cosine, a.cos > b.cos ? 0.0f : sine};
}

RELIEF_KERNEL CosSin angle_from_cos(float cosine) { return {cosine, __builtin_sqrtf(max(1.0f - sqr(cosine), 0.0f))}; }

/// Estimates for the children of one node.
struct LightEstimates {
  float value[kLightTreeWidth] = {};  ///< [0, 1e30]; 0: certainly nothing
  float sum = 0;
};

/// Estimates the irradiance that each child's lights cause at a point: never 0 where one of them contributes.
/// @param N  unit normal: light from below its plane does not count; zero vector: light from all sides counts
/// @source Conty Estevez and Kulla 2018, Eq. 3; the emission falls off with the cosine of the smallest possible angle
/// @cost   no branches in a lane, so that compilers turn the loop into SIMD
RELIEF_KERNEL LightEstimates light_tree_estimate(const LightTreeNode& node, Vec3f P, Vec3f N)
{
  // Cosines this far below zero are still taken as grazing, and none counts for less than the floor: rounding of angles
  // must not turn a sliver of a light into nothing, nor its probability into one that makes fireflies.
  constexpr float kSlack = 2e-3f, kFloor = 1e-2f;
  const float without_normal = is_zero(N) ? 1.0f : 0.0f;

  LightEstimates estimates;
  for (int i = 0; i < kLightTreeWidth; ++i) {
    const float x = P.x - node.cx[i], y = P.y - node.cy[i], z = P.z - node.cz[i];
    const float distance_squared = x * x + y * y + z * z;
    const float radius = light_tree_decode_radius(node.radius_bits[i]);
    const float radius_squared = radius * radius;
    // Not closer than the sphere's surface: inside, only the estimate is used. A point light's own position would divide
    // by zero; that clamp is far below any distance with a usable answer.
    const float inverse_distance = 1.0f / __builtin_sqrtf(max(max(distance_squared, radius_squared), 1e-30f));
    const float estimate = min(node.intensity[i] * inverse_distance * inverse_distance, 1e30f);

    const float sin_bound = min(radius * inverse_distance, 1.0f);
    const CosSin bound{__builtin_sqrtf(1.0f - sin_bound * sin_bound), sin_bound};

    const float along_axis =
        static_cast<float>(node.ax[i]) * x + static_cast<float>(node.ay[i]) * y + static_cast<float>(node.az[i]) * z;
    const float cos_front = along_axis * inverse_distance * (1.0f / 32767.0f);
    // Two-sided: the sign is cleared.
    const std::uint32_t sign_mask = ~((node.link[i] & kLightTreeTwoSided) << 1);
    const float cos_axis = __builtin_bit_cast(float, __builtin_bit_cast(std::uint32_t, cos_front) & sign_mask);
    const CosSin spread = angle_from_cos(light_tree_decode_cos(node.cos_spread[i]));
    const float cos_emission =
        angle_subtract_clamped(angle_subtract_clamped(angle_from_cos(cos_axis), spread), bound).cos;
    const float cos_limit = light_tree_decode_cos(node.cos_falloff[i]) - kSlack;
    const float emission_inside = max(cos_emission, kFloor);
    const float emission = cos_emission < cos_limit ? 0.0f : emission_inside;

    const float cos_normal = -(N.x * x + N.y * y + N.z * z) * inverse_distance;
    const float cos_received = angle_subtract_clamped(angle_from_cos(cos_normal), bound).cos;
    const float received_above = max(cos_received, kFloor);
    const float received = cos_received < -kSlack ? 0.0f : received_above;

    // Inside the sphere, light may arrive from anywhere. Without a normal, received is between the floor and one.
    const float factor = emission * max(received, without_normal);
    estimates.value[i] = estimate * (distance_squared > radius_squared ? factor : 1.0f);
  }
  const float* v = estimates.value;
  estimates.sum = ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]));
  return estimates;
}

/// One of two in proportion to their weights.
/// @param target  in [0, first + second), rounding aside; less what it passed on return
/// @return        whether it is the second: never one of weight zero if the other has any
RELIEF_KERNEL bool light_tree_take_second(double& target, float first, float second)
{
  const bool take = target >= static_cast<double>(first) && second > 0.0f;
  target -= take ? static_cast<double>(first) : 0.0;
  return take;
}

struct LightChoice {
  std::uint32_t light_index = 0;
  float probability = 0;  ///< 0: none; the walk can end in a group none of whose members turns out to contribute
};

/// Chooses one of the finite lights.
/// @param root  estimates of nodes[0] at the same point
/// @param u     [0, 1), double: each level uses up some of its bits
/// @cost        a node of four cache lines and eight estimates a level
RELIEF_KERNEL LightChoice
light_tree_sample(const LightTreeNode* nodes, const LightEstimates& root, Vec3f P, Vec3f N, double u)
{
  LightEstimates estimates = root;
  const LightTreeNode* node = nodes;
  float probability = 1.0f;
  while (estimates.sum > 0.0f) {
    const float* v = estimates.value;
    double target = u * static_cast<double>(estimates.sum);
    int chosen = 0;
    if (light_tree_take_second(target, (v[0] + v[1]) + (v[2] + v[3]), (v[4] + v[5]) + (v[6] + v[7]))) chosen = 4;
    if (light_tree_take_second(target, v[chosen] + v[chosen + 1], v[chosen + 2] + v[chosen + 3])) chosen += 2;
    if (light_tree_take_second(target, v[chosen], v[chosen + 1])) chosen += 1;
    u = target / static_cast<double>(v[chosen]);
    probability *= v[chosen] / estimates.sum;
    const std::uint32_t link = node->link[chosen];
    if ((link & kLightTreeLeaf) != 0) return {link & kLightTreeIndexMask, probability};
    node = nodes + (link & kLightTreeIndexMask);
    estimates = light_tree_estimate(*node, P, N);
  }
  return {};
}

/// Probability with which light_tree_sample chooses a light.
/// @param root   estimates of nodes[0] at the same point
/// @param trail  the light's
/// @return       0 for lights that are not in the tree
RELIEF_KERNEL float light_tree_pdf(const LightTreeNode* nodes,
                                   const LightEstimates& root,
                                   Vec3f P,
                                   Vec3f N,
                                   std::uint32_t light_index,
                                   LightTrail trail)
{
  LightEstimates estimates = root;
  const LightTreeNode* node = nodes;
  float probability = 1.0f;
  while (estimates.sum > 0.0f) {
    const int child = static_cast<int>(trail % kLightTreeWidth);
    trail /= kLightTreeWidth;
    probability *= estimates.value[child] / estimates.sum;
    if (!(probability > 0.0f)) return 0.0f;
    const std::uint32_t link = node->link[child];
    // Lights of zero intensity have no leaf; whatever trail they carry ends at another light.
    if ((link & kLightTreeLeaf) != 0) return (link & kLightTreeIndexMask) == light_index ? probability : 0.0f;
    node = nodes + (link & kLightTreeIndexMask);
    estimates = light_tree_estimate(*node, P, N);
  }
  return 0.0f;
}

}  // namespace relief
