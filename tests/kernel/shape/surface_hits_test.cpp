// Eight hits at once are what each of them is by itself.
#include "kernel/shape/surface_hits.h"

#include <cstring>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/chi2.h"

namespace relief {
namespace {

/// Two meshes of the same random triangles, one of them without normals, and instances that mirror or do not.
class SurfaceHits : public testing::Test {
 protected:
  static constexpr std::uint32_t kVertices = 300, kTriangles = 400;

  SurfaceHits()
  {
    for (std::uint32_t i = 0; i < kVertices; ++i) {
      P_.push_back(vector());
      N_.push_back(as_normal(vector()));
      uv_.push_back({random_.next(), random_.next()});
      color_.push_back({random_.next(), random_.next(), random_.next(), 1.0f});
    }
    for (std::uint32_t i = 0; i < kTriangles; ++i) {
      const std::uint32_t first = below(kVertices - 2);
      triangles_.push_back({first, first + 1, first + 2});
    }
    meshes_[0].P = P_.data();
    meshes_[0].triangles = triangles_.data();
    meshes_[1] = meshes_[0];
    meshes_[0].N = N_.data();
    meshes_[0].uv[1] = uv_.data();
    meshes_[1].color = color_.data();
    for (std::uint32_t i = 0; i < 4; ++i) {
      instances_[i].world_from_object = {vector(), vector(), vector(), 100.0f * vector()};
      instances_[i].object_from_world = inverse(instances_[i].world_from_object);
      if ((i & 1) != 0) instances_[i].flags |= kMirrored;
      if ((i & 2) != 0) instances_[i].flags |= kTracedInObjectSpace;
    }
  }

  std::uint32_t below(std::uint32_t end)
  {
    return static_cast<std::uint32_t>(random_.next() * static_cast<float>(end));
  }
  Vec3f vector() { return {2.0f * random_.next() - 1.0f, 2.0f * random_.next() - 1.0f, 2.0f * random_.next() - 1.0f}; }

  /// Some hits are next to an edge.
  SurfaceHitQuestions questions(std::uint32_t num_instances)
  {
    SurfaceHitQuestions q;
    for (int k = 0; k < 8; ++k) {
      q.instance[k] = &instances_[below(num_instances)];
      q.mesh[k] = &meshes_[below(2)];
      q.triangle[k] = below(kTriangles);
      q.bary_u[k] = random_.next() < 0.2f ? 1e-7f : random_.next();
      q.bary_v[k] = (1.0f - q.bary_u[k]) * random_.next();
    }
    return q;
  }

  TestRandom random_{5};
  std::vector<Vec3f> P_;
  std::vector<Normal3f> N_;
  std::vector<Vec2f> uv_;
  std::vector<Vec4f> color_;
  std::vector<TriangleIndices> triangles_;
  MeshView meshes_[2];
  InstanceView instances_[4];
};

TEST_F(SurfaceHits, EightAreWhatEachIs)
{
  int num_clear = 0;
  for (int i = 0; i < 4000; ++i) {
    const SurfaceHitQuestions q = questions(i % 2 == 0 ? 1 : 4);
    const int count = 1 + i % 8;
    SurfaceHit all[8], untouched;
    SurfaceHit* places[8];
    for (int k = 0; k < 8; ++k) places[k] = &all[k];
    all[7].P = untouched.P = {1, 2, 3};
    surface_hits_make(q, count, places);
    for (int k = 0; k < count; ++k) {
      const SurfaceHit one = surface_hit_make(*q.mesh[k], *q.instance[k], q.triangle[k], q.bary_u[k], q.bary_v[k]);
      num_clear += is_zero(one.clear) ? 0 : 1;
      const auto numbers = [](const SurfaceHit& hit) {
        std::vector<float> n(sizeof(SurfaceHit) / sizeof(float));
        std::memcpy(n.data(), &hit, sizeof hit);
        return n;
      };
      EXPECT_EQ(numbers(all[k]), numbers(one)) << "lane " << k << " of " << count;
    }
    if (count < 8) {
      EXPECT_EQ(all[7].P, untouched.P);
    }
  }
  EXPECT_GT(num_clear, 100);
}

}  // namespace
}  // namespace relief
