// Samplers against their densities (χ²), densities against 1, samples against evaluations, for every lobe and mixture.
#include <gtest/gtest.h>

#include "kernel/bsdf/glass_branches.h"
#include "tests/kernel/bsdf/bsdf_fixture.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

struct Setting {
  std::string name;
  SurfaceParams params;
  float wo_z;
};

/// Every lobe at several parameters, and mixtures; no delta lobes.
std::vector<Setting> rough_settings()
{
  SurfaceParams tilted_coat = with_coat(plastic({0.5f, 0.5f, 0.5f}, 0.6f), 1.0f, 0.4f);
  tilted_coat.clearcoat_N = normalize({0.3f, -0.2f, 1.0f});
  SurfaceParams half_metal = plastic({0.9f, 0.6f, 0.3f}, 0.5f);
  half_metal.metallic = 0.5f;
  return {
      {"lambert", lambert({0.8f, 0.8f, 0.8f}), 0.5f},
      {"metal, roughness 0.3", metal({1, 0.8f, 0.5f}, 0.3f), 0.9f},
      {"metal, roughness 0.5, grazing", metal({1, 0.8f, 0.5f}, 0.5f), 0.05f},
      {"metal, roughness 1", metal({1, 1, 1}, 1.0f), 0.3f},
      {"metal, roughness 1, from behind", metal({1, 1, 1}, 1.0f), -0.6f},
      {"plastic, roughness 0.4", plastic({0.2f, 0.5f, 0.8f}, 0.4f), 0.7f},
      {"plastic, roughness 0.8, grazing", plastic({0.2f, 0.5f, 0.8f}, 0.8f), 0.1f},
      {"half metal", half_metal, 0.6f},
      {"glass 1.5, roughness 0.4", glass(1.5f, 0.4f), 0.8f},
      {"glass 1.5, roughness 0.5, from inside", glass(1.5f, 0.5f), -0.8f},
      {"glass 1.5, roughness 0.5, beyond the critical angle", glass(1.5f, 0.5f), -0.3f},
      {"glass 1.5, roughness 1, grazing", glass(1.5f, 1.0f), 0.1f},
      {"glass 2.4, roughness 0.7", glass(2.4f, 0.7f), 0.5f},
      {"glass 1.1, roughness 1, from inside", glass(1.1f, 1.0f), -0.5f},
      {"thin wall, roughness 0.4", thin_wall({0.9f, 0.7f, 0.5f}, 0.4f), 0.6f},
      {"thin wall, roughness 1, from behind", thin_wall({0.9f, 0.7f, 0.5f}, 1.0f), -0.2f},
      {"coat, roughness 0.3, over lambert", with_coat(lambert({0.5f, 0.5f, 0.5f}), 1.0f, 0.3f), 0.4f},
      {"tilted coat", tilted_coat, 0.5f},
      {"sheen, roughness 0.3", with_sheen(lambert({0, 0, 0}), {1, 1, 1}, 0.3f), 0.3f},
      {"sheen, roughness 0.9, over lambert", with_sheen(lambert({0.3f, 0.3f, 0.3f}), {1, 0.5f, 0.5f}, 0.9f), 0.7f},
      {"mixture, solid", mixture(0.4f, false), 0.6f},
      {"mixture, solid, from inside", mixture(0.6f, false), -0.7f},
      {"mixture, thin", mixture(0.5f, true), 0.3f},
  };
}

// Significance 1 % for all settings together (Šidák), a million samples each, seed = index.
TEST(SurfaceSample, FollowsItsDensity)
{
  const std::vector<Setting> settings = rough_settings();
  const double threshold = sidak_threshold(0.01, static_cast<int>(settings.size()));
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const SurfaceClosure closure =
        surface_closure_make<kFeatureAll>(settings[i].params, full_tables(), direction(settings[i].wo_z));
    Chi2Histogram histogram(16, 24);
    TestRandom random(i);
    for (int n = 0; n < 1000000; ++n) {
      const float u_branch = random.next();
      const float u = random.next();
      const BsdfSample s = closure_sample<kFeatureAll>(closure, full_tables(), u_branch, {u, random.next()});
      if (s.pdf > 0.0f) {
        histogram.add(s.wi.x, s.wi.y, s.wi.z);
      } else {
        histogram.add_absorbed();
      }
    }
    const Chi2Result result = histogram.test([&](double x, double y, double z) {
      const Vec3f wi{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
      return static_cast<double>(closure_eval<kFeatureAll>(closure, full_tables(), wi).pdf);
    });
    EXPECT_GT(result.p_value, threshold) << settings[i].name << ", seed " << i << ": statistic " << result.statistic
                                         << ", degrees of freedom " << result.degrees_of_freedom << " "
                                         << result.failure;
  }
}

/// ∫ pdf over the sphere by midpoints in (√|z|, azimuth), which put more points near the horizon.
double pdf_integral(const SurfaceClosure& closure)
{
  constexpr int kZ = 800, kPhi = 300;
  double sum = 0;
  for (int i = 0; i < 2 * kZ; ++i) {
    const double x = (i % kZ + 0.5) / kZ;
    const double z = (i < kZ ? 1.0 : -1.0) * x * x;
    double ring = 0;
    for (int j = 0; j < kPhi; ++j) {
      const Vec3f wi = direction(static_cast<float>(z), static_cast<float>(2.0 * 3.14159265358979 * (j + 0.5) / kPhi));
      ring += static_cast<double>(closure_eval<kFeatureAll>(closure, full_tables(), wi).pdf);
    }
    sum += ring * 2.0 * x / kZ;
  }
  return sum * 2.0 * 3.14159265358979 / kPhi;
}

TEST(SurfacePdf, IntegratesToTheShareThatIsNotAbsorbed)
{
  for (const Setting& setting : rough_settings()) {
    const SurfaceClosure closure =
        surface_closure_make<kFeatureAll>(setting.params, full_tables(), direction(setting.wo_z));
    constexpr std::uint32_t kSamples = 1u << 16;
    double survived = 0;
    for (std::uint32_t n = 0; n < kSamples; ++n) {
      const Point3 point = sequence_point(n);
      if (closure_sample<kFeatureAll>(closure, full_tables(), point.lobe, point.u).pdf > 0.0f) survived += 1.0;
    }
    // The densities jump at horizons and at the edge of refraction: 3e-3 is what midpoints leave of that.
    EXPECT_NEAR(pdf_integral(closure), survived / kSamples, 3e-3) << setting.name;
  }
}

TEST(SurfacePdf, IntegratesToOneWhereNothingIsLost)
{
  // Cosine and uniform lobes lose no ray; microfacets do, below the horizon.
  const SurfaceParams surfaces[] = {lambert({0.5f, 0.5f, 0.5f}),
                                    with_sheen(lambert({0.3f, 0.3f, 0.3f}), {1, 1, 1}, 0.5f)};
  for (const SurfaceParams& p : surfaces) {
    EXPECT_NEAR(pdf_integral(surface_closure_make<kFeatureAll>(p, full_tables(), direction(0.4f))), 1.0, 1e-3);
  }
}

TEST(SurfaceSample, ReturnsWhatEvalReturns)
{
  for (const Setting& setting : rough_settings()) {
    const Vec3f wo = direction(setting.wo_z);
    for (std::uint32_t n = 0; n < 2000; ++n) {
      const Point3 point = sequence_point(n);
      const BsdfSample s = surface_sample<kFeatureAll>(setting.params, full_tables(), wo, point.lobe, point.u);
      if (!(s.pdf > 0.0f)) continue;
      const BsdfEval e = surface_eval<kFeatureAll>(setting.params, full_tables(), wo, s.wi);
      // Up to contraction of products and sums, which the compiler chooses anew where it inlines.
      EXPECT_LE(length(s.f - e.f), 1e-5f * length(e.f)) << setting.name;
      EXPECT_NEAR(s.pdf, e.pdf, 1e-5f * e.pdf) << setting.name;
      EXPECT_NEAR(static_cast<double>(length(s.wi)), 1.0, 1e-5) << setting.name;
      EXPECT_EQ((s.lobe & kLobeTransmit) != 0, s.wi.z * wo.z < 0.0f) << setting.name;
    }
  }
}

/// Equal up to the compiler's freedom to contract products and sums differently in each kernel.
void expect_close(const BsdfSample& a, const BsdfSample& b)
{
  EXPECT_EQ(a.lobe, b.lobe);
  EXPECT_NEAR(a.pdf, b.pdf, 1e-5f * a.pdf);
  EXPECT_LT(length(a.wi - b.wi), 1e-5f);
  EXPECT_LE(length(a.f - b.f), 1e-5f * length(a.f));
}

// A kernel without a feature must shade a material that does not use it as the full kernel does.
TEST(SurfaceSample, IsTheSameInKernelsWithFewerFeatures)
{
  const SurfaceParams plain = plastic({0.2f, 0.5f, 0.8f}, 0.4f);
  const SurfaceParams shiny = metal({0.9f, 0.5f, 0.8f}, 0.4f);
  const Vec3f wo = direction(0.6f);
  for (std::uint32_t n = 0; n < 1000; ++n) {
    const Point3 point = sequence_point(n);
    const BsdfSample a = surface_sample<0u>(plain, full_tables(), wo, point.lobe, point.u);
    const BsdfSample b = surface_sample<kFeatureAll>(plain, full_tables(), wo, point.lobe, point.u);
    expect_close(a, b);
    const BsdfSample c = surface_sample<kFeatureMetal>(shiny, full_tables(), wo, point.lobe, point.u);
    const BsdfSample d = surface_sample<kFeatureAll>(shiny, full_tables(), wo, point.lobe, point.u);
    expect_close(c, d);
  }
}

SurfaceParams random_params(TestRandom& random)
{
  // A third of the values at the ends of their range: that is where things break.
  const auto value = [&random] {
    const float choice = random.next();
    const float x = random.next();
    return choice < 0.17f ? 0.0f : choice < 0.34f ? 1.0f : x;
  };
  const auto color = [&] {
    const float r = value(), g = value();
    return Vec3f{r, g, value()};
  };
  SurfaceParams p;
  p.base_color = color();
  p.metallic = value();
  p.roughness = value();
  p.transmission = value();
  p.thin = random.next() < 0.5f;
  p.ior = 1.0f + 2.0f * value() * value();
  p.specular = value();
  p.specular_color = 2.0f * color();
  p.clearcoat = value();
  p.clearcoat_roughness = value();
  if (random.next() < 0.5f) {
    const float x = random.next() - 0.5f;
    p.clearcoat_N = normalize({x, random.next() - 0.5f, 1.0f});
  }
  p.sheen_color = color();
  p.sheen_roughness = value();
  return p;
}

// The bound holds per surface, not on the average. The tables' error is 1 % (see furnace_test.cpp); the rest is the
// noise of 4096 points with weights up to 40.
TEST(SurfaceAlbedo, IsAtMostOneForRandomParameters)
{
  TestRandom random(7);
  double largest = 0, largest_weight = 0;
  for (int n = 0; n < 1500; ++n) {
    const SurfaceParams p = random_params(random);
    const float wo_z = 2.0f * random.next() - 1.0f;
    const SampledAlbedo a = sampled_albedo(p, direction(wo_z), 4096);
    largest = std::max({largest, a.r, a.g, a.b});
    largest_weight = std::max(largest_weight, a.largest_weight);
    ASSERT_LT(std::max({a.r, a.g, a.b}), 1.03) << "surface " << n << " of seed 7, wo.z " << wo_z;
  }
  RecordProperty("largest_albedo", std::to_string(largest));
  RecordProperty("largest_weight", std::to_string(largest_weight));
  EXPECT_LT(largest_weight, 60.0);
}

TEST(SurfaceModel, IsFiniteForExtremeParametersAndDirections)
{
  TestRandom random(11);
  const float heights[] = {0.0f, 1e-30f, 1e-7f, 2e-6f, 1e-4f, 0.5f, 1.0f};
  const float numbers[] = {0.0f, 0x1p-24f, 0.5f, 1.0f - 0x1p-24f};
  for (int n = 0; n < 3000; ++n) {
    SurfaceParams p = random_params(random);
    if (n % 7 == 0) p.ior = 1.0f;
    if (n % 11 == 0) p.ior = 1e4f;
    for (const float height : heights) {
      const Vec3f wo = direction(n % 2 == 0 ? height : -height);
      for (const float u : numbers) {
        const BsdfSample s = surface_sample<kFeatureAll>(p, full_tables(), wo, random.next(), {u, 1.0f - 0x1p-24f - u});
        if (s.pdf > 0.0f) {
          ASSERT_TRUE(is_finite(s.wi) && is_finite(s.f) && is_finite(s.pdf)) << n << " " << height << " " << u;
          ASSERT_GE(min_component(s.f), 0.0f);
          ASSERT_NEAR(static_cast<double>(length(s.wi)), 1.0, 1e-4);
        } else {
          ASSERT_EQ(s.pdf, 0.0f) << n << " " << height << " " << u;
        }
        const BsdfEval e = surface_eval<kFeatureAll>(p, full_tables(), wo, direction(2.0f * u - 1.0f, 4.0f * u));
        ASSERT_TRUE(is_finite(e.f) && is_finite(e.pdf) && e.pdf >= 0.0f && min_component(e.f) >= 0.0f) << n;
        const BsdfEval mirror = surface_eval<kFeatureAll>(p, full_tables(), wo, {-wo.x, -wo.y, wo.z});
        ASSERT_TRUE(is_finite(mirror.f) && is_finite(mirror.pdf)) << n;
        const BsdfEval straight = surface_eval<kFeatureAll>(p, full_tables(), wo, -wo);
        ASSERT_TRUE(is_finite(straight.f) && is_finite(straight.pdf)) << n;
      }
      // What a sampler returns is unit but for rounding.
      const Vec3f upright{0, 0, std::nextafter(1.0f, 2.0f)};
      const BsdfEval above = surface_eval<kFeatureAll>(p, full_tables(), wo, upright);
      ASSERT_TRUE(is_finite(above.f) && is_finite(above.pdf)) << n;
      const BsdfEval from_above = surface_eval<kFeatureAll>(p, full_tables(), upright, wo);
      ASSERT_TRUE(is_finite(from_above.f) && is_finite(from_above.pdf)) << n;
    }
  }
}

TEST(SurfaceIsDelta, AgreesWithEval)
{
  TestRandom random(5);
  int num_delta = 0;
  for (int n = 0; n < 3000; ++n) {
    SurfaceParams p = random_params(random);
    if (n % 2 == 0) p.roughness = p.clearcoat_roughness = 0.0f;
    if (n % 4 == 0) {
      p.sheen_color = {};
      p.transmission = 1.0f;
    }
    if (!surface_is_delta(p)) continue;
    ++num_delta;
    for (std::uint32_t i = 0; i < 20; ++i) {
      const Vec3f wo = warp_sphere(sequence_point(i).u);
      const BsdfEval e = surface_eval<kFeatureAll>(p, full_tables(), wo, warp_sphere(sequence_point(i + 99).u));
      ASSERT_EQ(e.pdf, 0.0f);
      ASSERT_TRUE(is_zero(e.f));
      const BsdfSample s = surface_sample<kFeatureAll>(p, full_tables(), wo, sequence_point(i).lobe, {0.3f, 0.6f});
      ASSERT_TRUE(!(s.pdf > 0.0f) || (s.lobe & kLobeDelta) != 0);
    }
  }
  EXPECT_GT(num_delta, 100);
}

TEST(SmoothGlass, ReflectsAndRefractsByFresnelAndSnell)
{
  const SurfaceParams p = glass(1.5f, 0.0f);
  for (const float wo_z : {0.9f, 0.3f, -0.9f, -0.3f}) {
    const Vec3f wo = direction(wo_z);
    const double n_o = wo_z > 0.0f ? 1.0 : 1.5, n_i = wo_z > 0.0f ? 1.5 : 1.0;
    const double cos_o = std::abs(static_cast<double>(wo_z));
    const double sin_i = n_o / n_i * std::sqrt(1.0 - cos_o * cos_o);
    double F = 1.0;
    if (sin_i < 1.0) {
      const double cos_i = std::sqrt(1.0 - sin_i * sin_i);
      const double s = (n_o * cos_o - n_i * cos_i) / (n_o * cos_o + n_i * cos_i);
      const double q = (n_o * cos_i - n_i * cos_o) / (n_o * cos_i + n_i * cos_o);
      F = 0.5 * (s * s + q * q);
    }
    const BsdfSample reflected = surface_sample<kFeatureAll>(p, full_tables(), wo, 0.0f, {});
    EXPECT_EQ(reflected.lobe, kLobeDelta | kLobeReflect);
    EXPECT_NEAR(static_cast<double>(reflected.pdf), F, 1e-6);
    EXPECT_NEAR(static_cast<double>(reflected.wi.x), static_cast<double>(-wo.x), 1e-6);
    const BsdfSample other = surface_sample<kFeatureAll>(p, full_tables(), wo, 0.9999f, {});
    if (F < 1.0) {
      EXPECT_EQ(other.lobe, kLobeDelta | kLobeTransmit);
      EXPECT_NEAR(static_cast<double>(other.wi.x), static_cast<double>(-wo.x) * n_o / n_i, 1e-6);
      EXPECT_NEAR(static_cast<double>(other.eta), n_i / n_o, 1e-6);
      const double weight = static_cast<double>(other.f.x * std::fabs(other.wi.z) / other.pdf);
      EXPECT_NEAR(weight, 1.0, 1e-5) << "paths carry radiance over the square of the index";
      const BsdfSample flux =
          surface_sample<kFeatureAll, TransportMode::kImportance>(p, full_tables(), wo, 0.9999f, {});
      EXPECT_NEAR(static_cast<double>(flux.f.x * std::fabs(flux.wi.z) / flux.pdf), n_o * n_o / (n_i * n_i), 1e-5);
    } else {
      EXPECT_EQ(other.lobe, kLobeDelta | kLobeReflect);
    }
  }
}

TEST(GlassBranches, AreWhatChanceWouldChooseBetween)
{
  // A sample below the number at which reflection turns into refraction, and one above, for the same microfacet.
  struct Case {
    float ior, roughness, wo_z;
  };
  for (const Case& c : {Case{1.5f, 0, 0.6f}, Case{1.5f, 0, -0.9f}, Case{1.5f, 0.3f, 0.8f}, Case{1.5f, 1, 0.3f},
                        Case{1.3f, 0.5f, -0.9f}, Case{2.4f, 0.15f, -0.95f}}) {
    SCOPED_TRACE(testing::Message() << "index " << c.ior << ", roughness " << c.roughness << ", cosine " << c.wo_z);
    const SurfaceClosure closure =
        surface_closure_make<kFeatureAll>(glass(c.ior, c.roughness), full_tables(), direction(c.wo_z));
    const GlassLobe& glass_lobe = closure.lobes;
    TestRandom random(7);
    int pairs = 0;
    for (int n = 0; n < 1000; ++n) {
      const float u_x = random.next();
      const Vec2f u{u_x, random.next()};
      const GlassBranches both = glass_branches_sample<kFeatureAll>(closure, full_tables(), u);
      const float F = both.reflectance;
      EXPECT_EQ(glass_branches_sample<kFeatureAll>(closure, full_tables(), {0.99f * glass_lobe.lost - 1e-9f, u.y})
                    .reflectance,
                1.0f);
      if (!(F < 0.999f)) continue;
      ++pairs;
      constexpr float kClose = 1e-5f;
      const BsdfSample below = closure_sample<kFeatureAll>(closure, full_tables(), F - kClose, u);
      const BsdfSample above = closure_sample<kFeatureAll>(closure, full_tables(), F + kClose, u);
      for (const auto& [one, other] : {std::pair{below, both.reflected}, std::pair{above, both.refracted}}) {
        EXPECT_EQ(one.lobe, other.lobe);
        EXPECT_EQ(one.pdf, other.pdf);
        EXPECT_EQ(one.f, other.f);
        EXPECT_EQ(one.wi, other.wi);
        EXPECT_EQ(one.eta, other.eta);
      }
    }
    EXPECT_GT(pairs, 300);
  }
  EXPECT_EQ(glass_branches_sample<kFeatureAll>(
                surface_closure_make<kFeatureAll>(glass(1.0f, 0.2f), full_tables(), direction(0.5f)), full_tables(),
                {0.5f, 0.5f})
                .reflectance,
            1.0f);
}

TEST(MatchedGlass, IsNotThere)
{
  for (const float roughness : {0.0f, 0.5f, 1.0f}) {
    const Vec3f wo = direction(-0.4f);
    const BsdfSample s = surface_sample<kFeatureAll>(glass(1.0f, roughness), full_tables(), wo, 0.5f, {0.1f, 0.9f});
    EXPECT_EQ(s.wi, -wo);
    EXPECT_NEAR(static_cast<double>(s.f.x * std::fabs(s.wi.z) / s.pdf), 1.0, 1e-6);
  }
}

TEST(UnlitSurface, ScattersNothing)
{
  SurfaceParams p;
  p.unlit = true;
  EXPECT_EQ(surface_sample<kFeatureAll>(p, full_tables(), {0, 0, 1}, 0.5f, {0.5f, 0.5f}).pdf, 0.0f);
  EXPECT_TRUE(is_zero(surface_eval<kFeatureAll>(p, full_tables(), {0, 0, 1}, {0, 0, 1}).f));
  EXPECT_TRUE(surface_is_delta(p));
}

}  // namespace
}  // namespace relief
