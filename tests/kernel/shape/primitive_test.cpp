// What the door to primitives gives is what their vertices have, by weights that are worked out here in double precision; and what graphs
// read where there is none.
#include "kernel/shape/primitive.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "kernel/graph/graph_material.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

/// Random triangles under a random placement.
class Primitive : public testing::Test {
 protected:
  static constexpr std::uint32_t kTriangles = 50;

  Primitive()
  {
    for (std::uint32_t i = 0; i < 3 * kTriangles; ++i) {
      P_.push_back(vector());
      N_.push_back(as_normal(vector()));
      generated_.push_back(vector());
      for (int c = 0; c < 4; ++c) values_.push_back(random_.next());
    }
    for (std::uint32_t i = 0; i < kTriangles; ++i) triangles_.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    mesh_.P = P_.data();
    mesh_.N = N_.data();
    mesh_.generated = generated_.data();
    mesh_.triangles = triangles_.data();
    instance_.world_from_object = {vector(), vector(), vector(), vector()};
    instance_.object_from_world = inverse(instance_.world_from_object);
  }

  Vec3f vector() { return {2 * random_.next() - 1, 2 * random_.next() - 1, 2 * random_.next() - 1}; }
  PrimitivePlace place(std::uint32_t triangle)
  {
    const float u = random_.next();
    return {&mesh_, triangle, u, (1 - u) * random_.next()};
  }
  static double mean(const PrimitivePlace& at, double a, double b, double c)
  {
    const double u = static_cast<double>(at.u), v = static_cast<double>(at.v);
    return (1 - u - v) * a + u * b + v * c;
  }
  static void expect_mean(const PrimitivePlace& at, Vec3f found, Vec3f a, Vec3f b, Vec3f c)
  {
    const auto d = [](float x) { return static_cast<double>(x); };
    EXPECT_NEAR(d(found.x), mean(at, d(a.x), d(b.x), d(c.x)), 1e-6);
    EXPECT_NEAR(d(found.y), mean(at, d(a.y), d(b.y), d(c.y)), 1e-6);
    EXPECT_NEAR(d(found.z), mean(at, d(a.z), d(b.z), d(c.z)), 1e-6);
  }

  TestRandom random_{11};
  std::vector<Vec3f> P_, generated_;
  std::vector<Normal3f> N_;
  std::vector<float> values_;
  std::vector<TriangleIndices> triangles_;
  MeshView mesh_;
  InstanceView instance_;
};

TEST_F(Primitive, IsReadByTheWeightsOfItsVertices)
{
  for (std::uint32_t i = 0; i < kTriangles; ++i) {
    const PrimitivePlace at = place(i);
    const std::uint32_t a = 3 * i, b = a + 1, c = a + 2;
    expect_mean(at, primitive_vertex_normal(at), as_vector(N_[a]), as_vector(N_[b]), as_vector(N_[c]));
    expect_mean(at, primitive_generated(at), generated_[a], generated_[b], generated_[c]);
    const MeshColumn column{values_.data(), 0, 4};
    for (std::uint32_t k = 0; k < 4; ++k) {
      const auto of = [&](std::uint32_t v) { return static_cast<double>(values_[4 * v + k]); };
      EXPECT_NEAR(static_cast<double>(primitive_column(at, column, k)), mean(at, of(a), of(b), of(c)), 1e-6);
    }
  }
}

/// A step in the triangle's plane leads to the place whose hit is there; one off the plane to below it.
TEST_F(Primitive, MovesAlongItsPlane)
{
  int num_moved = 0;
  for (std::uint32_t i = 0; i < kTriangles; ++i) {
    const PrimitivePlace at = place(i), to = place(i);
    const SurfaceHit from = primitive_hit(at, instance_, {}, {}), there = primitive_hit(to, instance_, {}, {});
    const Vec3f edge = P_[3 * i + 1] - P_[3 * i];
    // Slivers are worked out with fewer digits.
    if (length(cross(edge, P_[3 * i + 2] - P_[3 * i])) < 0.1f * length_squared(edge)) continue;
    const PrimitivePlace moved = primitive_moved(at, instance_, there.P - from.P + 0.3f * from.Ng, 1);
    EXPECT_NEAR(moved.u, to.u, 1e-3f);
    EXPECT_NEAR(moved.v, to.v, 1e-3f);
    const PrimitivePlace back = primitive_moved(moved, instance_, there.P - from.P, -1);
    EXPECT_NEAR(back.u, at.u, 1e-3f);
    EXPECT_NEAR(back.v, at.v, 1e-3f);
    ++num_moved;
  }
  EXPECT_GT(num_moved, 30);
}

TEST_F(Primitive, EdgesAreAsFarAsTheNearestPointOfTheirLines)
{
  for (std::uint32_t i = 0; i < kTriangles; ++i) {
    const PrimitivePlace at = place(i);
    const Vec3f P = primitive_hit(at, instance_, {}, {}).P;
    double nearest = HUGE_VAL;
    for (std::uint32_t k = 0; k < 3; ++k) {
      const Vec3f a = transform_point(instance_.world_from_object, P_[3 * i + k]);
      const Vec3f b = transform_point(instance_.world_from_object, P_[3 * i + (k + 1) % 3]);
      const auto far = [&](double t) {
        double sum = 0;
        for (const Vec3f axis : {Vec3f{1, 0, 0}, Vec3f{0, 1, 0}, Vec3f{0, 0, 1}}) {
          const double x = static_cast<double>(dot(a, axis));
          sum += std::pow(x + t * (static_cast<double>(dot(b, axis)) - x) - static_cast<double>(dot(P, axis)), 2);
        }
        return sum;
      };
      // The square of the distance is a parabola along the line.
      double low = -10, high = 10;
      for (int step = 0; step < 200; ++step) {
        const double third = (high - low) / 3;
        if (far(low + third) < far(high - third)) {
          high -= third;
        } else {
          low += third;
        }
      }
      nearest = std::min(nearest, std::sqrt(far(low)));
    }
    EXPECT_NEAR(static_cast<double>(primitive_edge_distance(at, instance_, P)), nearest, 1e-4);
  }
}

/// A point of a lamp, or of what fills the world.
TEST(GraphPoint, NeedsNoPrimitiveAndNoInstance)
{
  const InstanceView nowhere{.world_from_object = {}, .object_from_world = {}, .index = kNoInstance};
  SurfaceHit hit;
  hit.P = {1, 2, 3};
  hit.Ng = hit.Ns = {0, 0, 1};
  hit.uv[0] = hit.uv[1] = {0.25f, 0.75f};
  const float values[4] = {5, 6, 7, 8};
  const GraphInstanceColumn column{3, values};
  GraphScene scene;
  scene.columns = &column;
  scene.num_columns = 1;
  GraphPoint at{{}, &nowhere, &hit, {0, 0, 1}, {0, 0}, 0.5f, &scene, {}};
  at.P_object = {4, 5, 6};
  using Q = GraphQuantity;
  const auto read = [&at](Q quantity, std::uint16_t index = 0) { return graph_quantity(at, quantity, index); };
  EXPECT_EQ(read(Q::generated_y), 5.0f);
  EXPECT_EQ(read(Q::parametric_x), 0.25f);
  EXPECT_EQ(read(Q::parametric_y), 0.25f);
  EXPECT_EQ(read(Q::edge_distance), kInfinity);
  EXPECT_EQ(read(Q::instance), -1.0f);
  EXPECT_EQ(read(Q::attribute_value, 3), 0.0f);
  EXPECT_EQ(read(Q::attribute_x, 3), 0.0f);
  EXPECT_EQ(read(Q::attribute_alpha, 3), 1.0f);
  EXPECT_EQ(read(Q::tangent_normal_x), 0.0f);
  EXPECT_EQ(read(Q::dpdx_x), 0.0f);
  EXPECT_EQ(read(Q::vertex_normal_z), 1.0f);
  // An instance without primitives, as one that a medium fills, has its values.
  InstanceView filled = nowhere;
  filled.index = 0;
  at.instance = &filled;
  EXPECT_EQ(read(Q::attribute_y, 3), 6.0f);
  EXPECT_EQ(read(Q::attribute_alpha, 3), 8.0f);
  EXPECT_EQ(read(Q::instance), 0.0f);
}

}  // namespace
}  // namespace relief
