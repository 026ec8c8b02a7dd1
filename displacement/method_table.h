// What a method prepares of one level of a height map, besides the bounds that all have (height_field.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>
#include <utility>

namespace relief {

/// Where RMIP splits a 2D bound.
enum class RmipSplit : std::uint8_t {
  kBound,  ///< in the middle of its longer side: Fig. 5c of the paper
  kRay,    ///< at the middle of the ray's interval: Fig. 5b, Patterson and others 1991
};
inline constexpr std::string_view kRmipSplitLabels[] = {"bound", "ray"};

/// What RMIP meets in one cell.
enum class RmipLeaf : std::uint8_t {
  kBilinear,   ///< the surface, by the leaf test of all methods
  kTriangles,  ///< two triangles between the displaced corners, as published: another surface, with cracks
};
inline constexpr std::string_view kRmipLeafLabels[] = {"bilinear", "triangles"};

/// How the surface over a rectangle of the map is bounded in space.
enum class SpaceBounds : std::uint8_t {
  kHull,    ///< its exact ranges (bounds3d.h)
  kAffine,  ///< boxes of object space by affine arithmetic, as published
};
inline constexpr std::string_view kSpaceBoundsLabels[] = {"hull", "affine"};

/// What RMIP meets at a fractional level of detail.
enum class RmipLevels : std::uint8_t {
  kMixed,         ///< one of two levels, by chance: level_of_detail.h
  kInterpolated,  ///< one surface between them, if the level is fixed: level_blend.h
};
inline constexpr std::string_view kRmipLevelsLabels[] = {"mixed", "interpolated"};

/// What RMIP's authors studied in their Figs. 5, 10 and 12, and their fractional levels of detail. TFDM takes the bounds.
struct RmipOptions {
  double marching_scale = 16;       ///< texels; rectangles whose sides are no longer are marched through
  bool reduce_by_inversion = true;  ///< bounds are tightened by inverting the displacement at the ends of a 3D box
  int resolution = 0;               ///< blocks of the table along each axis; 0: rmip_linear_resolution
  RmipSplit split = RmipSplit::kBound;
  RmipLeaf leaf = RmipLeaf::kBilinear;
  RmipLevels levels = RmipLevels::kMixed;
  SpaceBounds bounds = SpaceBounds::kHull;

  bool operator==(const RmipOptions&) const = default;
};

struct MethodTable {
  std::shared_ptr<const void> owner;
  const void* view = nullptr;  ///< as the method's traversal takes it
  std::size_t bytes = 0;
};

/// The table of one of these classes, which own a view of themselves.
template <class Owner>
MethodTable method_table_of(std::shared_ptr<const Owner> owner)
{
  const void* view = &owner->view();
  const std::size_t bytes = owner->bytes();
  return {std::move(owner), view, bytes};
}

}  // namespace relief
