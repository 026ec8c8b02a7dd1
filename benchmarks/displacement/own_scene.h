// A mesh and a height map of somebody's own in place of the benchmark's scenes.
#pragma once

#include <string>

#include "benchmarks/displacement/scenes.h"

namespace relief {

struct OwnSceneFiles {
  std::string mesh;  ///< .obj, or a scene, .gltf or .glb, whose meshes become one where they stand
  std::string map;   ///< any image of heights
  double scale = 0;  ///< of the mesh's units for the whole range of heights, 0 to 1
  double midlevel = 0.5;
  double tiles = 1;  ///< factor of the mesh's texture coordinates
};

class OwnScene {
 public:
  /// @error InputError, SceneError: files that cannot be read, a mesh without triangles or texture coordinates
  explicit OwnScene(const OwnSceneFiles& files);
  OwnScene(const OwnScene&) = delete;
  OwnScene& operator=(const OwnScene&) = delete;

  /// Whether a file is read as OBJ, by its name; else it is glTF. @error InputError for other names
  static bool is_obj(const std::string& file);

  /// Seen from the front, a little from the right and above; its tiles and scale are those of the files.
  const BenchSceneSpec& spec() const { return spec_; }
  /// The map stays as it is whatever `change` says.
  BenchScene make(const BenchSceneChange& change) const;

 private:
  std::string name_;  ///< of the spec
  BenchSceneSpec spec_;
  BenchScene scene_;  ///< not tiled
};

}  // namespace relief
