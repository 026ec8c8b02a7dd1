// Triangles that Embree has as quadrilaterals: how they are put in pairs, and that rays meet them as if they were not.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>

#include <gtest/gtest.h>

#include "displacement/vec3d.h"
#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "integrator/triangle_pairs.h"
#include "tests/oracle/triangle_tree.h"
#include "tests/support/scene_builder.h"
#include "tests/support/test_rays.h"

namespace relief::test {
namespace {

oracle::Vector3 vector_of(Vec3f v) { return {v.x, v.y, v.z}; }

std::array<std::uint32_t, 3> corners_of(const TriangleIndices& t) { return {t.v0, t.v1, t.v2}; }

/// The same triangle from another corner on.
TriangleIndices turned(const TriangleIndices& t, int by)
{
  const auto c = corners_of(t);
  const auto at = [&](int i) { return c[static_cast<std::size_t>((i + by) % 3)]; };
  return {at(0), at(1), at(2)};
}

bool is_same(const TriangleIndices& a, const TriangleIndices& b)
{
  for (int by = 0; by < 3; ++by) {
    if (corners_of(turned(a, by)) == corners_of(b)) return true;
  }
  return false;
}

/// Whether two triangles have an edge in common that they go along in opposite directions.
bool share_an_edge(const TriangleIndices& a, const TriangleIndices& b)
{
  for (int i = 0; i < 9; ++i) {
    const auto p = corners_of(turned(a, i / 3)), q = corners_of(turned(b, i % 3));
    if (p[0] == q[1] && p[1] == q[0]) return true;
  }
  return false;
}

double box_area(const std::vector<Vec3f>& P, std::span<const TriangleIndices> triangles)
{
  double low[3] = {1e30, 1e30, 1e30}, high[3] = {-1e30, -1e30, -1e30};
  for (const TriangleIndices& t : triangles) {
    for (const std::uint32_t v : corners_of(t)) {
      const double at[3] = {P[v].x, P[v].y, P[v].z};
      for (int axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], at[axis]);
        high[axis] = std::max(high[axis], at[axis]);
      }
    }
  }
  const double x = high[0] - low[0], y = high[1] - low[1], z = high[2] - low[2];
  return x * y + y * z + z * x;
}

/// The area of boxes of a way to put triangles in pairs; −1: there are two in a pair without an edge in common.
double area_of_way(const std::vector<Vec3f>& P, std::span<const TriangleIndices> triangles, unsigned is_second)
{
  double sum = 0;
  for (std::size_t k = 0; k < triangles.size();) {
    const std::size_t count = (is_second >> (k + 1) & 1u) != 0 ? 2 : 1;
    if (count == 2 && !share_an_edge(triangles[k], triangles[k + 1])) return -1;
    sum += box_area(P, triangles.subspan(k, count));
    k += count;
  }
  return sum;
}

TEST(TrianglePairs, HaveTheLeastAreaOfBoxesOfAllWays)
{
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1, 1);
  int num_paired = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<Vec3f> P;
    for (int v = 0; v < 7; ++v) P.push_back({uniform(random), uniform(random), trial % 2 ? 0.0f : uniform(random)});
    std::vector<TriangleIndices> triangles;
    const unsigned count = 1 + static_cast<unsigned>(random() % 9);
    for (unsigned k = 0; k < count; ++k) {
      std::array<std::uint32_t, 7> v;
      std::iota(v.begin(), v.end(), 0u);
      std::shuffle(v.begin(), v.end(), random);
      TriangleIndices t{v[0], v[1], v[2]};
      // Every other one goes on at an edge of the one before.
      if (k > 0 && random() % 4 != 0) {
        const TriangleIndices before = turned(triangles.back(), static_cast<int>(random() % 3));
        const std::uint32_t other =
            *std::find_if(v.begin(), v.end(), [&](std::uint32_t at) { return at != before.v0 && at != before.v1; });
        t = turned({before.v1, before.v0, other}, static_cast<int>(random() % 3));
      }
      triangles.push_back(t);
    }
    double least = 1e30;
    for (unsigned way = 0; way < 1u << count; ++way) {
      if ((way & 1u) != 0 || (way & way << 1) != 0) continue;
      const double area = area_of_way(P, triangles, way);
      if (area >= 0) least = std::min(least, area);
    }
    unsigned chosen = 0;
    std::uint32_t next = 0;
    for (const TrianglePair& pair : triangle_pairs_make(P, triangles)) {
      ASSERT_EQ(pair.first, next);
      next += pair.turns.first < 0 ? 1 : 2;
      if (pair.turns.first < 0) continue;
      chosen |= 2u << pair.first;
      ++num_paired;
    }
    ASSERT_EQ(next, count);
    EXPECT_NEAR(area_of_way(P, triangles, chosen), least, 1e-5 * least) << trial;
  }
  EXPECT_GT(num_paired, 200);
}

TEST(TrianglePairs, AreTheHalvesOfTheirQuadrilaterals)
{
  const std::vector<Vec3f> P = {{0, 0, 0}, {1, 0, 0.3f}, {1.2f, 1.1f, 0}, {-0.2f, 0.8f, 0.1f}};
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (int turns = 0; turns < 9; ++turns) {
    const std::vector<TriangleIndices> triangles = {turned({0, 1, 3}, turns / 3), turned({2, 3, 1}, turns % 3)};
    const std::vector<TrianglePair> pairs = triangle_pairs_make(P, triangles);
    ASSERT_EQ(pairs.size(), 1u);
    std::uint32_t c[4];
    pair_corners(pairs[0], triangles, c);
    EXPECT_TRUE(is_same({c[0], c[1], c[3]}, triangles[0]));
    EXPECT_TRUE(is_same({c[2], c[3], c[1]}, triangles[1]));
    for (int i = 0; i < 100; ++i) {
      const float u = uniform(random), v = uniform(random);
      // Embree's documentation of RTC_GEOMETRY_TYPE_QUAD.
      const auto at = [&](int corner) { return to_double(P[c[corner]]); };
      const double du = u, dv = v;
      const Vec3d expected = u + v <= 1.0f ? (1 - du - dv) * at(0) + du * at(1) + dv * at(3)
                                           : (du + dv - 1) * at(2) + (1 - du) * at(3) + (1 - dv) * at(1);
      const TrianglePlace place = pair_place(pairs[0], u, v);
      ASSERT_EQ(place.triangle, u + v <= 1.0f ? 0u : 1u);
      const TriangleIndices& t = triangles[place.triangle];
      const double pu = place.u, pv = place.v;
      const Vec3d P_there = (1 - pu - pv) * to_double(P[t.v0]) + pu * to_double(P[t.v1]) + pv * to_double(P[t.v2]);
      EXPECT_LT(length(P_there - expected), 1e-6);
    }
  }
}

TEST(TrianglePairs, DoNotReachOverEdgesThatWindAgainstEachOther)
{
  EXPECT_LT(pair_turns({0, 1, 2}, {0, 1, 3}).first, 0);
  EXPECT_GE(pair_turns({0, 1, 2}, {1, 0, 3}).first, 0);
  EXPECT_LT(pair_turns({0, 1, 2}, {1, 3, 4}).first, 0);
}

TEST(TrianglePairs, AreTheSameHoweverManyThereAre)
{
  // More than one thread takes at a time: all of a grid's squares are pairs.
  Mesh mesh;
  constexpr std::uint32_t kSide = 300;
  for (std::uint32_t v = 0; v < (kSide + 1) * (kSide + 1); ++v)
    mesh.P.push_back({static_cast<float>(v % (kSide + 1)), static_cast<float>(v / (kSide + 1)), 0});
  for (std::uint32_t k = 0; k < kSide * kSide; ++k) {
    const std::uint32_t a = k / kSide * (kSide + 1) + k % kSide;
    mesh.triangles.push_back({a, a + 1, a + kSide + 2});
    mesh.triangles.push_back({a, a + kSide + 2, a + kSide + 1});
  }
  const std::vector<TrianglePair> pairs = triangle_pairs_make(mesh.P, mesh.triangles);
  ASSERT_EQ(pairs.size(), std::size_t{kSide} * kSide);
  for (std::uint32_t k = 0; k < kSide * kSide; ++k) {
    EXPECT_EQ(pairs[k].first, 2 * k);
    EXPECT_GE(pairs[k].turns.first, 0);
  }
}

/// Whether two triangles that share an edge stand next to each other.
enum class Order { kPairs, kAlone };

/// A closed torus of squares that are bent, each two triangles.
Mesh torus_mesh(std::uint32_t around, std::uint32_t tube, Order order)
{
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uniform(-1, 1);
  Mesh mesh;
  for (std::uint32_t k = 0; k < around * tube; ++k) {
    const float phi = 2 * kPi * static_cast<float>(k / tube) / static_cast<float>(around),
                psi = 2 * kPi * static_cast<float>(k % tube) / static_cast<float>(tube);
    const float r = 1 + (0.3f + 0.03f * uniform(random)) * std::cos(psi);
    mesh.P.push_back({r * std::cos(phi), r * std::sin(phi), 0.3f * std::sin(psi)});
  }
  const auto vertex = [&](std::uint32_t i, std::uint32_t j) { return i % around * tube + j % tube; };
  for (std::uint32_t i = 0; i < around; ++i) {
    for (std::uint32_t j = 0; j < tube; ++j) {
      const std::uint32_t a = vertex(i, j), b = vertex(i + 1, j), c = vertex(i + 1, j + 1), d = vertex(i, j + 1);
      mesh.triangles.push_back(turned({a, b, c}, static_cast<int>(i % 3)));
      mesh.triangles.push_back(turned({a, c, d}, static_cast<int>(j % 3)));
    }
  }
  if (order == Order::kAlone) std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
  return mesh;
}

double share_of_pairs(const Mesh& mesh)
{
  return static_cast<double>(triangle_pairs_make(mesh.P, mesh.triangles).size()) /
         static_cast<double>(mesh.triangles.size());
}

/// What rays meet, asked one by one or by eights.
std::vector<RTCRayHit> hits_of(const SceneContext& context, const std::vector<TraceRay>& rays, bool by_eights)
{
  std::vector<RTCRayHit> out;
  EmbreeContext embree;
  embree_context_init(embree, false);
  for (const TraceRay& ray : rays) {
    RTCRayHit& query = out.emplace_back();
    query = {};
    query.ray = {ray.O.x, ray.O.y, ray.O.z, ray.t_min, ray.D.x, ray.D.y, ray.D.z, 0, ray.t_max, kRayBounce, 0, 0};
    query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    if (!by_eights) context.accel->intersect(embree, query);
  }
  for (std::size_t first = 0; by_eights && first + 8 <= out.size(); first += 8) {
    RTCRayHit8 packet;
    auto* const all = reinterpret_cast<RTCRayHitN*>(&packet);
    for (unsigned i = 0; i < 8; ++i) {
      const RTCRayHit& query = out[first + i];
      RTCRayN* const lanes = RTCRayHitN_RayN(all, 8);
      RTCRayN_org_x(lanes, 8, i) = query.ray.org_x;
      RTCRayN_org_y(lanes, 8, i) = query.ray.org_y;
      RTCRayN_org_z(lanes, 8, i) = query.ray.org_z;
      RTCRayN_tnear(lanes, 8, i) = query.ray.tnear;
      RTCRayN_dir_x(lanes, 8, i) = query.ray.dir_x;
      RTCRayN_dir_y(lanes, 8, i) = query.ray.dir_y;
      RTCRayN_dir_z(lanes, 8, i) = query.ray.dir_z;
      RTCRayN_time(lanes, 8, i) = 0;
      RTCRayN_tfar(lanes, 8, i) = query.ray.tfar;
      RTCRayN_mask(lanes, 8, i) = query.ray.mask;
      RTCRayN_id(lanes, 8, i) = i;
      RTCRayN_flags(lanes, 8, i) = 0;
      rtcCopyHitToHitN(RTCRayHitN_HitN(all, 8), &query.hit, 8, i);
    }
    context.accel->intersect8(embree, packet);
    for (unsigned i = 0; i < 8; ++i) {
      out[first + i].hit = rtcGetHitFromHitN(RTCRayHitN_HitN(all, 8), 8, i);
      out[first + i].ray.tfar = packet.ray.tfar[i];
    }
  }
  return out;
}

/// Where a mesh is, and whether it has a tree of its own.
struct Place {
  const char* name;
  Affine3 world_from_object;
  bool has_tree;
};

const Place kPlaces[] = {
    {"as it is", {}, false},
    {"turned, thin and far from the origin", {{0.6f, 0.8f, 0}, {-1.6f, 1.2f, 0}, {0, 0, 1e-3f}, {100, -20, 50}}, false},
    {"huge", {{1e5f, 0, 0}, {0, 0, 1e5f}, {0, -1e5f, 0}, {1, 2, 3}}, false},
    {"one of two", {{0.6f, 0.8f, 0}, {-0.8f, 0.6f, 0}, {0, 0, 1}, {3, 4, 5}}, true},
};

Scene scene_of(const Mesh& mesh, const Place& place)
{
  Scene scene = empty_scene();
  add_object(scene, mesh, diffuse_material({1, 1, 1}), place.world_from_object);
  if (place.has_tree) {
    scene.instances.push_back(scene.instances.back());
    scene.instances.back().world_from_object.p = {1e4f, 0, 0};
  }
  return scene;
}

/// Rays one by one and by eights, at what is paired, half of it, and nothing of it.
TEST(PairedMeshes, AreMetWhereTheirTrianglesAre)
{
  Mesh half = torus_mesh(60, 40, Order::kPairs);
  std::shuffle(half.triangles.begin() + 3600, half.triangles.end(), std::mt19937(4));
  const std::pair<const char*, Mesh> meshes[] = {{"pairs", torus_mesh(60, 40, Order::kPairs)},
                                                 {"pairs and triangles", half},
                                                 {"triangles", torus_mesh(60, 40, Order::kAlone)}};
  EXPECT_LT(share_of_pairs(meshes[0].second), 0.6);
  EXPECT_GT(share_of_pairs(meshes[2].second), 0.9);
  for (const auto& [name, mesh] : meshes) {
    for (const Place& place : kPlaces) {
      const Scene scene = scene_of(mesh, place);
      const SceneContext context(scene);
      std::vector<std::array<oracle::Vector3, 3>> triangles;
      for (const TriangleIndices& t : mesh.triangles) {
        const auto at = [&](std::uint32_t v) { return vector_of(transform_point(place.world_from_object, mesh.P[v])); };
        triangles.push_back({at(t.v0), at(t.v1), at(t.v2)});
      }
      const oracle::TriangleTree tree(triangles, 1e-4);
      // How far from where it is on a triangle a ray may meet it that is brought to an object's space.
      const auto rounding = [&](std::size_t k, const TraceRay& ray) {
        const auto corner = [&](std::size_t i) {
          return Vec3d{triangles[k][i][0], triangles[k][i][1], triangles[k][i][2]};
        };
        const Vec3d normal = cross(corner(1) - corner(0), corner(2) - corner(0));
        const double cosine = std::abs(dot(normal, to_double(ray.D))) / length(normal);
        return static_cast<double>(0x1p-20f * max_component(abs(ray.O))) / cosine;
      };
      std::mt19937 random(7);
      std::uniform_real_distribution<float> uniform(-1, 1);
      std::vector<TraceRay> rays;
      for (int k = 0; k < 4000; ++k) {
        const Vec3f O =
            transform_point(place.world_from_object, {2 * uniform(random), 2 * uniform(random), uniform(random)});
        const Vec3f at =
            transform_point(place.world_from_object, {uniform(random), uniform(random), 0.3f * uniform(random)});
        rays.push_back({O, normalize(at - O), 0, kInfinity});
      }
      for (const bool by_eights : {false, true}) {
        const std::vector<RTCRayHit> hits = hits_of(context, rays, by_eights);
        int num_same = 0, num_hits = 0;
        for (std::size_t k = 0; k < rays.size(); ++k) {
          const oracle::NearestTriangle oracle = tree.nearest(vector_of(rays[k].O), vector_of(rays[k].D));
          const RTCHit& hit = hits[k].hit;
          const bool is_hit = hit.geomID != RTC_INVALID_GEOMETRY_ID;
          const double t = hits[k].ray.tfar;
          if (oracle.t < HUGE_VAL) {
            ASSERT_TRUE(is_hit) << name << ' ' << place.name << " ray " << k;
            ASSERT_LT(t, oracle.t * (1 + 1e-4) + rounding(oracle.triangle, rays[k]))
                << name << ' ' << place.name << " ray " << k;
          }
          if (!is_hit) continue;
          ++num_hits;
          ASSERT_GT(t, oracle.maybe * (1 - 1e-4) - rounding(hit.primID, rays[k]))
              << name << ' ' << place.name << " ray " << k;
          if (hit.primID != oracle.triangle || oracle.maybe < oracle.t) continue;
          ++num_same;
          ASSERT_NEAR(static_cast<double>(hit.u), oracle.u, 2e-3) << name << ' ' << place.name << " ray " << k;
          ASSERT_NEAR(static_cast<double>(hit.v), oracle.v, 2e-3) << name << ' ' << place.name << " ray " << k;
        }
        EXPECT_GT(num_hits, 2000) << name << ' ' << place.name;
        EXPECT_GT(num_same, num_hits * 98 / 100) << name << ' ' << place.name;
      }
    }
  }
}

/// Rays from within a closed surface: of pairs alone, of triangles alone, and of both, in one tree and in two.
TEST(PairedMeshes, LetNoRayOut)
{
  const Mesh pairs = torus_mesh(200, 60, Order::kPairs), alone = torus_mesh(200, 60, Order::kAlone);
  const auto part = [&](const Mesh& of, bool first) {
    Mesh out = of;
    std::erase_if(out.triangles, [&](const TriangleIndices& t) {
      // Two of three squares, by the corner with the least number: most edges of squares are between the two parts.
      const std::uint32_t corner = std::min({t.v0, t.v1, t.v2});
      return ((corner / 60 + corner % 60) % 3 != 0) != first;
    });
    return out;
  };
  std::vector<std::pair<const char*, Scene>> scenes;
  struct Kind {
    const char* name;
    std::vector<Mesh> meshes;
    bool have_trees = false;
  };
  const Kind kinds[] = {{"pairs", {pairs}},
                        {"triangles", {alone}},
                        {"one tree", {part(pairs, true), part(alone, false)}},
                        {"two trees", {part(pairs, true), part(alone, false)}, true}};
  for (const auto& [name, meshes, have_trees] : kinds) {
    Scene scene = empty_scene();
    for (const Mesh& mesh : meshes) {
      add_object(scene, mesh, diffuse_material({1, 1, 1}));
      if (!have_trees) continue;
      scene.instances.push_back(scene.instances.back());
      scene.instances.back().world_from_object.p = {100, 0, 0};
    }
    scenes.emplace_back(name, std::move(scene));
  }
  const std::uint64_t num_rays = num_test_rays(400'000);
  for (const auto& [name, scene] : scenes) {
    const SceneContext context(scene);
    std::mt19937_64 random(9 + test_part());
    std::uniform_real_distribution<float> uniform(-1, 1);
    int num_out = 0, num_unseen = 0;
    EmbreeContext embree;
    embree_context_init(embree, false);
    for (std::uint64_t k = 0; k < num_rays; k += 8) {
      std::vector<TraceRay> rays;
      while (rays.size() < 8) {
        const float phi = kPi * uniform(random);
        const Vec3f D{uniform(random), uniform(random), uniform(random)};
        if (!(length(D) > 0.1f && length(D) < 1)) continue;
        rays.push_back({{std::cos(phi), std::sin(phi), 0.1f * uniform(random)}, D, 0, kInfinity});
      }
      const bool by_eights = k / 8 % 2 == 0;
      for (const RTCRayHit& query : hits_of(context, rays, by_eights))
        num_out += query.hit.geomID == RTC_INVALID_GEOMETRY_ID ? 1 : 0;
      for (const TraceRay& ray : rays) {
        RTCRay query{ray.O.x, ray.O.y, ray.O.z, 0, ray.D.x, ray.D.y, ray.D.z, 0, kInfinity, kRayShadow, 0, 0};
        context.accel->occluded(embree, query);
        num_unseen += query.tfar < 0 ? 0 : 1;
      }
    }
    EXPECT_EQ(num_out, 0) << name;
    EXPECT_EQ(num_unseen, 0) << name;
  }
}

}  // namespace
}  // namespace relief::test
