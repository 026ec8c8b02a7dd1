// Rays of a scene, and what methods make of them: the same rays for all, timed in turns.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "benchmarks/displacement/contender.h"

namespace relief {

struct BenchResolution {
  int width = 640, height = 360;
};

/// Direction to the sun of all scenes.
inline const Vec3f kBenchSun = normalize(Vec3f{0.5f, 0.7f, 0.6f});

/// Where a scene is seen from; axes are unit.
struct BenchCamera {
  Vec3f eye, forward, right, up;
  float half_height = 1;  ///< of the picture, at distance 1
};

BenchCamera bench_camera(const BenchSceneSpec& spec);

/// The rays of one scene by kind, and where the primary rays hit.
struct BenchRays {
  std::array<std::vector<BenchRay>, kNumBenchRayKinds> of_kind;
  std::vector<float> shading;  ///< a pixel: cosine to the light, 0.1 at least, 0 for the background

  const std::vector<BenchRay>& of(BenchRayKind kind) const { return of_kind[static_cast<std::size_t>(kind)]; }
};

/// One primary ray a pixel, and at each of their hits one bounce ray with cosine-distributed direction and one shadow ray
/// towards a sun. Secondary rays start on the exact surface, moved off it by the larger of its rounding error and a
/// quarter of a texel, so that a tessellation does not end them at once where its facets lie outside of the surface.
/// @param exact  what finds the exact surface
/// @param given  rays in place of the primary ones; empty: none
BenchRays bench_rays_make(const BenchScene& scene,
                          const BenchTracer& exact,
                          BenchResolution resolution,
                          const std::vector<BenchRay>& given = {});

/// A picture in memory: rows from the top, 3 bytes a pixel.
struct BenchPicture {
  int width = 0, height = 0;
  std::string caption;
  std::vector<std::uint8_t> rgb;
};

/// A scene as its primary rays see it.
BenchPicture shaded_picture(const BenchRays& rays, BenchResolution resolution, std::string caption);

/// What a method did with one kind of rays.
struct Measurement {
  double nanoseconds = 0;                                     ///< of processor time a ray
  double bounds = 0, texels = 0, inversions = 0, prisms = 0;  ///< counted, a ray
  double disagreement = 0;  ///< share of rays that end elsewhere than the first contender's
  double hit_share = 0;
};

/// Traces the rays by all tracers, chunk after chunk in turns, `rounds` times; a chunk counts with its fastest time,
/// so that what else the machine does is left out.
/// @param rounds  0: nothing is timed
/// @param tolerance  metres by which two hits may differ along the ray
/// @return  a tracer each
std::vector<Measurement> bench_measure(std::span<const BenchTracer* const> tracers,
                                       BenchRayKind kind,
                                       const std::vector<BenchRay>& rays,
                                       int rounds,
                                       double tolerance);

/// What owners of tracers own.
template <class Tracer>
std::vector<const BenchTracer*> tracers_of(const std::vector<std::unique_ptr<Tracer>>& owners)
{
  std::vector<const BenchTracer*> tracers;
  for (const auto& owner : owners) tracers.push_back(owner.get());
  return tracers;
}

}  // namespace relief
