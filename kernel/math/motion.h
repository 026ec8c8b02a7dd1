// Where something is while the shutter is open: transforms at evenly spaced times, taken apart, and what lies between them.
// Whoever asks for the same time gets the same transform, whether a ray is traced or its hit is shaded. Times go from 0,
// when the shutter opens, to 1, when it closes.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernel/math/affine.h"

namespace relief {

/// A transform as translation · rotation · stretch.
struct MotionKey {
  double p[3] = {0, 0, 0};     ///< translation
  double q[4] = {0, 0, 0, 1};  ///< unit quaternion x, y, z, w; of q and −q the one nearer to the key before
  double s[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< columns of the stretch
};

/// Keys of one thing; none: it stands still.
struct MotionView {
  const MotionKey* keys = nullptr;
  std::uint32_t num_keys = 0;  ///< 0, or at least 2
};

/// Place of a time between two of evenly spaced keys.
struct MotionPlace {
  std::uint32_t key;  ///< the one before
  double part;        ///< of the way to the next, 0…1
};

/// @param time      0…1
/// @param num_keys  at least 2
RELIEF_KERNEL MotionPlace motion_place(float time, std::uint32_t num_keys)
{
  const double along = static_cast<double>(time) * (num_keys - 1);
  const auto before = static_cast<std::uint32_t>(along);
  const std::uint32_t key = before < num_keys - 2 ? before : num_keys - 2;
  return {key, along - key};
}

/// Transform at a time: translation and stretch go straight from key to key, rotations by the shorter arc at an even pace.
/// @pre there are keys
/// @source Shoemake 1985, "Animating Rotation with Quaternion Curves"; Shoemake and Duff 1992, "Matrix Animation and Polar
///         Decomposition"
[[gnu::noinline]] RELIEF_KERNEL Affine3 motion_at(MotionView motion, float time)
{
  const MotionPlace place = motion_place(time, motion.num_keys);
  const MotionKey &a = motion.keys[place.key], &b = motion.keys[place.key + 1];
  double wa = 1.0 - place.part, wb = place.part;
  const auto mix = [&](double from, double to) { return wa * from + wb * to; };
  const double p[3] = {mix(a.p[0], b.p[0]), mix(a.p[1], b.p[1]), mix(a.p[2], b.p[2])};
  double s[9];
  for (int i = 0; i < 9; ++i) s[i] = mix(a.s[i], b.s[i]);
  // Where the arc is so short that its sine is all rounding, the straight mix differs by less than that rounding.
  constexpr double kShortArc = 1e-6;
  const double cosine = a.q[0] * b.q[0] + a.q[1] * b.q[1] + a.q[2] * b.q[2] + a.q[3] * b.q[3];
  const double angle = std::acos(cosine < 1.0 ? cosine : 1.0);
  if (angle > kShortArc) {
    const double sine = std::sin(angle);
    wa = std::sin(wa * angle) / sine;
    wb = std::sin(wb * angle) / sine;
  }
  double x = mix(a.q[0], b.q[0]), y = mix(a.q[1], b.q[1]), z = mix(a.q[2], b.q[2]), w = mix(a.q[3], b.q[3]);
  const double unit = 1.0 / std::sqrt(x * x + y * y + z * z + w * w);
  x *= unit, y *= unit, z *= unit, w *= unit;
  const double rows[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                             {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                             {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  const auto column = [&](const double* v) {
    const auto row = [&](int i) {
      return static_cast<float>(rows[i][0] * v[0] + rows[i][1] * v[1] + rows[i][2] * v[2]);
    };
    return Vec3f{row(0), row(1), row(2)};
  };
  return {column(s),
          column(s + 3),
          column(s + 6),
          {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])}};
}

}  // namespace relief
