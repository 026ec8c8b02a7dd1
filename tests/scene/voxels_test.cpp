// Grids of OpenVDB: what is read is what the library has, between values as it interpolates them; bounds hold what is between;
// what is wrong with a file is one error that says where.
#include "scene/voxels.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include <sys/stat.h>

#include "kernel/graph/voxels.h"
#include "scene/diagnostics.h"
#include "scene/memory.h"
#include "tests/support/graph_scene.h"

namespace relief {
namespace {

openvdb::math::Transform::Ptr turned()
{
  openvdb::math::Transform::Ptr transform = openvdb::math::Transform::createLinearTransform(0.25);
  transform->postRotate(0.6, openvdb::math::Y_AXIS);
  transform->postTranslate({1.5, -2, 0.5});
  return transform;
}

/// A grid of numbers on both sides of 0 and of the borders of bricks, a tile and a voxel far from the rest.
openvdb::FloatGrid::Ptr cloud()
{
  openvdb::initialize();
  openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0.0f);
  grid->setName("density");
  grid->setTransform(turned());
  std::mt19937 random(1);
  auto at = grid->getAccessor();
  for (int x = -11; x < 13; ++x) {
    for (int y = -5; y < 20; ++y) {
      for (int z = -9; z < 3; ++z) at.setValue({x, y, z}, static_cast<float>(random() % 1000) / 100.0f);
    }
  }
  grid->tree().addTile(1, {16, 16, 16}, 3.0f, true);
  at.setValue({40, -30, 7}, 2.5f);
  return grid;
}

class File {
 public:
  explicit File(const openvdb::GridPtrVec& grids) : path_(folder_ / "grids.vdb")
  {
    openvdb::io::File(path_.string()).write(grids);
  }
  const std::filesystem::path& path() const { return path_; }

  void cut(std::uintmax_t bytes) const { std::filesystem::resize_file(path_, bytes); }
  std::uintmax_t size() const { return std::filesystem::file_size(path_); }

  std::string failure(const std::string& grid) const
  {
    try {
      static_cast<void>(voxels_load(path_, grid, "scene.gltf", "/nodes/0/uri"));
    } catch (const SceneError& error) {
      EXPECT_EQ(error.file, "scene.gltf");
      EXPECT_EQ(error.json_path, "/nodes/0/uri");
      return error.expected + "; " + error.found;
    }
    return "";
  }

 private:
  test::TemporaryFolder folder_;
  std::filesystem::path path_;
};

/// Points around the grid's values, in the lattice's coordinates.
template <class Check>
void at_points(Check&& check)
{
  std::mt19937 random(2);
  std::uniform_real_distribution<double> x(-20, 48), y(-36, 30), z(-20, 30);
  for (int i = 0; i < 20000; ++i) check(openvdb::Vec3d(x(random), y(random), z(random)));
}

Vec3f in_object(const openvdb::GridBase& grid, const openvdb::Vec3d& lattice)
{
  const openvdb::Vec3d P = grid.transform().indexToWorld(lattice);
  return {static_cast<float>(P.x()), static_cast<float>(P.y()), static_cast<float>(P.z())};
}

TEST(Voxels, AreWhatTheLibraryHas)
{
  const openvdb::FloatGrid::Ptr grid = cloud();
  const File file({grid});
  const auto voxels = voxels_load(file.path(), "density", "scene.gltf", "/");
  ASSERT_EQ(voxels->view.channels, 1);
  at_points([&](const openvdb::Vec3d& p) {
    const float wanted = openvdb::tools::BoxSampler::sample(grid->tree(), p);
    // Halves have 11 bits; positions are single.
    ASSERT_NEAR(voxels_eval(voxels->view, in_object(*grid, p)).y, wanted, 0.006f);
    ASSERT_NEAR(voxels_eval(voxels_centered(voxels->view), in_object(*grid, p + openvdb::Vec3d(0.5))).x, wanted,
                0.006f);
  });
}

TEST(Voxels, OfVectorsHaveThreeNumbers)
{
  openvdb::initialize();
  openvdb::Vec3SGrid::Ptr grid = openvdb::Vec3SGrid::create(openvdb::Vec3s(0, 0, 0));
  grid->setName("color");
  auto at = grid->getAccessor();
  for (int i = 0; i < 12; ++i) at.setValue({i, 2, -3}, {static_cast<float>(i), 2.0f, -1.0f});
  const File file({grid});
  const auto voxels = voxels_load(file.path(), "color", "scene.gltf", "/");
  EXPECT_EQ(voxels_eval(voxels->view, {7.5f, 2, -3}), (Vec3f{7.5f, 2, -1}));
  EXPECT_EQ(voxels_eval(voxels->view, {7, 2.5f, -3}), (Vec3f{3.5f, 1, -0.5f}));
}

TEST(Voxels, FarAwayAndNowhereAreBackground)
{
  const File file({cloud()});
  const auto voxels = voxels_load(file.path(), "density", "scene.gltf", "/");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const float x : {1e6f, -1e30f, kInfinity, nan}) EXPECT_EQ(voxels_eval(voxels->view, {x, 0, x}), Vec3f{});
}

TEST(Voxels, AreWithinTheirBounds)
{
  const openvdb::FloatGrid::Ptr grid = cloud();
  const File file({grid});
  const auto voxels = voxels_load(file.path(), "density", "scene.gltf", "/");
  std::mt19937 random(3);
  at_points([&, n = 0](const openvdb::Vec3d& corner) mutable {
    if (++n % 20 != 0) return;
    const float size = static_cast<float>(random() % 300) / (n % 40 == 0 ? 10.0f : 200.0f);
    float low[3], high[3];
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = static_cast<float>(corner[axis]);
      high[axis] = low[axis] + size;
    }
    const VoxelRange range = voxels_range(voxels->view, low, high);
    for (int i = 0; i < 50; ++i) {
      openvdb::Vec3d p = corner;
      for (int axis = 0; axis < 3; ++axis) p[axis] += size * static_cast<double>(random() % 1001) / 1000;
      const float value = openvdb::tools::BoxSampler::sample(grid->tree(), p);
      ASSERT_GE(value, range.low.x - 0.006f);
      ASSERT_LE(value, range.high.x + 0.006f);
    }
  });
  // Tight where a box is as small as a voxel.
  const float low[3] = {41.2f, -30, 7}, high[3] = {41.8f, -29.5f, 7.5f};
  EXPECT_EQ(voxels_range(voxels->view, low, high).high.x, 0.0f);
}

TEST(Voxels, OfAFileThatEndsEarlyAreAnError)
{
  const File file({cloud()});
  const std::uintmax_t whole = file.size();
  EXPECT_NE(file.failure("heat").find("\"density\""), std::string::npos);
  for (int i = 40; --i >= 0;) {
    file.cut(whole * static_cast<std::uintmax_t>(i) / 40);
    ASSERT_NE(file.failure("density").find("an OpenVDB file"), std::string::npos) << i;
  }
}

// Bytes that are changed within a file crash OpenVDB, a few of a hundred; what then ends is the program that reads for us. Longer:
// --gtest_repeat, each time with other bytes.
TEST(Voxels, OfAFileWithAChangedByteAreAnErrorAtWorst)
{
  const File file({cloud()});
  std::string bytes;
  {
    std::ifstream in(file.path(), std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  static unsigned seed = 0;
  std::mt19937 random(seed++);
  int num_errors = 0;
  constexpr int kTimes = 50;
  for (int i = 0; i < kTimes; ++i) {
    std::string changed = bytes;
    changed[random() % changed.size()] ^= static_cast<char>(1 + random() % 255);
    std::ofstream(file.path(), std::ios::binary) << changed;
    try {
      num_errors += file.failure("density").empty() ? 0 : 1;
    } catch (const OutOfMemory&) {
      ++num_errors;
    }
  }
  EXPECT_LT(num_errors, kTimes);
}

// One changed byte, and the library reads billions of things that the file does not have.
TEST(Voxels, OfAFileWithoutEndAreAnError)
{
  const File file({cloud()});
  {
    std::fstream bytes(file.path(), std::ios::binary | std::ios::in | std::ios::out);
    bytes.seekp(806);
    bytes.put('\x7f');
  }
  EXPECT_NE(file.failure("density").find("CPU time limit exceeded"), std::string::npos);
}

TEST(Voxels, OfAPipeAreAnError)
{
  const File file({cloud()});
  std::filesystem::remove(file.path());
  ASSERT_EQ(::mkfifo(file.path().c_str(), 0600), 0);
  EXPECT_NE(file.failure("density").find("a regular file"), std::string::npos);
}

TEST(Voxels, OfNoneAreAnError)
{
  openvdb::initialize();
  openvdb::GridBase::Ptr grid = openvdb::FloatGrid::create();
  grid->setName("empty");
  const File file({grid});
  const auto voxels = voxels_load(file.path(), "empty", "scene.gltf", "/");
  EXPECT_EQ(voxels_eval(voxels->view, {0, 0, 0}), Vec3f{});
  EXPECT_NE(file.failure("density").find("\"empty\" of type float"), std::string::npos);
}

/// A grey TGA whose texels, from the lower left one on, are their numbers times seven.
std::string slices(int width, int height)
{
  std::string bytes(18, 0);
  bytes[2] = 3;
  bytes[12] = static_cast<char>(width);
  bytes[14] = static_cast<char>(height);
  bytes[16] = 8;
  for (int i = 0; i < width * height; ++i) bytes.push_back(static_cast<char>(i * 7));
  return bytes;
}

TEST(Voxels, OfSlicesStandFromTheLowerLeftOn)
{
  const test::TemporaryFolder folder;
  // Five slices of 3 x 2 in a picture of two rows of three.
  const std::string file = folder.write("slices.tga", slices(9, 4)).string();
  const auto voxels = voxels_load_slices({file, {}, "scene.gltf", "/"}, {3, 2, 5});
  const VoxelView view = voxels_centered(voxels->view);
  for (int z = 0; z < 5; ++z) {
    for (int y = 0; y < 2; ++y) {
      for (int x = 0; x < 3; ++x) {
        const int texel = (z / 3 * 2 + y) * 9 + z % 3 * 3 + x;
        const Vec3f at{(static_cast<float>(x) + 0.5f) / 3, (static_cast<float>(y) + 0.5f) / 2,
                       (static_cast<float>(z) + 0.5f) / 5};
        EXPECT_NEAR(voxels_eval(view, at).x, static_cast<float>(texel * 7 % 256) / 255, 1e-3f) << x << y << z;
      }
    }
  }
  // Half of what is at the border, as beyond it there is nothing.
  EXPECT_NEAR(voxels_eval(view, {1, 0.75f, 0.1f}).x, 0.5f * 11 * 7 / 255, 1e-3f);
  try {
    static_cast<void>(voxels_load_slices({file, {}, "scene.gltf", "/nodes/0/uri"}, {3, 2, 7}));
    FAIL() << "no error";
  } catch (const SceneError& error) {
    EXPECT_EQ(error.json_path, "/nodes/0/uri");
    EXPECT_NE(error.expected.find("7 slices of 3 x 2"), std::string::npos);
    EXPECT_NE(error.found.find("9 x 4"), std::string::npos);
  }
}

TEST(Voxels, AskForMemoryFirst)
{
  openvdb::initialize();
  openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0.0f);
  grid->setName("density");
  // Three cubes, between which the table of bricks would be as long as a galaxy.
  for (const int x : {-200000000, 0, 200000000}) grid->tree().setValue({x, x / 2, x}, 1.0f);
  const File file({grid});
  EXPECT_THROW(static_cast<void>(voxels_load(file.path(), "density", "scene.gltf", "/")), OutOfMemory);
}

TEST(Voxels, MakeAMediumThatVaries)
{
  const File file({cloud()});
  using nlohmann::json;
  test::GltfBuilder b =
      test::graph_scene({{"nodes", {{{"type", "voxel-texture"}, {"uri", file.path().string()}, {"grid", "density"}}}}});
  b.json["materials"][0]["extensions"]["RELIEF_volume"] = {
      {"closures", {{{"type", "scatter"}, {"density", {{"node", 0}, {"output", "value"}}}}}}};
  const test::TemporaryFolder folder;
  const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
  ASSERT_EQ(scene.varying_media.size(), 1u);
  EXPECT_EQ(scene.varying_media[0].closures.size(), 1u);
  EXPECT_EQ(scene.varying_media[0].program.voxels.size(), 1u);
  const bool is_listed = std::any_of(scene.files.begin(), scene.files.end(), [&](const FileStamp& stamp) {
    return std::filesystem::path(stamp.path) == file.path();
  });
  EXPECT_TRUE(is_listed);
}

}  // namespace
}  // namespace relief
