// Microtriangle marching as published beside our own heights on demand: which rays they lose, what they cost, and how far a
// lattice of N is from the heights that it stands for; and what whole worlds of heights take.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "benchmarks/procedural/smoothing_study.h"
#include "benchmarks/procedural/world_study.h"

namespace relief {

struct ProceduralOptions {
  int num_rays = 20000;
  int rounds = 3;
  std::vector<std::string> parts;                    ///< of bench_procedural_parts; empty: all
  std::vector<std::string> meshes;                   ///< scene files whose meshes are smoothed beside the icosahedron
  double world_shrink = 1;                           ///< factor by which pictures of worlds are smaller
  int world_mesh_divisor = 1;                        ///< see world_make
  std::function<void(const std::string&)> progress;  ///< empty: none
};

/// Rays of one precision against all micro-triangles in double precision.
struct MarchResult {
  int n = 1;
  std::string precision;
  double missed = 0;       ///< share of rays whose micro-triangle is there, and nothing was found
  double passed_over = 0;  ///< share that found one behind the first
  double invented = 0;
  double cells = 0;        ///< a ray
  double nanoseconds = 0;  ///< of processor time a ray
};

/// Our surface over the same lattice.
struct LatticeResult {
  int n = 1;
  double rms = 0;                ///< distance of the lattice's heights from the function's, in units of their range
  double nanoseconds = 0;        ///< a ray, once the heights are there
  double first_nanoseconds = 0;  ///< a ray, the first time, heights included
  double bytes = 0;              ///< of heights that were needed
};

struct ProceduralResults {
  int num_rays = 0;
  std::string isa;
  std::vector<MarchResult> marches;
  std::vector<LatticeResult> lattices;
  std::vector<SmoothingResult> smoothings;
  std::vector<WorldStudy> worlds;
};

/// Names of what can be run by itself.
std::vector<std::string> bench_procedural_parts();

/// @error std::runtime_error if Embree fails; SceneError for scene files, or one without a mesh that has normals
ProceduralResults bench_procedural_run(const ProceduralOptions& options);
std::string bench_procedural_markdown(const ProceduralResults& results);
std::string bench_procedural_json(const ProceduralResults& results);
/// @error OutputError
std::string bench_procedural_html(const ProceduralResults& results);

}  // namespace relief
