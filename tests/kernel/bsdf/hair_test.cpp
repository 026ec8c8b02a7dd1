// Lobes of strands: what is sampled follows the density over the whole sphere, and clear fibres lose nothing. Cuticles without a
// tilt: with one the model is not normalized, in Cycles neither.
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "kernel/bsdf/fibre.h"
#include "kernel/bsdf/hair.h"
#include "tests/kernel/bsdf/bsdf_fixture.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

struct StrandLobe {
  std::string name;
  bool is_behind = false;  ///< what it has in front, lamps alone find
  std::function<FibreEval(Vec3f wo, Vec3f wi)> eval;
  std::function<Vec3f(Vec3f wo, float u_lobe, Vec2f u)> sample;
};

StrandLobe hair_lobe(const Hair& hair)
{
  return {"hair " + std::to_string(hair.along) + ' ' + std::to_string(hair.around) + (hair.transmits ? " T" : " R"),
          hair.transmits,
          [hair](Vec3f wo, Vec3f wi) {
            const float f = hair_eval(hair, wo, wi);
            return FibreEval{splat3(f), f};
          },
          [hair](Vec3f wo, float, Vec2f u) { return hair_sample(hair, wo, u); }};
}

Fibre fibre_of(float roughness, float radial, float across, Vec3f sigma = {}, float coat = 0)
{
  Fibre fibre;
  fibre.sigma = sigma;
  fibre.variance = fibre_variance(roughness);
  fibre.variance_R = fibre_variance(roughness * (1.0f - coat));
  fibre.scale = fibre_scale(radial);
  fibre.across = across;
  return fibre;
}

StrandLobe fibre_lobe(const Fibre& fibre)
{
  return {"fibre " + std::to_string(fibre.variance) + ' ' + std::to_string(fibre.scale) + ' ' +
              std::to_string(fibre.across),
          false, [fibre](Vec3f wo, Vec3f wi) { return fibre_eval(fibre, wo, wi); },
          [fibre](Vec3f wo, float u_lobe, Vec2f u) { return fibre_sample(fibre, wo, u_lobe, u).wi; }};
}

std::vector<StrandLobe> lobes()
{
  std::vector<StrandLobe> all;
  for (const bool transmits : {false, true}) {
    all.push_back(hair_lobe(hair_make(0.3f, 0.7f, 0.1f, transmits)));
    all.push_back(hair_lobe(hair_make(0.6f, 1.0f, 0.0f, transmits)));
  }
  for (const float across : {-0.8f, 0.1f}) {
    all.push_back(fibre_lobe(fibre_of(0.4f, 0.5f, across)));
    all.push_back(fibre_lobe(fibre_of(0.7f, 0.9f, across, {0.4f, 0.8f, 2.0f})));
    all.push_back(fibre_lobe(fibre_of(0.6f, 0.4f, across, {0.1f, 0.1f, 0.1f}, 0.5f)));
  }
  return all;
}

/// A direction of a tilt along the strand, towards the viewer's side of it.
Vec3f tilted(float sine) { return {sine, 0.0f, std::sqrt(1.0f - sine * sine)}; }

// Significance 1 % for all of them together (Šidák), seed = index.
TEST(StrandLobe, SamplesFollowItsDensity)
{
  const std::vector<StrandLobe> all = lobes();
  std::uint64_t seed = 0;
  for (const StrandLobe& lobe : all) {
    for (const float sine : {-0.5f, 0.2f}) {
      const Vec3f wo = tilted(sine);
      Chi2Histogram histogram(16, 24);
      TestRandom random(seed);
      for (int n = 0; n < 200000; ++n) {
        const float u_lobe = random.next(), u = random.next();
        const Vec3f wi = lobe.sample(wo, u_lobe, {u, random.next()});
        // What turns past the end of the strand is lost.
        if (lobe.eval(wo, wi).pdf > 0.0f) {
          histogram.add(wi.x, wi.y, wi.z);
        } else {
          histogram.add_absorbed();
        }
      }
      const Chi2Result result = histogram.test([&](double x, double y, double z) {
        const Vec3f wi{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
        if (lobe.is_behind && wi.z > 0.0f) return 0.0;
        return static_cast<double>(lobe.eval(wo, wi).pdf);
      });
      EXPECT_GT(result.p_value, sidak_threshold(0.01, static_cast<int>(2 * all.size())))
          << lobe.name << ", wo.x " << sine << ", seed " << seed << ": statistic " << result.statistic << " of "
          << result.degrees_of_freedom << " degrees of freedom " << result.failure;
      ++seed;
    }
  }
}

// White furnaces: the integral over the sphere, by midpoints in the sine of the tilt and in the angle around.
TEST(StrandLobe, AClearFibreLosesNothing)
{
  constexpr int kTilts = 400, kAngles = 400;
  for (const float roughness : {0.3f, 0.6f, 1.0f}) {
    for (const float across : {-0.95f, -0.3f, 0.0f, 0.6f}) {
      for (const float sine : {-0.7f, 0.0f, 0.4f}) {
        const Fibre fibre = fibre_of(roughness, roughness, across);
        double f = 0, pdf = 0;
        for (int i = 0; i < kTilts; ++i) {
          for (int j = 0; j < kAngles; ++j) {
            const float x = -1.0f + 2.0f * (static_cast<float>(i) + 0.5f) / kTilts;
            const float phi = 2.0f * kPi * (static_cast<float>(j) + 0.5f) / kAngles;
            const float cosine = std::sqrt(1.0f - x * x);
            const FibreEval e = fibre_eval(fibre, tilted(sine), {x, -cosine * std::sin(phi), cosine * std::cos(phi)});
            f += static_cast<double>(e.f.y);
            pdf += static_cast<double>(e.pdf);
          }
        }
        const double cell = 4.0 * 3.14159265358979 / (kTilts * kAngles);
        EXPECT_NEAR(f * cell, 1.0, 3e-4) << roughness << ' ' << across << ' ' << sine;
        EXPECT_NEAR(pdf * cell, 1.0, 3e-4) << roughness << ' ' << across << ' ' << sine;
      }
    }
  }
}

// The direction in which a mirror would send light from a point of the surface is where the reflection has its peak.
TEST(StrandLobe, AFibreReflectsAboutItsNormal)
{
  const Fibre fibre = fibre_of(0.05f, 0.05f, 0.5f, {100, 100, 100});  // nothing gets through
  const Vec3f wo = tilted(0.3f), N{0.0f, 0.5f, std::sqrt(0.75f)};
  const Vec3f mirrored = 2.0f * dot(wo, N) * N - wo;
  const float at_mirror = fibre_eval(fibre, wo, mirrored).pdf;
  for (const Vec3f away : {Vec3f{0.1f, 0, 0}, Vec3f{-0.1f, 0, 0}, cross(mirrored, Vec3f{0.1f, 0, 0}),
                           cross(mirrored, Vec3f{-0.1f, 0, 0})}) {
    EXPECT_GT(at_mirror, fibre_eval(fibre, wo, normalize(mirrored + away)).pdf);
  }
}

}  // namespace
}  // namespace relief
