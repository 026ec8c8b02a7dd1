// What is at one place, found by many threads, against a table of all that came before.
#include <array>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "displacement/shared_edges.h"

namespace relief {
namespace {

/// Triangles between places of a small lattice, so that many share corners and edges: more than one thread is given.
std::vector<DisplacedTriangle> many_triangles()
{
  constexpr std::size_t kCount = 50000;
  std::mt19937 random(1);
  const auto coordinate = [&] { return static_cast<float>(static_cast<int>(random() % 25) - 12); };
  std::vector<DisplacedTriangle> triangles(kCount);
  for (DisplacedTriangle& triangle : triangles) {
    for (int k = 0; k < 3; ++k) {
      triangle.P[k] = {coordinate(), coordinate(), coordinate() * (random() % 2 == 0 ? 1.0f : -1.0f)};
      triangle.N[k] = {0, random() % 8 == 0 ? 1.0f : 0.0f, 1};
    }
  }
  return triangles;
}

using Line = std::array<float, 6>;  // a map takes −0 and 0 for one

Line line_of(const std::vector<DisplacedTriangle>& triangles, std::size_t corner)
{
  const Vec3f P = triangles[corner / 3].P[corner % 3], N = triangles[corner / 3].N[corner % 3];
  return {P.x, P.y, P.z, N.x, N.y, N.z};
}

TEST(SharedEdges, AreTheFirstOfAllThatAreEqual)
{
  const std::vector<DisplacedTriangle> triangles = many_triangles();
  const std::vector<std::uint32_t> corners = weld_corners(triangles), edges = weld_edges(corners);
  const std::vector<std::uint32_t> positions = weld_positions(triangles);
  std::map<Line, std::uint32_t> first_line;
  std::map<std::array<float, 3>, std::uint32_t> first_place;
  std::map<std::pair<Line, Line>, std::uint32_t> first_edge;
  ASSERT_EQ(corners.size(), 3 * triangles.size());
  std::size_t num_shared = 0;
  for (std::uint32_t corner = 0; corner < corners.size(); ++corner) {
    const Line line = line_of(triangles, corner), end = line_of(triangles, edge_end(corner));
    ASSERT_EQ(corners[corner], first_line.try_emplace(line, corner).first->second) << corner;
    ASSERT_EQ(positions[corner], first_place.try_emplace({line[0], line[1], line[2]}, corner).first->second) << corner;
    ASSERT_EQ(edges[corner], first_edge.try_emplace(std::minmax(line, end), corner).first->second) << corner;
    num_shared += edges[corner] != corner ? 1 : 0;
  }
  EXPECT_GT(num_shared, 10u);
  EXPECT_TRUE(weld_corners({}).empty());
}

}  // namespace
}  // namespace relief
