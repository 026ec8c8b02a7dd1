// A height map as a source of heights at points of triangles, for surfaces that are more than the map alone.
#pragma once

#include "displacement/height_field.h"
#include "displacement/height_source.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

struct MapHeights {
  const MeshView* mesh = nullptr;
  TextureRef mapping;  ///< uv set and texture transform
  const HeightFieldView* field = nullptr;
  HeightSource source() const;
};

}  // namespace relief
