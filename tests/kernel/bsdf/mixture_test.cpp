// Mixtures of lobes: samples follow the density of all together, samples and evaluations give one albedo, sharp and soft
// parts are the whole, and the layered Principled BSDF reflects no more than it receives.
#include <cmath>
#include <cstring>

#include <gtest/gtest.h>

#include "kernel/bsdf/mixture_colors.h"
#include "kernel/bsdf/mixture_make.h"
#include "tests/kernel/bsdf/lobe_trio.h"

namespace relief {
namespace {

const BsdfTables& tables()
{
  static const auto made = [] {
    auto t = std::make_unique<BsdfTables>();
    bsdf_tables_make(*t, kFeatureAll | kFeatureMixture);
    return t;
  }();
  return *made;
}

/// A mixture under test. `add` is called once for every wo.
struct MixtureCase {
  std::string name;
  std::function<void(MixtureBuild&)> add;
};

constexpr Vec3f kN{0, 0, 1};

/// World space is the surface's frame here.
Mixture mixture_make(const MixtureCase& one,
                     Vec3f wo,
                     MixtureLobes& lobes,
                     bool front = true,
                     MixtureBuild* built = nullptr)
{
  lobes.size = 0;
  MixtureBuild build{wo, kN, kN, front, &tables(), &lobes};
  one.add(build);
  if (built != nullptr) *built = build;
  return mixture_of(lobes, frame_from_normal(kN), kN);
}

/// A normal that leans by some degrees, Z up as graphs have it.
Vec3f leaning(float x, float y) { return normalize(Vec3f{x, -1.0f, y}); }

SurfaceClosureSpec spec_of(Maths maths, ClosureDistribution distribution = ClosureDistribution::kGgx)
{
  SurfaceClosureSpec spec;
  spec.maths = maths;
  spec.distribution = distribution;
  return spec;
}

SurfaceClosureSpec spec_of_52(ClosureDistribution distribution = ClosureDistribution::kGgx)
{
  return spec_of(Maths::k52, distribution);
}

/// A closure of 5.2.
template <typename Inputs>
MixtureCase case_of_52(const std::string& name, const SurfaceClosureSpec& spec, const Inputs& in)
{
  return {name, [=](MixtureBuild& b) {
            b.maths = Maths::k52;
            closure_add(b, spec, 1.0f, in);
          }};
}

Principled3Inputs random_principled3(TestRandom& r)
{
  Principled3Inputs in;
  in.base_color = {r.next(), r.next(), r.next()};
  in.metallic = r.next() < 0.5f ? 0.0f : r.next();
  in.specular = r.next();
  in.specular_tint = r.next();
  in.roughness = 0.25f + 0.75f * r.next();
  in.anisotropic = 0.6f * r.next();
  in.tangent = {1, 0, 0};
  in.sheen = r.next();
  // No clearcoat, whose samples do not follow its density: see BlenderLobe.ClearcoatFindsLightAsGgxOfItsRoughness.
  in.transmission = r.next() < 0.5f ? 0.0f : r.next();
  in.normal = leaning(0.2f * r.next(), 0.2f * r.next());
  return in;
}

Principled4Inputs random_principled4(TestRandom& r)
{
  Principled4Inputs in;
  in.base_color = {r.next(), r.next(), r.next()};
  in.metallic = r.next() < 0.5f ? 0.0f : r.next();
  in.roughness = 0.25f + 0.75f * r.next();
  in.diffuse_roughness = r.next();
  in.specular_ior_level = r.next();
  in.specular_tint = {r.next(), r.next(), r.next()};
  in.anisotropic = 0.6f * r.next();
  in.tangent = {1, 0, 0};
  in.transmission_weight = r.next() < 0.5f ? 0.0f : r.next();
  in.coat_weight = r.next() < 0.5f ? 0.0f : r.next();
  in.coat_roughness = 0.3f + 0.5f * r.next();
  in.coat_tint = {r.next(), r.next(), r.next()};
  in.sheen_weight = r.next() < 0.5f ? 0.0f : r.next();
  in.sheen_roughness = 0.3f + 0.7f * r.next();
  in.thin_film_thickness = r.next() < 0.7f ? 0.0f : 600.0f * r.next();
  return in;
}

std::vector<MixtureCase> cases()
{
  std::vector<MixtureCase> all;
  all.push_back({"diffuse and gloss", [](MixtureBuild& b) {
                   closure_add(b, spec_of(Maths::k34), 0.7f, DiffuseInputs{{0.8f, 0.2f, 0.1f}, 0.4f, leaning(0.3f, 0)});
                   GlossyInputs glossy;
                   glossy.roughness = 0.5f;
                   closure_add(b, spec_of(Maths::k34), 0.3f, glossy);
                 }});
  all.push_back({"translucent, velvet and toon", [](MixtureBuild& b) {
                   closure_add(b, spec_of(Maths::k34), 0.4f, TranslucentInputs{});
                   closure_add(b, spec_of(Maths::k34), 0.4f, VelvetInputs{});
                   closure_add(b, spec_of(Maths::k34), 0.2f, ToonInputs{{0.5f, 0.5f, 0.5f}, 0.6f, 0.3f, {}});
                 }});
  for (const auto distribution :
       {ClosureDistribution::kGgx, ClosureDistribution::kBeckmann, ClosureDistribution::kMultiscatterGgx}) {
    for (const Maths maths : {Maths::k34, Maths::k43}) {
      const std::string which = std::to_string(static_cast<int>(distribution)) + (maths >= Maths::k43 ? ", 4.3" : ", 3.4");
      all.push_back({"glass " + which, [=](MixtureBuild& b) {
                       GlassInputs glass;
                       glass.roughness = 0.5f;
                       closure_add(b, spec_of(maths, distribution), 1.0f, glass);
                     }});
    }
  }
  TestRandom random(7);
  for (int i = 0; i < 6; ++i) {
    const auto distribution = i % 2 == 0 ? ClosureDistribution::kGgx : ClosureDistribution::kMultiscatterGgx;
    const Principled3Inputs three = random_principled3(random);
    const Principled4Inputs four = random_principled4(random);
    all.push_back({"Principled 3.4, " + std::to_string(i),
                   [=](MixtureBuild& b) { closure_add(b, spec_of(Maths::k34, distribution), 1.0f, three); }});
    all.push_back({"Principled 4.3, " + std::to_string(i),
                   [=](MixtureBuild& b) { closure_add(b, spec_of(Maths::k43, distribution), 1.0f, four); }});
  }
  for (int i = 0; i < 4; ++i) {
    Principled4Inputs in = random_principled4(random);
    in.normal = leaning(0.4f * random.next(), 0.2f);
    in.thin_film_thickness = i % 2 == 0 ? 600.0f * random.next() : 0.0f;
    const auto distribution = i < 2 ? ClosureDistribution::kGgx : ClosureDistribution::kMultiscatterGgx;
    all.push_back(case_of_52("Principled 5.2, " + std::to_string(i), spec_of_52(distribution), in));
  }
  GlassInputs bubble;
  bubble.roughness = 0.5f;
  bubble.ior = 1.1f;
  bubble.thin_film_thickness = 420.0f;
  all.push_back(case_of_52("glass under a film", spec_of_52(), bubble));
  for (const bool is_physical : {false, true}) {
    MetallicInputs metal;
    metal.thin_film_thickness = 400.0f;
    metal.roughness = 0.6f;
    SurfaceClosureSpec spec = spec_of_52();
    if (is_physical) spec.variant = ClosureVariant::kPhysicalMetal;
    all.push_back(case_of_52(is_physical ? "film on a conductor" : "film on a coloured metal", spec, metal));
  }
  return all;
}

/// Density of what a mixture samples: without what microfacets count of directions that they would not sample, which
/// closure_eval says more of. The surface's own normals are kN.
double sampled_pdf(const Mixture& m, Vec3f wi)
{
  double sum = 0;
  mixture_visit(m, [&](const MixtureLobe& lobe) {
    const bool below = to_local(lobe.frame, from_local(m.frame, wi)).z < 0.0f, below_surface = wi.z < 0.0f;
    const Mixture one = mixture_choose(m, [&lobe](const MixtureLobe& other) { return &other == &lobe; });
    const auto density = [&](bool through) {
      if (!mixture_lobe_reaches(lobe, {through, below_surface, below_surface}, true)) return 0.0;
      const float pdf = mixture_eval<TransportMode::kRadiance>(one, tables(), wi, &lobe, through).pdf;
      return static_cast<double>(pdf * lobe.probability * m.scale);
    };
    sum += density(below);
    if (below && lobe.mirrors_below) sum += density(false);
  });
  return sum;
}

/// Blurs a closure's lobes as a path does that meets them.
template <typename Inputs>
void add_blurred(MixtureLobes& lobes, const SurfaceClosureSpec& spec, const Inputs& in, float blur, float most_sharp)
{
  lobes.size = 0;
  MixtureBuild build{normalize(Vec3f{0.5f, 0.2f, 0.8f}), kN, kN, true, &tables(), &lobes};
  build.maths = spec.maths;
  build.blur = blur;
  build.most_sharp = most_sharp;
  closure_add(build, spec, 1.0f, in);
  for (int i = 0; i < lobes.size; ++i) lobe_blur(lobes.lobes[i], blur, most_sharp);
}

/// Light of the same directions by both; their quotient where it is the same everywhere.
void expect_proportional(const MixtureLobes& a, const MixtureLobes& b, float* quotient)
{
  TestRandom random(3);
  *quotient = 0;
  for (int i = 0; i < 200; ++i) {
    const Vec3f wi = normalize(Vec3f{random.next() - 0.5f, random.next() - 0.5f, 2.0f * random.next() - 1.0f});
    const auto eval = [&](const MixtureLobes& lobes) {
      return closure_eval<kFeatureAll>(mixture_of(lobes, frame_from_normal(kN), kN), tables(), wi).f.x;
    };
    const float f_a = eval(a), f_b = eval(b);
    if (f_b < 1e-3f) continue;
    if (*quotient == 0) *quotient = f_a / f_b;
    EXPECT_NEAR(f_a / f_b, *quotient, 1e-3f * *quotient) << i;
  }
  EXPECT_GT(*quotient, 0);
}

TEST(Mixture, BlurredLobesAreThoseOfTheirWidth)
{
  using D = ClosureDistribution;
  constexpr float kBlur = 0.25f, kRoughness = 0.5f;
  const auto check = [&](const SurfaceClosureSpec& spec, auto in, bool keeps_energy) {
    SCOPED_TRACE(std::to_string(static_cast<int>(spec.distribution)) + (spec.maths >= Maths::k43 ? ", 4.3" : ", 3.4"));
    for (const float before : {0.0f, 0.2f}) {
      MixtureLobes blurred, rough;
      in.roughness = before;
      add_blurred(blurred, spec, in, kBlur, -1.0f);
      in.roughness = kRoughness;
      add_blurred(rough, spec, in, 0.0f, -1.0f);
      float quotient;
      expect_proportional(blurred, rough, &quotient);
      // What is given back is that of the width before, from 4.0 on.
      if (keeps_energy) {
        EXPECT_NEAR(quotient, 1.0f, 1e-3f);
      }
    }
  };
  for (const D distribution : {D::kGgx, D::kBeckmann, D::kAshikhminShirley}) {
    check(spec_of(Maths::k34, distribution), GlossyInputs{}, true);
    check(spec_of(Maths::k43, distribution), GlossyInputs{}, true);
  }
  check(spec_of(Maths::k34, D::kMultiscatterGgx), GlossyInputs{}, true);
  check(spec_of(Maths::k43, D::kMultiscatterGgx), GlossyInputs{}, false);
  for (const D distribution : {D::kGgx, D::kBeckmann}) {
    for (const Maths maths : {Maths::k34, Maths::k43}) {
      check(spec_of(maths, distribution), GlassInputs{}, true);
      check(spec_of(maths, distribution), RefractionInputs{}, true);
    }
  }
  check(spec_of(Maths::k34, D::kMultiscatterGgx), GlassInputs{}, true);
}

TEST(Mixture, WhatIsSharpByKindOrForPhotonsIsNotBlurred)
{
  MixtureLobes lobes;
  add_blurred(lobes, spec_of(Maths::k34, ClosureDistribution::kSharp), GlossyInputs{}, 0.4f, -1.0f);
  ASSERT_EQ(lobes.size, 1);
  EXPECT_TRUE(lobes.lobes[0].is_delta);
  GlossyInputs in;
  in.roughness = 0.25f;
  for (const float most_sharp : {0.3f, kInfinity}) {
    add_blurred(lobes, spec_of(Maths::k34), in, 0.4f, most_sharp);
    EXPECT_EQ(lobes.lobes[0].roughness, 0.25f);
    EXPECT_EQ(lobes.lobes[0].shape.ggx.alpha.x, 0.0625f);
  }
  // A wider lobe stays as it is.
  in.roughness = 0.9f;
  add_blurred(lobes, spec_of(Maths::k34), in, 0.4f, -1.0f);
  EXPECT_EQ(lobes.lobes[0].shape.ggx.alpha.x, 0.9f * 0.9f);
}

TEST(Mixture, SamplesFollowTheDensityOfAllLobes)
{
  const auto all = cases();
  // A hundredth for all of them together.
  const double level = 0.01 / static_cast<double>(all.size());
  std::uint64_t number = 0;
  for (const MixtureCase& one : all) {
    ++number;
    const float z = number % 2 == 0 ? 0.25f : 0.8f;
    const bool front = number % 3 != 0;
    MixtureLobes lobes;
    const Mixture m = mixture_make(one, direction(z, 0.7f), lobes, front);
    Chi2Histogram histogram(16, 24);
    TestRandom random(number);
    for (int n = 0; n < 200000; ++n) {
      const float u_branch = random.next(), u = random.next();
      const BsdfSample s = closure_sample<kFeatureAll>(m, tables(), u_branch, {u, random.next()});
      if (s.pdf > 0.0f) {
        histogram.add(s.wi.x, s.wi.y, s.wi.z);
      } else {
        histogram.add_absorbed();
      }
    }
    const Chi2Result result = histogram.test([&](double x, double y, double zz) {
      return sampled_pdf(m, {static_cast<float>(x), static_cast<float>(y), static_cast<float>(zz)});
    });
    EXPECT_TRUE(result.failure.empty()) << one.name << ": " << result.failure;
    EXPECT_GT(result.p_value, level) << one.name << ", cosine " << z << (front ? "" : ", from behind");
  }
}

TEST(Mixture, SamplesAndEvaluationsGiveOneAlbedo)
{
  for (const MixtureCase& one : cases()) {
    MixtureLobes lobes;
    const Mixture m = mixture_make(one, direction(0.6f, 0.3f), lobes);
    constexpr int kSamples = 400000;
    double sampled = 0, sampled2 = 0, uniform = 0, uniform2 = 0;
    TestRandom random(5);
    for (int n = 0; n < kSamples; ++n) {
      const float u_branch = random.next(), u = random.next(), v = random.next();
      const BsdfSample s = closure_sample<kFeatureAll>(m, tables(), u_branch, {u, v});
      const double a = s.pdf > 0.0f ? static_cast<double>(mean_component(s.f) * __builtin_fabsf(s.wi.z) / s.pdf) : 0.0;
      sampled += a;
      sampled2 += a * a;
      const Vec3f wi = warp_sphere({u, v});
      const double b = static_cast<double>(mean_component(closure_eval<kFeatureAll>(m, tables(), wi).f) *
                                           __builtin_fabsf(wi.z) / warp_sphere_pdf());
      uniform += b;
      uniform2 += b * b;
    }
    const auto variance = [](double sum, double sum2) { return (sum2 - sum * sum / kSamples) / kSamples / kSamples; };
    const double sigma = std::sqrt(variance(sampled, sampled2) + variance(uniform, uniform2));
    // 26 cases: four sigma are exceeded by chance once in 700 runs of this test.
    EXPECT_NEAR(sampled / kSamples, uniform / kSamples, 4 * sigma + 1e-4) << one.name;
  }
}

TEST(Mixture, SharpAndSoftPartsAreTheWhole)
{
  TestRandom random(3);
  for (const MixtureCase& one : cases()) {
    MixtureLobes lobes;
    const Mixture m = mixture_make(one, direction(0.5f, 1.0f), lobes);
    const SharpLobes sharp{true, true, 0.4f};
    for (int n = 0; n < 200; ++n) {
      const float u = random.next();
      const Vec3f wi = warp_sphere({u, random.next()});
      const Vec3f all = closure_eval<kFeatureAll>(m, tables(), wi).f;
      const Vec3f parts = closure_eval<kFeatureAll>(closure_sharp(m, sharp), tables(), wi).f +
                          closure_eval<kFeatureAll>(closure_soft(m, sharp), tables(), wi).f;
      EXPECT_NEAR(mean_component(all), mean_component(parts), 1e-5f * (1.0f + mean_component(all))) << one.name;
    }
  }
}

/// A white furnace: light of 1 from everywhere, or from the side that is reflected or let through.
double furnace(const Mixture& m, LobeSides sides = LobeSides::kBoth)
{
  constexpr int kSamples = 100000;
  double sum = 0;
  TestRandom random(11);
  for (int n = 0; n < kSamples; ++n) {
    const float u_branch = random.next(), u = random.next();
    const BsdfSample s = closure_sample<kFeatureAll>(m, tables(), u_branch, {u, random.next()});
    const bool counts = sides == LobeSides::kBoth || (s.wi.z < 0.0f) == (sides == LobeSides::kTransmit);
    if (s.pdf > 0.0f && counts) sum += static_cast<double>(max_component(s.f) * __builtin_fabsf(s.wi.z) / s.pdf);
  }
  return sum / kSamples;
}

// Glass of an index of 1.1 reflects .2 %, its film up to some 15 %: what is reflected is as bright as what is not.
TEST(Mixture, WhatAFilmOnGlassReflectsIsSampledAsOften)
{
  for (const float roughness : {0.0f, 0.3f}) {
    GlassInputs bubble;
    bubble.roughness = roughness;
    bubble.ior = 1.1f;
    bubble.thin_film_thickness = 420.0f;
    bubble.thin_film_ior = 1.4f;
    const MixtureCase one = case_of_52("", spec_of_52(), bubble);
    int num_reflected = 0;
    for (const float z : {0.5f, 1.0f}) {
      MixtureLobes lobes;
      const Mixture m = mixture_make(one, direction(z, 0.2f), lobes);
      TestRandom random(3);
      for (int i = 0; i < 2000; ++i) {
        const float u_branch = random.next(), u = random.next();
        const BsdfSample s = closure_sample<kFeatureAll>(m, tables(), u_branch, {u, random.next()});
        if (!(s.pdf > 0.0f) || s.wi.z < 0.0f) continue;
        ++num_reflected;
        EXPECT_LT(mean_component(s.f) * s.wi.z / s.pdf, 1.3f) << roughness << " " << z;
      }
    }
    EXPECT_GT(num_reflected, 100) << roughness;
  }
}

TEST(Mixture, TheLayeredPrincipledReflectsNoMoreThanItReceives)
{
  TestRandom random(13);
  for (int i = 0; i < 64; ++i) {
    const Principled4Inputs in = random_principled4(random);
    const auto distribution = i % 2 == 0 ? ClosureDistribution::kGgx : ClosureDistribution::kMultiscatterGgx;
    const MixtureCase one{"", [&](MixtureBuild& b) { closure_add(b, spec_of(Maths::k43, distribution), 1.0f, in); }};
    for (const float z : {0.1f, 0.5f, 1.0f}) {
      MixtureLobes lobes;
      const Mixture m = mixture_make(one, direction(z, 0.2f), lobes);
      // Albedos of layers come from tables, as in Cycles: they miss by a hundredth or two. What a film reflects more than
      // its glass is given back twice where facets scatter more than once, also as there.
      const double most = in.thin_film_thickness > 0.0f ? 1.06 : 1.03;
      EXPECT_LT(furnace(m), most) << i << ", cosine " << z << ", film " << in.thin_film_thickness << ", coat "
                                  << in.coat_weight << ", glass " << in.transmission_weight << ", metal "
                                  << in.metallic;
    }
  }
}

TEST(Mixture, ThePrincipledOf52ReflectsNoMoreThanItReceives)
{
  TestRandom random(19);
  for (int i = 0; i < 64; ++i) {
    const auto distribution = i % 2 == 0 ? ClosureDistribution::kGgx : ClosureDistribution::kMultiscatterGgx;
    Principled4Inputs in = random_principled4(random);
    const MixtureCase one = case_of_52("", spec_of_52(distribution), in);
    for (const float z : {0.1f, 0.5f, 1.0f}) {
      MixtureLobes lobes;
      const double most = in.thin_film_thickness > 0.0f ? 1.06 : 1.03;
      EXPECT_LT(furnace(mixture_make(one, direction(z, 0.2f), lobes)), most) << i << ", cosine " << z;
    }
  }
}

TEST(Mixture, RoughCoatsOf52TakeFromBelowWhatTheyReflect)
{
  Principled4Inputs in;
  in.base_color = {1, 1, 1};
  in.specular_ior_level = 0;
  in.coat_weight = 1;
  for (const float roughness : {0.3f, 0.5f, 0.7f}) {
    in.coat_roughness = roughness;
    for (const float z : {0.1f, 0.3f, 0.7f, 1.0f}) {
      MixtureLobes lobes;
      const double now = furnace(mixture_make(case_of_52("", spec_of_52(), in), direction(z, 0.2f), lobes));
      const MixtureCase older{"", [&](MixtureBuild& b) { closure_add(b, spec_of(Maths::k43), 1.0f, in); }};
      const double before = furnace(mixture_make(older, direction(z, 0.2f), lobes));
      EXPECT_NEAR(now, 1.0, 0.015) << roughness << ", cosine " << z;
      EXPECT_LE(std::abs(now - 1), std::abs(before - 1) + 5e-3)
          << roughness << ", cosine " << z << ", before " << before;
    }
  }
}

/// G1 of GGX by what it stands for: visible microfacets cover just what the surface does.
double masking_by_quadrature(double alpha, double cos_i)
{
  constexpr int kSide = 1000;
  const double pi = std::acos(-1.0), sin_i = std::sqrt(1 - cos_i * cos_i);
  double covered = 0;
  for (int i = 0; i < kSide; ++i) {
    // u = 1 − s²: denser where slopes tan θ = α √(u / (1 − u)) are steep.
    const double s = (i + 0.5) / kSide, tangent = alpha * std::sqrt(1 - s * s) / s;
    for (int k = 0; k < kSide; ++k) {
      // Per area of the surface: the facet's own is 1 / cos of it.
      covered += 2 * s * std::max(0.0, cos_i + sin_i * tangent * std::cos(pi * (k + 0.5) / kSide));
    }
  }
  return cos_i * kSide * kSide / covered;
}

TEST(Mixture, ShadowsOfBumpsOf52AreThoseOfMicrofacets)
{
  for (const float lean : {0.3f, 0.8f, 1.3f}) {
    const Vec3f N{std::sin(lean), 0.0f, std::cos(lean)};
    const double alpha = std::sqrt(std::min(1.0, 0.125 * std::pow(std::tan(static_cast<double>(lean)), 2)));
    for (const float cos_i : {0.1f, 0.5f, 0.95f}) {
      const Vec3f across{std::cos(lean), 0.0f, -std::sin(lean)};
      const Vec3f wi = N * cos_i + across * safe_sqrt(1.0f - cos_i * cos_i);
      EXPECT_NEAR(static_cast<double>(bump_shadowing_ggx(N, wi)),
                  masking_by_quadrature(alpha, static_cast<double>(cos_i)), 1e-5)
          << lean << ", " << cos_i;
    }
    EXPECT_EQ(bump_shadowing_ggx(N, cross(N, {0, 1, 0})), 0.0f);
  }
  EXPECT_EQ(bump_shadowing_ggx({0, 0, 1}, direction(0.3f, 1.0f)), 1.0f);
}

TEST(Mixture, ColorsOfEventsAreWhatAFurnaceGives)
{
  // What layers of light are divided by; versions since 4.0 estimate it by tables of 16 nodes an axis, which miss by two hundredths.
  struct Matter {
    const char* name;
    float metallic, transmission, coat;
  };
  for (const Matter& matter : {Matter{"plastic", 0, 0, 0}, {"metal", 1, 0, 0}, {"glass", 0, 1, 0}, {"coat", 0, 0, 1}}) {
    for (const float roughness : {0.3f, 0.7f}) {
      Principled4Inputs in;
      in.base_color = {0.8f, 0.8f, 0.8f};
      in.roughness = in.coat_roughness = roughness;
      in.metallic = matter.metallic, in.transmission_weight = matter.transmission, in.coat_weight = matter.coat;
      for (const float z : {0.15f, 0.4f, 0.9f}) {
        MixtureLobes lobes;
        const Mixture m = mixture_make(case_of_52("", spec_of_52(ClosureDistribution::kMultiscatterGgx), in),
                                       direction(z, 0.2f), lobes);
        const std::string where =
            std::string(matter.name) + ", " + std::to_string(roughness) + ", cosine " + std::to_string(z);
        Vec3f colors[kNumEventKinds] = {};
        mixture_event_colors(m, tables(), colors);
        EXPECT_NEAR(static_cast<double>(colors[0].x), furnace(closure_matte(m)), 0.03) << where;
        const Mixture glossy = mixture_choose(
            m, [](const MixtureLobe& lobe) { return mixture_lobe_event(lobe.kind) != EventKind::kDiffuse; });
        EXPECT_NEAR(static_cast<double>(colors[1].x), furnace(glossy, LobeSides::kReflect), 0.03) << where;
        EXPECT_NEAR(static_cast<double>(colors[2].x), furnace(glossy, LobeSides::kTransmit), 0.03) << where;
      }
    }
  }
}

TEST(Mixture, WhitePrincipledOf43IsClosed)
{
  for (const float roughness : {0.2f, 0.5f, 1.0f}) {
    Principled4Inputs in;
    in.base_color = {1, 1, 1};
    in.roughness = roughness;
    const MixtureCase one{
        "", [&](MixtureBuild& b) { closure_add(b, spec_of(Maths::k43, ClosureDistribution::kMultiscatterGgx), 1.0f, in); }};
    for (const float z : {0.2f, 0.5f, 1.0f}) {
      MixtureLobes lobes;
      EXPECT_NEAR(furnace(mixture_make(one, direction(z, 0.2f), lobes)), 1.0, 0.01) << roughness << ", cosine " << z;
    }
  }
}

/// Mean of rise(cosine to the microfacet) over those that are visible and reflect upwards, by the definition: an integral over all
/// microfacets, in double precision.
template <typename Rise>
double share_by_quadrature(double alpha, double cos_o, const Rise& rise)
{
  constexpr int kSide = 1500;
  const double pi = std::acos(-1.0), sin_o = std::sqrt(1 - cos_o * cos_o);
  const double G1 = 2 / (1 + std::sqrt(1 + alpha * alpha * sin_o * sin_o / (cos_o * cos_o)));
  double sum = 0;
  for (int i = 0; i < kSide; ++i) {
    // Slopes tan θ = α √(u / (1 − u)) follow the distribution times the cosine.
    const double u = (i + 0.5) / kSide, tangent = alpha * std::sqrt(u / (1 - u));
    const double cos_m = 1 / std::sqrt(1 + tangent * tangent), sin_m = tangent * cos_m;
    for (int k = 0; k < kSide; ++k) {
      const double c = sin_o * sin_m * std::cos(pi * (k + 0.5) / kSide) + cos_o * cos_m;
      if (c <= 0 || 2 * c * cos_m <= cos_o) continue;
      sum += G1 * c / (cos_o * cos_m) * rise(c);
    }
  }
  return sum / (double{kSide} * kSide);
}

/// The same as reflected_share.
double reflected_share_by_quadrature(double alpha, double eta, double cos_o)
{
  const double F0 = std::pow((eta - 1) / (eta + 1), 2);
  return share_by_quadrature(alpha, cos_o, [=](double c) {
    const double t = std::sqrt(1 - (1 - c * c) / (eta * eta));
    const double parallel = (eta * c - t) / (eta * c + t), perpendicular = (c - eta * t) / (c + eta * t);
    const double F = 0.5 * (parallel * parallel + perpendicular * perpendicular);
    return (F - F0) / (1 - F0);
  });
}

TEST(Mixture, TheReflectedShareIsItsIntegral)
{
  for (const double roughness : {0.2, 0.5, 0.8, 1.0}) {
    for (const double eta : {1.3, 1.5, 2.0}) {
      for (const double cos_o : {0.2, 0.5, 0.9}) {
        const float share = reflected_share(tables(), static_cast<float>(roughness), static_cast<float>(eta),
                                            static_cast<float>(cos_o));
        // Sixteen nodes an axis, linear between them.
        EXPECT_NEAR(static_cast<double>(share), reflected_share_by_quadrature(roughness * roughness, eta, cos_o), 0.006)
            << roughness << ", " << eta << ", " << cos_o;
      }
    }
  }
}

TEST(Mixture, TheSchlickShareIsItsIntegral)
{
  for (const double roughness : {0.2, 0.5, 0.8, 1.0}) {
    for (const double cos_o : {0.2, 0.5, 0.9}) {
      const float share = schlick_share(tables(), static_cast<float>(roughness), static_cast<float>(cos_o));
      const double truth =
          share_by_quadrature(roughness * roughness, cos_o, [](double c) { return std::pow(1 - c, 5); });
      // As above; this curve bends more.
      EXPECT_NEAR(static_cast<double>(share), truth, 0.01) << roughness << ", " << cos_o;
    }
  }
}

TEST(Mixture, NormalsAreTurnedJustSoFarThatMirrorsReflectUpwards)
{
  TestRandom r(7);
  const auto unit = [&r] { return normalize(Vec3f{r.next() - 0.5f, r.next() - 0.5f, r.next() - 0.5f}); };
  int num_turned = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3f Ng = unit();
    const Vec3f wo = normalize(unit() + Ng);
    const Vec3f N = unit();
    const float height_o = dot(wo, Ng);
    if (!(height_o > 1e-3f && dot(N, Ng) > 0.0f)) continue;
    const float least = std::min(0.9f * height_o, 0.01f);
    const auto height = [&](Vec3f normal) { return 2.0f * dot(normal, wo) * dot(normal, Ng) - height_o; };
    const Vec3f turned = normal_with_reflection_above(Ng, N, wo);
    if (height(N) >= least) {
      EXPECT_EQ(turned, N);
      continue;
    }
    ++num_turned;
    EXPECT_NEAR(length(turned), 1.0f, 1e-5f);
    EXPECT_NEAR(dot(turned, cross(Ng, N)), 0.0f, 1e-5f);
    EXPECT_NEAR(height(turned), least, 1e-4f);
    // No nearer normal would do.
    for (float t = 0.01f; t < 0.99f; t += 0.01f) {
      EXPECT_LT(height(normalize(lerp(t, N, turned))), least + 1e-4f) << t;
    }
  }
  EXPECT_GT(num_turned, 100);
}

/// A mirror whose normal leans, on a facet under a smooth normal that leans as well.
struct BentMirror {
  const char* name;
  Maths maths;
};

// Black patches were on the coarse balls of every version: what the lobe reflected above the facet, and below the smooth
// normal's horizon, was lost.
TEST(Mixture, BentMirrorsLoseNothingAboveTheFacet)
{
  for (const BentMirror version : {BentMirror{"3.4", Maths::k34}, {"4.3", Maths::k43}, {"5.2", Maths::k52}}) {
    TestRandom r(23);
    int num_apart = 0;
    for (int i = 0; i < 2000; ++i) {
      const auto lean = [&r](float by) {
        return normalize(Vec3f{by * (r.next() - 0.5f), by * (r.next() - 0.5f), 1.0f});
      };
      const Vec3f Ns = lean(1.0f), bent = lean(2.0f);
      const Vec3f wo = direction(0.05f + 0.9f * r.next(), 6.0f * r.next());
      MixtureLobes lobes;
      MixtureBuild b{wo, kN, Ns, true, &tables(), &lobes};
      b.maths = version.maths;
      const SurfaceClosureSpec spec = spec_of(version.maths, ClosureDistribution::kSharp);
      GlossyInputs in;
      in.color = {1, 1, 1};
      in.normal = {bent.x, -bent.z, bent.y};  // Z up
      closure_add(b, spec, 1.0f, in);
      const Mixture m = mixture_of(lobes, frame_from_normal(Ns), kN);
      const BsdfSample s = closure_sample<kFeatureAll>(m, tables(), 0.5f, {r.next(), r.next()});
      ASSERT_GT(s.pdf, 0.0f) << version.name << " " << i;
      EXPECT_GT(from_local(m.frame, s.wi).z, 0.0f) << version.name;
      EXPECT_NEAR(s.f.x * __builtin_fabsf(s.wi.z) / s.pdf, 1.0f, 1e-5f) << version.name;
      num_apart += s.wi.z < 0.0f ? 1 : 0;
    }
    EXPECT_GT(num_apart, 20) << version.name;
  }
}

/// Albedo of rough GGX under a bent normal, with what it mirrors to below that normal or without, by a sum over its microfacets:
/// Heitz 2014, Eq. 16 (visible normals), 83 and 84. Nothing of it is the lobe's.
/// @param bent  unit; the facet's normal is +Z
/// @param wo    unit
double bent_ggx_albedo(Vec3f bent, Vec3f wo, double alpha, bool correlated, bool below)
{
  const Frame frame = frame_from_normal(bent);
  const Vec3f o = to_local(frame, wo);
  const auto lambda = [alpha](double z) { return 0.5 * (std::sqrt(1.0 + alpha * alpha * (1.0 / (z * z) - 1.0)) - 1.0); };
  const double lambda_o = lambda(static_cast<double>(o.z));
  constexpr int kSteps = 600;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    const double z = (i + 0.5) / kSteps, sine = std::sqrt(1.0 - z * z);
    const double D = alpha * alpha / (M_PI * std::pow(1.0 + z * z * (alpha * alpha - 1.0), 2.0));
    for (int k = 0; k < kSteps; ++k) {
      const double phi = 2.0 * M_PI * (k + 0.5) / kSteps;
      const double x = sine * std::cos(phi), y = sine * std::sin(phi);
      const double cosine = x * static_cast<double>(o.x) + y * static_cast<double>(o.y) + z * static_cast<double>(o.z);
      if (cosine <= 0.0) continue;
      const double i_z = 2.0 * cosine * z - static_cast<double>(o.z);
      const Vec3f wi = {static_cast<float>(2.0 * cosine * x) - o.x, static_cast<float>(2.0 * cosine * y) - o.y,
                        static_cast<float>(i_z)};
      if (from_local(frame, wi).z <= 0.0f || (i_z <= 0.0 && !below)) continue;
      const double lambda_i = lambda(i_z);
      const double seen = D * cosine / (static_cast<double>(o.z) * (1.0 + lambda_o));
      sum += seen * (correlated ? (1.0 + lambda_o) / (1.0 + lambda_o + lambda_i) : 1.0 / (1.0 + lambda_i));
    }
  }
  return sum * 2.0 * M_PI / kSteps / kSteps;
}

// Before 5.0 microfacets mirror to below the bent normal, too, where that is above the surface. It was lost: 6 % of a metal of
// roughness .8 whose normal leans by 37 degrees.
TEST(Mixture, RoughBentMirrorsReflectBelowTheirNormal)
{
  const Vec3f bent = normalize(Vec3f{0.6f, 0, 0.8f}), wo = normalize(Vec3f{0.2f, 0.5f, 0.7f});
  for (const BentMirror version : {BentMirror{"3.4", Maths::k34}, {"4.3", Maths::k43}, {"5.2", Maths::k52}}) {
    MixtureLobes lobes;
    MixtureBuild b{wo, kN, kN, true, &tables(), &lobes};
    b.maths = version.maths;
    const SurfaceClosureSpec spec = spec_of(version.maths);
    GlossyInputs in;
    in.color = {1, 1, 1};
    in.roughness = 0.8f;
    in.normal = {bent.x, -bent.z, bent.y};  // Z up
    closure_add(b, spec, 1.0f, in);
    const Mixture m = mixture_of(lobes, frame_from_normal(kN), kN);
    TestRandom r(29);
    double sum = 0.0;
    constexpr int kSamples = 400000;
    for (int i = 0; i < kSamples; ++i) {
      const BsdfSample s = closure_sample<kFeatureAll>(m, tables(), 0.5f, {r.next(), r.next()});
      if (s.pdf > 0.0f) sum += static_cast<double>(s.f.x * __builtin_fabsf(s.wi.z) / s.pdf);
    }
    const double all = bent_ggx_albedo(bent, wo, 0.64, version.maths >= Maths::k43, true);
    const double above = bent_ggx_albedo(bent, wo, 0.64, version.maths >= Maths::k43, false);
    EXPECT_GT(all - above, 0.01);
    EXPECT_NEAR(sum / kSamples, version.maths >= Maths::k52 ? above : all, 0.002) << version.name;
  }
}

// Leaves with a normal map before an even world were an eighth too dark: what a lobe sends through the surface itself does not
// fade as diffuse reflection does.
TEST(Mixture, BentTranslucencyDoesNotFade)
{
  const Vec3f bent = normalize(Vec3f{0.6f, 0, 0.8f}), wo = normalize(Vec3f{0.2f, 0.5f, 0.7f});
  MixtureLobes lobes;
  MixtureBuild b{wo, kN, kN, true, &tables(), &lobes};
  TranslucentInputs in;
  in.color = {1, 1, 1};
  in.normal = {bent.x, -bent.z, bent.y};
  closure_add(b, spec_of(Maths::k34), 1.0f, in);
  const Mixture m = mixture_of(lobes, frame_from_normal(kN), kN);
  TestRandom r(31);
  double sum = 0.0;
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const BsdfSample s = closure_sample<kFeatureAll>(m, tables(), 0.5f, {r.next(), r.next()});
    if (s.pdf > 0.0f) sum += static_cast<double>(s.f.x * __builtin_fabsf(s.wi.z) / s.pdf);
  }
  // The share of a cosine lobe below a plane that leans by an angle of cosine .8.
  EXPECT_NEAR(sum / kSamples, 0.9, 0.003);
}

// What Cycles asks of a lamp below the facet or below the smooth normal's horizon, that a rough mirror's own normal sees.
TEST(Mixture, LampsAreSeenByTheNormalsOfEachVersion)
{
  const auto shines = [](Maths maths, Vec3f Ns, Vec3f N, Vec3f wi) {
    const Vec3f wo = normalize(Vec3f{0.1f, 0, 1});
    MixtureLobes lobes;
    MixtureBuild b{wo, kN, Ns, true, &tables(), &lobes};
    b.maths = maths;
    const SurfaceClosureSpec spec = spec_of(maths);
    GlossyInputs in;
    in.roughness = 1.0f;
    in.normal = {N.x, -N.z, N.y};
    closure_add(b, spec, 1.0f, in);
    const Mixture m = mixture_of(lobes, frame_from_normal(Ns), kN);
    return !is_zero(closure_eval<kFeatureAll>(m, tables(), to_local(m.frame, wi)).f);
  };
  const Vec3f leans = normalize(Vec3f{0.5f, 0, 1}), leans_more = normalize(Vec3f{0.6f, 0, 1});
  const Vec3f below_facet = normalize(Vec3f{1, 0, -0.1f}), below_smooth = normalize(Vec3f{-1, 0, 0.1f});
  // A facet and a bump: 4.3 asks the facet, 5.2 the smooth normal, 3.4 neither.
  EXPECT_TRUE(shines(Maths::k34, kN, leans, below_facet));
  EXPECT_FALSE(shines(Maths::k43, kN, leans, below_facet));
  EXPECT_FALSE(shines(Maths::k52, kN, leans, below_facet));
  EXPECT_TRUE(shines(Maths::k52, leans, leans_more, below_facet));
  EXPECT_FALSE(shines(Maths::k43, leans, leans_more, below_facet));
  // Above the facet and below the smooth normal's horizon, where the bump leans back.
  EXPECT_TRUE(shines(Maths::k34, leans, kN, below_smooth));
  EXPECT_TRUE(shines(Maths::k43, leans, kN, below_smooth));
  EXPECT_FALSE(shines(Maths::k52, leans, kN, below_smooth));
}

TEST(Mixture, NegativeRoughnessIsWhatItsSquareIsUpTo36)
{
  const auto roughness_of = [](Maths maths, auto in) {
    in.roughness = -0.5f;
    MixtureLobes lobes;
    MixtureBuild b{direction(0.7f), kN, kN, true, &tables(), &lobes};
    closure_add(b, spec_of(maths), 1.0f, in);
    return lobes.lobes[lobes.size - 1].roughness;
  };
  EXPECT_EQ(roughness_of(Maths::k34, GlossyInputs{}), 0.5f);
  EXPECT_EQ(roughness_of(Maths::k43, GlossyInputs{}), 0.0f);
  EXPECT_EQ(roughness_of(Maths::k34, GlassInputs{}), 0.5f);
  EXPECT_EQ(roughness_of(Maths::k43, GlassInputs{}), 0.0f);
  EXPECT_EQ(roughness_of(Maths::k34, RefractionInputs{}), 0.5f);
  EXPECT_EQ(roughness_of(Maths::k43, RefractionInputs{}), 0.5f);
  Principled3Inputs metal;
  metal.metallic = 1.0f;
  EXPECT_EQ(roughness_of(Maths::k34, metal), 0.5f);
}

TEST(Mixture, NothingWeighsNothing)
{
  MixtureLobes lobes;
  const MixtureCase nothing{"", [](MixtureBuild&) {}};
  const Mixture m = mixture_make(nothing, direction(0.5f, 0), lobes);
  EXPECT_EQ(closure_sample<kFeatureAll>(m, tables(), 0.5f, {0.5f, 0.5f}).pdf, 0.0f);
  EXPECT_EQ(closure_eval<kFeatureAll>(m, tables(), direction(0.5f, 1)).pdf, 0.0f);
  EXPECT_TRUE(lobes_are_delta(lobes));
}

TEST(Mixture, InputsThatAreNoNumbersGiveFiniteLight)
{
  constexpr float kBad[] = {-1.0f, 0.0f, 1e30f, kInfinity, -kInfinity, __builtin_nanf("")};
  TestRandom random(17);
  for (int i = 0; i < 3000; ++i) {
    float numbers[sizeof(Principled4Inputs) / sizeof(float)];
    for (float& x : numbers) {
      x = closure_input(
          random.next() < 0.2f ? kBad[static_cast<int>(5.99f * random.next())] : random.next());
    }
    const MixtureCase one{"", [&](MixtureBuild& b) {
                            Principled4Inputs four;
                            Principled3Inputs three;
                            std::memcpy(&four, numbers, sizeof four);
                            std::memcpy(&three, numbers, sizeof three);
                            if (i % 4 == 0) {
                              b.maths = Maths::k52;
                              closure_add(b, spec_of_52(static_cast<ClosureDistribution>(i % 5)), 1.0f, four);
                            } else if (i % 2 == 0) {
                              closure_add(b, spec_of(Maths::k43, static_cast<ClosureDistribution>(i % 5)), 1.0f, four);
                            } else {
                              closure_add(b, spec_of(Maths::k34, static_cast<ClosureDistribution>(i % 5)), 1.0f, three);
                            }
                          }};
    MixtureLobes lobes;
    const Mixture m = mixture_make(one, direction(0.1f + 0.9f * random.next(), random.next()), lobes, i % 3 != 0);
    const float u = random.next();
    const BsdfSample s = closure_sample<kFeatureAll>(m, tables(), u, {random.next(), random.next()});
    if (s.pdf > 0.0f) {
      EXPECT_TRUE(is_finite(s.f)) << i;
      EXPECT_TRUE(is_finite(s.wi)) << i;
    }
    EXPECT_TRUE(is_finite(closure_eval<kFeatureAll>(m, tables(), direction(0.4f, 2)).f)) << i;
  }
}

}  // namespace
}  // namespace relief
