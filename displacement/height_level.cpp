#include "displacement/height_level.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include <tbb/parallel_for.h>

#include "displacement/height_field.h"
#include "displacement/level_of_detail.h"

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

/// Where the texels of one level are between those of a coarser one, along one axis.
struct BetweenTexels {
  int before, after;
  float part;  ///< of the way
};

std::vector<BetweenTexels> between_texels(int fine_size, int coarse_size, Wrap wrap)
{
  const LatticeAxis axis{coarse_size, wrap};
  std::vector<BetweenTexels> out;
  for (int i = 0; i < fine_size; ++i) {
    const double x = lattice_on_level(i, fine_size, coarse_size), low = std::floor(x);
    const auto at = static_cast<std::int64_t>(low);
    out.push_back({lattice_texel(axis, at), lattice_texel(axis, at + 1), static_cast<float>(x - low)});
  }
  return out;
}

constexpr int kParts = 8;  ///< along a side of the map

/// Sums of squared differences of slopes in the parts of one band of the map.
struct BandLoss {
  float height = 0;
  double squares_u[kParts] = {}, squares_v[kParts] = {};
};

}  // namespace

LevelLoss level_loss(const HeightMapView& fine, const HeightMapView& coarse)
{
  const int width = fine.width, height = fine.height;
  const std::vector<BetweenTexels> columns = between_texels(width, coarse.width, fine.wrap_u);
  const std::vector<BetweenTexels> rows = between_texels(height, coarse.height, fine.wrap_v);
  const auto make_differences = [&](int row, std::vector<float>& out) {
    const BetweenTexels& y = rows[static_cast<std::size_t>(row)];
    const std::int64_t before = std::int64_t{y.before} * coarse.width, after = std::int64_t{y.after} * coarse.width;
    for (int i = 0; i < width; ++i) {
      const BetweenTexels& x = columns[static_cast<std::size_t>(i)];
      const auto along = [&](std::int64_t line) {
        const float a = height_at(coarse, line + x.before), b = height_at(coarse, line + x.after);
        return a + x.part * (b - a);
      };
      const float low = along(before), high = along(after);
      out[static_cast<std::size_t>(i)] = height_at(fine, std::int64_t{row} * width + i) - (low + y.part * (high - low));
    }
  };
  BandLoss bands[kParts];
  tbb::parallel_for(0, kParts, [&](int band) {
    BandLoss& loss = bands[band];
    std::vector<float> last(static_cast<std::size_t>(width)), here(static_cast<std::size_t>(width));
    const int first = height * band / kParts, end = height * (band + 1) / kParts;
    if (first > 0 && first < end) make_differences(first - 1, last);
    for (int row = first; row < end; ++row) {
      make_differences(row, here);
      for (int part = 0; part < kParts; ++part) {
        const int begin = width * part / kParts, stop = width * (part + 1) / kParts;
        double u = 0, v = 0;
        for (int i = begin; i < stop; ++i) {
          const auto k = static_cast<std::size_t>(i);
          loss.height = std::max(loss.height, std::abs(here[k]));
          const float du = i > 0 ? here[k] - here[k - 1] : 0.0f, dv = row > 0 ? here[k] - last[k] : 0.0f;
          u += static_cast<double>(du * du);
          v += static_cast<double>(dv * dv);
        }
        loss.squares_u[part] += u;
        loss.squares_v[part] += v;
      }
      std::swap(here, last);
    }
  });
  LevelLoss out;
  for (int band = 0; band < kParts; ++band) {
    const BandLoss& loss = bands[band];
    out.height = std::max(out.height, static_cast<double>(loss.height));
    for (int part = 0; part < kParts; ++part) {
      const auto texel_rows = height * (band + 1) / kParts - height * band / kParts;
      const auto texel_columns = width * (part + 1) / kParts - width * part / kParts;
      const double texels = static_cast<double>(texel_rows) * texel_columns;
      if (!(texels > 0)) continue;
      out.slope_u = std::max(out.slope_u, width * std::sqrt(loss.squares_u[part] / texels));
      out.slope_v = std::max(out.slope_v, height * std::sqrt(loss.squares_v[part] / texels));
    }
  }
  return out;
}

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
