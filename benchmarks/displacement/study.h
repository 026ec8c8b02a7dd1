// What `relief bench displacement` does: Table 1 of Thonat et al. 2023 and of its supplement on scenes like theirs, and
// their Figs. 9 to 12.
//
// T. Thonat, I. Georgiev, F. Beaune, T. Boubekeur, "RMIP: Displacement ray-tracing via inversion and oblong bounding",
// SIGGRAPH Asia 2023.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "benchmarks/displacement/frames.h"
#include "benchmarks/displacement/own_scene.h"
#include "benchmarks/displacement/vector_study.h"
#include "displacement/cost_model.h"

namespace relief {

/// Parts of the study.
struct BenchParts {
  bool table = true;      ///< all methods on all scenes: memory, preparation, speed, counts, agreement; step pictures
  bool marching = true;   ///< Fig. 10: marching scale × RMIP resolution
  bool sweeps = true;     ///< Fig. 11: more displacement, more tiles
  bool inversion = true;  ///< Fig. 12: bounds reduced by inversion or not; Fig. 5b's split, and the published leaf
  bool tessellation = true;  ///< ways to build a tessellation's tree
  bool costs = true;         ///< the constants by which `auto` chooses
  bool frames = true;        ///< whole path-traced frames
  bool vectors = true;       ///< points that vectors move, on scenes of their own
};

struct BenchOptions {
  std::vector<std::string> scenes;  ///< names; empty: all
  const OwnScene* own = nullptr;    ///< in place of the ten
  std::vector<BenchRay> rays;       ///< in place of those of a camera; empty: none
  BenchParts parts;
  double map_scale = 1;  ///< factor of the maps' sides, but of an own scene's
  std::int32_t vector_shrink = 1;  ///< by which points that vectors move are fewer along a side, a power of two
  BenchResolution resolution;
  int rounds = 3;
  std::uint64_t tessellation_bytes = 0;  ///< for the two tessellations of a scene together, while they are built
  std::function<void(const std::string&)> progress;  ///< called with a line for people; may be empty
};

/// What is known of one method on one scene.
struct MethodResult {
  std::string name;
  double rate = 1;  ///< of tessellations: edges a texel
  std::uint64_t num_micro_triangles = 0;
  std::size_t table_bytes = 0, triangle_bytes = 0, bvh_bytes = 0;
  double build_seconds = 0, rescale_seconds = 0;  ///< see Contender
  std::array<Measurement, kNumBenchRayKinds> of_kind;

  bool is_tessellation() const { return num_micro_triangles > 0; }
  std::size_t bytes() const { return table_bytes + triangle_bytes + bvh_bytes; }
  /// Millions of rays a second. @return 0 if nothing was timed
  double speed(BenchRayKind kind) const
  {
    const double nanoseconds = of_kind[static_cast<std::size_t>(kind)].nanoseconds;
    return nanoseconds > 0 ? 1e3 / nanoseconds : 0;
  }
};

struct SceneResult {
  std::string name, like;
  PaperFigures paper;
  std::size_t num_triangles = 0, map_bytes = 0;
  int map_width = 0, map_height = 0;
  double tiles_u = 1, tiles_v = 1;
  double tolerance = 0;  ///< metres along the ray: beyond it two methods disagree
  std::array<std::size_t, kNumBenchRayKinds> num_rays{};
  std::vector<MethodResult> methods;
  std::vector<BenchPicture> pictures;
};

/// Curves over one parameter, of one scene.
struct Sweep {
  std::string title, x_label, y_label;
  bool log_y = false;
  struct Line {
    std::string name;
    std::vector<double> x, y;
  };
  std::vector<Line> lines;
};

/// One variant of something, with its figures.
struct VariantResult {
  std::string scene, variant;
  double primary_speed = 0, bounce_speed = 0;  ///< millions of rays a second
  double build_seconds = 0;
  std::size_t bytes = 0;
  Measurement primary;  ///< with its counts
};

/// What one scene at one map size costs by one of the methods that `auto` chooses among; a mean over the kinds of rays.
struct CostSample {
  std::string scene;
  DisplacementMethod method = kDefaultMethod;
  std::uint64_t num_micro_triangles = 0;
  double ray = 0;    ///< nanoseconds
  double build = 0;  ///< nanoseconds of processor time a micro-triangle
};

struct FittedCost {
  DisplacementMethod method = kDefaultMethod;
  MethodCost cost = {};
};

struct BenchResults {
  std::string isa;
  bool is_own = false;  ///< of somebody's mesh and map, of which no paper tells
  double map_scale = 1;
  BenchResolution resolution;
  int rounds = 0;
  std::vector<SceneResult> scenes;
  std::vector<Sweep> marching, sweeps;
  std::vector<VariantResult> inversion, tessellation;
  std::vector<CostSample> costs;
  std::vector<FrameResult> frames;
  std::vector<VectorResult> vectors;
};

/// Least squares over the samples.
std::vector<FittedCost> fitted_costs(const std::vector<CostSample>& samples);

/// Names of the methods in the table; the first is what the others are compared with.
inline constexpr std::string_view kExactMethod = "chord", kPublishedMethod = "tfdm", kTessellationMethod = "tessellate";

/// @error std::invalid_argument for a scene that does not exist; std::runtime_error, std::bad_alloc
BenchResults bench_displacement_run(const BenchOptions& options);

}  // namespace relief
