// The published traversals with every option, table and direction of a limit, against the fast one, which methods_test.cpp
// compares with the oracle.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "displacement/rmip.h"
#include "displacement/traverse_chord.h"
#include "displacement/traverse_rmip.h"
#include "displacement/traverse_tfdm.h"
#include "tests/displacement/judge.h"
#include "tests/displacement/random_cases.h"

namespace relief {
namespace {

struct Query {
  DisplacedMeshView mesh;
  RayFrame frame;
  RayCurve curve;
  double t_min, t_max;
};

/// Compares a traversal with traverse_chord on random cases.
/// @param traverse  (query, field, any_hit, hit, counters) → found
template <class Tables, class Traverse>
void compare_with_chord(std::uint64_t seed, int num_cases, const Tables& make_tables, const Traverse& traverse)
{
  constexpr int kNumRays = 32;
  constexpr HeightFormat kFormats[] = {HeightFormat::kFloat, HeightFormat::kU16, HeightFormat::kU8};
  int num_hits = 0;
  for (int k = 0; k < num_cases; ++k) {
    std::mt19937_64 random(seed + static_cast<std::uint64_t>(k));
    RandomCase drawn = random_case(random, kNumRays);
    const HeightFormat format = kFormats[k % 3];
    drawn.map = stored_heights(drawn.map, format);
    const TracedCase traced({drawn.triangle}, drawn.map, format);
    Query q{traced.mesh(), {}, {}, 0, 0};
    const auto tables = make_tables(*q.mesh.field);
    for (const oracle::Ray& ray : drawn.rays) {
      q.frame = ray_frame_make(to_double(TracedCase::vector3(ray.O)), to_double(TracedCase::vector3(ray.D)));
      if (!ray_curve_make(q.frame, q.mesh.triangles[0], &q.curve)) continue;
      q.t_min = ray.t_min;
      q.t_max = ray.t_max;
      TraversalCounters counters;
      DisplacedHit expected, hit, any;
      const bool found = traverse_chord(q.mesh, 0, q.curve, q.t_min, q.t_max, false, &expected, &counters);
      ASSERT_EQ(traverse(q, tables, false, &hit, &counters), found) << "case " << seed + static_cast<std::uint64_t>(k);
      ASSERT_EQ(traverse(q, tables, true, &any, &counters), found) << "case " << seed + static_cast<std::uint64_t>(k);
      if (!found) continue;
      ++num_hits;
      // Both refine the same root; where the ray grazes it is known to fewer digits.
      ASSERT_NEAR(hit.t, expected.t, 1e-7 * (std::abs(expected.t) + 1e-3))
          << "case " << seed + static_cast<std::uint64_t>(k);
      ASSERT_GE(any.t, expected.t - 1e-7 * (std::abs(expected.t) + 1e-3));
      ASSERT_LE(any.t, q.t_max);
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
        const RmipOptions options{marching_scale, reduce};
        compare_with_chord(
            seed, kNumCases / 4, [&](const HeightFieldView& field) { return Rmip(field, resolution); },
            [&](const Query& q, const Rmip& rmip, bool any_hit, DisplacedHit* hit, TraversalCounters* counters) {
              return traverse_rmip(q.mesh, 0, q.frame, q.curve, rmip.view(), options, q.t_min, q.t_max, any_hit, hit,
                                   counters);
            });
        if (HasFatalFailure()) return;
        seed += kNumCases;
      }
    }
  }
}

TEST(RmipTraversal, IsTheSameOverAMinmaxMipmap)
{
  for (const double marching_scale : {1., 16.}) {
    compare_with_chord(
        200000, kNumCases, [](const HeightFieldView& field) { return MinmaxMipmap(field); },
        [&](const Query& q, const MinmaxMipmap& mipmap, bool any_hit, DisplacedHit* hit, TraversalCounters* counters) {
          return traverse_rmip(q.mesh, 0, q.frame, q.curve, mipmap.view(), {marching_scale, true}, q.t_min, q.t_max,
                               any_hit, hit, counters);
        });
    if (HasFatalFailure()) return;
  }
}

TEST(TfdmTraversal, FindsWhatTheFastMethodFinds)
{
  compare_with_chord(
      300000, 2 * kNumCases, [](const HeightFieldView& field) { return MinmaxMipmap(field); },
      [](const Query& q, const MinmaxMipmap& mipmap, bool any_hit, DisplacedHit* hit, TraversalCounters* counters) {
        return traverse_tfdm(q.mesh, 0, q.frame, q.curve, mipmap.view(), q.t_min, q.t_max, any_hit, hit, counters);
      });
}

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
  const Rmip rmip(*mesh.field);
  const MinmaxMipmap mipmap(*mesh.field);
  for (int k = 0; k < 200; ++k) {
    const Vec3f O{-1, -1, 0.01f + 0.1f * static_cast<float>(random_unit(random))};
    const Vec3f target{0.8f * static_cast<float>(random_unit(random)), 0.2f * static_cast<float>(random_unit(random)),
                       0};
    const RayFrame frame = ray_frame_make(to_double(O), to_double(target - O));
    RayCurve curve;
    if (!ray_curve_make(frame, mesh.triangles[0], &curve)) continue;
    TraversalCounters counters, tfdm_counters;
    DisplacedHit expected, a, b;
    ASSERT_TRUE(traverse_chord(mesh, 0, curve, 0, 1e30, false, &expected, &counters));
    ASSERT_TRUE(traverse_rmip(mesh, 0, frame, curve, rmip.view(), {}, 0, 1e30, false, &a, &counters));
    ASSERT_TRUE(traverse_tfdm(mesh, 0, frame, curve, mipmap.view(), 0, 1e30, false, &b, &tfdm_counters));
    EXPECT_NEAR(a.t, expected.t, 1e-9);
    EXPECT_NEAR(b.t, expected.t, 1e-9);
    // Tiles are skipped as nodes are, not one by one: there are 179 200 periods.
    EXPECT_LT(tfdm_counters.bounds, 20000u);
  }
}

/// A flat triangle over much of a map, and what traversals need besides.
class WideTriangle {
 public:
  WideTriangle(double span_u, double span_v, oracle::HeightMap map)
      : traced_({{{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}},
                  {{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}},
                  {{{-span_u, -span_v}, {span_u, -span_v}, {-span_u, span_v}}}}},
                std::move(map)),
        rmip_(*traced_.mesh().field),
        mipmap_(*traced_.mesh().field)
  {
  }

  /// @param stop  as TraversalCounters has it
  bool trace(TraversalMethod method,
             const oracle::Ray& ray,
             DisplacedHit* hit,
             TraversalCounters* counters,
             const std::atomic<bool>* stop = nullptr) const
  {
    const DisplacedMeshView mesh = traced_.mesh();
    const RayFrame frame = ray_frame_make(to_double(TracedCase::vector3(ray.O)), to_double(TracedCase::vector3(ray.D)));
    counters->stop = stop;
    RayCurve curve;
    if (!ray_curve_make(frame, mesh.triangles[0], &curve)) return false;
    switch (method) {
      case TraversalMethod::kChord:
        break;
      case TraversalMethod::kRmip:
        return traverse_rmip(mesh, 0, frame, curve, rmip_.view(), {}, 0, 1e30, false, hit, counters);
      case TraversalMethod::kRmipOnMinmax:
        return traverse_rmip(mesh, 0, frame, curve, mipmap_.view(), {}, 0, 1e30, false, hit, counters);
      case TraversalMethod::kTfdm:
        return traverse_tfdm(mesh, 0, frame, curve, mipmap_.view(), 0, 1e30, false, hit, counters);
    }
    return traverse_chord(mesh, 0, curve, 0, 1e30, false, hit, counters);
  }

 private:
  TracedCase traced_;
  Rmip rmip_;
  MinmaxMipmap mipmap_;
};

class EveryTraversal : public testing::TestWithParam<TraversalMethodLabel> {};

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
    const bool found = wide.trace(GetParam().method, ray, &hit, &counters);
    ASSERT_EQ(found, wide.trace(TraversalMethod::kTfdm, ray, &expected, &others)) << k;
    if (found) {
      EXPECT_NEAR(hit.t, expected.t, 1e-7) << k;
    }
    most = std::max(most, counters.bounds + counters.texels);
  }
  std::cout << "[ figures  ] " << GetParam().name << ": at most " << most << " bounds and texels a ray\n";
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
  EXPECT_FALSE(wide.trace(GetParam().method, ray, &hit, &counters, &stop));
  EXPECT_TRUE(counters.stopped);
  EXPECT_LT(counters.bounds, 10000u);
}

INSTANTIATE_TEST_SUITE_P(Displacement, EveryTraversal, testing::ValuesIn(kTraversalMethods), [](const auto& each) {
  std::string name(each.param.name);
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

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
  EXPECT_FALSE(wide.trace(TraversalMethod::kChord, ray_through({-1, .1, 6e-4}, {1, .1001, 6e-4}), &hit, &over));
  EXPECT_LT(over.bounds, 1000u);
  EXPECT_TRUE(wide.trace(TraversalMethod::kChord, ray_through({-1, .4, 6e-4}, {1, .4001, 6e-4}), &hit, &into));
}

}  // namespace
}  // namespace relief
