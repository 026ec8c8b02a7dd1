// Displacement by moving vertices: where they go, how they are shaded, and that nothing opens.
#include "displacement/moved_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <unordered_map>
#include <utility>
#include <vector>

#include "displacement/vec3d.h"

namespace relief::test {
namespace {

/// An octahedron of half a size along x, y and z, whose normals are as long as its vertices are far from the middle.
struct Octahedron {
  std::vector<Vec3f> P{{1, 0, 0}, {0, 2, 0}, {0, 0, 1.5f}, {-1, 0, 0}, {0, -2, 0}, {0, 0, -1.5f}};
  std::vector<Normal3f> N;
  std::vector<Vec2f> uv;
  std::vector<TriangleIndices> triangles{{0, 1, 2}, {1, 3, 2}, {3, 4, 2}, {4, 0, 2},
                                         {1, 0, 5}, {3, 1, 5}, {4, 3, 5}, {0, 4, 5}};

  Octahedron()
  {
    for (const Vec3f& v : P) {
      N.push_back(as_normal(v));
      uv.push_back({v.x + 2 * v.y, v.z});
    }
  }
  MeshView view() const
  {
    MeshView out;
    out.P = P.data();
    out.N = N.data();
    out.uv[0] = uv.data();
    out.triangles = triangles.data();
    out.num_vertices = static_cast<std::uint32_t>(P.size());
    out.num_triangles = static_cast<std::uint32_t>(triangles.size());
    return out;
  }
};

double waves(const Vec3d& P) { return 0.5 + 0.2 * std::sin(3 * P.x + 1) * std::cos(2 * P.y) + 0.1 * P.z; }

/// Waves over the base. In double precision sums along a side have one rounding, whichever triangle asks.
void eval_waves(const void* owner, std::uint32_t triangle, const float (*b)[8], float* h)
{
  const auto& mesh = *static_cast<const MeshView*>(owner);
  const TriangleIndices& t = mesh.triangles[triangle];
  for (int lane = 0; lane < 8; ++lane) {
    const Vec3d P = static_cast<double>(b[0][lane]) * to_double(mesh.P[t.v0]) +
                    static_cast<double>(b[1][lane]) * to_double(mesh.P[t.v1]) +
                    static_cast<double>(b[2][lane]) * to_double(mesh.P[t.v2]);
    h[lane] = static_cast<float>(waves(P));
  }
}

constexpr VertexDisplacement kBy{0.3, 0.25f, true};

Vec3d moved(const Vec3d& P, const Vec3d& N)
{
  return P + N * (kBy.scale * (waves(P) - static_cast<double>(kBy.midlevel)) / length(N));
}

TEST(MovedMesh, HasItsVerticesWhereHeightsSay)
{
  const Octahedron octahedron;
  const MeshView mesh = octahedron.view();
  const MovedMesh out = moved_mesh_make(mesh, corner_heights({&mesh, eval_waves}), kBy);
  const MeshView view = out.view(mesh);
  EXPECT_EQ(view.triangles, mesh.triangles);
  for (std::size_t k = 0; k < octahedron.P.size(); ++k) {
    const Vec3d P = to_double(octahedron.P[k]);
    EXPECT_LT(length(to_double(view.P[k]) - moved(P, P)), 1e-6);
    Vec3d sum{};
    for (const TriangleIndices& t : octahedron.triangles) {
      if (t.v0 != k && t.v1 != k && t.v2 != k) continue;
      const Vec3d a = to_double(view.P[t.v0]), n = cross(to_double(view.P[t.v1]) - a, to_double(view.P[t.v2]) - a);
      sum = sum + n * (1 / length(n));
    }
    EXPECT_LT(length(to_double(as_vector(view.N[k])) - sum * (1 / length(sum))), 1e-6);
  }
}

/// A vertex that a seam has two of moves as one: heights are those of the first, as in Cycles, where it is one.
TEST(MovedMesh, StaysClosedAlongTextureSeams)
{
  Octahedron octahedron;
  octahedron.P.push_back(octahedron.P[2]);
  octahedron.N.push_back(octahedron.N[2]);
  octahedron.uv.push_back({7, 7});
  for (std::size_t t = 1; t < 3; ++t) octahedron.triangles[t].v2 = 6;
  const MeshView mesh = octahedron.view();
  const CornerHeights by_triangle = [](const std::uint32_t* corners, float* h) {
    for (int lane = 0; lane < 8; ++lane) h[lane] = static_cast<float>(corners[lane] / 3);
  };
  const MovedMesh out = moved_mesh_make(mesh, by_triangle, kBy);
  EXPECT_EQ(out.P[2], out.P[6]);
  EXPECT_EQ(as_vector(out.N[2]), as_vector(out.N[6]));
  EXPECT_NEAR(out.P[2].z, 1.5 + kBy.scale * -static_cast<double>(kBy.midlevel), 1e-6);
}

TEST(MovedMesh, LeavesVerticesWhoseHeightIsNoNumber)
{
  const Octahedron octahedron;
  const MeshView mesh = octahedron.view();
  const CornerHeights none = [](const std::uint32_t*, float* h) { std::fill_n(h, 8, std::nanf("")); };
  EXPECT_EQ(moved_mesh_make(mesh, none, kBy).P, octahedron.P);
}

/// Sides that are divided differently: each edge has its like, the other way round, and all points are where heights say.
TEST(MovedMesh, IsClosedWhereTrianglesAreDividedDifferently)
{
  const Octahedron octahedron;
  const MeshView mesh = octahedron.view();
  const HeightSource source{&mesh, eval_waves};
  // More where x and y are positive; triangles of 300 cells are cut into parts.
  const std::pair<double, std::int32_t> kCells[] = {{1, 0}, {5, 0}, {40, 0}, {300, 0}, {300, 16}, {700, 512}};
  for (const auto& [most, most_cells] : kCells) {
    // Clang 14 lets no name of a binding into a function.
    const auto cells = [most = most](Vec3f a, Vec3f b) {
      const double x = 0.5 * static_cast<double>(a.x + b.x), y = 0.5 * static_cast<double>(a.y + b.y);
      return most * std::clamp(0.5 + x * 0.5 + y * 0.25, 0.05, 1.0) * static_cast<double>(length(b - a)) / 2.5;
    };
    const std::vector<LatticeTriangle> parts = lattices_make(mesh, cells, {}, most_cells);
    for (const LatticeTriangle& part : parts) {
      // Parts are halves of halves.
      const Vec2f side = part.corner[1] - part.corner[0];
      const double part_of_side = std::max({std::abs(side.x), std::abs(side.y), std::abs(side.x + side.y)});
      EXPECT_LE(part.side_n[0], most_cells > 0 ? most_cells * part_of_side : HUGE_VAL);
    }
    const MovedMesh out = divided_mesh_make(mesh, source, parts, kBy);
    const MeshView view = out.view(mesh);
    // Vertices in one place have one number. With sanitizers, and so unoptimized, maps of edges took two minutes.
    using Place = std::array<float, 3>;
    const auto hash = [](const Place& P) {
      std::size_t sum = 0;
      for (const float x : P) sum = sum * 0x9e3779b97f4a7c15u + std::hash<float>()(x);
      return sum ^ sum >> 29;
    };
    std::unordered_map<Place, std::uint32_t, decltype(hash)> numbers(view.num_vertices, hash);
    std::vector<std::uint32_t> number(view.num_vertices);
    for (std::uint32_t k = 0; k < view.num_vertices; ++k) {
      const Vec3f& P = view.P[k];
      number[k] = numbers.try_emplace(Place{P.x, P.y, P.z}, static_cast<std::uint32_t>(numbers.size())).first->second;
    }
    std::vector<std::uint64_t> edges, other_way;
    constexpr std::uint32_t kNone = ~0u;
    std::vector<std::uint32_t> first_at(numbers.size(), kNone);
    double volume = 0;
    std::uint32_t num_torn = 0;
    for (std::uint32_t k = 0; k < view.num_triangles; ++k) {
      const TriangleIndices& t = view.triangles[k];
      const std::array<std::uint32_t, 3> v{t.v0, t.v1, t.v2};
      const std::array<std::uint64_t, 3> at{number[t.v0], number[t.v1], number[t.v2]};
      if (at[0] == at[1] || at[1] == at[2] || at[2] == at[0]) continue;
      for (std::size_t side = 0; side < 3; ++side) {
        const std::uint64_t a = at[side], b = at[(side + 1) % 3];
        edges.push_back(a << 32 | b);
        other_way.push_back(b << 32 | a);
        // Shaded alike on both sides.
        if (first_at[a] == kNone) first_at[a] = v[side];
        num_torn += as_vector(view.N[v[side]]) == as_vector(view.N[first_at[a]]) ? 0 : 1;
      }
      volume += dot(to_double(view.P[t.v0]), cross(to_double(view.P[t.v1]), to_double(view.P[t.v2]))) / 6;
    }
    EXPECT_EQ(num_torn, 0u) << most;
    std::sort(edges.begin(), edges.end());
    std::sort(other_way.begin(), other_way.end());
    EXPECT_TRUE(edges == other_way) << most;
    EXPECT_GT(volume, 1);
    // The uv are linear in the places here, so these tell where a vertex was: x + 2y and z, on |x| + |y|/2 + |z|/1.5 = 1.
    for (std::uint32_t k = 0; k < view.num_vertices; ++k) {
      const auto sum = static_cast<double>(view.uv[0][k].x), z = static_cast<double>(view.uv[0][k].y);
      const Vec3d at = to_double(view.P[k]);
      // The vertex moved along N = (x, y, z) of its base, so base and moved point are on one line through the middle.
      const double x = at.x / at.z * z, y = at.y / at.z * z;
      if (std::abs(z) < 0.05) continue;
      EXPECT_NEAR(x + 2 * y, sum, 2e-4);
      EXPECT_LT(length(at - moved({x, y, z}, {x, y, z})), 2e-5);
    }
  }
}

/// Triangles in sixteen: vertices lie on the sides and faces, with what is linear over these; each edge has its like, also along a cut
/// of texture coordinates; and what has a vertex in common still has.
TEST(MovedMesh, HalvesSidesAndStaysClosed)
{
  Octahedron octahedron;
  octahedron.P.push_back(octahedron.P[2]);
  octahedron.N.push_back(octahedron.N[2]);
  octahedron.uv.push_back(octahedron.uv[2]);
  for (std::size_t t = 1; t < 3; ++t) octahedron.triangles[t].v2 = 6;
  const MeshView mesh = octahedron.view();
  const MovedMesh out = halved_mesh_make(mesh, 2);
  const MeshView view = out.view(mesh);
  ASSERT_EQ(view.num_triangles, 8u * 16);
  // By Euler 66 places; the cut has two sides and an end.
  ASSERT_EQ(view.num_vertices, 66u + 2 * 3 + 1);
  std::map<std::array<float, 3>, Vec3f> normals;
  for (std::uint32_t k = 0; k < view.num_vertices; ++k) {
    const Vec3f P = view.P[k];
    EXPECT_NEAR(std::abs(P.x) + std::abs(P.y) / 2 + std::abs(P.z) / 1.5f, 1, 1e-6);
    EXPECT_NEAR(view.uv[0][k].x, P.x + 2 * P.y, 1e-6);
    EXPECT_NEAR(view.uv[0][k].y, P.z, 1e-6);
    EXPECT_LT(length(as_vector(view.N[k]) - P), 1e-6f);
    const Vec3f first = normals.try_emplace({P.x, P.y, P.z}, as_vector(view.N[k])).first->second;
    EXPECT_EQ(as_vector(view.N[k]), first);
  }
  EXPECT_EQ(normals.size(), 66u);
  std::map<std::pair<std::array<float, 3>, std::array<float, 3>>, int> edges;
  double volume = 0;
  for (std::uint32_t k = 0; k < view.num_triangles; ++k) {
    const TriangleIndices& t = view.triangles[k];
    const Vec3f P[3] = {view.P[t.v0], view.P[t.v1], view.P[t.v2]};
    for (int side = 0; side < 3; ++side) {
      const Vec3f a = P[side], b = P[(side + 1) % 3];
      ++edges[{{a.x, a.y, a.z}, {b.x, b.y, b.z}}];
    }
    const double part = dot(to_double(P[0]), cross(to_double(P[1]), to_double(P[2]))) / 6;
    EXPECT_NEAR(part, 4.0 / (8 * 16), 1e-6);
    volume += part;
  }
  EXPECT_NEAR(volume, 4, 1e-5);
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1u);
  }
}

/// Where vectors bring a point: a turn about z that grows with the height, with overhangs.
Vec3d turned(const Vec3d& P)
{
  const double angle = 0.7 * P.z, c = std::cos(angle), s = std::sin(angle);
  return {c * P.x - s * P.y, s * P.x + c * P.y, P.z + 0.3 * std::sin(4 * P.x) * std::cos(3 * P.y)};
}

void moves_of_points(const void* owner, std::uint32_t triangle, const float (*b)[8], Vec3f* moves)
{
  const auto& mesh = *static_cast<const MeshView*>(owner);
  const TriangleIndices& t = mesh.triangles[triangle];
  for (int lane = 0; lane < 8; ++lane) {
    const Vec3d P = static_cast<double>(b[0][lane]) * to_double(mesh.P[t.v0]) +
                    static_cast<double>(b[1][lane]) * to_double(mesh.P[t.v1]) +
                    static_cast<double>(b[2][lane]) * to_double(mesh.P[t.v2]);
    moves[lane] = to_float(turned(P) - P);
  }
}

void moves_of_corners(const void* owner, const std::uint32_t* corners, Vec3f* moves)
{
  const auto& mesh = *static_cast<const MeshView*>(owner);
  for (int lane = 0; lane < 8; ++lane) {
    const TriangleIndices& t = mesh.triangles[corners[lane] / 3];
    const std::uint32_t vertices[3] = {t.v0, t.v1, t.v2};
    const Vec3d P = to_double(mesh.P[vertices[corners[lane] % 3]]);
    moves[lane] = to_float(turned(P) - P);
  }
}

TEST(MovedMesh, HasItsVerticesWhereVectorsSay)
{
  const Octahedron octahedron;
  for (const bool has_normals : {true, false}) {
    MeshView mesh = octahedron.view();
    if (!has_normals) mesh.N = nullptr;
    const MovedMesh out = moved_mesh_make(mesh, PointMoves{&mesh, moves_of_points, moves_of_corners}, true, {});
    EXPECT_EQ(out.N.empty(), !has_normals);
    for (std::size_t k = 0; k < octahedron.P.size(); ++k)
      EXPECT_LT(length(to_double(out.P[k]) - turned(to_double(octahedron.P[k]))), 1e-6);
  }
}

/// Neither uv nor normals that differ on the two sides of an edge open it, however its triangles are divided.
TEST(MovedMesh, IsClosedUnderVectorsThatDifferAlongSeams)
{
  Octahedron octahedron;
  for (const std::size_t of : {std::size_t{2}, std::size_t{1}}) {
    octahedron.P.push_back(octahedron.P[of]);
    octahedron.N.push_back(as_normal(Vec3f{0.1f, 0.2f, 1}));
    octahedron.uv.push_back({7, 7});
  }
  octahedron.triangles[1] = {7, 3, 6};
  const MeshView mesh = octahedron.view();
  // Other vectors on each triangle.
  const PointMoves moves{nullptr,
                         [](const void*, std::uint32_t triangle, const float(*b)[8], Vec3f* out) {
                           for (int k = 0; k < 8; ++k) out[k] = Vec3f{0.01f * static_cast<float>(triangle), b[1][k], 0};
                         },
                         nullptr};
  const auto cells = [](Vec3f a, Vec3f b) { return 12.0 + 10 * static_cast<double>(a.x + b.x); };
  const std::vector<LatticeTriangle> parts = lattices_make(mesh, cells);
  const MovedMesh out = divided_mesh_make(mesh, moves, parts, true, {});
  const MeshView view = out.view(mesh);
  using Place = std::array<float, 3>;
  std::map<std::pair<Place, Place>, int> edges;
  for (std::uint32_t k = 0; k < view.num_triangles; ++k) {
    const TriangleIndices& t = view.triangles[k];
    const std::array<std::uint32_t, 3> v{t.v0, t.v1, t.v2};
    for (std::size_t side = 0; side < 3; ++side) {
      const auto place = [&](std::uint32_t i) { return Place{view.P[i].x, view.P[i].y, view.P[i].z}; };
      const Place a = place(v[side]), b = place(v[(side + 1) % 3]);
      if (a == b) continue;
      ++edges[{a, b}];
      --edges[{b, a}];
    }
  }
  EXPECT_GT(edges.size(), 1000u);
  EXPECT_TRUE(std::all_of(edges.begin(), edges.end(), [](const auto& edge) { return edge.second == 0; }));
}

/// A mesh that deforms takes the same vectors along at all times, as in Cycles, and is shaded by its shape at each.
TEST(MovedMesh, TakesVectorsAlongWhileItDeforms)
{
  const Octahedron octahedron;
  const MeshView mesh = octahedron.view();
  const PointMoves moves{&mesh, moves_of_points, moves_of_corners};
  std::vector<Vec3f> twice;
  for (const Vec3f& P : octahedron.P) twice.push_back(2.0f * P);
  const MeshShape steps[] = {{octahedron.P.data(), octahedron.N.data()}, {twice.data(), octahedron.N.data()}};
  const std::vector<LatticeTriangle> parts = lattices_make(mesh, [](Vec3f, Vec3f) { return 7.0; });
  for (const MovedMesh& out :
       {moved_mesh_make(mesh, moves, true, steps), divided_mesh_make(mesh, moves, parts, true, steps)}) {
    const MeshView view = out.view(mesh);
    ASSERT_EQ(out.steps.size(), 2u);
    for (std::uint32_t k = 0; k < view.num_vertices; ++k) {
      EXPECT_LT(length(to_double(out.steps[0].P[k]) - to_double(out.P[k])), 1e-6);
      EXPECT_LT(length(to_double(as_vector(out.steps[0].N[k])) - to_double(as_vector(out.N[k]))), 1e-4);
      // What twice the size adds is the place on the base, which uv tell: x + 2y and z.
      const Vec3d base = to_double(out.steps[1].P[k]) - to_double(out.P[k]);
      EXPECT_NEAR(base.x + 2 * base.y, static_cast<double>(view.uv[0][k].x), 1e-5);
      EXPECT_NEAR(base.z, static_cast<double>(view.uv[0][k].y), 1e-5);
    }
    EXPECT_NE(as_vector(out.steps[1].N[0]), as_vector(out.N[0]));
  }
}

TEST(MovedMesh, CountsTheCellsOfItsTriangles)
{
  const Octahedron octahedron;
  const MeshView mesh = octahedron.view();
  EXPECT_DOUBLE_EQ(mean_cells_a_side(mesh, [](Vec3f, Vec3f) { return 3.0; }), 3.0);
}

}  // namespace
}  // namespace relief::test
