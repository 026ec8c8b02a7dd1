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
