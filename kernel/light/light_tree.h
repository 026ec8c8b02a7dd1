// Choice among many lights by a tree of bounds: every node knows a sphere around its lights, a cone around their axes and
// their summed intensity, which give an estimate of the irradiance they cause at a point; the walk goes down by these
// estimates. Read LightTreeNode, light_importance, then light_tree_sample and its inverse light_tree_pdf.
//
// The walk starts at a *cut* of up to eight nodes instead of the root. A scene with few lights is its own cut and has no
// tree; in others the cut replaces three levels of estimates for very large groups, which are the least reliable.
//
// Source: Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting", with the
// angles handled by their cosines as in pbrt-v4 §12.6.3. The build is in integrator/light_set.cpp.
#pragma once

#include "kernel/math/vec.h"

namespace relief {

/// Bounds of a light or a group of lights; two to a cache line.
struct alignas(32) LightTreeNode {
  float cx = 0, cy = 0, cz = 0;         ///< sphere around the lights: centre, world
  float intensity = 0;                  ///< W/sr in the strongest direction, mean of R, G, B, summed over the lights
  std::int16_t ax = 0, ay = 0, az = 0;  ///< cone's axis × 32767
  std::uint16_t radius_bits = 0;        ///< upper half of the radius' float, rounded up
  std::uint16_t cos_spread = 0;         ///< θo, half angle of the cone that holds all axes; see light_tree_encode_cos
  std::uint16_t cos_falloff = 0;        ///< θe, how far from its own axis a light emits
  std::uint32_t link = 0;               ///< leaf: light index; inner: index of the first of two neighbouring children
                                        ///< in `nodes`; with the flags below
};
static_assert(sizeof(LightTreeNode) == 32);

inline constexpr std::uint32_t kLightTreeLeaf = 1u << 31;      ///< in `link`
inline constexpr std::uint32_t kLightTreeTwoSided = 1u << 30;  ///< in `link`: emits along −axis as along +axis
inline constexpr std::uint32_t kLightTreeIndexMask = kLightTreeTwoSided - 1;

inline constexpr std::uint32_t kLightTreeMaxCut = 8;
/// Depth below the cut that a trail (29 bits besides the cut's 3) can spell. The build never exceeds it.
inline constexpr int kLightTreeMaxDepth = 29;

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

/// cos and sin of max(0, a − b) for angles in [0, π] given likewise.
struct CosSin {
  float cos = 1, sin = 0;
};
RELIEF_KERNEL CosSin angle_subtract_clamped(CosSin a, CosSin b)
{
  if (a.cos > b.cos) return {1.0f, 0.0f};
  return {a.cos * b.cos + a.sin * b.sin, a.sin * b.cos - a.cos * b.sin};
}

/// Estimate of the irradiance a node's lights cause at a point: never 0 where one of them contributes.
/// @param N  unit normal: light from below its plane does not count; zero vector: light from all sides counts
/// @return   [0, 1e30]; 0: certainly nothing
/// @source Conty Estevez and Kulla 2018, Eq. 3; the emission falls off with the cosine of the smallest possible angle
RELIEF_KERNEL float light_importance(const LightTreeNode& node, Vec3f P, Vec3f N)
{
  // Cosines this far below zero are still taken as grazing, and none counts for less than the floor: rounding of angles
  // must not turn a sliver of a light into nothing, nor its probability into one that makes fireflies.
  constexpr float kSlack = 2e-3f, kFloor = 1e-2f;

  const Vec3f from_light = P - Vec3f{node.cx, node.cy, node.cz};
  const float distance_squared = length_squared(from_light);
  const float radius = light_tree_decode_radius(node.radius_bits);
  const float radius_squared = sqr(radius);
  // A point light's own position would divide by zero; the clamp is far below any distance with a usable answer.
  float importance = min(node.intensity / max(max(distance_squared, radius_squared), 1e-30f), 1e30f);
  // Inside the sphere, light may arrive from anywhere.
  if (!(distance_squared > radius_squared)) return importance;

  const float inverse_distance = 1.0f / __builtin_sqrtf(distance_squared);
  const float sin_bound = radius * inverse_distance;
  const CosSin bound{safe_sqrt(1.0f - sqr(sin_bound)), sin_bound};

  const Vec3f axis{static_cast<float>(node.ax), static_cast<float>(node.ay), static_cast<float>(node.az)};
  float cos_axis = dot(axis, from_light) * (inverse_distance * (1.0f / 32767.0f));
  if ((node.link & kLightTreeTwoSided) != 0) cos_axis = __builtin_fabsf(cos_axis);
  const float cos_spread = light_tree_decode_cos(node.cos_spread);
  const CosSin to_axis{cos_axis, safe_sqrt(1.0f - sqr(cos_axis))};
  const CosSin spread{cos_spread, safe_sqrt(1.0f - sqr(cos_spread))};
  const float cos_emission = angle_subtract_clamped(angle_subtract_clamped(to_axis, spread), bound).cos;
  if (cos_emission < light_tree_decode_cos(node.cos_falloff) - kSlack) return 0.0f;
  importance *= max(cos_emission, kFloor);

  if (!is_zero(N)) {
    const float cos_normal = -dot(N, from_light) * inverse_distance;
    const CosSin to_normal{cos_normal, safe_sqrt(1.0f - sqr(cos_normal))};
    const float cos_received = angle_subtract_clamped(to_normal, bound).cos;
    if (cos_received < -kSlack) return 0.0f;
    importance *= max(cos_received, kFloor);
  }
  return importance;
}

/// Estimates for the nodes of the cut.
struct LightCut {
  float importance[kLightTreeMaxCut] = {};
  float sum = 0;
};

/// @param nodes    the cut is nodes[0 … num_cut)
/// @param num_cut  up to kLightTreeMaxCut
RELIEF_KERNEL LightCut light_cut_eval(const LightTreeNode* nodes, std::uint32_t num_cut, Vec3f P, Vec3f N)
{
  LightCut cut;
  for (std::uint32_t i = 0; i < num_cut; ++i) {
    cut.importance[i] = light_importance(nodes[i], P, N);
    cut.sum += cut.importance[i];
  }
  return cut;
}

struct LightChoice {
  std::uint32_t light_index = 0;
  float probability = 0;  ///< 0: none
};

/// Chooses one of the finite lights.
/// @param cut  from light_cut_eval at the same point
/// @param u    [0, 1), double: each level uses up some of its bits
/// @cost       one cache line and two estimates a level
RELIEF_KERNEL LightChoice
light_tree_sample(const LightTreeNode* nodes, std::uint32_t num_cut, const LightCut& cut, Vec3f P, Vec3f N, double u)
{
  if (!(cut.sum > 0.0f)) return {};
  double target = u * static_cast<double>(cut.sum);
  // The last node with any importance takes what rounding leaves over.
  std::uint32_t chosen = 0;
  double before = 0, chosen_before = 0;
  for (std::uint32_t i = 0; i < num_cut; ++i) {
    if (cut.importance[i] > 0.0f && target >= before) {
      chosen = i;
      chosen_before = before;
    }
    before += static_cast<double>(cut.importance[i]);
  }
  const double weight = static_cast<double>(cut.importance[chosen]);
  u = (target - chosen_before) / weight;
  float probability = cut.importance[chosen] / cut.sum;

  LightTreeNode node = nodes[chosen];
  while ((node.link & kLightTreeLeaf) == 0) {
    const LightTreeNode* children = nodes + (node.link & kLightTreeIndexMask);
    const float first = light_importance(children[0], P, N);
    const float second = light_importance(children[1], P, N);
    if (!(first + second > 0.0f)) return {};
    const float p_first = first / (first + second);
    const double p = static_cast<double>(p_first);
    if (u < p) {
      u = u / p;
      probability *= p_first;
      node = children[0];
    } else {
      const float p_second = 1.0f - p_first;
      // u can reach 1 by rounding above; then the second child may have no probability at all.
      if (!(p_second > 0.0f)) {
        node = children[0];
        continue;
      }
      u = (u - p) / static_cast<double>(p_second);
      probability *= p_second;
      node = children[1];
    }
  }
  return {node.link & kLightTreeIndexMask, probability};
}

/// Probability with which light_tree_sample chooses a light.
/// @param trail  the light's way down: its cut node in the low 3 bits, then one bit a level (1: second child)
/// @return       0 for lights that are not in the tree
RELIEF_KERNEL float light_tree_pdf(const LightTreeNode* nodes,
                                   const LightCut& cut,
                                   Vec3f P,
                                   Vec3f N,
                                   std::uint32_t light_index,
                                   std::uint32_t trail)
{
  if (!(cut.sum > 0.0f)) return 0.0f;
  const std::uint32_t start = trail % kLightTreeMaxCut;
  trail /= kLightTreeMaxCut;
  float probability = cut.importance[start] / cut.sum;
  LightTreeNode node = nodes[start];
  while ((node.link & kLightTreeLeaf) == 0 && probability > 0.0f) {
    const LightTreeNode* children = nodes + (node.link & kLightTreeIndexMask);
    const float first = light_importance(children[0], P, N);
    const float second = light_importance(children[1], P, N);
    if (!(first + second > 0.0f)) return 0.0f;
    const float p_first = first / (first + second);
    probability *= (trail & 1u) == 0 ? p_first : 1.0f - p_first;
    node = children[trail & 1u];
    trail >>= 1;
  }
  // Lights of zero intensity have no leaf; whatever trail they carry ends at another light.
  return (node.link & kLightTreeIndexMask) == light_index ? probability : 0.0f;
}

}  // namespace relief
