// The light that surrounds the scene: a lat-long map, one constant radiance, or what a value graph gives for a direction.
// environment_eval is the light, environment_sample and environment_pdf choose directions about in proportion to it; the tables
// they read are made by integrator/environment_tables.h.
//
// Directions: the map's centre looks along −Z, its right half is +X, its top +Y. Direction d of the unrotated map has
// u = ½ + atan2(d.x, −d.z) / 2π, v = θ / π with θ the angle to +Y; the rotation adds to u.
#pragma once

#include "kernel/math/trigonometry.h"
#include "kernel/sample/warp.h"
#include "kernel/texture/texture.h"

namespace relief {

/// Radiance from a direction of surroundings that are computed, W/m²/sr; may be negative. A pointer, as graphs are run apart from the stages.
/// @param wi  unit, towards the environment, world space
using EnvironmentRadiance = Vec3f (*)(const void* computed, Vec3f wi);

/// The disk of a sun among computed surroundings, which is smaller than a cell: it is sampled by itself.
struct EnvironmentSun {
  Vec3f towards;          ///< its middle; unit, world space
  float cone = 0;         ///< 1 − cosine of its radius
  float probability = 0;  ///< with which it is chosen
};

/// An environment and its sampling tables. Cells are those of a grid over the map, uniform in u and v; within a cell
/// directions are uniform in solid angle, so that the density is constant over it and bounded at the poles.
struct EnvironmentView {
  Vec3f color{};  ///< radiance factor, strength included; the radiance itself without a map
  bool has_map = false;      ///< it is not constant
  float rotation_turns = 0;  ///< rotation about +Y in turns, [0, 1)
  TextureView map;           ///< repeats in u; copied, so that a look-up needs no further pointer
  /// Gives the radiance in the map's place, as `color` times what it returns. Null: it is not computed.
  EnvironmentRadiance radiance_of = nullptr;
  const void* computed = nullptr;  ///< handed to it

  const EnvironmentSun* suns = nullptr;  ///< of computed surroundings
  int num_suns = 0;
  float cells_probability = 1;        ///< with which a cell is chosen, and no sun
  int num_columns = 0, num_rows = 0;  ///< of cells; rows even. 0: no cell is sampled
  const float* row_cdf = nullptr;     ///< num_rows + 1, from 0 to 1
  const float* column_cdf = nullptr;  ///< num_rows × (num_columns + 1), each row from 0 to 1
  /// num_rows + 1; upper hemisphere: sin²(θ/2) at the row's upper edge, lower hemisphere: cos²(θ/2). Solid angle is
  /// uniform in either, and either is accurate near its own pole.
  const float* row_edges = nullptr;
};

struct EnvironmentSample {
  Vec3f wi{};                 ///< unit, towards the environment
  Vec3f radiance{};           ///< of environment_eval(wi)
  float pdf_solid_angle = 0;  ///< 0: nothing was sampled
};

/// Position on the map, u in [0, 1], v in [0, 1].
/// @param wi  unit
RELIEF_KERNEL Vec2f environment_uv(const EnvironmentView& environment, Vec3f wi)
{
  // atan2 of (sine, cosine) instead of acos of the cosine, which has no digits left near the poles.
  const float sin_theta = __builtin_sqrtf(wi.x * wi.x + wi.z * wi.z);
  const float v = angle_of(sin_theta, wi.y) * kInvPi;
  const float turn = angle_of(__builtin_fabsf(wi.x), -wi.z) * (0.5f * kInvPi);
  const float u = 0.5f + __builtin_copysignf(turn, wi.x) + environment.rotation_turns;
  return {u - __builtin_floorf(u), clamp(v, 0.0f, 1.0f)};
}

/// Radiance at a position of the map, from environment_uv.
/// @pre there is a map
RELIEF_KERNEL Vec3f environment_eval_uv(const EnvironmentView& environment, Vec2f uv)
{
  // Half a texel from the poles the first and last rows are repeated, whatever the texture's own wrap mode.
  const float half_texel = 0.5f / static_cast<float>(environment.map.height);
  const Vec2f inside{uv.x, clamp(uv.y, half_texel, 1.0f - half_texel)};
  return environment.color * xyz(texture_sample(environment.map, inside, 0.0f));
}

/// Radiance that arrives from a direction.
/// @param wi  unit, towards the environment, world space
/// @return    W/m²/sr; negative where it takes light away
RELIEF_KERNEL Vec3f environment_eval(const EnvironmentView& environment, Vec3f wi)
{
  if (!environment.has_map) return environment.color;
  if (environment.radiance_of != nullptr) return environment.color * environment.radiance_of(environment.computed, wi);
  return environment_eval_uv(environment, environment_uv(environment, wi));
}

/// Cell of a cumulative distribution that contains x, and its place in it.
struct CdfCell {
  int index = 0;
  float fraction = 0;     ///< in [0, 1)
  float probability = 0;  ///< of the cell; > 0
};

/// @param cdf  num_cells + 1 values from 0 to 1, not decreasing, multiples of 2⁻²⁴ (so that differences are exact)
/// @param x    in [0, 1)
/// @return     the cell with cdf[index] <= x < cdf[index + 1]: never one of probability 0
/// @cost       log2(num_cells) steps
RELIEF_KERNEL CdfCell cdf_cell(const float* cdf, int num_cells, float x)
{
  int low = 0;
  for (int length = num_cells; length > 1;) {
    const int half = length / 2;
    low = cdf[low + half] <= x ? low + half : low;
    length -= half;
  }
  const float probability = cdf[low + 1] - cdf[low];
  return {low, (x - cdf[low]) / probability, probability};
}

/// Solid angle of a cell of a row, steradians.
RELIEF_KERNEL float environment_cell_solid_angle(const EnvironmentView& environment, int row)
{
  const float height = __builtin_fabsf(environment.row_edges[row + 1] - environment.row_edges[row]);
  return 4.0f * kPi * height / static_cast<float>(environment.num_columns);
}

/// Direction of a place in a cell; inverse of environment_uv with a step from uniform v to uniform solid angle.
/// @param x, y  place in the cell, in [0, 1); y = 0 is its upper edge
RELIEF_KERNEL Vec3f environment_direction(const EnvironmentView& environment, int column, int row, float x, float y)
{
  const float e = lerp(y, environment.row_edges[row], environment.row_edges[row + 1]);
  const float cos_theta = 2 * row < environment.num_rows ? 1.0f - 2.0f * e : 2.0f * e - 1.0f;
  const float sin_theta = 2.0f * safe_sqrt(e * (1.0f - e));
  const float u = (static_cast<float>(column) + x) / static_cast<float>(environment.num_columns);
  const SinCos phi = sin_cos_turn(u - 0.5f - environment.rotation_turns);
  return {sin_theta * phi.sin, cos_theta, -sin_theta * phi.cos};
}

/// Density of a place on the map among the cells.
RELIEF_KERNEL float environment_cells_pdf(const EnvironmentView& environment, Vec2f uv)
{
  if (environment.num_rows == 0) return 0.0f;
  const int column = axis_nearest(uv.x, environment.num_columns, Wrap::kClamp);
  const int row = axis_nearest(uv.y, environment.num_rows, Wrap::kClamp);
  const float* column_cdf = environment.column_cdf + static_cast<std::ptrdiff_t>(row) * (environment.num_columns + 1);
  const float probability =
      (environment.row_cdf[row + 1] - environment.row_cdf[row]) * (column_cdf[column + 1] - column_cdf[column]);
  return probability / environment_cell_solid_angle(environment, row);
}

/// Density of the suns at a direction, with the choice among them and the cells.
RELIEF_KERNEL float environment_suns_pdf(const EnvironmentView& environment, Vec3f wi)
{
  float pdf = 0.0f;
  for (int i = 0; i < environment.num_suns; ++i) {
    const EnvironmentSun& sun = environment.suns[i];
    // By the difference, as sun_light_is_met.
    if (length_squared(wi - sun.towards) <= 2.0f * sun.cone) pdf += sun.probability * warp_cone_pdf(sun.cone);
  }
  return pdf;
}

/// Density of environment_sample at a direction.
/// @param wi  unit, world space
/// @return    1/sr; positive wherever the light that the tables were made for is
RELIEF_KERNEL float environment_pdf(const EnvironmentView& environment, Vec3f wi)
{
  if (!environment.has_map) return 0.25f * kInvPi;
  const float in_cells = environment_cells_pdf(environment, environment_uv(environment, wi));
  return environment.cells_probability * in_cells + environment_suns_pdf(environment, wi);
}

/// A direction in a cell chosen by the tables, with the density of that.
/// @param u  uniform in [0, 1)²; u.x chooses the column, u.y the row
/// @pre      there are cells
RELIEF_KERNEL EnvironmentSample environment_cells_sample(const EnvironmentView& environment, Vec2f u)
{
  const CdfCell row = cdf_cell(environment.row_cdf, environment.num_rows, u.y);
  const float* column_cdf =
      environment.column_cdf + static_cast<std::ptrdiff_t>(row.index) * (environment.num_columns + 1);
  const CdfCell column = cdf_cell(column_cdf, environment.num_columns, u.x);
  EnvironmentSample sample;
  sample.wi = environment_direction(environment, column.index, row.index, column.fraction, row.fraction);
  sample.pdf_solid_angle = row.probability * column.probability / environment_cell_solid_angle(environment, row.index);
  return sample;
}

/// A direction by suns and cells together; u.x chooses among them, and what is left of it serves on.
/// @return  without radiance; pdf 0: neither was found
RELIEF_KERNEL EnvironmentSample environment_choose(const EnvironmentView& environment, Vec2f u)
{
  constexpr float kBelowOne = 1.0f - 0x1p-24f;
  for (int i = 0; i < environment.num_suns; ++i) {
    const EnvironmentSun& sun = environment.suns[i];
    if (u.x < sun.probability) {
      const Vec2f within{min(u.x / sun.probability, kBelowOne), u.y};
      EnvironmentSample sample;
      sample.wi = from_local(frame_from_normal(sun.towards), warp_cone(sun.cone, within));
      sample.pdf_solid_angle = environment_pdf(environment, sample.wi);
      return sample;
    }
    u.x -= sun.probability;
  }
  if (environment.num_rows == 0) return {};
  u.x = min(u.x / environment.cells_probability, kBelowOne);
  EnvironmentSample sample = environment_cells_sample(environment, u);
  sample.pdf_solid_angle = environment.cells_probability * sample.pdf_solid_angle +
                           environment_suns_pdf(environment, sample.wi);
  return sample;
}

/// A direction towards the environment, in proportion to its luminance, or what the tables take of it, averaged over
/// cells.
/// @param u  uniform in [0, 1)²
/// @return   uniform over the sphere without a map; pdf 0: nothing was sampled
RELIEF_KERNEL EnvironmentSample environment_sample(const EnvironmentView& environment, Vec2f u)
{
  if (!environment.has_map) {
    const float z = 1.0f - 2.0f * u.y;
    const float r = 2.0f * safe_sqrt(u.y * (1.0f - u.y));
    const SinCos phi = sin_cos_turn(u.x);
    return {{r * phi.cos, z, r * phi.sin}, environment.color, 0.25f * kInvPi};
  }
  EnvironmentSample sample;
  if (environment.num_suns > 0) {
    sample = environment_choose(environment, u);
  } else if (environment.num_rows > 0) {
    sample = environment_cells_sample(environment, u);
  }
  if (sample.pdf_solid_angle > 0.0f) sample.radiance = environment_eval(environment, sample.wi);
  return sample;
}

/// A direction of all of the environment's light, for photons: half of them by environment_sample, whose density may leave
/// dim parts out, half evenly.
/// @param u  uniform in [0, 1)²
RELIEF_KERNEL EnvironmentSample environment_sample_all(const EnvironmentView& environment, Vec2f u)
{
  const float even = 0.25f * kInvPi;
  const bool has_cells = environment.has_map && (environment.num_rows > 0 || environment.num_suns > 0);
  EnvironmentSample sample;
  if (has_cells && u.x < 0.5f) {
    sample = environment_sample(environment, {2.0f * u.x, u.y});
  } else {
    const float x = has_cells ? 2.0f * u.x - 1.0f : u.x;
    const float z = 1.0f - 2.0f * u.y;
    const float r = 2.0f * safe_sqrt(u.y * (1.0f - u.y));
    const SinCos phi = sin_cos_turn(x);
    sample.wi = {r * phi.cos, z, r * phi.sin};
    sample.radiance = environment_eval(environment, sample.wi);
  }
  sample.pdf_solid_angle = has_cells ? 0.5f * (environment_pdf(environment, sample.wi) + even) : even;
  return sample;
}

/// Radiance and density at once, for paths that leave the scene.
RELIEF_KERNEL EnvironmentSample environment_eval_pdf(const EnvironmentView& environment, Vec3f wi)
{
  return {wi, environment_eval(environment, wi), environment_pdf(environment, wi)};
}

}  // namespace relief
