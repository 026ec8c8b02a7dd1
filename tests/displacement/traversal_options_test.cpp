// The published traversals with every option, table and direction of a limit, against the fast one, which methods_test.cpp
// compares with the oracle.
#include <cmath>
#include <string>

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
      q.frame = ray_frame_make(TracedCase::vector3(ray.O), TracedCase::vector3(ray.D));
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
    const RayFrame frame = ray_frame_make(O, target - O);
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

}  // namespace
}  // namespace relief
