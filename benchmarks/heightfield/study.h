// Tables 1 and 2 and the figures of Bán and others, "Robust Cone Step Mapping", on this machine: how long maps take to be made
// and rays to be traced, and how many pixels are wrong.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "benchmarks/heightfield/trace.h"

namespace relief {

struct HeightfieldOptions {
  int size = 128;  ///< texels a side, a power of two
  int width = 640, height = 360;
  int rounds = 3;
  std::vector<std::string> maps;   ///< image files that are studied too
  std::vector<std::string> cones;  ///< cone maps that are made, of bench_heightfield_cones; empty: all
  std::function<void(const std::string&)> progress;  ///< empty: none
};

/// One way to trace one texture.
struct HeightfieldResult {
  std::string map, stepping, refinement;
  bool is_corrected = false;
  int max_iterations = 0;
  double nanoseconds = 0;             ///< of processor time a ray
  double steps = 0;                   ///< a ray
  double wrong = 0, unconverged = 0;  ///< shares of rays: off by more than a texel, or given up
};

struct HeightfieldPicture {
  std::string caption;
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;
};

struct HeightfieldTexture {
  std::string name;
  std::vector<std::pair<std::string, double>> generation;  ///< map, seconds of processor time
  std::vector<HeightfieldResult> results;
  std::vector<HeightfieldPicture> pictures;
};

struct HeightfieldResults {
  HeightfieldOptions options;
  std::size_t num_rays = 0;
  std::vector<HeightfieldTexture> textures;
};

/// Names of all cone maps.
std::vector<std::string> bench_heightfield_cones();

/// @error SceneError if a map cannot be read or is smaller than `size`
HeightfieldResults bench_heightfield_run(const HeightfieldOptions& options);
std::string bench_heightfield_markdown(const HeightfieldResults& results);
std::string bench_heightfield_json(const HeightfieldResults& results);
/// @error OutputError
std::string bench_heightfield_html(const HeightfieldResults& results);

}  // namespace relief
