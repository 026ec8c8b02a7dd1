#include "benchmarks/heightfield/map_file.h"

#include <algorithm>

#include "scene/height_map.h"
#include "scene/texture_store.h"

namespace relief {

namespace {

HeightMap read(const std::string& file)
{
  TextureRequest request;
  request.file = file;
  request.label = file;
  request.scene_file = file;
  Warnings warnings;
  return height_maps_load({&request, 1}, warnings).maps[0];
}

/// Mean of the texels in columns [x0, x1) and rows [y0, y1).
double mean(const HeightMapView& map, int x0, int x1, int y0, int y1)
{
  double sum = 0;
  for (std::int64_t y = y0; y < y1; ++y) {
    for (std::int64_t x = x0; x < x1; ++x) sum += static_cast<double>(height_at(map, y * map.width + x));
  }
  return sum / (static_cast<double>(x1 - x0) * (y1 - y0));
}

}  // namespace

HeightTexture height_texture_load(const std::string& file, int size)
{
  const HeightMap owner = read(file);
  const HeightMapView map = owner.view();
  if (std::min(map.width, map.height) < size) {
    throw SceneError(file, "", std::to_string(size) + " texels a side at least",
                     std::to_string(map.width) + " × " + std::to_string(map.height));
  }
  HeightTexture out{size, {}};
  const auto end = [size](int texels, int k) { return static_cast<int>(static_cast<std::int64_t>(texels) * k / size); };
  for (int j = 0; j < size; ++j) {
    for (int i = 0; i < size; ++i) {
      out.h.push_back(static_cast<float>(
          mean(map, end(map.width, i), end(map.width, i + 1), end(map.height, j), end(map.height, j + 1))));
    }
  }
  const auto [low, high] = std::minmax_element(out.h.begin(), out.h.end());
  const float from = *low, range = *high > from ? *high - from : 1;
  for (float& h : out.h) h = (h - from) / range;
  return out;
}

}  // namespace relief
