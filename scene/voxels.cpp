#include "scene/voxels.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <system_error>

#include "kernel/graph/voxels.h"
#include "scene/diagnostics.h"
#include "scene/memory.h"
#include "scene/voxel_process.h"

namespace relief {
namespace {

Affine3 lattice_from_object(const VoxelHeader& header)
{
  const auto row = [&](int i) {
    const double* r = header.object_from_lattice[i];
    return Vec3f{static_cast<float>(r[0]), static_cast<float>(r[1]), static_cast<float>(r[2])};
  };
  return inverse(Affine3{row(0), row(1), row(2), row(3)});
}

bool is_finite(const Affine3& m)
{
  const auto finite = [](Vec3f v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); };
  return finite(m.x) && finite(m.y) && finite(m.z) && finite(m.p);
}

std::string listed(const std::vector<std::string>& names)
{
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out.empty() ? "none" : out;
}

VoxelRange range_of(const std::uint16_t* values, int channels)
{
  VoxelRange out{splat3(kInfinity), splat3(-kInfinity)};
  for (std::size_t i = 0; i < kBrickVoxels; ++i, values += channels) {
    const float x = float_from_half(values[0]);
    const Vec3f value = channels == 1 ? splat3(x) : Vec3f{x, float_from_half(values[1]), float_from_half(values[2])};
    out = voxel_hull(out, {value, value});
  }
  return out;
}

/// Fills in what follows from the values.
void complete(Voxels& voxels, std::size_t num_bricks)
{
  VoxelView& view = voxels.view;
  const std::size_t brick_values = kBrickVoxels * static_cast<std::size_t>(view.channels);
  voxels.ranges.resize(num_bricks);
  tbb::parallel_for(std::size_t{0}, num_bricks, [&](std::size_t i) {
    voxels.ranges[i] = range_of(voxels.values.get() + i * brick_values, view.channels);
  });
  view.bricks = voxels.bricks.data();
  view.values = voxels.values.get();
  view.ranges = voxels.ranges.data();
  view.range = view.ranges[0];
  for (const VoxelRange& range : voxels.ranges) view.range = voxel_hull(view.range, range);
}

}  // namespace

std::shared_ptr<const Voxels> voxels_load(const std::filesystem::path& file,
                                          const std::string& grid,
                                          const std::string& scene_file,
                                          const std::string& json_path)
{
  const std::string label = scene_file + ": " + json_path + " (" + file.string() + ')';
  const auto fail = [&](const std::string& expected, const std::string& found) {
    throw SceneError(scene_file, json_path, expected, '"' + file.string() + "\": " + found);
  };
  const auto check = [&](const std::string& error) {
    if (error.empty()) return;
    if (is_out_of_memory(error)) throw OutOfMemory(label + ": " + error);
    fail("an OpenVDB file", error);
  };
  std::error_code unknown;
  const std::filesystem::file_status status = std::filesystem::status(file, unknown);
  // A pipe may have no end, or no beginning.
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    fail("a regular file", "something else");
  try {
    const std::unique_ptr<VoxelFile> reader = voxel_process_make();
    VoxelHeader header;
    check(reader->open(file.string(), grid, header));
    if (!header.is_known) fail("a grid of numbers, \"" + grid + '"', listed(header.grids));
    auto voxels = std::make_shared<Voxels>();
    VoxelView& view = voxels->view;
    view.channels = header.channels;
    view.lattice_from_object = lattice_from_object(header);
    if (!is_finite(view.lattice_from_object)) fail("a grid that fills space", "a transform without an inverse");
    const auto brick_bytes = kBrickVoxels * sizeof(std::uint16_t) * static_cast<std::size_t>(header.channels);
    memory_require(header.num_voxels / kBrickVoxels * brick_bytes, label);
    check(reader->read_tree(header));
    double cells = 1;
    for (int axis = 0; axis < 3; ++axis) {
      cells *= static_cast<double>(header.count[axis]);
      view.first[axis] = static_cast<int>(header.first[axis]);
      view.count[axis] = static_cast<int>(header.count[axis]);
    }
    const auto num_bricks = static_cast<std::size_t>(header.num_bricks);
    const double bytes =
        cells * sizeof(std::uint32_t) + static_cast<double>(num_bricks * (brick_bytes + sizeof(VoxelRange)));
    constexpr double kMostBytes = 0x1p62;
    constexpr std::uint64_t kMostBricks = 0xffffffff;
    const MemoryReservation room(static_cast<std::uint64_t>(std::min(bytes, kMostBytes)), label);
    if (header.num_bricks > kMostBricks) fail("at most 4,294,967,295 bricks", std::to_string(num_bricks));
    voxels->bricks.resize(static_cast<std::size_t>(cells));
    voxels->values = std::make_unique_for_overwrite<std::uint16_t[]>(num_bricks * brick_bytes / sizeof(std::uint16_t));
    check(reader->read_values(voxels->bricks.data(), voxels->values.get()));
    complete(*voxels, num_bricks);
    return voxels;
  } catch (const OutOfMemory&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(label);
  }
}

std::shared_ptr<const Voxels> voxels_load_slices(const ImageSource& source, const std::array<int, 3>& size)
{
  ImageReader reader(source);
  const ImageHeader& header = reader.header();
  const auto [width, height, depth] = size;
  const bool fits = header.width % width == 0 && header.height % height == 0 &&
                    std::int64_t{header.width / width} * (header.height / height) >= depth;
  if (!fits || header.num_channels == 2) {
    throw SceneError(source.scene_file, source.json_path,
                     "an image of one or three channels with " + std::to_string(depth) + " slices of " +
                         std::to_string(width) + " x " + std::to_string(height) + " texels",
                     '"' + source.file + "\": " + std::to_string(header.width) + " x " + std::to_string(header.height) +
                         " texels, " + std::to_string(header.num_channels) + " channels");
  }
  auto voxels = std::make_shared<Voxels>();
  VoxelView& view = voxels->view;
  view.channels = header.num_channels == 1 ? 1 : 3;
  view.lattice_from_object = {
      {static_cast<float>(width), 0, 0}, {0, static_cast<float>(height), 0}, {0, 0, static_cast<float>(depth)}, {}};
  const auto channels = static_cast<std::size_t>(view.channels);
  std::size_t num_places = 1;
  for (int axis = 0; axis < 3; ++axis) {
    view.count[axis] = (size[static_cast<std::size_t>(axis)] + kBrickSize - 1) / kBrickSize;
    num_places *= static_cast<std::size_t>(view.count[axis]);
  }
  const std::size_t brick_values = kBrickVoxels * channels;
  const std::size_t brick_bytes = brick_values * sizeof(std::uint16_t);
  // All of them at first; those that have nothing but 0 are left out.
  const MemoryReservation room((num_places + 1) * (brick_bytes + sizeof(VoxelRange) + sizeof(std::uint32_t)),
                               source.scene_file + ": " + source.json_path + " (" + source.file + ')');
  voxels->bricks.resize(num_places);
  std::vector<std::uint16_t> values((num_places + 1) * brick_values);
  reader.select(0, view.channels, SampleType::kFloat);
  const int columns = header.width / width;
  const int at_once = reader.rows_at_once();
  for (int begin = 0; begin < header.height; begin += at_once) {
    const int end = std::min(begin + at_once, header.height);
    const auto* rows = reinterpret_cast<const float*>(reader.load_rows(begin, end));
    for (int row = begin; row < end; ++row) {
      const int from_below = header.height - 1 - row, y = from_below % height;
      for (int column = 0; column < columns; ++column) {
        const int z = from_below / height * columns + column;
        if (z >= depth) break;
        for (int x = 0; x < width; ++x) {
          const std::size_t place = (static_cast<std::size_t>(x >> 3) * static_cast<std::size_t>(view.count[1]) +
                                     static_cast<std::size_t>(y >> 3)) *
                                        static_cast<std::size_t>(view.count[2]) +
                                    static_cast<std::size_t>(z >> 3);
          const auto within = static_cast<std::size_t>(((x & 7) << 6) | ((y & 7) << 3) | (z & 7));
          const std::size_t texel = static_cast<std::size_t>(row - begin) * static_cast<std::size_t>(header.width) +
                                    static_cast<std::size_t>(column * width + x);
          for (std::size_t c = 0; c < channels; ++c) {
            const float value = rows[texel * channels + c];
            constexpr float kLargest = 65504;
            values[(place + 1) * brick_values + within * channels + c] =
                half_from_float(value == value ? std::clamp(value, -kLargest, kLargest) : 0.0f);
          }
        }
      }
    }
  }
  std::uint32_t num_bricks = 1;
  for (std::size_t place = 0; place < num_places; ++place) {
    const auto brick = values.begin() + static_cast<std::ptrdiff_t>((place + 1) * brick_values);
    const auto end = brick + static_cast<std::ptrdiff_t>(brick_values);
    if (std::all_of(brick, end, [](std::uint16_t half) { return (half & 0x7fffu) == 0; })) continue;
    std::copy(brick, end, values.begin() + static_cast<std::ptrdiff_t>(num_bricks * brick_values));
    voxels->bricks[place] = num_bricks++;
  }
  voxels->values = std::make_unique_for_overwrite<std::uint16_t[]>(num_bricks * brick_values);
  std::copy_n(values.begin(), num_bricks * brick_values, voxels->values.get());
  complete(*voxels, num_bricks);
  return voxels;
}

VoxelView voxels_centered(const VoxelView& view)
{
  VoxelView out = view;
  out.lattice_from_object.p = out.lattice_from_object.p - splat3(0.5f);
  return out;
}

}  // namespace relief
