// Interpolation against closed forms.
#include "scene/animation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene/load.h"
#include "tests/support/gltf_builder.h"

namespace relief {
namespace {

constexpr double kHalf = 0.70710678118654752;

AnimationCurve positions(Interpolation interpolation, std::vector<float> times, std::vector<float> values)
{
  return {interpolation, false, std::move(times), std::move(values)};
}

TEST(Animation, LinearIsAStraightLine)
{
  const AnimationCurve c = positions(Interpolation::kLinear, {1, 3}, {0, 10, -4, 2, 20, 4});
  const auto v = animation_sample(c, 1.5);
  EXPECT_DOUBLE_EQ(v[0], 0.5);
  EXPECT_DOUBLE_EQ(v[1], 12.5);
  EXPECT_DOUBLE_EQ(v[2], -2);
}

TEST(Animation, IsClampedAtItsEnds)
{
  for (const Interpolation i : {Interpolation::kStep, Interpolation::kLinear}) {
    const AnimationCurve c = positions(i, {1, 3}, {0, 0, 0, 2, 0, 0});
    EXPECT_DOUBLE_EQ(animation_sample(c, -100)[0], 0);
    EXPECT_DOUBLE_EQ(animation_sample(c, 1)[0], 0);
    EXPECT_DOUBLE_EQ(animation_sample(c, 3)[0], 2);
    EXPECT_DOUBLE_EQ(animation_sample(c, 100)[0], 2);
  }
}

TEST(Animation, StepHoldsUntilTheNextKey)
{
  const AnimationCurve c = positions(Interpolation::kStep, {0, 1, 2}, {5, 0, 0, 6, 0, 0, 7, 0, 0});
  EXPECT_DOUBLE_EQ(animation_sample(c, 0.999)[0], 5);
  EXPECT_DOUBLE_EQ(animation_sample(c, 1)[0], 6);
  EXPECT_DOUBLE_EQ(animation_sample(c, 1.999)[0], 6);
}

TEST(Animation, OneKeyIsAConstant)
{
  const AnimationCurve c = positions(Interpolation::kLinear, {1}, {5, 6, 7});
  EXPECT_DOUBLE_EQ(animation_sample(c, 0)[1], 6);
  EXPECT_DOUBLE_EQ(animation_sample(c, 2)[2], 7);
}

// Hermite data taken from a cubic, f(t) = t³ − 2t² + 3t − 1 on [1, 3], gives that cubic back.
TEST(Animation, CubicSplineReproducesACubic)
{
  const auto f = [](double t) { return t * t * t - 2 * t * t + 3 * t - 1; };
  const auto df = [](double t) { return static_cast<float>(3 * t * t - 4 * t + 3); };
  const auto value = [&](double t) { return static_cast<float>(f(t)); };
  const AnimationCurve c = positions(Interpolation::kCubicSpline, {1, 3},
                                     {99, 0, 0, value(1), 0, 0, df(1), 0, 0, df(3), 0, 0, value(3), 0, 0, 99, 0, 0});
  for (double t = 1; t <= 3; t += 0.125) {
    EXPECT_NEAR(animation_sample(c, t)[0], f(t), 1e-12);
  }
  EXPECT_NEAR(animation_sample(c, 0)[0], f(1), 1e-12);
}

TEST(Animation, RotationsTurnAtConstantSpeed)
{
  const AnimationCurve c{
      Interpolation::kLinear, true, {0, 1}, {0, 0, 0, 1, 0, static_cast<float>(kHalf), 0, static_cast<float>(kHalf)}};
  for (double t = 0; t <= 1; t += 0.1) {
    const auto q = animation_sample(c, t);
    const double half_angle = t * 0.25 * 3.14159265358979323846;
    EXPECT_NEAR(q[1], std::sin(half_angle), 1e-7);
    EXPECT_NEAR(q[3], std::cos(half_angle), 1e-7);
  }
}

// q and −q are one rotation: going from q to −q' must not turn the long way.
TEST(Animation, RotationsTakeTheShorterArc)
{
  const AnimationCurve c{
      Interpolation::kLinear, true, {0, 1}, {0, 0, 0, 1, 0, static_cast<float>(-kHalf), 0, static_cast<float>(-kHalf)}};
  const auto q = animation_sample(c, 0.5);
  const double angle = 0.125 * 3.14159265358979323846;
  EXPECT_NEAR(std::fabs(q[3]), std::cos(angle), 1e-7);
  EXPECT_NEAR(std::fabs(q[1]), std::sin(angle), 1e-7);
}

TEST(Animation, EqualRotationsStayPut)
{
  const AnimationCurve c{Interpolation::kLinear, true, {0, 1}, {0, 0.6f, 0, 0.8f, 0, 0.6f, 0, 0.8f}};
  const auto q = animation_sample(c, 0.3);
  EXPECT_NEAR(q[1], 0.6, 1e-7);
  EXPECT_NEAR(q[3], 0.8, 1e-7);
}

TEST(Animation, SplinesOfRotationsAreUnit)
{
  const AnimationCurve c{Interpolation::kCubicSpline, true, {0, 1}, {0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 0,
                                                                     0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0}};
  for (double t = 0; t <= 1; t += 0.1) {
    const auto q = animation_sample(c, t);
    EXPECT_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1, 1e-12);
  }
}

/// A square that moves from x = 0 to x = 10 within a second.
test::GltfBuilder moving_square()
{
  test::GltfBuilder b = test::square_scene();
  const int times = b.accessor<float>({0, 1}, "SCALAR"), moves = b.accessor<float>({0, 0, 0, 10, 0, 0}, "VEC3");
  b.json["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}},
                           {"samplers", {{{"input", times}, {"output", moves}}}}}};
  b.json["nodes"][0]["scale"] = {2, 2, 2};
  b.json["nodes"][0]["translation"] = {-3, 0, 0};
  return b;
}

TEST(Animation, FrameIsTimeTimesFramesPerSecond)
{
  test::GltfBuilder b = moving_square();
  b.json["extensions"]["RELIEF_render"]["fps"] = 20;
  const test::TemporaryFolder folder;
  const auto file = folder.write("scene.gltf", b.gltf());
  LoadOptions options;
  options.has_frame = true;
  options.frame = 5;
  const Scene scene = scene_load(file, options);
  EXPECT_FLOAT_EQ(scene.instances.at(0).world_from_object.p.x, 2.5f);
  EXPECT_FLOAT_EQ(scene.instances.at(0).world_from_object.x.x, 2.0f);  // what is not animated stays
}

TEST(Animation, WithoutAFrameTheNodeKeepsItsOwnPose)
{
  const test::TemporaryFolder folder;
  const Scene scene = scene_load(folder.write("scene.gltf", moving_square().gltf()));
  EXPECT_FLOAT_EQ(scene.instances.at(0).world_from_object.p.x, -3.0f);
}

TEST(Animation, WhatIsShrunkToNothingIsLeftOutWithAWarning)
{
  test::GltfBuilder b = moving_square();
  const int sizes = b.accessor<float>({0, 0, 0, 1, 1, 1}, "VEC3");
  b.json["animations"][0]["samplers"][0]["output"] = sizes;
  b.json["animations"][0]["channels"][0]["target"]["path"] = "scale";
  const test::TemporaryFolder folder;
  const auto file = folder.write("scene.gltf", b.gltf());
  LoadOptions options;
  options.has_frame = true;
  EXPECT_TRUE(scene_load(file, options).instances.empty());
  options.frame = 12;
  EXPECT_EQ(scene_load(file, options).instances.size(), 1u);
}

}  // namespace
}  // namespace relief
