#include "displacement/clearance.h"

#include <algorithm>
#include <cmath>

#include "displacement/level_blend.h"

namespace relief {

namespace {

std::int64_t cell_of(double x) { return static_cast<std::int64_t>(std::floor(x)); }

/// Σ |aᵢ|·rᵢ: how much a function with gradient a changes at most within a box.
double change_within(Vec3d a, Vec3d reach)
{
  return std::abs(a.x) * reach.x + std::abs(a.y) * reach.y + std::abs(a.z) * reach.z;
}

/// A rectangle around a point, in lattice coordinates.
struct Around {
  double x, y, dx, dy;

  bool has_crease() const { return cell_of(x - dx) != cell_of(x + dx) || cell_of(y - dy) != cell_of(y + dy); }
  HeightsBetween heights(const HeightFieldView& field) const
  {
    return heights_between(field, x - dx, y - dy, x + dx, y + dy);
  }
};

}  // namespace

HeightsBetween heights_between(const HeightFieldView& field, double x0, double y0, double x1, double y1)
{
  const std::int64_t i0 = cell_of(x0), j0 = cell_of(y0), i1 = cell_of(x1), j1 = cell_of(y1);
  if (i1 - i0 > 1 || j1 - j0 > 1) {
    HeightsBetween all;
    stored_to_heights(field, height_field_range(field, i0, j0, i1, j1), &all.low, &all.high);
    return all;
  }
  // A bilinear patch is extreme at the corners of any rectangle in it.
  const double xs[3] = {x0, i1 > i0 ? static_cast<double>(i1) : x0, x1};
  const double ys[3] = {y0, j1 > j0 ? static_cast<double>(j1) : y0, y1};
  HeightsBetween out{static_cast<double>(kInfinity), -static_cast<double>(kInfinity)};
  for (const double y : ys) {
    for (const double x : xs) {
      const double h = interpolate_height(field, x, y);
      out.low = std::min(out.low, h);
      out.high = std::max(out.high, h);
    }
  }
  return out;
}

SurfaceInBox surface_in_box(const DisplacedMeshView& mesh,
                            const DisplacedTriangle& tri,
                            double b1,
                            double b2,
                            Vec3d reach)
{
  const BasePoint base = base_point(tri, b1, b2);
  const auto [x, y] = lattice_point(tri, b1, b2);
  const double h = mesh.blend == nullptr ? interpolate_height(*mesh.field, x, y) : blended_height(mesh, x, y);
  const double nu = length(base.N), s = mesh.scale * (h - mesh.midlevel) / nu;
  // Gradients of b1, b2 and s, as functions of a point P(b) + s·N(b): the dual basis of its derivatives.
  const Vec3d u = base.Pu + s * base.Nu, v = base.Pv + s * base.Nv;
  const double inverse = 1.0 / dot(cross(u, v), base.N);
  const Vec3d b1_gradient = cross(v, base.N) * inverse, b2_gradient = cross(base.N, u) * inverse;
  const double dx = change_within(base.xu * b1_gradient + base.xv * b2_gradient, reach);
  const double dy = change_within(base.yu * b1_gradient + base.yv * b2_gradient, reach);
  // A box of so many texels would be one of a triangle without area; also turns away NaN.
  constexpr double kMostTexels = 1 << 20;
  if (!(dx + dy < kMostTexels)) return {};
  SurfaceInBox out;
  const Around around{x, y, dx, dy};
  out.crease = around.has_crease();
  Around around_coarse{};
  if (mesh.blend != nullptr) {
    const HeightMapView &fine = mesh.field->map, &coarse = mesh.blend->coarse->map;
    around_coarse = {lattice_on_level(x, fine.width, coarse.width), lattice_on_level(y, fine.height, coarse.height),
                     dx * coarse.width / fine.width, dy * coarse.height / fine.height};
    out.crease |= around_coarse.has_crease();
  }
  const double weights[3] = {1.0 - b1 - b2, b1, b2};
  const Vec3d gradients[3] = {-1.0 * (b1_gradient + b2_gradient), b1_gradient, b2_gradient};
  for (int k = 0; k < 3; ++k) {
    if (weights[k] < change_within(gradients[k], reach)) out.sides |= static_cast<std::uint8_t>(1u << k);
  }
  if (!out.crease && out.sides == 0) return out;
  HeightsBetween near = around.heights(*mesh.field);
  if (mesh.blend != nullptr) {
    const HeightsBetween coarse = around_coarse.heights(*mesh.blend->coarse);
    const double w = mesh.blend->weight;
    near = {(1.0 - w) * near.low + w * coarse.low, (1.0 - w) * near.high + w * coarse.high};
  }
  // Of the displacement s·|N|.
  const Vec3d n = base.N * (1.0 / nu);
  const Vec3d gradient =
      nu * inverse * cross(u, v) + s * (dot(n, base.Nu) * b1_gradient + dot(n, base.Nv) * b2_gradient);
  out.clearance = std::abs(mesh.scale) * std::max(near.high - h, h - near.low) + change_within(gradient, reach);
  return out;
}

void add_planes_in_box(const DisplacedMeshView& mesh,
                       const DisplacedTriangle& tri,
                       double b1,
                       double b2,
                       Vec3d error,
                       Vec3d reach,
                       std::vector<NearPlane>* planes)
{
  if (mesh.blend != nullptr) return;
  const BasePoint base = base_point(tri, b1, b2);
  const LatticePoint at = lattice_point(tri, b1, b2);
  const double inverse_length = 1.0 / length(base.N);
  const Vec3d n = base.N * inverse_length;
  const double d = displacement_at(mesh, at.x, at.y);
  // Around the base triangle's vertices as they are numbered, wherever the surface is turned over.
  const double winding = dot(cross(base.Pu, base.Pv), base.N) < 0 ? -1.0 : 1.0;
  struct Tangents {
    Vec3d u, v, normal;
  };
  const auto tangents = [&](std::int64_t i, std::int64_t j) {
    const CellHeights c = cell_heights(*mesh.field, i, j);
    const double fx = std::clamp(at.x - static_cast<double>(i), 0.0, 1.0),
                 fy = std::clamp(at.y - static_cast<double>(j), 0.0, 1.0);
    const double hx = mesh.scale * (c.hx + c.hxy * fy), hy = mesh.scale * (c.hy + c.hxy * fx);
    const auto derivative = [&](Vec3d dP, Vec3d dN, double dx, double dy) {
      return dP + (hx * dx + hy * dy) * n + (d * inverse_length) * (dN - dot(n, dN) * n);
    };
    const Vec3d u = derivative(base.Pu, base.Nu, base.xu, base.yu), v = derivative(base.Pv, base.Nv, base.xv, base.yv);
    return Tangents{u, v, cross(u, v)};
  };
  const Tangents own = tangents(cell_of(at.x), cell_of(at.y));
  const double squared = dot(own.normal, own.normal);
  if (!(squared > 0)) return;
  // Gradients along the surface, which are short wherever it is not degenerate itself.
  const Vec3d b1_gradient = cross(own.v, own.normal) * (1 / squared),
              b2_gradient = cross(own.normal, own.u) * (1 / squared);
  const double dx = std::min(change_within(base.xu * b1_gradient + base.xv * b2_gradient, reach), 0.5);
  const double dy = std::min(change_within(base.yu * b1_gradient + base.yv * b2_gradient, reach), 0.5);
  for (std::int64_t j = cell_of(at.y - dy); j <= cell_of(at.y + dy); ++j) {
    for (std::int64_t i = cell_of(at.x - dx); i <= cell_of(at.x + dx); ++i) {
      const Vec3d normal = tangents(i, j).normal;
      const double size = length(normal);
      if (!(size > 0)) continue;
      const Vec3d N = normal * (winding / size);
      planes->push_back({N, change_within(N, 2.0 * error + reach)});
    }
  }
}

}  // namespace relief
