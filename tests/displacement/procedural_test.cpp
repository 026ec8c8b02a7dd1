// Surfaces whose heights are computed where rays ask for them: the same as if they had been stored, closed where triangles
// meet, and the same whatever the cache has forgotten.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include <tbb/parallel_for.h>

#include "displacement/lattice_split.h"
#include "displacement/procedural_field.h"
#include "tests/displacement/closed_surfaces.h"
#include "tests/displacement/judge.h"
#include "tests/displacement/random_cases.h"

namespace relief {
namespace {

constexpr std::size_t kCacheBytes = 4 << 20;

/// Heights of one triangle by a table at its lattice points.
struct TableSource {
  int n = 1;
  std::vector<float> h;  ///< (n + 1)², by b1, then b2

  float at(int i, int j) const
  {
    return h[static_cast<std::size_t>(std::clamp(j, 0, n) * (n + 1) + std::clamp(i, 0, n))];
  }
  static void eval(const void* owner, std::uint32_t, const float (*b)[8], float* h)
  {
    const auto& table = *static_cast<const TableSource*>(owner);
    for (int k = 0; k < 8; ++k) {
      h[k] = table.at(static_cast<int>(std::lround(b[1][k] * static_cast<float>(table.n))),
                      static_cast<int>(std::lround(b[2][k] * static_cast<float>(table.n))));
    }
  }
  static void bounds(const void* owner, std::uint32_t, const WeightPatches& p, float* low, float* high)
  {
    const auto& table = *static_cast<const TableSource*>(owner);
    const auto end = [&](int axis, int k, float sign) {
      const float reach = std::abs(p.du[axis][k]) + std::abs(p.dv[axis][k]);
      const float at = (p.center[axis][k] + sign * reach) * static_cast<float>(table.n);
      return static_cast<int>(sign < 0 ? std::floor(at) : std::ceil(at));
    };
    for (int k = 0; k < 8; ++k) {
      low[k] = HUGE_VALF;
      high[k] = -HUGE_VALF;
      for (int j = end(1, k, -1); j <= end(1, k, 1); ++j) {
        for (int i = end(0, k, -1); i <= end(0, k, 1); ++i) {
          if (std::clamp(i, 0, table.n) + std::clamp(j, 0, table.n) > table.n) continue;
          low[k] = std::min(low[k], table.at(i, j));
          high[k] = std::max(high[k], table.at(i, j));
        }
      }
      if (!(low[k] <= high[k])) low[k] = high[k] = table.at(0, 0);
    }
  }
  HeightSource source() const { return {this, eval, bounds}; }
};

/// A mesh by itself.
struct TestMesh {
  std::vector<Vec3f> P;
  std::vector<Normal3f> N;
  std::vector<TriangleIndices> triangles;

  explicit TestMesh(const std::vector<oracle::DisplacedTriangle>& from)
  {
    for (const oracle::DisplacedTriangle& triangle : from) {
      const auto first = static_cast<std::uint32_t>(P.size());
      for (std::size_t k = 0; k < 3; ++k) {
        P.push_back(TracedCase::vector3(triangle.P[k]));
        const Vec3f n = TracedCase::vector3(triangle.N[k]);
        N.push_back({n.x, n.y, n.z});
      }
      triangles.push_back({first, first + 1, first + 2});
    }
  }
  MeshView view() const
  {
    MeshView mesh;
    mesh.P = P.data();
    mesh.N = N.data();
    mesh.triangles = triangles.data();
    mesh.num_vertices = static_cast<std::uint32_t>(P.size());
    mesh.num_triangles = static_cast<std::uint32_t>(triangles.size());
    return mesh;
  }
};

DisplacedGeometry geometry_of(const DisplacedMesh& mesh, const ProceduralField& field)
{
  DisplacedGeometry geometry;
  geometry.mesh = mesh.view();
  geometry.procedural = &field;
  return geometry;
}

/// The surface over one triangle as a map of the oracle: the lattice, with the plane of the last cells beyond its third side.
oracle::HeightMap lattice_map(const ProceduralField& field, int n, double scale, double midlevel)
{
  int size = 4;
  while (size < n + 2) size *= 2;
  oracle::HeightMap map{size,
                        size,
                        std::vector<double>(static_cast<std::size_t>(size * size)),
                        oracle::Wrap::kClamp,
                        oracle::Wrap::kClamp,
                        scale,
                        midlevel};
  const auto at = [&](int i, int j) -> double& { return map.h[static_cast<std::size_t>(j * size + i)]; };
  for (int j = 0; j < size; ++j) {
    for (int i = 0; i < size; ++i) {
      if (i + j <= n) {
        at(i, j) = field.lattice_height(0, i, j);
      } else if (i + j == n + 1 && i > 0 && j > 0) {
        at(i, j) = at(i - 1, j) + at(i, j - 1) - at(i - 1, j - 1);
      } else {
        at(i, j) = i > 0 ? at(i - 1, j) : at(i, j - 1);
      }
    }
  }
  return map;
}

TEST(ComputedHeights, AreFoundByRandomRaysAsByTheOracle)
{
  constexpr int kRays = 40;
  const std::uint64_t num_cases = num_test_rays(40000) / kRays;
  std::vector<Judge> judges;
  judges.emplace_back(DisplacementMethod::chord, traversal_table_baseline());
  if (&best_table() != &traversal_table_baseline()) judges.emplace_back(DisplacementMethod::chord, best_table());
  for (std::uint64_t number = 1; number <= num_cases; ++number) {
    std::mt19937_64 random(number + (test_part() << 32));
    TableSource table;
    table.n = 1 << random_index(random, 8);
    const bool is_large = table.n > 32;
    for (const double h : is_large ? random_landscape(random, table.n + 1, table.n + 1)
                                   : random_heights(random, table.n + 1, table.n + 1))
      table.h.push_back(static_cast<float>(h));
    LatticeTriangle lattice;
    lattice.n = table.n;
    for (std::int32_t& side : lattice.side_n) {
      side = table.n;
      if (random_index(random, 3) == 0) side >>= random_index(random, std::ilogb(table.n) + 1);
    }
    LatticeCache cache(kCacheBytes);
    const ProceduralField field(table.source(), {lattice}, .5f, cache);

    const double size = std::pow(10, random_between(random, -2, 2));
    oracle::DisplacedTriangle triangle = random_base_triangle(random, size);
    oracle::HeightMap map = lattice_map(field, table.n, 1, 0);
    set_random_scale(random, size * std::pow(10, random_between(random, is_large ? -3 : -2, -.5)), &map);
    const double width = map.width;
    triangle.uv = {
        {{.5 / width, .5 / width}, {(table.n + .5) / width, .5 / width}, {.5 / width, (table.n + .5) / width}}};
    const TracedCase traced({triangle}, map);
    const TestMesh mesh({triangle});
    const DisplacedMesh displaced(mesh.view(), field, {.height = {}, .scale = map.scale, .midlevel = map.midlevel});
    const DisplacedGeometry geometry = geometry_of(displaced, field);
    const JudgedTriangle judged(triangle, map);
    int k = 0;
    for (const oracle::Ray& ray : random_rays(random, triangle, map, kRays)) {
      const std::vector<oracle::Hit> roots = judged.surface.intersect_all(ray);
      const std::string label = "case " + std::to_string(number) + " ray " + std::to_string(k++);
      for (Judge& judge : judges) {
        judge.ask(&geometry);
        judge.judge(traced, 0, judged, ray, roots, label);
        judge.ask(nullptr);
      }
    }
  }
  for (const Judge& judge : judges) {
    const Judgement& found = judge.judgement();
    std::cout << "[ figures  ] " << judge.name() << ": " << found.text() << "\n";
    EXPECT_EQ(found.num_faults(), 0u) << found.text();
    EXPECT_LE(found.num_beside, found.num_rays / 10000) << found.text();
  }
}

/// Waves in object space, by a mesh's positions.
struct WaveSource {
  const MeshView* mesh;
  float frequency = 9;

  float height(Vec3f P) const
  {
    return .5f + .5f * std::sin(frequency * P.x) * std::cos(frequency * P.y + 1) * std::sin(.7f * frequency * P.z + 2);
  }
  /// With the vertices in the order of their positions, as a source must have them.
  Vec3f position(std::uint32_t triangle, const float* b) const
  {
    const TriangleIndices& v = mesh->triangles[triangle];
    std::tuple<float, float, float, float> corners[3];
    const std::uint32_t vertices[3] = {v.v0, v.v1, v.v2};
    for (int k = 0; k < 3; ++k) {
      const Vec3f P = mesh->P[vertices[k]];
      corners[k] = {P.x, P.y, P.z, b[k]};
    }
    std::sort(corners, corners + 3);
    Vec3f sum{};
    for (const auto& [x, y, z, w] : corners) sum = sum + Vec3f{x, y, z} * w;
    return sum;
  }
  static void eval(const void* owner, std::uint32_t triangle, const float (*b)[8], float* h)
  {
    const auto& waves = *static_cast<const WaveSource*>(owner);
    for (int k = 0; k < 8; ++k) {
      const float w[3] = {b[0][k], b[1][k], b[2][k]};
      h[k] = waves.height(waves.position(triangle, w));
    }
  }
  /// By the slopes, which are below 1.3 times the frequency.
  static void bounds(const void* owner, std::uint32_t triangle, const WeightPatches& p, float* low, float* high)
  {
    const auto& waves = *static_cast<const WaveSource*>(owner);
    const TriangleIndices& v = waves.mesh->triangles[triangle];
    const Vec3f e1 = waves.mesh->P[v.v1] - waves.mesh->P[v.v0], e2 = waves.mesh->P[v.v2] - waves.mesh->P[v.v0];
    for (int k = 0; k < 8; ++k) {
      const float w[3] = {1 - p.center[0][k] - p.center[1][k], p.center[0][k], p.center[1][k]};
      const float reach = length(e1 * p.du[0][k] + e2 * p.du[1][k]) + length(e1 * p.dv[0][k] + e2 * p.dv[1][k]);
      const float h = waves.height(waves.position(triangle, w)), change = 1.3f * waves.frequency * reach + 1e-5f;
      low[k] = std::max(h - change, -1e-5f);
      high[k] = std::min(h + change, 1.00001f);
    }
  }
  HeightSource source() const { return {this, eval, bounds}; }
};

/// Lines far away along x need more cells than near ones.
double cells_along(Vec3f a, Vec3f b)
{
  if (std::tie(b.x, b.y, b.z) < std::tie(a.x, a.y, a.z)) std::swap(a, b);
  const Vec3f middle = (a + b) * .5f;
  return static_cast<double>(length(b - a) * std::exp(6 + 2.5f * middle.x));
}

/// A closed surface with lattices and parts of many sizes.
struct WavySurface {
  explicit WavySurface(const ClosedSurface& from, std::size_t cache_bytes = kCacheBytes)
      : mesh(from.triangles),
        view(mesh.view()),
        source{&view},
        cache(cache_bytes),
        field(source.source(), lattices_make(view, cells_along), .5f, cache),
        displaced(view, field, {.height = {}, .scale = .2, .midlevel = .5}),
        geometry(geometry_of(displaced, field))
  {
  }
  TestMesh mesh;
  MeshView view;
  WaveSource source;
  LatticeCache cache;
  ProceduralField field;
  DisplacedMesh displaced;
  DisplacedGeometry geometry;
};

TEST(ComputedHeights, LetNoRayOut)
{
  for (const ClosedSurface& surface : {closed_sphere(), closed_torus()}) {
    const WavySurface wavy(surface);
    EXPECT_GT(wavy.field.triangles().size(), surface.triangles.size());
    DisplacedScene scene(wavy.geometry, best_table());
    std::mt19937_64 random(97 + (test_part() << 32));
    Leaks leaks;
    const std::uint64_t num_rays = num_test_rays(60000) / 2;
    for (std::uint64_t k = 0; k < num_rays; ++k) {
      // Half of them through corners and sides of parts.
      oracle::Ray ray = ray_from_inside(random, surface);
      if (k % 2 == 0) {
        const DisplacedMeshView traced = wavy.geometry.mesh;
        const auto index = static_cast<std::uint32_t>(random_index(random, static_cast<int>(traced.num_triangles)));
        const double along =
            random_index(random, 2) == 0 ? std::floor(random_unit(random) * 65) / 64 : random_unit(random);
        const double b[3][2] = {{along, 0}, {0, along}, {along, 1 - along}};
        const double* at = b[random_index(random, 3)];
        const SurfacePoint point =
            displaced_surface_point(wavy.geometry, index, {static_cast<float>(at[0]), static_cast<float>(at[1])});
        ray = ray_through(surface.inside(random), {point.P.x, point.P.y, point.P.z});
      }
      leaks.trace(scene, ray);
    }
    leaks.expect_none(surface.name);
  }
}

TEST(ComputedHeights, AreTheSameHoweverFewAreKept)
{
  const ClosedSurface surface = closed_torus();
  const WavySurface roomy(surface, std::size_t{256} << 20), narrow(surface, 1);  // one set of tiles
  std::mt19937_64 random(5);
  std::vector<oracle::Ray> rays;
  for (int k = 0; k < 4000; ++k) rays.push_back(ray_from_inside(random, surface));
  std::vector<float> expected(rays.size()), found(rays.size());
  const auto trace = [&](const WavySurface& of, std::vector<float>& out) {
    // Many threads ask for the same tiles, and take them from each other.
    tbb::parallel_for(0, 16, [&](int part) {
      DisplacedScene scene(of.geometry, best_table());
      for (std::size_t k = static_cast<std::size_t>(part); k < rays.size(); k += 16) out[k] = scene.intersect(rays[k]);
    });
  };
  for (int round = 0; round < 3; ++round) {
    trace(roomy, expected);
    trace(narrow, found);
    ASSERT_EQ(expected, found);
  }
  EXPECT_GT(narrow.cache.tiles.num_made(), roomy.cache.tiles.num_made());
  EXPECT_LT(narrow.cache.bytes(), roomy.cache.bytes());
}

TEST(ComputedHeights, OfTrianglesAgreeAlongTheirSides)
{
  for (const ClosedSurface& surface : {closed_sphere(), closed_torus()}) {
    const WavySurface wavy(surface);
    // By the ends of a side: its cells, and the heights at them.
    std::map<std::vector<float>, std::set<std::vector<float>>> sides;
    for (std::uint32_t index = 0; index < wavy.geometry.mesh.num_triangles; ++index) {
      const LatticeTriangle& lattice = wavy.field.triangles()[index];
      const DisplacedTriangle& tri = wavy.geometry.mesh.triangles[index];
      for (int k = 0; k < 3; ++k) {
        Vec3f a = tri.P[k], b = tri.P[(k + 1) % 3];
        const bool turned = std::tie(b.x, b.y, b.z) < std::tie(a.x, a.y, a.z);
        const std::int32_t n = lattice.n, cells = lattice.side_n[k];
        std::vector<float> heights;
        for (std::int32_t at = 0; at <= cells; ++at) {
          const std::int32_t along = (turned ? cells - at : at) * (n / cells);
          heights.push_back(k == 0   ? wavy.field.lattice_height(index, along, 0)
                            : k == 1 ? wavy.field.lattice_height(index, n - along, along)
                                     : wavy.field.lattice_height(index, 0, n - along));
        }
        if (turned) std::swap(a, b);
        sides[{a.x, a.y, a.z, b.x, b.y, b.z}].insert(heights);
      }
    }
    for (const auto& [side, heights] : sides) ASSERT_EQ(heights.size(), 1u) << surface.name;
  }
}

TEST(ComputedHeights, OfTilesAreThoseOfTheLattice)
{
  const WavySurface wavy(closed_torus());
  std::mt19937_64 random(6);
  for (int k = 0; k < 20000; ++k) {
    const auto index =
        static_cast<std::uint32_t>(random_index(random, static_cast<int>(wavy.field.triangles().size())));
    const std::int32_t n = wavy.field.triangles()[index].n;
    std::int32_t i = random_index(random, n + 1), j = random_index(random, n + 1);
    if (i + j > n) i = n - i, j = n - j;
    const std::int32_t last = (n - 1) / kTileCells, tile_i = std::min(i / kTileCells, last),
                       tile_j = std::min(j / kTileCells, last);
    const HeightTileCache::Pin tile = wavy.field.tile(index, tile_i, tile_j);
    const double h = lattice_height(tile.tile().field, i - tile_i * kTileCells + 1, j - tile_j * kTileCells + 1);
    ASSERT_EQ(static_cast<float>(h), wavy.field.lattice_height(index, i, j)) << n << " " << i << " " << j;
  }
}

TEST(ComputedHeights, OfNodesAreWithinTheirBounds)
{
  const WavySurface wavy(closed_torus());
  std::mt19937_64 random(7);
  int num_nodes = 0;
  for (int k = 0; k < 20000; ++k) {
    const auto index =
        static_cast<std::uint32_t>(random_index(random, static_cast<int>(wavy.field.triangles().size())));
    const std::int32_t n = wavy.field.triangles()[index].n;
    std::int32_t i = random_index(random, n + 1), j = random_index(random, n + 1);
    if (i + j > n) i = n - i, j = n - j;
    const float h = wavy.field.lattice_height(index, i, j);
    const LatticeRange whole = wavy.field.range(index);
    ASSERT_TRUE(h >= whole.low && h <= whole.high);
    // Every node whose square has the point, on its border too.
    for (LatticeNode node = wavy.field.root(index); node.level > 0;) {
      LatticeRange children[4];
      wavy.field.children(index, node, children);
      const std::int32_t size = kTileCells << (node.level - 1);
      LatticeNode next = node;
      for (int child = 0; child < 4; ++child) {
        const std::int32_t i0 = (2 * node.i + (child & 1)) * size, j0 = (2 * node.j + (child >> 1)) * size;
        if (i < i0 || i > i0 + size || j < j0 || j > j0 + size || i0 + j0 >= n) continue;
        ASSERT_TRUE(h >= children[child].low && h <= children[child].high)
            << h << " at " << i << " " << j << " of " << n;
        next = {node.level - 1, 2 * node.i + (child & 1), 2 * node.j + (child >> 1)};
        ++num_nodes;
      }
      if (next.level == node.level) break;
      node = next;
    }
  }
  EXPECT_GT(num_nodes, 1000);
}

/// A square of so many quads a side, whose normals are along z.
std::vector<oracle::DisplacedTriangle> square_of_quads(int num_quads)
{
  const auto vertex = [&](int i, int j) {
    return oracle::Vector3{static_cast<double>(i) / num_quads, static_cast<double>(j) / num_quads, 0};
  };
  std::vector<oracle::DisplacedTriangle> triangles;
  for (int j = 0; j < num_quads; ++j) {
    for (int i = 0; i < num_quads; ++i) {
      for (const bool upper : {false, true}) {
        oracle::DisplacedTriangle triangle;
        triangle.P = {vertex(upper ? i + 1 : i, upper ? j + 1 : j), upper ? vertex(i, j + 1) : vertex(i + 1, j),
                      upper ? vertex(i + 1, j) : vertex(i, j + 1)};
        triangle.N = {{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}};
        triangles.push_back(triangle);
      }
    }
  }
  return triangles;
}

/// Smooth normals are those of the height function, whether a square is many triangles of one cell or few of many.
TEST(ComputedHeights, AreShadedAlikeHoweverFewTheirCells)
{
  for (const int num_cells : {1, 2, 4, 8, 64}) {
    const TestMesh mesh(square_of_quads(64 / num_cells));
    const MeshView view = mesh.view();
    const WaveSource waves{&view};
    LatticeCache cache(kCacheBytes);
    const ProceduralField field(waves.source(), lattices_make(view, num_cells), .5f, cache);
    const double scale = .2;
    const DisplacedMesh displaced(view, field, {.height = {}, .scale = scale, .midlevel = .5});
    const DisplacedGeometry geometry = geometry_of(displaced, field);
    std::mt19937_64 random(31);
    double largest = 0;
    Vec3d mean{}, expected_mean{};
    for (int k = 0; k < 20000; ++k) {
      const auto index = static_cast<std::uint32_t>(random_index(random, static_cast<int>(view.num_triangles)));
      const oracle::Vector2 b = random_barycentric(random);
      const float b1 = static_cast<float>(b[0]), b2 = static_cast<float>(b[1]);
      const Vec3d found = displaced_smooth_normal(geometry, index, {b1, b2});
      const float w[3] = {1 - b1 - b2, b1, b2};
      const Vec3d P = to_double(waves.position(index, w));
      const double f = 9, sine_z = .5 * std::sin(2.0);
      Vec3d expected{-scale * f * std::cos(f * P.x) * std::cos(f * P.y + 1) * sine_z,
                     scale * f * std::sin(f * P.x) * std::sin(f * P.y + 1) * sine_z, 1};
      expected = expected * (1 / length(expected));
      largest = std::max(largest, length(found - expected));
      mean = mean + found;
      expected_mean = expected_mean + expected;
    }
    // Slopes over a 64th to either side, and linear between: of waves of this length off by a 160th.
    EXPECT_LT(largest, .01) << num_cells << " cells a side";
    EXPECT_LT(length(mean - expected_mean) / 20000, 2e-3) << num_cells << " cells a side";
  }
}

TEST(ComputedHeights, WithoutKnownBoundsAreCutOff)
{
  const TestMesh mesh({hard_case_parts::flat_triangle()});
  const MeshView view = mesh.view();
  WaveSource waves{&view};
  HeightSource source = waves.source();
  source.bounds = [](const void*, std::uint32_t, const WeightPatches&, float* low, float* high) {
    std::fill_n(low, 8, -HUGE_VALF);
    std::fill_n(high, 8, HUGE_VALF);
  };
  LatticeCache cache(kCacheBytes);
  const ProceduralField field(source, lattices_make(view, 64), .5f, cache);
  EXPECT_TRUE(field.is_sampled());
  const LatticeRange range = field.range(0);
  EXPECT_TRUE(std::isfinite(range.low) && std::isfinite(range.high));
  for (int i = 0; i <= 64; ++i) {
    const float h = field.lattice_height(0, i, 64 - i);
    EXPECT_TRUE(h >= range.low && h <= range.high);
  }
}

TEST(ComputedHeights, ThatAreNoNumbersAreTheMidlevel)
{
  const TestMesh mesh({hard_case_parts::flat_triangle()});
  HeightSource source{nullptr, [](const void*, std::uint32_t, const float(*)[8], float* h) { std::fill_n(h, 8, NAN); },
                      [](const void*, std::uint32_t, const WeightPatches&, float* low, float* high) {
                        std::fill_n(low, 8, 0.0f);
                        std::fill_n(high, 8, 1.0f);
                      }};
  LatticeCache cache(kCacheBytes);
  const ProceduralField field(source, lattices_make(mesh.view(), 4), .25f, cache);
  EXPECT_EQ(field.lattice_height(0, 1, 2), .25f);
}

}  // namespace
}  // namespace relief
