// The only source that uses OpenVDB; see voxel_file.h.
#include "scene/openvdb_file.h"

#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <fstream>
#include <memory>
#include <mutex>
#include <new>
#include <stdexcept>

#include "kernel/texture/half.h"
#include "scene/voxel_file.h"

namespace relief {
namespace {

/// Nearest half that is a number: what is too large is the largest, and NaN is 0.
std::uint16_t half_of(double value)
{
  constexpr double kLargest = 65504;
  return half_from_float(static_cast<float>(std::isnan(value) ? 0.0 : std::clamp(value, -kLargest, kLargest)));
}

/// Numbers and texts of the start of a file, all of them within it.
class Head {
 public:
  explicit Head(const std::string& file) : stream_(file, std::ios::binary | std::ios::ate)
  {
    if (!stream_) throw std::runtime_error("cannot be opened");
    size_ = stream_.tellg();
    stream_.seekg(0);
  }

  std::int64_t size() const { return size_; }
  void seek(std::int64_t place) { stream_.seekg(place); }

  template <typename Number>
  Number number()
  {
    Number value{};
    read(reinterpret_cast<char*>(&value), sizeof value);
    return value;
  }

  std::string text(std::int64_t length)
  {
    require(length);
    std::string out(static_cast<std::size_t>(length), 0);
    read(out.data(), length);
    return out;
  }
  std::string text() { return text(number<std::uint32_t>()); }

 private:
  void require(std::int64_t bytes)
  {
    const std::int64_t at = stream_.tellg();
    if (at < 0 || bytes > size_ - at) throw std::runtime_error("the file ends too early");
  }
  void read(char* to, std::int64_t bytes)
  {
    require(bytes);
    stream_.read(to, bytes);
  }

  std::ifstream stream_;
  std::int64_t size_ = 0;
};

/// Refuses a file that ends before its grids do: the library would take what it finds there for sizes, and make gigabytes of them.
/// @source OpenVDB 10, versions 211 to 224 of the format: magic number, versions, identity, metadata, then a head a grid
/// @error  std::exception
void refuse_if_truncated(const std::string& file)
{
  constexpr std::int64_t kMagic = 0x56444220;
  constexpr std::uint32_t kOldest = 216, kOfCompression = 220, kOfGrids = 222;
  Head head(file);
  if (head.number<std::int64_t>() != kMagic) throw std::runtime_error("it is no OpenVDB file");
  const auto version = head.number<std::uint32_t>();
  if (version < kOldest) throw std::runtime_error("a version of the format before 1.0");
  head.number<std::uint64_t>();  // of the library
  const bool has_places = head.number<char>() != 0;
  if (version >= kOfCompression && version < kOfGrids) head.number<char>();
  constexpr int kIdentity = 36;
  head.text(kIdentity);
  for (auto left = head.number<std::uint32_t>(); left > 0; --left) {
    for (int part = 0; part < 3; ++part) head.text();
  }
  if (!has_places) throw std::runtime_error("a stream, which does not say where its grids are");
  for (auto left = head.number<std::uint32_t>(); left > 0; --left) {
    const std::string name = head.text();
    for (int part = 0; part < 2; ++part) head.text();
    std::int64_t places[3];  // of the grid, its values, its end
    for (std::int64_t& place : places) place = head.number<std::int64_t>();
    if (places[0] < 0 || places[2] < places[0] || places[2] > head.size()) {
      // A grid's second name of several alike comes after a separator.
      throw std::runtime_error("the file ends before its grid \"" + name.substr(0, name.find('\x1e')) + "\" does");
    }
    head.seek(places[2]);
  }
}

/// A grid once its type is known.
class Tree {
 public:
  virtual ~Tree() = default;
  virtual int channels() const = 0;
  virtual void measure(VoxelHeader& header) = 0;
  virtual void read(std::uint32_t* bricks, std::uint16_t* values) = 0;
};

template <typename Grid>
class TreeOf final : public Tree {
  using Leaf = typename Grid::TreeType::LeafNodeType;
  using Value = typename Grid::ValueType;
  static_assert(Leaf::DIM == kBrickSize);
  static constexpr int kChannels = openvdb::VecTraits<Value>::IsVec ? 3 : 1;

  struct Tile {
    openvdb::CoordBBox box;
    Value value;
  };

 public:
  explicit TreeOf(typename Grid::Ptr grid) : grid_(std::move(grid)) {}

  int channels() const override { return kChannels; }

  void measure(VoxelHeader& header) override
  {
    auto& tree = grid_->tree();
    openvdb::CoordBBox box;
    auto tiles = tree.cbeginValueOn();
    for (tiles.setMaxDepth(decltype(tiles)::LEAF_DEPTH - 1); tiles; ++tiles) {
      openvdb::CoordBBox of_tile;
      tiles.getBoundingBox(of_tile);
      tiles_.push_back({of_tile, tiles.getValue()});
      box.expand(of_tile);
    }
    tree.stealNodes(leaves_);
    for (const Leaf* leaf : leaves_) box.expand(leaf->getNodeBoundingBox());
    if (!box.empty()) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        header.first[axis] = first_[axis] = box.min()[axis] >> 3;
        header.count[axis] = count_[axis] = (std::int64_t{box.max()[axis]} >> 3) + 1 - first_[axis];
      }
    }
    header.num_bricks = 1 + tiles_.size() + leaves_.size();
  }

  void read(std::uint32_t* bricks, std::uint16_t* values) override
  {
    fill(values, grid_->background());
    std::uint32_t next = 1;
    for (const Tile& tile : tiles_) {
      fill(brick(values, next), tile.value);
      // Of numbers that mean something: those of level sets say how far it is, too, but where a tile is active.
      for (std::int64_t x = tile.box.min().x() >> 3; x <= tile.box.max().x() >> 3; ++x) {
        for (std::int64_t y = tile.box.min().y() >> 3; y <= tile.box.max().y() >> 3; ++y) {
          for (std::int64_t z = tile.box.min().z() >> 3; z <= tile.box.max().z() >> 3; ++z)
            bricks[place(x, y, z)] = next;
        }
      }
      ++next;
    }
    tbb::parallel_for(std::size_t{0}, leaves_.size(), [&](std::size_t i) {
      const std::unique_ptr<Leaf> leaf(std::exchange(leaves_[i], nullptr));
      const auto number = next + static_cast<std::uint32_t>(i);
      const openvdb::Coord at = leaf->origin();
      bricks[place(at.x() >> 3, at.y() >> 3, at.z() >> 3)] = number;
      std::uint16_t* to = brick(values, number);
      // In OpenVDB's leaves z runs fastest as well.
      for (openvdb::Index k = 0; k < kBrickVoxels; ++k) write(to + k * kChannels, leaf->getValue(k));
    });
  }

  ~TreeOf() override
  {
    for (Leaf* leaf : leaves_) delete leaf;
  }

 private:
  static void write(std::uint16_t* to, const Value& value)
  {
    if constexpr (kChannels == 3) {
      for (int c = 0; c < 3; ++c) to[c] = half_of(static_cast<double>(value[c]));
    } else {
      to[0] = half_of(static_cast<double>(value));
    }
  }
  static void fill(std::uint16_t* to, const Value& value)
  {
    for (std::size_t k = 0; k < kBrickVoxels; ++k) write(to + k * kChannels, value);
  }
  static std::uint16_t* brick(std::uint16_t* values, std::uint32_t number)
  {
    return values + std::size_t{number} * kBrickVoxels * kChannels;
  }
  std::size_t place(std::int64_t x, std::int64_t y, std::int64_t z) const
  {
    return static_cast<std::size_t>(((x - first_[0]) * count_[1] + y - first_[1]) * count_[2] + z - first_[2]);
  }

  typename Grid::Ptr grid_;
  std::vector<Tile> tiles_;
  std::vector<Leaf*> leaves_;
  std::int64_t first_[3] = {}, count_[3] = {};
};

/// Null: it is none of numbers.
template <typename... Grids>
std::unique_ptr<Tree> tree_of(const openvdb::GridBase::Ptr& grid)
{
  std::unique_ptr<Tree> tree;
  const auto try_one = [&]<typename Grid>() {
    if (tree == nullptr && grid->isType<Grid>())
      tree = std::make_unique<TreeOf<Grid>>(openvdb::gridPtrCast<Grid>(grid));
  };
  (try_one.template operator()<Grids>(), ...);
  return tree;
}

std::unique_ptr<Tree> tree_make(const openvdb::GridBase::Ptr& grid)
{
  return tree_of<openvdb::FloatGrid, openvdb::DoubleGrid, openvdb::Int32Grid, openvdb::Int64Grid, openvdb::BoolGrid,
                 openvdb::Vec3SGrid, openvdb::Vec3DGrid, openvdb::Vec3IGrid>(grid);
}

/// Runs what may fail. @return what is wrong
template <class Step>
std::string attempt(const Step& step)
{
  try {
    step();
    return {};
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    const std::string text = e.what();
    return text.empty() ? "truncated or corrupt data" : text;
  }
}

class OpenVdbFile final : public VoxelFile {
 public:
  std::string open(const std::string& file, const std::string& grid, VoxelHeader& header) override
  {
    return attempt([&] {
      static std::once_flag once;
      std::call_once(once, [] { openvdb::initialize(); });
      refuse_if_truncated(file);
      file_ = std::make_unique<openvdb::io::File>(file);
      // Nothing is copied to elsewhere before it is read.
      file_->setCopyMaxBytes(0);
      file_->open();
      grid_name_ = grid;
      const openvdb::GridPtrVecPtr all = file_->readAllGridMetadata();
      for (const openvdb::GridBase::Ptr& one : *all) {
        header.grids.push_back('"' + one->getName() + "\" of type " + one->valueType());
        if (one->getName() != grid || header.is_known) continue;
        const std::unique_ptr<Tree> tree = tree_make(one);
        if (tree == nullptr) continue;
        header.is_known = true;
        header.channels = tree->channels();
        if (const auto count = one->getMetadata<openvdb::Int64Metadata>(openvdb::GridBase::META_FILE_VOXEL_COUNT)) {
          header.num_voxels = static_cast<std::uint64_t>(std::max<std::int64_t>(count->value(), 0));
        }
        // Of what is wider at its far end the part that is affine, as in Cycles.
        const openvdb::Mat4d m = one->transform().baseMap()->getAffineMap()->getMat4();
        for (int row = 0; row < 4; ++row) {
          for (int axis = 0; axis < 3; ++axis) header.object_from_lattice[row][axis] = m(row, axis);
        }
      }
    });
  }

  std::string read_tree(VoxelHeader& header) override
  {
    return attempt([&] {
      tree_ = tree_make(file_->readGrid(grid_name_));
      tree_->measure(header);
    });
  }

  std::string read_values(std::uint32_t* bricks, std::uint16_t* values) override
  {
    return attempt([&] { tree_->read(bricks, values); });
  }

 private:
  std::unique_ptr<openvdb::io::File> file_;
  std::string grid_name_;
  std::unique_ptr<Tree> tree_;
};

}  // namespace

std::unique_ptr<VoxelFile> openvdb_file_make() { return std::make_unique<OpenVdbFile>(); }

}  // namespace relief
