#include "integrator/environment_tables.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace relief {
namespace {

/// Probabilities are integers over this: floats hold all of them up to 1 exactly, so that the difference of two
/// entries of a cumulative distribution is exact and sampling and density agree to the last bit.
constexpr std::uint32_t kQuanta = 1u << 24;

/// Integrals over one cell of the interpolation weights of the texels it touches, along one axis.
struct CellTexels {
  int first = 0;  ///< may be -1: the caller wraps
  std::vector<float> weights;
};

/// Integral of a texel's interpolation weight (a tent of half-width 1 around its centre) from −∞ to x.
/// @param x  distance from the texel's centre, texels
double tent_integral(double x)
{
  if (x <= -1) return 0;
  if (x >= 1) return 1;
  return x < 0 ? 0.5 * (1 + x) * (1 + x) : 1 - 0.5 * (1 - x) * (1 - x);
}

/// Texels whose interpolation weights reach into each of `num_cells` equal cells.
std::vector<CellTexels> cell_texels(int num_texels, int num_cells)
{
  std::vector<CellTexels> cells(static_cast<std::size_t>(num_cells));
  for (int i = 0; i < num_cells; ++i) {
    const double begin = static_cast<double>(i) * num_texels / num_cells;
    const double end = static_cast<double>(i + 1) * num_texels / num_cells;
    CellTexels& cell = cells[static_cast<std::size_t>(i)];
    cell.first = static_cast<int>(std::floor(begin - 0.5));
    const int last = static_cast<int>(std::ceil(end + 0.5)) - 1;
    for (int texel = cell.first; texel <= last; ++texel) {
      const double centre = texel + 0.5;
      cell.weights.push_back(static_cast<float>(tent_integral(end - centre) - tent_integral(begin - centre)));
    }
  }
  return cells;
}

/// Luminance of the map at the texels of one mip level.
struct LuminanceImage {
  int width = 0, height = 0;
  std::vector<float> texels;
};

LuminanceImage luminance_load(const EnvironmentView& environment, int level)
{
  const TextureView& map = environment.map;
  LuminanceImage image{mip_size(map.width, level), mip_size(map.height, level), {}};
  const auto width = static_cast<std::size_t>(image.width);
  image.texels.resize(width * static_cast<std::size_t>(image.height));
  // This footprint selects exactly the level, for textures in memory and in the cache alike.
  const float footprint =
      level == 0 ? 0.0f
                 : std::ldexp(1.0f, level) / std::sqrt(static_cast<float>(map.width) * static_cast<float>(map.height));
  tbb::parallel_for(tbb::blocked_range<int>(0, image.height), [&](const tbb::blocked_range<int>& rows) {
    for (int y = rows.begin(); y < rows.end(); ++y) {
      for (int x = 0; x < image.width; ++x) {
        const Vec2f centre{(static_cast<float>(x) + 0.5f) / static_cast<float>(image.width),
                           (static_cast<float>(y) + 0.5f) / static_cast<float>(image.height)};
        const Vec3f value = xyz(texture_sample(map, centre, footprint));
        image.texels[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)] =
            luminance(abs(environment.color * value));
      }
    }
  });
  return image;
}

/// Writes a cumulative distribution in multiples of 1 / kQuanta.
/// @param weights  num_cells, >= 0, at least one > 0
/// @param cdf      num_cells + 1
/// Every cell with a weight gets a probability, however small its share: a cell of density zero that has radiance
/// would be a bias. What the least cells are given too much, the greatest cell is given too little.
void cdf_write(const double* weights, int num_cells, float* cdf)
{
  double total = 0;
  for (int i = 0; i < num_cells; ++i) {
    total += weights[i];
  }
  std::vector<std::int64_t> quanta(static_cast<std::size_t>(num_cells));
  std::int64_t sum = 0;
  for (int i = 0; i < num_cells; ++i) {
    std::int64_t& q = quanta[static_cast<std::size_t>(i)];
    q = weights[i] > 0 ? std::max<std::int64_t>(1, std::llround(weights[i] / total * kQuanta)) : 0;
    sum += q;
  }
  // The excess is below one quantum a cell, 2^-14 of the whole; the greatest of at most 1024 cells has 2^-10 or more.
  *std::max_element(quanta.begin(), quanta.end()) += kQuanta - sum;
  std::int64_t running = 0;
  for (int i = 0; i < num_cells; ++i) {
    cdf[i] = static_cast<float>(running) / static_cast<float>(kQuanta);
    running += quanta[static_cast<std::size_t>(i)];
  }
  cdf[num_cells] = 1.0f;
}

/// A distribution over cells none of which will be asked for: rows without light.
void cdf_write_uniform(int num_cells, float* cdf)
{
  const std::vector<double> equal(static_cast<std::size_t>(num_cells), 1.0);
  cdf_write(equal.data(), num_cells, cdf);
}

std::vector<float> row_edges_make(int num_rows)
{
  std::vector<float> edges(static_cast<std::size_t>(num_rows) + 1);
  for (int i = 0; i <= num_rows; ++i) {
    const double half_theta = 0.5 * std::numbers::pi * i / num_rows;
    const double value = 2 * i <= num_rows ? std::sin(half_theta) : std::cos(half_theta);
    edges[static_cast<std::size_t>(i)] = static_cast<float>(value * value);
  }
  return edges;
}

/// Coarsest mip level with at least two texels a cell on both sides: light stays where it is to a quarter of a cell, and
/// a huge map is read quickly.
int level_for_cells(const TextureView& map, int num_columns, int num_rows)
{
  int level = 0;
  while (level + 1 < map.num_levels && mip_size(map.width, level + 1) >= 2 * num_columns &&
         mip_size(map.height, level + 1) >= 2 * num_rows) {
    ++level;
  }
  return level;
}

/// Integral of the map over each cell of a grid, in texels × luminance; row after row.
std::vector<double> cells_integrate(const LuminanceImage& image, int num_columns, int num_rows)
{
  const std::vector<CellTexels> columns = cell_texels(image.width, num_columns);
  const std::vector<CellTexels> rows = cell_texels(image.height, num_rows);
  std::vector<double> cells(static_cast<std::size_t>(num_rows) * static_cast<std::size_t>(num_columns));
  tbb::parallel_for(0, num_rows, [&](int row) {
    const auto r = static_cast<std::size_t>(row);
    const auto width = static_cast<std::size_t>(image.width);
    std::vector<double> row_texels(width);  // integrated over the row's height
    for (std::size_t k = 0; k < rows[r].weights.size(); ++k) {
      const int y = std::clamp(rows[r].first + static_cast<int>(k), 0, image.height - 1);
      const float* texels = image.texels.data() + static_cast<std::size_t>(y) * width;
      for (std::size_t x = 0; x < width; ++x) {
        row_texels[x] += static_cast<double>(rows[r].weights[k]) * static_cast<double>(texels[x]);
      }
    }
    double* row_cells = cells.data() + r * static_cast<std::size_t>(num_columns);
    for (std::size_t c = 0; c < columns.size(); ++c) {
      for (std::size_t k = 0; k < columns[c].weights.size(); ++k) {
        const int x = (columns[c].first + static_cast<int>(k) + image.width) % image.width;
        row_cells[c] += static_cast<double>(columns[c].weights[k]) * row_texels[static_cast<std::size_t>(x)];
      }
    }
  });
  return cells;
}

float turns_of(float rotation)
{
  const double turns = static_cast<double>(rotation) / (2 * std::numbers::pi);
  return static_cast<float>(turns - std::floor(turns));
}

/// Cells and the mean luminance that a unit of them stands for.
struct Cells {
  int num_columns = 0, num_rows = 0;
  std::vector<double> values;  ///< row after row
  double unit = 1;
};

/// Writes the cumulative distributions.
/// @return  flux of what they are in proportion to, luminance × solid angle
double tables_fill(EnvironmentTables& tables, Cells cells, EnvironmentDensity density)
{
  EnvironmentView& environment = tables.environment;
  const int num_columns = cells.num_columns, num_rows = cells.num_rows;
  tables.row_edges = row_edges_make(num_rows);
  const auto height = [&tables](std::size_t row) {
    return static_cast<double>(std::abs(tables.row_edges[row + 1] - tables.row_edges[row]));
  };
  tables.row_cdf.resize(static_cast<std::size_t>(num_rows) + 1);
  const auto width = static_cast<std::size_t>(num_columns);
  const std::size_t pitch = width + 1;
  tables.column_cdf.resize(static_cast<std::size_t>(num_rows) * pitch);

  double sum = 0, area = 0;
  for (std::size_t i = 0; i < cells.values.size(); ++i) {
    sum += cells.values[i] * height(i / width);
    area += height(i / width);
  }
  const double mean = sum / area;
  if (density == EnvironmentDensity::kExcess) {
    for (double& cell : cells.values) cell = std::max(cell - mean, 0.0);
    tables.base_luminance = static_cast<float>(mean * cells.unit);
  } else if (tables.computed) {
    constexpr double kLeast = 0.05;
    for (double& cell : cells.values) cell = std::max(cell, kLeast * mean);
  }
  std::vector<double> row_weights(static_cast<std::size_t>(num_rows));
  tbb::parallel_for(0, num_rows, [&](int row) {
    const auto r = static_cast<std::size_t>(row);
    const double* weights = cells.values.data() + r * width;
    const double row_sum = std::accumulate(weights, weights + width, 0.0);
    row_weights[r] = row_sum * height(r);
    float* cdf = tables.column_cdf.data() + r * pitch;
    if (row_sum > 0) {
      cdf_write(weights, num_columns, cdf);
    } else {
      cdf_write_uniform(num_columns, cdf);
    }
  });
  const double flux = std::accumulate(row_weights.begin(), row_weights.end(), 0.0);
  if (flux > 0) {
    cdf_write(row_weights.data(), num_rows, tables.row_cdf.data());
    environment.num_columns = num_columns;
    environment.num_rows = num_rows;
  } else {
    tables.row_cdf.clear();
    tables.column_cdf.clear();
    tables.row_edges.clear();
  }
  return flux * cells.unit * 4 * std::numbers::pi / num_columns;
}

Cells cells_of_map(const EnvironmentView& environment)
{
  Cells cells;
  cells.num_columns = std::clamp(environment.map.width, 1, kMaxEnvironmentColumns);
  // Even, so that no row lies in both hemispheres.
  cells.num_rows = std::clamp(environment.map.height + environment.map.height % 2, 2, kMaxEnvironmentColumns / 2);
  const LuminanceImage image =
      luminance_load(environment, level_for_cells(environment.map, cells.num_columns, cells.num_rows));
  cells.values = cells_integrate(image, cells.num_columns, cells.num_rows);
  cells.unit = static_cast<double>(cells.values.size()) / (static_cast<double>(image.width) * image.height);
  return cells;
}

/// The disks in world space, a little wider: rounding must not take a place within a disk out of it.
std::vector<EnvironmentSun> suns_of(const ComputedEnvironment& computed, std::span<const GraphSun> suns)
{
  constexpr float kWider = 1.002f;
  std::vector<EnvironmentSun> out;
  for (const GraphSun& sun : suns) {
    const float half = std::sin(0.5f * std::min(kWider * sun.radius, std::numbers::pi_v<float>));
    const Vec3f map{sun.towards.x, sun.towards.z, -sun.towards.y};
    out.push_back({normalize(computed_environment_world(computed, map)), 2.0f * half * half, 0.0f});
  }
  return out;
}

/// Shares the choice between suns and cells in proportion to their light, with a part that is even: none of it knows of shadows,
/// so that nothing may starve.
/// @param flux  of the cells; 0: there are none
void suns_share(EnvironmentTables& tables, std::span<const float> luminances, double flux)
{
  double total = flux;
  int num_lit = flux > 0 ? 1 : 0;
  const auto flux_of = [&](std::size_t i) {
    return static_cast<double>(luminances[i]) * 2 * std::numbers::pi * static_cast<double>(tables.suns[i].cone);
  };
  for (std::size_t i = 0; i < tables.suns.size(); ++i) {
    total += flux_of(i);
    num_lit += luminances[i] > 0 ? 1 : 0;
  }
  if (num_lit == 0) {
    tables.suns.clear();
    return;
  }
  constexpr double kDefensive = 0.25;
  double rest = 1;
  std::vector<EnvironmentSun> lit;
  for (std::size_t i = 0; i < tables.suns.size(); ++i) {
    if (!(luminances[i] > 0)) continue;
    EnvironmentSun sun = tables.suns[i];
    sun.probability = static_cast<float>((1 - kDefensive) * flux_of(i) / total + kDefensive / num_lit);
    rest -= static_cast<double>(sun.probability);
    lit.push_back(sun);
  }
  tables.suns = std::move(lit);
  tables.environment.cells_probability = flux > 0 ? static_cast<float>(rest) : 0.0f;
}

}  // namespace

EnvironmentView EnvironmentTables::view() const
{
  EnvironmentView view = environment;
  view.row_cdf = row_cdf.data();
  view.column_cdf = column_cdf.data();
  view.row_edges = row_edges.data();
  view.suns = suns.data();
  view.num_suns = static_cast<int>(suns.size());
  return view;
}

std::size_t EnvironmentTables::bytes() const
{
  std::size_t bytes = (row_cdf.size() + column_cdf.size() + row_edges.size()) * sizeof(float);
  const auto add = [&bytes](const SmoothGrid& grid) {
    bytes += grid.values.size() * sizeof(Vec3f) + grid.is_smooth.size();
  };
  if (computed) {
    add(computed->map);
    for (const SmoothSun& sun : computed->suns) add(sun.grid);
  }
  return bytes;
}

EnvironmentView environment_view_make(const TextureView* map, Vec3f color, float rotation)
{
  EnvironmentView environment;
  environment.color = color;
  environment.rotation_turns = turns_of(rotation);
  if (map != nullptr) {
    environment.has_map = true;
    environment.map = *map;
    environment.map.wrap_u = Wrap::kRepeat;
  }
  return environment;
}

EnvironmentView environment_view_make(const ComputedEnvironment& computed, Vec3f color, float rotation)
{
  EnvironmentView environment;
  environment.color = color;
  environment.rotation_turns = turns_of(rotation);
  environment.has_map = true;
  environment.radiance_of = computed_environment_radiance;
  environment.computed = &computed;
  return environment;
}

EnvironmentTables environment_tables_make(const TextureView* map,
                                          Vec3f color,
                                          float rotation,
                                          EnvironmentDensity density)
{
  EnvironmentTables tables;
  tables.environment = environment_view_make(map, color, rotation);
  if (map != nullptr) tables_fill(tables, cells_of_map(tables.environment), density);
  return tables;
}

EnvironmentTables environment_tables_make(std::shared_ptr<ComputedEnvironment> computed,
                                          Vec3f color,
                                          float rotation,
                                          std::span<const GraphSun> suns,
                                          int image_side,
                                          EnvironmentDensity density)
{
  EnvironmentTables tables;
  tables.environment = environment_view_make(*computed, color, rotation);
  tables.suns = suns_of(*computed, suns);
  computed_environment_smooth(*computed, tables.suns);
  const ComputedCells found = computed_environment_cells(*computed, tables.suns, color, image_side);
  tables.computed = std::move(computed);
  Cells cells{ComputedCells::kColumns, ComputedCells::kRows, {found.luminance.begin(), found.luminance.end()}, 1};
  suns_share(tables, found.suns, tables_fill(tables, std::move(cells), density));
  return tables;
}

}  // namespace relief
