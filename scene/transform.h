// Node transforms in double precision: a deep hierarchy is multiplied here and rounded to float once, at its end.
#pragma once

#include <array>
#include <optional>

#include "kernel/math/affine.h"

namespace relief {

using Vec3d = std::array<double, 3>;
/// Unit quaternion x, y, z, w, as glTF stores it.
using Quaternion = std::array<double, 4>;

/// 3×4 affine map: columns are the images of the axes and of the origin.
struct Transform {
  Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, p{0, 0, 0};
};

/// Translation · rotation · scale of a node (glTF 2.0, section 3.5.3).
struct Trs {
  Vec3d translation{0, 0, 0};
  Quaternion rotation{0, 0, 0, 1};
  Vec3d scale{1, 1, 1};
};

/// @param rotation  need not be unit; it is normalized; a zero one means no rotation
Transform transform_from_trs(const Trs& trs);

/// @param column_major  glTF's 16 numbers
/// @return empty unless the last row is 0 0 0 1
std::optional<Transform> transform_from_matrix(const std::array<double, 16>& column_major);

/// `a` after `b`.
Transform operator*(const Transform& a, const Transform& b);

Affine3 transform_to_affine(const Transform& t);

enum class TransformDefect : std::uint8_t { kNone, kNotFinite, kSingular };

/// Whether a transform can be used in single precision, forwards and backwards.
TransformDefect transform_defect(const Transform& t);

/// Unit vector along v; computed in double, where no square underflows. Zero stays zero.
Vec3f unit_direction(const Vec3d& v);

/// Negative determinant.
bool transform_mirrors(const Transform& t);

}  // namespace relief
