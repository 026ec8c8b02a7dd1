#include "displacement/dicing.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "displacement/level_of_detail.h"

namespace relief {

namespace {

/// Bilinear patches of texels that are wider than pixels are straight enough then: they bend by a sixteenth of what they do.
constexpr double kMostSegmentsATexel = 4;

}  // namespace

Dicing::Dicing(const MeshView& mesh,
               const DisplacedMeshView& triangles,
               std::span<const HeightFieldView* const> levels,
               double texel,
               const PictureView& view,
               std::span<const Affine3> instances,
               double pixels,
               const RequireBytes& require)
    : seen_(mesh, view, instances, SeenInstances::Coarser::kOutside),
      pixels_(pixels),
      texel_(texel),
      levels_(levels.begin(), levels.end()),
      mesh_(triangles)
{
  // However near the camera is; texels of some triangles are narrower than the mean.
  constexpr double kNarrower = 4;
  const double most_a_metre = kNarrower * kMostSegmentsATexel / texel_;
  // Nobody traces the parts' prisms.
  mesh_.unfolded = nullptr;
  mesh_.walls = nullptr;
  mesh_.num_walls = 0;
  if (!has_long_sides(most_a_metre)) return;
  parts_ = lattices_make(
      mesh,
      [&](Vec3f a, Vec3f b) {
        return std::min(seen_.pixels(a, b) / pixels_, most_a_metre * length(to_double(b) - to_double(a)));
      },
      require);
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
}

/// Whether a triangle may have to be cut. Of dense meshes none has.
bool Dicing::has_long_sides(double most_a_metre) const
{
  std::atomic<bool> has{false};
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, mesh_.num_triangles), [&](const auto& range) {
    for (std::uint32_t index = range.begin(); index < range.end() && !has.load(std::memory_order_relaxed); ++index) {
      const DisplacedTriangle& tri = mesh_.triangles[index];
      const double longest = static_cast<double>(
          std::max({length(tri.P[1] - tri.P[0]), length(tri.P[2] - tri.P[1]), length(tri.P[0] - tri.P[2])}));
      const double most = std::min(seen_.most_pixels_a_metre(to_double(tri.P[0]), longest) / pixels_, most_a_metre);
      if (!(most * longest < kMostLatticeCells)) has = true;
    }
  });
  return has;
}

TessellationRule Dicing::rule() const
{
  TessellationRule rule;
  rule.segments = [this](const DisplacedTriangle& tri, int edge) {
    return std::min(kMostSegmentsATexel * texels_along(tri, edge),
                    seen_.pixels(tri.P[edge], tri.P[edge == 2 ? 0 : edge + 1]) / pixels_);
  };
  rule.height = [this](Vec3d P, double x, double y) {
    return height(x, y, max(0.0, level(P) - std::log2(static_cast<double>(kTexelsASide))));
  };
  return rule;
}

double Dicing::level(Vec3d P) const
{
  const double last = static_cast<double>(levels_.size()) - 1;
  const double texels = pixels_ / (seen_.pixels_a_metre(P) * texel_);  // between two vertices
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
  if (parts_.empty()) return;
  const LatticeTriangle& part = parts_[*triangle];
  const Vec2f place = part.base_weights(*b1, *b2);
  *triangle = part.base;
  *b1 = place.x;
  *b2 = place.y;
}

}  // namespace relief
