// Height maps of displaced materials: one channel of an image at the precision of its file, without mip levels. They
// stand beside the textures, whose formats end at half precision: 11 bits are too few for heights.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "kernel/shape/height_map_view.h"
#include "scene/diagnostics.h"

namespace relief {

class KeptImages;       // scene/kept_images.h
struct TextureRequest;  // scene/texture_store.h

/// Larger heights are taken for damage: their squares would leave single precision.
inline constexpr float kHighestHeight = 1e30f;

/// Texels and sampler of one height map.
struct HeightMap {
  std::string label;  ///< how messages name it, e.g. "scene.gltf: /images/3 (bark.png)"
  int width = 0, height = 0;
  HeightFormat format = HeightFormat::kU16;
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
  /// Row-major, the top row first, aligned to 64 bytes. Maps of the same image share them.
  std::shared_ptr<const void> texels;

  HeightMapView view() const;
  std::size_t bytes() const;  ///< of the texels, shared ones included
};

/// Lowest and highest texel of a map.
struct HeightRange {
  float low = 0, high = 0;
};

/// @pre   the map has texels
/// @cost  one pass over the texels
HeightRange height_map_range(const HeightMapView& map);

/// Bytes of all maps, shared texels once.
std::size_t height_map_bytes(std::span<const HeightMap> maps);

/// Height maps as loaded for a list of requests.
struct HeightMapSet {
  std::vector<HeightMap> maps;      ///< in the order of their first request
  std::vector<int> map_of_request;  ///< index into `maps`
};

/// Reads the images of all requests (in parallel); equal requests (image and wrap modes) become one map. 8-bit integers
/// and fewer stay 8-bit, 16-bit ones 16-bit, everything else becomes float; values are never decoded from sRGB. Of several
/// channels the first that is no alpha counts, R where there is one. Texels that are not finite or beyond ±1e30 become the
/// mean of the others, 0 if there are none.
/// @param requests  colour and filter are ignored: heights are linear data, interpolated bilinearly
/// @param warnings  replaced texels with their number and the first place, colour channels that differ, nearest filters
/// @param kept      of the frames before, if there are any
/// @error SceneError naming the file and JSON path of an image that is missing, unreadable or absurdly large
/// @cost  memory: the map, and 64 MiB or 64 rows of the image on top
HeightMapSet height_maps_load(std::span<const TextureRequest> requests, Warnings& warnings, KeptImages* kept = nullptr);

/// Room for a map's texels, aligned.
/// @error std::bad_alloc
std::shared_ptr<void> height_texels_allocate(std::size_t bytes);

/// Replaces what is not finite or beyond ±1e30 by the mean of the others, and says so.
/// @param label  of the map
void height_texels_repair(std::span<float> texels, int width, const std::string& label, Warnings& warnings);

}  // namespace relief
