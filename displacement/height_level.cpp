#include "displacement/height_level.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

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

  /// Sum over a stretch of texels, each with its share.
  template <typename Value>
  double sum(Value value_at) const
  {
    if (first == last) return first_share * static_cast<double>(value_at(first));
    // Integers are summed as such: exact, and fast.
    using Sum = std::conditional_t<std::is_integral_v<decltype(value_at(first))>, std::uint64_t, double>;
    Sum whole = 0;
    for (std::int64_t texel = first + 1; texel < last; ++texel) whole += value_at(texel);
    return first_share * static_cast<double>(value_at(first)) + static_cast<double>(whole) +
           last_share * static_cast<double>(value_at(last));
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

/// Calls `store` with the index of every texel of a level and the mean of the texels that it covers.
template <typename Texel, typename Store>
void average(const HeightMapView& map, int width, int height, Store store)
{
  const auto* texels = static_cast<const Texel*>(map.texels);
  const double area = static_cast<double>(map.width) / width * (static_cast<double>(map.height) / height);
  tbb::parallel_for(0, height, [&](int row) {
    const Coverage rows = coverage_of(row, map.height, height);
    for (int column = 0; column < width; ++column) {
      const Coverage columns = coverage_of(column, map.width, width);
      const double sum = rows.sum([&](std::int64_t y) {
        const Texel* line = texels + y * map.width;
        return columns.sum([line](std::int64_t x) {
          if constexpr (std::is_integral_v<Texel>) {
            return std::uint64_t{line[x]};
          } else {
            return static_cast<double>(line[x]);
          }
        });
      });
      store(static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column),
            sum / area);
    }
  });
}

}  // namespace

HeightLevel::HeightLevel(const HeightMapView& map, int level) : shape_(map)
{
  const int width = level_size(map.width, level), height = level_size(map.height, level);
  const std::size_t count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  shape_.texels = nullptr;
  shape_.width = width;
  shape_.height = height;
  if (map.format == HeightFormat::kFloat) {
    floats_.resize(count);
    average<float>(map, width, height, [this](std::size_t at, double mean) { floats_[at] = static_cast<float>(mean); });
    return;
  }
  shape_.format = HeightFormat::kU16;
  words_.resize(count);
  const auto store = [this](std::size_t at, double mean) {
    words_[at] = static_cast<std::uint16_t>(std::clamp(std::nearbyint(mean), 0.0, 65535.0));
  };
  if (map.format == HeightFormat::kU8) {
    average<std::uint8_t>(map, width, height, [&](std::size_t at, double mean) { store(at, 257.0 * mean); });
  } else {
    average<std::uint16_t>(map, width, height, store);
  }
}

HeightMapView HeightLevel::view() const
{
  HeightMapView view = shape_;
  view.texels = view.format == HeightFormat::kFloat ? static_cast<const void*>(floats_.data()) : words_.data();
  return view;
}

}  // namespace relief
