// Eight surfaces whose lobes are columns scatter as each does by the list of its lobes.
#include "kernel/stage/shade_surfaces.h"

#include "tests/kernel/bsdf/lobe_trio.h"
#include "tests/kernel/bsdf/principled_program.h"

namespace relief {
namespace {

constexpr unsigned kFeatures = kFeatureMixture | kFeatureGraphs;

/// How far numbers may differ.
struct Tolerance {
  float relative = 1e-5f, absolute = 1e-6f;
};

void expect_close(float a, float b, const char* what, Tolerance tolerance = {})
{
  EXPECT_LE(std::fabs(a - b), tolerance.relative * std::fabs(b) + tolerance.absolute) << what << ' ' << a << ' ' << b;
}

void expect_close(Vec3f a, Vec3f b, const char* what, Tolerance tolerance = {})
{
  expect_close(a.x, b.x, what, tolerance);
  expect_close(a.y, b.y, what, tolerance);
  expect_close(a.z, b.z, what, tolerance);
}

/// Eight hits of a program, as columns and each as a list of lobes.
class EightHits : public PrincipledProgram {
 protected:
  struct Each {
    Vec3f wo, Ng, Ns, to_lamp;
    Vec2f u;
    float branch = 0.5f;
    bool is_front = true;
    Vec3f to_photon;
    float most_sharp = -1;  ///< up to which roughness lobes are sharp
    float blur = 0, passing = 0;
    bool is_first = false;
  };

  /// Unit, anywhere above a normal; now and then at its horizon.
  Vec3f above(Vec3f N)
  {
    const Vec3f local = direction();
    const float z = random_.next() < 0.1f ? 1e-4f : local.z;
    return normalize(from_local(frame_from_normal(N), Vec3f{local.x, local.y, z}));
  }

  Vec3f anywhere()
  {
    return normalize(Vec3f{random_.next(), random_.next(), random_.next()} - Vec3f{0.5f, 0.5f, 0.5f});
  }

  Each thrown_hit(bool is_smooth)
  {
    Each hit;
    hit.Ng = anywhere();
    hit.wo = above(hit.Ng);
    hit.Ns = is_smooth ? above(hit.Ng) : hit.Ng;
    hit.to_lamp = anywhere();
    hit.u = {random_.next(), random_.next()};
    hit.branch = side_random_.next();
    hit.is_front = side_random_.next() < 0.5f;
    const auto centred = [&] { return side_random_.next() - 0.5f; };
    hit.to_photon = normalize(Vec3f{centred(), centred(), centred()});
    hit.most_sharp = side_random_.next() < 0.3f ? kInfinity : side_random_.next();
    if (random_.next() < 0.05f) hit.u.x = random_.next() < 0.5f ? 0.0f : 1.0f - 1e-5f;
    if (random_.next() < 0.3f) hit.blur = 0.5f * random_.next();
    hit.is_first = random_.next() < 0.5f;
    if (random_.next() < 0.3f) hit.passing = random_.next();
    return hit;
  }

  /// What stages do with eight hits up to where they ask.
  void make(const GraphProgramView& view, const Each (&each)[8])
  {
    MixtureBuildLanes b{};
    b.tables = &closure_tables();
    F8 blur{};
    for (int k = 0; k < 8; ++k) {
      lane_set(b.wo, k, each[k].wo);
      lane_set(b.Ng, k, each[k].Ng);
      lane_set(b.Ns, k, each[k].Ns);
      blur[k] = each[k].blur;
      store_lane(hits_.to[0], k, each[k].to_lamp);
      hits_.u[0][k] = each[k].u.x;
      hits_.u[1][k] = each[k].u.y;
      hits_.u[2][k] = each[k].branch;
    }
    closures_resolve_columns(view, 1, registers_, b, hits_.lobes);
    hit_columns_begin(b, frame_from_normal(shading_normal_towards(b.Ns, b.wo)), blur, splat8(-1.0f), hits_);
    for (int k = 0; k < 8; ++k) {
      HitLane lane{&hits_, k};
      sums_[k] = lobes_sum(lane);
      if (each[k].is_first) lobes_defend(lane, each[k].passing);
    }
    hit_columns_ask<HitTowards::kLamp>(hits_);
    hit_columns_sample<false>(hits_);
  }

  MixtureLobes& make(const GraphProgramView& view, const Each& hit, int lane)
  {
    lobes_.size = 0;
    MixtureBuild build{hit.wo, hit.Ng, hit.Ns, true, &closure_tables(), &lobes_};
    build.blur = hit.blur;
    closures_resolve({&view, &registers_, lane}, build);
    if (hit.blur > 0.0f) lobes_blur(lobes_, hit.blur, -1.0f);
    const LobesSum sum = lobes_sum(lobes_);
    expect_close(sums_[lane].probability, sum.probability, "probability");
    expect_close(sums_[lane].sharp, sum.sharp, "sharp");
    expect_close(sums_[lane].weight, sum.weight, "weight");
    if (hit.is_first) lobes_defend(lobes_, hit.passing);
    return lobes_;
  }

  /// Compares columns with a hit's list.
  void compare(const Each& hit, int k, const MixtureLobes& lobes);

  /// Compares the sharp part of columns, and the soft one, with those of a hit's list.
  void compare_parts(const Each& hit, int k, const MixtureLobes& lobes);

  /// How often what was compared.
  struct {
    int num_lit = 0, num_diffuse = 0, num_mirrored = 0, num_glossy = 0, num_absorbed = 0, num_delta = 0,
        num_through = 0, num_passed = 0, num_sharp = 0, num_soft = 0;
  } compared;
  TestRandom side_random_{11};  ///< of what not all tests look at
  HitColumns hits_{};
  LobesSum sums_[8];
  MixtureLobes lobes_;
};

/// Whether a lobe lets light through.
bool goes_through(const MixtureLobe& lobe) { return mixture_traits(lobe.kind).sides != LobeSides::kReflect; }

/// As slope_of, of f · cos by microfacets of other kinds than reflection by GGX.
float facet_slope_of(const MixtureLobe& lobe, Vec3f wi)
{
  const bool refracts = goes_through(lobe) && wi.z < 0.0f, is_glass = lobe.kind == MixtureLobeKind::kGlass;
  const bool is_reflection = lobe.kind == MixtureLobeKind::kBeckmann;
  const bool is_beckmann =
      is_reflection || (is_glass ? lobe.shape.glass.is_beckmann : lobe.shape.refraction.is_beckmann);
  const AnisotropicAlpha alpha = is_reflection ? lobe.shape.beckmann.alpha
                                 : is_glass
                                     ? AnisotropicAlpha{lobe.shape.glass.alpha, lobe.shape.glass.alpha}
                                     : AnisotropicAlpha{lobe.shape.refraction.alpha, lobe.shape.refraction.alpha};
  const float eta = is_glass ? lobe.fresnel.eta : is_reflection ? 1.0f : lobe.shape.refraction.eta;
  const Vec3f h = lobe.wo + (refracts ? eta : 1.0f) * wi;
  // What half vectors are wrong by, relative to their length, and in widths of the lobe.
  const float rounding = (1.0f + (refracts ? eta : 1.0f)) / length(h);
  float slope = 1.0f / std::fabs(wi.z) + rounding / min(alpha.x, alpha.y);
  if (is_beckmann) {
    const float z = std::fabs(h.z) / length(h), steep = std::hypot(h.x / alpha.x, h.y / alpha.y) / std::fabs(h.z);
    slope += rounding / z * (1.0f + 2.0f * steep * steep + 2.0f * steep / min(alpha.x, alpha.y));
  }
  const float cos_o = std::fabs(dot(lobe.wo, h)) / length(h), cos_i = std::fabs(dot(wi, h)) / length(h);
  if (refracts) slope += rounding * (1.0f / cos_o + 1.0f / cos_i);
  if (is_glass || lobe.fresnel.kind == MixtureFresnel::kInterpolated) {
    const float cos_d = refracts ? cos_o : half_angle_cosine(lobe.wo, wi);
    const float index = lobe.fresnel.eta, root = std::sqrt(std::fabs(sqr(index) - 1.0f + sqr(cos_d)));
    slope += (refracts ? rounding / min(root, cos_d) : 1.0f / std::fabs(cos_d - root)) / root;
    if (index < 1.0f) slope += 1.0f / (index * root);
  }
  return slope;
}

/// How far f · cos of a lobe changes, relative, if a direction changes by one: most of all at the horizon.
/// @param wi  the lobe's frame
float slope_of(const MixtureLobe& lobe, Vec3f wi)
{
  const float horizon = 1.0f / std::fabs(wi.z);
  if (lobe.kind == MixtureLobeKind::kMicrofibre) {
    // It goes with the fourth power of the length of a direction that A and B stretch.
    const SheenMicrofibre& fibres = lobe.shape.microfibre;
    const float across = std::hypot(lobe.wo.x, lobe.wo.y);
    const float along = (lobe.wo.x * wi.x + lobe.wo.y * wi.y) / across;
    const float aside = (lobe.wo.x * wi.y - lobe.wo.y * wi.x) / across;
    const float stretched = std::hypot(fibres.A * along + fibres.B * wi.z, fibres.A * aside, wi.z);
    return horizon + (1.0f + std::fabs(fibres.A) + std::fabs(fibres.B)) / stretched;
  }
  if (mixture_lobe_is_diffuse(lobe)) return horizon;
  if (goes_through(lobe) || lobe.kind == MixtureLobeKind::kBeckmann) return facet_slope_of(lobe, wi);
  // The slope of a half vector has the rounding of directions over its length, and is asked for in widths of the lobe.
  const bool is_ggx = lobe.kind == MixtureLobeKind::kGgx;
  const float width = is_ggx ? min(lobe.shape.ggx.alpha.x, lobe.shape.ggx.alpha.y) : lobe.shape.clearcoat.alpha;
  const float facets = horizon + 1.0f / (width * length(lobe.wo + wi));
  const float eta = lobe.fresnel.eta, cos_d = half_angle_cosine(lobe.wo, wi);
  // Towards the critical angle a reflectance rises as a root falls, and a small one is a difference.
  const float root = std::sqrt(std::fabs(sqr(eta) - 1.0f + sqr(cos_d)));
  if (lobe.fresnel.kind == MixtureFresnel::kDielectric) return facets + 1.0f / (root * std::fabs(cos_d - root));
  if (lobe.fresnel.kind == MixtureFresnel::kF82 || !(eta < 1.0f)) return facets;
  return facets + 1.0f / (eta * root);
}

/// Of f · cos and density.
/// @param wi  world
Tolerance tolerance_of(const MixtureLobes& lobes, Vec3f wi)
{
  constexpr float kRounding = 2e-6f;
  Tolerance tolerance;
  float slope = 0.0f;
  for (int i = 0; i < lobes.size; ++i) {
    const MixtureLobe& lobe = lobes.lobes[i];
    if (lobe.is_delta) continue;
    const Vec3f wi_lobe = to_local(lobe.frame, wi);
    slope = max(slope, slope_of(lobe, wi_lobe));
    if (mixture_lobe_is_diffuse(lobe)) continue;
    // A reflectance near none is a difference, too, which the height of the lobe multiplies.
    constexpr float kLastDigits = 2e-7f;
    const BsdfEval e = mixture_lobe_eval<TransportMode::kRadiance>(lobe, closure_tables(), wi_lobe,
                                                                   goes_through(lobe) && wi_lobe.z < 0.0f, false);
    tolerance.absolute += kLastDigits * max_component(lobe.weight) * e.pdf;
  }
  tolerance.relative = 1e-4f + kRounding * slope;
  return tolerance;
}

/// The lobe that a number chooses.
/// @param scale  see Mixture
/// @param u      what is left of it is one for the lobe
const MixtureLobe& chosen_of(const MixtureLobes& lobes, float scale, float& u)
{
  const MixtureLobe* chosen = nullptr;
  for (int i = 0; i < lobes.size; ++i) {
    const float probability = lobes.lobes[i].probability * scale;
    if (!(probability > 0.0f)) continue;
    chosen = &lobes.lobes[i];
    if (u < probability) {
      u /= probability;
      break;
    }
    u -= probability;
  }
  return *chosen;
}

/// How far the direction changes that a lobe samples, if its numbers do in their last digits. What is left of one that has chosen the lobe
/// has as many as the lobe is likely.
float rounding_of(const MixtureLobe& lobe, float probability, float branch, Vec2f u)
{
  constexpr float kLastDigits = 3e-7f;
  const auto sampled = [&](float x, float y) {
    return mixture_lobe_sample<TransportMode::kRadiance>(
               lobe, branch, {clamp(x, 0.0f, 1.0f - kUnitRoundoff), clamp(y, 0.0f, 1.0f - kUnitRoundoff)})
        .wi;
  };
  const Vec3f wi = sampled(u.x, u.y);
  float most = 0.0f;
  for (const float dx : {-kLastDigits, kLastDigits}) {
    for (const float dy : {-kLastDigits, 0.0f, kLastDigits}) {
      most = max(most, length(sampled(u.x + dx / probability, u.y + dy) - wi));
    }
  }
  return most;
}

void EightHits::compare(const Each& hit, int k, const MixtureLobes& lobes)
{
  const HitLane lane{&hits_, k, 1.0f / (1.0f - 0.5f * hit.passing)};
  EXPECT_EQ(lobes_are_delta(lane), lobes_are_delta(lobes));
  expect_close(lobes_normal(lane, hit.Ns), lobes_normal(lobes, hit.Ns), "normal");
  compared.num_delta += lobes_are_delta(lobes) ? 1 : 0;

  const Frame side = frame_from_normal(shading_normal_towards(hit.Ns, hit.wo));
  const Mixture all = mixture_of(lobes, side, hit.Ng), diffuse = closure_diffuse(all);
  const Vec3f lamp = to_local(side, hit.to_lamp);
  const float cos_lamp = std::fabs(lamp.z);
  const BsdfEval e = closure_eval<kFeatures>(all, closure_tables(), lamp),
                 found = closure_eval<kFeatures>(lane, closure_tables(), lamp);
  expect_close(found.f * cos_lamp, e.f * cos_lamp, "f", tolerance_of(lobes, hit.to_lamp));
  expect_close(found.pdf, e.pdf, "pdf", tolerance_of(lobes, hit.to_lamp));
  expect_close(closure_eval<kFeatures>(closure_diffuse(lane), closure_tables(), lamp).f * cos_lamp,
               closure_eval<kFeatures>(diffuse, closure_tables(), lamp).f * cos_lamp, "diffuse",
               tolerance_of(lobes, hit.to_lamp));
  compared.num_lit += e.pdf > 0.0f ? 1 : 0;

  const BsdfSample s =
      closure_sample<kFeatures>(mixture_of(lobes, side, hit.Ng, lane.gain), closure_tables(), hit.branch, hit.u);
  const BsdfSample sampled = closure_sample(lane);
  EXPECT_EQ(sampled.pdf > 0.0f, s.pdf > 0.0f);
  if (!(s.pdf > 0.0f)) {
    ++compared.num_absorbed;
    return;
  }
  EXPECT_EQ(sampled.lobe, s.lobe);
  const bool is_diffuse = (s.lobe & kLobeDiffuse) != 0, is_delta = (s.lobe & kLobeDelta) != 0;
  Vec2f u = hit.u;
  const MixtureLobe& chosen = chosen_of(lobes, all.scale, u.x);
  EXPECT_LE(length(sampled.wi - s.wi),
            5e-6f + 2.0f * rounding_of(chosen, chosen.probability * all.scale, hit.branch, u));
  const float cos_i = std::fabs(sampled.wi.z);
  const Tolerance tolerance = tolerance_of(lobes, from_local(side, sampled.wi));
  const BsdfEval there =
      is_delta ? BsdfEval{s.f, s.pdf}
               : mixture_eval<TransportMode::kRadiance>(mixture_of(lobes, side, hit.Ng, lane.gain), closure_tables(),
                                                        sampled.wi, &chosen, (s.lobe & kLobeTransmit) != 0);
  expect_close(sampled.f * cos_i, there.f * cos_i, "sampled f", tolerance);
  expect_close(sampled.pdf, there.pdf, "sampled pdf", tolerance);
  expect_close(sampled.roughness, s.roughness, "width");
  if ((s.lobe & kLobeTransmit) != 0) ++(is_delta ? compared.num_passed : compared.num_through);
  ++(is_diffuse ? compared.num_diffuse : is_delta ? compared.num_mirrored : compared.num_glossy);
}

void EightHits::compare_parts(const Each& hit, int k, const MixtureLobes& lobes)
{
  const SharpLobes sharp{true, true, hit.most_sharp};
  const HitLane lane{&hits_, k, 1.25f, HitTowards::kPhoton};
  const Frame side = frame_from_normal(shading_normal_towards(hit.Ns, hit.wo));
  const Mixture all = mixture_of(lobes, side, hit.Ng, lane.gain);
  EXPECT_EQ(closure_has<true>(lane, sharp), closure_has<true>(all, sharp));
  EXPECT_EQ(closure_has<false>(lane, sharp), closure_has<false>(all, sharp));

  const auto f_of = [](const auto& closure, Vec3f wi) {
    return closure_eval<kFeatures>(closure, closure_tables(), wi).f * std::fabs(wi.z);
  };
  const Tolerance tolerance = tolerance_of(lobes, hit.to_photon);
  const Vec3f photon = to_local(side, hit.to_photon);
  expect_close(f_of(lane, photon), f_of(all, photon), "towards photons", tolerance);
  const Vec3f soft = f_of(closure_soft(all, sharp), photon);
  expect_close(f_of(closure_soft(lane, sharp), photon), soft, "soft", tolerance);
  expect_close(f_of(closure_soft(lane, kAllSharp), photon), f_of(closure_soft(all, kAllSharp), photon), "matte",
               tolerance);
  compared.num_soft += is_zero(soft) ? 0 : 1;

  const BsdfSample sampled = closure_sample(lane);
  // Where glass has mirrored to below its own normal lists ask what it refracts there.
  const Vec3f wi = from_local(side, sampled.wi);
  bool goes_below = false;
  for (int i = 0; i < lobes.size; ++i) {
    goes_below = goes_below || (dot(wi, lobes.lobes[i].frame.n) < 0.0f) != ((sampled.lobe & kLobeTransmit) != 0);
  }
  if (!(sampled.pdf > 0.0f) || (sampled.lobe & kLobeDelta) != 0 || goes_below) return;
  const Vec3f f_sharp = f_of(closure_sharp(all, sharp), sampled.wi);
  expect_close(f_of(closure_sharp(lane, sharp), sampled.wi), f_sharp, "sharp", tolerance_of(lobes, wi));
  compared.num_sharp += is_zero(f_sharp) ? 0 : 1;
}

TEST_F(EightHits, ScatterAsEachByItself)
{
  for (const PrincipledCase& one : kPrincipledCases) {
    SCOPED_TRACE(one.name);
    use(one);
    vary_all(one);
    const GraphProgramView& view = program();
    compared = {};
    for (int i = 0; i < 6000; ++i) {
      Each each[8];
      for (int k = 0; k < 8; ++k) {
        each[k] = thrown_hit(i % 3 != 0);
        throw_inputs(k, i % 2 != 0);
        // At an index of 1 what a coat reflects is rounding alone.
        F8& coat_ior = registers_.lanes[result_of(offsetof(Principled4Inputs, coat_ior))];
        if (one.maths != Maths::k34) coat_ior[k] = coat_ior[k] < kInfinity ? max(float{coat_ior[k]}, 1.01f) : 1.5f;
      }
      make(view, each);
      for (int k = 0; k < 8; ++k) compare(each[k], k, make(view, each[k], k));
    }
    EXPECT_GT(compared.num_lit, 10000);
    EXPECT_GT(compared.num_diffuse, 4000);
    EXPECT_GT(compared.num_mirrored, 50);
    EXPECT_GT(compared.num_glossy, 4000);
    EXPECT_GT(compared.num_absorbed, 500);
    EXPECT_GT(compared.num_delta, 5);
  }
}

TEST_F(EightHits, ThatHaveNoWeightScatterNothing)
{
  for (const PrincipledCase& one : {kPrincipledCases[3], kPrincipledCases[11]}) {
    use(one);
    vary_all(one);
    vary(0);
    const GraphProgramView& view = program();
    for (const float weight : {0.0f, -1.0f, kInfinity, std::numeric_limits<float>::quiet_NaN()}) {
      Each each[8];
      for (int k = 0; k < 8; ++k) {
        each[k] = thrown_hit(true);
        throw_inputs(k, false);
        registers_.lanes[0][k] = weight;
      }
      make(view, each);
      for (int k = 0; k < 8; ++k) compare(each[k], k, make(view, each[k], k));
    }
    EXPECT_EQ(compared.num_lit + compared.num_diffuse + compared.num_glossy, 0);
  }
}

/// Others, and mixtures of several, are taken from lists.
class ListedHits : public EightHits {
 protected:
  /// Adds one hit's closures to a list.
  /// @param i  of the group
  void add(int i, const Each& hit, MixtureBuild& build)
  {
    const Vec3f color{random_.next(), random_.next(), random_.next()};
    const Vec3f normal = i % 7 == 0 ? Vec3f{hit.Ns.x, -hit.Ns.z, hit.Ns.y} + 0.3f * color : Vec3f{};
    SurfaceClosureSpec spec;
    spec.maths = build.maths = i % 3 == 0 ? Maths::k34 : i % 3 == 1 ? Maths::k43 : Maths::k52;
    // Not every hit has every lobe.
    const auto sometimes = [&](bool is_used, float value) { return is_used && random_.next() < 0.7f ? value : 0.0f; };
    if (i % 3 != 0) {
      spec.distribution = i % 2 != 0 ? ClosureDistribution::kMultiscatterGgx : ClosureDistribution::kGgx;
      Principled4Inputs in;
      in.base_color = color;
      in.metallic = i % 5 == 0 ? 1.0f : sometimes(i % 5 == 1, random_.next());
      in.roughness = random_.next();
      in.specular_tint = {random_.next(), 1, 1};
      in.normal = normal;
      in.sheen_weight = sometimes(i % 4 == 1, 0.6f);
      in.coat_weight = sometimes(i % 8 == 2, 0.5f);
      in.coat_tint = {1, 0.5f, random_.next()};
      closure_add(build, spec, 0.9f, in);
      return;
    }
    DiffuseInputs diffuse;
    diffuse.color = color;
    diffuse.normal = normal;
    GlossyInputs glossy;
    glossy.roughness = random_.next() < 0.1f ? 0.0f : random_.next();
    glossy.normal = normal;
    Principled3Inputs coated;
    coated.base_color = color;
    coated.clearcoat = sometimes(true, 0.8f);
    coated.sheen = sometimes(true, 0.8f);
    if (i % 2 != 0) closure_add(build, spec, 0.6f, diffuse);
    if (i % 4 != 0) closure_add(build, spec, 0.4f, glossy);
    if (i % 4 == 0) closure_add(build, spec, 0.4f, coated);
  }

  /// Compares groups of eight, whose lists a function makes.
  /// @return  how many there were
  template <typename Add>
  int compare_groups(int groups, Add&& add_to)
  {
    const std::unique_ptr<MixtureLobes[]> lists(new MixtureLobes[8]);
    int num_groups = 0;
    for (int i = 0; i < groups && !HasFailure(); ++i) {
      SCOPED_TRACE(i);
      Each each[8];
      for (int k = 0; k < 8; ++k) {
        Each& hit = each[k] = thrown_hit(i % 4 != 0);
        MixtureLobes& lobes = lists[static_cast<std::size_t>(k)];
        lobes.size = 0;
        MixtureBuild build{hit.wo, hit.Ng, hit.Ns, hit.is_front, &closure_tables(), &lobes};
        build.blur = hit.blur;
        add_to(i, hit, build);
        if (hit.blur > 0.0f) lobes_blur(lobes, hit.blur, -1.0f);
        if (hit.is_first) lobes_defend(lobes, hit.passing);
        hit_columns_set_surface(hits_, k, hit.Ng, frame_from_normal(shading_normal_towards(hit.Ns, hit.wo)));
        store_lane(hits_.to[0], k, hit.to_lamp);
        hits_.u[0][k] = hit.u.x;
        hits_.u[1][k] = hit.u.y;
        hits_.u[2][k] = hit.branch;
        store_lane(hits_.to[1], k, hit.to_photon);
        hits_.most_sharp[k] = hit.most_sharp;
      }
      if (!lobe_columns_take(hits_.lobes, lists.get(), 8)) continue;
      ++num_groups;
      hit_columns_ask<HitTowards::kLamp>(hits_);
      hit_columns_ask<HitTowards::kPhoton>(hits_);
      hit_columns_sample<true>(hits_);
      for (int k = 0; k < 8; ++k) {
        compare(each[k], k, lists[static_cast<std::size_t>(k)]);
        compare_parts(each[k], k, lists[static_cast<std::size_t>(k)]);
      }
    }
    return num_groups;
  }
};

TEST_F(ListedHits, ScatterAsTheirLists)
{
  const int num_groups =
      compare_groups(12000, [&](int i, const Each& hit, MixtureBuild& build) { add(i, hit, build); });
  EXPECT_GT(num_groups, 11000);
  EXPECT_GT(compared.num_lit, 30000);
  EXPECT_GT(compared.num_diffuse, 15000);
  EXPECT_GT(compared.num_mirrored, 150);
  EXPECT_GT(compared.num_glossy, 15000);
}

/// Light goes through some of their lobes.
class HitsThrough : public ListedHits {
 protected:
  /// Adds one hit's closures to a list.
  /// @param i  of the group
  void add_through(int i, const Each& hit, MixtureBuild& build)
  {
    const Vec3f color{random_.next(), random_.next(), random_.next()};
    const Vec3f normal = i % 7 == 0 ? Vec3f{hit.Ns.x, -hit.Ns.z, hit.Ns.y} + 0.3f * color : Vec3f{};
    SurfaceClosureSpec spec;
    spec.maths = build.maths = i % 3 == 0 ? Maths::k34 : i % 3 == 1 ? Maths::k43 : Maths::k52;
    constexpr ClosureDistribution kDistributions[] = {ClosureDistribution::kGgx, ClosureDistribution::kBeckmann,
                                                      ClosureDistribution::kMultiscatterGgx,
                                                      ClosureDistribution::kSharp};
    const int kind = i / 3 % 6;
    const ClosureDistribution distribution = kDistributions[i / 18 % 4];
    if (kind != 0 && kind != 4) spec.distribution = distribution;
    const float roughness = random_.next() < 0.1f ? 0.0f : random_.next();
    // Both sides, and now and then none: indices that match.
    const float ior = random_.next() < 0.05f ? 1.0f : 1.05f + random_.next();
    const auto translucent = [&](float weight) {
      TranslucentInputs in;
      in.color = color;
      in.normal = normal;
      closure_add(build, spec, weight, in);
    };
    if (kind == 0) {
      DiffuseInputs in;
      in.color = color;
      closure_add(build, spec, 0.6f, in);
      translucent(0.4f);
    } else if (kind == 1) {
      RefractionInputs in;
      in.color = color;
      in.normal = normal;
      in.roughness = roughness;
      in.ior = ior;
      closure_add(build, spec, 0.7f, in);
      if (random_.next() < 0.5f) translucent(0.3f);
    } else if (kind == 2) {
      GlassInputs in;
      in.color = color;
      in.normal = normal;
      in.roughness = roughness;
      in.ior = ior;
      closure_add(build, spec, 0.8f, in);
    } else if (kind == 3) {
      GlossyInputs in;
      in.color = color;
      in.normal = normal;
      in.roughness = roughness;
      in.anisotropy = random_.next() - 0.5f;
      closure_add(build, spec, 0.5f, in);
      if (random_.next() < 0.7f) translucent(0.5f);
    } else if (kind == 4) {
      Principled3Inputs in;
      in.base_color = color;
      in.normal = normal;
      in.roughness = roughness;
      in.transmission = random_.next() < 0.5f ? 1.0f : random_.next();
      in.ior = ior;
      closure_add(build, spec, 0.9f, in);
    } else {
      if (distribution != ClosureDistribution::kMultiscatterGgx) spec.distribution = ClosureDistribution::kGgx;
      if (spec.maths == Maths::k34) spec.maths = build.maths = Maths::k52;
      Principled4Inputs in;
      in.base_color = color;
      in.normal = normal;
      in.roughness = roughness;
      in.transmission_weight = random_.next() < 0.5f ? 1.0f : random_.next();
      in.ior = ior;
      if (random_.next() < 0.5f) in.specular_tint = {random_.next(), 1, 1};
      closure_add(build, spec, 0.9f, in);
    }
  }
};

TEST_F(HitsThrough, ScatterAsTheirLists)
{
  const int num_groups =
      compare_groups(24000, [&](int i, const Each& hit, MixtureBuild& build) { add_through(i, hit, build); });
  // Those of Ashikhmin and Shirley and what facets scatter twice up to 3.6 are no columns.
  EXPECT_GT(num_groups, 19000);
  EXPECT_GT(compared.num_lit, 60000);
  EXPECT_GT(compared.num_diffuse, 20000);
  EXPECT_GT(compared.num_mirrored, 5000);
  EXPECT_GT(compared.num_glossy, 30000);
  EXPECT_GT(compared.num_through, 30000);
  EXPECT_GT(compared.num_passed, 5000);
  EXPECT_GT(compared.num_sharp, 20000);
  EXPECT_GT(compared.num_soft, 20000);
}

TEST_F(ListedHits, OfOtherLobesAreNotTaken)
{
  const std::unique_ptr<MixtureLobes[]> lists(new MixtureLobes[8]);
  const auto fill = [&](int k, auto&& add) {
    MixtureLobes& lobes = lists[static_cast<std::size_t>(k)];
    lobes.size = 0;
    MixtureBuild build{{0.6f, 0, 0.8f}, {0, 0, 1}, {0, 0, 1}, true, &closure_tables(), &lobes};
    add(build);
  };
  const auto diffuse = [](MixtureBuild& b) { closure_add(b, {}, 1.0f, DiffuseInputs{}); };
  for (int k = 0; k < 8; ++k) fill(k, diffuse);
  EXPECT_TRUE(lobe_columns_take(hits_.lobes, lists.get(), 8));
  EXPECT_EQ(hits_.lobes.num_lobes, 1);
  fill(5, [](MixtureBuild& b) { closure_add(b, {}, 1.0f, VelvetInputs{}); });
  EXPECT_FALSE(lobe_columns_take(hits_.lobes, lists.get(), 8));
  EXPECT_TRUE(lobe_columns_take(hits_.lobes, lists.get(), 5));
  fill(5, [&](MixtureBuild& b) {
    for (int i = 0; i < kMostLobeColumns; ++i) diffuse(b);
  });
  EXPECT_TRUE(lobe_columns_take(hits_.lobes, lists.get(), 8));
  EXPECT_EQ(hits_.lobes.num_lobes, kMostLobeColumns);
  fill(6, [&](MixtureBuild& b) {
    for (int i = 0; i <= kMostLobeColumns; ++i) diffuse(b);
  });
  EXPECT_FALSE(lobe_columns_take(hits_.lobes, lists.get(), 8));
}

}  // namespace
}  // namespace relief
