// Points that vectors or heights move, in tiles that rays ask for: the points, boxes, hits and normals of the mesh that divides the same lattices.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "displacement/cpu.h"
#include "displacement/embree_geometry.h"
#include "displacement/lattice_split.h"
#include "displacement/moved_mesh.h"
#include "displacement/point_tiles.h"
#include "kernel/shape/surface_hit.h"
#include "tests/oracle/triangle_tree.h"
#include "tests/support/test_rays.h"

namespace relief {
namespace {

constexpr double kPi = 3.14159265358979323846;

const TraversalTable& best_table() { return cpu_has_avx2() ? traversal_table_avx2() : traversal_table_baseline(); }

/// Of all instruction sets that the machine has.
std::vector<const TraversalTable*> tables()
{
  std::vector<const TraversalTable*> out{&traversal_table_baseline()};
  if (&best_table() != out[0]) out.push_back(&best_table());
  return out;
}

double between(std::mt19937_64& random, double low, double high)
{
  return std::uniform_real_distribution<double>(low, high)(random);
}

Vec3d direction(std::mt19937_64& random)
{
  const double z = between(random, -1, 1), phi = between(random, 0, 2 * kPi), r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

/// Where a point goes, from its place, and its triangle and weights, which differ on the two sides of an edge.
using Move = std::function<Vec3d(Vec3d, std::uint32_t, double)>;

/// Rolls waves of a ball or a torus over: overhangs.
Vec3d curl(Vec3d P, std::uint32_t, double)
{
  const double wave = 9 * (P.x + P.y) + 7 * P.z;
  return .06 * Vec3d{std::sin(2 * wave), std::cos(wave + 5 * P.z), std::sin(wave) * std::cos(3 * P.y)};
}

/// Heights from −.75 to 1.25.
Vec3d waves(Vec3d P, std::uint32_t, double)
{
  return {.25 + std::sin(11 * P.x + 5 * P.z) * std::cos(9 * P.y - 7 * P.z), 0, 0};
}

struct TorusParts {
  bool has_line = true;  ///< one of its triangles has two corners in one place
  bool has_cut = true;   ///< its first row has normals of its own
};

/// A torus around the z axis, of a few triangles, whose points move.
class MovedTorus {
 public:
  static constexpr int kNumAround = 6, kNumTube = 5;
  static constexpr double kRadius = 1, kTube = .4;

  /// @param along  points move along normals, by what `move` gives along x
  MovedTorus(Move move, bool along, const CellsAlong& cells, TorusParts has = {})
      : move_(std::move(move)), along_(along), has_line_(has.has_line)
  {
    const auto corner = [&](int i, int j, bool turned) {
      const double phi = 2 * kPi * (i % kNumAround) / kNumAround, psi = 2 * kPi * (j % kNumTube) / kNumTube;
      const Vec3d N{std::cos(psi) * std::cos(phi), std::cos(psi) * std::sin(phi), std::sin(psi)};
      P_.push_back(to_float(Vec3d{std::cos(phi), std::sin(phi), 0} * kRadius + N * kTube));
      N_.push_back(as_normal(to_float(turned ? N + Vec3d{.1, .2, .3} : N)));
      return static_cast<std::uint32_t>(P_.size() - 1);
    };
    for (int i = 0; i < kNumAround; ++i) {
      for (int j = 0; j < kNumTube; ++j) {
        const bool cut = has.has_cut && i == 0 && j < 2;
        const std::uint32_t a = corner(i, j, cut), b = corner(i + 1, j, cut), c = corner(i + 1, j + 1, cut),
                            d = corner(i, j + 1, cut);
        triangles_.push_back({a, b, c});
        triangles_.push_back({c, d, a});
      }
    }
    // A triangle with two corners in one place: whatever moves its points, it stays a line.
    const std::uint32_t a = corner(0, 0, false), b = corner(1, 0, false), c = corner(1, 0, false);
    if (has_line_) triangles_.push_back({a, b, c});
    mesh_.P = P_.data();
    mesh_.N = N_.data();
    mesh_.triangles = triangles_.data();
    mesh_.num_vertices = static_cast<std::uint32_t>(P_.size());
    mesh_.num_triangles = static_cast<std::uint32_t>(triangles_.size());
    parts_ = lattices_make(mesh_, cells);
    whole_ = along_ ? divided_mesh_make(mesh_, heights(), parts_, by())
                    : divided_mesh_make(mesh_, moves(), parts_, true, {});
    view_ = whole_.view(mesh_);
    for (const LatticeTriangle& part : parts_) {
      const auto n = static_cast<std::uint32_t>(part.n);
      first_vertex_.push_back(next_vertex_);
      next_vertex_ += (n + 1) * (n + 2) / 2;
    }
  }
  MovedTorus(const MovedTorus&) = delete;
  MovedTorus& operator=(const MovedTorus&) = delete;

  std::unique_ptr<PointTiles> tiled(PointTileCache& cache) const
  {
    PointMover mover = along_ ? point_mover_make(heights(), by()) : point_mover_make(moves());
    return std::make_unique<PointTiles>(mesh_, std::move(mover), parts_, true, cache, 5);
  }
  const std::vector<LatticeTriangle>& parts() const { return parts_; }
  /// A triangle without area; ~0: there is none.
  std::uint32_t line() const { return has_line_ ? mesh_.num_triangles - 1 : ~0u; }
  const MeshView& whole() const { return view_; }
  std::uint32_t vertex(std::uint32_t part, std::int32_t i, std::int32_t j) const
  {
    return first_vertex_[part] + static_cast<std::uint32_t>(j * (parts_[part].n + 1) - j * (j - 1) / 2 + i);
  }
  /// A point within the torus, however it is displaced by `curl` or `waves`.
  static Vec3d inside(std::mt19937_64& random)
  {
    const double phi = between(random, 0, 2 * kPi);
    return Vec3d{std::cos(phi), std::sin(phi), 0} * .95 + .05 * direction(random);
  }

 private:
  static VertexDisplacement by() { return {.1, .25f, true}; }
  PointMoves moves() const
  {
    return {this,
            [](const void* owner, std::uint32_t triangle, const float(*b)[8], Vec3f* moves) {
              for (int k = 0; k < 8; ++k)
                moves[k] = to_float(static_cast<const MovedTorus*>(owner)->move(triangle, b, k));
            },
            nullptr};
  }
  HeightSource heights() const
  {
    return {this, [](const void* owner, std::uint32_t triangle, const float(*b)[8], float* h) {
              for (int k = 0; k < 8; ++k)
                h[k] = static_cast<float>(static_cast<const MovedTorus*>(owner)->move(triangle, b, k).x);
            }};
  }
  Vec3d move(std::uint32_t triangle, const float (*b)[8], int k) const
  {
    const TriangleIndices& t = triangles_[triangle];
    const Vec3d P = static_cast<double>(b[0][k]) * to_double(P_[t.v0]) +
                    static_cast<double>(b[1][k]) * to_double(P_[t.v1]) +
                    static_cast<double>(b[2][k]) * to_double(P_[t.v2]);
    return move_(P, triangle, static_cast<double>(b[1][k]));
  }

  Move move_;
  bool along_, has_line_;
  std::vector<Vec3f> P_;
  std::vector<Normal3f> N_;
  std::vector<TriangleIndices> triangles_;
  MeshView mesh_, view_;
  std::vector<LatticeTriangle> parts_;
  MovedMesh whole_;
  std::vector<std::uint32_t> first_vertex_;
  std::uint32_t next_vertex_ = 0;
};

/// Some triangles have lattices up to sixteen times as fine as their neighbours'.
double uneven(Vec3f a, Vec3f b)
{
  const Vec3f middle = 0.5f * (a + b);
  return 6 * std::exp2(static_cast<double>(1.5f + 1.5f * middle.x)) * static_cast<double>(length(b - a));
}

/// The tree over a torus' tiles.
class Tree {
 public:
  explicit Tree(const PointTiles& tiles, const TraversalTable& table = best_table())
      : device_(rtcNewDevice("threads=1")), scene_(rtcNewScene(device_))
  {
    geometry_.tiles = &tiles;
    RTCGeometry geometry = displaced_geometry_make(device_, geometry_, table);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene_, geometry, 0);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
  }
  ~Tree()
  {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  Tree(const Tree&) = delete;
  Tree& operator=(const Tree&) = delete;

  RTCRayHit intersect(Vec3d O, Vec3d D) const
  {
    RTCRayHit query{};
    query.ray = ray(O, D);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    EmbreeContext context;
    embree_context_init(context, false);
    embree_intersect1(scene_, context, query);
    return query;
  }
  bool occluded(Vec3d O, Vec3d D) const
  {
    RTCRay query = ray(O, D);
    EmbreeContext context;
    embree_context_init(context, false);
    embree_occluded1(scene_, context, query);
    return query.tfar < 0;
  }

 private:
  static RTCRay ray(Vec3d O, Vec3d D)
  {
    RTCRay query{};
    const Vec3f o = to_float(O), d = to_float(D);
    query.org_x = o.x, query.org_y = o.y, query.org_z = o.z;
    query.dir_x = d.x, query.dir_y = d.y, query.dir_z = d.z;
    query.tfar = kInfinity;
    query.mask = ~0u;
    return query;
  }
  RTCDevice device_;
  RTCScene scene_;
  DisplacedGeometry geometry_;
};

bool is_hit(const RTCRayHit& query) { return query.hit.geomID != RTC_INVALID_GEOMETRY_ID; }

struct Case {
  const char* name;
  Move move;
  CellsAlong cells;
  bool along = false;    ///< heights move points
  bool is_flat = false;  ///< sums of normals are what rounding leaves of them
};

std::vector<Case> cases()
{
  return {{"overhangs on uneven lattices", curl, uneven},
          {"overhangs on one triangle each", curl, [](Vec3f, Vec3f) { return 1.0; }},
          {"nothing moves", [](Vec3d, std::uint32_t, double) { return Vec3d{}; }, [](Vec3f, Vec3f) { return 20.0; }},
          // The sides of an edge disagree: the first of them counts.
          {"another vector on each triangle",
           [](Vec3d P, std::uint32_t triangle, double b) {
             return curl(P, 0, 0) + Vec3d{.002 * triangle, .03 * b, 0};
           },
           uneven},
          {"all in one place along y",
           [](Vec3d P, std::uint32_t, double) {
             return Vec3d{0, -P.y, 0};
           },
           uneven, false, true},
          {"heights on uneven lattices", waves, uneven, true},
          // As those of a graph over texture coordinates may, where these are cut.
          {"heights of each triangle's own",
           [](Vec3d P, std::uint32_t triangle, double b) {
             return waves(P, 0, 0) + Vec3d{.005 * triangle + .1 * b, 0, 0};
           },
           uneven, true}};
}

TEST(PointTiles, HaveThePointsOfADividedMesh)
{
  for (const Case& c : cases()) {
    const MovedTorus torus(c.move, c.along, c.cells);
    PointTileCache cache(1 << 24);
    const auto tiled = torus.tiled(cache);
    std::size_t num_points = 0;
    for (std::uint32_t part = 0; part < torus.parts().size(); ++part) {
      if (torus.parts()[part].base == torus.line()) continue;
      const std::int32_t n = torus.parts()[part].n;
      for (std::int32_t j = 0; j <= n; ++j) {
        for (std::int32_t i = 0; i + j <= n; ++i) {
          const Vec3f P = torus.whole().P[torus.vertex(part, i, j)], Q = tiled->point(part, i, j);
          ASSERT_EQ(0, std::memcmp(&P, &Q, sizeof P)) << c.name << ' ' << part << ' ' << i << ' ' << j;
          ++num_points;
        }
      }
    }
    EXPECT_GT(num_points, 100u);
  }
}

/// Every triangle of every tile, in the middle and beside its corners.
TEST(PointTiles, AreShadedAsADividedMesh)
{
  const float weights[][2] = {{.3f, .3f}, {.01f, .01f}, {.98f, .01f}, {.01f, .98f}};
  InstanceView placed;
  placed.world_from_object = {{1, 0, 0}, {0, 2, 0}, {0, 0, .5f}, {.1f, .2f, .3f}};
  placed.object_from_world = {{1, 0, 0}, {0, .5f, 0}, {0, 0, 2}, {-.1f, -.1f, -.6f}};
  for (const Case& c : cases()) {
    // The divided mesh has normals of what rounding leaves of a line's triangles.
    const MovedTorus torus(c.move, c.along, c.cells, {.has_line = false});
    PointTileCache cache(1 << 24);
    const auto tiled = torus.tiled(cache);
    const MeshView& whole = torus.whole();
    std::uint32_t tile = 0;
    std::size_t num_seen = 0;
    float most_lift = 0;
    for (std::uint32_t part = 0; part < torus.parts().size(); ++part) {
      const LatticeTriangle& lattice = torus.parts()[part];
      for (std::int32_t j0 = 0; j0 < lattice.n; j0 += PointTile::kCells) {
        for (std::int32_t i0 = 0; i0 + j0 < lattice.n; i0 += PointTile::kCells, ++tile) {
          for (int number = 0; number < 2 * PointTile::kCells * PointTile::kCells; ++number) {
            const int cell = number / 2, second = number % 2;
            const std::int32_t i = i0 + cell % PointTile::kCells, j = j0 + cell / PointTile::kCells;
            if (i + j + second >= lattice.n) continue;
            const std::uint32_t v[3] = {torus.vertex(part, i + second, j + second),
                                        torus.vertex(part, i + 1 - second, j + second),
                                        torus.vertex(part, i + second, j + 1 - second)};
            const Vec3d P[3] = {to_double(whole.P[v[0]]), to_double(whole.P[v[1]]), to_double(whole.P[v[2]])};
            const Vec3d normal = cross(P[1] - P[0], P[2] - P[0]);
            if (!(length(normal) > 1e-12)) continue;
            for (const auto& w : weights) {
              const DisplacedPoint at = tiled->resolve(placed, tile, {w[0], w[1], static_cast<float>(number)});
              const double b[3] = {1 - static_cast<double>(w[0]) - static_cast<double>(w[1]), w[0], w[1]};
              Vec3d there{}, smooth{};
              for (int k = 0; k < 3; ++k) {
                there = there + b[k] * P[k];
                smooth = smooth + b[k] * to_double(as_vector(whole.N[v[k]]));
              }
              ASSERT_LT(length(to_double(at.P) - there), 1e-6) << c.name;
              ASSERT_GT(dot(to_double(at.Ng), normal), (1 - 1e-6) * length(normal)) << c.name;
              if (!c.is_flat && length(smooth) > .01) {
                MeshView there_alone = whole;
                const TriangleIndices triangle{v[0], v[1], v[2]};
                there_alone.triangles = &triangle;
                const SurfaceHit hit = surface_hit_make(there_alone, placed, 0, w[0], w[1]);
                ASSERT_LT(length(at.lift.N - hit.lift.N), 1e-4f) << c.name;
                ASSERT_NEAR(at.lift.front, hit.lift.front, 1e-6f + 1e-4f * hit.lift.front) << c.name;
                ASSERT_NEAR(at.lift.back, hit.lift.back, 1e-6f - 1e-4f * hit.lift.back) << c.name;
                most_lift = std::max(most_lift, hit.lift.front);
                ASSERT_GT(dot(to_double(at.Ns), smooth), (1 - 1e-5) * length(smooth))
                    << c.name << " part " << part << " n " << lattice.n << " cell " << i << ' ' << j << ' ' << second;
              }
              ASSERT_EQ(at.triangle, lattice.base);
              ++num_seen;
            }
          }
        }
      }
    }
    EXPECT_EQ(tile, tiled->num_tiles());
    EXPECT_GT(num_seen, 100u) << c.name;
    EXPECT_TRUE(c.is_flat || most_lift > 1e-3f) << c.name;
  }
}

/// For failures: where a ray went, what was found and what is there.
std::string ray_text(Vec3d O, Vec3d D, double found, double there)
{
  char text[256];
  std::snprintf(text, sizeof text, ": from %.9g %.9g %.9g along %.9g %.9g %.9g, met at %.12g in place of %.12g", O.x,
                O.y, O.z, D.x, D.y, D.z, found, there);
  return text;
}

/// No origin is farther from what it meets.
constexpr double kFarthest = 3.2;

/// Beside all triangles in double precision.
TEST(PointTiles, AreMetWhereTheirTrianglesAre)
{
  const std::uint64_t num_rays = num_test_rays(1500);
  for (const Case& c : cases()) {
    const MovedTorus torus(c.move, c.along, c.cells);
    PointTileCache cache(1 << 24);
    const auto tiled = torus.tiled(cache);
    std::vector<std::unique_ptr<Tree>> trees;
    for (const TraversalTable* table : tables()) trees.push_back(std::make_unique<Tree>(*tiled, *table));
    const auto vector_of = [](Vec3d v) { return oracle::Vector3{v.x, v.y, v.z}; };
    std::vector<std::array<oracle::Vector3, 3>> triangles;
    for (std::uint32_t k = 0; k < torus.whole().num_triangles; ++k) {
      const TriangleIndices t = torus.whole().triangles[k];
      const auto at = [&](std::uint32_t v) { return vector_of(to_double(torus.whole().P[v])); };
      triangles.push_back({at(t.v0), at(t.v1), at(t.v2)});
    }
    // Within 1.7° of edge-on, rounding of a corner moves the place that is met by more than is allowed here.
    constexpr double kLeastSine = .03;
    const oracle::TriangleTree doubles(std::move(triangles), 1e-5, kLeastSine);
    std::mt19937_64 random(7 + test_part());
    std::uint64_t num_hits = 0, num_unclear = 0, num_missed = 0, num_invented = 0, num_shadows_unlike = 0;
    std::string first_missed, first_invented;
    for (std::uint64_t ray = 0; ray < num_rays; ++ray) {
      const Vec3d O = to_double(to_float(2.0 * direction(random)));
      Vec3d D = to_double(to_float(MovedTorus::inside(random) + .6 * direction(random) - O));
      if (ray % 10 == 0) D.y = 0;  // within the plane of what is flat
      if (ray % 10 == 1) D.x = D.z = 0;
      const oracle::NearestTriangle nearest = doubles.nearest(vector_of(O), vector_of(D));
      // Six roundings, of three corners along the ray and across it, make a length; of a short D even the last bit of t is more than
      // any number would allow.
      const double most_off = 6 * 0x1p-24 * kFarthest / kLeastSine / length(D);
      if (nearest.maybe != nearest.t) ++num_unclear;
      for (const auto& tree : trees) {
        const RTCRayHit hit = tree->intersect(O, D);
        const double t = is_hit(hit) ? static_cast<double>(hit.ray.tfar) : HUGE_VAL;
        if (nearest.t < HUGE_VAL && !(t < nearest.t + most_off)) {
          if (num_missed++ == 0) first_missed = ray_text(O, D, t, nearest.t);
        }
        if (is_hit(hit) && !(t > nearest.maybe - most_off)) {
          if (num_invented++ == 0) first_invented = ray_text(O, D, t, nearest.maybe);
        }
        if (tree->occluded(O, D) != is_hit(hit)) ++num_shadows_unlike;
        num_hits += is_hit(hit) ? 1 : 0;
      }
    }
    EXPECT_EQ(num_missed, 0u) << c.name << first_missed;
    EXPECT_EQ(num_invented, 0u) << c.name << first_invented;
    EXPECT_EQ(num_shadows_unlike, 0u) << c.name;
    // Some of what is met is seen edge-on.
    EXPECT_LT(num_unclear, num_rays / 10) << c.name;
    // What is flat is met from the side at times.
    EXPECT_GT(num_hits, num_rays / 10) << c.name;
  }
}

/// Half of the rays to points and sides, where Embree's triangles let some through.
void expect_no_ray_out(const MovedTorus& torus, std::uint64_t num_rays)
{
  PointTileCache cache(1 << 24);
  const auto tiled = torus.tiled(cache);
  std::vector<std::unique_ptr<Tree>> trees;
  for (const TraversalTable* table : tables()) trees.push_back(std::make_unique<Tree>(*tiled, *table));
  std::mt19937_64 random(5 + test_part());
  for (std::uint64_t k = 0; k < num_rays; ++k) {
    const Vec3d O = to_double(to_float(MovedTorus::inside(random)));
    Vec3d D = direction(random);
    if (k % 2 == 0) {
      const std::uint32_t number =
          std::uniform_int_distribution<std::uint32_t>(0, torus.whole().num_triangles - 1)(random);
      const TriangleIndices t = torus.whole().triangles[number];
      const Vec3d P = to_double(torus.whole().P[t.v0]), Q = to_double(torus.whole().P[t.v1]);
      D = P - O;
      if (k % 4 == 0) D = D + between(random, 0, 1) * (Q - P);
    }
    const Tree& tree = *trees[k / 8 % trees.size()];
    ASSERT_TRUE(is_hit(tree.intersect(O, D))) << k;
    ASSERT_TRUE(tree.occluded(O, D)) << k;
  }
}

TEST(PointTiles, LetNoRayOut)
{
  const std::uint64_t num_rays = num_test_rays(1000000);
  expect_no_ray_out(MovedTorus(curl, false, uneven), num_rays / 2);
  // Where normals differ heights move borders apart.
  expect_no_ray_out(MovedTorus(waves, true, uneven, {.has_cut = false}), num_rays / 2);
}

/// Points of one place go their own ways where its normals differ, and together where these are the same: as in the divided mesh, the
/// border opens or stays closed.
TEST(PointTiles, OpenABorderWhereItsNormalsDiffer)
{
  const Vec3f P[] = {{0, -1, 0}, {0, 1, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {1, 0, 0}};
  const TriangleIndices triangles[] = {{0, 1, 2}, {3, 4, 5}};
  const HeightSource heights{nullptr,
                             [](const void*, std::uint32_t, const float(*)[8], float* h) { std::fill_n(h, 8, 1.0f); }};
  for (const bool same : {false, true}) {
    const float lean = same ? 0 : 1;
    const Normal3f N[] = {{-lean, 0, 1}, {-lean, 0, 1}, {-lean, 0, 1}, {lean, 0, 1}, {lean, 0, 1}, {lean, 0, 1}};
    MeshView mesh;
    mesh.P = P;
    mesh.N = N;
    mesh.triangles = triangles;
    mesh.num_vertices = 6;
    mesh.num_triangles = 2;
    const std::vector<LatticeTriangle> parts = lattices_make(mesh, 32);
    const VertexDisplacement by{.1, 0, true};
    PointTileCache cache(1 << 24);
    const PointTiles tiles(mesh, point_mover_make(heights, by), parts, true, cache, 0);
    const MovedMesh whole = divided_mesh_make(mesh, heights, parts, by);
    float least = kInfinity;  // of the whole mesh, from the border
    for (const Vec3f& at : whole.P) least = std::min(least, std::abs(at.x));
    EXPECT_NEAR(least, same ? 0 : .1 / std::sqrt(2.0), 1e-6);
    const Tree tree(tiles);
    std::mt19937_64 random(9);
    for (int k = 0; k < 10000; ++k) {
      const Vec3d O{between(random, -.2, .2), between(random, -.7, .7), 3};
      const double inside = std::abs(O.x) - static_cast<double>(least);
      if (!same && std::abs(inside) < 1e-5) continue;
      ASSERT_EQ(is_hit(tree.intersect(O, {0, 0, -1})), same || inside > 0) << O.x << ' ' << O.y;
    }
  }
}

/// Rays that leave a point start as far from it as floats err there, which is nothing at 0.
TEST(PointTiles, LevelGroundAtZeroIsLeft)
{
  const Vec3f P[] = {{-1, -.7f, 0}, {1.3f, -1, 0}, {.2f, 1.1f, 0}};
  const TriangleIndices triangle{0, 1, 2};
  MeshView mesh;
  mesh.P = P;
  mesh.triangles = &triangle;
  mesh.num_vertices = 3;
  mesh.num_triangles = 1;
  const PointMoves moves{
      nullptr, [](const void*, std::uint32_t, const float(*)[8], Vec3f* out) { std::fill_n(out, 8, Vec3f{}); },
      nullptr};
  PointTileCache cache(1 << 24);
  const PointTiles tiles(mesh, point_mover_make(moves), lattices_make(mesh, 64), false, cache, 0);
  for (const TraversalTable* table : tables()) {
    const Tree tree(tiles, *table);
    std::mt19937_64 random(9);
    for (int k = 0; k < 100000; ++k) {
      const Vec3d O{between(random, -.3, .3), between(random, -.3, .3), std::exp2(-between(random, 20, 60))};
      Vec3d D = direction(random);
      D.z = std::abs(D.z) * std::exp2(-between(random, 0, 10));
      ASSERT_FALSE(is_hit(tree.intersect(O, D))) << k;
      ASSERT_FALSE(tree.occluded(O, D)) << k;
      D.z = -D.z;
      ASSERT_TRUE(is_hit(tree.intersect(O, D))) << k;
    }
  }
}

TEST(PointTiles, AreTheSameForEveryCacheAndNumberOfThreads)
{
  const MovedTorus torus(curl, false, uneven);
  struct Answer {
    std::uint32_t primitive;
    float u, v, t, number;
    Vec3f P, Ns;
    bool operator==(const Answer&) const = default;
  };
  constexpr int kRays = 4000;
  std::uint64_t num_evicted = 0;
  const auto answers = [&](std::size_t bytes, int num_threads, bool in_turn) {
    PointTileCache cache(bytes);
    const auto tiled = torus.tiled(cache);
    const Tree tree(*tiled);
    std::vector<Answer> out(kRays);
    std::atomic<int> next{0};
    const auto work = [&] {
      for (int k; (k = next++) < kRays;) {
        const int index = in_turn ? k : kRays - 1 - k;
        std::mt19937_64 random(static_cast<std::uint64_t>(index));
        const Vec3d O = 3.0 * direction(random), D = MovedTorus::inside(random) - O;
        const RTCRayHit hit = tree.intersect(O, D);
        if (!is_hit(hit)) continue;
        const InstanceView here;
        const DisplacedPoint at = tiled->resolve(here, hit.hit.primID, {hit.hit.u, hit.hit.v, hit.hit.Ng_x});
        out[static_cast<std::size_t>(index)] = {hit.hit.primID, hit.hit.u, hit.hit.v, hit.ray.tfar,
                                                hit.hit.Ng_x,   at.P,      at.Ns};
      }
    };
    std::vector<std::thread> threads;
    for (int k = 0; k < num_threads; ++k) threads.emplace_back(work);
    for (std::thread& thread : threads) thread.join();
    num_evicted = cache.num_evicted();
    EXPECT_LE(cache.bytes(), std::max(bytes, 8 * sizeof(PointTile)));
    return out;
  };
  const std::vector<Answer> expected = answers(1 << 26, 1, true);
  EXPECT_EQ(num_evicted, 0u);
  EXPECT_EQ(answers(1 << 26, 8, false), expected);
  // Room for so few that threads take tiles from each other while rays are inside, and find none at times.
  EXPECT_EQ(answers(1, 16, true), expected);
  EXPECT_GT(num_evicted, 100u);
}

}  // namespace
}  // namespace relief
