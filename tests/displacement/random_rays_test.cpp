// Random rays at random displaced triangles: every tracing method, compiled for every instruction set this machine has,
// against the oracle, which is asked for each ray once. Pre-tessellation is compared with the surface that it approximates.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iostream>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "displacement/tessellation.h"
#include "tests/displacement/closed_surfaces.h"
#include "tests/displacement/judge.h"
#include "tests/displacement/random_cases.h"

namespace relief {
namespace {

constexpr std::uint64_t kRaysPerCase = 40;
constexpr HeightFormat kFormats[] = {HeightFormat::kFloat, HeightFormat::kU16, HeightFormat::kFloat, HeightFormat::kU8};
/// One case in so many is tessellated: building Embree's trees for 40 rays costs more than tracing them.
constexpr std::uint64_t kTessellatedShare = 10;
constexpr TessellationKind kKinds[] = {TessellationKind::kQuads, TessellationKind::kGrids, TessellationKind::kBlocks};
constexpr const char* kKindNames[] = {"tessellate", "tessellate-grid", "blocks"};

/// Prints figures, also of a test that passes: they are what the documentation quotes.
void report(const std::string& label, const std::string& figures)
{
  std::cout << "[ figures  ] " << label << ": " << figures << "\n";
}

/// How a tessellation with a vertex a texel differs from the surface.
struct TessellationErrors {
  std::uint64_t num_rays = 0, num_hits = 0;
  std::uint64_t num_only_surface = 0, num_only_tessellation = 0;
  ErrorHistogram distance;  ///< of hits from the surface at their weights, in units of the largest displacement

  void add(const TessellationErrors& other)
  {
    num_rays += other.num_rays;
    num_hits += other.num_hits;
    num_only_surface += other.num_only_surface;
    num_only_tessellation += other.num_only_tessellation;
    distance.add(other.distance);
  }
  std::string text() const
  {
    std::ostringstream out;
    out.precision(3);
    const double rays = static_cast<double>(num_rays) / 100;
    out << num_rays << " rays, " << num_hits << " hits; where the surface has none "
        << static_cast<double>(num_only_tessellation) / rays << " %, none where it has one "
        << static_cast<double>(num_only_surface) / rays << " %; distance from it in largest displacements (median, "
        << "99 %, 99.9 %, largest): " << quantiles_text(distance);
    return out.str();
  }
};

void compare_tessellation(const TracedCase& traced,
                          const std::vector<oracle::Ray>& rays,
                          const std::vector<std::vector<oracle::Hit>>& roots,
                          RTCDevice device,
                          TessellationKind kind,
                          TessellationErrors* errors)
{
  const DisplacedMeshView mesh = traced.mesh();
  double low, high;
  stored_to_heights(*mesh.field, mesh.field->range, &low, &high);
  const double largest_d =
      std::abs(mesh.scale) * std::max(std::abs(low - mesh.midlevel), std::abs(high - mesh.midlevel));
  const Tessellation tessellation(mesh, tessellation_layout_make(mesh, kind, 1));
  RTCScene scene = tessellation_scene_make(device, {});
  RTCGeometry geometry = tessellation.geometry_make(device);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene);
  EmbreeContext context;
  embree_context_init(context, false);
  for (std::size_t k = 0; k < rays.size(); ++k) {
    RTCRayHit query{};
    query.ray = embree_ray(rays[k]);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    embree_intersect1(scene, context, query);
    const bool found = query.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    const bool exists = std::any_of(roots[k].begin(), roots[k].end(), [](const oracle::Hit& h) { return h.certain; });
    ++errors->num_rays;
    errors->num_hits += found ? 1 : 0;
    errors->num_only_surface += exists && !found ? 1 : 0;
    errors->num_only_tessellation += found && roots[k].empty() ? 1 : 0;
    if (!found || !(largest_d > 0)) continue;
    const MicroHit hit = tessellation.hit(query.hit.primID, query.hit.u, query.hit.v);
    errors->distance.add(length(surface_point(mesh, mesh.triangles[0], hit.b1, hit.b2).P - hit.P) / largest_d);
  }
  rtcReleaseScene(scene);
}

/// One judge for each method and instruction set, and what the tessellations are off by. Later parts of a long run are for
/// the best instruction set: it takes a third of the time, and the first part has had the rays to tell them apart.
struct Findings {
  std::vector<Judge> judges = test_part() == 0 ? judges_of_all_methods() : judges_of_all_methods(best_table());
  TessellationErrors tessellations[std::size(kKinds)];
};

void judge_case(std::uint64_t number, RTCDevice device, Findings* findings)
{
  std::mt19937_64 random(number);
  RandomCase drawn = random_case(random, static_cast<int>(kRaysPerCase));
  const HeightFormat format = kFormats[number % 4];
  drawn.map = stored_heights(drawn.map, format);
  const TracedCase traced({drawn.triangle}, drawn.map, format);
  const JudgedTriangle triangle(drawn.triangle, drawn.map);
  std::vector<std::vector<oracle::Hit>> roots;
  for (std::size_t k = 0; k < drawn.rays.size(); ++k) {
    roots.push_back(triangle.surface.intersect_all(drawn.rays[k]));
    const std::string label = "random case " + std::to_string(number) + " ray " + std::to_string(k);
    for (Judge& judge : findings->judges) judge.judge(traced, 0, triangle, drawn.rays[k], roots.back(), label);
  }
  if (number % kTessellatedShare != 0) return;
  for (std::size_t k = 0; k < std::size(kKinds); ++k)
    compare_tessellation(traced, drawn.rays, roots, device, kKinds[k], &findings->tessellations[k]);
}

constexpr int kTrianglesPerLargeMap = 8;
constexpr int kRaysPerTriangle = 40;

void judge_large_case(std::uint64_t number, RTCDevice, Findings* findings)
{
  std::mt19937_64 random(number);
  RandomLargeCase drawn = random_large_case(random, kTrianglesPerLargeMap, kRaysPerTriangle);
  const HeightFormat format = kFormats[number % 4];
  drawn.map = stored_heights(drawn.map, format);
  const TracedCase traced(drawn.triangles, drawn.map, format);
  for (std::uint32_t index = 0; index < drawn.triangles.size(); ++index) {
    const JudgedTriangle triangle(drawn.triangles[index], drawn.map);
    for (std::size_t k = 0; k < drawn.rays[index].size(); ++k) {
      const oracle::Ray& ray = drawn.rays[index][k];
      const std::vector<oracle::Hit> roots = triangle.surface.intersect_all(ray);
      const std::string label = "large case " + std::to_string(number) + " ray " + std::to_string(k);
      for (Judge& judge : findings->judges) judge.judge(traced, index, triangle, ray, roots, label);
    }
  }
}

/// A plane of Blender's: all normals are equal, and up is out.
void judge_flat_case(std::uint64_t number, RTCDevice, Findings* findings)
{
  std::mt19937_64 random(number);
  RandomLargeCase drawn = random_large_case(random, kTrianglesPerLargeMap, 0);
  if (number % 2 == 0) {
    drawn.map = random_case(random, 0).map;
    set_random_scale(random, std::pow(10, random_between(random, -2, 0)), &drawn.map);
  }
  drawn.map.scale = std::abs(drawn.map.scale);
  const HeightFormat format = kFormats[number / 2 % 4];
  drawn.map = stored_heights(drawn.map, format);
  for (oracle::DisplacedTriangle& triangle : drawn.triangles) triangle.N[1] = triangle.N[2] = triangle.N[0];
  const TracedCase traced(drawn.triangles, drawn.map, format);
  for (std::uint32_t index = 0; index < drawn.triangles.size(); ++index) {
    const JudgedTriangle triangle(drawn.triangles[index], drawn.map);
    for (const oracle::Ray& ray : random_rays(random, drawn.triangles[index], drawn.map, kRaysPerTriangle)) {
      const std::vector<oracle::Hit> roots = triangle.surface.intersect_all(ray);
      for (Judge& judge : findings->judges)
        judge.judge(traced, index, triangle, ray, roots, "flat case " + std::to_string(number));
    }
  }
}

/// Judges as many cases, from number `first` on, on all processors.
/// @param judge  judge_case or judge_large_case
std::vector<Findings> judge_cases(std::uint64_t first,
                                  std::uint64_t num_cases,
                                  void (*judge)(std::uint64_t, RTCDevice, Findings*))
{
  std::vector<Findings> findings(std::max(1u, std::thread::hardware_concurrency()));
  std::atomic<std::uint64_t> next{first};
  const std::uint64_t end = first + num_cases;
  std::vector<std::thread> threads;
  threads.reserve(findings.size());
  for (Findings& mine : findings) {
    threads.emplace_back([&mine, &next, end, judge] {
      RTCDevice device = rtcNewDevice("threads=1");
      for (std::uint64_t number = next++; number < end; number = next++) judge(number, device, &mine);
      rtcReleaseDevice(device);
    });
  }
  for (std::thread& thread : threads) thread.join();
  return findings;
}

void expect_no_faults(const std::vector<Findings>& findings)
{
  const std::vector<Judge>& judges = findings[0].judges;
  for (std::size_t k = 0; k < judges.size(); ++k) {
    Judgement sum;
    for (const Findings& each : findings) sum.add(each.judges[k].judgement());
    report(judges[k].name(), sum.text());
    EXPECT_EQ(sum.num_faults(), 0u) << judges[k].name() << " " << sum.text();
    // One ray in ten thousand may be decided by rounding: most of those start on the surface.
    EXPECT_LE(sum.num_beside, sum.num_rays / 10000) << judges[k].name() << " " << sum.text();
  }
}

TEST(RandomTrianglesOnLargeMaps, AreFoundByEveryMethodAsByTheOracle)
{
  const std::uint64_t num_cases = num_test_rays(16000) / (kTrianglesPerLargeMap * kRaysPerTriangle);
  expect_no_faults(judge_cases(1 + test_part() * num_cases, num_cases, judge_large_case));
}

TEST(RandomFlatTriangles, AreFoundByEveryMethodAsByTheOracle)
{
  const std::uint64_t num_cases = num_test_rays(16000) / (kTrianglesPerLargeMap * kRaysPerTriangle);
  expect_no_faults(judge_cases(1 + test_part() * num_cases, num_cases, judge_flat_case));
}

TEST(RandomDisplacedTriangles, AreFoundByEveryMethodAsByTheOracle)
{
  const std::uint64_t num_cases = num_test_rays(200000) / kRaysPerCase;
  const std::vector<Findings> findings = judge_cases(1 + test_part() * num_cases, num_cases, judge_case);
  expect_no_faults(findings);
  for (std::size_t k = 0; k < std::size(kKinds); ++k) {
    TessellationErrors sum;
    for (const Findings& each : findings) sum.add(each.tessellations[k]);
    report(kKindNames[k], sum.text());
    // Vertices lie on the surface; both it and what is between them are this far from the base triangle at most.
    EXPECT_LT(sum.distance.largest(), 2.01);
  }
}

}  // namespace
}  // namespace relief
