#include "displacement/height_level.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

namespace relief {

namespace {

int level_size(int size, int level)
{
  for (; level > 0 && size > 1; --level) size = (size + 1) / 2;
  return size;
}

/// Texels of the map that one texel of the level covers along a side: all of them whole but the first and the last.
struct Coverage {
  std::int64_t first = 0, last = 0;
  double first_share = 1, last_share = 1;

  double share(std::int64_t texel) const
  {
    if (first == last) return first_share;
    return texel == first ? first_share : texel == last ? last_share : 1.0;
  }
};

Coverage coverage_of(int texel, int fine_size, int coarse_size)
{
  // In units of 1 / coarse_size of a fine texel all borders are integers.
  const std::int64_t begin = std::int64_t{texel} * fine_size, end = begin + fine_size;
  Coverage c;
  c.first = begin / coarse_size;
  c.last = (end - 1) / coarse_size;
  const auto share = [&](std::int64_t t) {
    const std::int64_t from = std::max(begin, t * coarse_size), to = std::min(end, (t + 1) * coarse_size);
    return static_cast<double>(to - from) / coarse_size;
  };
  c.first_share = share(c.first);
  c.last_share = share(c.last);
  return c;
}

}  // namespace

HeightLevel::HeightLevel(const HeightMapView& map, int level) : shape_(map)
{
  shape_.texels = nullptr;
  shape_.width = level_size(map.width, level);
  shape_.height = level_size(map.height, level);
  const bool is_float = map.format == HeightFormat::kFloat;
  shape_.format = is_float ? HeightFormat::kFloat : HeightFormat::kU16;
  const auto width = static_cast<std::size_t>(shape_.width), count = width * static_cast<std::size_t>(shape_.height);
  if (is_float) {
    floats_.resize(count);
  } else {
    words_.resize(count);
  }
  const double area = static_cast<double>(map.width) / shape_.width * (static_cast<double>(map.height) / shape_.height);
  // Integers are summed as such: no rounding before the last.
  const double unit = map.format == HeightFormat::kU8 ? 257.0 : 1.0;
  const auto value_at = [&](std::int64_t index) -> double {
    switch (map.format) {
      case HeightFormat::kU8:
        return static_cast<const std::uint8_t*>(map.texels)[index];
      case HeightFormat::kU16:
        return static_cast<const std::uint16_t*>(map.texels)[index];
      case HeightFormat::kFloat:
        break;
    }
    return static_cast<double>(static_cast<const float*>(map.texels)[index]);
  };
  tbb::parallel_for(0, shape_.height, [&](int row) {
    const Coverage rows = coverage_of(row, map.height, shape_.height);
    for (int column = 0; column < shape_.width; ++column) {
      const Coverage columns = coverage_of(column, map.width, shape_.width);
      double sum = 0;
      for (std::int64_t y = rows.first; y <= rows.last; ++y) {
        double row_sum = 0;
        for (std::int64_t x = columns.first; x <= columns.last; ++x) {
          row_sum += columns.share(x) * value_at(y * map.width + x);
        }
        sum += rows.share(y) * row_sum;
      }
      const double mean = sum / area;
      const std::size_t at = static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column);
      if (is_float) {
        floats_[at] = static_cast<float>(mean);
      } else {
        words_[at] = static_cast<std::uint16_t>(std::clamp(std::nearbyint(mean * unit), 0.0, 65535.0));
      }
    }
  });
}

HeightMapView HeightLevel::view() const
{
  HeightMapView view = shape_;
  view.texels = view.format == HeightFormat::kFloat ? static_cast<const void*>(floats_.data()) : words_.data();
  return view;
}

}  // namespace relief
