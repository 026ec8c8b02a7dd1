// Rays that leave a surface do not meet it again at their origin, at any scale, place or tilt.
#include <random>

#include "displacement/tessellation_lattice.h"
#include "integrator/scene_context.h"
#include "integrator/trace.h"
#include "kernel/math/rounding.h"
#include "kernel/sample/warp.h"
#include "kernel/shape/surface_hit.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

struct Place {
  float scale, offset;
  bool instanced;
};

class SelfIntersection : public testing::TestWithParam<Place> {};

/// Random triangles, seen from random origins; from every hit, rays leave on both sides at random and at grazing angles.
/// The triangle is alone and flat, so any hit of a leaving ray is a self-intersection.
TEST_P(SelfIntersection, LeavingRaysDoNotComeBack)
{
  const Place place = GetParam();
  std::mt19937 random(12345);
  std::uniform_real_distribution<float> uniform(-1, 1);
  const auto point = [&] { return Vec3f{uniform(random), uniform(random), uniform(random)}; };
  int hits = 0;
  for (int trial = 0; trial < 400; ++trial) {
    Scene scene = empty_scene();
    Mesh mesh;
    const Vec3f center = point() * place.offset;
    Affine3 placement;
    if (place.instanced) {
      mesh.P = {point(), point(), point()};
      const Frame frame = frame_from_normal(normalize(point()));
      placement = {frame.s * place.scale, frame.t * (place.scale * 0.3f), frame.n * (place.scale * 2.0f), center};
    } else {
      mesh.P = {center + point() * place.scale, center + point() * place.scale, center + point() * place.scale};
    }
    mesh.triangles = {{0, 1, 2}};
    add_object(scene, mesh, diffuse_material({1, 1, 1}), placement);
    if (place.instanced) {
      scene.instances.push_back(scene.instances.back());
      scene.instances.back().flags = 0;
      scene.instances.back().world_from_object.p = center + Vec3f{0, 1e6f * place.scale, 0};
    }
    const SceneContext context(scene);

    std::vector<TraceRay> rays;
    for (int i = 0; i < 64; ++i) {
      const Vec3f O = center + point() * (3 * place.scale);
      const Vec3f target = transform_point(placement, (mesh.P[0] + mesh.P[1] + mesh.P[2]) / 3.0f);
      rays.push_back({O, normalize(target + point() * (0.3f * place.scale) - O), 0, kInfinity});
    }
    std::vector<TraceRay> leaving;
    for (const TraceHit& h : trace_rays(context, rays)) {
      if (!h.hit) continue;
      ++hits;
      const SurfaceHit surface = surface_hit_make(
          context.meshes[0], context.instances[static_cast<std::size_t>(h.instance_index)], h.triangle_index, h.u, h.v);
      const Frame frame = frame_from_normal(surface.Ng);
      for (int i = 0; i < 32; ++i) {
        const Vec3f side = i % 2 == 0 ? surface.Ng : -surface.Ng;
        const Vec3f O = offset_ray_origin(surface.P, surface.P_error, side);
        const float height = i < 16 ? std::fabs(uniform(random)) : std::exp(12 * uniform(random) - 13);
        const Vec3f flat = normalize(Vec3f{uniform(random), uniform(random), 0});
        leaving.push_back({O, normalize(from_local(frame, flat) + side * height), kLeastDistance, kInfinity});
      }
    }
    for (const TraceHit& h : trace_rays(context, leaving)) {
      EXPECT_FALSE(h.hit) << "trial " << trial << " t " << h.t;
    }
  }
  EXPECT_GT(hits, 2000);
}

INSTANTIATE_TEST_SUITE_P(,
                         SelfIntersection,
                         testing::Values(Place{1, 0, false},
                                         Place{1, 1000, false},
                                         Place{1e-3f, 1, false},
                                         Place{1e4f, 1e5f, false},
                                         Place{1, 0, true},
                                         Place{1, 1000, true},
                                         Place{1e-3f, 10, true},
                                         Place{1e4f, 1e5f, true}));

/// Closed meshes, and paths that are scattered inside: none may get out past an edge, where the face beyond is as near as origins
/// are moved. Around the world's origin and away from it, where rounding is larger.
TEST(ClosedMesh, NoPathGetsOutPastAnEdge)
{
  constexpr int kNumPaths = 16384, kBounces = 64;
  const auto wedge = [](float degrees) {
    Mesh mesh;
    const float x = std::cos(degrees * kPi / 180), y = std::sin(degrees * kPi / 180);
    mesh.P = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {1, 0, 1}, {x, y, 0}, {x, y, 1}};
    mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {0, 1, 5}, {0, 5, 4}, {2, 4, 5}, {2, 5, 3}, {0, 4, 2}, {1, 3, 5}};
    return mesh;
  };
  Mesh tetrahedron;
  tetrahedron.P = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  tetrahedron.triangles = {{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}};
  std::mt19937 random(7);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (const float away : {0.0f, 3.3f, 100.0f}) {
    for (Mesh mesh : {tetrahedron, wedge(30), wedge(6), wedge(2)}) {
      Vec3f middle;
      for (Vec3f& P : mesh.P) {
        P += Vec3f{away, -0.7f * away, 0.3f * away};
        middle += P / static_cast<float>(mesh.P.size());
      }
      Scene scene = empty_scene();
      add_object(scene, mesh, diffuse_material({1, 1, 1}));
      const SceneContext context(scene);
      std::vector<TraceRay> rays;
      for (int i = 0; i < kNumPaths; ++i) {
        rays.push_back({middle, warp_sphere({uniform(random), uniform(random)}), kLeastDistance, kInfinity});
      }
      for (int bounce = 0; bounce < kBounces; ++bounce) {
        const std::vector<TraceHit> hits = trace_rays(context, rays);
        for (std::size_t i = 0; i < hits.size(); ++i) {
          ASSERT_TRUE(hits[i].hit) << mesh.P.size() << " vertices, " << away << " m away, bounce " << bounce;
          const SurfaceHit at = surface_hit_make(context.meshes[0], context.instances[0], hits[i].triangle_index,
                                                 hits[i].u, hits[i].v);
          const bool front = dot(at.Ng, middle - at.P) > 0.0f;
          const Vec3f D = warp_cosine_hemisphere({uniform(random), uniform(random)});
          rays[i] = {surface_hit_origin(at, at.P, front), from_local(frame_from_normal(front ? at.Ng : -at.Ng), D),
                     kLeastDistance, kInfinity};
        }
      }
    }
  }
}

/// Axes that are 1…64 times as long as each other: valleys become narrower than right angles.
constexpr Vec3f kStretches[] = {{1, 1, 1},  {16, 1, 1}, {1, 1, 16},       {64, 1, 64},
                                {1, 64, 8}, {1, 1, 64}, {1.0f / 64, 1, 1}};
constexpr int kNumPlaces = 5;

/// A stretch alone, turned before, after, or both, or far from the origin.
Affine3 stretched_placement(Vec3f scale, int place, std::mt19937& random)
{
  std::uniform_real_distribution<float> uniform(-1, 1);
  const auto rotation = [&] {
    const Frame f = frame_from_normal(normalize(Vec3f{uniform(random), uniform(random), uniform(random)}));
    return Affine3{f.s, f.t, f.n, {}};
  };
  const float far = place == 4 ? 100.0f : 0.0f;
  const Affine3 stretch{{scale.x, 0, 0}, {0, scale.y, 0}, {0, 0, scale.z}, {far, 2 * far, -far}};
  if (place == 1) return rotation() * stretch;
  if (place == 2) return stretch * rotation();
  return place == 3 ? rotation() * stretch * rotation() : stretch;
}

/// Counts the rays that hit something.
int num_hits(const SceneContext& context, const std::vector<TraceRay>& rays)
{
  int count = 0;
  for (const TraceHit& h : trace_rays(context, rays)) count += h.hit ? 1 : 0;
  return count;
}

/// A height field of noise. Along its displacement direction it is met only once, so any hit of a ray that leaves
/// that way, to either side, is the surface that it leaves.
TEST(DisplacedSelfIntersection, NoValleyOfAStretchedHeightFieldIsMetFromWithin)
{
  constexpr int kSize = 256;
  const std::vector<std::uint16_t> texels = noise_texels(kSize, 3);
  std::mt19937 random(12345);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (const Vec3f scale : kStretches) {
    for (int place = 0; place < kNumPlaces; ++place) {
      const Affine3 placement = stretched_placement(scale, place, random);
      Scene scene = empty_scene();
      Mesh plane = quad_mesh({-2, -2, 0}, {4, 0, 0}, {0, 4, 0});
      plane.uv[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
      Material material = diffuse_material({1, 1, 1});
      material.displacement_index = 0;
      add_object(scene, plane, material, placement);
      add_displacement(scene, kSize, texels, 0.003f);
      const SceneContext context(scene);

      std::vector<TraceRay> rays, leaving;
      for (int i = 0; i < 20'000; ++i) {
        const Vec3f O = transform_point(placement, {3 * uniform(random), 3 * uniform(random), i % 2 ? 2.0f : -2.0f});
        const Vec3f target = transform_point(placement, {1.9f * uniform(random), 1.9f * uniform(random), 0});
        rays.push_back({O, target - O, 0, kInfinity});
      }
      const Vec3f up = normalize(placement.z);
      for (const TraceHit& h : trace_rays(context, rays)) {
        if (!h.hit) continue;
        const bool upward = dot(h.Ng, up) > 0;
        leaving.push_back({h.O_front, upward ? up : -up, kLeastDistance, kInfinity});
        leaving.push_back({h.O_back, upward ? -up : up, kLeastDistance, kInfinity});
      }
      EXPECT_GT(leaving.size(), 39'900u);
      EXPECT_EQ(num_hits(context, leaving), 0)
          << scale.x << " " << scale.y << " " << scale.z << ", placement " << place;
    }
  }
}

/// The same of micro-triangles, from points on their sides and very near to them.
TEST(DisplacedSelfIntersection, NoValleyOfATessellationIsMetFromWithin)
{
  constexpr int kSize = 64;
  const std::vector<std::uint16_t> texels = noise_texels(kSize, 3);
  std::mt19937 random(12345);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (const DisplacementMethod method :
       {DisplacementMethod::tessellate, DisplacementMethod::tessellate_grid, DisplacementMethod::kAuto}) {
    for (const Vec3f scale : kStretches) {
      for (int place = 0; place < kNumPlaces; ++place) {
        const Affine3 placement = stretched_placement(scale, place, random);
        Scene scene = empty_scene();
        Mesh plane = quad_mesh({-2, -2, 0}, {4, 0, 0}, {0, 4, 0});
        plane.uv[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
        Material material = diffuse_material({1, 1, 1});
        material.displacement_index = 0;
        add_object(scene, plane, material, placement);
        add_displacement(scene, kSize, texels, 0.1f);
        DisplacementOptions options;
        options.method = method;
        if (method == DisplacementMethod::kAuto) {
          options.error = 2;
          options.camera = scene.cameras[0].camera;
          options.camera->world_from_camera = placement * options.camera->world_from_camera;
          options.picture_height = 200;
          options.num_rays = 1e9;
        }
        const SceneContext context(scene, options);
        const Tessellation* tessellation = context.displacements.tessellation(0);
        ASSERT_NE(tessellation, nullptr);

        std::vector<TraceRay> rays, leaving;
        for (int i = 0; i < 5'000; ++i) {
          const auto primitive = static_cast<std::uint32_t>(random() % tessellation->layout().num_primitives);
          const float along = std::fabs(uniform(random)), beside = i % 2 == 0 ? 0.0f : 1e-6f * uniform(random);
          float u = along, v = std::fabs(beside);
          if (tessellation->layout().kind != TessellationKind::kQuads) {
            // Between two columns of the grid.
            const TessellatedTriangle& t =
                tessellation->layout().triangles[tessellation->locate(primitive, 0, 0).triangle];
            const bool is_block = tessellation->layout().kind == TessellationKind::kBlocks;
            const auto block = LatticeBlocks(t.segments).block(is_block ? primitive - t.first_primitive : 0);
            const auto n = static_cast<float>(is_block ? block.cells : t.segments);
            v = (std::floor(n * std::fabs(uniform(random))) + v) / n;
            // Beyond the third side there is nothing.
            if (is_block && n * (u + v) > static_cast<float>(t.segments - block.i - block.j)) continue;
          }
          if (i % 3 == 0) std::swap(u, v);
          const Vec3f target = to_float(tessellation->hit(primitive, u, v).P);
          if (std::max(std::fabs(target.x), std::fabs(target.y)) > 1.95f) continue;
          const Vec3f from{3 * uniform(random), 3 * uniform(random), i % 4 < 2 ? 2.0f : -2.0f};
          const Vec3f O = transform_point(placement, from);
          rays.push_back({O, transform_point(placement, target) - O, 0, kInfinity});
        }
        const Vec3f up = normalize(placement.z);
        for (const TraceHit& h : trace_rays(context, rays)) {
          if (!h.hit) continue;
          const bool upward = dot(h.Ng, up) > 0;
          leaving.push_back({h.O_front, upward ? up : -up, kLeastDistance, kInfinity});
          leaving.push_back({h.O_back, upward ? -up : up, kLeastDistance, kInfinity});
        }
        EXPECT_GT(leaving.size(), 4'000u);
        // Diced, 13 of two million remain (14 as quadrilaterals): in three of these cases, where a side of one step meets thirty rows, and
        // as many slivers one corner.
        EXPECT_LE(num_hits(context, leaving), method == DisplacementMethod::kAuto ? 6 : 0)
            << displacement_method_label(method) << ", " << scale.x << " " << scale.y << " " << scale.z
            << ", placement " << place;
      }
    }
  }
}

/// A floor at height 0 whose heights are 0: its points have a coordinate that is exact, and so no error in proportion to it.
/// What the tracer's doubles leave of the large ones is all that rays have to be moved out of.
TEST(DisplacedSelfIntersection, LevelGroundAtZeroIsLeft)
{
  constexpr int kSize = 8;
  std::mt19937 random(12345);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (const float size : {1e-3f, 1.0f, 1e4f}) {
    for (const Vec3f scale : {Vec3f{1, 1, 1}, Vec3f{4, 0.5f, 64}}) {
      std::vector<std::uint16_t> texels(kSize * kSize, 0);
      texels[0] = 65535;
      Scene scene = empty_scene();
      Mesh plane = quad_mesh({-size, -size, 0}, {2 * size, 0, 0}, {0, 2 * size, 0});
      plane.uv[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
      Material material = diffuse_material({1, 1, 1});
      material.displacement_index = 0;
      const Affine3 placement{{scale.x, 0, 0}, {0, scale.y, 0}, {0, 0, scale.z}, {}};
      add_object(scene, plane, material, placement);
      add_displacement(scene, kSize, texels, 0.1f * size).midlevel = 0;
      const SceneContext context(scene);

      std::vector<TraceRay> rays, leaving;
      for (int i = 0; i < 5000; ++i) {
        // Close to the middle and far from it; away from the peak at the corner.
        const float reach = i % 2 == 0 ? 0.5f * size : 1e-4f * size;
        const Vec3f target{reach * uniform(random), reach * uniform(random), 0};
        rays.push_back({transform_point(placement, target + Vec3f{0, 0, size}), {0, 0, -1}, 0, kInfinity});
      }
      for (const TraceHit& h : trace_rays(context, rays)) {
        if (!h.hit) continue;
        for (int i = 0; i < 8; ++i) {
          const float rise = std::exp(12 * uniform(random) - 13);
          const Vec3f flat = normalize(Vec3f{uniform(random), uniform(random), 0});
          leaving.push_back({h.O_front, flat + Vec3f{0, 0, rise}, kLeastDistance, 0.1f * size});
          leaving.push_back({h.O_back, flat - Vec3f{0, 0, rise}, kLeastDistance, 0.1f * size});
        }
      }
      EXPECT_EQ(leaving.size(), 80'000u);
      EXPECT_EQ(num_hits(context, leaving), 0) << size << ", stretched by " << scale.z;
    }
  }
}

/// A globe of 24 × 12 quads whose map repeats around it. Where its first column is its last, vertices are equal.
Mesh globe_mesh()
{
  constexpr std::size_t kColumns = 24, kRows = 12;
  Mesh globe = sphere_mesh(1, kColumns, kRows, true);
  for (std::size_t r = 0; r <= kRows; ++r) {
    const std::size_t row = r * (kColumns + 1);
    globe.P[row + kColumns] = globe.P[row];
    globe.N[row + kColumns] = globe.N[row];
    for (std::size_t c = 0; c <= kColumns; ++c)
      globe.uv[0].push_back({static_cast<float>(c) / kColumns, static_cast<float>(r) / kRows});
  }
  return globe;
}

/// Rays that leave along the displacement direction from the edges and corners of base triangles, outward and inward.
/// Seen from inside, a flattened globe is a valley narrower than a right angle along all of its rim. Displacement lines meet
/// its surface only once on this side of the centre. Not from the rows at the poles, where the map is not continuous.
TEST(DisplacedSelfIntersection, NoNeighborOfABaseTriangleIsMetFromWithin)
{
  constexpr int kSize = 256;
  constexpr std::size_t kInPolarRows = 3 * 24;
  const std::vector<std::uint16_t> texels = noise_texels(kSize, 3);
  const Mesh globe = globe_mesh();
  std::mt19937 random(12345);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (const Vec3f scale : kStretches) {
    for (int place = 0; place < kNumPlaces; ++place) {
      const Affine3 placement = stretched_placement(scale, place, random);
      Scene scene = empty_scene();
      Material material = diffuse_material({1, 1, 1});
      material.displacement_index = 0;
      add_object(scene, globe, material, placement);
      add_displacement(scene, kSize, texels, 0.003f);
      const SceneContext context(scene);

      std::vector<TraceRay> rays, leaving;
      for (int i = 0; i < 20'000; ++i) {
        const TriangleIndices t =
            globe.triangles[kInPolarRows + random() % (globe.triangles.size() - 2 * kInPolarRows)];
        const std::uint32_t vertices[4] = {t.v0, t.v1, t.v2, t.v0};
        const std::size_t side = random() % 3;
        const float f = i % 16 == 0 ? 0.0f : uniform(random);
        const Vec3f target = (1 - f) * globe.P[vertices[side]] + f * globe.P[vertices[side + 1]];
        const Vec3f beside{uniform(random) - 0.5f, uniform(random) - 0.5f, uniform(random) - 0.5f};
        const Vec3f O = transform_point(placement, 2.0f * normalize(target) + 0.6f * beside);
        rays.push_back({O, transform_point(placement, target) - O, 0, kInfinity});
      }
      for (const TraceHit& h : trace_rays(context, rays)) {
        if (!h.hit) continue;
        const TriangleIndices t = globe.triangles[h.triangle_index];
        const Vec3f N = (1 - h.u - h.v) * as_vector(globe.N[t.v0]) + h.u * as_vector(globe.N[t.v1]) +
                        h.v * as_vector(globe.N[t.v2]);
        const Vec3f out = transform_vector(placement, N);
        leaving.push_back({h.O_front, out, kLeastDistance, kInfinity});
        leaving.push_back({h.O_back, -out, kLeastDistance, 0.8f});
      }
      EXPECT_GT(leaving.size(), 39'900u);
      EXPECT_EQ(num_hits(context, leaving), 0)
          << scale.x << " " << scale.y << " " << scale.z << ", placement " << place;
    }
  }
}

/// A cube whose sides read a map of noise at places of their own, with normals in common: walls close the seams. Paths that are
/// scattered inside must not get out where a wall meets the surface.
TEST(ClosedMesh, NoPathGetsOutPastAWeldedSeam)
{
  constexpr int kNumPaths = 16384, kBounces = 32, kSize = 64;
  Mesh cube;
  const auto corner = [](int i) { return Vec3f{i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 1.0f : -1.0f}; };
  const int sides[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (std::uint32_t side = 0; side < 6; ++side) {
    for (const int i : sides[side]) {
      cube.P.push_back(corner(i));
      cube.N.push_back(as_normal(normalize(corner(i))));
    }
    const float u = 0.3f * static_cast<float>(side);
    cube.uv[0].insert(cube.uv[0].end(), {{u, 0}, {u + 0.2f, 0}, {u + 0.2f, 0.2f}, {u, 0.2f}});
    cube.triangles.push_back({4 * side, 4 * side + 1, 4 * side + 2});
    cube.triangles.push_back({4 * side, 4 * side + 2, 4 * side + 3});
  }
  std::mt19937 random(7);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (const float away : {0.0f, 3.3f, 100.0f}) {
    Scene scene = empty_scene();
    Material material = diffuse_material({1, 1, 1});
    material.displacement_index = 0;
    const Vec3f middle{away, -0.7f * away, 0.3f * away};
    add_object(scene, cube, material, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, middle});
    add_displacement(scene, kSize, noise_texels(kSize, 3), 0.4f).weld_seams = true;
    const SceneContext context(scene);
    std::vector<TraceRay> rays;
    for (int i = 0; i < kNumPaths; ++i) {
      rays.push_back({middle, warp_sphere({uniform(random), uniform(random)}), kLeastDistance, kInfinity});
    }
    int num_out = 0;
    for (int bounce = 0; bounce < kBounces; ++bounce) {
      const std::vector<TraceHit> hits = trace_rays(context, rays);
      for (std::size_t i = 0; i < hits.size(); ++i) {
        const TraceHit& hit = hits[i];
        if (!hit.hit) {
          ++num_out;
          rays[i] = {middle, warp_sphere({uniform(random), uniform(random)}), kLeastDistance, kInfinity};
          continue;
        }
        const bool front = dot(hit.Ng, rays[i].D) < 0.0f;
        const Vec3f D = warp_cosine_hemisphere({uniform(random), uniform(random)});
        rays[i] = {front ? hit.O_front : hit.O_back, from_local(frame_from_normal(front ? hit.Ng : -hit.Ng), D),
                   kLeastDistance, kInfinity};
      }
    }
    EXPECT_EQ(num_out, 0) << away << " m away, of " << kNumPaths * kBounces;
  }
}

TEST(ShadowTerminator, CoarseSphereIsLitLikeAFineOne)
{
  // Point light, so that nothing softens the terminator. Without the lift the coarse sphere's facets shadow
  // themselves: whole facets turn black and the error triples.
  const auto lit = [](int columns) {
    Scene scene = empty_scene();
    add_object(scene, sphere_mesh(1, columns, columns / 2, true), diffuse_material({1, 1, 1}));
    Light light;
    light.P = {6, 4, 2};
    light.emission = {50, 50, 50};
    scene.lights.push_back(light);
    scene.render.max_bounces = scene.render.diffuse_bounces = 0;
    return render_scene(scene, render_options(scene, 64, 16));
  };
  const Rendered fine = lit(512);
  const Rendered coarse = lit(32);
  double squared = 0;
  double energy = 0;
  int black = 0;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const float a = fine.radiance(x, y).x;
      const float b = coarse.radiance(x, y).x;
      // Silhouettes differ by coverage, which is not the question.
      if (fine.at(Aov::kBeauty, x, y)[3] < 1 || coarse.at(Aov::kBeauty, x, y)[3] < 1) continue;
      squared += sqr(a - b);
      energy += sqr(a);
      black += a > 0.02f && b == 0.0f ? 1 : 0;
    }
  }
  EXPECT_EQ(black, 0);
  EXPECT_LT(std::sqrt(squared / energy), 0.02);
}

}  // namespace
}  // namespace relief::test
