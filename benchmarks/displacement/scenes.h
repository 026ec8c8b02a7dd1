// The ten scenes of the benchmark: like those of Thonat et al. 2023, Table 1, in triangles, map size and tiling, with
// meshes and maps of our own making.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "benchmarks/displacement/maps.h"
#include "kernel/shape/mesh_view.h"
#include "scene/height_map.h"

namespace relief {

/// What the paper measured, on a CPU: its supplement's table.
struct PaperFigures {
  double tfdm_milliseconds = 0;  ///< 0: not in the table
  double tessellation = 0;       ///< speed over TFDM
  double rmip_low = 0, rmip = 0, rmip_high = 0;
  double tessellation_memory = 0;  ///< over TFDM's, as the others
  double rmip_low_memory = 0, rmip_memory = 0, rmip_high_memory = 0;
};

enum class BenchShape : std::uint8_t { kSphere, kTorus, kPlane, kPlate, kBlob, kGoblet };

struct BenchSceneSpec {
  std::string_view name;  ///< on the command line
  std::string_view like;  ///< the paper's scene
  BenchShape shape = BenchShape::kSphere;
  int columns = 1, rows = 1;  ///< quads of the base mesh
  BenchMap map = BenchMap::kDomes;
  int map_size = 2048;
  double tiles_u = 1, tiles_v = 1;
  double scale = 0.1;         ///< metres for the whole range of heights
  double eye[3] = {0, 1, 3};
  double field_of_view = 40;  ///< degrees, vertical
  PaperFigures paper;
  double look_at[3] = {0, 0, 0};
};

std::span<const BenchSceneSpec> bench_scene_specs();

/// Departures from a scene as it is described.
struct BenchSceneChange {
  double map = 1;     ///< factor of the map's sides
  double scale = 1;   ///< factor of the displacement
  double tiling = 1;  ///< factor of the tiles along both axes
};

/// A scene in memory.
struct BenchScene {
  const BenchSceneSpec* spec = nullptr;
  std::vector<Vec3f> P;
  std::vector<Normal3f> N;
  std::vector<Vec2f> uv;
  std::vector<TriangleIndices> triangles;
  HeightMap height_map;
  double tiles_u = 1, tiles_v = 1;
  double scale = 0, midlevel = 0.5;
  double texel_metres = 0;  ///< mean side of a texel on the base mesh

  MeshView mesh() const;
  HeightMapView map() const { return height_map.view(); }
  int map_size() const;  ///< side of a square map of as many texels
};

BenchScene bench_scene_make(const BenchSceneSpec& spec, const BenchSceneChange& change);

/// Sets texel_metres by the triangles and the map.
void bench_scene_measure_texels(BenchScene& scene);

}  // namespace relief
