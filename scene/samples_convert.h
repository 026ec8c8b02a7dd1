// Samples of decoded rows as those who read an image want them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include "scene/image_io.h"

namespace relief {

/// A sample as another type has it: the same part of the type's range.
template <typename To, typename From>
To sample_convert(From value)
{
  if constexpr (std::is_same_v<To, From>) {
    return value;
  } else if constexpr (std::is_floating_point_v<To>) {
    return static_cast<To>(value) / static_cast<To>(std::numeric_limits<From>::max());
  } else {
    constexpr std::uint32_t kFrom = std::numeric_limits<From>::max(), kTo = std::numeric_limits<To>::max();
    return static_cast<To>((value * kTo + kFrom / 2) / kFrom);
  }
}

/// Copies some channels of a row, or of several.
/// @param from        interleaved, `stride` channels a texel; of any alignment, as `to`
/// @param num_copied  channels from the first that `from` points to
template <typename From, typename To>
void samples_copy(const unsigned char* from, std::size_t num_texels, int stride, int num_copied, unsigned char* to)
{
  const auto stride_bytes = static_cast<std::size_t>(stride) * sizeof(From);
  for (std::size_t i = 0; i < num_texels; ++i, from += stride_bytes) {
    for (int c = 0; c < num_copied; ++c, to += sizeof(To)) {
      From value;
      std::memcpy(&value, from + static_cast<std::size_t>(c) * sizeof value, sizeof value);
      const To converted = sample_convert<To>(value);
      std::memcpy(to, &converted, sizeof converted);
    }
  }
}

/// The same, to a type that is known when it runs.
template <typename From>
void samples_convert(const unsigned char* from,
                     std::size_t num_texels,
                     int stride,
                     int num_copied,
                     SampleType type,
                     unsigned char* to)
{
  switch (type) {
    case SampleType::kU8:
      return samples_copy<From, std::uint8_t>(from, num_texels, stride, num_copied, to);
    case SampleType::kU16:
      return samples_copy<From, std::uint16_t>(from, num_texels, stride, num_copied, to);
    case SampleType::kFloat:
      return samples_copy<From, float>(from, num_texels, stride, num_copied, to);
  }
}

}  // namespace relief
