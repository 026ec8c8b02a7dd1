// Scenes of boxes that media fill, seen through a small window, whose light is known. Statistical comparisons as in
// analytic_scenes_test.cpp: 16 runs, 5.2 standard errors.
#pragma once

#include <cmath>
#include <utility>

#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {

inline constexpr int kRuns = 16;
inline constexpr double kQuantile = 5.2;

inline void expect_mean(const Scene& scene, int samples, double truth, double absolute, int channel = 0)
{
  const Estimate estimate = estimate_mean(scene, render_options(scene, 8, samples), kRuns, channel);
  EXPECT_NEAR(estimate.mean, truth, kQuantile * estimate.standard_error + absolute)
      << "standard error " << estimate.standard_error;
  // Else the comparison would tell nothing.
  EXPECT_LT(estimate.standard_error, 0.02 * truth + 1e-9);
}

/// A box around the origin, seen counter-clockwise from outside.
inline Mesh box_mesh(Vec3f half)
{
  Mesh mesh;
  const auto add = [&mesh](Vec3f P, Vec3f u, Vec3f v) {
    const Mesh quad = quad_mesh(P, u, v);
    const auto first = static_cast<std::uint32_t>(mesh.P.size());
    mesh.P.insert(mesh.P.end(), quad.P.begin(), quad.P.end());
    for (const TriangleIndices& t : quad.triangles) {
      mesh.triangles.push_back({first + t.v0, first + t.v1, first + t.v2});
    }
  };
  const Vec3f x{2 * half.x, 0, 0}, y{0, 2 * half.y, 0}, z{0, 0, 2 * half.z};
  const Vec3f low = -half, high = half;
  add(low, y, x);
  add(low, z, y);
  add(low, x, z);
  add(high, -x, -y);
  add(high, -y, -z);
  add(high, -z, -x);
  return mesh;
}

/// Looks along −z from (0, 0, 4) through a window of 1e-4, past the diagonals of boxes.
inline Scene view()
{
  Scene scene = empty_scene();
  scene.cameras[0].camera.world_from_camera.p = {0.1f, 0.03f, 4};
  scene.cameras[0].camera.half_width = scene.cameras[0].camera.half_height = 1e-4f;
  scene.render.max_bounces = scene.render.diffuse_bounces = scene.render.volume_bounces = 0;
  return scene;
}

inline void add_medium(Scene& scene, Mesh mesh, const Medium& medium, Vec3f at = {})
{
  Material material = diffuse_material({1, 1, 1});
  material.alpha_mode = AlphaMode::kBlend;
  material.base_alpha = 0;
  material.is_boundary = true;
  material.medium_index = static_cast<int>(scene.media.size());
  scene.media.push_back(medium);
  Affine3 place;
  place.p = at;
  add_object(scene, std::move(mesh), material, place);
}

inline Medium absorbing(Vec3f sigma)
{
  Medium medium;
  medium.sigma_t = sigma;
  return medium;
}

inline Medium scattering(Vec3f sigma_s, float g, Vec3f sigma_a = {})
{
  Medium medium;
  medium.sigma_t = sigma_s + sigma_a;
  medium.phases[medium.num_phases++] = {sigma_s, g};
  return medium;
}

}  // namespace relief::test
