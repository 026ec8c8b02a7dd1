// The choice among lights: probabilities, densities and the estimator as a whole.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <ctime>
#include <map>
#include <vector>

#include "integrator/light_tree_build.h"
#include "kernel/sample/dimensions.h"
#include "tests/kernel/light/light_estimates.h"

namespace relief {
namespace {

Light random_light(Random& random, double spread, double size)
{
  const LightKind kinds[] = {LightKind::kPoint, LightKind::kSpot, LightKind::kRectangle, LightKind::kDisk,
                             LightKind::kTriangle};
  Light light;
  light.kind = kinds[static_cast<int>(random.next() * 5)];
  light.P = random.in_cube(spread);
  light.axis = random.direction();
  light.emission = splat3(std::exp(random.between(-3, 3)));
  light.two_sided = random.next() < 0.3;
  light.cos_outer = random.between(-0.2, 0.99);
  light.cos_inner = std::min(0.999f, light.cos_outer + random.between(0, 0.5));
  if (light.kind != LightKind::kPoint && light.kind != LightKind::kSpot) {
    light.edge_u = random.direction() * static_cast<float>(size) * random.between(0.1, 1);
    light.edge_v = cross(random.direction(), light.edge_u);
    const Vec3f n = cross(light.edge_u, light.edge_v);
    light.axis = normalize(n);
    light.area = length(n) * (light.kind == LightKind::kRectangle ? 4.0f : light.kind == LightKind::kDisk ? kPi : 0.5f);
    if (!(light.area > 0.0f)) light.axis = {0, 0, 1};
  }
  return light;
}

LightSet random_set(Random& random, int num_lights, double spread, double size)
{
  LightSet set;
  for (int i = 0; i < num_lights; ++i) set.lights.push_back(random_light(random, spread, size));
  light_tree_build(set);
  return set;
}

LightEstimates root_estimates(const LightsView& view, Vec3f P, const LightReceiver& at)
{
  LightEstimates root;
  light_tree_estimate(view.tree, view.tree.root, P, at, root);
  return root;
}

float tree_probability(const LightsView& view, Vec3f P, const LightReceiver& at, std::uint32_t light)
{
  return light_tree_pdf(view.tree, root_estimates(view, P, at), P, at, light, view.light_trails[light], -1);
}

Vec3f random_normal(Random& random) { return random.next() < 0.25 ? Vec3f{} : random.direction(); }

/// Half of those that have a normal are glossy, from nearly mirrors on.
LightReceiver random_receiver(Random& random)
{
  const Vec3f N = random_normal(random);
  if (is_zero(N) || random.next() < 0.5) return N;
  const auto alpha2 = static_cast<float>(std::pow(10.0, random.between(-4, 0)));
  return {N, {random.direction(), random.unit() * kMostGlossShare, max(alpha2, kLeastGlossAlpha2)}};
}

TEST(LightTree, ProbabilitiesSumToOne)
{
  Random random{1};
  for (const int num_lights : {1, 2, 5, 8, 9, 33, 700}) {
    const LightSet set = random_set(random, num_lights, 10, 1);
    const LightsView view = set.view();
    for (int k = 0; k < 50; ++k) {
      const Vec3f P = random.in_cube(k % 2 == 0 ? 10 : 100);
      const LightReceiver at = random_receiver(random);
      double sum = 0;
      for (std::uint32_t i = 0; i < view.num_lights; ++i) sum += static_cast<double>(tree_probability(view, P, at, i));
      // A walk ends without a light where a group's bound may contribute but none of its members does; the lights here
      // face at random and differ in power by a factor of e^6, which is the worst for groups.
      EXPECT_LT(sum, 1 + 1e-4);
      if (is_zero(at.N) && num_lights > 8) {
        EXPECT_GT(sum, 0.1);
      }
      if (num_lights <= 8 && sum > 0) {
        EXPECT_NEAR(sum, 1, 1e-5);
      }
    }
  }
}

/// What a walk comes to, by visiting every node in double precision.
struct Walks {
  std::vector<double> probability;  ///< of each light
  double without_light = 0;         ///< of ending in a node whose children are all estimated to contribute nothing
};

double float_of_half_word(std::uint32_t bits) { return static_cast<double>(std::bit_cast<float>(bits)); }

/// The estimate of one child, from what the block's members and light_tree_estimate are documented to mean.
double scalar_estimate(const LightTreeBlock& block, int i, Vec3f P, const LightReceiver& at)
{
  const Vec3f N = at.N;
  const double d[3] = {static_cast<double>(P.x) - static_cast<double>(block.cx[i]),
                       static_cast<double>(P.y) - static_cast<double>(block.cy[i]),
                       static_cast<double>(P.z) - static_cast<double>(block.cz[i])};
  const double slope[3] = {float_of_half_word(block.slope_xy[i] << 16),
                           float_of_half_word(block.slope_xy[i] & 0xffff0000u),
                           float_of_half_word(block.slope_z_constant[i] << 16)};
  const double constant = float_of_half_word(block.slope_z_constant[i] & 0xffff0000u);
  const double radius = float_of_half_word(block.radii[i] & 0xffff0000u);
  const double emission_radius = float_of_half_word(block.radii[i] << 16);
  const double h = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + radius * radius / 4 + 1e-30);
  double along = (slope[0] * d[0] + slope[1] * d[1] + slope[2] * d[2]) / h;
  if ((block.link[i] & kLightTreeTwoSided) != 0) along = std::abs(along);
  const double profile = constant + along;
  const double least = (block.link[i] & kLightTreeDimSide) != 0 ? 1.0 / 32 : 0.0;
  const double emitted = std::clamp(std::max(profile, 0.3 * (profile + emission_radius / h) + 0.01), least, 1.0);
  const double cosine =
      -(static_cast<double>(N.x) * d[0] + static_cast<double>(N.y) * d[1] + static_cast<double>(N.z) * d[2]) / h;
  const double floor = is_zero(N) ? 1.0 : 0.01;
  double received = std::max({0.0, cosine, 0.3 * (cosine + radius / h) + floor});
  if (const auto share = static_cast<double>(at.gloss.share); share > 0 && received > 0) {
    const Vec3f R = at.gloss.R;
    const double along_R =
        -(static_cast<double>(R.x) * d[0] + static_cast<double>(R.y) * d[1] + static_cast<double>(R.z) * d[2]) / h;
    const double radius2 = radius * radius / (h * h);
    const double a = static_cast<double>(at.gloss.alpha2) + radius2 / 8;
    const double p = a / (std::numbers::pi * std::pow(2 * a + 1 - along_R, 2));
    const double shown = std::numbers::pi * p / (1 + std::pow(share * p * std::numbers::pi * radius2, 2));
    received = (1 - share) * received + share * std::min(shown, 1e6 * received);
  }
  return std::min(static_cast<double>(block.intensity[i]) / (h * h), 1e30) * emitted * received;
}

void walk_everywhere(LightTreeView tree,
                     std::uint32_t link,
                     Vec3f P,
                     const LightReceiver& at,
                     double probability,
                     Walks& walks)
{
  const LightTreeBlock* blocks = tree.blocks + (link & kLightTreeIndexMask);
  const std::uint32_t num_children = kLightTreeLanes * ((link >> kLightTreeBlocksShift) % 4 + 1);
  double sum = 0;
  std::vector<double> estimates;
  for (std::uint32_t i = 0; i < num_children; ++i) {
    estimates.push_back(scalar_estimate(blocks[i / kLightTreeLanes], static_cast<int>(i % kLightTreeLanes), P, at));
    sum += estimates.back();
  }
  if (!(sum > 0)) walks.without_light += probability;
  for (std::uint32_t i = 0; i < num_children && sum > 0; ++i) {
    const std::uint32_t child = blocks[i / kLightTreeLanes].link[i % kLightTreeLanes];
    const double child_probability = probability * estimates[i] / sum;
    if (!(child_probability > 0)) continue;
    if ((child & kLightTreeLeaf) != 0) {
      walks.probability[child & kLightTreeIndexMask] += child_probability;
    } else {
      walk_everywhere(tree, child, P, at, child_probability, walks);
    }
  }
}

TEST(LightTree, ProbabilitiesAreThoseOfScalarEstimatesInDoubleAndSumToOne)
{
  Random random{20};
  for (const int num_lights : {2, 7, 8, 9, 31, 33, 200, 3000}) {
    const LightSet set = random_set(random, num_lights, 10, 1);
    const LightsView view = set.view();
    for (int k = 0; k < 40; ++k) {
      const Vec3f P = random.in_cube(k % 2 == 0 ? 10 : 100);
      const LightReceiver at = random_receiver(random);
      Walks walks{std::vector<double>(view.num_lights, 0.0)};
      walk_everywhere(view.tree, view.tree.root, P, at, 1.0, walks);
      double sum = walks.without_light;
      for (std::uint32_t i = 0; i < view.num_lights; ++i) {
        const double probability = static_cast<double>(tree_probability(view, P, at, i));
        // Where a child is about to count for nothing, what is left of its estimate has few digits.
        ASSERT_NEAR(probability, walks.probability[i], 1e-4 * walks.probability[i] + 1e-6)
            << num_lights << " light " << i;
        sum += probability;
      }
      ASSERT_NEAR(sum, 1, 2e-5) << num_lights;
    }
  }
}

TEST(LightTree, RelativeVarianceAmongAThousandLanternsIsSmall)
{
  // Closed octahedra in a hall. Shadows aside, the variance of a sample is Σ E² / p − (Σ E)², summed without sampling.
  Random random{21};
  LightSet set;
  for (int i = 0; i < 1000; ++i) {
    const Vec3f centre{random.between(-6, 6), random.between(0.3, 8), random.between(-18, 18)};
    const float size = random.between(0.03, 0.08), emission = random.between(2, 12);
    for (int face = 0; face < 8; ++face) {
      const float x = (face & 1) != 0 ? size : -size, y = (face & 2) != 0 ? size : -size,
                  z = (face & 4) != 0 ? size : -size;
      Light light;
      light.kind = LightKind::kTriangle;
      light.P = centre + Vec3f{x, 0, 0};
      light.edge_u = Vec3f{-x, y, 0};
      light.edge_v = Vec3f{-x, 0, z};
      light.axis = normalize(Vec3f{x, y, z});
      light.area = 0.5f * length(cross(light.edge_u, light.edge_v));
      light.emission = splat3(emission);
      set.lights.push_back(light);
    }
  }
  light_tree_build(set);
  const LightsView view = set.view();
  const int points = 60;
  double mean = 0, without_light = 0;
  for (int k = 0; k < points; ++k) {
    const Vec3f P = k % 2 == 0 ? Vec3f{random.between(-6, 6), 0, random.between(-18, 18)}
                               : Vec3f{6, random.between(0, 8), random.between(-18, 18)};
    const Vec3f N = k % 2 == 0 ? Vec3f{0, 1, 0} : Vec3f{-1, 0, 0};
    Walks walks{std::vector<double>(view.num_lights, 0.0)};
    walk_everywhere(view.tree, view.tree.root, P, N, 1.0, walks);
    double irradiance = 0, squares = 0;
    for (std::uint32_t i = 0; i < view.num_lights; ++i) {
      const Light& light = view.lights[i];
      const Vec3f to_light = light.P + (light.edge_u + light.edge_v) * (1.0f / 3.0f) - P;
      const double squared = static_cast<double>(length_squared(to_light));
      const double cosines =
          static_cast<double>(max(0.0f, -dot(to_light, light.axis)) * max(0.0f, dot(to_light, N))) / squared;
      const double value = static_cast<double>(light.emission.x * light.area) * cosines / squared;
      irradiance += value;
      if (value > 0) squares += value * value / walks.probability[i];
    }
    mean += (squares / (irradiance * irradiance) - 1) / points;
    without_light += walks.without_light / points;
  }
  std::printf("relative variance %.3f, walks without a light %.4f\n", mean, without_light);
  EXPECT_LT(mean, 0.5);
  EXPECT_LT(without_light, 0.05);
}

TEST(LightTree, ChoosesWithTheProbabilityItStates)
{
  Random random{2};
  for (const int num_lights : {1, 2, 8, 9, 40, 3000}) {
    const LightSet set = random_set(random, num_lights, 10, 1);
    const LightsView view = set.view();
    for (int k = 0; k < 20; ++k) {
      const Vec3f P = random.in_cube(12);
      const LightReceiver at = random_receiver(random);
      const LightEstimates root = root_estimates(view, P, at);
      for (int i = 0; i < 200; ++i) {
        const LightChoice choice = light_tree_sample(view.tree, root, P, at, random.next());
        if (choice.probability == 0) continue;
        ASSERT_EQ(tree_probability(view, P, at, choice.light_index), choice.probability);
      }
    }
  }
}

TEST(LightTree, FrequenciesAreTheProbabilities)
{
  // χ² over 40 lights with 10^6 choices on a regular lattice in u: counts differ from their share by rounding alone, so the
  // bound is a count, not a significance.
  Random random{3};
  const LightSet set = random_set(random, 40, 10, 1);
  const LightsView view = set.view();
  const Vec3f P{1, 2, 3}, N{};
  const LightEstimates root = root_estimates(view, P, N);
  const int n = 1000000;
  std::vector<int> counts(40, 0);
  for (int i = 0; i < n; ++i) {
    const LightChoice choice = light_tree_sample(view.tree, root, P, N, (i + 0.5) / n);
    if (choice.probability > 0) ++counts[choice.light_index];
  }
  for (std::uint32_t i = 0; i < 40; ++i) {
    EXPECT_NEAR(counts[i], n * static_cast<double>(tree_probability(view, P, N, i)), 3) << i;
  }
}

TEST(LightTree, NeverLeavesOutALightThatContributes)
{
  Random random{4};
  int contributing = 0;
  for (int k = 0; k < 3000; ++k) {
    const double size = std::pow(10.0, random.between(-3, 1.5)), far = std::pow(10.0, random.between(0, 4));
    const LightSet set = random_set(random, 1 + static_cast<int>(random.next() * 30), 5, size);
    const LightsView view = set.view();
    for (int j = 0; j < 10; ++j) {
      Vec3f P = random.in_cube(j % 2 == 0 ? 6 : far);
      Vec3f N = random_normal(random);
      const auto index = static_cast<std::uint32_t>(random.next() * view.num_lights);
      const Light& light = view.lights[index];
      // Half of the points see the light or are seen by it at a grazing angle, or lie close to it.
      if (j % 4 == 1) P = light.P + cross(light.axis, random.direction()) * 3.0f + light.axis * random.between(0, 1e-3);
      if (j % 4 == 2) N = normalize(cross(light.P - P, random.direction()) + random.direction() * 1e-4f);
      if (j % 4 == 3) P = light.P + random.direction() * static_cast<float>(size) * random.between(1e-4, 1);
      LightReceiver at = random_receiver(random);
      at.N = N;
      if (is_zero(N)) at = N;
      for (int i = 0; i < 4; ++i) {
        const LightSample sample = light_sample(light, P, {random.unit(), random.unit()});
        const bool lit = sample.pdf > 0.0f && !is_zero(sample.radiance) && (is_zero(N) || dot(N, sample.wi) > 0.0f);
        if (!lit) continue;
        ++contributing;
        ASSERT_GT(tree_probability(view, P, at, index), 0.0f) << "set " << k << " point " << j;
      }
    }
  }
  EXPECT_GT(contributing, 20000);
}

TEST(LightSampler, DensityOfAHitEqualsTheSamples)
{
  Random random{5};
  int compared = 0;
  for (int k = 0; k < 60; ++k) {
    LightSet set = random_set(random, 1 + k, 10, 1);
    set.lights.push_back({});
    set.lights.back().kind = LightKind::kSun;
    set.lights.back().emission = {0.1f, 0.1f, 0.1f};
    light_tree_build(set);
    set.environment.environment.color = {0.01f, 0.02f, 0.03f};
    set.environment_irradiance.mean = set.environment_irradiance.constant = k % 2 == 0 ? 0.06f : 0.0f;
    // In some of the scenes the environment is left alone where the lights are bright, in some everywhere.
    if (k % 3 == 1) set.environment_yields_to = 0.002f * static_cast<float>(k);
    const LightsView view = set.view();
    for (int i = 0; i < 400; ++i) {
      const Vec3f P = random.in_cube(12);
      const LightReceiver at = random_receiver(random);
      const LightSample sample = lights_sample(view, P, at, {random.next(), random.unit()});
      if (sample.pdf == 0.0f || sample.delta) continue;
      ++compared;
      const float pdf = sample.ref.light_index < 0 ? lights_environment_pdf(view, P, at, sample.wi)
                                                   : lights_pdf(view, P, at, sample.ref, sample.wi, sample.distance);
      ASSERT_NEAR(pdf / sample.pdf, 1.0f, 1e-4f) << k << " light " << sample.ref.light_index;
    }
  }
  EXPECT_GT(compared, 9000);
}

TEST(LightGloss, HasTheHeightAndTheIntegralOfGgxsReflection)
{
  for (const float alpha2 : {1e-4f, 0.01f, 0.25f, 1.0f}) {
    const LightGloss gloss{{0, 0, 1}, 0.5f, alpha2};
    const double a = static_cast<double>(alpha2);
    // D of the normal over four: the density of the mirror direction along the normal.
    EXPECT_NEAR(static_cast<double>(light_gloss_eval(gloss, 0.0f, 0.0f)) * 4 * a, 1, 1e-5);
    // Over x = e^t - e^s, from 0 to 2, by the midpoint rule.
    const double from = std::log(a), to = std::log(a + 2);
    const int n = 20000;
    double sum = 0;
    for (int i = 0; i < n; ++i) {
      const double e = std::exp(from + (to - from) * (i + 0.5) / n);
      sum += 2 * static_cast<double>(light_gloss_eval(gloss, static_cast<float>(e - a), 0.0f)) * e * (to - from) / n;
    }
    // What GGX sends along the normal and stays above it is 1/(1 + a) of all.
    EXPECT_NEAR(sum, 1 / (1 + a), 2e-4);
    // Of what fills the lobe, following the lobe finds most.
    EXPECT_LT(light_gloss_eval(gloss, 0.0f, 1.0f),
              min(1.0f, 4.0f * alpha2 + 0.6f) * light_gloss_eval(gloss, 0.0f, 0.0f));
  }
}

TEST(LightGloss, AsksTheLampThatShines)
{
  LightSet set;
  for (const Vec3f P : {Vec3f{0, 0, 2}, Vec3f{6, 0, 6}}) {
    Light light;
    light.kind = LightKind::kPoint;
    light.P = P;
    light.emission = splat3(P.x == 0.0f ? 10.0f : 1.0f);
    set.lights.push_back(light);
  }
  light_tree_build(set);
  const LightsView view = set.view();
  const Vec3f N{0, 0, 1}, R = normalize(Vec3f{1, 0, 1});
  EXPECT_LT(tree_probability(view, {}, N, 1), 0.01f);
  EXPECT_GT(tree_probability(view, {}, {N, {R, 0.5f, 0.01f}}, 1), 0.1f);
  EXPECT_LT(tree_probability(view, {}, {N, {normalize(Vec3f{-1, 0, 1}), 0.5f, 0.01f}}, 1), 0.01f);
}

TEST(LightSampler, MeanIsTheIrradianceOfAllLights)
{
  // 100000 independent samples a point, |z| < 5 (two-sided significance 6e-7); points keep off the lights so that the
  // variance is finite in practice.
  Random random{6};
  for (const int num_lights : {1, 3, 8, 30, 400}) {
    LightSet set = random_set(random, num_lights, 3, 0.5);
    Light sun;
    sun.kind = LightKind::kSun;
    sun.axis = normalize(Vec3f{1, -2, 3});
    sun.emission = {0.3f, 0.2f, 0.1f};
    set.lights.push_back(sun);
    sun.axis = normalize(Vec3f{-1, -2, 1});
    sun.emission = {0.1f, 0.2f, 0.3f};
    set.lights.push_back(sun);
    light_tree_build(set);
    set.environment.environment.color = {0.2f, 0.2f, 0.2f};
    set.environment_irradiance.mean = set.environment_irradiance.constant = kPi * 0.2f;
    const LightsView view = set.view();
    for (int k = 0; k < 6; ++k) {
      const Vec3f P = random.direction() * 7.0f, N = random.direction();
      // Over the hemisphere a constant environment gives π times its radiance.
      const double truth = irradiance(view, P, N, 4096) + 0.2 * std::numbers::pi;
      const int n = 100000;
      const Moments found = sampler_moments(view, P, N, n);
      EXPECT_LT(std::abs(found.mean - truth), 5 * std::sqrt(found.variance / n) + 1e-4 * truth)
          << num_lights << " lights, truth " << truth << " mean " << found.mean;
    }
  }
}

/// Lamps over a floor, of several sizes and powers.
LightSet hung_lamps(int number)
{
  Random random{21};
  LightSet set;
  for (int i = 0; i < number; ++i) {
    Light light;
    light.kind = LightKind::kRectangle;
    light.P = {random.between(-4, 4), random.between(2, 4), random.between(-4, 4)};
    light.axis = {0, -1, 0};
    light.edge_u = {random.between(0.2, 1), 0, 0};
    light.edge_v = {0, 0, random.between(0.2, 1)};
    light.area = 4 * light.edge_u.x * light.edge_v.z;
    light.emission = splat3(random.between(1, 9) / light.area);
    set.lights.push_back(light);
  }
  light_tree_build(set);
  return set;
}

/// Variance of the irradiance that so many samples of a pixel find, over its square.
double sampled_variance(const LightsView& view, Vec3f P, std::uint32_t samples)
{
  constexpr int kPixels = 500;
  const Vec3f N{0, 1, 0};
  double sum = 0, squares = 0;
  for (int p = 0; p < kPixels; ++p) {
    const std::uint32_t hash = sample_pixel_hash(17, p, 3);
    double mean = 0;
    for (std::uint32_t i = 0; i < samples; ++i) {
      const std::uint32_t index = sample_sequence_index(i, sample_log2_stream(samples));
      const LightSample sample = lights_sample(view, P, N, scatter_samples(hash, index, 0).light);
      if (!(sample.pdf > 0.0f)) continue;
      mean += static_cast<double>(sample.radiance.x * max(0.0f, dot(N, sample.wi)) / sample.pdf) / samples;
    }
    sum += mean / kPixels;
    squares += mean * mean / kPixels;
  }
  return squares / (sum * sum) - 1;
}

TEST(LightSampler, ErrorOfManyLampsFallsAsFastAsThatOfOne)
{
  // Exponents of the number of samples between 64 and 1024. Of smooth integrands that of one lamp is near −3; where lamps
  // meet in the number that chooses them there is an edge, which leaves −2. By a number of its own for the choice: −1.1.
  for (const int number : {1, 2, 4, 16}) {
    LightSet set = hung_lamps(number);
    const Vec3f P{0.5f, 0, 0.3f};
    const double at_64 = sampled_variance(set.view(), P, 64), at_1024 = sampled_variance(set.view(), P, 1024);
    const double fall = std::log2(at_1024 / at_64) / 4;
    std::printf("%d lamps: relative variance %.3g at 64 samples, %.3g at 1024, exponent %.2f\n", number, at_64, at_1024,
                fall);
    EXPECT_LT(fall, number == 1 ? -2.5 : -1.7) << number;
  }
}

TEST(LightSampler, ErrorOfLampsBesideSunsAndSkyFallsFast)
{
  LightSet set = hung_lamps(3);
  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = normalize(Vec3f{1, -2, 1});
  sun.emission = {1, 1, 1};
  sun.cone = 0.01f;
  set.lights.push_back(sun);
  sun.axis = normalize(Vec3f{-1, -2, 1});
  set.lights.push_back(sun);
  light_tree_build(set);
  set.environment.environment.color = {0.2f, 0.2f, 0.2f};
  set.environment_irradiance.mean = set.environment_irradiance.constant = kPi * 0.2f;
  const Vec3f P{0.5f, 0, 0.3f};
  const double at_64 = sampled_variance(set.view(), P, 64), at_1024 = sampled_variance(set.view(), P, 1024);
  EXPECT_LT(std::log2(at_1024 / at_64) / 4, -1.7);
}

TEST(LightSampler, PlaceIsEvenOnWhateverIsChosen)
{
  // χ² of the place in 16 × 16 cells, for every light that is chosen often enough by itself and for all others together:
  // 2 million points, significance 1 % for all tests together (Šidák).
  Random random{22};
  LightSet set = random_set(random, 300, 10, 1);
  Light sun;
  sun.kind = LightKind::kSun;
  sun.emission = {0.2f, 0.2f, 0.2f};
  set.lights.push_back(sun);
  sun.axis = normalize(Vec3f{1, -2, 1});
  set.lights.push_back(sun);
  light_tree_build(set);
  set.environment.environment.color = {0.01f, 0.02f, 0.03f};
  set.environment_irradiance.mean = set.environment_irradiance.constant = 0.06f;
  const LightsView view = set.view();
  constexpr int kSide = 16, kPoints = 2000000;
  constexpr double kOften = 20 * kSide * kSide;
  std::map<std::int32_t, std::array<double, kSide * kSide>> counts;
  for (int i = 0; i < kPoints; ++i) {
    const LightsChoice chosen = lights_choose(view, {1, 2, 3}, {}, {random.next(), random.unit()});
    if (!(chosen.probability > 0.0f)) continue;
    const bool often = static_cast<double>(chosen.probability) * kPoints > kOften;
    const auto cell =
        static_cast<std::size_t>(chosen.u.x * kSide) * kSide + static_cast<std::size_t>(chosen.u.y * kSide);
    ASSERT_LT(cell, static_cast<std::size_t>(kSide * kSide));
    ++counts[often ? chosen.ref.light_index : -2][cell];
  }
  EXPECT_GT(counts.size(), 10u);
  // |z| of all of them together: 1 − 0.99^(1 / tests), two-sided, is beyond 4.3 for up to 400 tests.
  for (const auto& [light, cells] : counts) {
    double total = 0, chi_squared = 0;
    for (const double count : cells) total += count;
    const double expected = total / (kSide * kSide), degrees = kSide * kSide - 1;
    for (const double count : cells) chi_squared += (count - expected) * (count - expected) / expected;
    const double v = 2 / (9 * degrees);
    EXPECT_LT(std::abs(std::cbrt(chi_squared / degrees) - (1 - v)) / std::sqrt(v), 4.3) << "light " << light;
  }
}

TEST(LightSampler, TreeHasFarLessVarianceThanUniformOrPowerAloneAmongAThousandLights)
{
  // Small disks in a flat hall, all facing down, seen from its floor: what light choice is for.
  Random random{7};
  LightSet set;
  for (int i = 0; i < 1000; ++i) {
    Light light;
    light.kind = LightKind::kDisk;
    light.P = {random.between(-50, 50), random.between(2, 4), random.between(-50, 50)};
    light.axis = {0, -1, 0};
    light.edge_u = {0.1f, 0, 0};
    light.edge_v = {0, 0, 0.1f};
    light.area = kPi * 0.01f;
    light.emission = splat3(random.between(1, 100));
    set.lights.push_back(light);
  }
  light_tree_build(set);
  const LightsView view = set.view();
  double power = 0, tree_relative = 0, power_relative = 0, uniform_relative = 0;
  for (const Light& light : set.lights) power += static_cast<double>(light.emission.x);
  const int points = 40;
  for (int k = 0; k < points; ++k) {
    const Vec3f P{random.between(-50, 50), 0, random.between(-50, 50)}, N{0, 1, 0};
    // Contribution of each light, nearly constant over its own samples.
    double truth = 0, by_power = 0, by_uniform = 0;
    for (const Light& light : set.lights) {
      const LightSample sample = light_sample(light, P, {0.5f, 0.5f});
      const double value = static_cast<double>(sample.radiance.x * max(0.0f, dot(N, sample.wi)) / sample.pdf);
      truth += value;
      by_uniform += value * value * 1000;
      by_power += value * value * power / static_cast<double>(light.emission.x);
    }
    const Moments tree = sampler_moments(view, P, N, 20000);
    tree_relative += tree.variance / (truth * truth) / points;
    power_relative += (by_power / (truth * truth) - 1) / points;
    uniform_relative += (by_uniform / (truth * truth) - 1) / points;
  }
  std::printf("relative variance of one sample: tree %.3f, power %.1f, uniform %.1f\n", tree_relative, power_relative,
              uniform_relative);
  EXPECT_LT(10 * tree_relative, power_relative);
  EXPECT_LT(10 * tree_relative, uniform_relative);
}

TEST(LightSampler, NothingToSampleGivesNoSample)
{
  LightSet set;
  light_tree_build(set);
  EXPECT_FALSE(set.any());
  EXPECT_EQ(lights_sample(set.view(), {}, {}, {0.5, 0.5f}).pdf, 0.0f);
  EXPECT_EQ(lights_environment_pdf(set.view(), {}, {}, {0, 0, 1}), 0.0f);
}

TEST(LightSampler, OneLightIsAlwaysChosen)
{
  LightSet set;
  Random random{8};
  set.lights.push_back(random_light(random, 1, 1));
  set.lights[0].kind = LightKind::kPoint;
  light_tree_build(set);
  const LightSample sample = lights_sample(set.view(), {5, 5, 5}, {}, {1 - 0x1p-53, 0.0f});
  EXPECT_EQ(sample.pdf, 1.0f);
  EXPECT_EQ(sample.ref.light_index, 0);
}

TEST(LightSampler, LightsWithoutIntensityAreNeverChosenButKeepTheirPlace)
{
  Random random{9};
  LightSet set = random_set(random, 20, 5, 1);
  for (Light& light : set.lights) light.kind = LightKind::kPoint;
  std::vector<float> scales(20, 1.0f);
  scales[0] = scales[7] = scales[19] = 0.0f;
  set.emission_scales = scales;
  light_tree_build(set);
  const LightsView view = set.view();
  for (const std::uint32_t dark : {0u, 7u, 19u}) EXPECT_EQ(tree_probability(view, {9, 9, 9}, {}, dark), 0.0f);
  EXPECT_GT(tree_probability(view, {9, 9, 9}, {}, 1), 0.0f);
}

TEST(LightSampler, CoincidentAndDegenerateLightsBuildAWorkingTree)
{
  Random random{10};
  LightSet set;
  for (int i = 0; i < 5000; ++i) {
    Light light;
    light.P = {1, 2, 3};
    light.emission = {1, 1, 1};
    if (i % 3 == 0) {
      light.kind = LightKind::kTriangle;  // of no area
      light.edge_u = {1, 0, 0};
      light.edge_v = {2, 0, 0};
    }
    set.lights.push_back(light);
  }
  // Sizes and places over the whole range of floats.
  for (const float scale : {1e-30f, 1e-10f, 1e10f, 1e18f}) {
    Light light;
    light.kind = LightKind::kDisk;
    light.P = {scale, scale, scale};
    light.edge_u = {scale, 0, 0};
    light.edge_v = {0, scale, 0};
    light.axis = {0, 0, 1};
    light.area = kPi * scale * scale;
    light.emission = {1, 1, 1};
    set.lights.push_back(light);
  }
  light_tree_build(set);
  const LightsView view = set.view();
  for (const Vec3f P : {Vec3f{1, 2, 3}, Vec3f{0, 0, 0}, Vec3f{1e18f, 0, 0}, Vec3f{3, 3, 3}}) {
    for (int i = 0; i < 1000; ++i) {
      const LightSample sample = lights_sample(view, P, random_normal(random), {random.next(), random.unit()});
      ASSERT_TRUE(is_finite(sample.pdf) && sample.pdf >= 0.0f);
      if (sample.pdf == 0.0f) continue;
      ASSERT_TRUE(is_finite(sample.radiance) && is_finite(sample.wi));
    }
  }
  EXPECT_NEAR(tree_probability(view, {2, 2, 3}, {}, 1), tree_probability(view, {2, 2, 3}, {}, 2), 1e-3f);
}

TEST(LightSampler, AHundredThousandLights)
{
  Random random{11};
  LightSet set;
  for (int i = 0; i < 100000; ++i) set.lights.push_back(random_light(random, 100, 0.1));
  // Processor time, so that a busy machine does not fail the test.
  const std::clock_t begin = std::clock();
  light_tree_build(set);
  const double build_seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  const LightsView view = set.view();
  const std::clock_t start = std::clock();
  double sum = 0;
  const int n = 200000;
  for (int i = 0; i < n; ++i) {
    const Vec3f P{static_cast<float>(i % 100), 3, 4};
    sum +=
        static_cast<double>(lights_sample(view, P, Vec3f{0, 1, 0},
                                          {static_cast<double>(sample_1d(1, static_cast<std::uint32_t>(i), 0)), 0.4f})
                                .pdf);
  }
  const double sample_seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / n;
  std::printf("build %.3f s, %.0f bytes a light, %.0f ns a sample (%g)\n", build_seconds,
              static_cast<double>(set.bytes()) / 1e5, sample_seconds * 1e9, sum);
  double total = 0;
  for (std::uint32_t i = 0; i < view.num_lights; ++i)
    total += static_cast<double>(tree_probability(view, {1, 2, 3}, {}, i));
  // The rest: walks that end in a group whose members turn out to face away.
  EXPECT_GT(total, 0.7);
  EXPECT_LT(total, 1 + 1e-4);
  EXPECT_LT(build_seconds, 5.0);
}

TEST(LightTree, SameTreeWhateverTheThreads)
{
  // Threads finish in another order every time; three more builds of a tree large enough to be split among them must agree.
  Random random{12};
  LightSet first = random_set(random, 20000, 10, 1);
  for (int k = 0; k < 3; ++k) {
    LightSet again;
    again.lights = first.lights;
    light_tree_build(again);
    ASSERT_EQ(again.light_trails, first.light_trails);
    ASSERT_EQ(again.tree_blocks.size(), first.tree_blocks.size());
    for (std::size_t i = 0; i < first.tree_blocks.size(); ++i) {
      // Without padding, and meant to the last bit. NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
      ASSERT_EQ(std::memcmp(&again.tree_blocks[i], &first.tree_blocks[i], sizeof(LightTreeBlock)), 0);
    }
  }
}

}  // namespace
}  // namespace relief
