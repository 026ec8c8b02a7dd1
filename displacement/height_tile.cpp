#include "displacement/height_tile.h"

namespace relief {

void height_tile_finish(HeightTile* tile)
{
  HeightMapView map;
  map.texels = tile->texels;
  map.width = map.height = kTileTexels;
  map.format = HeightFormat::kFloat;
  map.wrap_u = map.wrap_v = Wrap::kClamp;
  tile->field = small_height_field_make(map, tile->lines, kTileLines);
}

}  // namespace relief
