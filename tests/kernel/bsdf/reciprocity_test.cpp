// f(wo, wi) = f(wi, wo) for everything that reflects; across a solid's boundary radiance over index squared is what is
// reciprocal: f(wo, wi) / eta² of one side equals f(wi, wo) of the other. Rates allowed: 0.
#include <gtest/gtest.h>

#include "tests/kernel/bsdf/bsdf_fixture.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

void expect_reciprocal(const std::string& name, const SurfaceParams& p, bool below)
{
  TestRandom random(3);
  for (int n = 0; n < 4000; ++n) {
    const float a_z = 0.01f + 0.99f * random.next();
    const float b_z = 0.01f + 0.99f * random.next();
    const Vec3f a = direction(below ? -a_z : a_z, 6.0f * random.next());
    const Vec3f b = direction(below ? -b_z : b_z, 6.0f * random.next());
    const Vec3f ab = surface_eval<kFeatureAll>(p, full_tables(), a, b).f;
    const Vec3f ba = surface_eval<kFeatureAll>(p, full_tables(), b, a).f;
    // Table look-ups and half vectors are rounded in float on both sides.
    ASSERT_NEAR(ab.x, ba.x, 1e-4f * max(ab.x, ba.x) + 1e-7f) << name << " " << n;
    ASSERT_NEAR(ab.y, ba.y, 1e-4f * max(ab.y, ba.y) + 1e-7f) << name << " " << n;
    ASSERT_NEAR(ab.z, ba.z, 1e-4f * max(ab.z, ba.z) + 1e-7f) << name << " " << n;
  }
}

TEST(Reciprocity, OfReflection)
{
  for (const float r : {0.2f, 0.5f, 1.0f}) {
    const std::string suffix = ", roughness " + std::to_string(r);
    expect_reciprocal("metal" + suffix, metal({0.9f, 0.5f, 0.2f}, r), false);
    expect_reciprocal("plastic" + suffix, plastic({0.9f, 0.5f, 0.2f}, r), false);
    expect_reciprocal("sheen" + suffix, with_sheen(plastic({0.9f, 0.5f, 0.2f}, r), {0.8f, 0.6f, 0.7f}, r), false);
    expect_reciprocal("coat alone" + suffix, with_coat(lambert({0, 0, 0}), 1.0f, r), false);
    expect_reciprocal("glass outside" + suffix, glass(1.5f, r), false);
    expect_reciprocal("glass inside" + suffix, glass(1.5f, r), true);
    expect_reciprocal("thin wall" + suffix, thin_wall({0.9f, 0.5f, 0.2f}, r), false);
  }
}

TEST(Reciprocity, OfTransmissionThroughAThinWall)
{
  TestRandom random(4);
  const SurfaceParams p = thin_wall({0.9f, 0.5f, 0.2f}, 0.6f);
  for (int n = 0; n < 4000; ++n) {
    const Vec3f a = direction(0.01f + 0.99f * random.next(), 6.0f * random.next());
    const Vec3f b = direction(-0.01f - 0.99f * random.next(), 6.0f * random.next());
    const float ab = surface_eval<kFeatureAll>(p, full_tables(), a, b).f.y;
    const float ba = surface_eval<kFeatureAll>(p, full_tables(), b, a).f.y;
    ASSERT_NEAR(ab, ba, 1e-4f * max(ab, ba) + 1e-7f) << n;
  }
}

TEST(Reciprocity, OfRefraction)
{
  TestRandom random(5);
  int num_compared = 0;
  for (const float ior : {1.1f, 1.5f, 2.42f}) {
    for (const float r : {0.3f, 0.7f, 1.0f}) {
      const SurfaceParams p = glass(ior, r);
      for (int n = 0; n < 4000; ++n) {
        const Vec3f outside = direction(0.02f + 0.98f * random.next(), 6.0f * random.next());
        const Vec3f inside = direction(-0.02f - 0.98f * random.next(), 6.0f * random.next());
        const float in = surface_eval<kFeatureAll>(p, full_tables(), outside, inside).f.x / (ior * ior);
        const float out = surface_eval<kFeatureAll>(p, full_tables(), inside, outside).f.x;
        ASSERT_NEAR(in, out, 1e-3f * max(in, out) + 1e-6f) << ior << " " << r << " " << n;
        num_compared += in > 1e-4f ? 1 : 0;
        // Photons going in see what cameras looking out see.
        const float photons =
            surface_eval<kFeatureAll, TransportMode::kImportance>(p, full_tables(), outside, inside).f.x;
        ASSERT_NEAR(photons, in, 1e-5f * in) << ior << " " << r << " " << n;
      }
    }
  }
  EXPECT_GT(num_compared, 20000);
}

}  // namespace
}  // namespace relief
