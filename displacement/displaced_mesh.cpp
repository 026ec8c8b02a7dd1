#include "displacement/displaced_mesh.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <initializer_list>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include "displacement/far_ray.h"
#include "displacement/lattice_split.h"
#include "displacement/level_of_detail.h"
#include "displacement/prism.h"
#include "displacement/seams.h"
#include "kernel/math/rounding.h"

namespace relief {

namespace {

/// Bounds of the heights between lattice positions on one level.
/// @param x, y  of the positions
void widen_by_heights(std::initializer_list<double> x,
                      std::initializer_list<double> y,
                      const HeightFieldView& field,
                      HeightBounds* bounds)
{
  const auto cell = [](double at) { return static_cast<std::int64_t>(std::floor(at)); };
  const auto [x_low, x_high] = std::minmax(x);
  const auto [y_low, y_high] = std::minmax(y);
  const StoredRange stored =
      height_field_range(field, cell(x_low - 1e-6), cell(y_low - 1e-6), cell(x_high + 1e-6), cell(y_high + 1e-6));
  double h_low, h_high;
  stored_to_heights(field, stored, &h_low, &h_high);
  bounds->low = std::min(bounds->low, h_low);
  bounds->high = std::max(bounds->high, h_high);
}

/// Area of a triangle in the map, texels.
double lattice_area(const DisplacedTriangle& tri)
{
  return 0.5 * std::abs((tri.x[1] - tri.x[0]) * (tri.y[2] - tri.y[0]) - (tri.y[1] - tri.y[0]) * (tri.x[2] - tri.x[0]));
}

/// Subtracts whole periods, so that digits are left for fractions of a texel where uv are large.
void rebase(double* x, const LatticeAxis& axis)
{
  if (axis.wrap == Wrap::kClamp) return;
  const double least = std::min({x[0], x[1], x[2]});
  const double periods = std::floor(least / axis.num_cells) * axis.num_cells;
  for (int k = 0; k < 3; ++k) x[k] -= periods;
}

/// The walls of a triangle's edges.
std::span<const SeamWall> walls_of(std::span<const SeamWall> walls, std::uint32_t triangle)
{
  const auto before = [](const SeamWall& wall, std::uint32_t edge) { return wall.edge < edge; };
  const auto first = std::lower_bound(walls.begin(), walls.end(), 3 * triangle, before);
  return {first, std::lower_bound(first, walls.end(), 3 * triangle + 3, before)};
}

/// Bounds of the heights that a triangle and the walls along it have on all levels.
HeightBounds height_bounds(const DisplacedTriangle& tri,
                           std::span<const SeamWall> walls,
                           const HeightFieldView& field,
                           std::span<const HeightFieldView* const> coarser)
{
  HeightBounds bounds;
  const auto widen = [&](const HeightFieldView& level) {
    const auto x = [&](double at) { return lattice_on_level(at, field.map.width, level.map.width); };
    const auto y = [&](double at) { return lattice_on_level(at, field.map.height, level.map.height); };
    widen_by_heights({x(tri.x[0]), x(tri.x[1]), x(tri.x[2])}, {y(tri.y[0]), y(tri.y[1]), y(tri.y[2])}, level, &bounds);
    for (const SeamWall& wall : walls)
      widen_by_heights({x(wall.x[0]), x(wall.x[1])}, {y(wall.y[0]), y(wall.y[1])}, level, &bounds);
  };
  widen(field);
  for (const HeightFieldView* level : coarser) widen(*level);
  return bounds;
}

/// Sets P and N of a triangle, or of a part of it.
void place_corners(const MeshView& mesh, const TriangleIndices& v, const LatticeTriangle* part, DisplacedTriangle* tri)
{
  const Vec3f P[3] = {mesh.P[v.v0], mesh.P[v.v1], mesh.P[v.v2]};
  Vec3f N[3];
  if (mesh.N != nullptr) {
    N[0] = as_vector(mesh.N[v.v0]);
    N[1] = as_vector(mesh.N[v.v1]);
    N[2] = as_vector(mesh.N[v.v2]);
  }
  corners_place(P, mesh.N != nullptr ? N : nullptr, part, tri);
}

/// A triangle without the bounds of its displacement.
/// @param is_far  becomes true if its texture coordinates are of no use
DisplacedTriangle place_triangle(const MeshView& mesh,
                                 std::uint32_t index,
                                 const HeightFieldView& field,
                                 const DisplacementMapping& mapping,
                                 bool* is_far)
{
  DisplacedTriangle tri;
  const TextureRef& m = mapping.height;
  const Vec2f* uv = mesh.uv[m.uv_set];
  const TriangleIndices& v = mesh.triangles[index];
  const std::uint32_t vertices[3] = {v.v0, v.v1, v.v2};
  place_corners(mesh, v, nullptr, &tri);
  for (int k = 0; k < 3; ++k) {
    const Vec2f t = uv != nullptr ? uv[vertices[k]] : Vec2f{};
    const double u = static_cast<double>(m.m00) * t.x + static_cast<double>(m.m01) * t.y + m.m02;
    const double w = static_cast<double>(m.m10) * t.x + static_cast<double>(m.m11) * t.y + m.m12;
    tri.x[k] = u * field.map.width - 0.5;
    tri.y[k] = w * field.map.height - 0.5;
    // NaN is far, too.
    *is_far |= !(std::abs(tri.x[k]) <= kMostTexels && std::abs(tri.y[k]) <= kMostTexels);
  }
  if (*is_far) {
    std::fill(tri.x, tri.x + 3, -0.5);
    std::fill(tri.y, tri.y + 3, -0.5);
  }
  rebase(tri.x, field.x);
  rebase(tri.y, field.y);
  tri.s_min = tri.s_max = 0;
  return tri;
}

}  // namespace

DisplacedMesh::DisplacedMesh(const MeshView& mesh,
                             const HeightFieldView& field,
                             const DisplacementMapping& mapping,
                             std::span<const HeightFieldView* const> coarser,
                             std::span<const MeshShape> steps)
    : triangles_(mesh.num_triangles), unfolded_(mesh.num_triangles), field_(&field), mapping_(mapping)
{
  set_steps(mesh, nullptr, steps);
  std::atomic<std::uint32_t> num_far_uv{0}, first_far_uv{mesh.num_triangles};
  tbb::parallel_for(std::uint32_t{0}, mesh.num_triangles, [&](std::uint32_t index) {
    bool is_far = false;
    triangles_[index] = place_triangle(mesh, index, field, mapping, &is_far);
    if (!is_far) return;
    num_far_uv.fetch_add(1, std::memory_order_relaxed);
    std::uint32_t first = first_far_uv.load(std::memory_order_relaxed);
    while (index < first && !first_far_uv.compare_exchange_weak(first, index, std::memory_order_relaxed)) {
    }
  });
  if (mapping.weld_seams) {
    walls_ = seam_walls_make(triangles_, field);
    seam_edges_.resize(triangles_.size());
    for (const SeamWall& wall : walls_) seam_edges_[wall.edge / 3] |= static_cast<std::uint8_t>(1u << (wall.edge % 3));
  }
  report_.num_walls = static_cast<std::uint32_t>(walls_.size());
  report_.num_far_uv = num_far_uv;
  report_.first_far_uv = first_far_uv;
  bound_triangles(
      [&](std::uint32_t index) { return height_bounds(triangles_[index], walls_of(walls_, index), field, coarser); });
}

DisplacedMesh::DisplacedMesh(const MeshView& mesh,
                             const ProceduralField& field,
                             const DisplacementMapping& mapping,
                             std::span<const MeshShape> steps)
    : triangles_(field.triangles().size()), unfolded_(triangles_.size()), mapping_(mapping)
{
  set_steps(mesh, field.triangles().data(), steps);
  tbb::parallel_for(std::size_t{0}, triangles_.size(), [&](std::size_t index) {
    const LatticeTriangle& lattice = field.triangles()[index];
    DisplacedTriangle& tri = triangles_[index];
    place_corners(mesh, mesh.triangles[lattice.base], &lattice, &tri);
    for (int k = 0; k < 3; ++k) {
      tri.x[k] = k == 1 ? lattice.n : 0;
      tri.y[k] = k == 2 ? lattice.n : 0;
    }
    tri.s_min = tri.s_max = 0;
  });
  bound_triangles([&](std::uint32_t index) {
    const LatticeRange range = field.range(index);
    return HeightBounds{range.low, range.high};
  });
}

/// Makes room for what is known of a mesh that deforms.
/// @param parts  of the mesh's triangles, which are displaced; null: the triangles are
/// @param steps  none: it does not deform
void DisplacedMesh::set_steps(const MeshView& mesh, const LatticeTriangle* parts, std::span<const MeshShape> steps)
{
  if (steps.empty()) return;
  deformation_ = std::make_unique<Deformation>();
  deformation_->triangles = mesh.triangles;
  deformation_->parts = parts;
  deformation_->steps.assign(steps.begin(), steps.end());
  deformation_->bounds.resize(triangles_.size());
}

/// Bounds the prisms, and the mesh.
/// @param heights  of a triangle
void DisplacedMesh::bound_triangles(const std::function<HeightBounds(std::uint32_t)>& heights)
{
  const auto num_triangles = static_cast<std::uint32_t>(triangles_.size());
  std::atomic<std::uint32_t> num_folded{0}, num_short{0}, num_degenerate{0};
  tbb::parallel_for(std::uint32_t{0}, num_triangles, [&](std::uint32_t index) {
    DisplacedTriangle& tri = triangles_[index];
    const HeightBounds h = heights(index);
    double d_low = mapping_.scale * (h.low - mapping_.midlevel), d_high = mapping_.scale * (h.high - mapping_.midlevel);
    if (d_low > d_high) std::swap(d_low, d_high);

    const PrismReport report = prism_bound(d_low, d_high, &tri);
    unfolded_[index] = report.unfolded ? 1 : 0;
    if (deformation_ != nullptr)
      deformation_->bounds[index] = deforming_bounds_make(*deformation_, index, d_low, d_high);
    if (report.degenerate) {
      num_degenerate.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    if (report.short_normals) num_short.fetch_add(1, std::memory_order_relaxed);
    if (!report.unfolded) num_folded.fetch_add(1, std::memory_order_relaxed);
  });
  report_.num_folded = num_folded;
  report_.num_short_normals = num_short;
  report_.num_degenerate = num_degenerate;
  box_ = tbb::parallel_reduce(
      tbb::blocked_range<std::uint32_t>(0, num_triangles), box_empty(),
      [&](const tbb::blocked_range<std::uint32_t>& range, Box3 sum) {
        for (std::uint32_t index = range.begin(); index < range.end(); ++index) {
          if (deformation_ == nullptr) {
            sum = box_union(sum, displaced_triangle_bounds(view(), index));
            continue;
          }
          for (std::uint32_t step = 0; step < deformation_->steps.size(); ++step)
            sum = box_union(sum, deforming_triangle_bounds(view(), index, step));
        }
        return sum;
      },
      box_union);
  if (num_triangles > 0) pad_ = ray_target_pad(ray_target_make(box_));
}

DisplacedMeshView DisplacedMesh::view() const
{
  return {triangles_.data(),
          unfolded_.data(),
          static_cast<std::uint32_t>(triangles_.size()),
          field_,
          mapping_.scale,
          mapping_.midlevel,
          mapping_.weld_seams ? seam_edges_.data() : nullptr,
          walls_.data(),
          static_cast<std::uint32_t>(walls_.size()),
          pad_,
          0,
          deformation_.get()};
}

float DisplacedMesh::widest_texel() const
{
  double widest = 0;
  const auto widen = [&](const DisplacedTriangle& tri, double texels) {
    const Vec3d a = to_double(tri.P[1]) - to_double(tri.P[0]), b = to_double(tri.P[2]) - to_double(tri.P[0]);
    if (texels > 0) widest = std::max(widest, 0.5 * length(cross(a, b)) / texels);
  };
  for (std::uint32_t index = 0; index < triangles_.size(); ++index) {
    const double texels = lattice_area(triangles_[index]);
    widen(triangles_[index], texels);
    for (std::uint32_t step = 0; deformation_ != nullptr && step < deformation_->steps.size(); ++step) {
      DisplacedTriangle then;
      deforming_triangle_at_step(*deformation_, index, step, &then);
      widen(then, texels);
    }
  }
  return static_cast<float>(std::sqrt(widest));
}

double mean_texels_a_side(const MeshView& mesh, const TextureRef& mapping, int width, int height)
{
  const Vec2f* uv = mesh.uv[mapping.uv_set];
  if (uv == nullptr || mesh.num_triangles == 0) return 0;
  double twice_uv_area = 0;
  for (std::uint32_t i = 0; i < mesh.num_triangles; ++i) {
    const TriangleIndices& v = mesh.triangles[i];
    const Vec2f a = uv[v.v1] - uv[v.v0], b = uv[v.v2] - uv[v.v0];
    twice_uv_area += std::abs(static_cast<double>(a.x) * b.y - static_cast<double>(a.y) * b.x);
  }
  const double texels_a_uv =
      std::abs(static_cast<double>(mapping.m00) * mapping.m11 - static_cast<double>(mapping.m01) * mapping.m10) *
      static_cast<double>(width) * static_cast<double>(height);
  return std::sqrt(twice_uv_area * texels_a_uv / mesh.num_triangles);
}

MapDensity map_density(const MeshView& mesh, const TextureRef& mapping)
{
  const Vec2f* uv = mesh.uv[mapping.uv_set];
  if (uv == nullptr) return {};
  double u_squares = 0, v_squares = 0, area = 0;
  for (std::uint32_t i = 0; i < mesh.num_triangles; ++i) {
    const TriangleIndices& t = mesh.triangles[i];
    const Vec3d e1 = to_double(mesh.P[t.v1] - mesh.P[t.v0]), e2 = to_double(mesh.P[t.v2] - mesh.P[t.v0]);
    const double twice_area = length(cross(e1, e2));
    if (!(twice_area > 0)) continue;
    const Vec2f a = uv[t.v1] - uv[t.v0], b = uv[t.v2] - uv[t.v0];
    const double u1 = static_cast<double>(mapping.m00) * a.x + static_cast<double>(mapping.m01) * a.y;
    const double v1 = static_cast<double>(mapping.m10) * a.x + static_cast<double>(mapping.m11) * a.y;
    const double u2 = static_cast<double>(mapping.m00) * b.x + static_cast<double>(mapping.m01) * b.y;
    const double v2 = static_cast<double>(mapping.m10) * b.x + static_cast<double>(mapping.m11) * b.y;
    // |∇u| = |u1·e2 − u2·e1| / |e1 × e2|.
    const double u = length(u1 * e2 - u2 * e1), v = length(v1 * e2 - v2 * e1);
    u_squares += u * u / twice_area;
    v_squares += v * v / twice_area;
    area += twice_area;
  }
  if (!(area > 0)) return {};
  return {std::sqrt(u_squares / area), std::sqrt(v_squares / area)};
}

Box3 displaced_triangle_bounds(const DisplacedMeshView& mesh, std::uint32_t triangle)
{
  const DisplacedTriangle& tri = mesh.triangles[triangle];
  if (tri.s_min > tri.s_max) {
    const Vec3f P = tri.P[0];
    return {P, P};
  }
  const auto bounds = [&](float Vec3f::*axis, float* low, float* high) {
    double prism_low = kInfinity, prism_high = -kInfinity, magnitude = 0;
    double base_low = kInfinity, base_high = -kInfinity, longest = 0;
    for (int k = 0; k < 3; ++k) {
      const double p = tri.P[k].*axis, n = tri.N[k].*axis;
      for (const double s : {static_cast<double>(tri.s_min), static_cast<double>(tri.s_max)}) {
        prism_low = std::min(prism_low, p + s * n);
        prism_high = std::max(prism_high, p + s * n);
        magnitude = std::max(magnitude, std::abs(p) + std::abs(s * n));
      }
      base_low = std::min(base_low, p);
      base_high = std::max(base_high, p);
      longest = std::max(longest, length(to_double(tri.N[k])));
    }
    // |d| = |s|·|N| is at most this, in any direction.
    const double reach =
        std::max(std::abs(static_cast<double>(tri.s_min)), std::abs(static_cast<double>(tri.s_max))) * longest;
    // A float's ulp covers the rounding of all that.
    const double pad = static_cast<double>(kUnitRoundoff) * magnitude + mesh.pad;
    *low = round_down(std::max(prism_low, base_low - reach) - pad);
    *high = round_up(std::min(prism_high, base_high + reach) + pad);
  };
  Box3 box;
  bounds(&Vec3f::x, &box.low.x, &box.high.x);
  bounds(&Vec3f::y, &box.low.y, &box.high.y);
  bounds(&Vec3f::z, &box.low.z, &box.high.z);
  return box;
}

}  // namespace relief
