// Bounds of what a value graph gives over small parallelograms: the interpreter of graph_eval.h once more, with a range in
// place of each number. Heidrich and Seidel 1998, "Ray-Tracing Procedural Displacement Shaders", bound shaders so.
//
// What is not known is unknown, which is no error: whatever follows from it is, too.
#pragma once

#include "kernel/graph/graph_bounds_functions.h"

namespace relief {

namespace graph_bounds {

RELIEF_KERNEL void copy_op(const GraphRangeOperands& o) { o.set(0, o.in(0)); }

RELIEF_KERNEL void add_op(const GraphRangeOperands& o) { o.set(0, o.in(0) + o.in(1)); }

RELIEF_KERNEL void subtract_op(const GraphRangeOperands& o)
{
  o.set(0, o.inputs[0] == o.inputs[1] ? range_point(F8{}) : o.in(0) - o.in(1));
}

RELIEF_KERNEL void multiply_op(const GraphRangeOperands& o)
{
  o.set(0, o.inputs[0] == o.inputs[1] ? range_within(o.in(0) * o.in(0), F8{}, splat8(kInfinity)) : o.in(0) * o.in(1));
}

RELIEF_KERNEL void divide_op(const GraphRangeOperands& o) { o.set(0, o.in(0) * range_reciprocal(o.in(1))); }

RELIEF_KERNEL void multiply_add_op(const GraphRangeOperands& o) { o.set(0, o.in(0) * o.in(1) + o.in(2)); }

RELIEF_KERNEL void minimum_op(const GraphRangeOperands& o) { o.set(0, range_min(o.in(0), o.in(1))); }

RELIEF_KERNEL void maximum_op(const GraphRangeOperands& o) { o.set(0, range_max(o.in(0), o.in(1))); }

RELIEF_KERNEL void less_than_op(const GraphRangeOperands& o)
{
  o.set(0, truth(o.in(0).high < o.in(1).low, o.in(0).low >= o.in(1).high));
}

RELIEF_KERNEL void greater_than_op(const GraphRangeOperands& o)
{
  o.set(0, truth(o.in(0).low > o.in(1).high, o.in(0).high <= o.in(1).low));
}

RELIEF_KERNEL void equal_op(const GraphRangeOperands& o)
{
  const GraphRange x = o.in(0), y = o.in(1);
  const I8 apart = (x.high < y.low) | (x.low > y.high);
  o.set(0, truth(range_is_point(x) & range_is_point(y) & (x.low == y.low), apart));
}

/// Of select and guard.
RELIEF_KERNEL void chosen(const GraphRangeOperands& o, bool is_guard)
{
  const GraphRange condition = o.in(is_guard ? 1 : 0), yes = o.in(is_guard ? 0 : 1);
  const GraphRange no = is_guard ? range_point(F8{}) : o.in(2);
  const I8 surely = (condition.low > 0.0f) | (condition.high < 0.0f);
  const I8 never = (condition.low == 0.0f) & (condition.high == 0.0f);
  o.set(0, range_select(surely, yes, range_select(never, no, range_hull(yes, no))));
}

RELIEF_KERNEL void select_op(const GraphRangeOperands& o) { chosen(o, false); }
RELIEF_KERNEL void guard_op(const GraphRangeOperands& o) { chosen(o, true); }

RELIEF_KERNEL void skip_op(const GraphRangeOperands& o)
{
  const GraphRange factor = o.in(0);
  if (mask_of((factor.low == 0.0f) & (factor.high == 0.0f)) == 0xffu)
    o.next += o.immediates[0] | std::uint32_t{o.immediates[1]} << 16;
}

RELIEF_KERNEL void floor_op(const GraphRangeOperands& o)
{
  o.set(0, range_between(floor(o.in(0).low), floor(o.in(0).high)));
}

RELIEF_KERNEL void ceil_op(const GraphRangeOperands& o)
{
  o.set(0, range_between(-floor(-o.in(0).low), -floor(-o.in(0).high)));
}

RELIEF_KERNEL void absolute_op(const GraphRangeOperands& o) { o.set(0, range_abs(o.in(0))); }

RELIEF_KERNEL void sign_op(const GraphRangeOperands& o)
{
  const GraphRange a = o.in(0);
  o.set(0, range_between(a.low > 0.0f    ? splat8(1.0f)
                         : a.low == 0.0f ? F8{}
                                         : -splat8(1.0f),
                         a.high < 0.0f    ? -splat8(1.0f)
                         : a.high == 0.0f ? F8{}
                                          : splat8(1.0f)));
}

RELIEF_KERNEL void square_root_op(const GraphRangeOperands& o)
{
  const GraphRange a = o.in(0);
  const F8 low = sqrt(max(a.low, F8{})), high = sqrt(max(a.high, F8{}));
  o.set(0, range_of_function(a, sqrt(max(a.c, F8{})), 0.5f / high, 0.5f / low, low, high));
}

RELIEF_KERNEL void power_op(const GraphRangeOperands& o) { power(o); }

RELIEF_KERNEL void logarithm_op(const GraphRangeOperands& o) { logarithm(o); }

RELIEF_KERNEL void exponent_op(const GraphRangeOperands& o) { exponent(o); }

RELIEF_KERNEL void modulo_op(const GraphRangeOperands& o) { modulo(o); }

RELIEF_KERNEL void sine_op(const GraphRangeOperands& o) { o.set(0, sine_of(o.in(0), 0.0)); }

RELIEF_KERNEL void cosine_op(const GraphRangeOperands& o) { o.set(0, sine_of(o.in(0), 1.5707963267948966)); }

RELIEF_KERNEL void tangent_op(const GraphRangeOperands& o) { tangent(o); }

RELIEF_KERNEL void arcsine_op(const GraphRangeOperands& o)
{
  growing(o, [](float a) { return std::asin(clamp(a, -1.0f, 1.0f)); });
}

RELIEF_KERNEL void arccosine_op(const GraphRangeOperands& o)
{
  const GraphRange a = o.in(0);
  const auto f = [](float x) { return std::acos(clamp(x, -1.0f, 1.0f)); };
  o.set(0, range_padded(each(a.high, f), each(a.low, f)));
}

RELIEF_KERNEL void arctangent_op(const GraphRangeOperands& o)
{
  growing(o, [](float a) { return std::atan(a); });
}

RELIEF_KERNEL void arctangent2_op(const GraphRangeOperands& o) { arctangent2(o); }

RELIEF_KERNEL void sinh_op(const GraphRangeOperands& o)
{
  growing(o, [](float a) { return std::sinh(a); });
}

RELIEF_KERNEL void cosh_op(const GraphRangeOperands& o)
{
  const GraphRange a = range_abs(o.in(0));
  const auto f = [](float x) { return std::cosh(x); };
  o.set(0, range_padded(each(max(a.low, F8{}), f), each(a.high, f)));
}

RELIEF_KERNEL void tanh_op(const GraphRangeOperands& o)
{
  growing(o, [](float a) { return std::tanh(a); });
}

RELIEF_KERNEL void rgb_to_hsv_op(const GraphRangeOperands& o) { to_hues(o, rgb_to_hsv, false); }

RELIEF_KERNEL void rgb_to_hsl_op(const GraphRangeOperands& o) { to_hues(o, rgb_to_hsl, true); }

RELIEF_KERNEL void hsv_to_rgb_op(const GraphRangeOperands& o) { from_hues(o, hsv_to_rgb, false); }

RELIEF_KERNEL void hsl_to_rgb_op(const GraphRangeOperands& o) { from_hues(o, hsl_to_rgb, true); }

RELIEF_KERNEL void noise_1d_op(const GraphRangeOperands& o) { noise<1>(o); }

RELIEF_KERNEL void noise_2d_op(const GraphRangeOperands& o) { noise<2>(o); }

RELIEF_KERNEL void noise_3d_op(const GraphRangeOperands& o) { noise<3>(o); }

RELIEF_KERNEL void noise_4d_op(const GraphRangeOperands& o) { noise<4>(o); }

RELIEF_KERNEL void signed_noise_1d_op(const GraphRangeOperands& o) { signed_noise<1>(o); }

RELIEF_KERNEL void signed_noise_2d_op(const GraphRangeOperands& o) { signed_noise<2>(o); }

RELIEF_KERNEL void signed_noise_3d_op(const GraphRangeOperands& o) { signed_noise<3>(o); }

RELIEF_KERNEL void signed_noise_4d_op(const GraphRangeOperands& o) { signed_noise<4>(o); }

RELIEF_KERNEL void hash_1d_op(const GraphRangeOperands& o) { hash<1>(o); }

RELIEF_KERNEL void hash_2d_op(const GraphRangeOperands& o) { hash<2>(o); }

RELIEF_KERNEL void hash_3d_op(const GraphRangeOperands& o) { hash<3>(o); }

RELIEF_KERNEL void hash_4d_op(const GraphRangeOperands& o) { hash<4>(o); }

RELIEF_KERNEL void voronoi_1d_op(const GraphRangeOperands& o) { voronoi<1>(o); }

RELIEF_KERNEL void voronoi_2d_op(const GraphRangeOperands& o) { voronoi<2>(o); }

RELIEF_KERNEL void voronoi_3d_op(const GraphRangeOperands& o) { voronoi<3>(o); }

RELIEF_KERNEL void voronoi_4d_op(const GraphRangeOperands& o) { voronoi<4>(o); }

RELIEF_KERNEL void musgrave_1d_op(const GraphRangeOperands& o) { musgrave<1>(o); }

RELIEF_KERNEL void musgrave_2d_op(const GraphRangeOperands& o) { musgrave<2>(o); }

RELIEF_KERNEL void musgrave_3d_op(const GraphRangeOperands& o) { musgrave<3>(o); }

RELIEF_KERNEL void musgrave_4d_op(const GraphRangeOperands& o) { musgrave<4>(o); }

RELIEF_KERNEL void image_op(const GraphRangeOperands& o) { image(o); }

RELIEF_KERNEL void image_box_op(const GraphRangeOperands& o) { image_box(o); }

RELIEF_KERNEL void image_tiles_op(const GraphRangeOperands& o) { image_tiles(o); }

RELIEF_KERNEL void table_op(const GraphRangeOperands& o) { table(o); }

RELIEF_KERNEL void grid_op(const GraphRangeOperands& o) { grid(o); }

RELIEF_KERNEL void brick_op(const GraphRangeOperands& o) { set_all(o, 2, unit()); }

RELIEF_KERNEL void fresnel_op(const GraphRangeOperands& o)
{
  const GraphRange cosine = o.in(0), eta = o.in(1);
  // The cosines of unit vectors, rounded; those of longer ones have bounds where the index is 1 at least: Cook and Torrance's
  // second factor is c (g − c) at most, which is less than (η² − 1) / 2.
  const I8 is_unit = (cosine.low >= -1.00001f) & (cosine.high <= 1.00001f) & (eta.low > 0.0f);
  const F8 half = max(splat8(1.0f), 0.5f * eta.high * eta.high);
  const GraphRange longer = range_between(F8{}, (0.5f + 0.5f * half * half) * 1.0001f);
  o.set(0, range_select(is_unit, range_between(F8{}, splat8(1.01f)),
                        range_select(eta.low >= 1.0f, longer, range_unknown())));
}

RELIEF_KERNEL void checker_op(const GraphRangeOperands& o) { o.set(0, unit()); }

RELIEF_KERNEL void open_share_op(const GraphRangeOperands& o) { o.set(0, unit()); }

RELIEF_KERNEL void bevel_op(const GraphRangeOperands& o)
{
  for (int i = 0; i < 3; ++i) o.set(i, range_between(splat8(-1.0f), splat8(1.0f)));
}

RELIEF_KERNEL void ies_op(const GraphRangeOperands& o)
{
  const float* table = o.program.tables + (o.immediates[0] | std::uint32_t{o.immediates[1]} << 16);
  const int angles = o.immediates[2] + o.immediates[3], size = ies_table_size(o.immediates[2], o.immediates[3]);
  float most = 0.0f;
  for (int i = angles; i < size; ++i) most = max(most, __builtin_fabsf(table[i]));
  // The weights of four values between two add up to 5/4 in size.
  o.set(0, range_between(F8{}, splat8(25.0f / 16.0f * 1.0001f * most)));
}

RELIEF_KERNEL void voxels_op(const GraphRangeOperands& o) { voxels(o); }

/// No spot is larger than 1, and eight in each of the cells around are looked at.
RELIEF_KERNEL void gabor_op(const GraphRangeOperands& o, float num_cells)
{
  const F8 most = splat8(num_cells * kGaborSpots);
  set_all(o, 2, range_between(-most, most));
}

RELIEF_KERNEL void gabor_2d_op(const GraphRangeOperands& o) { gabor_op(o, 9.0f); }
RELIEF_KERNEL void gabor_3d_op(const GraphRangeOperands& o) { gabor_op(o, 27.0f); }

/// Of any temperature: red of 800 K is the most, green of it the least.
RELIEF_KERNEL void blackbody_op(const GraphRangeOperands& o)
{
  set_all(o, 3, range_between(splat8(-0.25f), splat8(5.5f)));
}

}  // namespace graph_bounds

/// Runs a program: see GraphBoundsRun.
/// @param stop  true: the run is given up, and nothing is known; null: never
RELIEF_KERNEL void graph_bounds_run(const GraphProgramView& program,
                                    const TextureView* textures,
                                    GraphRangeRegisters& registers,
                                    const std::atomic<bool>* stop = nullptr)
{
  const std::uint16_t* word = program.code;
  const std::uint16_t* const end = word + program.num_words;
  for (unsigned count = 0; word < end; ++count) {
    if (count % kGraphOpsAPoll == 0 && stop != nullptr && stop->load(std::memory_order_relaxed)) [[unlikely]] {
      for (GraphRange& range : registers.lanes) range = range_unknown();
      return;
    }
    const auto op = static_cast<GraphOp>(*word++);
    const GraphOpShape& shape = kGraphOpShapes[static_cast<int>(op)];
    const std::uint16_t* immediates = word;
    const std::uint16_t* outputs = immediates + shape.num_immediates;
    const std::uint16_t* inputs = outputs + shape.num_outputs;
    word = inputs + shape.num_inputs;
    const GraphRangeOperands o{program, textures, registers, immediates, outputs, inputs, word};
    switch (op) {
#define X(name, num_outputs, num_inputs, num_immediates) \
  case GraphOp::name:                                    \
    graph_bounds::name##_op(o);                          \
    break;
#include "kernel/graph/graph_ops.inc"
#undef X
    }
  }
}

}  // namespace relief
