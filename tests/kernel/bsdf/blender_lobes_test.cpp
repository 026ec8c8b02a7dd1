// The lobes of Blender's shaders as trios: samples follow densities, densities integrate to what is not lost, samples and
// evaluations give one albedo, and f is reciprocal. blender_lobes_formula_test.cpp has their values.
#include <gtest/gtest.h>

#include "kernel/bsdf/ashikhmin_shirley.h"
#include "kernel/bsdf/beckmann.h"
#include "kernel/bsdf/clearcoat_gtr1.h"
#include "kernel/bsdf/microfacet_refraction.h"
#include "kernel/bsdf/oren_nayar.h"
#include "kernel/bsdf/principled_diffuse.h"
#include "kernel/bsdf/principled_sheen.h"
#include "kernel/bsdf/sheen_microfibre.h"
#include "kernel/bsdf/toon.h"
#include "kernel/bsdf/translucent.h"
#include "kernel/bsdf/velvet.h"
#include "tests/kernel/bsdf/lobe_trio.h"

namespace relief {
namespace {

/// A lobe whose functions are named family_eval and family_sample.
#define RELIEF_TEST_TRIO(family, lobe)                                                  \
  [l = lobe](Vec3f wo, Vec3f wi, float* pdf) { return family##_eval(l, wo, wi, pdf); }, \
      [l = lobe](Vec3f wo, Vec2f u) { return family##_sample(l, wo, u); }

std::string number(float x)
{
  char text[32];
  std::snprintf(text, sizeof text, "%g", static_cast<double>(x));
  return text;
}

std::vector<LobeTrio> lobes()
{
  std::vector<LobeTrio> all;
  const auto add = [&](LobeTrio trio) { all.push_back(std::move(trio)); };
  for (const float sigma : {0.0f, 0.5f, 1.0f}) {
    add({"Oren-Nayar " + number(sigma), RELIEF_TEST_TRIO(oren_nayar, oren_nayar_make(sigma))});
    add({"Oren-Nayar with multiple scattering " + number(sigma),
         [sigma](Vec3f wo, Vec3f wi, float* pdf) {
           return oren_nayar_multiple_eval(oren_nayar_multiple_make(splat3(1.0f), sigma, wo), wo, wi, pdf).x;
         },
         [sigma](Vec3f wo, Vec2f u) {
           return oren_nayar_multiple_sample(oren_nayar_multiple_make(splat3(1.0f), sigma, wo), wo, u);
         },
         false, true, 1.01});
  }
  for (const float roughness : {0.0f, 0.5f, 1.0f}) {
    LobeTrio trio{"Principled diffuse " + number(roughness),
                  RELIEF_TEST_TRIO(principled_diffuse, PrincipledDiffuse{roughness})};
    trio.largest_albedo = 1.52;
    add(trio);
  }
  add({"Principled sheen", RELIEF_TEST_TRIO(principled_sheen, PrincipledSheen{})});
  const AnisotropicAlpha alphas[] = {{0.3f, 0.3f}, {0.15f, 0.6f}, {1.0f, 0.4f}, {1.0f, 1.0f}};
  for (const AnisotropicAlpha a : alphas) {
    const std::string name = " " + number(a.x) + " " + number(a.y);
    for (const SmithMasking m : {SmithMasking::kSeparable, SmithMasking::kCorrelated}) {
      const std::string which = m == SmithMasking::kSeparable ? ", separable" : ", correlated";
      add({"GGX" + name + which, RELIEF_TEST_TRIO(ggx_anisotropic, (GgxAnisotropic{a, m}))});
      add({"Beckmann" + name + which, RELIEF_TEST_TRIO(beckmann, (Beckmann{a, m}))});
    }
    LobeTrio trio{"Ashikhmin-Shirley" + name, RELIEF_TEST_TRIO(ashikhmin_shirley, ashikhmin_shirley_make(a))};
    add(trio);
  }
  for (const bool is_beckmann : {false, true}) {
    for (const float eta : {1.5f, 1.0f / 1.5f}) {
      for (const float alpha : {0.3f, 0.8f}) {
        const MicrofacetRefraction r{alpha, eta, is_beckmann,
                                     eta > 1.0f ? SmithMasking::kSeparable : SmithMasking::kCorrelated};
        LobeTrio trio{
            (is_beckmann ? "Beckmann refraction " : "GGX refraction ") + number(alpha) + " eta " + number(eta),
            RELIEF_TEST_TRIO(microfacet_refraction, r)};
        trio.is_below = true;
        trio.is_reciprocal = false;
        add(trio);
      }
    }
  }
  for (const float sigma : {0.3f, 1.0f, 3.0f}) {
    add({"Velvet " + number(sigma), RELIEF_TEST_TRIO(velvet, velvet_make(sigma))});
  }
  for (const float roughness : {0.2f, 0.5f, 1.0f}) {
    LobeTrio trio{"Microfibre sheen " + number(roughness),
                  [roughness](Vec3f wo, Vec3f wi, float* pdf) {
                    return sheen_microfibre_eval(sheen_microfibre_make(wo.z, roughness), wo, wi, pdf);
                  },
                  [roughness](Vec3f wo, Vec2f u) {
                    return sheen_microfibre_sample(sheen_microfibre_make(wo.z, roughness), wo, u);
                  }};
    trio.is_reciprocal = false;
    add(trio);
  }
  const float toons[][2] = {{0.5f, 0.0f}, {0.3f, 0.4f}, {0.9f, 0.6f}};
  for (const auto& t : toons) {
    for (const bool is_glossy : {false, true}) {
      LobeTrio trio{(is_glossy ? "Glossy toon " : "Diffuse toon ") + number(t[0]) + " " + number(t[1]),
                    RELIEF_TEST_TRIO(toon, toon_make(t[0], t[1], is_glossy))};
      trio.is_reciprocal = false;
      trio.pdf_tolerance = 2e-2;  // the rim is an edge
      add(trio);
    }
  }
  LobeTrio below{"Translucent", RELIEF_TEST_TRIO(translucent, Translucent{})};
  below.is_below = true;
  below.is_reciprocal = false;
  add(below);
  return all;
}

// Significance 1 % for all of them together (Šidák), seed = index.
TEST(BlenderLobe, SamplesFollowItsDensity)
{
  const std::vector<LobeTrio> all = lobes();
  const float heights[] = {0.08f, 0.7f};
  std::uint64_t seed = 0;
  for (const LobeTrio& lobe : all) {
    for (const float z : heights) {
      const Chi2Result result = lobe_chi2(lobe, direction(z), seed, 200000);
      EXPECT_GT(result.p_value, sidak_threshold(0.01, static_cast<int>(2 * all.size())))
          << lobe.name << ", wo.z " << z << ", seed " << seed << ": statistic " << result.statistic << " of "
          << result.degrees_of_freedom << " degrees of freedom " << result.failure;
      ++seed;
    }
  }
}

TEST(BlenderLobe, DensityIntegratesToTheShareThatIsNotLostAndAlbedosAgree)
{
  for (const LobeTrio& lobe : lobes()) {
    double largest = 0;
    for (const float z : {0.02f, 0.1f, 0.3f, 0.7f, 1.0f}) {
      const LobeIntegrals integrals = lobe_integrals(lobe, direction(z));
      const LobeIntegrals sampled = lobe_sampled(lobe, direction(z));
      EXPECT_NEAR(integrals.pdf, sampled.pdf, lobe.pdf_tolerance) << lobe.name << ", wo.z " << z;
      EXPECT_NEAR(integrals.albedo, sampled.albedo, lobe.pdf_tolerance * std::fmax(1.0, integrals.albedo))
          << lobe.name << " " << z;
      EXPECT_LT(integrals.pdf, 1.0 + lobe.pdf_tolerance) << lobe.name << ", wo.z " << z;
      largest = std::fmax(largest, sampled.albedo);
    }
    std::printf("  %-50s largest albedo %.4f\n", lobe.name.c_str(), largest);
    EXPECT_LT(largest, lobe.largest_albedo + 2e-3) << lobe.name;
  }
}

TEST(BlenderLobe, IsReciprocal)
{
  TestRandom random(3);
  for (const LobeTrio& lobe : lobes()) {
    if (!lobe.is_reciprocal) continue;
    for (int n = 0; n < 300; ++n) {
      const Vec3f a = direction(0.02f + 0.98f * random.next(), 6.0f * random.next());
      const Vec3f b = direction(0.02f + 0.98f * random.next(), 6.0f * random.next());
      float pdf = 0;
      const float forth = lobe.eval(a, b, &pdf), back = lobe.eval(b, a, &pdf);
      ASSERT_NEAR(forth, back, 1e-4f * std::fmax(forth, back) + 1e-6f) << lobe.name;
    }
  }
}

/// Lobes as sharp as they get, beside the others.
std::vector<LobeTrio> extreme_lobes()
{
  std::vector<LobeTrio> all = lobes();
  const AnisotropicAlpha alphas[] = {{kDeltaAlpha, kDeltaAlpha}, {kDeltaAlpha, 1.0f}, {1.0f, kDeltaAlpha}};
  for (const AnisotropicAlpha a : alphas) {
    all.push_back({"GGX", RELIEF_TEST_TRIO(ggx_anisotropic, (GgxAnisotropic{a, SmithMasking::kSeparable}))});
    all.push_back({"Beckmann", RELIEF_TEST_TRIO(beckmann, (Beckmann{a, SmithMasking::kCorrelated}))});
    all.push_back({"Ashikhmin-Shirley", RELIEF_TEST_TRIO(ashikhmin_shirley, ashikhmin_shirley_make(a))});
  }
  all.push_back({"GTR1", RELIEF_TEST_TRIO(clearcoat_gtr1, ClearcoatGtr1{kGtr1DeltaAlpha})});
  all.push_back({"Velvet 0", RELIEF_TEST_TRIO(velvet, velvet_make(0.0f))});
  all.push_back({"Toon 0", RELIEF_TEST_TRIO(toon, toon_make(0.0f, 0.0f, true))});
  for (const bool is_beckmann : {false, true}) {
    LobeTrio trio{"Refraction",
                  RELIEF_TEST_TRIO(microfacet_refraction, (MicrofacetRefraction{kDeltaAlpha, 1.01f, is_beckmann}))};
    trio.is_below = true;
    all.push_back(trio);
  }
  return all;
}

// Its samples do not follow what counts as its density: visible normals of GGX, each weighed by the masking of wi alone, as
// Cycles has it. The other side is a quadrature over GGX's own formula in double precision.
TEST(BlenderLobe, ClearcoatFindsLightAsGgxOfItsRoughness)
{
  const auto G1 = [](double z, double alpha) {
    return 2.0 / (1.0 + std::sqrt(1.0 + alpha * alpha * (1.0 - z * z) / (z * z)));
  };
  for (const float alpha : {0.1f, 0.5f, 1.0f}) {
    for (const float wo_z : {0.2f, 0.7f, 1.0f}) {
      const Vec3f wo = direction(wo_z, 0.3f);
      // How much of a world it gets that is bright in one half alone.
      double sampled = 0;
      constexpr std::uint32_t kSamples = 1u << 18;
      for (std::uint32_t n = 0; n < kSamples; ++n) {
        const Vec3f wi = clearcoat_gtr1_sample({alpha}, wo, sequence_point(n).u);
        if (!(wi.z > 0.0f && wi.x > 0.0f)) continue;
        float pdf = 0;
        const float f = clearcoat_gtr1_eval({alpha}, wo, wi, &pdf);
        ASSERT_GT(pdf, 0.0f);
        sampled += static_cast<double>(f * wi.z / pdf);
      }
      double expected = 0;
      constexpr int kZ = 1500, kPhi = 1500;
      for (int i = 0; i < kZ; ++i) {
        const double z = (i + 0.5) / kZ, r = std::sqrt(1.0 - z * z);
        for (int j = 0; j < kPhi; ++j) {
          const double phi = M_PI * ((j + 0.5) / kPhi - 0.5);
          const double h[3] = {static_cast<double>(wo.x) + r * std::cos(phi),
                               static_cast<double>(wo.y) + r * std::sin(phi), static_cast<double>(wo.z) + z};
          const double a2 = static_cast<double>(alpha) * static_cast<double>(alpha);
          const double cos2 = h[2] * h[2] / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
          const double t = 1.0 - cos2 + a2 * cos2;
          const double D = a2 / (M_PI * t * t);
          const double pdf =
              G1(static_cast<double>(wo_z), static_cast<double>(alpha)) * D / (4.0 * static_cast<double>(wo_z));
          expected += pdf * G1(z, 0.25) * M_PI / kPhi / kZ;
        }
      }
      EXPECT_NEAR(sampled / kSamples, expected, 2e-3) << alpha << " " << wo_z;
    }
  }
}

TEST(BlenderLobe, IsFiniteFromTheNormalToTheHorizon)
{
  const float edges[] = {0.0f, 0x1p-24f, 1e-3f, 0.5f, 0.999f, 1.0f - 0x1p-24f};
  for (const LobeTrio& lobe : extreme_lobes()) {
    for (const float z : {kMinCosine, 1e-3f, 0.3f, 0.9999999f, 1.0f}) {
      const Vec3f wo = direction(z);
      const auto check = [&](Vec3f wi) {
        if (!is_on_side(lobe, wi)) return;
        float pdf = -1;
        const float f = lobe.eval(wo, wi, &pdf);
        EXPECT_TRUE(is_finite(f * wi.z) && is_finite(pdf) && f >= 0.0f && pdf >= 0.0f)
            << lobe.name << " wo.z " << z << " wi.z " << wi.z << " f " << f << " pdf " << pdf;
      };
      for (const float u : edges) {
        for (const float v : edges) {
          const Vec3f wi = lobe.sample(wo, {u, v});
          ASSERT_TRUE(is_finite(wi)) << lobe.name << " wo.z " << z << " u " << u << " " << v;
          if (!is_on_side(lobe, wi)) continue;
          EXPECT_NEAR(length(wi), 1.0f, 1e-4f) << lobe.name << " wo.z " << z;
          check(wi);
        }
      }
      const float side = lobe.is_below ? -1.0f : 1.0f;
      for (const float z_i : {kMinCosine, 0.5f, 1.0f}) {
        check(direction(side * z_i));
        check(direction(side * z_i, 0.7f + kPi));
      }
      check({-wo.x, -wo.y, side * wo.z});
    }
  }
}

}  // namespace
}  // namespace relief
