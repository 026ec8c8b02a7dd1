#include "integrator/light_set.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <tuple>

#include "integrator/emitter_graph.h"
#include "kernel/shape/material_lookup.h"
#include "kernel/texture/texture.h"
#include "scene/world_displacement.h"

namespace relief {
namespace {

constexpr float kPiAngle = std::numbers::pi_v<float>;

/// Cone of directions: unit axis and half angle in radians, [0, π].
struct Cone {
  Vec3f axis{0, 0, 1};
  float angle = 0;
};

/// Smallest cone around two.
/// @source Conty Estevez and Kulla 2018, Algorithm 1
Cone cone_union(const Cone& a, const Cone& b)
{
  const Cone& wide = a.angle >= b.angle ? a : b;
  const Cone& narrow = a.angle >= b.angle ? b : a;
  const float between = std::atan2(length(cross(wide.axis, narrow.axis)), dot(wide.axis, narrow.axis));
  if (std::min(between + narrow.angle, kPiAngle) <= wide.angle) return wide;
  const float angle = 0.5f * (wide.angle + between + narrow.angle);
  if (angle >= kPiAngle) return {wide.axis, kPiAngle};
  // Turn the wide cone's axis towards the narrow one's; opposite axes have no direction to turn in.
  const Vec3f turn = narrow.axis - wide.axis * dot(wide.axis, narrow.axis);
  const float turn_length = length(turn);
  if (!(turn_length > 1e-6f)) return {wide.axis, kPiAngle};
  const float by = angle - wide.angle;
  return {normalize(wide.axis * std::cos(by) + turn * (std::sin(by) / turn_length)), angle};
}

/// Mean over all directions of the part of its intensity that a light has there, and the same times three and the cosine
/// to its axis: the expansion of that part to first order is mean + slope × cosine.
struct LightProfile {
  float mean = 1, slope = 0;
};
constexpr LightProfile kFlatProfile{1.0f / 4.0f, 1.0f / 2.0f};
constexpr LightProfile kTwoSidedProfile{1.0f / 2.0f, 0.0f};
/// One within a cone, nothing outside.
LightProfile cone_profile(float cosine) { return {0.5f * (1.0f - cosine), 0.75f * (1.0f - cosine * cosine)}; }

/// What the build knows of a light or a group; the tree's nodes are made from these.
struct LightBounds {
  Vec3f low{kInfinity, kInfinity, kInfinity}, high{-kInfinity, -kInfinity, -kInfinity};
  Cone spread;
  float falloff = 0;       ///< radians
  float profile_mean = 1;  ///< of a light: see LightProfile
  Vec3f profile_slope;     ///< of a light: LightProfile::slope along its axis
  bool is_flat = false;    ///< a light whose intensity is its cosine
  float intensity = 0;     ///< 0: empty group
  bool two_sided = false;
};

LightBounds bounds_union(const LightBounds& a, const LightBounds& b)
{
  if (a.intensity == 0) return b;
  if (b.intensity == 0) return a;
  LightBounds both;
  both.low = min(a.low, b.low);
  both.high = max(a.high, b.high);
  both.spread = cone_union(a.spread, b.spread);
  both.falloff = std::max(a.falloff, b.falloff);
  both.intensity = std::min(a.intensity + b.intensity, 1e30f);
  both.two_sided = a.two_sided || b.two_sided;
  return both;
}

Vec3f bounds_centre(const LightBounds& bounds) { return bounds.low * 0.5f + bounds.high * 0.5f; }

/// @param scale  mean of the emission texture
/// @return       intensity 0: the light never needs choosing
LightBounds light_bounds(const Light& light, float scale)
{
  LightBounds bounds;
  const float emission = light_scalar(light.emission) * scale;
  const auto include = [&bounds](Vec3f P) {
    bounds.low = min(bounds.low, P);
    bounds.high = max(bounds.high, P);
  };
  LightProfile profile;
  switch (light.kind) {
    case LightKind::kPoint:
      include(light.P - Vec3f{light.radius, light.radius, light.radius});
      include(light.P + Vec3f{light.radius, light.radius, light.radius});
      bounds.spread = {{0, 0, 1}, kPiAngle};
      bounds.falloff = 0.5f * kPiAngle;
      bounds.intensity = emission;
      break;
    case LightKind::kSpot: {
      include(light.P - Vec3f{light.radius, light.radius, light.radius});
      include(light.P + Vec3f{light.radius, light.radius, light.radius});
      const float inner = std::acos(std::clamp(light.cos_inner, -1.0f, 1.0f));
      const float outer = std::acos(std::clamp(light.cos_outer, -1.0f, 1.0f));
      bounds.spread = {light.axis, std::min(inner, outer)};
      bounds.falloff = std::max(outer - inner, 0.0f);
      profile = cone_profile(std::cos(0.5f * (inner + outer)));
      bounds.intensity = emission;
      break;
    }
    case LightKind::kRectangle:
    case LightKind::kDisk:
      for (const float u : {-1.0f, 1.0f}) {
        for (const float v : {-1.0f, 1.0f}) include(light.P + light.edge_u * u + light.edge_v * v);
      }
      break;
    case LightKind::kTriangle:
      include(light.P);
      include(light.P + light.edge_u);
      include(light.P + light.edge_v);
      break;
    case LightKind::kSun:
    case LightKind::kEnvironment:
      return {};
  }
  if (light.kind == LightKind::kRectangle || light.kind == LightKind::kDisk || light.kind == LightKind::kTriangle) {
    bounds.spread = {light.axis, 0.0f};
    bounds.falloff = 0.5f * kPiAngle;
    bounds.intensity = emission * light.area;
    bounds.two_sided = light.two_sided;
    profile = light.two_sided ? kTwoSidedProfile : kFlatProfile;
    bounds.is_flat = true;
    if (light.spread_tan > 0.0f) {
      // Brighter along the axis, and nothing beyond the spread.
      bounds.falloff = std::atan(light.spread_tan);
      bounds.intensity *= light.spread_tan * light.spread_scale;
      profile = cone_profile(std::cos(0.5f * bounds.falloff));
      if (light.two_sided) profile = {2.0f * profile.mean, 0.0f};
      bounds.is_flat = false;
    }
  }
  bounds.profile_mean = profile.mean;
  bounds.profile_slope = bounds.spread.axis * profile.slope;
  const bool usable = bounds.intensity > 0.0f && is_finite(bounds.low) && is_finite(bounds.high);
  if (!usable) return {};
  bounds.intensity = std::min(bounds.intensity, 1e30f);
  return bounds;
}

struct BuildLight {
  LightBounds bounds;
  Vec3f centre;
  std::uint32_t link = 0;  ///< as LightTreeBlock::link
};

/// Sums over a group's lights, weighted by their intensities.
struct ProfileSum {
  double intensity = 0, mean = 0, slope[3] = {};
};

ProfileSum profile_sum(std::span<const BuildLight> lights)
{
  ProfileSum sum;
  for (const BuildLight& light : lights) {
    const double weight = static_cast<double>(light.bounds.intensity);
    const Vec3f slope = light.bounds.profile_slope;
    sum.intensity += weight;
    sum.mean += weight * static_cast<double>(light.bounds.profile_mean);
    sum.slope[0] += weight * static_cast<double>(slope.x);
    sum.slope[1] += weight * static_cast<double>(slope.y);
    sum.slope[2] += weight * static_cast<double>(slope.z);
  }
  return sum;
}

/// Intensity of a group by direction ω as a node keeps it: intensity × min(1, constant + slope · ω).
struct GroupProfile {
  float intensity = 0, constant = 1;
  Vec3f slope{};
};

/// @param lights  the group's
/// @param bounds  around all of them
/// @return        not negative in any direction in which one of the lights emits, but for the points that a sphere around
///                them covers
GroupProfile group_profile(std::span<const BuildLight> lights, const LightBounds& bounds)
{
  if (lights.size() == 1 && bounds.is_flat) return {bounds.intensity, 0.0f, bounds.spread.axis};
  const float reach = std::min(bounds.spread.angle + bounds.falloff, kPiAngle);
  const float cos_reach = std::cos(reach);
  if (cos_reach > 0.0f) {
    // Spots: all of it within the inner cone, nothing beyond the outer one; where the two are nearly the same, the ramp is
    // less steep and begins outside.
    constexpr float kSteepest = 8.0f;
    const float cos_full = std::max(std::cos(bounds.spread.angle), cos_reach + 0.5f / kSteepest);
    const float steepness = std::min(1.0f / (cos_full - cos_reach), kSteepest);
    return {bounds.intensity, 1.0f - steepness * cos_full, bounds.spread.axis * steepness};
  }
  const ProfileSum sum = profile_sum(lights);
  const double total = sum.intensity, mean = sum.mean / total;
  const double x = sum.slope[0], y = sum.slope[1], z = sum.slope[2];
  const double first_order = std::sqrt(x * x + y * y + z * z) / total;
  if (!(first_order > 1e-6)) return {bounds.intensity * static_cast<float>(mean), 1.0f, {}};
  // The expansion is as it should be for lights that face in all directions, and too even for those that face in one,
  // whose profile is max(0, cos) = 2 slope · ω: between the two we blend by how much the lights agree.
  const double agreement = std::min(first_order / (2 * mean), 1.0);
  double constant = mean * (1 - agreement);
  const double steepness = first_order * (1 + agreement);
  const Vec3f direction =
      normalize(Vec3f{static_cast<float>(x / total), static_cast<float>(y / total), static_cast<float>(z / total)});
  const double between = std::acos(std::clamp(static_cast<double>(dot(direction, bounds.spread.axis)), -1.0, 1.0));
  constant =
      std::max(constant, -steepness * std::cos(std::min(between + static_cast<double>(reach), std::numbers::pi)));
  const double peak = constant + steepness;
  // Mean over all directions of what is positive of it, which is made that of the lights.
  const double kept = constant >= steepness ? constant : peak * peak / (4 * steepness);
  return {static_cast<float>(total * peak * mean / kept), static_cast<float>(constant / peak),
          direction * static_cast<float>(steepness / peak)};
}

/// Upper half of a float's bits (sign, exponent, 7 bits of mantissa), to the nearest.
std::uint32_t upper_half(float v) { return (std::bit_cast<std::uint32_t>(v) + 0x8000u) >> 16; }
/// The same of a number that is not negative, rounded up.
std::uint32_t upper_half_above(float v) { return (std::bit_cast<std::uint32_t>(v) + 0xffffu) >> 16; }

/// Writes one child of a node so that it holds all of a group.
/// @param link  without the two-sided flag
void child_write(LightTreeBlock& block,
                 std::size_t lane,
                 const LightBounds& bounds,
                 const GroupProfile& profile,
                 std::uint32_t link)
{
  const Vec3f centre = bounds_centre(bounds);
  const float half_diagonal = length(bounds.high * 0.5f - bounds.low * 0.5f);
  block.cx[lane] = centre.x;
  block.cy[lane] = centre.y;
  block.cz[lane] = centre.z;
  block.intensity[lane] = std::min(profile.intensity, 1e30f);
  // A few ulps for the roundings of centre and diagonal; a lone point light keeps radius 0.
  const float rounding = half_diagonal > 0.0f ? 4e-7f * max_component(abs(centre)) : 0.0f;
  const float radius = half_diagonal * (1.0f + 1e-6f) + rounding;
  const float emission_radius = radius * (length(profile.slope) + std::abs(profile.constant));
  block.radii[lane] = upper_half_above(emission_radius) | upper_half_above(radius) << 16;
  block.slope_xy[lane] = upper_half(profile.slope.x) | upper_half(profile.slope.y) << 16;
  block.slope_z_constant[lane] = upper_half(profile.slope.z) | upper_half(profile.constant) << 16;
  block.link[lane] = link | (bounds.two_sided ? kLightTreeTwoSided : 0u);
}

/// Cost of a group by its orientation: solid angle of its emission, weighted by the cosine it falls off with.
/// @source Conty Estevez and Kulla 2018, Eq. 1
float orientation_cost(const LightBounds& bounds)
{
  const float spread = bounds.two_sided ? kPiAngle : bounds.spread.angle;
  const float reach = std::min(spread + bounds.falloff, kPiAngle);
  const float sin_spread = std::sin(spread), cos_spread = std::cos(spread);
  return 2.0f * kPiAngle * (1.0f - cos_spread) +
         0.5f * kPiAngle *
             (2.0f * reach * sin_spread - std::cos(spread - 2.0f * reach) - 2.0f * spread * sin_spread + cos_spread);
}

/// Cost of a group in a split: intensity × orientation × surface of the box.
float group_cost(const LightBounds& bounds)
{
  if (bounds.intensity == 0) return 0;
  const Vec3f d = bounds.high - bounds.low;
  return bounds.intensity * orientation_cost(bounds) * (d.x * d.y + d.y * d.z + d.z * d.x);
}

float component(Vec3f v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

struct RangeBounds {
  LightBounds bounds;
  Vec3f centre_low{kInfinity, kInfinity, kInfinity}, centre_high{-kInfinity, -kInfinity, -kInfinity};
};

RangeBounds range_bounds(std::span<const BuildLight> lights)
{
  RangeBounds range;
  for (const BuildLight& light : lights) {
    range.bounds = bounds_union(range.bounds, light.bounds);
    range.centre_low = min(range.centre_low, light.centre);
    range.centre_high = max(range.centre_high, light.centre);
  }
  return range;
}

/// Reorders a range so that its first `result` lights are one part: binned by centre on each axis, the least sum of the
/// parts' costs wins.
/// @param balanced  halves instead
/// @pre             at least two lights
/// @source Conty Estevez and Kulla 2018, Eq. 2
std::size_t range_split(std::span<BuildLight> lights, const RangeBounds& range, bool balanced)
{
  constexpr int kBins = 16;
  const Vec3f extent = range.centre_high - range.centre_low;
  const float longest = max_component(extent);
  const std::size_t half = lights.size() / 2;
  float best_cost = kInfinity;
  int best_axis = -1, best_bin = 0;
  const auto bin_of = [&](const BuildLight& light, int axis) {
    const float x = (component(light.centre, axis) - component(range.centre_low, axis)) / component(extent, axis);
    return std::clamp(static_cast<int>(x * kBins), 0, kBins - 1);
  };
  for (int axis = 0; axis < 3 && !balanced; ++axis) {
    if (!(component(extent, axis) > 0.0f)) continue;
    std::array<LightBounds, kBins> bins;
    for (const BuildLight& light : lights) {
      LightBounds& bin = bins[static_cast<std::size_t>(bin_of(light, axis))];
      bin = bounds_union(bin, light.bounds);
    }
    std::array<float, kBins> cost_above{};
    LightBounds above;
    for (int i = kBins - 1; i > 0; --i) {
      above = bounds_union(above, bins[static_cast<std::size_t>(i)]);
      cost_above[static_cast<std::size_t>(i)] = group_cost(above);
    }
    LightBounds below;
    // Splits across the longest side are preferred: thin slabs of lights are poor groups.
    const float regularity = longest / component(extent, axis);
    for (int i = 1; i < kBins; ++i) {
      below = bounds_union(below, bins[static_cast<std::size_t>(i - 1)]);
      const float cost = regularity * (group_cost(below) + cost_above[static_cast<std::size_t>(i)]);
      if (below.intensity > 0 && cost < best_cost) {
        best_cost = cost;
        best_axis = axis;
        best_bin = i;
      }
    }
  }
  if (best_axis >= 0) {
    const auto middle = std::stable_partition(
        lights.begin(), lights.end(), [&](const BuildLight& light) { return bin_of(light, best_axis) < best_bin; });
    const auto first = static_cast<std::size_t>(middle - lights.begin());
    if (first > 0 && first < lights.size()) return first;
  }
  // Asked for, or coincident centres, or costs that overflow.
  const int axis = extent.x == longest ? 0 : extent.y == longest ? 1 : 2;
  std::stable_sort(lights.begin(), lights.end(), [axis](const BuildLight& a, const BuildLight& b) {
    return component(a.centre, axis) < component(b.centre, axis);
  });
  return half;
}

/// A part of the lights that becomes one child of a node.
struct Group {
  std::span<BuildLight> lights;
  RangeBounds range;
  float cost = 0;
};

/// Splits a range into up to kLightTreeWidth groups: always the one with the greatest cost, until there are enough.
/// @param balanced  groups of equal numbers of lights instead
std::vector<Group> range_groups(std::span<BuildLight> lights, bool balanced)
{
  const auto group_make = [balanced](std::span<BuildLight> part) {
    Group group{part, range_bounds(part), -1.0f};
    if (part.size() > 1) group.cost = balanced ? static_cast<float>(part.size()) : group_cost(group.range.bounds);
    return group;
  };
  std::vector<Group> groups{group_make(lights)};
  while (groups.size() < static_cast<std::size_t>(kLightTreeWidth)) {
    const auto worst =
        std::max_element(groups.begin(), groups.end(), [](const Group& a, const Group& b) { return a.cost < b.cost; });
    if (worst->lights.size() < 2) break;
    const Group group = *worst;
    const std::size_t middle = range_split(group.lights, group.range, balanced);
    *worst = group_make(group.lights.first(middle));
    groups.insert(worst + 1, group_make(group.lights.subspan(middle)));
  }
  return groups;
}

/// A node before it has a place: its children, and below each child of several lights another branch.
struct Branch {
  std::vector<Group> groups;
  std::vector<Branch> below;  ///< one a group; empty for single lights
};

/// @param depth  of the node, root 0
Branch branch_make(std::span<BuildLight> lights, int depth)
{
  // From this depth on groups are balanced: six more levels hold 32^6 lights, so no trail is too long.
  constexpr int kBalancedFrom = kLightTreeMaxDepth - 6;
  // Below this size a task costs more than it saves.
  constexpr std::size_t kParallelLights = 2048;
  Branch branch{range_groups(lights, depth >= kBalancedFrom), {}};
  branch.below.resize(branch.groups.size());
  const auto descend = [&](std::size_t i) {
    if (branch.groups[i].lights.size() > 1) branch.below[i] = branch_make(branch.groups[i].lights, depth + 1);
  };
  if (lights.size() >= kParallelLights) {
    tbb::parallel_for(std::size_t{0}, branch.groups.size(), descend);
  } else {
    for (std::size_t i = 0; i < branch.groups.size(); ++i) descend(i);
  }
  return branch;
}

/// Gives a branch and all below it their places, depth first, so that the layout does not depend on threads.
/// @param trail  way to the branch
/// @param depth  of the branch: the trail's length
/// @return       link to the branch
std::uint32_t branch_write(const Branch& branch, LightTrail trail, int depth, LightSet& set)
{
  const std::size_t first = set.tree_blocks.size();
  const std::size_t num_blocks = (branch.groups.size() + kLightTreeLanes - 1) / kLightTreeLanes;
  set.tree_blocks.resize(first + num_blocks);
  for (std::size_t i = 0; i < branch.groups.size(); ++i) {
    const Group& group = branch.groups[i];
    const LightTrail child_trail = trail | static_cast<LightTrail>(i) << (kLightTreeTrailBits * depth);
    std::uint32_t link = 0;
    if (group.lights.size() == 1) {
      link = group.lights[0].link;
      const std::uint32_t index = link & kLightTreeIndexMask;
      ((link & kLightTreeCopy) != 0 ? set.copies[index].trail : set.light_trails[index]) = child_trail;
    } else {
      link = branch_write(branch.below[i], child_trail, depth + 1, set);
    }
    child_write(set.tree_blocks[first + i / kLightTreeLanes], i % kLightTreeLanes, group.range.bounds,
                group_profile(group.lights, group.range.bounds), link);
  }
  return static_cast<std::uint32_t>(first) | static_cast<std::uint32_t>(num_blocks - 1) << kLightTreeBlocksShift;
}

/// Builds the part of the tree that instances share.
/// @return  the lights as one, in object space; intensity 0: none ever needs choosing
LightBounds shared_build(LightSet& set, const SharedLights& shared, std::span<const float> intensity_scales)
{
  std::vector<BuildLight> lights;
  for (std::uint32_t i = shared.first_light; i < shared.first_light + shared.num_lights; ++i) {
    const LightBounds bounds = light_bounds(set.lights[i], intensity_scales.empty() ? 1.0f : intensity_scales[i]);
    if (bounds.intensity > 0.0f) lights.push_back({bounds, bounds_centre(bounds), i | kLightTreeLeaf});
  }
  if (lights.empty()) return {};
  const std::uint32_t root = lights.size() == 1 ? lights[0].link : branch_write(branch_make(lights, 0), 0, 0, set);
  for (std::uint32_t i = 0; i < shared.num_copies; ++i) set.copies[shared.first_copy + i].root = root;
  if (lights.size() == 1) return lights[0].bounds;
  LightBounds bounds = range_bounds(lights).bounds;
  const ProfileSum sum = profile_sum(lights);
  bounds.profile_mean = static_cast<float>(sum.mean / sum.intensity);
  bounds.profile_slope = {static_cast<float>(sum.slope[0] / sum.intensity),
                          static_cast<float>(sum.slope[1] / sum.intensity),
                          static_cast<float>(sum.slope[2] / sum.intensity)};
  return bounds;
}

/// Bounds in world space of the lights that a copy shares.
/// @param in_object  of shared_build, intensity > 0
LightBounds copy_bounds(const LightSet& set,
                        const SharedLights& shared,
                        std::uint32_t copy,
                        const LightBounds& in_object)
{
  const Affine3& world_from_object = set.copies[copy].world_from_object;
  const float scale = set.copies[copy].scale;
  LightsView view;
  view.lights = set.lights.data();
  view.tree.copies = set.copies.data();
  LightBounds bounds = in_object;
  bounds.low = splat3(kInfinity);
  bounds.high = splat3(-kInfinity);
  for (std::uint32_t i = shared.first_light; i < shared.first_light + shared.num_lights; ++i) {
    Light storage;
    const LightRef ref{static_cast<std::int32_t>(i), static_cast<std::int32_t>(copy)};
    const LightBounds one = light_bounds(lights_at(view, ref, storage), 1.0f);
    bounds.low = min(bounds.low, one.low);
    bounds.high = max(bounds.high, one.high);
  }
  bounds.spread.axis = transform_vector(world_from_object, in_object.spread.axis) / scale;
  bounds.profile_slope = transform_vector(world_from_object, in_object.profile_slope) / scale;
  bounds.intensity = std::min(in_object.intensity * sqr(scale), 1e30f);
  const bool usable = bounds.intensity > 0.0f && is_finite(bounds.low) && is_finite(bounds.high);
  return usable ? bounds : LightBounds{};
}

/// Mean of an emission texture over a triangle, as a scalar.
/// @param emission  factor that the texture multiplies: channels that do not emit do not count
/// @cost            ten look-ups, each with the footprint of a tenth of the triangle
float mean_emission_scale(const TextureView& texture,
                          const TextureRef& ref,
                          const MeshView& mesh,
                          std::uint32_t triangle,
                          Vec3f emission)
{
  const Vec2f* uv = mesh.uv[ref.uv_set];
  const TriangleIndices tri = mesh.triangles[triangle];
  const Vec2f zero{};
  const Vec2f t0 = texture_ref_uv(ref, uv != nullptr ? uv[tri.v0] : zero);
  const Vec2f t1 = texture_ref_uv(ref, uv != nullptr ? uv[tri.v1] : zero);
  const Vec2f t2 = texture_ref_uv(ref, uv != nullptr ? uv[tri.v2] : zero);
  const Vec2f d1 = t1 - t0, d2 = t2 - t0;
  const float uv_area = 0.5f * std::abs(difference_of_products(d1.x, d2.y, d1.y, d2.x));
  // Points of a regular lattice of three a side; with footprints that overlap, no texel of the triangle is left out.
  constexpr int kSide = 3;
  const float width = std::sqrt(uv_area / (0.5f * kSide * kSide)) * 1.5f;
  Vec3f sum{};
  int count = 0;
  for (int i = 0; i <= kSide; ++i) {
    for (int j = 0; i + j <= kSide; ++j) {
      const float b1 = (static_cast<float>(i) + 1.0f / 3.0f) / (kSide + 1.0f);
      const float b2 = (static_cast<float>(j) + 1.0f / 3.0f) / (kSide + 1.0f);
      sum += max(xyz(texture_sample(texture, t0 + b1 * d1 + b2 * d2, width)), Vec3f{});
      ++count;
    }
  }
  const float mean = light_scalar(emission * sum) / (static_cast<float>(count) * light_scalar(emission));
  return is_finite(mean) ? mean : 1.0f;
}

Light triangle_light(const Affine3& placed, const MeshView& mesh, std::uint32_t triangle, bool two_sided)
{
  Light light;
  light.kind = LightKind::kTriangle;
  light.two_sided = two_sided;
  const TriangleIndices tri = mesh.triangles[triangle];
  light.P = transform_point(placed, mesh.P[tri.v0]);
  light.edge_u = transform_vector(placed, mesh.P[tri.v1] - mesh.P[tri.v0]);
  light.edge_v = transform_vector(placed, mesh.P[tri.v2] - mesh.P[tri.v0]);
  const Vec3f normal = cross(light.edge_u, light.edge_v);
  const float double_area = length(normal);
  if (double_area > 0.0f && is_finite(double_area)) {
    light.area = 0.5f * double_area;
    light.axis = normal * ((determinant(placed) < 0.0f ? -1.0f : 1.0f) / double_area);
  }
  light.triangle_index = static_cast<std::int32_t>(triangle);
  return light;
}

/// Makes one light of two triangles that are a rectangle, as those of most lamps made of meshes are: one choice less, and
/// its samples are spread over all of it.
/// @param lights  of a mesh that emits evenly, one a triangle, from index `first` on; pairs are looked for in their order
void rectangles_join(std::span<Light> lights, std::int32_t first)
{
  for (std::size_t t = 0; t + 1 < lights.size(); ++t) {
    const std::array<Vec3f, 3> a{lights[t].P, lights[t].P + lights[t].edge_u, lights[t].P + lights[t].edge_v};
    const Light& second = lights[t + 1];
    const std::array<Vec3f, 3> b{second.P, second.P + second.edge_u, second.P + second.edge_v};
    const bool has_areas = lights[t].area > 0.0f && second.area > 0.0f;
    if (!has_areas || !(dot(lights[t].axis, second.axis) > 0.0f)) continue;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const Vec3f P = a[corner], u = a[(corner + 1) % 3] - P, v = a[(corner + 2) % 3] - P;
      const Vec3f opposite = P + u + v;
      const float size_squared = length_squared(u) + length_squared(v);
      // Rounding of world coordinates, and as much of a skew as sampling takes for none (rectangle.h).
      const float near = 1e-5f * __builtin_sqrtf(size_squared);
      const auto is_vertex = [&](Vec3f Q) {
        return std::any_of(b.begin(), b.end(), [&](Vec3f q) { return length_squared(q - Q) <= sqr(near); });
      };
      const bool is_right = sqr(dot(u, v)) <= 1e-9f * length_squared(u) * length_squared(v);
      if (!is_right || !is_vertex(opposite) || !is_vertex(P + u) || !is_vertex(P + v)) continue;
      Light& light = lights[t];
      light.kind = LightKind::kRectangle;
      light.P = P + 0.5f * (u + v);
      light.edge_u = 0.5f * u;
      light.edge_v = 0.5f * v;
      light.area = light.area + second.area;
      Light& part = lights[t + 1];
      part.emission = {};
      part.whole_index = first + static_cast<std::int32_t>(t);
      ++t;
      break;
    }
  }
}

bool emits(const Material& material)
{
  return (!is_zero(material.emission) || material.emission_index >= 0) && !material.unlit &&
         material.displacement_index < 0;
}

/// Irradiance of what the tables sample, by their own importance sampling: exact up to the variation within cells, so a
/// small sun in the map is not missed.
EnvironmentIrradiance environment_irradiance(const EnvironmentTables& tables)
{
  const EnvironmentView environment = tables.view();
  EnvironmentIrradiance irradiance;
  if (!environment.has_map) {
    irradiance.mean = irradiance.constant = kPi * light_scalar(environment.color);
    return irradiance;
  }
  // Moments ∫ L, ∫ L ω, ∫ L ω ωᵀ.
  constexpr std::uint32_t kSamples = 4096;
  double total = 0, linear[3] = {}, squares[3] = {}, products[3] = {};
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const EnvironmentSample sample = environment_sample(environment, sample_2d(0, 2 * i, 0));
    const float bright = luminance(sample.radiance);
    if (!(sample.pdf_solid_angle > 0.0f) || !(bright > tables.base_luminance)) continue;
    const float sampled = light_scalar(sample.radiance) * (1.0f - tables.base_luminance / bright);
    const double L = static_cast<double>(sampled) / static_cast<double>(sample.pdf_solid_angle) / kSamples;
    const double w[3] = {static_cast<double>(sample.wi.x), static_cast<double>(sample.wi.y),
                         static_cast<double>(sample.wi.z)};
    total += L;
    for (std::size_t k = 0; k < 3; ++k) {
      linear[k] += L * w[k];
      squares[k] += L * w[k] * w[k];
      products[k] += L * w[k] * w[(k + 1) % 3];
    }
  }
  const auto vec = [](const double(&v)[3], double factor) {
    return Vec3f{static_cast<float>(v[0] * factor), static_cast<float>(v[1] * factor),
                 static_cast<float>(v[2] * factor)};
  };
  // Estimates need an order of magnitude only, so a map brighter than this may lose its shape.
  constexpr double kGreatest = 1e30;
  if (!(total < kGreatest)) {
    irradiance.mean = irradiance.constant = static_cast<float>(kGreatest);
    return irradiance;
  }
  irradiance.mean = static_cast<float>(total / 4);
  irradiance.constant = static_cast<float>(total * 3 / 32);
  irradiance.linear = vec(linear, 1.0 / 2);
  irradiance.squares = vec(squares, 15.0 / 32);
  irradiance.products = vec(products, 15.0 / 16);
  return irradiance;
}

/// Fills in what is known of the environment's light as a whole.
void environment_integrate(LightSet& set)
{
  const EnvironmentView environment = set.environment.view();
  constexpr std::uint32_t kSamples = 4096;
  double sum = 0;
  double squares = 0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const EnvironmentSample sample = environment_sample_all(environment, sample_2d(0, 2 * i, 0));
    const double radiance = static_cast<double>(light_scalar(sample.radiance));
    sum += radiance / static_cast<double>(sample.pdf_solid_angle) / kSamples;
    squares += radiance * radiance / static_cast<double>(sample.pdf_solid_angle) / kSamples;
  }
  set.environment_flux_density = std::min(sum / 4, 1e30);
  set.environment_solid_angle = squares > 0 ? sum * sum / squares : 0.0;
}

/// Instances whose emissive triangles become one piece of LightSet::lights.
struct EmissiveMesh {
  std::vector<std::size_t> instances;
  std::size_t first_light = 0;
};

/// The emissive instances of a scene, those together that will share their lights; in the order of the first of each.
std::vector<EmissiveMesh> emissive_meshes(const Scene& scene, LightSet& set)
{
  const auto triangles = [&](const Instance& instance) {
    return scene.meshes[static_cast<std::size_t>(instance.mesh_index)].triangles.size();
  };
  std::vector<std::size_t> emissive;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    if (triangles(instance) == 0 || !emits(scene.materials[static_cast<std::size_t>(instance.material_index)]))
      continue;
    emissive.push_back(i);
    set.num_emissive_triangles += triangles(instance);
  }
  const bool may_share = set.num_emissive_triangles > static_cast<std::size_t>(kLightTreeWidth);
  std::vector<EmissiveMesh> meshes;
  std::map<std::tuple<int, int, bool>, std::size_t> known;
  for (const std::size_t i : emissive) {
    const Instance& instance = scene.instances[i];
    float scale = 0;
    if (may_share && is_similarity(instance.world_from_object, &scale)) {
      const bool no_caustics = (instance.flags & kNoCausticLight) != 0;
      const auto [place, is_new] =
          known.try_emplace({instance.mesh_index, instance.material_index, no_caustics}, meshes.size());
      if (!is_new) {
        meshes[place->second].instances.push_back(i);
        continue;
      }
    }
    meshes.push_back({{i}});
  }
  return meshes;
}

/// Adds the lights of emissive instances to a set.
/// @return  of each light, the mean of its emission texture
std::vector<float> emissive_meshes_add(const Scene& scene,
                                       std::span<const TextureView> textures,
                                       const KernelGlobals* globals,
                                       LightSet& set)
{
  std::vector<EmissiveMesh> meshes = emissive_meshes(scene, set);
  std::size_t num_lights = set.lights.size();
  for (EmissiveMesh& emissive : meshes) {
    emissive.first_light = num_lights;
    const Instance& instance = scene.instances[emissive.instances[0]];
    num_lights += scene.meshes[static_cast<std::size_t>(instance.mesh_index)].triangles.size();
  }
  set.lights.resize(num_lights);
  set.first_light_index.assign(scene.instances.size(), -1);
  set.light_copy_index.assign(scene.instances.size(), -1);
  std::vector<float> scales(num_lights, 1.0f);
  for (const EmissiveMesh& emissive : meshes) {
    const std::size_t i = emissive.instances[0];
    const Instance& instance = scene.instances[i];
    const bool is_shared = emissive.instances.size() > 1;
    const Affine3 placed = is_shared ? Affine3{} : instance.world_from_object;
    const MeshView mesh = scene.meshes[static_cast<std::size_t>(instance.mesh_index)].view();
    const Material& material = scene.materials[static_cast<std::size_t>(instance.material_index)];
    const TextureRef& ref = material.emission_texture;
    const TextureView* texture =
        ref.texture_index >= 0 ? &textures[static_cast<std::size_t>(ref.texture_index)] : nullptr;
    std::vector<Vec3f> means;
    bool asks_for_path = false;
    if (material.emission_index >= 0 && globals != nullptr) {
      asks_for_path = emitter_graph_asks_for_path(globals->graphs[material.emission_index]);
      means.resize(mesh.num_triangles);
      emitter_graph_means(*globals, i, means);
    }
    tbb::parallel_for(std::uint32_t{0}, mesh.num_triangles, [&](std::uint32_t triangle) {
      Light light = triangle_light(placed, mesh, triangle, material.double_sided);
      light.emission = means.empty() ? material.emission : means[triangle];
      light.is_even = emission_is_even(material);
      // Photons do not start where no point was seen to shine: paths find that light.
      const bool is_dark = !means.empty() && is_zero(means[triangle]);
      light.casts_caustics = (instance.flags & kNoCausticLight) == 0 && !is_dark && !asks_for_path;
      light.instance_index = static_cast<std::int32_t>(i);
      set.lights[emissive.first_light + triangle] = light;
      if (texture != nullptr && means.empty()) {
        scales[emissive.first_light + triangle] = mean_emission_scale(*texture, ref, mesh, triangle, material.emission);
      }
    });
    const auto first = static_cast<std::int32_t>(emissive.first_light);
    if (emission_is_even(material)) {
      rectangles_join(std::span(set.lights).subspan(emissive.first_light, mesh.num_triangles), first);
    }
    for (const std::size_t user : emissive.instances) set.first_light_index[user] = first;
    if (!is_shared) continue;
    set.shared.push_back({static_cast<std::uint32_t>(emissive.first_light), mesh.num_triangles,
                          static_cast<std::uint32_t>(set.copies.size()),
                          static_cast<std::uint32_t>(emissive.instances.size())});
    for (const std::size_t user : emissive.instances) {
      LightCopy copy;
      copy.world_from_object = scene.instances[user].world_from_object;
      copy.object_from_world = inverse(copy.world_from_object);
      is_similarity(copy.world_from_object, &copy.scale);
      copy.instance_index = static_cast<std::int32_t>(user);
      set.light_copy_index[user] = static_cast<std::int32_t>(set.copies.size());
      set.copies.push_back(copy);
    }
  }
  return scales;
}

/// Makes the emission of lights with a graph that of its mean, by which lights are compared.
void lamps_scale(const KernelGlobals& globals, std::span<Light> lights)
{
  tbb::parallel_for(std::size_t{0}, lights.size(), [&](std::size_t i) {
    Light& light = lights[i];
    if (light.lamp_index < 0) return;
    // What was dark wherever the graph was asked may shine elsewhere.
    constexpr float kLeastMean = 1e-3f;
    const float mean = max(emitter_graph_lamp_mean(globals, light), kLeastMean);
    if (is_finite(light.emission * mean)) {
      light.emission *= mean;
      light.lamp_scale = 1.0f / mean;
    }
    if (emitter_graph_asks_for_path(globals.graphs[globals.lamps[light.lamp_index].graph_index])) {
      light.casts_caustics = false;
    }
  });
}

}  // namespace

void light_set_build_tree(LightSet& set, std::span<const float> intensity_scales)
{
  set.suns.clear();
  set.area_lights.clear();
  std::vector<BuildLight> finite;
  std::size_t next_shared = 0;
  for (std::size_t i = 0; i < set.lights.size(); ++i) {
    const Light& light = set.lights[i];
    const auto index = static_cast<std::uint32_t>(i);
    if (light.kind == LightKind::kSun) set.suns.push_back(index);
    const bool is_seen = light.instance_index < 0;
    const bool is_flat = light.kind == LightKind::kRectangle || light.kind == LightKind::kDisk;
    if (is_seen && (is_flat || light_is_ball(light))) {
      set.area_lights.push_back(index);
    }
    if (next_shared < set.shared.size() && index == set.shared[next_shared].first_light) {
      i += set.shared[next_shared++].num_lights - 1;
      continue;
    }
    const LightBounds bounds = light_bounds(light, intensity_scales.empty() ? 1.0f : intensity_scales[i]);
    if (bounds.intensity > 0.0f) finite.push_back({bounds, bounds_centre(bounds), index | kLightTreeLeaf});
  }

  set.light_trails.assign(set.lights.size(), 0u);
  set.tree_blocks.clear();
  for (const SharedLights& shared : set.shared) {
    const LightBounds in_object = shared_build(set, shared, intensity_scales);
    if (!(in_object.intensity > 0.0f)) continue;
    std::vector<BuildLight> copies(shared.num_copies);
    tbb::parallel_for(std::uint32_t{0}, shared.num_copies, [&](std::uint32_t i) {
      const std::uint32_t copy = shared.first_copy + i;
      const LightBounds bounds = copy_bounds(set, shared, copy, in_object);
      copies[i] = {bounds, bounds_centre(bounds), copy | kLightTreeLeaf | kLightTreeCopy};
    });
    std::copy_if(copies.begin(), copies.end(), std::back_inserter(finite),
                 [](const BuildLight& light) { return light.bounds.intensity > 0.0f; });
  }
  if (!finite.empty()) set.tree_root = branch_write(branch_make(finite, 0), 0, 0, set);
}

LightSet light_set_make(const Scene& scene,
                        std::span<const TextureView> textures,
                        EnvironmentDensity density,
                        const KernelGlobals* globals)
{
  LightSet set;
  const auto texture_view = [&](int index) {
    return index >= 0 ? &textures[static_cast<std::size_t>(index)] : nullptr;
  };
  set.environment = environment_tables_make(texture_view(scene.environment.texture_index), scene.environment.color,
                                            scene.environment.rotation, density);
  set.environment_irradiance = environment_irradiance(set.environment);
  environment_integrate(set);
  set.environment_casts_caustics = scene.environment.casts_caustics && scene.environment.hidden_from == 0;
  // Where some kinds of rays alone see it, only a path that goes there knows of which kind it is.
  if (scene.environment.hidden_from != 0) set.environment_irradiance = {};

  set.lights = scene.lights;
  if (globals != nullptr) lamps_scale(*globals, set.lights);
  const std::vector<float> scales = emissive_meshes_add(scene, textures, globals, set);
  light_set_build_tree(set, scales);
  if (!set.environment.environment.has_map && density == EnvironmentDensity::kExcess) {
    // Where the other lights are weaker than this, leaving the environment to the BSDF costs more variance than it saves:
    // measured under suns of 1.7 to .05 of the environment's irradiance, the two are even at about .15.
    constexpr float kYieldingRatio = 0.125f;
    set.environment_yields_to = kYieldingRatio * set.environment_irradiance.mean;
    float suns = 0;
    for (const std::uint32_t sun : set.suns) suns += light_scalar(set.lights[sun].emission);
    // Decided for the whole scene, so that sides turned away from the sun save their shadow rays.
    if (suns > set.environment_yields_to) set.environment_irradiance = {};
  }
  return set;
}

LightsView LightSet::view() const
{
  LightsView v;
  v.lights = lights.data();
  v.num_lights = static_cast<std::uint32_t>(lights.size());
  v.tree = {tree_blocks.empty() ? nullptr : tree_blocks.data(), tree_root, copies.data()};
  v.light_trails = light_trails.data();
  const bool one_finite = copies.empty() && tree_blocks.size() == 1 && tree_blocks[0].intensity[1] == 0.0f;
  if (one_finite && suns.empty() && !(environment_irradiance.mean > 0.0f)) {
    v.only_light = static_cast<std::int32_t>(tree_blocks[0].link[0] & kLightTreeIndexMask);
  }
  v.suns = suns.data();
  v.num_suns = static_cast<std::uint32_t>(suns.size());
  v.environment = environment.view();
  v.environment_irradiance = environment_irradiance;
  v.environment_yields_to = environment_yields_to;
  v.environment_casts_caustics = environment_casts_caustics;
  return v;
}

std::size_t LightSet::bytes() const
{
  return lights.size() * sizeof(Light) + copies.size() * sizeof(LightCopy) + shared.size() * sizeof(SharedLights) +
         (first_light_index.size() + light_copy_index.size()) * sizeof(std::int32_t) +
         (area_lights.size() + suns.size()) * sizeof(std::uint32_t) + light_trails.size() * sizeof(LightTrail) +
         tree_blocks.size() * sizeof(LightTreeBlock) + environment.bytes();
}

}  // namespace relief
