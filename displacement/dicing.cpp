#include "displacement/dicing.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include <tbb/parallel_for.h>

#include "displacement/level_of_detail.h"
#include "displacement/stretch.h"
#include "kernel/math/box.h"

namespace relief {

namespace {

/// Bilinear patches of texels that are wider than pixels are straight enough then: they bend by a sixteenth of what they do.
constexpr double kMostSegmentsATexel = 4;
/// Of more instances than this only the nearest are looked at.
constexpr std::size_t kMostInstances = 16;

/// @return  those that show a metre of the mesh longest, by its middle
std::vector<Affine3> nearest_instances(const MeshView& mesh, const PictureView& view, std::span<const Affine3> all)
{
  std::vector<Affine3> instances(all.begin(), all.end());
  if (instances.size() <= kMostInstances) return instances;
  Box3 box = box_empty();
  for (std::uint32_t i = 0; i < mesh.num_vertices; ++i) box = box_union(box, {mesh.P[i], mesh.P[i]});
  const Vec3f middle = 0.5f * (box.low + box.high);
  std::vector<std::pair<double, std::size_t>> by_size;
  for (std::size_t i = 0; i < all.size(); ++i) {
    by_size.emplace_back(-stretch_of(all[i]).most * view.pixels_a_metre(to_double(transform_point(all[i], middle))), i);
  }
  std::nth_element(by_size.begin(), by_size.begin() + kMostInstances, by_size.end());
  instances.clear();
  for (std::size_t k = 0; k < kMostInstances; ++k) instances.push_back(all[by_size[k].second]);
  return instances;
}

}  // namespace

Dicing::Dicing(const MeshView& mesh,
               const DisplacedMeshView& triangles,
               std::span<const HeightFieldView* const> levels,
               double texel,
               const PictureView& view,
               std::span<const Affine3> instances,
               double pixels)
    : view_(view),
      instances_(nearest_instances(mesh, view, instances)),
      pixels_(pixels),
      texel_(texel),
      levels_(levels.begin(), levels.end()),
      mesh_(triangles)
{
  for (const Affine3& m : instances_) stretches_.push_back(stretch_of(m).most);
  // However near the camera is; texels of some triangles are narrower than the mean.
  constexpr double kNarrower = 4;
  parts_ = lattices_make(mesh, [this](Vec3f a, Vec3f b) {
    return std::min(segments(a, b), kNarrower * kMostSegmentsATexel / texel_ * length(to_double(b) - to_double(a)));
  });
  triangles_.resize(parts_.size());
  tbb::parallel_for(std::size_t{0}, parts_.size(), [&](std::size_t index) {
    const LatticeTriangle& part = parts_[index];
    const DisplacedTriangle& whole = triangles.triangles[part.base];
    DisplacedTriangle& tri = triangles_[index] = whole;
    for (int k = 0; k < 3; ++k) {
      const Vec2f w = part.corner[k];
      tri.P[k] = lattice_corner(w, whole.P[0], whole.P[1], whole.P[2]);
      tri.N[k] = lattice_corner(w, whole.N[0], whole.N[1], whole.N[2]);
      const double b1 = w.x, b2 = w.y, b0 = 1.0 - b1 - b2;
      tri.x[k] = b0 * whole.x[0] + b1 * whole.x[1] + b2 * whole.x[2];
      tri.y[k] = b0 * whole.y[0] + b1 * whole.y[1] + b2 * whole.y[2];
    }
  });
  mesh_.triangles = triangles_.data();
  mesh_.num_triangles = static_cast<std::uint32_t>(triangles_.size());
  // Nobody traces the parts' prisms.
  mesh_.unfolded = nullptr;
  mesh_.walls = nullptr;
  mesh_.num_walls = 0;
}

TessellationRule Dicing::rule() const
{
  TessellationRule rule;
  rule.segments = [this](const DisplacedTriangle& tri, int edge) {
    return std::min(kMostSegmentsATexel * texels_along(tri, edge),
                    segments(tri.P[edge], tri.P[edge == 2 ? 0 : edge + 1]));
  };
  rule.height = [this](Vec3d P, double x, double y) {
    return height(x, y, max(0.0, level(P) - std::log2(static_cast<double>(kTexelsASide))));
  };
  return rule;
}

double Dicing::segments(Vec3f a, Vec3f b) const
{
  // The same bits either way.
  if (std::tie(b.x, b.y, b.z) < std::tie(a.x, a.y, a.z)) std::swap(a, b);
  double most = 0;
  for (const Affine3& m : instances_) {
    const Vec3f ends[2] = {transform_point(m, a), transform_point(m, b)};
    const Vec3d from = to_double(ends[0]), to = to_double(ends[1]);
    const double coarsening =
        min(view_.coarsening(0.5 * (from + to)), min(view_.coarsening(from), view_.coarsening(to)));
    most = std::max(most, view_.pixels(ends[0], ends[1]) / coarsening);
  }
  return most / pixels_;
}

double Dicing::level(Vec3d P) const
{
  double density = 0;
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    const Affine3& m = instances_[i];
    const Vec3d world = P.x * to_double(m.x) + P.y * to_double(m.y) + P.z * to_double(m.z) + to_double(m.p);
    density = std::max(density, stretches_[i] * view_.pixels_a_metre(world) / view_.coarsening(world));
  }
  const double last = static_cast<double>(levels_.size()) - 1;
  const double texels = pixels_ / (density * texel_);  // between two vertices
  return texels > 1 ? std::min(std::log2(texels), last) : 0.0;
}

double Dicing::height(double x, double y, double level) const
{
  const auto at = [&](std::size_t k) {
    const HeightFieldView &finest = *levels_[0], &f = *levels_[k];
    return interpolate_height(f, lattice_on_level(x, finest.map.width, f.map.width),
                              lattice_on_level(y, finest.map.height, f.map.height));
  };
  const auto k = static_cast<std::size_t>(level);
  const double part = level - static_cast<double>(k), h = at(k);
  return part > 0 ? h + part * (at(k + 1) - h) : h;
}

void Dicing::set_base_place(std::uint32_t* triangle, float* b1, float* b2) const
{
  const LatticeTriangle& part = parts_[*triangle];
  const Vec2f place = part.base_weights(*b1, *b2);
  *triangle = part.base;
  *b1 = place.x;
  *b2 = place.y;
}

}  // namespace relief
