// Triangles of a Wavefront OBJ, for `relief bench` alone: scenes are glTF.
#pragma once

#include <string>
#include <vector>

#include "kernel/math/vec.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

struct ObjMesh {
  std::vector<Vec3f> P;
  std::vector<Normal3f> N;  ///< empty: not all corners have one
  std::vector<Vec2f> uv;    ///< v grows downwards, as in glTF
  std::vector<TriangleIndices> triangles;
};

/// Reads v, vt, vn and f, and passes over all else: all objects and groups become one mesh. Polygons become fans of triangles.
/// @error InputError with the line: numbers that are missing or not finite, entries that do not exist, corners without texture
///        coordinates, no faces
ObjMesh obj_load(const std::string& file);

}  // namespace relief
