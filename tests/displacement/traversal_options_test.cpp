// The published traversals with every option, table and direction of a limit, against the fast one, which methods_test.cpp
// compares with the oracle.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>
#include <map>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "displacement/method.h"
#include "tests/displacement/judge.h"
#include "tests/displacement/random_cases.h"

namespace relief {
namespace {

/// A method with its table for one height field.
struct Prepared {
  const DisplacementMethodEntry* entry;
  MethodTable table;
};

Prepared prepare(DisplacementMethod method, const HeightFieldView& field, const RmipOptions& options = {})
{
  const DisplacementMethodEntry& entry = displacement_method(method);
  return {&entry, entry.table_make != nullptr ? entry.table_make(field, options) : MethodTable{}};
}

/// Compares a method with chord on random cases.
void compare_with_chord(std::uint64_t seed, int num_cases, DisplacementMethod method, const RmipOptions& options = {})
{
  constexpr int kNumRays = 32;
  constexpr HeightFormat kFormats[] = {HeightFormat::kFloat, HeightFormat::kU16, HeightFormat::kU8};
  int num_hits = 0;
  for (int k = 0; k < num_cases; ++k) {
    SCOPED_TRACE(testing::Message() << "case " << seed + static_cast<std::uint64_t>(k));
    std::mt19937_64 random(seed + static_cast<std::uint64_t>(k));
    RandomCase drawn = random_case(random, kNumRays);
    const HeightFormat format = kFormats[k % 3];
    drawn.map = stored_heights(drawn.map, format);
    const TracedCase traced({drawn.triangle}, drawn.map, format);
    const DisplacedMeshView mesh = traced.mesh();
    const Prepared chord = prepare(DisplacementMethod::chord, *mesh.field);
    const Prepared other = prepare(method, *mesh.field, options);
    for (const oracle::Ray& ray : drawn.rays) {
      RayCurve curve;
      if (!ray_curve_make(ray_frame_make(to_double(TracedCase::vector3(ray.O)), to_double(TracedCase::vector3(ray.D))),
                          mesh.triangles[0], &curve)) {
        continue;
      }
      TraversalCounters counters;
      PrismQuery query{mesh, 0, curve, ray.t_min, ray.t_max, false, options, counters};
      DisplacedHit expected, hit, any;
      const bool found = chord.entry->traverse(query, chord.table.view, &expected);
      ASSERT_EQ(other.entry->traverse(query, other.table.view, &hit), found);
      query.any_hit = true;
      ASSERT_EQ(other.entry->traverse(query, other.table.view, &any), found);
      if (!found) continue;
      ++num_hits;
      // Both refine the same root; where the ray grazes it is known to fewer digits.
      ASSERT_NEAR(hit.t, expected.t, 1e-7 * (std::abs(expected.t) + 1e-3));
      ASSERT_GE(any.t, expected.t - 1e-7 * (std::abs(expected.t) + 1e-3));
      ASSERT_LE(any.t, ray.t_max);
    }
  }
  EXPECT_GT(num_hits, num_cases * kNumRays / 4);
}

constexpr int kNumCases = 600;

TEST(RmipTraversal, IsTheSameForEveryOptionAndResolution)
{
  std::uint64_t seed = 100000;
  for (const double marching_scale : {.25, 1., 4., 16., 1000.}) {
    for (const bool reduce : {false, true}) {
      for (const int resolution : {1, 3, 0, 1 << 20}) {
        SCOPED_TRACE(testing::Message() << "marching scale " << marching_scale << ", inversion " << reduce << ", R "
                                        << resolution);
        compare_with_chord(seed, kNumCases / 4, DisplacementMethod::rmip, {marching_scale, reduce, resolution});
        if (HasFatalFailure()) return;
        seed += kNumCases;
      }
    }
  }
}

TEST(RmipTraversal, IsTheSameWhereTheRayIsSplitInTheMiddle)
{
  std::uint64_t seed = 150000;
  for (const double marching_scale : {.25, 1., 16.}) {
    for (const bool reduce : {false, true}) {
      SCOPED_TRACE(testing::Message() << "marching scale " << marching_scale << ", inversion " << reduce);
      compare_with_chord(seed, kNumCases / 2, DisplacementMethod::rmip, {marching_scale, reduce, 0, RmipSplit::kRay});
      if (HasFatalFailure()) return;
      seed += kNumCases;
    }
  }
}

TEST(PublishedTraversals, AreTheSameByAffineArithmetic)
{
  std::uint64_t seed = 170000;
  for (const DisplacementMethod method :
       {DisplacementMethod::rmip, DisplacementMethod::rmip_minmax, DisplacementMethod::tfdm}) {
    SCOPED_TRACE(displacement_method_label(method));
    compare_with_chord(seed, kNumCases, method, {.marching_scale = 1, .bounds = SpaceBounds::kAffine});
    if (HasFatalFailure()) return;
    seed += kNumCases;
  }
}

/// Two triangles a cell are another surface: how often they miss what is there, and hit what is not.
struct LeafRates {
  int num_rays = 0, num_hits = 0, num_missed = 0, num_invented = 0, num_elsewhere = 0;
  double furthest = 0;  ///< of t, where both hit the same triangle, in lengths of the ray's direction
};

/// @param num_cells  a side of a bumpy square of two base triangles
LeafRates leaf_rates(int num_cells, double scale)
{
  std::mt19937_64 random(11);
  oracle::HeightMap map{num_cells, num_cells, {}, oracle::Wrap::kRepeat, oracle::Wrap::kRepeat, scale, 0.5};
  for (int row = 0; row < num_cells; ++row) {
    for (int column = 0; column < num_cells; ++column) {
      map.h.push_back(float_rounded(.5 + .5 * std::sin(6.2831853 * 2 * column / num_cells) *
                                             std::cos(6.2831853 * 3 * row / num_cells)));
    }
  }
  const oracle::Vector3 N00{-.3, -.3, 1}, N10{.3, -.3, 1}, N01{-.3, .3, 1}, N11{.3, .3, 1};
  const TracedCase traced({{{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}, {{N00, N10, N01}}, {{{0, 0}, {1, 0}, {0, 1}}}},
                           {{{{0, 1, 0}, {1, 0, 0}, {1, 1, 0}}}, {{N01, N10, N11}}, {{{0, 1}, {1, 0}, {1, 1}}}}},
                          map);
  const DisplacedMeshView mesh = traced.mesh();
  const RmipOptions options{16, true, 0, RmipSplit::kBound, RmipLeaf::kTriangles};
  const Prepared exact = prepare(DisplacementMethod::chord, *mesh.field);
  const Prepared published = prepare(DisplacementMethod::rmip, *mesh.field, options);
  LeafRates rates;
  for (rates.num_rays = 0; rates.num_rays < 40000; ++rates.num_rays) {
    // Over the rim too, and grazing.
    const oracle::Vector3 target{random_between(random, -.1, 1.1), random_between(random, -.1, 1.1), 0};
    const oracle::Ray ray = ray_through(
        {random_between(random, -1, 2), random_between(random, -1, 2), random_between(random, .1, 1)}, target);
    double t[2] = {HUGE_VAL, HUGE_VAL};
    for (std::uint32_t triangle = 0; triangle < 2; ++triangle) {
      RayCurve curve;
      if (!ray_curve_make(ray_frame_make(to_double(TracedCase::vector3(ray.O)), to_double(TracedCase::vector3(ray.D))),
                          mesh.triangles[triangle], &curve)) {
        continue;
      }
      for (int k = 0; k < 2; ++k) {
        const Prepared& method = k == 0 ? exact : published;
        TraversalCounters counters;
        DisplacedHit hit;
        if (method.entry->traverse({mesh, triangle, curve, 0, t[k], false, options, counters}, method.table.view, &hit))
          t[k] = hit.t;
      }
    }
    const bool is_there = t[0] < HUGE_VAL, found = t[1] < HUGE_VAL;
    rates.num_hits += is_there ? 1 : 0;
    rates.num_missed += is_there && !found ? 1 : 0;
    rates.num_invented += found && !is_there ? 1 : 0;
    if (!is_there || !found) continue;
    // A hundredth of the height is far more than a patch bends.
    rates.num_elsewhere += std::abs(t[0] - t[1]) > .01 * scale ? 1 : 0;
    if (std::abs(t[0] - t[1]) <= .01 * scale) rates.furthest = std::max(rates.furthest, std::abs(t[0] - t[1]));
  }
  std::cout << "[ figures  ] two triangles a cell, " << num_cells << " cells a side: of " << rates.num_rays << " rays "
            << rates.num_hits << " hit, " << rates.num_missed << " missed, " << rates.num_invented << " invented, "
            << rates.num_elsewhere << " elsewhere; the others within " << rates.furthest << "\n";
  return rates;
}

TEST(RmipTraversal, HitsAnotherSurfaceWithTwoTrianglesACell)
{
  const LeafRates coarse = leaf_rates(32, .2), fine = leaf_rates(256, .2);
  for (const LeafRates& rates : {coarse, fine}) {
    ASSERT_GT(rates.num_hits, 20000);
    ASSERT_LT(rates.num_hits, 38000);
    EXPECT_LT(rates.num_missed, rates.num_rays / 400);
    EXPECT_LT(rates.num_invented, rates.num_rays / 200);
  }
  EXPECT_LT(coarse.num_elsewhere, coarse.num_rays / 10);
  // It is inexact: of 40,000 rays 57, 104 and 2908 went astray, and 0, 2 and 3 with the finer map.
  EXPECT_GT(coarse.num_missed + coarse.num_invented, 0);
  EXPECT_LT(fine.num_missed + fine.num_invented + fine.num_elsewhere, fine.num_rays / 1000);
}

TEST(RmipTraversal, IsTheSameOverAMinmaxMipmap)
{
  for (const double marching_scale : {1., 16.}) {
    compare_with_chord(200000, kNumCases, DisplacementMethod::rmip_minmax, {marching_scale, true});
    if (HasFatalFailure()) return;
  }
}

class EveryTraversal : public testing::TestWithParam<DisplacementMethod> {};

TEST_P(EveryTraversal, FindsWhatTheFastMethodFinds) { compare_with_chord(300000, 2 * kNumCases, GetParam()); }

/// A plane with heights of one texel's period, tiled so often that the ray passes thousands of texels.
TEST(PublishedTraversals, FindTheFirstOfThousandsOfTiles)
{
  const oracle::DisplacedTriangle triangle{
      {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}, {{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}}, {{{0, 0}, {512, 0}, {0, 700}}}};
  std::mt19937_64 random(8);
  oracle::HeightMap map{5, 3, random_heights(random, 5, 3), oracle::Wrap::kRepeat, oracle::Wrap::kMirror, 0.001, 0.5};
  for (double& h : map.h) h = float_rounded(random_unit(random));
  const TracedCase traced({triangle}, map);
  const DisplacedMeshView mesh = traced.mesh();
  std::vector<Prepared> methods;
  for (const DisplacementMethod method : traversing_methods()) methods.push_back(prepare(method, *mesh.field));
  for (int k = 0; k < 200; ++k) {
    const Vec3f O{-1, -1, 0.01f + 0.1f * static_cast<float>(random_unit(random))};
    const Vec3f target{0.8f * static_cast<float>(random_unit(random)), 0.2f * static_cast<float>(random_unit(random)),
                       0};
    RayCurve curve;
    if (!ray_curve_make(ray_frame_make(to_double(O), to_double(target - O)), mesh.triangles[0], &curve)) continue;
    double expected = -1;
    for (const Prepared& method : methods) {
      TraversalCounters counters;
      DisplacedHit hit;
      ASSERT_TRUE(method.entry->traverse({mesh, 0, curve, 0, 1e30, false, {}, counters}, method.table.view, &hit));
      if (expected < 0) expected = hit.t;
      EXPECT_NEAR(hit.t, expected, 1e-9) << method.entry->title;
      // Tiles are skipped as nodes are, not one by one: there are 179 200 periods.
      EXPECT_LT(counters.bounds, 20000u) << method.entry->title;
    }
  }
}

/// A flat triangle over much of a map, and what traversals need besides.
class WideTriangle {
 public:
  WideTriangle(double span_u, double span_v, oracle::HeightMap map)
      : traced_({{{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}},
                  {{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}},
                  {{{-span_u, -span_v}, {span_u, -span_v}, {-span_u, span_v}}}}},
                std::move(map))
  {
    for (const DisplacementMethod method : traversing_methods()) {
      prepared_.emplace(method, prepare(method, *traced_.mesh().field));
    }
  }

  /// @param stop  as TraversalCounters has it
  bool trace(DisplacementMethod method,
             const oracle::Ray& ray,
             DisplacedHit* hit,
             TraversalCounters* counters,
             const std::atomic<bool>* stop = nullptr) const
  {
    const DisplacedMeshView mesh = traced_.mesh();
    counters->stop = stop;
    RayCurve curve;
    if (!ray_curve_make(ray_frame_make(to_double(TracedCase::vector3(ray.O)), to_double(TracedCase::vector3(ray.D))),
                        mesh.triangles[0], &curve)) {
      return false;
    }
    const Prepared& p = prepared_.at(method);
    return p.entry->traverse({mesh, 0, curve, 0, 1e30, false, {}, *counters}, p.table.view, hit);
  }

 private:
  TracedCase traced_;
  std::map<DisplacementMethod, Prepared> prepared_;
};

TEST_P(EveryTraversal, TakesAsLongAsAClampedMapIsLarge)
{
  std::mt19937_64 random(9);
  oracle::HeightMap map{64, 64, {}, oracle::Wrap::kClamp, oracle::Wrap::kClamp, 0.01, 0.5};
  for (int k = 0; k < 64 * 64; ++k) map.h.push_back(float_rounded(random_unit(random)));
  const WideTriangle wide(1e7, 1e7, map);
  std::uint64_t most = 0;
  for (int k = 0; k < 2000; ++k) {
    // Grazing: through what varies along one axis beside the map, over it, and far from it.
    const oracle::Vector3 target{.5 + random_between(random, -1, 1) * std::pow(10, random_between(random, -8, -1)),
                                 .5 + random_between(random, -1, 1) * std::pow(10, random_between(random, -8, -1)),
                                 random_between(random, -.005, .005)};
    const double phi = random_between(random, 0, 6.283), tilt = std::pow(10, random_between(random, -6, 0));
    const oracle::Vector3 away{std::cos(phi), std::sin(phi), tilt};
    const oracle::Ray ray = ray_through(combination(1, target, 1, away), target);
    DisplacedHit hit, expected;
    TraversalCounters counters, others;
    const bool found = wide.trace(GetParam(), ray, &hit, &counters);
    ASSERT_EQ(found, wide.trace(DisplacementMethod::tfdm, ray, &expected, &others)) << k;
    if (found) {
      EXPECT_NEAR(hit.t, expected.t, 1e-7) << k;
    }
    most = std::max(most, counters.bounds + counters.texels);
  }
  std::cout << "[ figures  ] " << displacement_method_label(GetParam()) << ": at most " << most
            << " bounds and texels a ray\n";
  // Along an edge there are 64 cells, and as many nodes and marches; the triangle has 1.3 · 10⁹ texels a side.
  EXPECT_LT(most, 3000u);
}

TEST_P(EveryTraversal, IsGivenUpWhenNobodyWaits)
{
  oracle::HeightMap map{4, 4, std::vector<double>(16, 0.), oracle::Wrap::kRepeat, oracle::Wrap::kRepeat, 0.001, 0};
  for (std::size_t k = 0; k < 16; k += 5) map.h[k] = 1;
  const WideTriangle wide(5e8, 5e8, map);
  const std::atomic<bool> stop{true};
  // Just below the highest points of 10⁹ tiles that it passes by.
  const oracle::Ray ray = ray_through({-1, .1, .0009995}, {1, .27, .0009993});
  DisplacedHit hit;
  TraversalCounters counters;
  EXPECT_FALSE(wide.trace(GetParam(), ray, &hit, &counters, &stop));
  EXPECT_TRUE(counters.stopped);
  EXPECT_LT(counters.bounds, 10000u);
}

INSTANTIATE_TEST_SUITE_P(Displacement, EveryTraversal, testing::ValuesIn(traversing_methods()), method_test_name);

TEST(ChordTraversal, SkipsARowOfAMillionTilesThatItPassesOver)
{
  // Every row of texels has a height of its own, and one ray runs along a low row, far below the highest.
  oracle::HeightMap map{64, 64, {}, oracle::Wrap::kRepeat, oracle::Wrap::kRepeat, 1e-3, 0};
  std::mt19937_64 random(10);
  for (int row = 0; row < 64; ++row) {
    for (int column = 0; column < 64; ++column)
      map.h.push_back(float_rounded(row < 48 ? .5 * random_unit(random) : .5 + .5 * random_unit(random)));
  }
  const WideTriangle wide(5e5, .5, map);
  DisplacedHit hit;
  TraversalCounters over, into;
  EXPECT_FALSE(wide.trace(DisplacementMethod::chord, ray_through({-1, .1, 6e-4}, {1, .1001, 6e-4}), &hit, &over));
  EXPECT_LT(over.bounds, 1000u);
  EXPECT_TRUE(wide.trace(DisplacementMethod::chord, ray_through({-1, .4, 6e-4}, {1, .4001, 6e-4}), &hit, &into));
}

}  // namespace
}  // namespace relief
