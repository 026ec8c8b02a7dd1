#include "benchmarks/heightfield/cone_map.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace relief {

namespace {

std::size_t place(const HeightTexture& t, int i, int j)
{
  return static_cast<std::size_t>(j) * static_cast<std::size_t>(t.size) + static_cast<std::size_t>(i);
}

int sign_of(int x) { return x > 0 ? 1 : x < 0 ? -1 : 0; }

/// Whether some of the cell beyond a texel falls as seen from a texel so far away.
/// @source [B], Algorithm 2
bool is_limiting(const HeightTexture& t, int k, int l, int sign_x, int sign_y)
{
  const float h00 = t.texel(k, l), h10 = t.texel(k + sign_x, l), h01 = t.texel(k, l + sign_y);
  const float h11 = t.texel(k + sign_x, l + sign_y);
  return h00 > h10 || h00 > h01 || h10 > h11 || h01 > h11;
}

/// The cone of one texel, narrowed by squares of texels around it.
/// @param limits  whether the texel that is dx, dy away counts
template <class Limits>
float narrowed(const HeightTexture& t, int i, int j, bool stops_early, const Limits& limits)
{
  const float own = t.texel(i, j);
  double cone = 1;
  const double unit = 1.0 / t.size;
  for (int ring = 1; ring < t.size; ++ring) {
    // Nothing is higher than 1.
    if (stops_early && ring * unit >= cone * (1 - static_cast<double>(own))) break;
    const auto test = [&](int dx, int dy) {
      const double rise = static_cast<double>(t.texel(i + dx, j + dy)) - own;
      if (rise > 0 && limits(dx, dy)) cone = std::min(cone, std::hypot(dx, dy) * unit / rise);
    };
    for (int d = -ring; d <= ring; ++d) {
      test(d, -ring);
      test(d, ring);
      if (std::abs(d) == ring) continue;
      test(-ring, d);
      test(ring, d);
    }
  }
  return static_cast<float>(cone);
}

template <class Cone>
ConeMap each_texel(const HeightTexture& t, const Cone& cone)
{
  ConeMap map(t.h.size());
  for (int j = 0; j < t.size; ++j) {
    for (int i = 0; i < t.size; ++i) map[place(t, i, j)] = cone(i, j);
  }
  return map;
}

/// Largest values of blocks of 2^level texels a side.
using Mipmap = std::vector<std::vector<float>>;

Mipmap maximum_mipmap(const HeightTexture& t, std::vector<float> finest)
{
  Mipmap levels = {std::move(finest)};
  for (int size = t.size / 2; size >= 1; size /= 2) {
    const std::vector<float>& below = levels.back();
    std::vector<float> level;
    const auto at = [&](int i, int j) { return below[static_cast<std::size_t>(j * 2 * size + i)]; };
    for (int j = 0; j < size; ++j) {
      for (int i = 0; i < size; ++i) {
        level.push_back(std::max(std::max(at(2 * i, 2 * j), at(2 * i + 1, 2 * j)),
                                 std::max(at(2 * i, 2 * j + 1), at(2 * i + 1, 2 * j + 1))));
      }
    }
    levels.push_back(std::move(level));
  }
  return levels;
}

/// Cones by blocks: of each level those around the texel's own.
/// @param most  largest height in a block, of what counts for a texel that sees it in some direction
template <class Most>
float by_blocks(const HeightTexture& t, int i, int j, int num_levels, const Most& most)
{
  const float own = t.texel(i, j);
  double cone = 1;
  for (int level = 0; level < num_levels; ++level) {
    const int size = 1 << level, count = t.size >> level, own_i = i >> level, own_j = j >> level;
    for (int block_j = own_j - 1; block_j <= own_j + 1; ++block_j) {
      for (int block_i = own_i - 1; block_i <= own_i + 1; ++block_i) {
        if (block_i == own_i && block_j == own_j) continue;
        const auto wrap = [count](int k) { return ((k % count) + count) % count; };
        const float high = most(level, wrap(block_i), wrap(block_j), block_i - own_i, block_j - own_j);
        if (!(high > own)) continue;
        const auto gap = [size](int own_block, int block, int at) {
          return block == own_block ? 0 : block > own_block ? block * size - at : at - ((block + 1) * size - 1);
        };
        const double distance = std::hypot(gap(own_i, block_i, i), gap(own_j, block_j, j)) / t.size;
        cone = std::min(cone, distance / (static_cast<double>(high) - own));
      }
    }
  }
  return static_cast<float>(cone);
}

}  // namespace

double HeightTexture::at(const std::vector<float>& texels, double u, double v) const
{
  const double x = u * size - 0.5, y = v * size - 0.5;
  const double i = std::floor(x), j = std::floor(y), fx = x - i, fy = y - j;
  const auto texel_at = [&](double a, double b) {
    const auto wrap = [this](double k) {
      return static_cast<std::size_t>(((static_cast<int>(k) % size) + size) % size);
    };
    return static_cast<double>(texels[wrap(b) * static_cast<std::size_t>(size) + wrap(a)]);
  };
  return (1 - fy) * ((1 - fx) * texel_at(i, j) + fx * texel_at(i + 1, j)) +
         fy * ((1 - fx) * texel_at(i, j + 1) + fx * texel_at(i + 1, j + 1));
}

ConeMap cone_map_conservative(const HeightTexture& t)
{
  return each_texel(t, [&](int i, int j) { return narrowed(t, i, j, false, [](int, int) { return true; }); });
}

ConeMap cone_map_relaxed(const HeightTexture& t)
{
  return each_texel(t, [&](int i, int j) {
    return narrowed(t, i, j, true,
                    [&](int dx, int dy) { return is_limiting(t, i + dx, j + dy, sign_of(dx), sign_of(dy)); });
  });
}

ConeMap cone_map_quick(const HeightTexture& t)
{
  const Mipmap mipmap = maximum_mipmap(t, t.h);
  return each_texel(t, [&](int i, int j) {
    return by_blocks(t, i, j, static_cast<int>(mipmap.size()), [&](int level, int block_i, int block_j, int, int) {
      return mipmap[static_cast<std::size_t>(level)][static_cast<std::size_t>(block_j * (t.size >> level) + block_i)];
    });
  });
}

ConeMap cone_map_quick_relaxed(const HeightTexture& t)
{
  std::array<Mipmap, 9> limiting;  // by the signs of the directions in which a texel is seen
  for (int sign_y = -1; sign_y <= 1; ++sign_y) {
    for (int sign_x = -1; sign_x <= 1; ++sign_x) {
      std::vector<float> finest;
      for (int j = 0; j < t.size; ++j) {
        for (int i = 0; i < t.size; ++i) finest.push_back(is_limiting(t, i, j, sign_x, sign_y) ? t.texel(i, j) : -1.0f);
      }
      limiting[static_cast<std::size_t>(3 * sign_y + sign_x + 4)] = maximum_mipmap(t, std::move(finest));
    }
  }
  const auto num_levels = static_cast<int>(limiting[0].size());
  return each_texel(t, [&](int i, int j) {
    return by_blocks(t, i, j, num_levels, [&](int level, int block_i, int block_j, int side_x, int side_y) {
      const auto at = static_cast<std::size_t>(block_j * (t.size >> level) + block_i);
      float most = -1;
      // Texels of a block straight ahead may lie to either side.
      for (int sign_y = side_y == 0 ? -1 : side_y; sign_y <= (side_y == 0 ? 1 : side_y); ++sign_y) {
        for (int sign_x = side_x == 0 ? -1 : side_x; sign_x <= (side_x == 0 ? 1 : side_x); ++sign_x) {
          if (sign_x == 0 && sign_y == 0) continue;
          most = std::max(
              most, limiting[static_cast<std::size_t>(3 * sign_y + sign_x + 4)][static_cast<std::size_t>(level)][at]);
        }
      }
      return most;
    });
  });
}

ConeMap cone_map_relaxed_approximate(const HeightTexture& t, int num_steps)
{
  return each_texel(t, [&](int i, int j) {
    double cone = 1;
    const double u = (i + 0.5) / t.size, v = (j + 0.5) / t.size, own = static_cast<double>(t.texel(i, j));
    // A period around the apex.
    const int half = t.size / 2;
    for (int dy = -half; dy < half; ++dy) {
      for (int dx = -half; dx < half; ++dx) {
        if (dx == 0 && dy == 0) continue;
        const double z = static_cast<double>(t.texel(i + dx, j + dy));
        if (z >= 1) {
          cone = std::min(cone, std::hypot(dx, dy) / t.size / (1 - own + 1e-9));
          continue;
        }
        // From the top over the apex through the texel, and on to the bottom.
        const double per_height_x = dx / (t.size * (1 - z)), per_height_y = dy / (t.size * (1 - z));
        const double step = z / num_steps;
        double depth = 1 - z + step, at = z - step;
        for (int k = 1; k < num_steps; ++k) {
          if (t.height(u + per_height_x * depth, v + per_height_y * depth) < at) break;
          depth += step;
          at -= step;
        }
        if (at <= own) continue;
        cone = std::min(cone, std::hypot(per_height_x, per_height_y) * depth / (at - own));
      }
    }
    return static_cast<float>(cone);
  });
}

ConeMap cone_map_corrected(const HeightTexture& t, const ConeMap& map)
{
  return each_texel(t, [&](int i, int j) {
    float least = 1;
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) {
        const int a = (i + x + t.size) % t.size, b = (j + y + t.size) % t.size;
        least = std::min(least, map[place(t, a, b)]);
      }
    }
    return least;
  });
}

}  // namespace relief
