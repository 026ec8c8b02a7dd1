// Numbers on a lattice of which most of space has none: bricks of 8 × 8 × 8 values, and a table of where they are. Value graphs
// read what volumes' files hold from them.
#pragma once

#include "kernel/graph/voxel_view.h"
#include "kernel/texture/half.h"

namespace relief {

/// Where a value of the lattice stands; those of places without a brick are the background's.
RELIEF_KERNEL const std::uint16_t* voxel_at(const VoxelView& v, int x, int y, int z)
{
  const int bx = (x >> 3) - v.first[0], by = (y >> 3) - v.first[1], bz = (z >> 3) - v.first[2];
  const bool is_within = bx >= 0 && by >= 0 && bz >= 0 && bx < v.count[0] && by < v.count[1] && bz < v.count[2];
  const std::size_t brick = is_within ? v.bricks[(static_cast<std::size_t>(bx) * static_cast<std::size_t>(v.count[1]) +
                                                  static_cast<std::size_t>(by)) *
                                                     static_cast<std::size_t>(v.count[2]) +
                                                 static_cast<std::size_t>(bz)]
                                      : 0;
  const int within = ((x & 7) << 6) | ((y & 7) << 3) | (z & 7);
  return v.values + (brick * kBrickVoxels + static_cast<std::size_t>(within)) * static_cast<std::size_t>(v.channels);
}

/// The value between eight of the lattice; one number stands in all three.
/// @param P  object space
RELIEF_KERNEL Vec3f voxels_eval(const VoxelView& v, Vec3f P)
{
  // Farther away, and of what is not a number, all is background.
  constexpr float kOutermost = 0x1p28f;
  const Vec3f p = transform_point(v.lattice_from_object, P);
  const bool is_near =
      __builtin_fabsf(p.x) < kOutermost && __builtin_fabsf(p.y) < kOutermost && __builtin_fabsf(p.z) < kOutermost;
  const float fx = is_near ? __builtin_floorf(p.x) : kOutermost, fy = is_near ? __builtin_floorf(p.y) : kOutermost,
              fz = is_near ? __builtin_floorf(p.z) : kOutermost;
  const int x = static_cast<int>(fx), y = static_cast<int>(fy), z = static_cast<int>(fz);
  const Vec3f t = is_near ? Vec3f{p.x - fx, p.y - fy, p.z - fz} : Vec3f{};
  const std::uint16_t* corners[8];
  corners[0] = voxel_at(v, x, y, z);
  if ((x & 7) != 7 && (y & 7) != 7 && (z & 7) != 7) {
    for (int i = 1; i < 8; ++i) corners[i] = corners[0] + ((i & 1 ? 64 : 0) + (i & 2 ? 8 : 0) + (i >> 2)) * v.channels;
  } else {
    for (int i = 1; i < 8; ++i) corners[i] = voxel_at(v, x + (i & 1), y + (i >> 1 & 1), z + (i >> 2));
  }
  float out[3];
  for (int c = 0; c < v.channels; ++c) {
    const auto along_x = [&](int i) {
      const float a = float_from_half(corners[i][c]);
      return a + t.x * (float_from_half(corners[i + 1][c]) - a);
    };
    const float a = along_x(0), b = along_x(4);
    const float low = a + t.y * (along_x(2) - a), high = b + t.y * (along_x(6) - b);
    out[c] = low + t.z * (high - low);
  }
  return v.channels == 1 ? splat3(out[0]) : Vec3f{out[0], out[1], out[2]};
}

RELIEF_KERNEL VoxelRange voxel_hull(const VoxelRange& a, const VoxelRange& b)
{
  return {min(a.low, b.low), max(a.high, b.high)};
}

/// Least and largest values that voxels_eval may give in a box.
/// @param low, high  of the box, on the lattice
/// @cost  some thousand values or bricks
RELIEF_KERNEL VoxelRange voxels_range(const VoxelView& v, const float (&low)[3], const float (&high)[3])
{
  constexpr float kMost = 4096;
  int first[3], last[3];  // of the lattice, both within
  bool leaves = false;    // what has a table
  float single = 1, whole = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const int begin = v.first[axis] * kBrickSize, end = (v.first[axis] + v.count[axis]) * kBrickSize;
    const float a = __builtin_floorf(low[axis]), b = __builtin_floorf(high[axis]) + 1.0f;
    if (!(a <= b)) return v.range;
    leaves = leaves || !(a >= static_cast<float>(begin)) || !(b < static_cast<float>(end));
    if (!(a < static_cast<float>(end)) || !(b >= static_cast<float>(begin))) return v.ranges[0];
    first[axis] = a >= static_cast<float>(begin) ? static_cast<int>(a) : begin;
    last[axis] = b < static_cast<float>(end) ? static_cast<int>(b) : end - 1;
    single *= static_cast<float>(last[axis] - first[axis] + 1);
    whole *= static_cast<float>((last[axis] >> 3) - (first[axis] >> 3) + 1);
  }
  if (whole > kMost) return v.range;
  VoxelRange out = leaves ? v.ranges[0] : VoxelRange{splat3(kInfinity), splat3(-kInfinity)};
  const int step = single <= kMost ? 1 : kBrickSize;
  for (int x = first[0] & -step; x <= last[0]; x += step) {
    for (int y = first[1] & -step; y <= last[1]; y += step) {
      for (int z = first[2] & -step; z <= last[2]; z += step) {
        const std::uint16_t* at = voxel_at(v, x, y, z);
        if (step != 1) {
          const auto brick =
              static_cast<std::size_t>(at - v.values) / (kBrickVoxels * static_cast<std::size_t>(v.channels));
          out = voxel_hull(out, v.ranges[brick]);
          continue;
        }
        const float x0 = float_from_half(at[0]);
        const Vec3f value = v.channels == 1 ? splat3(x0) : Vec3f{x0, float_from_half(at[1]), float_from_half(at[2])};
        out = voxel_hull(out, {value, value});
      }
    }
  }
  return out;
}

}  // namespace relief
