// Fibres of facets beside light that is followed in double precision by plain geometry: it meets the real ellipse, and draws
// its facets as Heitz 2018 does. What scatters is compared, and what is sampled, and by which density.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "kernel/bsdf/facet_fibre.h"
#include "kernel/bsdf/mixture_make.h"
#include "tests/kernel/bsdf/bsdf_fixture.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

constexpr double kTau = 6.283185307179586;
constexpr float kEta = 1.55f;

struct Case {
  float alpha, tilt, aspect, turn, sine, sigma, low = -1, high = 1;
};

const Case kCases[] = {
    {0.3f, 0.0f, 1.0f, 0.0f, 0.3f, 0.0f},
    {0.1f, 0.0f, 1.0f, 0.0f, -0.5f, 0.2f},
    {0.3f, 0.1f, 0.7f, 0.5f, 0.3f, 0.5f},
    {0.15f, 0.05f, 0.85f, 1.0f, -0.6f, 0.0f},
    {0.2f, -0.05f, 0.85f, 2.5f, 0.1f, 0.3f, -0.9f, -0.5f},
};

FacetFibre fibre_of(const Case& c)
{
  FacetFibre fibre;
  fibre.alpha = c.alpha;
  fibre.tilt = c.tilt;
  fibre.aspect = c.aspect;
  fibre.turn = c.turn;
  fibre.sigma = splat3(c.sigma);
  fibre.low = c.low;
  fibre.high = c.high;
  for (std::uint16_t& gain : fibre.gains) gain = half_from_float(1.0f);
  return fibre;
}

Vec3f viewer(float sine) { return {sine, 0.0f, std::sqrt(1.0f - sine * sine)}; }

struct V3 {
  double x = 0, y = 0, z = 0;
};
V3 operator*(double s, V3 a) { return {s * a.x, s * a.y, s * a.z}; }
V3 operator+(V3 a, V3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
V3 operator-(V3 a, V3 b) { return a + -1.0 * b; }
double inner(V3 a, V3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V3 outer(V3 a, V3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
V3 unit(V3 a) { return 1.0 / std::sqrt(inner(a, a)) * a; }

/// Directions by 8 angles around the fibre and two tilts.
struct Bins {
  static constexpr int kCount = 16;
  std::array<double, kCount> sum{}, squares{};

  static int of(double x, double y, double z, double sine)
  {
    const double turn = std::atan2(-y, z) / kTau + 0.5;
    return std::min(7, static_cast<int>(8.0 * turn)) + (x > -sine ? 8 : 0);
  }
  void add(int bin, double value)
  {
    sum[static_cast<std::size_t>(bin)] += value;
    squares[static_cast<std::size_t>(bin)] += value * value;
  }
};

void expect_same(const Bins& a, double n_a, const Bins& b, double n_b, const std::string& name)
{
  for (std::size_t i = 0; i < Bins::kCount; ++i) {
    const double mean_a = a.sum[i] / n_a, mean_b = b.sum[i] / n_b;
    const double variance = (a.squares[i] / n_a - mean_a * mean_a) / n_a + (b.squares[i] / n_b - mean_b * mean_b) / n_b;
    // 80 and as many more comparisons; what is left over is rounding of tables.
    EXPECT_NEAR(mean_a, mean_b, 4.5 * std::sqrt(variance) + 2e-3 * mean_b + 1e-5) << name << ", bin " << i;
  }
}

/// Light in a fibre of glass, on its way.
class Walk {
 public:
  Walk(const Case& c, std::uint64_t seed) : c_(c), random_(seed) {}

  /// Follows one ray; what leaves by R, TT or TRT goes to the bins.
  void follow(Bins& bins)
  {
    const double cos_o = std::sqrt(1.0 - double{c_.sine} * c_.sine), s = std::sin(c_.turn), k = std::cos(c_.turn);
    const V3 wo{c_.sine, -cos_o * s, cos_o * k};
    enter_outline(c_.low + (c_.high - c_.low) * random_.next(), s, k);
    V3 m = normal(c_.tilt), macro = normal(0);
    const double cos_m = inner(wo, m);
    if (!(cos_m > 0.0 && inner(wo, macro) > 0.0)) return;
    V3 facet = facet_seen(m, wo);
    double F = reflectance(inner(wo, facet), kEta), share = energy(false, cos_m);
    const V3 mirrored = 2.0 * inner(wo, facet) * facet - wo;
    if (inner(mirrored, m) > 0.0 && inner(mirrored, macro) > 0.0)
      put(bins, mirrored, share * F * seen(cos_m, inner(mirrored, m)));
    V3 w = refracted_ray(wo, facet, kEta);
    if (!(inner(w, m) < 0.0 && inner(w, macro) < 0.0)) return;
    share *= (1.0 - F) * seen(cos_m, -inner(w, m));
    for (int boundary = 0; boundary < 2; ++boundary) {
      share *= cross_over(w);
      m = -1.0 * normal(c_.tilt);
      macro = -1.0 * normal(0);
      const V3 back = -1.0 * w;
      const double cos_in = inner(back, m);
      if (!(cos_in > 0.0)) return;
      facet = facet_seen(m, back);
      F = reflectance(inner(back, facet), 1.0 / kEta);
      share *= energy(true, cos_in);
      if (F < 1.0 && inner(back, macro) > 0.0) {
        const V3 out = refracted_ray(back, facet, 1.0 / kEta);
        if (inner(out, m) < 0.0 && inner(out, macro) < 0.0)
          put(bins, out, share * (1.0 - F) * seen(cos_in, -inner(out, m)));
      }
      w = w + 2.0 * inner(back, facet) * facet;
      if (!(inner(w, m) > 0.0 && inner(w, macro) > 0.0)) return;
      share *= F * seen(cos_in, inner(w, m));
    }
  }

 private:
  void enter_outline(double across, double s, double k)
  {
    // The line at a distance from the middle, across the ray, meets the ellipse first on the viewer's side.
    const double b2 = double{c_.aspect} * c_.aspect;
    const double offset = -across * std::sqrt(k * k + b2 * s * s);
    const double px = offset * k, pz = -offset * s;
    const double A = s * s + k * k / b2, B = px * s + pz * k / b2, C = px * px + pz * pz / b2 - 1.0;
    const double t = (-B + std::sqrt(std::max(0.0, B * B - A * C))) / A;
    X_ = px + t * s;
    Z_ = pz + t * k;
  }
  V3 normal(double tilt) const
  {
    const V3 n = unit({X_, Z_ / (double{c_.aspect} * c_.aspect), 0});
    return {std::sin(tilt), -std::cos(tilt) * n.x, std::cos(tilt) * n.y};
  }
  /// @return  what pigment leaves
  double cross_over(V3 w)
  {
    const double b2 = double{c_.aspect} * c_.aspect, dx = -w.y, dz = w.z;
    const double t = -2.0 * (X_ * dx + Z_ * dz / b2) / (dx * dx + dz * dz / b2);
    X_ += t * dx;
    Z_ += t * dz;
    return std::exp(-c_.sigma * t);
  }
  V3 facet_seen(V3 m, V3 w)
  {
    const V3 s = unit(outer(std::abs(m.x) < 0.9 ? V3{1, 0, 0} : V3{0, 1, 0}, m)), t = outer(m, s);
    const double a = c_.alpha;
    const V3 h = unit({a * inner(w, s), a * inner(w, t), inner(w, m)});
    const double across = h.x * h.x + h.y * h.y;
    const V3 T1 = across > 0.0 ? 1.0 / std::sqrt(across) * V3{-h.y, h.x, 0} : V3{1, 0, 0}, T2 = outer(h, T1);
    const double r = std::sqrt(random_.next()), phi = kTau * random_.next(), half = 0.5 * (1.0 + h.z);
    const double t1 = r * std::cos(phi), t2 = (1.0 - half) * std::sqrt(1.0 - t1 * t1) + half * r * std::sin(phi);
    const V3 n = t1 * T1 + t2 * T2 + std::sqrt(std::max(0.0, 1.0 - t1 * t1 - t2 * t2)) * h;
    const V3 facet = unit({a * n.x, a * n.y, std::max(0.0, n.z)});
    return facet.x * s + facet.y * t + facet.z * m;
  }
  double seen(double cos_one, double cos_other) const
  {
    const auto lambda = [this](double c) {
      return 0.5 * (std::sqrt(1.0 + double{c_.alpha} * c_.alpha * (1.0 / (c * c) - 1.0)) - 1.0);
    };
    return (1.0 + lambda(cos_one)) / (1.0 + lambda(cos_one) + lambda(cos_other));
  }
  double energy(bool inside, double cosine) const
  {
    const GlassCoordinate g = glass_coordinate(inside ? 1.0f / kEta : kEta, std::sqrt(c_.alpha));
    return 1.0 / (1.0 - double{glass_lost(full_tables(), g, g.side, static_cast<float>(cosine))});
  }
  static double reflectance(double c, double eta)
  {
    const double g2 = eta * eta - 1.0 + c * c;
    if (!(g2 > 0.0)) return 1.0;
    const double g = std::sqrt(g2), A = (g - c) / (g + c), B = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    return 0.5 * A * A * (1.0 + B * B);
  }
  static V3 refracted_ray(V3 w, V3 facet, double eta)
  {
    const double c = inner(w, facet);
    return (c / eta - std::sqrt(std::max(0.0, 1.0 - (1.0 - c * c) / (eta * eta)))) * facet - 1.0 / eta * w;
  }
  void put(Bins& bins, V3 w, double share) const
  {
    const double s = std::sin(-c_.turn), k = std::cos(-c_.turn);
    bins.add(Bins::of(w.x, w.y * k - w.z * s, w.z * k + w.y * s, c_.sine), share);
  }

  Case c_;
  TestRandom random_;
  double X_ = 0, Z_ = 0;
};

/// ∫ f · cos by cells of the sphere, a point in each.
template <typename F>
Bins integrate(const Case& c, int size, std::uint64_t seed, const F& f)
{
  TestRandom random(seed);
  Bins bins;
  for (int i = 0; i < size * size; ++i) {
    const Vec2f u{(static_cast<float>(i % size) + random.next()) / static_cast<float>(size),
                  (static_cast<float>(i / size) + random.next()) / static_cast<float>(size)};
    const Vec3f wi = warp_sphere(u);
    bins.add(Bins::of(wi.x, wi.y, wi.z, c.sine), double{f(wi)} * 2.0 * kTau);
  }
  return bins;
}

// Significance: 4.5 standard errors a bin, of 80.
TEST(FacetFibre, ScattersAsLightThatIsFollowed)
{
  constexpr int kRays = 100000, kSize = 250;
  for (const Case& c : kCases) {
    Bins walked;
    Walk walk(c, 1);
    for (int i = 0; i < kRays; ++i) walk.follow(walked);
    // The rest of the light is a distribution of its own, and told apart by gains that are almost 0.
    FacetFibre rest = fibre_of(c);
    rest.gains[0] = rest.gains[1] = 0;
    rest.gains[2] = 1;
    const FacetFibre fibre = fibre_of(c);
    const Vec3f wo = viewer(c.sine);
    const Bins f = integrate(c, kSize, 2, [&](Vec3f wi) {
      return (facet_fibre_f(fibre, kEta, full_tables(), wo, wi) - facet_fibre_f(rest, kEta, full_tables(), wo, wi)).x;
    });
    expect_same(f, kSize * kSize, walked, kRays,
                "alpha " + std::to_string(c.alpha) + ", aspect " + std::to_string(c.aspect));
  }
}

// Likewise.
TEST(FacetFibre, SamplesStandForWhatIsScattered)
{
  constexpr int kSamples = 100000, kSize = 250;
  for (const Case& c : kCases) {
    const FacetFibre fibre = fibre_of(c);
    const Vec3f wo = viewer(c.sine);
    Bins sampled;
    TestRandom random(3);
    for (int i = 0; i < kSamples; ++i) {
      const float u_lobe = random.next(), u = random.next();
      const FacetFibreSample s = facet_fibre_sample(fibre, kEta, full_tables(), wo, u_lobe, {u, random.next()});
      if (!(s.weight.x > 0.0f)) continue;
      EXPECT_NEAR(length(s.wi), 1.0f, 1e-4f);
      sampled.add(Bins::of(s.wi.x, s.wi.y, s.wi.z, c.sine), double{s.weight.x});
    }
    const Bins f =
        integrate(c, kSize, 4, [&](Vec3f wi) { return facet_fibre_f(fibre, kEta, full_tables(), wo, wi).x; });
    expect_same(f, kSize * kSize, sampled, kSamples,
                "alpha " + std::to_string(c.alpha) + ", aspect " + std::to_string(c.aspect));
  }
}

// Samples of a mixture in which one lobe is followed and the others are asked.
TEST(FacetFibre, SamplesOfAMixtureStandForAllOfIt)
{
  constexpr int kSamples = 100000, kSize = 250;
  const Case c{0.3f, 0.0f, 1.0f, 0.0f, 0.3f, 0.0f};
  const Vec3f N{0, 0, 1};
  MixtureLobes lobes;
  MixtureBuild build{viewer(c.sine), N, N, true, &full_tables(), &lobes};
  build.tangent = {1, 0, 0};
  SurfaceClosureSpec spec;
  FacetFibreInputs facets;
  facets.color = {0.9f, 0.5f, 0.2f};
  closure_add(build, spec, 0.4f, facets);
  FibreInputs plain;
  plain.color = {0.2f, 0.5f, 0.9f};
  closure_add(build, spec, 0.3f, plain);
  closure_add(build, spec, 0.3f, DiffuseInputs{});
  ASSERT_EQ(lobes.size, 3);
  const Mixture mixture = mixture_of(lobes, frame_from_normal(N), N);
  Bins sampled;
  TestRandom random(6);
  for (int i = 0; i < kSamples; ++i) {
    const float u_branch = random.next(), u = random.next();
    const BsdfSample s = closure_sample<kFeatureAll>(mixture, full_tables(), u_branch, {u, random.next()});
    if (!(s.pdf > 0.0f)) continue;
    const Vec3f wi = from_local(mixture.frame, s.wi);
    sampled.add(Bins::of(wi.x, wi.y, wi.z, c.sine), double{s.f.x * std::abs(s.wi.z) / s.pdf});
  }
  const Bins f = integrate(c, kSize, 7, [&](Vec3f wi) {
    const Vec3f local = to_local(mixture.frame, wi);
    return closure_eval<kFeatureAll>(mixture, full_tables(), local).f.x * std::abs(local.z);
  });
  expect_same(f, kSize * kSize, sampled, kSamples, "mixture");
}

TEST(FacetFibre, AClearFibreLosesAlmostNothing)
{
  for (const float alpha : {0.05f, 0.2f, 0.5f, 1.0f}) {
    for (const float sine : {0.0f, 0.4f, -0.8f}) {
      for (const float aspect : {1.0f, 0.6f}) {
        const FacetFibre fibre = fibre_of({alpha, 0.0f, aspect, 0.7f, sine, 0.0f});
        TestRandom random(5);
        double sum = 0, largest = 0;
        constexpr int kSamples = 80000;
        for (int i = 0; i < kSamples; ++i) {
          const float u_lobe = random.next(), u = random.next();
          const FacetFibreSample s =
              facet_fibre_sample(fibre, kEta, full_tables(), viewer(sine), u_lobe, {u, random.next()});
          sum += double{s.weight.x};
          largest = std::max(largest, double{s.weight.x});
        }
        // What is masked among facets is given back by tables of flat surfaces: at a roughness of 1 that is 1.1 % too much.
        // Noise is .3 % there.
        EXPECT_NEAR(sum / kSamples, 1.0, 0.02) << alpha << ' ' << sine << ' ' << aspect;
        EXPECT_LT(largest, 8.0);
      }
    }
  }
}

TEST(FacetFibre, ItsDensityIsOneInAll)
{
  constexpr int kTilts = 300, kAngles = 300;
  for (const Case& c : kCases) {
    const FacetFibre fibre = fibre_of(c);
    double sum = 0;
    for (int i = 0; i < kTilts; ++i) {
      // Tilts evenly in their angle: the density of tilts is that of angles.
      const float tilt = kPi * ((static_cast<float>(i) + 0.5f) / kTilts - 0.5f);
      for (int j = 0; j < kAngles; ++j) {
        const float angle = 2.0f * kPi * (static_cast<float>(j) + 0.5f) / kAngles;
        sum +=
            double{facet_fibre_pdf(fibre, kEta, viewer(c.sine), fibre_direction(tilt, angle))} * std::cos(double{tilt});
      }
    }
    EXPECT_NEAR(sum * 0.5 * kTau * kTau / (kTilts * kAngles), 1.0, 2e-3) << c.alpha << ' ' << c.aspect;
  }
}

// Of a fibre without a tilt; but for what is given back of light that was masked, which follows from one side alone.
TEST(FacetFibre, IsTheSameBothWays)
{
  const auto mean = [](const FacetFibre& fibre, Vec3f wo, Vec3f wi) {
    FacetFibre other = fibre;
    double sum = 0;
    constexpr int kTimes = 2000;
    for (int i = 0; i < kTimes; ++i) {
      other.seed = static_cast<std::uint16_t>(i);
      sum += double{facet_fibre_f(other, kEta, full_tables(), wo, wi).x};
    }
    return sum / kTimes;
  };
  for (const float angle : {0.3f, 1.2f, 2.4f, 3.0f}) {
    for (const float sigma : {0.0f, 0.5f}) {
      const FacetFibre fibre = fibre_of({0.15f, 0.0f, 1.0f, 0.0f, 0.0f, sigma});
      const float from = 0.5f, to = -0.35f;
      // Over the cosine between the fibre and where light comes from.
      const double there = mean(fibre, fibre_direction(from, 0.0f), fibre_direction(to, angle)) / std::cos(double{to});
      const double back =
          mean(fibre, fibre_direction(to, 0.0f), fibre_direction(from, -angle)) / std::cos(double{from});
      EXPECT_NEAR(there, back, 0.04 * back) << angle << ' ' << sigma;
    }
  }
}

}  // namespace
}  // namespace relief
