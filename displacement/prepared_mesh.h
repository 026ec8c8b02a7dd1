// A mesh as one displacement displaces it, prepared to be traced; and those of the displacement sets before, so that one that
// has not changed is not prepared again.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "displacement/border_strips.h"
#include "displacement/content_hash.h"
#include "displacement/curved_heights.h"
#include "displacement/dicing.h"
#include "displacement/displaced_mesh.h"
#include "displacement/embree_geometry.h"
#include "displacement/map_heights.h"
#include "displacement/point_tiles.h"
#include "displacement/tessellation.h"

namespace relief {

struct PreparedMesh {
  std::string name;                             ///< of the mesh
  int mesh_index = -1;                          ///< into the input's meshes
  int displacement_index = -1;                  ///< into the input's settings
  DisplacementMethod method = kDefaultMethod;   ///< by which it is traced
  std::unique_ptr<MapHeights> map_heights;      ///< where computed heights are a map's
  std::unique_ptr<CurvedHeights> curved;        ///< where the base is curved
  std::unique_ptr<ProceduralField> procedural;  ///< heights that are computed
  DisplacedMesh mesh;
  DisplacedGeometry geometry;      ///< where it tessellates: what is tessellated
  LevelBlend blend;                ///< of its mesh, if it has one
  std::unique_ptr<Dicing> dicing;  ///< what is tessellated in place of the mesh; null: the mesh itself
  std::unique_ptr<Tessellation> tessellation;
  std::unique_ptr<PointTiles> tiles;  ///< where points move and the mesh has no room; nothing of the above is made then
  WallsBeside walls;                   ///< at its borders with other meshes
  std::optional<ContentHash> content;  ///< of all that `mesh` and `tree` are made of; empty: they are not to be kept
  std::shared_ptr<RTCSceneTy> tree;    ///< of `geometry`, committed; null: none yet
  std::uint64_t tree_bytes = 0;
  double seconds = 0;  ///< that making `mesh` and `tree` took
};

/// Prepared meshes that no set has at the moment. Each belongs to one set at a time, which may change all of it but what its
/// content says.
class KeptMeshes {
 public:
  /// @return null if there is none of that content
  std::unique_ptr<PreparedMesh> take(const ContentHash& content);
  void put(std::unique_ptr<PreparedMesh> mesh);

  struct Tally {
    std::uint64_t count = 0, bytes = 0;
    double seconds = 0;  ///< that making it took
  };
  /// Ends the questions of a set: what it has not taken goes.
  /// @return  of what it has taken
  Tally end_set();

 private:
  std::multimap<ContentHash, std::unique_ptr<PreparedMesh>> meshes_;
  Tally taken_;
};

}  // namespace relief
