// How a decoder hands over a value that it has as a float.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "scene/image_io.h"

namespace relief {

/// Writes one sample (ImageFile::read_rows), and goes on behind it.
inline void sample_put(float value, SampleType type, unsigned char*& to)
{
  const auto copy = [&](auto sample) {
    std::memcpy(to, &sample, sizeof sample);
    to += sizeof sample;
  };
  // Not a number is 0 as well.
  const float part = value > 0 ? std::min(value, 1.0f) : 0.0f;
  if (type == SampleType::kFloat) copy(value);
  if (type == SampleType::kU16) copy(static_cast<std::uint16_t>(part * 65535.0f + 0.5f));
  if (type == SampleType::kU8) copy(static_cast<std::uint8_t>(part * 255.0f + 0.5f));
}

}  // namespace relief
