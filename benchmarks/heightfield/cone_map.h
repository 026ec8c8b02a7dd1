// Cone maps as published, to be measured: over a texture of heights in 0…1 that repeats, on [0, 1]² of texture space. They are
// for heights over a plane and rays from above; what `cone` (displacement/methods/cone.cpp) made exact of them is part of the
// program, these are not.
//
// Dummer 2006, "Cone Step Mapping: An Iterative Ray-Heightfield Intersection Algorithm" [D]. Policarpo and Oliveira 2007,
// "Relaxed Cone Stepping for Relief Mapping", GPU Gems 3 [P]. Valasek and Bán 2022, "Quick Cone Map Generation on the GPU" [V].
// Bán, Valasek, Bálint and Vad, "Robust Cone Step Mapping" [B].
#pragma once

#include <string>
#include <vector>

namespace relief {

/// Heights at texel centres, row by row, bilinear in between.
struct HeightTexture {
  int size = 0;  ///< texels a side
  std::vector<float> h;

  float texel(int i, int j) const
  {
    const auto wrap = [this](int k) { return static_cast<std::size_t>(((k % size) + size) % size); };
    return h[wrap(j) * static_cast<std::size_t>(size) + wrap(i)];
  }
  /// @param texels  of this size
  double at(const std::vector<float>& texels, double u, double v) const;
  double height(double u, double v) const { return at(h, u, v); }
};

/// Tangent of the half opening angle of the cone over each texel, 0…1: length in texture space by height.
using ConeMap = std::vector<float>;

/// [D]: no texel is within a cone. All pairs of texels.
ConeMap cone_map_conservative(const HeightTexture& texture);
/// [V]: the same, by a maximum mipmap, and never wider.
ConeMap cone_map_quick(const HeightTexture& texture);
/// [P]: rays from the top through each other texel are followed in so many steps to where they come out again.
ConeMap cone_map_relaxed_approximate(const HeightTexture& texture, int num_steps);
/// [B], Algorithm 2: only texels limit a cone where the surface falls as seen from its apex. Nearest ones first, until the cone
/// is as narrow as anything further away could make it.
ConeMap cone_map_relaxed(const HeightTexture& texture);
/// [B]'s future work: [V] by maximum mipmaps of what limits, one a quadrant.
ConeMap cone_map_quick_relaxed(const HeightTexture& texture);
/// [B], Eq. 2: the least of 3 × 3 texels, so that interpolation is in it.
ConeMap cone_map_corrected(const HeightTexture& texture, const ConeMap& map);

}  // namespace relief
