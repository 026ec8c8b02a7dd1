// Whole frames of a benchmark's scene, path traced by the renderer: what a difference in ray tracing is worth once
// shading, sampling and everything else are paid for.
#pragma once

#include <string>
#include <vector>

#include "benchmarks/displacement/measure.h"

namespace relief {

/// One method's frame.
struct FrameResult {
  std::string scene, method;
  double rate = 1;            ///< of tessellations: edges a texel
  double render_seconds = 0;  ///< of wall clock, one thread, fastest of the rounds
  double build_seconds = 0;
  std::uint64_t num_rays = 0;  ///< of all kinds
  std::size_t bytes = 0;       ///< tables, prepared or tessellated triangles and trees, besides the map
  double difference = 0;       ///< root mean square difference from the first method's picture, over its mean
};

/// Renders half of the resolution's width and height with 4 samples a pixel and 4 bounces, under an even sky and a sun.
/// All methods have the same random numbers, so that exact ones give the same picture.
/// @param tessellation_bytes  what a tessellation may take while it is built; it is made coarser if need be
/// @return  chord, rmip, tfdm and both tessellations
std::vector<FrameResult> bench_frames(const BenchScene& bench,
                                      BenchResolution resolution,
                                      int rounds,
                                      std::uint64_t tessellation_bytes);

}  // namespace relief
