// Rays from above against a height texture, as pixel shaders trace them.
#pragma once

#include <vector>

#include "benchmarks/heightfield/cone_map.h"

namespace relief {

/// In texture space: starts at height 1 and falls; z is the height.
struct TextureRay {
  double u, v, du, dv, dz;  ///< dz < 0
};

enum class ConeStepping { kOriginal, kCellMax };
enum class ConeRefinement { kNone, kSecant, kBisection };

/// Where a ray was found to meet the heights.
struct TextureHit {
  bool hit = false;       ///< above height 0
  bool converged = true;  ///< false: the iterations were used up
  double t = 0;
  int num_steps = 0;
};

/// Cone stepping.
/// @param cones          interpolated like the heights
/// @param max_iterations  after which a ray is given up
/// @source [D]; kCellMax: [B], Algorithm 1 and Eq. 1. The original takes steps of half a texel at least.
TextureHit cone_trace(const HeightTexture& texture,
                      const ConeMap& cones,
                      const TextureRay& ray,
                      ConeStepping stepping,
                      ConeRefinement refinement,
                      int max_iterations);

/// Equal steps from top to bottom, then a secant.
TextureHit linear_trace(const HeightTexture& texture, const TextureRay& ray, int num_steps);

/// The maximum mipmap over cells of two of the methods that come without cones.
class MaximumPyramid {
 public:
  explicit MaximumPyramid(const HeightTexture& texture);
  /// Descends where the ray may be below a node's maximum, and goes up when it leaves one.
  /// @param exact  cells are solved as bilinear patches (Tevs, Ihrke and Seidel 2008, "Maximum Mipmaps for Fast, Accurate, and
  ///               Scalable Dynamic Height Field Rendering"); otherwise by a secant over the cell (Drobot 2010, "Quadtree
  ///               Displacement Mapping with Height Blending", GPU Pro)
  TextureHit trace(const TextureRay& ray, bool exact, int max_iterations) const;

 private:
  const HeightTexture& texture_;
  std::vector<std::vector<float>> levels_;
};

/// Every cell that the ray crosses, each as a bilinear patch: what is right.
TextureHit exact_trace(const HeightTexture& texture, const TextureRay& ray);

}  // namespace relief
