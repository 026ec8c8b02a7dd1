// What is below a surface: the medium whose walks reflect what the surface is said to, and how paths enter.
#include "kernel/bsdf/subsurface.h"
#include "kernel/bsdf/subsurface_profile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>


namespace relief {
namespace {

/// Share of diffuse light that an even half space of isotropic scattering reflects: 1 − 2 √(1 − α) ∫ μ H(μ) dμ, by
/// Chandrasekhar's H, iterated in double precision.
double half_space_reflectance(double single_albedo)
{
  constexpr int kPoints = 400;
  std::vector<double> mu(kPoints), h(kPoints, 1.0);
  for (int i = 0; i < kPoints; ++i) mu[i] = (i + 0.5) / kPoints;
  const double root = std::sqrt(1.0 - single_albedo);
  for (int turn = 0; turn < 200; ++turn) {
    std::vector<double> next(kPoints);
    for (int i = 0; i < kPoints; ++i) {
      double sum = 0;
      for (int j = 0; j < kPoints; ++j) sum += mu[j] * h[j] / (mu[i] + mu[j]);
      next[i] = 1.0 / (root + 0.5 * single_albedo * sum / kPoints);
    }
    h = next;
  }
  double moment = 0;
  for (int i = 0; i < kPoints; ++i) moment += mu[i] * h[i] / kPoints;
  return 1.0 - 2.0 * root * moment;
}

TEST(Subsurface, AHalfSpaceReflectsItsAlbedo)
{
  // The fit's own errors: 1 % and, of bright media, 4 %.
  for (const float albedo : {0.1f, 0.3f, 0.5f, 0.7f}) {
    EXPECT_NEAR(half_space_reflectance(subsurface_single_albedo(albedo, 0.0f)) / albedo, 1.0, 0.012) << albedo;
  }
  EXPECT_NEAR(half_space_reflectance(subsurface_single_albedo(0.9f, 0.0f)) / 0.9, 1.0, 0.045);
}

TEST(Subsurface, VanDeHulstsAlbedosAreOfTheSameHalfSpaces)
{
  for (const float albedo : {0.1f, 0.3f, 0.5f, 0.7f, 0.9f}) {
    EXPECT_NEAR(half_space_reflectance(subsurface_similar_albedo(albedo, 0.0f)), albedo, 0.005) << albedo;
    const double even = subsurface_similar_albedo(albedo, 0.0f), single = subsurface_similar_albedo(albedo, -0.5f);
    EXPECT_NEAR((1.0 - single) / (1.0 + 0.5 * single), 1.0 - even, 1e-5) << albedo;
  }
}

TEST(Subsurface, AnisotropicMediaAreSimilarToEvenOnes)
{
  for (const float albedo : {0.2f, 0.5f, 0.8f}) {
    for (const float g : {0.3f, 0.6f}) {
      // Similarity: (1 − α) / (1 − g α) is what an even medium would have.
      const double single = subsurface_single_albedo(albedo, g);
      const double even = 1.0 - (1.0 - single) / (1.0 - g * single);
      EXPECT_NEAR(half_space_reflectance(even), albedo, 0.03) << albedo << " " << g;
    }
  }
}

TEST(Subsurface, DarkMediaAreBrightOnesDarkened)
{
  Subsurface s;
  s.albedo = {0.02f, 0.5f, 0.0f};
  s.radius = {1, 0.5f, 1};
  const SubsurfaceMedium m = subsurface_medium(s);
  EXPECT_FLOAT_EQ(m.albedo.x, 0.2f);
  EXPECT_FLOAT_EQ(m.gain.x, subsurface_single_albedo(0.02f, 0) / 0.2f / 0.02f);
  EXPECT_FLOAT_EQ(m.gain.y, 2.0f);
  EXPECT_FLOAT_EQ(m.sigma_t.y, 2.0f);
  EXPECT_EQ(m.gain.z, 0.0f);
}

TEST(Subsurface, FreePathsOfSkinAreInvertedDipoles)
{
  for (const float ior : {1.1f, 1.4f, 2.0f}) {
    for (const float albedo : {0.01f, 0.05f, 0.2f, 0.4f, 0.7f, 0.9f, 0.99f}) {
      const float F_dr = (-1.440f / ior + 0.710f) / ior + 0.668f + 0.0636f * ior;
      const float a43 = 4.0f / 3.0f * (1 + F_dr) / (1 - F_dr);
      const float reduced = 1.0f - sqr(subsurface_free_path(1.0f, albedo, ior)) / 3.0f;
      const auto reflects = [a43](double of) {
        const double s = std::sqrt(3 * (1 - of));
        return 0.5 * of * (1 + std::exp(static_cast<double>(-a43) * s)) * std::exp(-s);
      };
      // Halved twelve times.
      EXPECT_LT(reflects(static_cast<double>(reduced) - 0x1p-12), albedo) << ior << " " << albedo;
      EXPECT_GT(reflects(static_cast<double>(reduced) + 0x1p-12), albedo) << ior << " " << albedo;
    }
  }
  EXPECT_FLOAT_EQ(subsurface_free_path(2.0f, 0.0f, 1.4f), 2.0f * std::sqrt(3.0f));
}

/// Share of a profile's light up to a distance, by the trapezoid rule in double precision over Christensen's and Burley's sum of two
/// exponentials.
double profile_share(double free_path, double r)
{
  constexpr int kSteps = 20000;
  double sum = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = r * i / kSteps / free_path;
    sum += (i == 0 || i == kSteps ? 0.5 : 1.0) * (std::exp(-x) + std::exp(-x / 3)) / (4 * free_path);
  }
  return sum * r / kSteps;
}

TEST(Profile, HoldsAllLightWithinItsEnd)
{
  const double whole = profile_share(1, static_cast<double>(kProfileEnd));
  EXPECT_NEAR(static_cast<double>(kProfileShare), whole, 1e-7);
  for (const float free_path : {1e-3f, 0.08f, 50.0f}) {
    const double end = static_cast<double>(kProfileEnd * free_path);
    double sum = 0;
    constexpr int kSteps = 20000;
    for (int i = 0; i < kSteps; ++i) {
      sum += static_cast<double>(profile_pdf(free_path, static_cast<float>(end * (i + 0.5) / kSteps))) * end / kSteps;
    }
    EXPECT_NEAR(sum, 1, 1e-5) << free_path;
    EXPECT_EQ(profile_pdf(free_path, kProfileEnd * free_path), 0.0f);
  }
}

TEST(Profile, DistancesAreDistributedAsTheirDensitySays)
{
  const double whole = profile_share(1, static_cast<double>(kProfileEnd));
  float last = -1;
  for (const float u : {0.0f, 1e-6f, 0.01f, 0.3f, 0.5f, 0.9f, 0.99f, 0.9999f, 0x1.fffffep-1f}) {
    const float r = profile_sample(u);
    EXPECT_GT(r, last) << u;
    EXPECT_LE(r, kProfileEnd);
    // A rounded logarithm of y: 3 2⁻²⁴ in r, where the density is at most half, and the sum's own error.
    EXPECT_NEAR(profile_share(1, static_cast<double>(r)) / whole, static_cast<double>(u), 3e-7) << u;
    last = r;
  }
}

/// On a plane, where distances along the disk are those from P, what all probes find together is all light; each only by the axis that
/// can see it.
TEST(Profile, APlaneLosesNothing)
{
  const Vec3f free_path{0.1f, 0.02f, 0};
  const Vec3f N = normalize(Vec3f{1, 2, -0.5f}), P{3, -1, 2};
  Vec3f sum;
  constexpr int kSide = 256;
  for (int i = 0; i < kSide * kSide; ++i) {
    const Vec2f u{(static_cast<float>(i % kSide) + 0.5f) / kSide, (static_cast<float>(i / kSide) + 0.5f) / kSide};
    const ProfileProbe probe = profile_probe_make(free_path, P, N, u);
    EXPECT_NEAR(length(probe.D), 1, 1e-5f);
    const float towards = dot(probe.D, N);
    if (std::abs(towards) < 0.5f) continue;
    const float t = dot(P - probe.O, N) / towards;
    EXPECT_GE(t, 0.0f);
    EXPECT_LE(t, probe.length * (1 + 1e-6f));
    sum += profile_probe_gain(probe, free_path, length(probe.O + t * probe.D - P), N);
  }
  sum *= 1.0f / (kSide * kSide);
  EXPECT_NEAR(sum.x, 1, 2e-3f);
  EXPECT_NEAR(sum.y, 1, 2e-3f);
  EXPECT_EQ(sum.z, 0.0f);
}

TEST(Subsurface, PathsEnterBelowTheSurface)
{
  for (const SubsurfaceEntry entry : {SubsurfaceEntry::kDiffuse, SubsurfaceEntry::kRefracted, SubsurfaceEntry::kEither}) {
    for (const float cosine : {0.01f, 0.4f, 1.0f}) {
      Subsurface s;
      s.entry = entry;
      s.entry_alpha = 0.3f;
      const Vec3f wo{std::sqrt(1 - cosine * cosine), 0, cosine};
      for (int i = 0; i < 64; ++i) {
        const Vec3f wi = subsurface_enter(s, wo, {(static_cast<float>(i % 8) + 0.5f) / 8, (static_cast<float>(i / 8) + 0.5f) / 8});
        EXPECT_NEAR(length(wi), 1.0f, 1e-5f);
        EXPECT_LT(wi.z, 0.01f);
      }
    }
  }
}

/// Smooth facets refract by Snell's law alone.
TEST(Subsurface, SmoothFacetsRefract)
{
  Subsurface s;
  s.entry = SubsurfaceEntry::kRefracted;
  s.entry_alpha = 1e-5f;
  s.entry_ior = 1.5f;
  const Vec3f wi = subsurface_enter(s, {0.6f, 0, 0.8f}, {0.3f, 0.7f});
  EXPECT_NEAR(wi.x, -0.4f, 1e-3f);
  EXPECT_NEAR(wi.z, -std::sqrt(1 - 0.16f), 1e-3f);
}

}  // namespace
}  // namespace relief
