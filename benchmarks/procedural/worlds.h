// Scenes with computed heights of which more is there than could be stored: like Smits' pot (their Fig. 9) and terrain
// (Fig. 10), and a planet of few triangles.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "kernel/math/vec.h"
#include "scene/scene.h"

namespace relief {

/// What Smits and others measured, on processors of 250 MHz.
struct PaperPicture {
  double hours = 0;  ///< of processors; 0: they have no such picture
  int paths = 0;     ///< a pixel
  int length = 0;    ///< of a path
  int width = 0, height = 0;
  std::string_view cells;   ///< their N
  std::string_view memory;  ///< as they say it
};

/// How finely a world is divided.
struct WorldCells {
  std::int32_t n = 0;       ///< along each side of all triangles; 0: by their size in the picture
  double least_metres = 0;  ///< by size: cells are not divided that are smaller than this; 0: as small as it takes
};

struct WorldSpec {
  std::string_view name;  ///< on the command line
  std::string_view title;
  int width = 0, height = 0;  ///< of the picture, pixels
  PaperPicture paper;
  /// A division and the picture that it is seen in.
  struct Case {
    WorldCells cells;
    int shrink = 1;  ///< the picture's sides are so many times smaller
    int crop = 1;    ///< of them this part is traced, in the middle
    int room = 1;    ///< so many times the usual memory for heights
  };
  std::span<const Case> cases;
};

std::span<const WorldSpec> world_specs();

/// A world in memory: one mesh, one material with a graph of heights, one camera.
struct World {
  const WorldSpec* spec = nullptr;
  Scene scene;
  float eye_height = -1;  ///< metres of the camera above the displaced surface; negative: it is where it is
};

/// @param mesh_divisor  makes the terrain smaller, for tests
World world_make(const WorldSpec& spec, int mesh_divisor);

/// A camera at a point that looks at another.
/// @param half_height  of the picture at distance 1
Camera world_camera(Vec3f eye, Vec3f at, float half_height, double aspect);

}  // namespace relief
