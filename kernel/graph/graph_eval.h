// Runs a compiled value graph over eight points at a time. One function an opcode of graph_ops.inc, then graph_run, which
// decodes each instruction once for all lanes.
//
// Numbers are Blender's: a division by zero gives 0, roots and logarithms of what has none give 0, a negative power of 0 is
// infinite.
#pragma once

#include <atomic>
#include <cmath>
#include <limits>

#include "kernel/graph/blackbody.h"
#include "kernel/graph/color_spaces.h"
#include "kernel/graph/gabor.h"
#include "kernel/graph/graph_op.h"
#include "kernel/graph/graph_registers.h"
#include "kernel/graph/ies.h"
#include "kernel/graph/image.h"
#include "kernel/graph/musgrave.h"
#include "kernel/graph/noise.h"
#include "kernel/graph/voronoi.h"
#include "kernel/graph/voxels.h"
#include "kernel/math/lanes_functions.h"

namespace relief {

/// One instruction's operands.
struct GraphOperands {
  const GraphProgramView& program;
  const TextureView* textures;
  GraphRegisters& registers;
  const std::uint16_t* immediates;
  const std::uint16_t* outputs;
  const std::uint16_t* inputs;
  const std::uint16_t*& next;  ///< instruction
};

RELIEF_KERNEL F8 graph_in(const GraphOperands& o, int i) { return graph_operand(o.program, o.registers, o.inputs[i]); }
RELIEF_KERNEL void graph_set(const GraphOperands& o, int i, F8 value) { o.registers.lanes[o.outputs[i]] = value; }

template <typename F>
RELIEF_KERNEL F8 each_lane(F8 a, F&& f)
{
  for (int k = 0; k < 8; ++k) a[k] = f(a[k]);
  return a;
}

template <typename F>
RELIEF_KERNEL F8 each_lane(F8 a, F8 b, F&& f)
{
  for (int k = 0; k < 8; ++k) a[k] = f(a[k], b[k]);
  return a;
}

RELIEF_KERNEL F8 one_where(I8 is) { return is ? splat8(1.0f) : F8{}; }

/// A whole number of 32 bits as processors convert it: what does not fit is the lowest one.
RELIEF_KERNEL int graph_int(float a)
{
  return a >= -2147483648.0f && a < 2147483648.0f ? static_cast<int>(a) : std::numeric_limits<int>::min();
}

/// Power of a number that may be negative where the exponent is whole and has 32 bits; elsewhere 0. Of 0 it is the library's, so
/// that negative powers are infinite.
RELIEF_KERNEL float graph_power(float a, float b)
{
  return a < 0.0f && b != static_cast<float>(graph_int(b)) ? 0.0f : std::pow(a, b);
}

RELIEF_KERNEL float graph_logarithm(float a, float base)
{
  if (a <= 0.0f || base <= 0.0f) return 0.0f;
  const float scale = std::log(base);
  return scale != 0.0f ? std::log(a) / scale : 0.0f;
}

RELIEF_KERNEL void graph_copy(const GraphOperands& o) { graph_set(o, 0, graph_in(o, 0)); }
RELIEF_KERNEL void graph_add(const GraphOperands& o) { graph_set(o, 0, graph_in(o, 0) + graph_in(o, 1)); }
RELIEF_KERNEL void graph_subtract(const GraphOperands& o) { graph_set(o, 0, graph_in(o, 0) - graph_in(o, 1)); }
RELIEF_KERNEL void graph_multiply(const GraphOperands& o) { graph_set(o, 0, graph_in(o, 0) * graph_in(o, 1)); }
RELIEF_KERNEL void graph_divide(const GraphOperands& o)
{
  const F8 b = graph_in(o, 1);
  graph_set(o, 0, b != 0.0f ? graph_in(o, 0) / b : F8{});
}
RELIEF_KERNEL void graph_multiply_add(const GraphOperands& o)
{
  graph_set(o, 0, graph_in(o, 0) * graph_in(o, 1) + graph_in(o, 2));
}
RELIEF_KERNEL void graph_minimum(const GraphOperands& o) { graph_set(o, 0, min(graph_in(o, 0), graph_in(o, 1))); }
RELIEF_KERNEL void graph_maximum(const GraphOperands& o) { graph_set(o, 0, max(graph_in(o, 0), graph_in(o, 1))); }
RELIEF_KERNEL void graph_less_than(const GraphOperands& o)
{
  graph_set(o, 0, one_where(graph_in(o, 0) < graph_in(o, 1)));
}
RELIEF_KERNEL void graph_greater_than(const GraphOperands& o)
{
  graph_set(o, 0, one_where(graph_in(o, 0) > graph_in(o, 1)));
}
RELIEF_KERNEL void graph_equal(const GraphOperands& o) { graph_set(o, 0, one_where(graph_in(o, 0) == graph_in(o, 1))); }
/// The second where the first is not 0, else the third.
RELIEF_KERNEL void graph_select(const GraphOperands& o)
{
  graph_set(o, 0, graph_in(o, 0) != 0.0f ? graph_in(o, 1) : graph_in(o, 2));
}
/// The first where the second is not 0, else 0. Immediate: which guards belong together, for the compiler.
RELIEF_KERNEL void graph_guard(const GraphOperands& o)
{
  graph_set(o, 0, graph_in(o, 1) != 0.0f ? graph_in(o, 0) : F8{});
}
RELIEF_KERNEL void graph_floor(const GraphOperands& o) { graph_set(o, 0, floor(graph_in(o, 0))); }
RELIEF_KERNEL void graph_ceil(const GraphOperands& o) { graph_set(o, 0, -floor(-graph_in(o, 0))); }
RELIEF_KERNEL void graph_absolute(const GraphOperands& o) { graph_set(o, 0, abs(graph_in(o, 0))); }
RELIEF_KERNEL void graph_sign(const GraphOperands& o)
{
  const F8 a = graph_in(o, 0);
  graph_set(o, 0, one_where(a > 0.0f) - one_where(a < 0.0f));
}
RELIEF_KERNEL void graph_square_root(const GraphOperands& o) { graph_set(o, 0, sqrt(max(graph_in(o, 0), F8{}))); }
RELIEF_KERNEL void graph_power(const GraphOperands& o)
{
  const F8 a = graph_in(o, 0), b = graph_in(o, 1);
  // In single precision the product has the digits for a small power only.
  constexpr float kMostExact = 4.0f, kLeastNormal = 1.17549435e-38f;
  const I8 is_normal = (a >= kLeastNormal) & (a < kInfinity);
  const F8 exponent = b * log8(is_normal ? a : splat8(1.0f));
  const I8 is_exact = is_normal & (abs(exponent) <= kMostExact);
  F8 out = exp8(is_exact ? exponent : F8{});
  const unsigned exact = mask_of(is_exact);
  for (int k = 0; k < 8; ++k) {
    if ((exact >> k & 1u) == 0) out[k] = graph_power(a[k], b[k]);
  }
  graph_set(o, 0, out);
}
RELIEF_KERNEL void graph_logarithm(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), graph_in(o, 1), [](float a, float b) { return graph_logarithm(a, b); }));
}
RELIEF_KERNEL void graph_exponent(const GraphOperands& o)
{
  const F8 a = graph_in(o, 0);
  constexpr float kLargest = 87.0f;
  F8 out = exp8(a);
  const unsigned far = mask_of(~(abs(a) <= kLargest));
  for (int k = 0; far != 0 && k < 8; ++k) {
    if ((far >> k & 1u) != 0) out[k] = std::exp(a[k]);
  }
  graph_set(o, 0, out);
}
RELIEF_KERNEL void graph_modulo(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), graph_in(o, 1), [](float a, float b) {
              return b != 0.0f ? std::fmod(a, b) : 0.0f;
            }));
}
/// Sines and cosines; those of large angles one by one.
RELIEF_KERNEL SinCos8 graph_sin_cos(F8 a)
{
  const I8 is_near = abs(a) <= kLargestAngle;
  SinCos8 out = sin_cos(is_near ? a : F8{});
  const unsigned far = mask_of(~is_near);
  for (int k = 0; far != 0 && k < 8; ++k) {
    if ((far >> k & 1u) == 0) continue;
    out.sin[k] = std::sin(a[k]);
    out.cos[k] = std::cos(a[k]);
  }
  return out;
}
RELIEF_KERNEL void graph_sine(const GraphOperands& o) { graph_set(o, 0, graph_sin_cos(graph_in(o, 0)).sin); }
RELIEF_KERNEL void graph_cosine(const GraphOperands& o) { graph_set(o, 0, graph_sin_cos(graph_in(o, 0)).cos); }
RELIEF_KERNEL void graph_tangent(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), [](float a) { return std::tan(a); }));
}
RELIEF_KERNEL void graph_arcsine(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), [](float a) { return std::asin(clamp(a, -1.0f, 1.0f)); }));
}
RELIEF_KERNEL void graph_arccosine(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), [](float a) { return std::acos(clamp(a, -1.0f, 1.0f)); }));
}
RELIEF_KERNEL void graph_arctangent(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), [](float a) { return std::atan(a); }));
}
RELIEF_KERNEL void graph_arctangent2(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), graph_in(o, 1), [](float a, float b) { return std::atan2(a, b); }));
}
RELIEF_KERNEL void graph_sinh(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), [](float a) { return std::sinh(a); }));
}
RELIEF_KERNEL void graph_cosh(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), [](float a) { return std::cosh(a); }));
}
RELIEF_KERNEL void graph_tanh(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), [](float a) { return std::tanh(a); }));
}

/// Applies a function from Vec3f to Vec3f.
template <typename F>
RELIEF_KERNEL void graph_each_color(const GraphOperands& o, F&& f)
{
  alignas(32) float c[3][8];
  for (int i = 0; i < 3; ++i) store8(c[i], graph_in(o, i));
  for (int k = 0; k < 8; ++k) {
    const Vec3f out = f(Vec3f{c[0][k], c[1][k], c[2][k]});
    c[0][k] = out.x;
    c[1][k] = out.y;
    c[2][k] = out.z;
  }
  for (int i = 0; i < 3; ++i) graph_set(o, i, load8(c[i]));
}
RELIEF_KERNEL void graph_rgb_to_hsv(const GraphOperands& o) { graph_each_color(o, rgb_to_hsv); }
RELIEF_KERNEL void graph_hsv_to_rgb(const GraphOperands& o) { graph_each_color(o, hsv_to_rgb); }
RELIEF_KERNEL void graph_rgb_to_hsl(const GraphOperands& o) { graph_each_color(o, rgb_to_hsl); }
RELIEF_KERNEL void graph_hsl_to_rgb(const GraphOperands& o) { graph_each_color(o, hsl_to_rgb); }

/// Octaves of noise at a point of kDims coordinates; then detail, roughness, lacunarity. Immediates: whether normalized,
/// whether it repeats.
template <int kDims>
RELIEF_KERNEL void graph_noise(const GraphOperands& o)
{
  F8 p[kDims];
  for (int i = 0; i < kDims; ++i) p[i] = graph_in(o, i);
  const NoiseOctaves octaves{clamp(graph_in(o, kDims), 0.0f, 15.0f), max(graph_in(o, kDims + 1), F8{}),
                             graph_in(o, kDims + 2)};
  graph_set(o, 0, noise_fractal<kDims>(p, octaves, o.immediates[0] != 0, o.immediates[1] != 0));
}
RELIEF_KERNEL void graph_noise_1d(const GraphOperands& o) { graph_noise<1>(o); }
RELIEF_KERNEL void graph_noise_2d(const GraphOperands& o) { graph_noise<2>(o); }
RELIEF_KERNEL void graph_noise_3d(const GraphOperands& o) { graph_noise<3>(o); }
RELIEF_KERNEL void graph_noise_4d(const GraphOperands& o) { graph_noise<4>(o); }

/// Immediate: whether it repeats.
template <int kDims>
RELIEF_KERNEL void graph_signed_noise(const GraphOperands& o)
{
  F8 p[kDims];
  for (int i = 0; i < kDims; ++i) p[i] = graph_in(o, i);
  graph_set(o, 0, noise_signed<kDims>(p, o.immediates[0] != 0));
}
RELIEF_KERNEL void graph_signed_noise_1d(const GraphOperands& o) { graph_signed_noise<1>(o); }
RELIEF_KERNEL void graph_signed_noise_2d(const GraphOperands& o) { graph_signed_noise<2>(o); }
RELIEF_KERNEL void graph_signed_noise_3d(const GraphOperands& o) { graph_signed_noise<3>(o); }
RELIEF_KERNEL void graph_signed_noise_4d(const GraphOperands& o) { graph_signed_noise<4>(o); }

template <int kDims>
RELIEF_KERNEL void graph_hash(const GraphOperands& o)
{
  F8 key[kDims];
  for (int i = 0; i < kDims; ++i) key[i] = graph_in(o, i);
  graph_set(o, 0, hash_unit(key));
}
RELIEF_KERNEL void graph_hash_1d(const GraphOperands& o) { graph_hash<1>(o); }
RELIEF_KERNEL void graph_hash_2d(const GraphOperands& o) { graph_hash<2>(o); }
RELIEF_KERNEL void graph_hash_3d(const GraphOperands& o) { graph_hash<3>(o); }
RELIEF_KERNEL void graph_hash_4d(const GraphOperands& o) { graph_hash<4>(o); }

/// Cells at a point; then smoothness, exponent, randomness, detail, roughness, lacunarity. Immediates: feature, metric,
/// VoronoiFlags. Outputs: distance, colour, position as x, y, z, w, radius; in one dimension the position is w.
template <int kDims>
RELIEF_KERNEL void graph_voronoi(const GraphOperands& o)
{
  F8 p[kDims];
  for (int i = 0; i < kDims; ++i) p[i] = graph_in(o, i);
  const unsigned flags = o.immediates[2];
  const NoiseOctaves octaves{clamp(graph_in(o, kDims + 3), 0.0f, 15.0f), clamp(graph_in(o, kDims + 4), 0.0f, 1.0f),
                             graph_in(o, kDims + 5)};
  const auto eval = [&]<bool kPcg>() {
    const VoronoiSettings<kDims, kPcg> settings{static_cast<VoronoiFeature>(o.immediates[0]),
                                                static_cast<VoronoiMetric>(o.immediates[1]),
                                                graph_in(o, kDims),
                                                graph_in(o, kDims + 1),
                                                graph_in(o, kDims + 2),
                                                flags};
    return voronoi_fractal<kDims>(p, settings, octaves);
  };
  const bool is_pcg = (flags & kVoronoiPcg) != 0 && kDims > 1;
  const Voronoi<kDims> cells = is_pcg ? eval.template operator()<true>() : eval.template operator()<false>();
  graph_set(o, 0, cells.distance);
  for (int i = 0; i < 3; ++i) graph_set(o, 1 + i, cells.color[i]);
  for (int i = 0; i < 4; ++i) {
    const int axis = kDims == 1 ? i - 3 : i;
    graph_set(o, 4 + i, axis >= 0 && axis < kDims ? cells.position[axis] : F8{});
  }
  graph_set(o, 8, cells.distance);
}
RELIEF_KERNEL void graph_voronoi_1d(const GraphOperands& o) { graph_voronoi<1>(o); }
RELIEF_KERNEL void graph_voronoi_2d(const GraphOperands& o) { graph_voronoi<2>(o); }
RELIEF_KERNEL void graph_voronoi_3d(const GraphOperands& o) { graph_voronoi<3>(o); }
RELIEF_KERNEL void graph_voronoi_4d(const GraphOperands& o) { graph_voronoi<4>(o); }

/// Musgrave's noises at a point; then octaves, falloff, lacunarity, offset, gain. Immediates: type, whether noise repeats.
template <int kDims>
RELIEF_KERNEL void graph_musgrave(const GraphOperands& o)
{
  F8 p[kDims];
  for (int i = 0; i < kDims; ++i) p[i] = graph_in(o, i);
  const MusgraveSettings settings{clamp(graph_in(o, kDims), 0.0f, 16.0f),
                                  graph_in(o, kDims + 1),
                                  graph_in(o, kDims + 2),
                                  graph_in(o, kDims + 3),
                                  graph_in(o, kDims + 4),
                                  o.immediates[1] != 0};
  graph_set(o, 0, musgrave_eval<kDims>(p, static_cast<MusgraveType>(o.immediates[0]), settings));
}
RELIEF_KERNEL void graph_musgrave_1d(const GraphOperands& o) { graph_musgrave<1>(o); }
RELIEF_KERNEL void graph_musgrave_2d(const GraphOperands& o) { graph_musgrave<2>(o); }
RELIEF_KERNEL void graph_musgrave_3d(const GraphOperands& o) { graph_musgrave<3>(o); }
RELIEF_KERNEL void graph_musgrave_4d(const GraphOperands& o) { graph_musgrave<4>(o); }

/// One brick's random tint.
RELIEF_KERNEL float brick_tint(std::uint32_t row, std::uint32_t column)
{
  std::uint32_t n = ((row << 16) + (column & 0xffffu) + 1013u) & 0x7fffffffu;
  n ^= n >> 13;
  n = (n * (n * n * 60493u + 19990303u) + 1376312589u) & 0x7fffffffu;
  return 0.5f * static_cast<float>(n) / 1073741824.0f;
}

/// A number that is rounded before anything is added to it, where a compiler would fuse the two: Cycles does not, and far from the
/// origin the difference is as large as a brick's mortar.
RELIEF_KERNEL float graph_rounded(float a)
{
  asm("" : "+x"(a));
  return a;
}

/// Bricks at x, y; then mortar size and smoothness, bias, width, height, offset, squash. Immediates: every how many rows are
/// shifted, and squashed; 0: none. Outputs: tint, share of mortar.
RELIEF_KERNEL void graph_brick(const GraphOperands& o)
{
  alignas(32) float in[9][8], tint[8], mortar[8];
  for (int i = 0; i < 9; ++i) store8(in[i], graph_in(o, i));
  const auto row_of = [](float a) { return graph_int(__builtin_floorf(a)); };
  for (int k = 0; k < 8; ++k) {
    const float x_all = in[0][k], y_all = in[1][k], size = in[2][k], smooth = in[3][k], height = in[6][k];
    float width = in[5][k], shift = 0.0f;
    const int row = row_of(y_all / height);
    const int shifted_rows = o.immediates[0], squashed_rows = o.immediates[1];
    if (shifted_rows != 0 && squashed_rows != 0) {
      width *= row % squashed_rows != 0 ? 1.0f : in[8][k];
      shift = row % shifted_rows != 0 ? 0.0f : graph_rounded(width * in[7][k]);
    }
    const int column = row_of((x_all + shift) / width);
    const float x = x_all + shift - graph_rounded(width * static_cast<float>(column));
    const float y = y_all - graph_rounded(height * static_cast<float>(row));
    tint[k] =
        clamp(brick_tint(static_cast<std::uint32_t>(row), static_cast<std::uint32_t>(column)) + in[4][k], 0.0f, 1.0f);
    const float inside = min(min(x, y), min(width - x, height - y));
    const float depth = 1.0f - inside / size;
    const float t = clamp(depth / smooth, 0.0f, 1.0f);
    mortar[k] = inside >= size ? 0.0f : smooth == 0.0f ? 1.0f : depth < smooth ? t * t * (3.0f - 2.0f * t) : 1.0f;
  }
  graph_set(o, 0, load8(tint));
  graph_set(o, 1, load8(mortar));
}

/// Writes four numbers a lane.
template <typename F>
RELIEF_KERNEL void graph_set_rgba(const GraphOperands& o, F&& of_lane)
{
  F8 rgba[4];
  for (int k = 0; k < 8; ++k) {
    const Vec4f v = of_lane(k);
    rgba[0][k] = v.x;
    rgba[1][k] = v.y;
    rgba[2][k] = v.z;
    rgba[3][k] = v.w;
  }
  for (int c = 0; c < 4; ++c) graph_set(o, c, rgba[c]);
}

/// Image at u, v (v up) with a footprint's width; linear RGBA. Immediates: texture, ImageFlags.
RELIEF_KERNEL void graph_image(const GraphOperands& o)
{
  const TextureView& texture = o.textures[o.immediates[0]];
  const F8 u = graph_in(o, 0), v = graph_in(o, 1), width = graph_in(o, 2);
  graph_set_rgba(o, [&](int k) { return image_sample(texture, u[k], v[k], width[k], o.immediates[1]); });
}

/// Image on the sides of a box: at a point, by a normal and the width of seams. Immediates: texture, ImageFlags.
RELIEF_KERNEL void graph_image_box(const GraphOperands& o)
{
  const TextureView& texture = o.textures[o.immediates[0]];
  F8 in[7];
  for (int i = 0; i < 7; ++i) in[i] = graph_in(o, i);
  graph_set_rgba(o, [&](int k) {
    return image_box(texture, {in[0][k], in[1][k], in[2][k]}, {in[3][k], in[4][k], in[5][k]}, in[6][k],
                     o.immediates[1]);
  });
}

/// Tiled image at u, v (v up) with a footprint's width. Immediates: ImageFlags, rows of tiles, and by low and high word
/// the place of their textures' indices in the tables; −1: no such tile.
RELIEF_KERNEL void graph_image_tiles(const GraphOperands& o)
{
  const float* tiles = o.program.tables + (o.immediates[2] | std::uint32_t{o.immediates[3]} << 16);
  const F8 u = graph_in(o, 0), v = graph_in(o, 1), width = graph_in(o, 2);
  graph_set_rgba(o, [&](int k) {
    float x = u[k], y = v[k];
    const int tile = image_tile(x, y, o.immediates[1]);
    if (tile < 0 || tiles[tile] < 0.0f) return kMissingImage;
    return image_sample(o.textures[static_cast<int>(tiles[tile])], x, y, width[k], o.immediates[0]);
  });
}

/// Value of a table over 0…1. Immediates: its first float by low and high word, its entries, whether between two of them it
/// is interpolated, whether it goes on beyond its ends.
RELIEF_KERNEL void graph_table(const GraphOperands& o)
{
  const float* table = o.program.tables + (o.immediates[0] | std::uint32_t{o.immediates[1]} << 16);
  const int last = o.immediates[2] - 1;
  const bool interpolated = o.immediates[3] != 0;
  const bool goes_on = o.immediates[4] != 0 && last > 0;
  graph_set(o, 0, each_lane(graph_in(o, 0), [=](float x) {
              if (goes_on && x < 0.0f) return table[0] + (table[0] - table[1]) * -x * static_cast<float>(last);
              if (goes_on && x > 1.0f) {
                return table[last] + (table[last] - table[last - 1]) * (x - 1.0f) * static_cast<float>(last);
              }
              const float at = clamp(x, 0.0f, 1.0f) * static_cast<float>(last);
              const int i = at < static_cast<float>(last) ? static_cast<int>(at) : last;
              const float t = at - static_cast<float>(i);
              return interpolated && t > 0.0f ? (1.0f - t) * table[i] + t * table[i + 1] : table[i];
            }));
}

/// Colours of a table of two dimensions at u, v, between the centres of its cells, 0…1 over all of them. Immediates: its first
/// float by low and high word, its columns and rows.
RELIEF_KERNEL void graph_grid(const GraphOperands& o)
{
  const float* table = o.program.tables + (o.immediates[0] | std::uint32_t{o.immediates[1]} << 16);
  const int columns = o.immediates[2], rows = o.immediates[3];
  const auto cell = [](float at, int size, int* second, float* rest) {
    const float x = clamp(at * static_cast<float>(size) - 0.5f, 0.0f, static_cast<float>(size - 1));
    const int first = static_cast<int>(x);
    *rest = x - static_cast<float>(first);
    *second = first + 1 < size ? first + 1 : first;
    return first;
  };
  const F8 u = graph_in(o, 0), v = graph_in(o, 1);
  F8 rgb[3];
  for (int k = 0; k < 8; ++k) {
    int x1, y1;
    float s, t;
    const int x0 = cell(u[k], columns, &x1, &s), y0 = cell(v[k], rows, &y1, &t);
    for (int c = 0; c < 3; ++c) {
      const auto at = [=](int x, int y) { return table[(y * columns + x) * 3 + c]; };
      rgb[c][k] =
          (1.0f - t) * ((1.0f - s) * at(x0, y0) + s * at(x1, y0)) + t * ((1.0f - s) * at(x0, y1) + s * at(x1, y1));
    }
  }
  for (int c = 0; c < 3; ++c) graph_set(o, c, rgb[c]);
}

/// Intensity by a horizontal and a vertical angle. Immediates: first float of its table by low and high word, its numbers of
/// horizontal and of vertical angles.
RELIEF_KERNEL void graph_ies(const GraphOperands& o)
{
  const float* table = o.program.tables + (o.immediates[0] | std::uint32_t{o.immediates[1]} << 16);
  graph_set(o, 0, each_lane(graph_in(o, 0), graph_in(o, 1), [=](float horizontal, float vertical) {
              return ies_eval(table, o.immediates[2], o.immediates[3], horizontal, vertical);
            }));
}

/// What a lattice has at a point of the object. Immediate: which.
RELIEF_KERNEL void graph_voxels(const GraphOperands& o)
{
  const VoxelView& voxels = o.program.voxels[o.immediates[0]];
  const F8 x = graph_in(o, 0), y = graph_in(o, 1), z = graph_in(o, 2);
  F8 out[3];
  for (int k = 0; k < 8; ++k) {
    const Vec3f value = voxels_eval(voxels, {x[k], y[k], z[k]});
    out[0][k] = value.x;
    out[1][k] = value.y;
    out[2][k] = value.z;
  }
  for (int c = 0; c < 3; ++c) graph_set(o, c, out[c]);
}

/// 1 in every other cell of a lattice of unit cubes, but not in the one at the origin.
RELIEF_KERNEL void graph_checker(const GraphOperands& o)
{
  // Of each axis by itself: far away a sum of three has lost the bit that says whether it is odd.
  I8 is_odd{};
  for (int i = 0; i < 3; ++i) {
    // Keeps what lies on the border of two cells from flickering between them.
    const F8 cell = floor((graph_in(o, i) + 1e-6f) * 0.999999f);
    is_odd ^= cell - 2.0f * floor(0.5f * cell) == 1.0f;  // NaN and infinity: even
  }
  graph_set(o, 0, one_where(is_odd));
}

/// Waves at x, y; then frequency, isotropy and the direction's angle as a fraction of a turn. Outputs: sums of cosines and sines.
RELIEF_KERNEL void graph_gabor_2d(const GraphOperands& o)
{
  const F8 p[2] = {graph_in(o, 0), graph_in(o, 1)};
  GaborWaves waves{};
  waves.frequency = graph_in(o, 2);
  waves.isotropy = graph_in(o, 3);
  waves.azimuth_turns = graph_in(o, 4);
  const SinCos8 sum = gabor_noise<2>(p, waves);
  graph_set(o, 0, sum.cos);
  graph_set(o, 1, sum.sin);
}

/// Waves at x, y, z; then frequency, isotropy and the unit direction. Outputs: sums of cosines and sines.
RELIEF_KERNEL void graph_gabor_3d(const GraphOperands& o)
{
  const F8 p[3] = {graph_in(o, 0), graph_in(o, 1), graph_in(o, 2)};
  GaborWaves waves{graph_in(o, 3), graph_in(o, 4), {graph_in(o, 5), graph_in(o, 6), graph_in(o, 7)}, {}, {}};
  const auto turns_of = [](float y, float x) { return std::atan2(y, x) / (2.0f * kPi); };
  const F8 *d = waves.direction, flat = sqrt(d[0] * d[0] + d[1] * d[1]);
  waves.azimuth_turns = each_lane(d[1], d[0], turns_of);
  waves.inclination_turns = each_lane(flat, d[2], turns_of);
  const SinCos8 sum = gabor_noise<3>(p, waves);
  graph_set(o, 0, sum.cos);
  graph_set(o, 1, sum.sin);
}

/// Linear colour of a black body of some kelvins, with the luminance of white; may be below 0.
RELIEF_KERNEL void graph_blackbody(const GraphOperands& o)
{
  alignas(32) float kelvins[8], c[3][8];
  store8(kelvins, graph_in(o, 0));
  for (int k = 0; k < 8; ++k) {
    const Vec3f color = blackbody_color(kelvins[k]);
    c[0][k] = color.x;
    c[1][k] = color.y;
    c[2][k] = color.z;
  }
  for (int i = 0; i < 3; ++i) graph_set(o, i, load8(c[i]));
}

/// Reflectance of a dielectric. Normals that are linked may be longer than 1, and the cosine with them: the formula goes on there.
/// @param c    >= 0
/// @param eta  > 0
/// @source     Cook and Torrance 1982, "A Reflectance Model for Computer Graphics"
RELIEF_KERNEL float graph_reflectance(float c, float eta)
{
  const float squared = eta * eta - 1.0f + c * c;
  if (!(squared > 0.0f)) return 1.0f;
  const float g = __builtin_sqrtf(squared);
  const float across = (g - c) / (g + c);
  const float along = (c * (g + c) - 1.0f) / (c * (g - c) + 1.0f);
  return 0.5f * across * across * (1.0f + along * along);
}

/// Reflectance of a dielectric for a cosine and an index of refraction.
RELIEF_KERNEL void graph_fresnel(const GraphOperands& o)
{
  graph_set(o, 0, each_lane(graph_in(o, 0), graph_in(o, 1), [](float cos_i, float eta) {
              return graph_reflectance(__builtin_fabsf(cos_i), eta);
            }));
}

/// How much is open over a point by ambient occlusion: origins on both sides, geometric normal, normal and direction to the viewer, world; then the
/// distance that is looked, the instance that alone counts or −1, and the time. Immediate: rays.
RELIEF_KERNEL void graph_open_share(const GraphOperands& o)
{
  const GraphRays& rays = o.registers.rays;
  alignas(32) float in[18][8], out[8];
  for (int i = 0; i < 18; ++i) store8(in[i], graph_in(o, i));
  for (int k = 0; k < 8; ++k) {
    out[k] = 1.0f;
    if (rays.open_share == nullptr || (o.registers.used >> k & 1u) == 0) continue;
    const auto vector = [&](int i) { return Vec3f{in[i][k], in[i + 1][k], in[i + 2][k]}; };
    out[k] = rays.open_share(rays.scene, {{vector(0), vector(3)},
                                          vector(6),
                                          vector(9),
                                          vector(12),
                                          in[15][k],
                                          o.immediates[0],
                                          static_cast<std::int32_t>(in[16][k]),
                                          in[17][k]});
  }
  graph_set(o, 0, load8(out));
}

/// The normal of rounded edges: position, geometric normal and direction to the viewer, world; then the radius, the instance
/// and the time. Immediate: rays. (0, 0, 0) where there is none.
RELIEF_KERNEL void graph_bevel(const GraphOperands& o)
{
  const GraphRays& rays = o.registers.rays;
  alignas(32) float in[12][8], out[3][8] = {};
  for (int i = 0; i < 12; ++i) store8(in[i], graph_in(o, i));
  for (int k = 0; k < 8; ++k) {
    if (rays.bevel == nullptr || (o.registers.used >> k & 1u) == 0 || !(in[9][k] > 0.0f)) continue;
    const auto vector = [&](int i) { return Vec3f{in[i][k], in[i + 1][k], in[i + 2][k]}; };
    const Vec3f N = rays.bevel(rays.scene, {vector(0), vector(3), vector(6), in[9][k], o.immediates[0],
                                            static_cast<std::int32_t>(in[10][k]), in[11][k]});
    out[0][k] = N.x;
    out[1][k] = N.y;
    out[2][k] = N.z;
  }
  for (int i = 0; i < 3; ++i) graph_set(o, i, load8(out[i]));
}

/// Goes on some words later where no point has a factor but 0. Immediates: how many, by low and high word.
RELIEF_KERNEL void graph_skip(const GraphOperands& o)
{
  if ((mask_of(graph_in(o, 0) != 0.0f) & o.registers.used) != 0) return;
  o.next += o.immediates[0] | std::uint32_t{o.immediates[1]} << 16;
}

/// Operations after which a run asks whether it is to be given up. The dearest take a millisecond each.
inline constexpr unsigned kGraphOpsAPoll = 16;

/// Runs a program: see GraphRun.
/// @param stop  true: the run is given up, and all that it gives is 0; null: never
RELIEF_KERNEL void graph_run(const GraphProgramView& program,
                             const TextureView* textures,
                             GraphRegisters& registers,
                             const std::atomic<bool>* stop = nullptr)
{
  const std::uint16_t* word = program.code;
  const std::uint16_t* const end = word + program.num_words;
  for (unsigned count = 0; word < end; ++count) {
    if (count % kGraphOpsAPoll == 0 && stop != nullptr && stop->load(std::memory_order_relaxed)) [[unlikely]] {
      for (F8& lanes : registers.lanes) lanes = F8{};
      return;
    }
    const auto op = static_cast<GraphOp>(*word++);
    const GraphOpShape& shape = kGraphOpShapes[static_cast<int>(op)];
    const std::uint16_t* immediates = word;
    const std::uint16_t* outputs = immediates + shape.num_immediates;
    const std::uint16_t* inputs = outputs + shape.num_outputs;
    word = inputs + shape.num_inputs;
    const GraphOperands o{program, textures, registers, immediates, outputs, inputs, word};
    switch (op) {
#define X(name, num_outputs, num_inputs, num_immediates) \
  case GraphOp::name:                                    \
    graph_##name(o);                                     \
    break;
#include "kernel/graph/graph_ops.inc"
#undef X
    }
  }
}
}  // namespace relief
