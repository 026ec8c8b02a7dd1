// Single formulae against independent ones in double: Fresnel, microfacet distribution and masking, refraction, tables.
#include <gtest/gtest.h>

#include "tests/kernel/bsdf/bsdf_fixture.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

/// Reflectance by the amplitudes of both polarisations, from angles instead of cosines.
double fresnel_by_angles(double cos_i, double eta)
{
  const double theta_i = std::acos(cos_i);
  const double sin_t = std::sin(theta_i) / eta;
  if (sin_t >= 1.0) return 1.0;
  const double theta_t = std::asin(sin_t);
  const double r_s = std::sin(theta_i - theta_t) / std::sin(theta_i + theta_t);
  const double r_p = std::tan(theta_i - theta_t) / std::tan(theta_i + theta_t);
  return 0.5 * (r_s * r_s + r_p * r_p);
}

TEST(FresnelDielectric, MatchesTheLawInAngles)
{
  for (const double eta : {1.1, 1.5, 2.42, 1.0 / 1.1, 1.0 / 1.5, 1.0 / 2.42}) {
    for (double cos_i = 0.01; cos_i < 0.999; cos_i += 0.01) {
      const auto c = static_cast<float>(cos_i);
      const auto e = static_cast<float>(eta);
      // Next to the critical angle the reflectance rises like a square root: compare away from it.
      if (eta < 1.0 && std::abs(1.0 - (1.0 - cos_i * cos_i) / (eta * eta)) < 1e-4) continue;
      ASSERT_NEAR(static_cast<double>(fresnel_dielectric(c, refracted_cosine(c, e), e)), fresnel_by_angles(cos_i, eta),
                  2e-5)
          << eta << " " << cos_i;
    }
  }
}

TEST(FresnelDielectric, AtNormalIncidenceIsF0)
{
  for (const float eta : {1.2f, 1.5f, 3.0f}) EXPECT_NEAR(fresnel_dielectric(1.0f, 1.0f, eta), fresnel_F0(eta), 1e-6f);
}

TEST(FresnelMean, OfDielectricsIsWithinItsStatedError)
{
  for (double ior = 1.05; ior <= 3.0; ior += 0.05) {
    double sum = 0;
    constexpr int kSteps = 2000;
    for (int i = 0; i < kSteps; ++i) {
      const double mu = (i + 0.5) / kSteps;
      sum += 2.0 * mu * fresnel_by_angles(mu, ior) / kSteps;
    }
    ASSERT_NEAR(static_cast<double>(fresnel_dielectric_mean(static_cast<float>(ior))), sum, 0.01) << ior;
  }
}

TEST(FresnelMean, OfSchlickIsExact)
{
  double sum = 0;
  constexpr int kSteps = 20000;
  for (int i = 0; i < kSteps; ++i) {
    const double mu = (i + 0.5) / kSteps;
    sum += 2.0 * mu * (0.3 + 0.6 * std::pow(1.0 - mu, 5.0)) / kSteps;
  }
  EXPECT_NEAR(static_cast<double>(fresnel_schlick_mean(splat3(0.3f), 0.9f).x), sum, 1e-6);
}

TEST(GgxDistribution, HasUnitProjectedArea)
{
  for (const float alpha : {0.01f, 0.1f, 0.5f, 1.0f}) {
    // ∫ D cos dω, tan θ = alpha·t/(1 − t) spreads the points over the peak.
    double sum = 0;
    constexpr int kSteps = 20000;
    for (int i = 0; i < kSteps; ++i) {
      const double t = (i + 0.5) / kSteps;
      const double tangent = static_cast<double>(alpha) * t / (1.0 - t);
      const double d_tangent = static_cast<double>(alpha) / ((1.0 - t) * (1.0 - t)) / kSteps;
      const double cosine = 1.0 / std::sqrt(1.0 + tangent * tangent);
      const Vec3f h{static_cast<float>(tangent * cosine), 0.0f, static_cast<float>(cosine)};
      // sin θ dθ = tan cos³ dtan.
      sum += static_cast<double>(ggx_D(h, alpha)) * cosine * tangent * cosine * cosine * cosine * d_tangent;
    }
    EXPECT_NEAR(2.0 * 3.14159265358979 * sum, 1.0, 1e-3) << alpha;
  }
}

TEST(GgxReflection, MatchesTheTextbookFormula)
{
  TestRandom random(1);
  for (int n = 0; n < 5000; ++n) {
    const double alpha = 0.01 + 0.99 * static_cast<double>(random.next());
    const Vec3f wo = direction(0.01f + 0.99f * random.next(), 6.0f * random.next());
    const Vec3f wi = direction(0.01f + 0.99f * random.next(), 6.0f * random.next());
    const double h[3] = {static_cast<double>(wo.x) + wi.x, static_cast<double>(wo.y) + wi.y,
                         static_cast<double>(wo.z) + wi.z};
    const double l = std::sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
    const double c2 = h[2] * h[2] / (l * l), tan2 = (h[0] * h[0] + h[1] * h[1]) / (h[2] * h[2]);
    const double a2 = alpha * alpha;
    const double D = a2 / (3.14159265358979 * c2 * c2 * (a2 + tan2) * (a2 + tan2));
    const auto lambda = [&](double z) { return 0.5 * (std::sqrt(1.0 + a2 * (1.0 - z * z) / (z * z)) - 1.0); };
    const double G2 = 1.0 / (1.0 + lambda(static_cast<double>(wo.z)) + lambda(static_cast<double>(wi.z)));
    const double expected = D * G2 / (4.0 * static_cast<double>(wo.z) * static_cast<double>(wi.z));
    const GgxReflection r = ggx_reflection_eval(wo, wi, static_cast<float>(alpha));
    ASSERT_NEAR(static_cast<double>(r.f), expected, 2e-4 * expected + 1e-9) << n;
    ASSERT_NEAR(static_cast<double>(r.cos_d), l / 2.0, 1e-6) << n;
  }
}

TEST(Refract, ObeysSnellAndStaysInThePlane)
{
  TestRandom random(2);
  for (int n = 0; n < 2000; ++n) {
    const float eta = n % 2 == 0 ? 1.0f + random.next() : 1.0f / (1.0f + random.next());
    const Vec3f m = warp_sphere({random.next(), random.next()});
    Vec3f wo = warp_sphere({random.next(), random.next()});
    if (dot(wo, m) < 0.0f) wo = -wo;
    const float cos_o = dot(wo, m);
    const float cos_t = refracted_cosine(cos_o, eta);
    if (!(cos_t > 0.01f)) continue;
    const Vec3f wt = refract(wo, m, cos_o, cos_t, eta);
    ASSERT_NEAR(length(wt), 1.0f, 2e-5f) << n;
    ASSERT_NEAR(eta * length(cross(wt, m)), length(cross(wo, m)), 2e-5f) << n;
    ASSERT_NEAR(dot(wt, cross(wo, m)), 0.0f, 1e-5f) << n;
  }
}

/// Albedo of GGX reflection in double by brute force over wi, no visible normals, no shared code.
double ggx_albedo_brute(double mu, double alpha, bool schlick)
{
  const double a2 = alpha * alpha, sin_o = std::sqrt(1.0 - mu * mu);
  const auto lambda = [&](double z) { return 0.5 * (std::sqrt(1.0 + a2 * (1.0 - z * z) / (z * z)) - 1.0); };
  constexpr int kZ = 1500, kPhi = 600;
  double sum = 0;
  for (int i = 0; i < kZ; ++i) {
    const double x = (i + 0.5) / kZ, z = x * x, r = std::sqrt(1.0 - z * z);
    for (int j = 0; j < kPhi; ++j) {
      const double phi = 3.14159265358979 * (j + 0.5) / kPhi;
      const double hx = sin_o + r * std::cos(phi), hy = r * std::sin(phi), hz = mu + z;
      const double l2 = hx * hx + hy * hy + hz * hz;
      const double c2 = hz * hz / l2, s2 = 1.0 - c2;
      const double D = a2 / (3.14159265358979 * (a2 * c2 + s2) * (a2 * c2 + s2));
      const double f = D / (4.0 * mu * z * (1.0 + lambda(mu) + lambda(z)));
      const double F = schlick ? std::pow(1.0 - std::min(1.0, 0.5 * std::sqrt(l2)), 5.0) : 1.0;
      sum += f * F * z * 2.0 * x / kZ * 2.0 * 3.14159265358979 / kPhi;
    }
  }
  return sum;
}

// 0.3 %: what interpolation and the 512-point quadratures leave.
TEST(BsdfTables, GgxAlbedosMatchBruteForce)
{
  for (const float roughness : {0.42f, 0.63f, 0.87f, 1.0f}) {
    for (const float mu : {0.08f, 0.33f, 0.71f, 1.0f}) {
      const GgxAlbedo e = ggx_albedo(full_tables(), ggx_coordinate(roughness), mu);
      const double alpha = static_cast<double>(roughness) * static_cast<double>(roughness);
      EXPECT_NEAR(1.0 - static_cast<double>(e.lost), ggx_albedo_brute(static_cast<double>(mu), alpha, false), 3e-3)
          << roughness << " " << mu;
      EXPECT_NEAR(static_cast<double>(e.grazing), ggx_albedo_brute(static_cast<double>(mu), alpha, true), 3e-3)
          << roughness << " " << mu;
    }
  }
}

TEST(BsdfTables, AreTheSameOnEveryRun)
{
  static BsdfTables a, b;
  bsdf_tables_make(a);
  bsdf_tables_make(b);
  EXPECT_EQ(0, __builtin_memcmp(&a, &b, sizeof(BsdfTables)));
}

// f·cos of a lobe that multiplies two coupled factors integrates to colour × factor, whatever the factor.
TEST(DiffuseCoupled, TurnsWhatIsNotReflectedIntoAlbedo)
{
  const auto a = [](double mu) { return 0.9 - 0.5 * std::pow(1.0 - mu, 5.0); };
  double mean = 0, albedo = 0;
  constexpr int kSteps = 4000;
  for (int i = 0; i < kSteps; ++i) mean += 2.0 * (i + 0.5) / kSteps * a((i + 0.5) / kSteps) / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    const double mu = (i + 0.5) / kSteps;
    const Vec3f f = diffuse_coupled_eval(splat3(1.0f), static_cast<float>(a(0.3)), static_cast<float>(a(mu)),
                                         static_cast<float>(mean));
    albedo += static_cast<double>(f.x) * mu * 2.0 * 3.14159265358979 / kSteps;
  }
  EXPECT_NEAR(albedo, a(0.3), 1e-5);
}

}  // namespace
}  // namespace relief
