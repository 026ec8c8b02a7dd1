#include "integrator/light_tree_build.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

namespace relief {
namespace {

constexpr float kPiAngle = std::numbers::pi_v<float>;

/// Smallest cone around two.
/// @source Conty Estevez and Kulla 2018, Algorithm 1
LightCone cone_union(const LightCone& a, const LightCone& b)
{
  const LightCone& wide = a.angle >= b.angle ? a : b;
  const LightCone& narrow = a.angle >= b.angle ? b : a;
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

/// Bounds around lights or groups that are added one after the other.
class BoundsSum {
 public:
  void add(const LightBounds& other)
  {
    if (other.intensity == 0) return;
    if (bounds_.intensity == 0) {
      bounds_ = other;
      chord_squared_ = chord_squared_of(bounds_.spread.angle);
      return;
    }
    bounds_.low = min(bounds_.low, other.low);
    bounds_.high = max(bounds_.high, other.high);
    if (!spread_holds(other.spread)) {
      bounds_.spread = cone_union(bounds_.spread, other.spread);
      chord_squared_ = chord_squared_of(bounds_.spread.angle);
    }
    bounds_.falloff = std::max(bounds_.falloff, other.falloff);
    bounds_.intensity = std::min(bounds_.intensity + other.intensity, 1e30f);
    bounds_.profile_mean = 1;
    bounds_.profile_slope = {};
    bounds_.is_flat = false;
    bounds_.two_sided |= other.two_sided;
    bounds_.has_dim_side |= other.has_dim_side;
  }
  const LightBounds& bounds() const { return bounds_; }

 private:
  static float chord_squared_of(float angle) { return 4.0f * sqr(std::sin(0.5f * angle)); }
  /// Without an arc tangent, which most lights that are added need not: they emit along one axis, and within the cone.
  bool spread_holds(const LightCone& cone) const
  {
    if (bounds_.spread.angle >= kPiAngle) return true;
    return cone.angle == 0 && length_squared(cone.axis - bounds_.spread.axis) <= chord_squared_;
  }

  LightBounds bounds_;
  float chord_squared_ = 0;  ///< of the distance between unit vectors along the axis and along the border of the spread
};

Vec3f bounds_centre(const LightBounds& bounds) { return bounds.low * 0.5f + bounds.high * 0.5f; }

/// @param channels  as LightSet's
/// @param scale     mean of the emission texture
/// @return          intensity 0: the light never needs choosing
LightBounds light_bounds_of(const Light& light, Vec3f channels, float scale)
{
  LightBounds bounds = light_bounds(light, light_scalar(light.emission, channels) * scale);
  const bool usable = bounds.intensity > 0.0f && is_finite(bounds.low) && is_finite(bounds.high);
  if (!usable) return {};
  bounds.intensity = std::min(bounds.intensity, 1e30f);
  return bounds;
}

/// Around a light wherever it is while the shutter is open.
LightBounds moving_bounds(const LightSet& set, std::uint32_t index, float scale)
{
  LightsView view;
  view.lights = set.lights.data();
  view.motions = set.motions;
  // What lies between two of these times is covered by what they differ by.
  constexpr int kTimes = 64;
  BoundsSum sum;
  LightBounds before;
  float farthest = 0, widest = 0;
  Vec3f slope;
  for (int i = 0; i <= kTimes; ++i) {
    Light storage;
    const Light& light = lights_at(view, {static_cast<std::int32_t>(index)}, storage, static_cast<float>(i) / kTimes);
    const LightBounds one = light_bounds_of(light, set.channels, scale);
    if (!(one.intensity > 0.0f)) return {};
    if (i > 0) {
      farthest = std::max({farthest, length(one.low - before.low), length(one.high - before.high)});
      widest = std::max(widest, std::acos(std::clamp(dot(one.spread.axis, before.spread.axis), -1.0f, 1.0f)));
    }
    slope += one.profile_slope * (1.0f / (kTimes + 1));
    sum.add(one);
    before = one;
  }
  LightBounds all = sum.bounds();
  all.low = all.low - splat3(farthest);
  all.high = all.high + splat3(farthest);
  all.spread.angle = std::min(all.spread.angle + widest, kPiAngle);
  all.intensity = before.intensity;
  all.profile_mean = before.profile_mean;
  all.profile_slope = slope;
  return all;
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
/// @param link  without the flags of its sides
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
  block.link[lane] =
      link | (bounds.two_sided ? kLightTreeTwoSided : 0u) | (bounds.has_dim_side ? kLightTreeDimSide : 0u);
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
  BoundsSum sum;
  for (const BuildLight& light : lights) {
    sum.add(light.bounds);
    range.centre_low = min(range.centre_low, light.centre);
    range.centre_high = max(range.centre_high, light.centre);
  }
  range.bounds = sum.bounds();
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
    std::array<BoundsSum, kBins> bins;
    for (const BuildLight& light : lights) bins[static_cast<std::size_t>(bin_of(light, axis))].add(light.bounds);
    const auto is_empty = [&](int i) { return bins[static_cast<std::size_t>(i)].bounds().intensity == 0; };
    // Before and behind an empty bin the parts are the same. Of few lights most bins are empty.
    std::array<float, kBins> cost_above{};
    BoundsSum above;
    float cost = 0;
    for (int i = kBins - 1; i > 0; --i) {
      if (!is_empty(i)) {
        above.add(bins[static_cast<std::size_t>(i)].bounds());
        cost = group_cost(above.bounds());
      }
      cost_above[static_cast<std::size_t>(i)] = cost;
    }
    BoundsSum below;
    // Splits across the longest side are preferred: thin slabs of lights are poor groups.
    const float regularity = longest / component(extent, axis);
    for (int i = 1; i < kBins; ++i) {
      if (is_empty(i - 1)) continue;
      below.add(bins[static_cast<std::size_t>(i - 1)].bounds());
      cost = regularity * (group_cost(below.bounds()) + cost_above[static_cast<std::size_t>(i)]);
      if (cost < best_cost) {
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
    // A walk passes lane by lane, the blocks of each in turn. Groups that are neighbours there are chosen by numbers that are
    // neighbours, so even numbers give even points over many small lights.
    const std::size_t block = i % num_blocks, lane = i / num_blocks;
    const LightTrail child_trail = trail | static_cast<LightTrail>(block * kLightTreeLanes + lane)
                                               << (kLightTreeTrailBits * depth);
    std::uint32_t link = 0;
    if (group.lights.size() == 1) {
      link = group.lights[0].link;
      const std::uint32_t index = link & kLightTreeIndexMask;
      ((link & kLightTreeCopy) != 0 ? set.copies[index].trail : set.light_trails[index]) = child_trail;
    } else {
      link = branch_write(branch.below[i], child_trail, depth + 1, set);
    }
    child_write(set.tree_blocks[first + block], lane, group.range.bounds,
                group_profile(group.lights, group.range.bounds), link);
  }
  return static_cast<std::uint32_t>(first) | static_cast<std::uint32_t>(num_blocks - 1) << kLightTreeBlocksShift;
}

/// Builds the part of the tree that instances share.
/// @return  the lights as one, in object space; intensity 0: none ever needs choosing
LightBounds shared_build(LightSet& set, const SharedLights& shared)
{
  std::vector<BuildLight> lights;
  for (std::uint32_t i = shared.first_light; i < shared.first_light + shared.num_lights; ++i) {
    const LightBounds bounds =
        light_bounds_of(set.lights[i], set.channels, set.emission_scales.empty() ? 1.0f : set.emission_scales[i]);
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
    const LightBounds one = light_bounds_of(lights_at(view, ref, storage), set.channels, 1.0f);
    bounds.low = min(bounds.low, one.low);
    bounds.high = max(bounds.high, one.high);
  }
  bounds.spread.axis = transform_vector(world_from_object, in_object.spread.axis) / scale;
  bounds.profile_slope = transform_vector(world_from_object, in_object.profile_slope) / scale;
  bounds.intensity = std::min(in_object.intensity * sqr(scale), 1e30f);
  const bool usable = bounds.intensity > 0.0f && is_finite(bounds.low) && is_finite(bounds.high);
  return usable ? bounds : LightBounds{};
}

}  // namespace

void light_tree_build(LightSet& set)
{
  set.suns.clear();
  set.area_lights.clear();
  std::vector<BuildLight> finite;
  std::size_t next_shared = 0;
  for (std::size_t i = 0; i < set.lights.size(); ++i) {
    const Light& light = set.lights[i];
    const auto index = static_cast<std::uint32_t>(i);
    if (light_is_sun(light)) set.suns.push_back(index);
    if (light_is_met(light)) set.area_lights.push_back(index);
    if (next_shared < set.shared.size() && index == set.shared[next_shared].first_light) {
      i += set.shared[next_shared++].num_lights - 1;
      continue;
    }
    const float scale = set.emission_scales.empty() ? 1.0f : set.emission_scales[i];
    const LightBounds bounds =
        light.motion_index >= 0 ? moving_bounds(set, index, scale) : light_bounds_of(light, set.channels, scale);
    if (bounds.intensity > 0.0f) finite.push_back({bounds, bounds_centre(bounds), index | kLightTreeLeaf});
  }

  set.light_trails.assign(set.lights.size(), 0u);
  set.tree_blocks.clear();
  for (const SharedLights& shared : set.shared) {
    const LightBounds in_object = shared_build(set, shared);
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

}  // namespace relief
