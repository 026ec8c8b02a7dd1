// Rays that leave a surface do not meet it again at their origin, at any scale, place or tilt.
#include <random>

#include "integrator/trace.h"
#include "kernel/math/rounding.h"
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
      const Vec3f target = transform_point(placement, place.instanced ? (mesh.P[0] + mesh.P[1] + mesh.P[2]) / 3.0f
                                                                      : (mesh.P[0] + mesh.P[1] + mesh.P[2]) / 3.0f);
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

/// A height field of noise under transforms whose axes are 1…64 times as long as each other, so that its valleys are narrower
/// than right angles. Along its displacement direction a height field is met only once, so any hit of a ray that leaves
/// that way, to either side, is the surface that it leaves.
TEST(DisplacedSelfIntersection, NoValleyOfAStretchedHeightFieldIsMetFromWithin)
{
  constexpr int kSize = 256;
  const std::vector<std::uint16_t> texels = noise_texels(kSize, 3);
  std::mt19937 random(12345);
  std::uniform_real_distribution<float> uniform(-1, 1);
  const auto rotation = [&] {
    const Frame f = frame_from_normal(normalize(Vec3f{uniform(random), uniform(random), uniform(random)}));
    return Affine3{f.s, f.t, f.n, {}};
  };
  for (const Vec3f scale : {Vec3f{1, 1, 1}, Vec3f{16, 1, 1}, Vec3f{1, 1, 16}, Vec3f{64, 1, 64}, Vec3f{1, 64, 8},
                            Vec3f{1, 1, 64}, Vec3f{1.0f / 64, 1, 1}}) {
    for (int place = 0; place < 5; ++place) {
      const float far = place == 4 ? 100.0f : 0.0f;
      const Affine3 stretch{{scale.x, 0, 0}, {0, scale.y, 0}, {0, 0, scale.z}, {far, 2 * far, -far}};
      const Affine3 placement = place == 1   ? rotation() * stretch
                                : place == 2 ? stretch * rotation()
                                : place == 3 ? rotation() * stretch * rotation()
                                             : stretch;
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
      int self_hits = 0;
      for (const TraceHit& h : trace_rays(context, leaving)) self_hits += h.hit ? 1 : 0;
      EXPECT_EQ(self_hits, 0) << scale.x << " " << scale.y << " " << scale.z << ", placement " << place;
    }
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
