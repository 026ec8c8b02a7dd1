// How texture seams are found and measured, see displacement/seams.h.
#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "displacement/displaced_mesh.h"
#include "displacement/seams.h"

namespace relief {
namespace {

/// Two triangles of the unit square, split along the diagonal, over the map h = texel column / (width − 1).
struct SeamCase {
  static constexpr int kWidth = 64;

  SeamCase()
  {
    P = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    uv = {{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}};
    triangles = {{0, 1, 2}, {3, 4, 5}};
    for (int x = 0; x < kWidth; ++x) texels.push_back(static_cast<float>(x) / (kWidth - 1));
  }

  void move_second_triangle(Vec2f by)
  {
    for (std::size_t i = 3; i < 6; ++i) uv[i] = uv[i] + by;
  }

  /// The mesh as it is traced.
  struct Traced {
    HeightField field;
    DisplacedMesh mesh;
  };
  std::unique_ptr<Traced> trace(Wrap wrap, bool weld_seams = false) const
  {
    auto traced = std::make_unique<Traced>();
    traced->field = HeightField(HeightMapView{texels.data(), kWidth, 1, HeightFormat::kFloat, wrap, wrap});
    MeshView view;
    view.P = P.data();
    view.N = N.empty() ? nullptr : N.data();
    view.uv[0] = uv.empty() ? nullptr : uv.data();
    view.triangles = triangles.data();
    view.num_vertices = static_cast<std::uint32_t>(P.size());
    view.num_triangles = static_cast<std::uint32_t>(triangles.size());
    traced->mesh = DisplacedMesh(view, traced->field.view(), {height, -2, 0.5, weld_seams});
    return traced;
  }
  SeamReport find(Wrap wrap) const { return seam_report(trace(wrap)->mesh.view()); }

  std::vector<Vec3f> P;
  std::vector<Normal3f> N;
  std::vector<Vec2f> uv;
  std::vector<TriangleIndices> triangles;
  std::vector<float> texels;
  TextureRef height;
};

TEST(SeamReport, EqualCoordinatesHaveNone)
{
  const SeamCase seam;
  const SeamReport found = seam.find(Wrap::kRepeat);
  EXPECT_EQ(found.all.num_edges, 0u);
  EXPECT_EQ(found.all.length, 0);
  EXPECT_EQ(found.all.largest_gap, 0);
}

// Moved by whole tiles, also along v, where the map is constant.
TEST(SeamReport, WholeTilesApartAreTheSameUnderRepeat)
{
  SeamCase seam;
  seam.move_second_triangle({1000, -3.25f});
  EXPECT_EQ(seam.find(Wrap::kRepeat).all.num_edges, 0u);
  // Mirrored, even tiles agree.
  EXPECT_EQ(seam.find(Wrap::kMirror).all.num_edges, 0u);
  seam.move_second_triangle({1, 0});
  EXPECT_EQ(seam.find(Wrap::kRepeat).all.num_edges, 0u);
  EXPECT_EQ(seam.find(Wrap::kMirror).all.num_edges, 1u);
}

// Under clamping the sides of the diagonal ask for h(u) and h(u + ¼). With x = 64 u − ½ clamped to 0…63 the heights are
// x / 63: 16/63 apart where neither is clamped, and equal nowhere but at the very end.
TEST(SeamReport, AShiftedSideOpensAGapOfTheRampsRise)
{
  SeamCase seam;
  seam.move_second_triangle({0.25f, 0});
  const SeamReport found = seam.find(Wrap::kClamp);
  EXPECT_EQ(found.all.num_edges, 1u);
  EXPECT_NEAR(found.all.largest_gap, 2 * 16.0 / 63, 1e-6);
  // The last half texel of 64 is clamped on both sides; one of its points lies in it.
  EXPECT_NEAR(found.all.length, std::sqrt(2.0) * (1 - 0.5 / 64), std::sqrt(2.0) / 100);
}

TEST(SeamReport, TheTransformTakesPart)
{
  SeamCase seam;
  seam.move_second_triangle({0.25f, 0});
  seam.height.m00 = 4;
  EXPECT_EQ(seam.find(Wrap::kRepeat).all.num_edges, 0u);
}

// The diagonal shared by index has no seam, whatever the other edges do.
TEST(SeamReport, OpenBordersAreNoSeams)
{
  SeamCase seam;
  seam.triangles = {{0, 1, 2}};
  EXPECT_EQ(seam.find(Wrap::kClamp).all.num_edges, 0u);
}

// Three triangles on one edge: the gap is that of the two farthest apart.
TEST(SeamReport, EdgesOfManyTrianglesTakeTheWidestGap)
{
  SeamCase seam;
  seam.P.insert(seam.P.end(), {{1, 1, 0}, {0, 0, 0}, {0, 0, 1}});
  seam.uv.insert(seam.uv.end(), {{1.125f, 1}, {0.125f, 0}, {0, 0}});
  seam.triangles.push_back({6, 7, 8});
  EXPECT_NEAR(seam.find(Wrap::kClamp).all.largest_gap, 2 * 8.0 / 63, 1e-6);
  seam.move_second_triangle({0.25f, 0});
  EXPECT_NEAR(seam.find(Wrap::kClamp).all.largest_gap, 2 * 16.0 / 63, 1e-6);
  EXPECT_EQ(seam.find(Wrap::kClamp).all.num_edges, 1u);
}

// With as many tiles as an edge has points, or a multiple, points at equal distances would all fall on one texel: here on the
// first and the last of the map, 1 − 1/63 apart where half the points of the other side are.
TEST(SeamReport, TilesInStepWithThePointsAreSeen)
{
  SeamCase seam;
  for (std::size_t i = 0; i < 6; ++i) {
    seam.uv[i] = 4096.0f * seam.uv[i];
  }
  seam.move_second_triangle({0.5f, 0});
  const SeamReport found = seam.find(Wrap::kRepeat);
  EXPECT_GT(found.all.largest_gap, 0.9);
  EXPECT_GT(found.all.length, 0.95 * std::sqrt(2.0));
}

// 20,000 triangles of their own texture coordinates, thousands of tiles each: every edge wants its 4096 points, 120 million in
// all, which took ten seconds. The figures of a share of them are those of all but for the largest gap.
TEST(SeamReport, ManyTilesOnManyTrianglesAreEstimatedAtOnce)
{
  constexpr int kSide = 100;
  SeamCase seam;
  seam.P.clear();
  seam.uv.clear();
  seam.triangles.clear();
  for (int i = 0; i < kSide * kSide; ++i) {
    const auto x = static_cast<float>(i % kSide), y = static_cast<float>(i / kSide);
    for (const bool upper : {false, true}) {
      const auto first = static_cast<std::uint32_t>(seam.P.size());
      seam.P.insert(seam.P.end(), {{x, y, 0}, {x + 1, y + 1, 0}, upper ? Vec3f{x, y + 1, 0} : Vec3f{x + 1, y, 0}});
      seam.uv.insert(seam.uv.end(), {{0, 0}, {3000.3f, 0}, {0, 3000.7f}});
      seam.triangles.push_back({first, first + 1, first + 2});
    }
  }
  // On the diagonals both sides have the same coordinates.
  const SeamReport found = seam.find(Wrap::kRepeat);
  constexpr std::size_t kSeams = 2 * kSide * (kSide - 1);
  EXPECT_EQ(found.all.num_edges, kSeams);
  EXPECT_NEAR(found.all.length, kSeams, 0.05 * kSeams);
  // Along v the map is constant: at u = 0 it has the mean of its ends, ½.
  EXPECT_NEAR(found.all.largest_gap, 1, 0.05);
  // Four million, and what rounding up adds.
  EXPECT_LE(found.num_points, (std::size_t{1} << 22) + kSeams);
}

// What welding does not close: the report is of what the walls leave.
TEST(SeamReport, SplitNormalsAreThoseWithoutWalls)
{
  SeamCase seam;
  seam.move_second_triangle({0.25f, 0});
  const auto walls = [&seam] { return seam.trace(Wrap::kClamp, true)->mesh.view().num_walls; };
  EXPECT_EQ(seam.find(Wrap::kClamp).split.num_edges, 0u)
      << "without normals coplanar triangles move along the same one";
  EXPECT_EQ(walls(), 2u);
  seam.N.assign(6, {0, 0, 1});
  EXPECT_EQ(seam.find(Wrap::kClamp).split.num_edges, 0u);
  EXPECT_EQ(walls(), 2u);
  seam.N[3] = {0, 0.6f, 0.8f};
  const SeamReport found = seam.find(Wrap::kClamp);
  EXPECT_EQ(found.split.num_edges, 1u);
  EXPECT_EQ(found.split.length, found.all.length);
  EXPECT_EQ(walls(), 0u);
}

TEST(SeamReport, ConstantMapsHaveNone)
{
  SeamCase seam;
  std::fill(seam.texels.begin(), seam.texels.end(), 0.3f);
  seam.move_second_triangle({0.3f, 0.1f});
  EXPECT_EQ(seam.find(Wrap::kClamp).all.num_edges, 0u);
}

TEST(SeamReport, WithoutCoordinatesThereIsNothingToCompare)
{
  SeamCase seam;
  seam.uv.clear();
  EXPECT_EQ(seam.find(Wrap::kRepeat).all.num_edges, 0u);
}

}  // namespace
}  // namespace relief
