// A height map as scene/ hands it to displacement/: full-precision texels, no ownership, no mip chain.
#pragma once

#include <cstdint>

#include "kernel/texture/texture_view.h"

namespace relief {

/// How heights are stored. Integers stand for value / (2^bits − 1), so that they span 0…1.
enum class HeightFormat : std::uint8_t { kU8, kU16, kFloat };

/// Heights of a texture, one channel, row-major, the top row first. Texel (i, j) is centred at uv
/// ((i + ½)/width, (j + ½)/height), as in TextureView. All values are finite.
struct HeightMapView {
  const void* texels = nullptr;
  int width = 0, height = 0;
  HeightFormat format = HeightFormat::kU16;
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
};

/// @param index  row · width + column
RELIEF_KERNEL float height_at(const HeightMapView& map, std::int64_t index)
{
  switch (map.format) {
    case HeightFormat::kU8:
      return static_cast<const std::uint8_t*>(map.texels)[index] * (1.0f / 255.0f);
    case HeightFormat::kU16:
      return static_cast<const std::uint16_t*>(map.texels)[index] * (1.0f / 65535.0f);
    case HeightFormat::kFloat:
      break;
  }
  return static_cast<const float*>(map.texels)[index];
}

}  // namespace relief
