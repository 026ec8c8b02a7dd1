// The part `vector` of `relief bench displacement`: points that vectors move, in tiles that rays ask for (displacement/point_tiles.h),
// beside all their triangles in a tree of Embree's, alone and in pairs.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "benchmarks/displacement/measure.h"

namespace relief {

/// What is known of one way to trace one scene.
struct VectorMethodResult {
  std::string name;
  std::size_t bytes = 0;       ///< once all rays are traced, besides the base mesh
  std::size_t peak_bytes = 0;  ///< while it is built or traced
  double first_seconds = 0;    ///< of processor time, all threads, until the first ray can be traced
  std::array<Measurement, kNumBenchRayKinds> of_kind;
};

struct VectorResult {
  std::string name;
  std::size_t num_base_triangles = 0, num_triangles = 0;
  std::array<std::size_t, kNumBenchRayKinds> num_rays{};
  double tolerance = 0;  ///< metres along the ray
  std::vector<VectorMethodResult> methods;
  BenchPicture picture;
};

/// @param shrink    by which cells along a side are fewer, a power of two
/// @param progress  called with a line for people; may be empty
/// @error std::runtime_error, std::bad_alloc
std::vector<VectorResult> bench_vector_run(BenchResolution resolution,
                                           int rounds,
                                           std::int32_t shrink,
                                           const std::function<void(const std::string&)>& progress);

}  // namespace relief
