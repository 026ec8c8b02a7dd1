// What value graphs read of up to eight points, written to registers: what most of them read in lanes, a switch for eight.
#pragma once

#include "kernel/graph/graph_material.h"
#include "kernel/math/vec_lanes.h"

namespace relief {

/// Up to eight points on primitives, as far as most graphs read them: see GraphPoint. Lanes behind the last repeat any.
struct GraphPlaces {
  const SurfaceHit* hit[8];
  const InstanceView* instance[8];
  Vec3f wo[8];
  float footprint[8];
};

/// The same in lanes.
struct GraphLanes {
  Vec3x8 P;      ///< world
  F8 to_viewer;  ///< 1: the point is seen from in front; or else −1
  Affine3x8 object_from_world;
  Vec3x8 dPdx, dPdy;  ///< as of GraphFootprint
};

/// As graph_footprint.
/// @param P_error  see SurfaceHit
RELIEF_KERNEL void graph_footprint(const Vec3x8& Ng, F8 footprint, const Vec3x8& P_error, GraphLanes& out)
{
  const F8 one = splat8(1.0f);
  const Vec3x8 across = cross(Vec3x8{one, one, -one}, Ng);
  const I8 is_parallel = ~(dot(across, across) > 1e-12f);
  Vec3x8 x = normalize(across);
  if (mask_of(is_parallel) != 0) x = select(is_parallel, frame_from_normal(Ng).s, x);
  const F8 width = max(footprint, kFootprintRoundings * max(P_error.x, max(P_error.y, P_error.z)));
  out.dPdx = x * width;
  out.dPdy = cross(Ng, x) * width;
}

RELIEF_KERNEL GraphLanes graph_lanes_make(const GraphPlaces& at)
{
  alignas(32) float in[13][8];
  bool is_one_instance = true;
  for (int k = 0; k < 8; ++k) {
    const SurfaceHit& hit = *at.hit[k];
    store_lane(in, k, hit.P);
    store_lane(in + 3, k, hit.Ng);
    store_lane(in + 6, k, at.wo[k]);
    store_lane(in + 9, k, hit.P_error);
    in[12][k] = at.footprint[k];
    is_one_instance = is_one_instance && at.instance[k] == at.instance[0];
  }
  GraphLanes out;
  out.P = load8(in);
  const Vec3x8 Ng = load8(in + 3);
  const I8 is_behind = dot(Ng, load8(in + 6)) < 0.0f;
  out.to_viewer = is_behind ? splat8(-1.0f) : splat8(1.0f);
  if (is_one_instance) {
    out.object_from_world = splat8(at.instance[0]->object_from_world);
  } else {
    for (int k = 0; k < 8; ++k) lane_set(out.object_from_world, k, at.instance[k]->object_from_world);
  }
  graph_footprint(select(is_behind, -Ng, Ng), load8(in[12]), load8(in + 9), out);
  return out;
}

/// A component of vectors.
RELIEF_KERNEL F8 graph_component(const Vec3x8& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }
RELIEF_KERNEL Vec3x8 graph_z_up(const Vec3x8& v) { return {v.x, -v.z, v.y}; }

/// Whether graph_input_lanes knows a quantity.
RELIEF_KERNEL bool graph_input_has_lanes(const GraphInput& input)
{
  using Q = GraphQuantity;
  const auto is_between = [&](Q first, Q last) { return input.quantity >= first && input.quantity <= last; };
  if (is_between(Q::object_x, Q::object_z) || is_between(Q::position_x, Q::position_z)) return true;
  if (is_between(Q::normal_x, Q::incoming_z) || is_between(Q::backfacing, Q::dpdy_z)) return true;
  if (input.shift != GraphShift::kNone) return false;
  return is_between(Q::uv0_u, Q::uv1_v);
}

/// As graph_quantity of each.
/// @pre  graph_input_has_lanes
RELIEF_KERNEL F8 graph_input_lanes(const GraphPlaces& at, const GraphLanes& lanes, const GraphInput& input)
{
  using Q = GraphQuantity;
  const auto axis_of = [&](Q first) { return static_cast<int>(input.quantity) - static_cast<int>(first); };
  const auto place = [&] {
    if (input.shift == GraphShift::kNone) return lanes.P;
    return lanes.P + (input.shift == GraphShift::kAlongX ? lanes.dPdx : lanes.dPdy) * splat8(input.width);
  };
  const auto each = [&](auto&& number) {
    alignas(32) float out[8];
    for (int k = 0; k < 8; ++k) out[k] = number(k);
    return load8(out);
  };
  switch (input.quantity) {
    case Q::object_x:
    case Q::object_y:
    case Q::object_z:
      return graph_component(transform_point(lanes.object_from_world, place()), axis_of(Q::object_x));
    case Q::position_x:
    case Q::position_y:
    case Q::position_z:
      return graph_component(graph_z_up(place()), axis_of(Q::position_x));
    case Q::normal_x:
    case Q::normal_y:
    case Q::normal_z:
      return lanes.to_viewer *
             each([&](int k) { return graph_component(graph_z_up(at.hit[k]->Ns), axis_of(Q::normal_x)); });
    case Q::true_normal_x:
    case Q::true_normal_y:
    case Q::true_normal_z:
      return lanes.to_viewer *
             each([&](int k) { return graph_component(graph_z_up(at.hit[k]->Ng), axis_of(Q::true_normal_x)); });
    case Q::incoming_x:
    case Q::incoming_y:
    case Q::incoming_z:
      return each([&](int k) { return graph_component(graph_z_up(at.wo[k]), axis_of(Q::incoming_x)); });
    case Q::uv0_u:
      return each([&](int k) { return at.hit[k]->uv[0].x; });
    case Q::uv0_v:
      return each([&](int k) { return 1.0f - at.hit[k]->uv[0].y; });
    case Q::uv1_u:
      return each([&](int k) { return at.hit[k]->uv[1].x; });
    case Q::uv1_v:
      return each([&](int k) { return 1.0f - at.hit[k]->uv[1].y; });
    case Q::dpdx_x:
    case Q::dpdx_y:
    case Q::dpdx_z:
      return graph_component(graph_z_up(lanes.dPdx), axis_of(Q::dpdx_x));
    case Q::dpdy_x:
    case Q::dpdy_y:
    case Q::dpdy_z:
      return graph_component(graph_z_up(lanes.dPdy), axis_of(Q::dpdy_x));
    case Q::backfacing:
      return lanes.to_viewer < 0.0f ? splat8(1.0f) : splat8(0.0f);
    default:
      return F8{};
  }
}

/// Writes up to eight points' quantities to their lanes of the registers, as graph_load_point does one's.
/// @param point_of  the GraphPoint of a lane, for what is not in `at`
template <typename PointOf>
RELIEF_KERNEL void graph_load_points(const GraphProgramView& program,
                                     const GraphPlaces& at,
                                     int count,
                                     const PointOf& point_of,
                                     GraphRegisters& registers)
{
  if (program.num_inputs == 0) return;
  const GraphLanes lanes = graph_lanes_make(at);
  bool are_all = true;
  for (std::uint32_t i = 0; i < program.num_inputs; ++i) {
    const GraphInput& input = program.inputs[i];
    const bool has_lanes = graph_input_has_lanes(input);
    if (has_lanes) registers.lanes[input.register_index] = graph_input_lanes(at, lanes, input);
    are_all = are_all && has_lanes;
  }
  if (are_all) return;
  for (int k = 0; k < count; ++k) {
    graph_load_point(program, point_of(k), k, registers,
                     [](const GraphInput& input) { return !graph_input_has_lanes(input); });
  }
}

}  // namespace relief
