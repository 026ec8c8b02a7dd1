// What worlds take: preparation, memory, rays a second and tiles of heights that were made, beside the paper's figures.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "benchmarks/procedural/worlds.h"

namespace relief {

struct WorldOptions {
  int rounds = 3;                                    ///< the first without any heights
  double shrink = 1;                                 ///< factor by which pictures' sides are smaller
  int mesh_divisor = 1;                              ///< see world_make
  std::function<void(const std::string&)> progress;  ///< empty: none
};

/// Rays of one kind.
struct WorldRays {
  std::uint64_t count = 0;
  double hit_share = 0;
  double first_nanoseconds = 0;      ///< of processor time a ray, in the first round, heights included
  double nanoseconds = 0;            ///< in the fastest of the others
  std::uint64_t first_tiles = 0;     ///< that were made in the first round
  std::uint64_t repeated_tiles = 0;  ///< in the last
};

/// One world, divided and seen in one way.
struct WorldResult {
  WorldCells cells;
  int width = 0, height = 0;                ///< of the picture
  int traced_width = 0, traced_height = 0;  ///< of the part in its middle that is traced
  std::uint64_t room_bytes = 0;             ///< for heights
  std::uint64_t num_lattices = 0;
  double num_micro_triangles = 0, most_cells_a_side = 0;
  double prepare_seconds = 0;    ///< wall clock
  std::uint64_t mesh_bytes = 0;  ///< of the base mesh
  std::uint64_t prepared_bytes = 0, height_bytes = 0;
  std::uint64_t peak_bytes = 0;   ///< of the process, more than before; 0: not known
  std::array<WorldRays, 3> rays;  ///< by BenchRayKind
};

struct WorldStudy {
  const WorldSpec* spec = nullptr;
  std::uint64_t num_triangles = 0;
  std::vector<WorldResult> results;
  int picture_width = 0, picture_height = 0;
  std::vector<std::uint8_t> rgb;  ///< of the first result
};

/// @error std::runtime_error if Embree fails
WorldStudy world_study(const WorldSpec& spec, const WorldOptions& options);

std::string world_markdown(const WorldStudy& study);
nlohmann::ordered_json world_json(const WorldStudy& study);
/// A piece of a page.
std::string world_html(const WorldStudy& study);

}  // namespace relief
