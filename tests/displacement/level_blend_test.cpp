// Surfaces between two levels of a height map, which RMIP traces with levels=interpolated, against the oracle. Of levels it
// knows nothing: it is given one dense map, whose lattice has the lines of both levels, and whose heights are the blend.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "displacement/clearance.h"
#include "displacement/displacement_set.h"
#include "displacement/level_blend.h"
#include "tests/displacement/closed_surfaces.h"
#include "tests/displacement/judge.h"
#include "tests/displacement/random_cases.h"

namespace relief {
namespace {

constexpr DisplacementMethod kBlendingMethods[] = {DisplacementMethod::rmip, DisplacementMethod::rmip_minmax};
constexpr HeightFormat kFormats[] = {HeightFormat::kFloat, HeightFormat::kU16, HeightFormat::kU8};

/// A case at a level between its map's own and the next.
class BlendedCase {
 public:
  BlendedCase(const std::vector<oracle::DisplacedTriangle>& triangles,
              const oracle::HeightMap& map,
              double weight,
              HeightFormat format = HeightFormat::kFloat,
              bool weld_seams = false)
      : traced_(triangles, map, format, 2, weld_seams), weight_(weight)
  {
  }

  const TracedCase& traced() const { return traced_; }
  /// Valid until the next one is made.
  DisplacedGeometry geometry(DisplacementMethod method)
  {
    DisplacedGeometry result = traced_.geometry(method);
    blend_ = {result.levels[1].field, result.levels[1].table, weight_};
    result.mesh.blend = &blend_;
    result.lod.num_levels = 1;
    result.lod.by_cone = false;
    return result;
  }

 private:
  TracedCase traced_;
  double weight_;
  LevelBlend blend_;
};

/// Texels of the coarser level, as the oracle takes them.
oracle::HeightMap coarse_map(const TracedCase& traced, const oracle::HeightMap& fine)
{
  const HeightFieldView& field = *traced.geometry(DisplacementMethod::rmip).levels[1].field;
  oracle::HeightMap map = fine;
  map.width = field.map.width;
  map.height = field.map.height;
  map.h.clear();
  for (int row = 0; row < map.height; ++row) {
    for (int column = 0; column < map.width; ++column) map.h.push_back(lattice_height(field, column, row));
  }
  return map;
}

/// Parts into which the lines of two levels divide a texel of the finer one, all of one width.
int parts_a_texel(int fine, int coarse) { return fine == coarse ? 1 : fine == 2 * coarse ? 2 : 2 * coarse; }

/// One axis of a dense map: a texel is a part of one of the finer level's, and the first one is at its first centre.
struct DenseAxis {
  DenseAxis(int fine, int coarse, oracle::Wrap wrap_)
      : texels(fine),
        parts(parts_a_texel(fine, coarse)),
        // The lattice of a mirrored map has a texel where it is mirrored.
        periods(wrap_ == oracle::Wrap::kMirror ? 2 : 1),
        size(parts * periods * fine),
        wrap(wrap_ == oracle::Wrap::kMirror ? oracle::Wrap::kRepeat : wrap_)
  {
  }
  /// Of a dense texel, on the map.
  double u(int at) const { return (static_cast<double>(at) / parts + .5) / texels; }
  /// A place of the map, on the dense one.
  double dense_u(double of_map) const { return (parts * (of_map * texels - .5) + .5) / size; }

  int texels, parts, periods, size;
  oracle::Wrap wrap;
};

/// The blend as one map.
struct DenseMap {
  DenseMap(const oracle::HeightMap& fine, const oracle::HeightMap& coarse, double weight)
      : x(fine.width, coarse.width, fine.wrap_u), y(fine.height, coarse.height, fine.wrap_v), map(fine)
  {
    map.width = x.size;
    map.height = y.size;
    map.wrap_u = x.wrap;
    map.wrap_v = y.wrap;
    map.h.clear();
    for (int row = 0; row < y.size; ++row) {
      for (int column = 0; column < x.size; ++column) {
        const oracle::Vector2 uv{x.u(column), y.u(row)};
        map.h.push_back((1 - weight) * oracle::height_eval(fine, uv) + weight * oracle::height_eval(coarse, uv));
      }
    }
  }
  oracle::DisplacedTriangle triangle(oracle::DisplacedTriangle of_map) const
  {
    for (oracle::Vector2& uv : of_map.uv) uv = {x.dense_u(uv[0]), y.dense_u(uv[1])};
    return of_map;
  }

  DenseAxis x, y;
  oracle::HeightMap map;
};

std::vector<Judge> blending_judges()
{
  std::vector<Judge> judges;
  for (const DisplacementMethod method : kBlendingMethods) {
    judges.emplace_back(method, traversal_table_baseline());
    if (&best_table() != &traversal_table_baseline()) judges.emplace_back(method, best_table());
  }
  return judges;
}

void expect_no_faults(const std::vector<Judge>& judges, std::uint64_t least_hits)
{
  for (const Judge& judge : judges) {
    const Judgement& found = judge.judgement();
    std::cout << "[ figures  ] " << judge.name() << ": " << found.text() << "\n";
    EXPECT_EQ(found.num_faults(), 0u) << judge.name() << " " << found.text();
    EXPECT_LE(found.num_beside, 1 + found.num_rays / 10000) << judge.name();
    EXPECT_GE(found.num_certain, least_hits);
  }
}

/// Puts one ray to all judges.
/// @param triangle  of the dense map
void judge_blended(BlendedCase& blended,
                   std::uint32_t index,
                   const JudgedTriangle& triangle,
                   const oracle::Ray& ray,
                   const std::string& label,
                   std::vector<Judge>* judges)
{
  const std::vector<oracle::Hit> roots = triangle.surface.intersect_all(ray);
  for (Judge& judge : *judges) {
    const DisplacedGeometry geometry = blended.geometry(judge.method());
    judge.ask(&geometry);
    judge.judge(blended.traced(), index, triangle, ray, roots, label);
    judge.ask(nullptr);
  }
}

TEST(BlendedLevels, AreFoundAsByTheOracle)
{
  constexpr int kNumRays = 40;
  const std::uint64_t num_cases = num_test_rays(24000) / kNumRays;
  std::vector<Judge> judges = blending_judges();
  std::uint64_t num_judged = 0;
  for (std::uint64_t number = 1 + (test_part() << 40); num_judged < num_cases; ++number) {
    std::mt19937_64 random(number);
    RandomCase drawn = random_case(random, kNumRays);
    const auto size = [](int texels) { return texels * parts_a_texel(texels, (texels + 1) / 2); };
    constexpr int kMostTexels = 200;  // of maps with an odd side, each texel of which has many parts
    if (size(drawn.map.width) > kMostTexels || size(drawn.map.height) > kMostTexels) continue;
    const HeightFormat format = kFormats[number % 3];
    drawn.map = stored_heights(drawn.map, format);
    const double weight = random_unit(random);
    BlendedCase blended({drawn.triangle}, drawn.map, weight, format);
    const DenseMap dense(drawn.map, coarse_map(blended.traced(), drawn.map), weight);
    const JudgedTriangle triangle(dense.triangle(drawn.triangle), dense.map);
    ++num_judged;
    for (std::size_t k = 0; k < drawn.rays.size(); ++k) {
      judge_blended(blended, 0, triangle, drawn.rays[k],
                    "random case " + std::to_string(number) + " ray " + std::to_string(k), &judges);
    }
  }
  expect_no_faults(judges, num_cases * kNumRays / 4);
}

TEST(BlendedLevels, AreFoundOnLargeMapsAsByTheOracle)
{
  constexpr int kNumTriangles = 4, kNumRays = 40;
  const std::uint64_t num_cases = num_test_rays(800) / (kNumTriangles * kNumRays);
  std::vector<Judge> judges = blending_judges();
  std::uint64_t num_judged = 0;
  for (std::uint64_t number = 1 + (test_part() << 40); num_judged < num_cases; ++number) {
    std::mt19937_64 random(number);
    RandomLargeCase drawn = random_large_case(random, kNumTriangles, kNumRays);
    if (drawn.map.width % 2 != 0 || drawn.map.height % 2 != 0) continue;
    const HeightFormat format = kFormats[num_judged++ % 3];
    drawn.map = stored_heights(drawn.map, format);
    const double weight = random_unit(random);
    BlendedCase blended(drawn.triangles, drawn.map, weight, format);
    const DenseMap dense(drawn.map, coarse_map(blended.traced(), drawn.map), weight);
    for (std::uint32_t index = 0; index < kNumTriangles; ++index) {
      const JudgedTriangle triangle(dense.triangle(drawn.triangles[index]), dense.map);
      for (const oracle::Ray& ray : drawn.rays[index])
        judge_blended(blended, index, triangle, ray, "large case " + std::to_string(number), &judges);
    }
  }
  expect_no_faults(judges, num_cases * kNumTriangles * kNumRays / 4);
}

class BlendedSurface : public testing::TestWithParam<DisplacementMethod> {};

TEST_P(BlendedSurface, LetsNoRayOut)
{
  for (const ClosedSurface& surface : {closed_sphere(), closed_torus(), seamed_box()}) {
    for (const double weight : {.5, .23}) {
      BlendedCase blended(surface.triangles, surface.map, weight, HeightFormat::kFloat, surface.weld_seams);
      DisplacedScene scene(blended.geometry(GetParam()), best_table());
      std::mt19937_64 random(297 + (test_part() << 32));
      Leaks leaks;
      for (std::uint64_t k = 0; k < num_test_rays(120000) / 6; ++k) {
        leaks.trace(scene, ray_from_inside(random, surface));
      }
      leaks.expect_none(surface.name);
    }
  }
}

/// A square of two triangles under a map of 8 × 8 texels, as a displacement set takes it.
struct SquareInput {
  SquareInput()
  {
    std::mt19937_64 random(17);
    for (float& texel : texels) texel = static_cast<float>(random_unit(random));
    HeightMapView map;
    map.texels = texels;
    map.width = map.height = 8;
    map.format = HeightFormat::kFloat;
    MeshView mesh;
    mesh.P = P;
    mesh.uv[0] = uv;
    mesh.triangles = triangles;
    mesh.num_vertices = 4;
    mesh.num_triangles = 2;
    input.meshes = {mesh};
    input.mesh_names = {"square"};
    input.height_maps = {{map, nullptr}};
    settings.height.texture_index = 0;
    settings.method = DisplacementMethod::rmip;
    input.settings = {&settings, 1};
    input.instances = {{0, 0, -1, {}}};
  }

  float texels[64];
  Vec3f P[4] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  Vec2f uv[4] = {{0, 0}, {1, 0}, {0, 1}, {1, 1}};
  TriangleIndices triangles[2] = {{0, 1, 2}, {2, 1, 3}};
  DisplacementSettings settings;
  DisplacementInput input;
};

TEST(BlendedLevels, AreTracedWhereAFixedFractionIsToBeInterpolated)
{
  SquareInput square;
  DisplacementOptions options;
  options.rmip = RmipOptions{};
  const auto warnings = [&] { return displacement_warnings(square.settings, options).size(); };
  for (const float lod : {-1.f, 0.f, 1.f, 1.25f}) {
    for (const RmipLevels levels : {RmipLevels::kMixed, RmipLevels::kInterpolated}) {
      options.lod = lod;
      options.rmip->levels = levels;
      DisplacementSet set(square.input, options);
      const DisplacedGeometry& geometry = set.geometry(0);
      const bool blends = lod == 1.25f && levels == RmipLevels::kInterpolated;
      ASSERT_EQ(geometry.mesh.blend != nullptr, blends) << lod;
      EXPECT_EQ(warnings(), levels == RmipLevels::kInterpolated && !blends ? 1u : 0u) << lod;
      EXPECT_EQ(set.has_levels(), lod == 1.25f && !blends) << lod;
      if (!blends) continue;
      EXPECT_EQ(geometry.mesh.blend->weight, .25);
      EXPECT_EQ(geometry.mesh.field->map.width, 4);
      EXPECT_EQ(geometry.mesh.blend->coarse->map.width, 2);
      // Facets stand for what both have lost.
      const InstanceView placement{.world_from_object = {}, .object_from_world = {}};
      const DisplacedPoint point = displaced_resolve(geometry, placement, 1, 0, {.3f, .3f, 0});
      EXPECT_EQ(point.level, 1.25f);
    }
  }
}

/// Hits of rays at a surface; infinite where there is none.
std::vector<float> hits_of(const DisplacedGeometry& geometry, const std::vector<oracle::Ray>& rays)
{
  DisplacedScene scene(geometry, best_table());
  std::vector<float> hits;
  for (const oracle::Ray& ray : rays) hits.push_back(scene.intersect(ray));
  return hits;
}

TEST_P(BlendedSurface, IsThatOfALevelWhereItsWeightIsAll)
{
  const ClosedSurface surface = closed_torus();
  std::mt19937_64 random(12);
  std::vector<oracle::Ray> rays;
  for (int k = 0; k < 4000; ++k)
    rays.push_back(ray_through(random_vector(random, 1.5, 3), random_vector(random, 0, 1.5)));
  const TracedCase traced(surface.triangles, surface.map, HeightFormat::kFloat, 2);
  std::vector<float> levels[2];
  for (const int level : {0, 1}) {
    DisplacedGeometry geometry = traced.geometry(GetParam());
    geometry.lod.by_cone = false;
    geometry.lod.fixed = static_cast<float>(level);
    levels[level] = hits_of(geometry, rays);
  }
  int num_apart = 0, num_hits = 0;
  for (const double little : {0., 0x1p-40}) {
    for (const int level : {0, 1}) {
      BlendedCase blended(surface.triangles, surface.map, level == 0 ? little : 1 - little);
      const std::vector<float> hits = hits_of(blended.geometry(GetParam()), rays);
      for (std::size_t k = 0; k < rays.size(); ++k) {
        ASSERT_EQ(hits[k] < HUGE_VALF, levels[level][k] < HUGE_VALF) << ray_text(rays[k]);
        if (!(hits[k] < HUGE_VALF)) continue;
        ASSERT_NEAR(hits[k], levels[level][k], 1e-6f * hits[k]) << ray_text(rays[k]);
        ++num_hits;
        if (!(std::abs(levels[0][k] - levels[1][k]) < 1e-4f)) ++num_apart;
      }
    }
  }
  EXPECT_GT(num_hits, 8000);
  EXPECT_GT(num_apart, 4000);
}

TEST_P(BlendedSurface, IsShadedWhereItIsHit)
{
  std::mt19937_64 random(13);
  int num_hits = 0;
  for (int number = 0; number < 400; ++number) {
    RandomCase drawn = random_case(random, 24);
    drawn.map.width = 2 * (1 + drawn.map.width / 2);
    drawn.map.height = 2 * (1 + drawn.map.height / 2);
    drawn.map.h = random_heights(random, drawn.map.width, drawn.map.height);
    const double weight = random_unit(random);
    BlendedCase blended({drawn.triangle}, drawn.map, weight);
    const DisplacedGeometry geometry = blended.geometry(GetParam());
    const DenseMap dense(drawn.map, coarse_map(blended.traced(), drawn.map), weight);
    const oracle::DisplacedTriangle triangle = dense.triangle(drawn.triangle);
    TraversalCounters counters;
    for (const oracle::Ray& ray : drawn.rays) {
      DisplacedHit hit;
      if (!best_table().trace(geometry, 0, displaced_query(ray, false), &hit, &counters)) continue;
      const DisplacedPlace place = displaced_hit_decode(displaced_hit_encode(hit));
      const SurfacePoint point = displaced_surface_point(geometry, 0, place);
      const auto expected = oracle::surface_eval(triangle, dense.map, {place.b1, place.b2});
      const Vec3d P{expected.P[0], expected.P[1], expected.P[2]};
      ++num_hits;
      const double size = length(point.P) + std::abs(drawn.map.scale);
      ASSERT_LT(length(point.P - P), 1e-9 * size) << "case " << number;
      // Beside a line of a lattice weights say too little about the side.
      const DisplacedTriangle& tri = geometry.mesh.triangles[0];
      const double x = tri.x[0] + place.b1 * (tri.x[1] - tri.x[0]) + place.b2 * (tri.x[2] - tri.x[0]);
      const double y = tri.y[0] + place.b1 * (tri.y[1] - tri.y[0]) + place.b2 * (tri.y[2] - tri.y[0]);
      if (std::abs(2 * x - std::round(2 * x)) < 1e-6 || std::abs(2 * y - std::round(2 * y)) < 1e-6) continue;
      const Vec3d Ng{expected.Ng[0], expected.Ng[1], expected.Ng[2]};
      ASSERT_LT(std::min(length(point.Ng - Ng), length(point.Ng + Ng)), 1e-6) << "case " << number;
    }
  }
  EXPECT_GT(num_hits, 3000);
}

TEST_P(BlendedSurface, IsShadedSmoothlyByTheSlopesOfBothLevels)
{
  // Both levels of a ramp have its slope, a texel from the border on.
  oracle::HeightMap map{32, 16, {}, oracle::Wrap::kClamp, oracle::Wrap::kClamp, .7, .5};
  for (int row = 0; row < map.height; ++row) {
    for (int column = 0; column < map.width; ++column) map.h.push_back(column / 64. + row / 128.);
  }
  const oracle::DisplacedTriangle triangle{{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}},
                                           {{{.1, 0, 1}, {0, .1, 1}, {0, 0, 1}}},
                                           {{{.25, .25}, {.75, .25}, {.25, .75}}}};
  BlendedCase blended({triangle}, map, .4);
  const DisplacedGeometry geometry = blended.geometry(GetParam());
  std::mt19937_64 random(14);
  for (int k = 0; k < 100; ++k) {
    const oracle::Vector2 b = random_barycentric(random);
    const DisplacedPlace place{static_cast<float>(b[0]), static_cast<float>(b[1])};
    const Vec3d smooth = displaced_smooth_normal(geometry, 0, place);
    EXPECT_LT(length(smooth - displaced_surface_point(geometry, 0, place).Ng), 1e-6);
  }
}

TEST_P(BlendedSurface, IsClearedAsTheDenseMapIs)
{
  std::mt19937_64 random(15);
  int num_creases = 0;
  for (int number = 0; number < 300; ++number) {
    RandomCase drawn = random_case(random, 0);
    drawn.map.width = 2 * (1 + drawn.map.width / 2);
    drawn.map.height = 2 * (1 + drawn.map.height / 2);
    drawn.map.h = random_heights(random, drawn.map.width, drawn.map.height);
    const double weight = random_unit(random), scale = std::abs(drawn.map.scale);
    BlendedCase blended({drawn.triangle}, drawn.map, weight);
    const DisplacedMeshView mesh = blended.geometry(GetParam()).mesh;
    DenseMap dense(drawn.map, coarse_map(blended.traced(), drawn.map), weight);
    dense.map = stored_heights(dense.map, HeightFormat::kFloat);
    for (double& h : dense.map.h) h = float_rounded(h);
    const TracedCase dense_case({dense.triangle(drawn.triangle)}, dense.map);
    const DisplacedMeshView dense_mesh = dense_case.mesh();
    const DisplacedTriangle& tri = mesh.triangles[0];
    for (int k = 0; k < 40; ++k) {
      // Close to a line of the dense lattice, within so little that no cell is left behind.
      oracle::Vector2 b = random_barycentric(random);
      const double xu = tri.x[1] - tri.x[0], x = tri.x[0] + b[0] * xu + b[1] * (tri.x[2] - tri.x[0]);
      b[0] += (.5 * std::round(2 * x) - x) / xu;
      if (!(b[0] > 0 && b[0] + b[1] < 1)) continue;
      const double side = 1e-5 * length(to_double(tri.P[1]) - to_double(tri.P[0]));
      const Vec3d reach{side, side, side};
      const SurfaceInBox found = surface_in_box(mesh, tri, b[0], b[1], reach);
      const SurfaceInBox expected = surface_in_box(dense_mesh, dense_mesh.triangles[0], b[0], b[1], reach);
      if (!found.crease || !expected.crease) continue;
      ++num_creases;
      // Blended bounds hold those of the blend, as far as the dense case's floats tell.
      const double rounding = 1e-6 * scale + .02 * expected.clearance;
      ASSERT_GE(found.clearance, expected.clearance - rounding) << "case " << number;
      ASSERT_LE(found.clearance, 3 * expected.clearance + rounding) << "case " << number;
    }
  }
  EXPECT_GT(num_creases, 1000);
}

/// What rays at a surface take: counts, and the least processor time of a few turns.
struct Cost {
  TraversalCounters counters;
  double nanoseconds = HUGE_VAL;

  double steps() const { return static_cast<double>(counters.bounds + counters.texels); }
};

void add_turn(const DisplacedGeometry& geometry,
              const std::vector<oracle::Ray>& rays,
              const std::vector<LodCone>& cones,
              Cost* cost)
{
  DisplacedScene scene(geometry, best_table());
  cost->counters = {};
  scene.count(&cost->counters);
  const std::clock_t start = std::clock();
  for (std::size_t k = 0; k < rays.size(); ++k) scene.intersect(rays[k], cones[k]);
  const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  cost->nanoseconds = std::min(cost->nanoseconds, 1e9 * seconds / static_cast<double>(rays.size()));
}

TEST_P(BlendedSurface, TakesLessThanTwiceTheStepsOfMixedLevels)
{
  ClosedSurface surface = closed_torus();
  std::mt19937_64 random(16);
  surface.map.width = surface.map.height = 512;
  surface.map.h = random_landscape(random, 512, 512);
  BlendedCase blended(surface.triangles, surface.map, .5);
  const DisplacedGeometry interpolated = blended.geometry(GetParam());
  DisplacedGeometry mixed = blended.traced().geometry(GetParam());
  mixed.lod.by_cone = false;
  mixed.lod.fixed = .5f;
  std::vector<oracle::Ray> rays;
  std::vector<LodCone> cones;
  for (int k = 0; k < 20000; ++k) {
    rays.push_back(ray_through(random_vector(random, 2, 4), random_vector(random, 0, 1.4)));
    cones.emplace_back().dither = static_cast<float>(random_unit(random));
  }
  Cost of_mixed, of_interpolated;
  for (int turn = 0; turn < 5; ++turn) {
    add_turn(mixed, rays, cones, &of_mixed);
    add_turn(interpolated, rays, cones, &of_interpolated);
  }
  for (const Cost* cost : {&of_mixed, &of_interpolated}) {
    const auto num_rays = static_cast<double>(rays.size());
    std::cout << "[ figures  ] " << displacement_method_label(GetParam())
              << (cost == &of_mixed ? ", mixed: " : ", interpolated: ") << cost->nanoseconds << " ns a ray, "
              << static_cast<double>(cost->counters.bounds) / num_rays << " bounds, "
              << static_cast<double>(cost->counters.texels) / num_rays << " cells\n";
  }
  // Lines of both lattices are crossed, half as many again as those of the finer one.
  EXPECT_LT(of_interpolated.steps(), 2 * of_mixed.steps());
}

INSTANTIATE_TEST_SUITE_P(Displacement, BlendedSurface, testing::ValuesIn(kBlendingMethods), method_test_name);

}  // namespace
}  // namespace relief
