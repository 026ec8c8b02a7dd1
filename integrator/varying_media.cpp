#include "integrator/varying_media.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>

#include "integrator/graph_bounds_stage.h"
#include "integrator/instance_box.h"
#include "integrator/scene_context.h"
#include "kernel/sample/sobol.h"
#include "kernel/volume/varying_medium.h"
#include "scene/texture_store.h"

namespace relief {

namespace {

/// Boxes of all places together, but for one a place.
constexpr int kMostBoxes = 1 << 18;
/// Boxes along a side of a place, and of a level of the world.
constexpr int kBoxes = 32, kWorldBoxes = 16;
/// The world ends as many times twice its size away as it has levels: a million sizes.
constexpr int kWorldLevels = 21;

/// Times what is found at a point of each box: bounds above it are no use, as most collisions would be in vain.
constexpr float kLoose = 32.0f;
/// Times that what stands in for such bounds is.
constexpr float kSampledMargin = 2.0f;
/// Mean free paths from corner to corner, of a place and of a level of the world, from which on a medium is a wall. They limit how many
/// collisions are in vain where densities grow exponentially, as they do below a fog that gets thinner with height.
constexpr float kWall = 1e5f, kWorldWall = 2e3f;
/// And below which no bound is too large.
constexpr float kThin = 100.0f;

/// Optical depth from corner to corner below which there is nothing: bounds on what is 0 are a little above.
constexpr float kNothing = 1e-12f;
/// Of a place, so much is filled where it is worth while to make its boxes again, as fine as they get.
constexpr float kMuchLess = 0.5f;

constexpr GraphRay kSomeRay{1u << static_cast<int>(GraphRayKind::kCamera)};

/// What it was found to be at some of the box's points.
struct Found {
  Vec3f least, mean, most;  ///< of sigma_t, 1/m
  float deviation = 0;      ///< 1/m: root of the mean square, of the channel that is farthest off
};

Found found_of(const Medium (&media)[kMediumPoints])
{
  Found found{media[0].sigma_t, {}, media[0].sigma_t};
  for (const Medium& medium : media) {
    found.least = min(found.least, medium.sigma_t);
    found.most = max(found.most, medium.sigma_t);
    found.mean += medium.sigma_t * (1.0f / kMediumPoints);
  }
  float squares = 0;
  for (const Medium& medium : media) squares += sqr(max_component(abs(medium.sigma_t - found.mean)));
  found.deviation = std::sqrt(squares * (1.0f / kMediumPoints));
  return found;
}

/// Of what a bound allows beyond what was found, so much is corrected: what rays meet there counts for ten times as much at most.
constexpr float kUnseen = 0.1f;
/// Collisions of flights, over the most that was found at the box's points and over the bound. With 1.05 and .05 there is a fifth more
/// noise, as what flights carry grows wherever it is denser than that.
constexpr float kMostFound = 1.3f, kLeastOfBound = 0.2f;

/// What rays take a medium for in a box.
/// @param bound  of sigma_t, 1/m
/// @param size   metres, from corner to corner
RateBox box_of(const Found& found, float bound, float size)
{
  // In thin boxes the mean is best. In dense ones it would weigh what passes through a hole by how dense the rest is: there the
  // medium is taken for its thinnest part, and collisions are as many as its densest asks for, which then take light away alone.
  const float dense = std::min(found.deviation * size, 1.0f);
  RateBox box;
  if (!is_finite(found.mean) || !(found.deviation < kInfinity)) {
    box.residual = box.shows = box.most = bound;
    return box;
  }
  box.sigma_t = found.mean + (found.least - found.mean) * dense;
  const float to_most = max_component(found.most - box.sigma_t);
  const float off = max_component(max(splat3(bound) - box.sigma_t, box.sigma_t));
  box.residual = std::max(1.5f * found.deviation + (1.25f * to_most - 1.5f * found.deviation) * dense, kUnseen * off);
  box.shows = std::max(max_component(found.mean), kUnseen * bound);
  box.most = std::min(bound, std::max(kMostFound * max_component(found.most), kLeastOfBound * bound));
  return box;
}

/// Bounds on a closure's inputs, one after the other.
/// @tparam At  (result of the program) -> ValueBounds
template <typename At>
struct InputBounds {
  const At& at;
  int place;  ///< among the program's results

  ValueBounds number() { return at(place++); }
  ValueBounds color()
  {
    ValueBounds all{kInfinity, -kInfinity};
    for (int c = 0; c < 3; ++c) {
      const ValueBounds one = number();
      all = {std::min(all.low, one.low), std::max(all.high, one.high)};
    }
    return all;
  }
};

/// As medium_resolve.
template <typename At>
MediumRate rate_of(const VaryingMedium& medium, const At& at)
{
  MediumRate rate;
  for (std::uint32_t i = 0; i < medium.num_closures; ++i) {
    InputBounds<At> in{at, medium.closures[i].first_result};
    const float weight = in.number().high;
    if (!(weight > 0)) continue;
    volume_closure_visit(medium.closures[i].kind, [&](auto kind) { rate_add(kind, weight, in, rate); });
  }
  return rate;
}

/// Eight boxes of a grid.
struct Boxes {
  F8 middle[3], half[3];  ///< world
};

/// Of m's row `axis` over boxes: two of the three axes are kept apart, see GraphRange.
GraphRange affine_range(const Affine3& m, int axis, const Boxes& boxes)
{
  const auto part = [axis](Vec3f v) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; };
  const float x = part(m.x), y = part(m.y), z = part(m.z), p = part(m.p);
  GraphRange out;
  out.c = boxes.middle[0] * x + boxes.middle[1] * y + boxes.middle[2] * z + p;
  out.d1 = boxes.half[0] * x;
  out.d2 = boxes.half[1] * y;
  const F8 size = abs(boxes.middle[0] * x) + abs(boxes.middle[1] * y) + abs(boxes.middle[2] * z) + std::abs(p);
  out.rest = boxes.half[2] * std::abs(z) + 2e-6f * size;
  out.low = splat8(-kInfinity);
  out.high = splat8(kInfinity);
  return range_closed(out);
}

/// What a graph reads in boxes.
GraphRange quantity_range(const MediumPoint& somewhere,
                          const VaryingPlace& place,
                          const GraphInput& input,
                          const Boxes& boxes)
{
  using Q = GraphQuantity;
  const auto axis_of = [&input](Q first) { return static_cast<int>(input.quantity) - static_cast<int>(first); };
  switch (input.quantity) {
    case Q::object_x:
    case Q::object_y:
    case Q::object_z:
      return affine_range(somewhere.node->object_from_world, axis_of(Q::object_x), boxes);
    case Q::generated_x:
    case Q::generated_y:
    case Q::generated_z: {
      const int axis = axis_of(Q::generated_x);
      const GraphRange object = affine_range(somewhere.node->object_from_world, axis, boxes);
      if (somewhere.node->index == kNoInstance) return object;
      const Vec3f scale = place.generated_scale, offset = place.generated_offset;
      return axis == 0   ? object * scale.x + offset.x
             : axis == 1 ? object * scale.y + offset.y
                         : object * scale.z + offset.z;
    }
    case Q::position_x:
    case Q::position_y:
    case Q::position_z:
      return affine_range(kZUpFromWorld, axis_of(Q::position_x), boxes);
    case Q::normal_x:
    case Q::normal_y:
    case Q::normal_z:
    case Q::true_normal_x:
    case Q::true_normal_y:
    case Q::true_normal_z:
    case Q::incoming_x:
    case Q::incoming_y:
    case Q::incoming_z:
    case Q::object_normal_x:
    case Q::object_normal_y:
    case Q::object_normal_z:
    case Q::vertex_normal_x:
    case Q::vertex_normal_y:
    case Q::vertex_normal_z:
    case Q::smooth_normal_x:
    case Q::smooth_normal_y:
    case Q::smooth_normal_z:
      return range_between(splat8(-1.00001f), splat8(1.00001f));
    case Q::ray_kind:
      return range_between(F8{}, splat8(1.0f));
    case Q::ray_depth:
      return range_between(F8{}, splat8(0x1p16f));
    case Q::ray_origin_x:
    case Q::ray_origin_y:
    case Q::ray_origin_z:
    case Q::window_x:
    case Q::window_y:
    case Q::shutter_time:
      return range_unknown();
    default:
      return range_point(splat8(medium_quantity(somewhere, input)));
  }
}

/// Generated coordinates of a mesh by its points: they are an affine map of where these were before modifiers.
void fit_generated(const MeshView& mesh, VaryingPlace& place)
{
  if (mesh.generated == nullptr || mesh.num_vertices == 0) return;
  float scale[3], offset[3];
  for (int axis = 0; axis < 3; ++axis) {
    const auto part = [axis](Vec3f v) { return static_cast<double>(axis == 0 ? v.x : axis == 1 ? v.y : v.z); };
    double mean_P = 0, mean_g = 0, both = 0, square = 0;
    const double share = 1.0 / mesh.num_vertices;
    for (std::uint32_t i = 0; i < mesh.num_vertices; ++i) {
      mean_P += share * part(mesh.P[i]);
      mean_g += share * part(mesh.generated[i]);
    }
    for (std::uint32_t i = 0; i < mesh.num_vertices; ++i) {
      const double P = part(mesh.P[i]) - mean_P;
      both += P * (part(mesh.generated[i]) - mean_g);
      square += P * P;
    }
    const double slope = square > 0 ? both / square : 0;
    scale[axis] = static_cast<float>(slope);
    offset[axis] = static_cast<float>(mean_g - slope * mean_P);
  }
  place.generated_scale = {scale[0], scale[1], scale[2]};
  place.generated_offset = {offset[0], offset[1], offset[2]};
}

/// Eight boxes of one of a grid's levels.
/// @param middle  of the grid, world
/// @param scale   of the level's boxes
/// @param group   which eight; those behind the last repeat it
/// @param corner  gets the lower one of each
Boxes boxes_of_group(const RateGrid& grid, Vec3f middle, float scale, std::size_t group, Vec3f* corner)
{
  Boxes boxes;
  const auto side = static_cast<std::size_t>(grid.size);
  const float half = 0.5f * static_cast<float>(grid.size);
  const Vec3f lengths = grid.cell * scale;
  for (int k = 0; k < kMediumPoints; ++k) {
    const std::size_t i = std::min(group * 8 + static_cast<std::size_t>(k), side * side * side - 1);
    const std::size_t at[3] = {i % side, i / side % side, i / (side * side)};
    const float m[3] = {middle.x, middle.y, middle.z}, cell[3] = {grid.cell.x, grid.cell.y, grid.cell.z};
    for (int axis = 0; axis < 3; ++axis) {
      const float length = scale * cell[axis];
      boxes.middle[axis][k] = m[axis] + (static_cast<float>(at[axis]) + 0.5f - half) * length;
      // Points on its border may be taken for a neighbour's.
      boxes.half[axis][k] = 0.5f * length * 1.001f;
    }
    corner[k] = Vec3f{boxes.middle[0][k], boxes.middle[1][k], boxes.middle[2][k]} - lengths * 0.5f;
  }
  return boxes;
}

float volume_of(const Box3& box)
{
  const Vec3f size = box.high - box.low;
  return size.x * size.y * size.z;
}

/// The part of a grid of one level in which rays look for something.
std::optional<Box3> filled_part(const RateGrid& grid)
{
  Vec3f first = splat3(kInfinity), last = splat3(-kInfinity);
  const RateBox* box = grid.boxes;
  for (int z = 0; z < grid.size; ++z) {
    for (int y = 0; y < grid.size; ++y) {
      for (int x = 0; x < grid.size; ++x, ++box) {
        if (!(box->residual > 0.0f || box->shows > 0.0f)) continue;
        const Vec3f at{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
        first = min(first, at);
        last = max(last, at);
      }
    }
  }
  if (!(first.x <= last.x)) return std::nullopt;
  return Box3{grid.low + first * grid.cell, grid.low + (last + Vec3f{1, 1, 1}) * grid.cell};
}

/// What a ray from the camera may reach in few steps: all that is there, and the camera.
Box3 world_box(const SceneContext& context)
{
  Box3 box{context.scene.bounds_low, context.scene.bounds_high};
  if (!(box.low.x <= box.high.x)) box = box_empty();
  for (const SceneCamera& camera : context.scene.cameras) {
    const Vec3f P = camera.camera.world_from_camera.p;
    box = box_union(box, {P, P});
  }
  const Vec3f middle = (box.low + box.high) * 0.5f;
  // As long in all directions: what is far away is as far in each.
  const Vec3f half = splat3(std::max(0.5f * max_component(box.high - box.low), 1e-3f));
  return {middle - half, middle + half};
}

}  // namespace

void VaryingMedia::make(const SceneContext& context)
{
  const Scene& scene = context.scene;
  const VolumeProgram* world =
      scene.environment.varying_medium.closures.empty() ? nullptr : &scene.environment.varying_medium;
  const bool any = std::any_of(scene.varying_media.begin(), scene.varying_media.end(),
                               [](const VolumeProgram& volume) { return !volume.closures.empty(); });
  if (!any && world == nullptr) return;
  const auto add = [this](const VolumeProgram& volume) {
    VaryingMedium medium;
    medium.program = volume.program.view();
    medium.closures = volume.closures.data();
    medium.num_closures = static_cast<std::uint32_t>(volume.closures.size());
    media_.push_back(medium);
  };
  for (const VolumeProgram& volume : scene.varying_media) add(volume);
  media_.resize(scene.media.size());
  if (scene.environment.medium) {
    if (world != nullptr)
      add(*world);
    else
      media_.emplace_back();
  }
  place_of_instance_.assign(scene.instances.size(), -1);
  const auto medium_of = [&](std::size_t instance) -> VaryingMedium* {
    const auto material = static_cast<std::size_t>(scene.instances[instance].material_index);
    const int medium = scene.materials[material].medium_index;
    if (medium < 0 || media_[static_cast<std::size_t>(medium)].num_closures == 0) return nullptr;
    return &media_[static_cast<std::size_t>(medium)];
  };
  std::int32_t count = world != nullptr ? 1 : 0;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    if (medium_of(i) != nullptr) place_of_instance_[i] = count++;
  }
  places_.resize(static_cast<std::size_t>(count));
  boxes_.resize(places_.size());
  size_ = std::clamp(static_cast<int>(std::cbrt(kMostBoxes / std::max(count, 1))), 1, kBoxes);
  for (VaryingMedium& medium : media_) {
    medium.places = places_.data();
    medium.place_of_instance = place_of_instance_.data();
  }
  if (world != nullptr) {
    media_.back().place_of_instance = nullptr;
    const Problem problem = add_rates(context, media_.back(), kWholeWorld);
    media_.back().shines = problem.shines;
    if (!problem.has_bounds) {
      problems_.emplace_back(
          "what fills the world has no bounds on its density: twice the most that was found at 16 points a side stands "
          "in for "
          "them, and there may be more noise");
    }
  }
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    VaryingMedium* medium = medium_of(i);
    if (medium == nullptr) continue;
    const Problem problem = add_rates(context, *medium, static_cast<std::int32_t>(i));
    medium->shines |= problem.shines;
    const std::string who = "the volume in \"" + scene.instances[i].name + '"';
    constexpr std::size_t kMostNamed = 10;
    if (!problem.has_bounds && problems_.size() < kMostNamed) {
      problems_.push_back(who + " has no bounds on its density: twice the most that was found at " +
                          std::to_string(size_) + " points a side stands in for them, and there may be more noise");
    }
    if (problem.is_tamed && problems_.size() < kMostNamed) {
      problems_.push_back(who + " is so dense somewhere that it counts as a wall there");
    }
  }
}

VaryingMedia::Problem VaryingMedia::add_rates(const SceneContext& context,
                                              const VaryingMedium& medium,
                                              std::int32_t instance)
{
  const bool is_world = instance == kWholeWorld;
  const Box3 box = is_world ? world_box(context) : instance_box(context, static_cast<std::size_t>(instance));
  const std::size_t index =
      is_world ? 0 : static_cast<std::size_t>(place_of_instance_[static_cast<std::size_t>(instance)]);
  VaryingPlace& place = places_[index];
  if (!is_world) {
    const auto mesh = static_cast<std::size_t>(context.scene.instances[static_cast<std::size_t>(instance)].mesh_index);
    fit_generated(context.meshes[mesh], place);
  }
  const float diagonal = length(box.high - box.low);
  place.densest = (is_world ? kWorldWall : kWall) / diagonal;
  const RatesOf of{context, medium, instance, diagonal, is_world ? kWorldBoxes : size_, is_world ? kWorldLevels : 1};
  Problem problem = make_rates(of, box, place, boxes_[index]);
  if (is_world) return problem;
  const std::optional<Box3> filled = filled_part(place.rates);
  if (!filled) {
    place.rates.boxes = nullptr;
    boxes_[index] = {};
  } else if (volume_of(*filled) < kMuchLess * volume_of(box)) {
    problem = make_rates(of, *filled, place, boxes_[index]);
  }
  return problem;
}

VaryingMedia::Problem VaryingMedia::make_rates(const RatesOf& of,
                                               Box3 box,
                                               VaryingPlace& place,
                                               std::vector<RateBox>& all)
{
  const SceneContext& context = of.context;
  const VaryingMedium& medium = of.medium;
  const std::int32_t instance = of.instance;
  const float diagonal = of.diagonal;
  RateGrid& grid = place.rates;
  grid.size = of.size;
  grid.num_levels = of.num_levels;
  grid.low = box.low;
  grid.cell = max((box.high - box.low) / static_cast<float>(grid.size), splat3(1e-20f));
  const std::size_t side = static_cast<std::size_t>(grid.size), level_size = side * side * side;
  all.assign(level_size * static_cast<std::size_t>(grid.num_levels), {});
  const GraphBoundsRun run_bounds = graph_bounds_select();
  const std::span<const ImageBounds> images = context.scene.textures->height_bounds();
  const Vec3f middle = (box.low + box.high) * 0.5f, D{0, 0, 1};
  Problem problem;
  for (int level = 0; level < grid.num_levels; ++level) {
    const float scale = static_cast<float>(1u << level);
    std::vector<MediumRate> rates(level_size);
    std::vector<Found> found(level_size);
    tbb::parallel_for(std::size_t{0}, (level_size + 7) / 8, [&](std::size_t group) {
      Vec3f corner[kMediumPoints];
      const Boxes boxes = boxes_of_group(grid, middle, scale, group, corner);
      const Vec3f lengths = grid.cell * scale;
      const auto registers = std::make_unique_for_overwrite<GraphRangeRegisters>();
      registers->images = images.empty() ? nullptr : images.data();
      const MediumPoint somewhere = medium_point_make(context.globals, place, instance, corner[0], D, kSomeRay);
      for (std::uint32_t i = 0; i < medium.program.num_inputs; ++i) {
        const GraphInput& input = medium.program.inputs[i];
        registers->lanes[input.register_index] = quantity_range(somewhere, place, input, boxes);
      }
      run_bounds(medium.program, context.globals.textures, *registers);
      for (int k = 0; k < kMediumPoints; ++k) {
        const std::size_t i = group * 8 + static_cast<std::size_t>(k);
        if (i >= level_size) break;
        Vec3f P[kMediumPoints];
        for (int point = 0; point < kMediumPoints; ++point) {
          // One in each eighth of the box.
          const auto number = static_cast<std::uint32_t>(i * kMediumPoints + static_cast<std::size_t>(point)) * 3u;
          const auto part = [&](int axis) {
            const std::uint32_t bits = hash_mix_32(number + static_cast<std::uint32_t>(axis) + 1u);
            return 0.5f * (static_cast<float>(point >> axis & 1) + unit_float(bits));
          };
          P[point] = corner[k] + lengths * Vec3f{part(0), part(1), part(2)};
        }
        Medium media[kMediumPoints];
        varying_medium_eval(context.globals, medium, instance, P, kMediumPoints, D, kSomeRay, media);
        found[i] = found_of(media);
        rates[i] = rate_of(medium, [&](int result) -> ValueBounds {
          const std::uint16_t operand = medium.program.results[result];
          if (operand == kNoGraphOperand) return {0, 0};
          const GraphRange range = graph_range_operand(medium.program, *registers, operand);
          // What is not a number counts as 0.
          const float low = range.low[k], high = range.high[k];
          return {low <= high ? low : -kInfinity, low <= high ? high : kInfinity};
        });
      }
    });
    float most = 0;
    for (const Found& one : found) most = std::max(most, max_component(one.most));
    const float largest = std::max(kLoose * most, kThin / (diagonal * scale));
    const float wall = place.densest / scale, corner_to_corner = length(grid.cell) * scale;
    for (std::size_t i = 0; i < level_size; ++i) {
      problem.is_tamed |= level == 0 && max_component(found[i].most) >= wall;
      float rate = std::min(rates[i].sigma_t, wall);
      if (!(rate <= largest)) {
        rate = std::max(kSampledMargin * most, kThin / (diagonal * scale));
        // Far away densities that grow without end are no numbers any more.
        problem.has_bounds = problem.has_bounds && level > 0;
      }
      RateBox& known = all[static_cast<std::size_t>(level) * level_size + i];
      if (rate * diagonal * scale > kNothing) known = box_of(found[i], rate, corner_to_corner);
      // What only shines has to be met as well.
      if (rates[i].emits) known.shows += 1.0f / (diagonal * scale);
      problem.shines |= rates[i].emits;
    }
  }
  grid.boxes = all.data();
  return problem;
}

}  // namespace relief
