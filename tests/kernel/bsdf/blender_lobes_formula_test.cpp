// Values of the lobes of Blender's shaders: against formulae in double that share no code, and against pictures of Cycles.
#include <gtest/gtest.h>

#include <algorithm>
#include <complex>

#include "kernel/bsdf/ashikhmin_shirley.h"
#include "kernel/bsdf/beckmann.h"
#include "kernel/bsdf/clearcoat_gtr1.h"
#include "kernel/bsdf/fresnel_models.h"
#include "kernel/bsdf/microfacet_energy.h"
#include "kernel/bsdf/microfacet_refraction.h"
#include "kernel/bsdf/oren_nayar.h"
#include "kernel/bsdf/principled_diffuse.h"
#include "kernel/bsdf/principled_sheen.h"
#include "kernel/bsdf/sheen_microfibre.h"
#include "kernel/bsdf/thin_film.h"
#include "kernel/bsdf/toon.h"
#include "kernel/bsdf/translucent.h"
#include "kernel/bsdf/velvet.h"
#include "tests/kernel/bsdf/lobe_trio.h"

namespace relief {
namespace {

constexpr double kPiD = 3.14159265358979323846;

/// Directions by angles, and what the oracles need of them.
struct Pair {
  double theta_o, phi_o, theta_i, phi_i;
  Vec3f wo, wi;
  double h[3];  ///< half vector, unit
  double cos_d;
};

Pair pair_of(TestRandom& random)
{
  Pair p;
  p.theta_o = 1.55 * static_cast<double>(random.next());
  p.theta_i = 1.55 * static_cast<double>(random.next());
  p.phi_o = 2.0 * kPiD * static_cast<double>(random.next());
  p.phi_i = 2.0 * kPiD * static_cast<double>(random.next());
  const auto at = [](double theta, double phi, double* w) {
    w[0] = std::sin(theta) * std::cos(phi);
    w[1] = std::sin(theta) * std::sin(phi);
    w[2] = std::cos(theta);
  };
  double o[3], i[3];
  at(p.theta_o, p.phi_o, o);
  at(p.theta_i, p.phi_i, i);
  double squared = 0;
  for (int k = 0; k < 3; ++k) squared += (o[k] + i[k]) * (o[k] + i[k]);
  for (int k = 0; k < 3; ++k) p.h[k] = (o[k] + i[k]) / std::sqrt(squared);
  p.cos_d = o[0] * p.h[0] + o[1] * p.h[1] + o[2] * p.h[2];
  const auto vec = [](const double* w) {
    return Vec3f{static_cast<float>(w[0]), static_cast<float>(w[1]), static_cast<float>(w[2])};
  };
  p.wo = vec(o);
  p.wi = vec(i);
  return p;
}

/// Compares f over random pairs. The allowance is relative, and absolute where f is next to nothing.
template <typename Oracle>
void expect_formula(const std::string& name,
                    const std::function<float(Vec3f, Vec3f, float*)>& eval,
                    const Oracle& oracle,
                    double relative = 1e-4)
{
  TestRandom random(11);
  for (int n = 0; n < 5000; ++n) {
    const Pair p = pair_of(random);
    float pdf = 0;
    const double expected = oracle(p);
    ASSERT_NEAR(static_cast<double>(eval(p.wo, p.wi, &pdf)), expected, relative * std::abs(expected) + 1e-5)
        << name << ", pair " << n << ": angles " << p.theta_o << " " << p.phi_o << " " << p.theta_i << " " << p.phi_i;
  }
}

TEST(BlenderLobeFormula, OrenNayar)
{
  for (const double sigma : {0.2, 1.0}) {
    const auto lobe = oren_nayar_make(static_cast<float>(sigma));
    expect_formula(
        "Oren-Nayar", [&](Vec3f wo, Vec3f wi, float* pdf) { return oren_nayar_eval(lobe, wo, wi, pdf); },
        [&](const Pair& p) {
          const double A = 1.0 / (kPiD + (3.0 * kPiD - 4.0) / 6.0 * sigma);
          double t = std::sin(p.theta_o) * std::sin(p.theta_i) * std::cos(p.phi_o - p.phi_i);
          if (t > 0.0) t /= std::cos(std::min(p.theta_o, p.theta_i));
          return A + sigma * A * t;
        });
  }
}

TEST(BlenderLobeFormula, OrenNayarAlbedoIsItsIntegral)
{
  const OrenNayar lobe = oren_nayar_make(0.7f);
  const LobeTrio trio{
      "Oren-Nayar", [&](Vec3f wo, Vec3f wi, float* pdf) { return oren_nayar_eval(lobe, wo, wi, pdf); }, {}};
  for (const float z : {0.01f, 0.2f, 0.6f, 1.0f}) {
    EXPECT_NEAR(lobe_integrals(trio, direction(z)).albedo, static_cast<double>(oren_nayar_albedo(lobe, z)), 1e-3) << z;
  }
}

TEST(BlenderLobeFormula, OrenNayarWithMultipleScatteringIsClosedForWhite)
{
  for (const float roughness : {0.3f, 1.0f}) {
    for (const float z : {0.05f, 0.3f, 1.0f}) {
      const OrenNayarMultiple lobe = oren_nayar_multiple_make(splat3(1.0f), roughness, direction(z));
      const LobeTrio trio{
          "", [&](Vec3f wo, Vec3f wi, float* pdf) { return oren_nayar_multiple_eval(lobe, wo, wi, pdf).x; }, {}};
      EXPECT_NEAR(lobe_integrals(trio, direction(z)).albedo, 1.0, 2e-3) << roughness << " " << z;
    }
  }
}

double schlick5(double cosine) { return std::pow(1.0 - cosine, 5.0); }

TEST(BlenderLobeFormula, PrincipledDiffuseIsBurleys)
{
  // Burley 2012: interpolation to F_D90 from both sides; what its product with 1 − F/2 leaves is the same polynomial.
  for (const double roughness : {0.0, 0.4, 1.0}) {
    const PrincipledDiffuse lobe{static_cast<float>(roughness)};
    expect_formula(
        "diffuse", [&](Vec3f wo, Vec3f wi, float* pdf) { return principled_diffuse_eval(lobe, wo, wi, pdf); },
        [&](const Pair& p) {
          const double F_D90 = 0.5 + 2.0 * roughness * p.cos_d * p.cos_d;
          const double o = 1.0 + (F_D90 - 1.0) * schlick5(std::cos(p.theta_o));
          const double i = 1.0 + (F_D90 - 1.0) * schlick5(std::cos(p.theta_i));
          return o * i / kPiD;
        });
  }
}

TEST(BlenderLobeFormula, PrincipledSheen)
{
  expect_formula(
      "sheen", [](Vec3f wo, Vec3f wi, float* pdf) { return principled_sheen_eval({}, wo, wi, pdf); },
      [](const Pair& p) { return schlick5(p.cos_d); });
}

double lambda_ggx(double alpha_tan2) { return 0.5 * (std::sqrt(1.0 + alpha_tan2) - 1.0); }
/// The exact one, of which the lobe has a fit.
double lambda_beckmann(double alpha_tan2)
{
  const double a = 1.0 / std::sqrt(alpha_tan2);
  return 0.5 * (std::erf(a) - 1.0) + std::exp(-a * a) / (2.0 * a * std::sqrt(kPiD));
}

TEST(BlenderLobeFormula, GgxAndBeckmannOfTwoRoughnesses)
{
  for (const bool is_beckmann : {false, true}) {
    for (const SmithMasking masking : {SmithMasking::kSeparable, SmithMasking::kCorrelated}) {
      const double a_x = 0.35, a_y = 0.8;
      const AnisotropicAlpha alpha{static_cast<float>(a_x), static_cast<float>(a_y)};
      expect_formula(
          is_beckmann ? "Beckmann" : "GGX",
          [&](Vec3f wo, Vec3f wi, float* pdf) {
            return is_beckmann ? beckmann_eval({alpha, masking}, wo, wi, pdf)
                               : ggx_anisotropic_eval({alpha, masking}, wo, wi, pdf);
          },
          [&](const Pair& p) {
            const double slope_x = p.h[0] / p.h[2] / a_x, slope_y = p.h[1] / p.h[2] / a_y;
            const double slope2 = slope_x * slope_x + slope_y * slope_y;
            const double P22 = is_beckmann ? std::exp(-slope2) : 1.0 / ((1.0 + slope2) * (1.0 + slope2));
            const double D = P22 / (kPiD * a_x * a_y * std::pow(p.h[2], 4.0));
            const auto lambda = [&](double theta, double phi) {
              const double a2 = std::pow(a_x * std::cos(phi), 2.0) + std::pow(a_y * std::sin(phi), 2.0);
              const double x = a2 * std::pow(std::tan(theta), 2.0);
              return is_beckmann ? lambda_beckmann(x) : lambda_ggx(x);
            };
            const double o = lambda(p.theta_o, p.phi_o), i = lambda(p.theta_i, p.phi_i);
            const double G = masking == SmithMasking::kSeparable ? 1.0 / ((1.0 + o) * (1.0 + i)) : 1.0 / (1.0 + o + i);
            return D * G / (4.0 * std::cos(p.theta_o) * std::cos(p.theta_i));
          },
          is_beckmann ? 8e-3 : 2e-4);
    }
  }
}

TEST(BlenderLobeFormula, AshikhminShirley)
{
  const double n_x = 2.0 / (0.3 * 0.3) - 2.0, n_y = 2.0 / (0.7 * 0.7) - 2.0;
  const AshikhminShirley lobe = ashikhmin_shirley_make({0.3f, 0.7f});
  expect_formula(
      "Ashikhmin-Shirley", [&](Vec3f wo, Vec3f wi, float* pdf) { return ashikhmin_shirley_eval(lobe, wo, wi, pdf); },
      [&](const Pair& p) {
        const double phi_h = std::atan2(p.h[1], p.h[0]);
        const double exponent = n_x * std::pow(std::cos(phi_h), 2.0) + n_y * std::pow(std::sin(phi_h), 2.0);
        return std::sqrt((n_x + 1.0) * (n_y + 1.0)) / (8.0 * kPiD) * std::pow(p.h[2], exponent) /
               (p.cos_d * std::max(std::cos(p.theta_o), std::cos(p.theta_i)));
      },
      3e-4);
}

TEST(BlenderLobeFormula, Velvet)
{
  const double sigma = 0.6;
  expect_formula(
      "velvet", [&](Vec3f wo, Vec3f wi, float* pdf) { return velvet_eval(velvet_make(0.6f), wo, wi, pdf); },
      [&](const Pair& p) {
        const double theta_h = std::acos(p.h[2]);
        const double cot = 1.0 / std::tan(theta_h);
        const double D =
            std::exp(-cot * cot / (sigma * sigma)) / (sigma * sigma * kPiD * std::pow(std::sin(theta_h), 4.0));
        const double o = std::cos(p.theta_o), i = std::cos(p.theta_i);
        const double G = std::min({1.0, 2.0 * p.h[2] * o / p.cos_d, 2.0 * p.h[2] * i / p.cos_d});
        return D * G / (4.0 * o * i);
      },
      3e-4);
}

TEST(BlenderLobeFormula, ClearcoatGtr1)
{
  const double a2 = 0.04;
  expect_formula(
      "GTR1", [&](Vec3f wo, Vec3f wi, float* pdf) { return clearcoat_gtr1_eval({0.2f}, wo, wi, pdf); },
      [&](const Pair& p) {
        const double D = (a2 - 1.0) / (kPiD * std::log(a2) * (1.0 + (a2 - 1.0) * p.h[2] * p.h[2]));
        const auto G1 = [](double theta) { return 1.0 / (1.0 + lambda_ggx(0.0625 * std::pow(std::tan(theta), 2.0))); };
        return D * G1(p.theta_o) * G1(p.theta_i) / (4.0 * std::cos(p.theta_o) * std::cos(p.theta_i));
      },
      3e-4);
}

TEST(BlenderLobeFormula, ToonIsADiskOfConstantRadiance)
{
  for (const bool is_glossy : {false, true}) {
    const Toon lobe = toon_make(0.4f, 0.3f, is_glossy);
    const double inner = 0.2 * kPiD, rim = 0.15 * kPiD;
    expect_formula(
        "toon", [&](Vec3f wo, Vec3f wi, float* pdf) { return toon_eval(lobe, wo, wi, pdf); },
        [&](const Pair& p) {
          // Spherical law of cosines; the mirror direction has the opposite azimuth.
          const double cosine = std::cos(p.theta_o) * std::cos(p.theta_i) -
                                std::sin(p.theta_o) * std::sin(p.theta_i) * std::cos(p.phi_o - p.phi_i);
          const double angle = is_glossy ? std::acos(cosine) : p.theta_i;
          const double fade = std::clamp(1.0 - (angle - inner) / rim, 0.0, 1.0);
          return fade / (2.0 * kPiD * (1.0 - std::cos(inner + rim)) * std::cos(p.theta_i));
        },
        1e-3);
  }
}

TEST(BlenderLobeFormula, RefractionIsReciprocalUpToTheIndices)
{
  // Flux convention: f(wo, wi, eta) / eta² = f(wi, wo, 1 / eta).
  TestRandom random(5);
  for (const bool is_beckmann : {false, true}) {
    int num_lit = 0;
    for (int n = 0; n < 2000; ++n) {
      const Vec3f wo = direction(0.05f + 0.95f * random.next(), 6.0f * random.next());
      const Vec3f wi = direction(-0.05f - 0.95f * random.next(), 6.0f * random.next());
      const MicrofacetRefraction down{0.6f, 1.45f, is_beckmann};
      const MicrofacetRefraction up{0.6f, 1.0f / 1.45f, is_beckmann};
      float pdf = 0;
      const float there = microfacet_refraction_eval(down, wo, wi, &pdf) / (1.45f * 1.45f);
      const float back = microfacet_refraction_eval(up, -wi, -wo, &pdf);
      ASSERT_NEAR(there, back, 1e-3f * there + 1e-6f) << n;
      num_lit += there > 1e-3f;
    }
    EXPECT_GT(num_lit, 200);
  }
}

TEST(BlenderLobeFormula, MicrofibreSheenReflectsItsAlbedo)
{
  for (const float roughness : {0.3f, 0.8f}) {
    for (const float z : {0.1f, 0.5f, 1.0f}) {
      const SheenMicrofibre lobe = sheen_microfibre_make(z, roughness);
      const LobeTrio trio{
          "", [&](Vec3f wo, Vec3f wi, float* pdf) { return sheen_microfibre_eval(lobe, wo, wi, pdf); }, {}};
      const LobeIntegrals integrals = lobe_integrals(trio, direction(z));
      EXPECT_NEAR(integrals.albedo, static_cast<double>(lobe.albedo), 1e-3);
      EXPECT_NEAR(integrals.pdf, 1.0, 2e-3);
    }
  }
}

// What Cycles 3.4.1 renders: relative 2e-5, the clearcoat's logarithm and the fits of Cycles included.
TEST(BlenderLobeFormula, IsWhatCyclesRenders)
{
  struct Recorded {
    const char* lobe;
    float a, b;
    Vec3f wo, wi;
    float radiance;
  };
  static const Recorded kRecorded[] = {
#include "tests/kernel/bsdf/blender_lobes_recorded.inc"
  };
  for (const Recorded& r : kRecorded) {
    const std::string name = r.lobe;
    const Vec3f wo = normalize(r.wo), wi = normalize(r.wi);
    const SmithMasking separable = SmithMasking::kSeparable;
    float pdf = 0, f = -1;
    if (name == "oren_nayar") f = oren_nayar_eval(oren_nayar_make(r.a), wo, wi, &pdf);
    if (name == "velvet") f = velvet_eval(velvet_make(r.a), wo, wi, &pdf);
    if (name == "toon_diffuse") f = toon_eval(toon_make(r.a, r.b, false), wo, wi, &pdf);
    if (name == "toon_glossy") f = toon_eval(toon_make(r.a, r.b, true), wo, wi, &pdf);
    // Roughness and anisotropy of the Glossy node.
    const AnisotropicAlpha glossy = anisotropic_alpha_of_glossy(r.a, r.b);
    if (name == "ggx") f = ggx_anisotropic_eval({glossy, separable}, wo, wi, &pdf);
    if (name == "beckmann") f = beckmann_eval({glossy, separable}, wo, wi, &pdf);
    if (name == "ashikhmin_shirley") f = ashikhmin_shirley_eval(ashikhmin_shirley_make(glossy), wo, wi, &pdf);
    // Roughness and index.
    if (name == "refr_ggx" || name == "refr_beckmann") {
      f = microfacet_refraction_eval({sqr(r.a), r.b, name == "refr_beckmann", separable, true}, wo, wi, &pdf);
    }
    // Roughness of the Principled shader, and its anisotropy where it shines.
    const AnisotropicAlpha principled = anisotropic_alpha_of_principled(r.a, r.b);
    const float cos_d = half_angle_cosine(wo, wi);
    if (name == "p_diffuse") f = principled_diffuse_eval({r.a}, wo, wi, &pdf);
    if (name == "p_sheen") f = principled_diffuse_eval({r.a}, wo, wi, &pdf) + principled_sheen_eval({}, wo, wi, &pdf);
    if (name == "p_metal") f = ggx_anisotropic_eval({principled, separable}, wo, wi, &pdf);
    if (name == "p_specular") {
      f = ggx_anisotropic_eval({principled, separable}, wo, wi, &pdf) *
          fresnel_interpolated(splat3(0.04f), splat3(1.0f), cos_d, ior_of_specular(0.5f)).x;
    }
    if (name == "p_clearcoat") {
      f = clearcoat_gtr1_eval({sqr(r.a)}, wo, wi, &pdf) * kGtr1Strength *
          fresnel_interpolated(splat3(0.04f), splat3(1.0f), cos_d, kGtr1Ior).x;
    }
    if (name == "translucent") f = translucent_eval({}, wo, wi, &pdf);
    ASSERT_GE(f, 0.0f) << name;
    EXPECT_NEAR(f * std::fabs(wi.z), r.radiance, 2e-5f * r.radiance + 1e-8f) << name << " " << r.a << " " << r.b;
  }
}

// Furnace of Cycles 3.4.1, Multiscatter GGX of colour (0.9, 0.5, 0.2), 256 pixels of 1024 samples.
TEST(BlenderLobeFormula, EnergyFactorOfTheWalkMeetsItsAlbedo)
{
  struct Recorded {
    float roughness, wo_z;
    Vec3f albedo;
  };
  const Recorded kRecorded[] = {
      {0.4f, 0.1f, {0.8897f, 0.4717f, 0.1821f}}, {0.4f, 0.6f, {0.8943f, 0.4846f, 0.1904f}},
      {0.6f, 0.3f, {0.8801f, 0.4468f, 0.1669f}}, {0.6f, 0.6f, {0.8784f, 0.4431f, 0.1650f}},
      {0.8f, 0.1f, {0.8841f, 0.4570f, 0.1730f}}, {0.8f, 0.3f, {0.8683f, 0.4171f, 0.1493f}},
      {1.0f, 0.1f, {0.8764f, 0.4370f, 0.1608f}}, {1.0f, 0.3f, {0.8512f, 0.3766f, 0.1263f}},
      {1.0f, 0.6f, {0.8260f, 0.3234f, 0.0988f}},
  };
  const Vec3f color = {0.9f, 0.5f, 0.2f};
  for (const Recorded& r : kRecorded) {
    const float E = 1.0f - ggx_albedo(full_tables(), ggx_coordinate(r.roughness), r.wo_z).lost;
    const Vec3f albedo = color * ggx_energy_factor(full_tables(), EnergyModel::kWalk, color, r.roughness, r.wo_z) * E;
    EXPECT_LT(max_component(abs(albedo - r.albedo)), 0.011f) << r.roughness << " " << r.wo_z;
  }
}

TEST(BlenderLobeFormula, EnergyFactorClosesTheFurnaceForWhite)
{
  for (const EnergyModel model : {EnergyModel::kTable, EnergyModel::kWalk}) {
    for (const float roughness : {0.3f, 0.7f, 1.0f}) {
      const float E = 1.0f - ggx_albedo(full_tables(), ggx_coordinate(roughness), 0.4f).lost;
      EXPECT_NEAR(ggx_energy_factor(full_tables(), model, splat3(1.0f), roughness, 0.4f).x * E, 1.0f, 1e-5f);
    }
  }
}

/// Amplitudes of a dielectric or conducting interface by complex cosines.
struct Amplitudes {
  std::complex<double> s, p;
};
Amplitudes amplitudes(std::complex<double> n1, std::complex<double> cos1, std::complex<double> n2)
{
  const std::complex<double> sine = n1 / n2 * std::sqrt(1.0 - cos1 * cos1);
  const std::complex<double> cos2 = std::sqrt(1.0 - sine * sine);
  return {(n1 * cos1 - n2 * cos2) / (n1 * cos1 + n2 * cos2), (n2 * cos1 - n1 * cos2) / (n2 * cos1 + n1 * cos2)};
}

TEST(FresnelModels, ConductorIsCloseToTheExactOne)
{
  // The formula takes cos_t as 1, which strong absorption justifies: 0.03 for the metals of the shader's defaults.
  const double eta = 2.757, k = 3.867;
  for (double cosine = 0.02; cosine < 1.0; cosine += 0.02) {
    const Amplitudes a = amplitudes(1.0, cosine, {eta, k});
    const double exact = 0.5 * (std::norm(a.s) + std::norm(a.p));
    const float ours = fresnel_conductor(splat3(2.757f), splat3(3.867f), static_cast<float>(cosine)).x;
    EXPECT_NEAR(static_cast<double>(ours), exact, 0.03) << cosine;
  }
  EXPECT_NEAR(fresnel_conductor(splat3(1.5f), splat3(0.0f), 1.0f).x, 0.04f, 1e-6f);
}

TEST(FresnelModels, ConductorsOf52AreExact)
{
  for (const double eta : {0.2, 1.0, 2.757}) {
    for (const double k : {0.0, 0.5, 3.867}) {
      for (double cosine = 0.02; cosine <= 1.0; cosine += 0.07) {
        const Amplitudes a = amplitudes(1.4, cosine, {eta, k});
        const Vec3f n3 = splat3(static_cast<float>(eta)), k3 = splat3(static_cast<float>(k));
        const ConductorReflection r = fresnel_conductor_polarized(static_cast<float>(cosine), 1.4f, n3, k3);
        EXPECT_NEAR(static_cast<double>(r.R_s.x), std::norm(a.s), 2e-5) << eta << " " << k << " " << cosine;
        EXPECT_NEAR(static_cast<double>(r.R_p.y), std::norm(a.p), 2e-5) << eta << " " << k << " " << cosine;
        if (k == 0.0) continue;
        EXPECT_NEAR(static_cast<double>(r.cos_s.z), std::cos(std::arg(a.s)), 2e-4) << eta << " " << k << " " << cosine;
        EXPECT_NEAR(static_cast<double>(r.sin_s.z), std::sin(std::arg(a.s)), 2e-4) << eta << " " << k << " " << cosine;
        EXPECT_NEAR(static_cast<double>(r.cos_p.x), std::cos(std::arg(a.p)), 2e-4) << eta << " " << k << " " << cosine;
        EXPECT_NEAR(static_cast<double>(r.sin_p.x), std::sin(std::arg(a.p)), 2e-4) << eta << " " << k << " " << cosine;
      }
    }
  }
}

TEST(FresnelModels, F82MeetsItsColours)
{
  const Vec3f F0 = {0.617f, 0.577f, 0.540f}, tint = {0.695f, 0.726f, 0.770f};
  const FresnelF82 f = fresnel_f82_make(F0, tint);
  const float fifth = schlick_weight(1.0f / 7.0f);
  const Vec3f schlick = F0 * (1.0f - fifth) + splat3(fifth);
  EXPECT_LT(max_component(abs(fresnel_f82(f, 1.0f) - F0)), 1e-6f);
  EXPECT_LT(max_component(abs(fresnel_f82(f, 1.0f / 7.0f) - schlick * tint)), 1e-5f);
  EXPECT_EQ(fresnel_f82(f, 0.0f).x, 1.0f);
  double mean = 0;
  constexpr int kSteps = 20000;
  for (int i = 0; i < kSteps; ++i) {
    const double mu = (i + 0.5) / kSteps;
    mean += 2.0 * mu * static_cast<double>(fresnel_f82(f, static_cast<float>(mu)).y) / kSteps;
  }
  EXPECT_NEAR(static_cast<double>(fresnel_f82_mean(f).y), mean, 1e-4);
}

TEST(FresnelModels, F82OfAConductorMeetsItTwice)
{
  const Vec3f eta = {2.757f, 2.513f, 2.231f}, k = {3.867f, 3.404f, 3.009f};
  const FresnelF82 f = fresnel_f82_of_conductor(eta, k);
  for (const float z : {1.0f, 1.0f / 7.0f}) {
    EXPECT_LT(max_component(abs(fresnel_f82(f, z) - fresnel_conductor(eta, k, z))), 1e-5f) << z;
  }
}

TEST(FresnelModels, InterpolationFollowsTheDielectric)
{
  // With its own F0 the interpolation is the dielectric itself.
  for (const float z : {0.05f, 0.3f, 0.8f, 1.0f}) {
    EXPECT_NEAR(fresnel_interpolated(splat3(0.04f), splat3(1.0f), z, 1.5f).x, fresnel_dielectric_at(z, 1.5f), 1e-6f);
  }
  EXPECT_NEAR(ior_of_specular(0.5f), 1.5f, 1e-6f);
  EXPECT_NEAR(ior_of_F0(0.04f), 1.5f, 1e-6f);
  EXPECT_NEAR(fresnel_F0(ior_of_F0(0.3f)), 0.3f, 1e-6f);
  EXPECT_NEAR(fresnel_schlick_generalized(splat3(0.1f), splat3(0.9f), 5.0f, 0.4f, 1.5f).x,
              fresnel_schlick(splat3(0.1f), 0.9f, 0.4f).x, 1e-6f);
}

TEST(FresnelModels, ThinFilmOfTheSurfacesOwnIndexIsNotThere)
{
  // No reflection between film and surface: what is left is the outer interface, of whatever thickness.
  for (const float z : {0.2f, 0.7f, 1.0f}) {
    const Vec3f F = fresnel_thin_film(z, 1.5f, 1.5f, 500.0f);
    const float expected = fresnel_dielectric_at(z, 1.5f);
    // White under E scaled to D65 is white to the digits of the matrix.
    EXPECT_LT(max_component(abs(F - splat3(expected))), 1e-4f) << z;
  }
  // A film that has faded away.
  EXPECT_LT(max_component(abs(fresnel_thin_film(0.6f, 1.5f, 1.33f, 0.0f) - splat3(fresnel_dielectric_at(0.6f, 1.5f)))),
            1e-3f);
}

TEST(FresnelModels, ThinFilmIsTheSpectralIntegral)
{
  // Airy's sum in closed form at each wavelength, under the Gaussians whose transforms the code has; their sum over Y's is
  // what normalises it. The code stops at the third order.
  const auto reflectance = [](double cosine, double eta, double film, double nm, double wavelength) {
    const Amplitudes top = amplitudes(1.0, cosine, film);
    const double cos2 = std::sqrt(1.0 - (1.0 - cosine * cosine) / (film * film));
    const Amplitudes bottom = amplitudes(film, cos2, eta);
    const std::complex<double> turn = std::polar(1.0, 4.0 * kPiD * film * nm * cos2 / wavelength);
    const auto sum = [&](std::complex<double> r12, std::complex<double> r23) {
      return std::norm((r12 + r23 * turn) / (1.0 + r12 * r23 * turn));
    };
    return 0.5 * (sum(top.s, bottom.s) + sum(top.p, bottom.p));
  };
  for (const double nm : {200.0, 450.0}) {
    for (const double cosine : {0.4, 1.0}) {
      double xyz[3] = {}, norm[3] = {};
      // Gaussians in wave number (per metre); X has two.
      const double value[4] = {5.4856e-13, 4.4201e-13, 5.2481e-13, 0};
      const double position[4] = {1.6810e6, 1.7953e6, 2.2084e6, 2.2399e6};
      const double variance[4] = {4.3278e9, 9.3046e9, 6.6121e9, 4.5282e9};
      for (double sigma = 1.2e6; sigma < 2.9e6; sigma += 1e3) {
        const double R = reflectance(cosine, 1.5, 1.33, nm, 1e9 / sigma);
        for (int c = 0; c < 4; ++c) {
          // A transform that falls as exp(−variance · phase²) belongs to a Gaussian of twice that variance.
          const double spread = 2.0 * variance[c];
          const double area = c < 3 ? value[c] * std::sqrt(2.0 * kPiD * variance[c]) : 1.64408e-8;
          const double g = area / std::sqrt(2.0 * kPiD * spread) *
                           std::exp(-std::pow(sigma - position[c], 2.0) / (2.0 * spread)) * 1e3 / 1.0685e-7;
          xyz[c % 3] += R * g;
          norm[c % 3] += g;
        }
      }
      for (const double n : norm) EXPECT_NEAR(n, 1.0, 0.01);
      const double X = xyz[0] * 0.95047, Y = xyz[1], Z = xyz[2] * 1.08883;
      const double rgb[3] = {3.2404542 * X - 1.5371385 * Y - 0.4985314 * Z,
                             -0.9692660 * X + 1.8760108 * Y + 0.0415560 * Z,
                             0.0556434 * X - 0.2040259 * Y + 1.0572252 * Z};
      const Vec3f F = fresnel_thin_film(static_cast<float>(cosine), 1.5f, 1.33f, static_cast<float>(nm));
      EXPECT_NEAR(static_cast<double>(F.x), rgb[0], 3e-3) << nm << " " << cosine;
      EXPECT_NEAR(static_cast<double>(F.y), rgb[1], 3e-3) << nm << " " << cosine;
      EXPECT_NEAR(static_cast<double>(F.z), rgb[2], 3e-3) << nm << " " << cosine;
    }
  }
}

const ThinFilmTable& film_table()
{
  static const auto made = [] {
    auto table = std::make_unique<ThinFilmTable>();
    thin_film_table_make(*table);
    return table;
  }();
  return *made;
}

TEST(FresnelModels, FilmsOf52AreSpectralIntegrals)
{
  // Airy's sum in closed form at each wavelength that the table is made of, by Rec.709's matching functions.
  const double from_xyz[3][3] = {
      {3.2404542, -1.5371385, -0.4985314}, {-0.9692660, 1.8760108, 0.0415560}, {0.0556434, -0.2040259, 1.0572252}};
  for (const std::complex<double> below : {std::complex<double>(1.5, 0.0), std::complex<double>(2.757, 3.867)}) {
    for (const double nm : {50.0, 300.0, 900.0}) {
      for (const double cosine : {0.4, 0.7, 1.0}) {
        const double film = 1.33, cos2 = std::sqrt(1.0 - (1.0 - cosine * cosine) / (film * film));
        const Amplitudes top = amplitudes(1.0, cosine, film), bottom = amplitudes(film, cos2, below);
        double rgb[3] = {}, norm[3] = {};
        for (int w = 0; w < kNumCieMatches; ++w) {
          const std::complex<double> turn = std::polar(1.0, 4.0 * kPiD * film * nm * cos2 / (380.0 + 5.0 * w));
          const auto sum = [&](std::complex<double> r12, std::complex<double> r23) {
            return std::norm((r12 + r23 * turn) / (1.0 + r12 * r23 * turn));
          };
          const double R = 0.5 * (sum(top.s, bottom.s) + sum(top.p, bottom.p));
          for (int c = 0; c < 3; ++c) {
            double match = 0;
            for (int i = 0; i < 3; ++i) match += from_xyz[c][i] * static_cast<double>(kCieMatches[i][w]);
            rgb[c] += R * match;
            norm[c] += match;
          }
        }
        const ThinFilm thin{&film_table(), 1.33f, static_cast<float>(nm)};
        const Vec3f n = splat3(static_cast<float>(below.real())), k = splat3(static_cast<float>(below.imag()));
        const Vec3f F = below.imag() > 0 ? fresnel_film_on_conductor(thin, static_cast<float>(cosine), n, k)
                                         : fresnel_film_on_dielectric(thin, static_cast<float>(cosine), n.x);
        // The code stops at the third order, of which a metal leaves more; its table is linear between nodes.
        const double allowed = below.imag() > 0 ? 4e-3 : 5e-4;
        const auto exact = [&](int c) { return std::clamp(rgb[c] / norm[c], 0.0, 1.0); };
        EXPECT_NEAR(static_cast<double>(F.x), exact(0), allowed) << below << " " << nm << " " << cosine;
        EXPECT_NEAR(static_cast<double>(F.y), exact(1), allowed) << below << " " << nm << " " << cosine;
        EXPECT_NEAR(static_cast<double>(F.z), exact(2), allowed) << below << " " << nm << " " << cosine;
      }
    }
  }
}

TEST(FresnelModels, FilmsThatHaveFadedAreNotThere)
{
  const ThinFilm none{&film_table(), 1.33f, 1e-3f};
  const Vec3f n{2.757f, 2.513f, 2.231f}, k{3.867f, 3.404f, 3.009f};
  for (const float z : {0.1f, 0.5f, 1.0f}) {
    EXPECT_LT(max_component(abs(fresnel_film_on_dielectric(none, z, 1.5f) - splat3(fresnel_dielectric_at(z, 1.5f)))),
              1e-4f);
    EXPECT_LT(max_component(abs(fresnel_film_on_conductor(none, z, n, k) - fresnel_conductor_exact(n, k, z))), 1e-4f);
    const FresnelF82 metal = fresnel_f82_make({0.9f, 0.6f, 0.2f}, {0.7f, 0.8f, 0.9f});
    EXPECT_LT(max_component(abs(fresnel_film_on_f82(none, z, metal) - fresnel_f82(metal, z))), 2e-3f);
  }
}

TEST(FresnelModels, FilmsOf52NeverReflectMoreThanAll)
{
  for (float z = 0.0f; z <= 1.0f; z += 0.05f) {
    for (const float nm : {0.2f, 100.0f, 5000.0f, 1e8f}) {
      for (const float film : {1e-5f, 0.7f, 1.0f, 1.9f, 40.0f}) {
        const ThinFilm thin{&film_table(), film, nm};
        const FresnelF82 metal = fresnel_f82_make({1.0f, 0.5f, 0.0f}, {0.0f, 1.0f, 0.5f});
        for (const Vec3f F :
             {fresnel_film_on_dielectric(thin, z, 1.5f), fresnel_film_on_dielectric(thin, z, 0.6f),
              fresnel_film_on_conductor(thin, z, {0, 1, 3}, {0, 0, 1e8f}), fresnel_film_on_f82(thin, z, metal)}) {
          EXPECT_TRUE(is_finite(F)) << z << " " << nm << " " << film;
          EXPECT_GE(min_component(F), 0.0f);
          EXPECT_LE(max_component(F), 1.0f);
        }
      }
    }
  }
}

}  // namespace
}  // namespace relief
