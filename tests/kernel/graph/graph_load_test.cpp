// What graphs read of eight points at once is what they read of each.
#include "kernel/graph/graph_load.h"

#include <vector>

#include <gtest/gtest.h>

#include "tests/support/chi2.h"

namespace relief {
namespace {

/// Points on random triangles of two instances, and a program that reads all there is, bumps of two widths among it.
class GraphLoad : public testing::Test {
 protected:
  static constexpr std::uint32_t kVertices = 60;

  GraphLoad()
  {
    for (std::uint32_t i = 0; i < kVertices; ++i) {
      P_.push_back(vector());
      N_.push_back(as_normal(normalize(vector())));
      uv_.push_back({random_.next(), random_.next()});
      generated_.push_back(vector());
    }
    for (std::uint32_t i = 0; i + 2 < kVertices; ++i) triangles_.push_back({i, i + 1, i + 2});
    mesh_.P = P_.data();
    mesh_.N = N_.data();
    mesh_.uv[0] = uv_.data();
    mesh_.generated = generated_.data();
    mesh_.triangles = triangles_.data();
    mesh_.num_vertices = kVertices;
    for (InstanceView& instance : instances_) {
      instance.world_from_object = {vector(), vector(), vector(), 3.0f * vector()};
      instance.object_from_world = inverse(instance.world_from_object);
    }
    scene_.camera_from_world = {vector(), vector(), vector(), vector()};
  }

  /// @param are_all  whether it reads what has no lanes, too
  GraphProgramView program(bool is_shifted, bool are_all)
  {
    inputs_.clear();
    const auto add = [&](GraphQuantity quantity, GraphShift shift, float width) {
      const GraphInput input{quantity, shift, static_cast<std::uint16_t>(inputs_.size()), 0, width};
      if (are_all || graph_input_has_lanes(input)) inputs_.push_back(input);
    };
    for (const float width : {1.0f, 0.3f}) {
      for (int i = 0; i < static_cast<int>(GraphQuantity::kCount); ++i) {
        const auto quantity = static_cast<GraphQuantity>(i);
        add(quantity, GraphShift::kNone, 1.0f);
        if (!is_shifted) continue;
        add(quantity, GraphShift::kAlongX, width);
        add(quantity, GraphShift::kAlongY, width);
      }
    }
    GraphProgramView view;
    view.inputs = inputs_.data();
    view.num_inputs = static_cast<std::uint32_t>(inputs_.size());
    view.is_shifted = is_shifted;
    return view;
  }

  Vec3f vector() { return {2.0f * random_.next() - 1.0f, 2.0f * random_.next() - 1.0f, 2.0f * random_.next() - 1.0f}; }

  TestRandom random_{9};
  std::vector<Vec3f> P_, generated_;
  std::vector<Normal3f> N_;
  std::vector<Vec2f> uv_;
  std::vector<TriangleIndices> triangles_;
  std::vector<GraphInput> inputs_;
  MeshView mesh_;
  InstanceView instances_[2];
  GraphScene scene_;
};

TEST_F(GraphLoad, EightPointsAreWhatEachIs)
{
  GraphRegisters all, one;
  for (int i = 0; i < 2000; ++i) {
    const GraphProgramView view = program(i % 2 == 0, i % 4 < 2);
    ASSERT_LE(view.num_inputs, kMostGraphRegisters);
    ASSERT_GT(view.num_inputs, 20u);
    SurfaceHit hits[8];
    GraphPoint points[8];
    GraphPlaces places;
    const int count = 1 + i % 8;
    for (int k = 0; k < 8; ++k) {
      const InstanceView& instance = instances_[random_.next() < 0.5f ? i / 8 % 2 : 0];
      const auto triangle = static_cast<std::uint32_t>(random_.next() * static_cast<float>(kVertices - 2));
      const float u = random_.next(), v = (1.0f - u) * random_.next();
      hits[k] = surface_hit_make(mesh_, instance, triangle, u, v);
      // Where the axes of footprints have no cross product.
      if (i % 16 == 3) hits[k].Ng = normalize(Vec3f{1, 1, -1});
      const float footprint = random_.next() < 0.2f ? 0.0f : 0.1f * random_.next();
      points[k] = {
          {&mesh_, triangle, u, v}, &instance, &hits[k], normalize(vector()), {0.1f, 0.2f}, footprint, &scene_, {}};
      places.hit[k] = &hits[k];
      places.instance[k] = &instance;
      places.wo[k] = points[k].wo;
      places.footprint[k] = footprint;
    }
    graph_load_points(
        view, places, count, [&](int k) { return points[k]; }, all);
    for (int k = 0; k < count; ++k) {
      graph_load_point(view, points[k], k, one);
      for (const GraphInput& input : inputs_) {
        const float a = all.lanes[input.register_index][k], b = one.lanes[input.register_index][k];
        // Rounding of places in a space whose map may stretch.
        EXPECT_NEAR(a, b, 1e-5f * (1.0f + std::fabs(b))) << static_cast<int>(input.quantity) << " lane " << k;
      }
    }
    if (HasFailure()) break;
  }
}

}  // namespace
}  // namespace relief
