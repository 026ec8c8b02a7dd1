// Eight surfaces of a diffuse lobe and a reflection scatter as each does by the list of its lobes.
#include "kernel/stage/shade_surfaces.h"

#include "tests/kernel/bsdf/lobe_trio.h"
#include "tests/kernel/bsdf/plain_principled.h"

namespace relief {
namespace {

constexpr unsigned kFeatures = kFeatureMixture | kFeatureGraphs;

/// Eight hits of a program, as columns and each as a list of lobes.
class EightHits : public PlainPrincipled {
 protected:
  struct Each {
    Vec3f wo, Ng, Ns, to_lamp;
    Vec2f u;
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
    if (random_.next() < 0.05f) hit.u.x = random_.next() < 0.5f ? 0.0f : 1.0f - 1e-5f;
    if (random_.next() < 0.3f) hit.blur = 0.5f * random_.next();
    hit.is_first = random_.next() < 0.5f;
    if (random_.next() < 0.3f) hit.passing = random_.next();
    return hit;
  }

  /// What stages do with eight hits up to where they ask.
  void make(const GraphProgramView& plain, const Each (&each)[8])
  {
    MixtureBuildLanes b{};
    F8 blur{};
    for (int k = 0; k < 8; ++k) {
      lane_set(b.wo, k, each[k].wo);
      lane_set(b.Ng, k, each[k].Ng);
      lane_set(b.Ns, k, each[k].Ns);
      blur[k] = each[k].blur;
      store_lane(hits_.to_lamp, k, each[k].to_lamp);
      hits_.u[0][k] = each[k].u.x;
      hits_.u[1][k] = each[k].u.y;
    }
    closures_resolve_plain(plain, spec_, registers_, b, hits_.lobes);
    lobe_pairs_make(b, frame_from_normal(shading_normal_towards(b.Ns, b.wo)), blur, hits_);
    for (int k = 0; k < 8; ++k) {
      LobePairLane lane{&hits_, k};
      if (each[k].is_first) lobes_defend(lane, each[k].passing);
    }
    lobe_pairs_light(hits_);
    lobe_pairs_sample(hits_);
  }

  MixtureLobes& make(const GraphProgramView& plain, const Each& hit, int lane)
  {
    lobes_.size = 0;
    MixtureBuild build{hit.wo, hit.Ng, hit.Ns, true, &tables_, &lobes_};
    closures_resolve({&plain, &registers_, lane}, build);
    if (hit.blur > 0.0f) lobes_blur(lobes_, hit.blur, -1.0f);
    if (hit.is_first) lobes_defend(lobes_, hit.passing);
    return lobes_;
  }

  /// Compares columns with a hit's list.
  void compare(const Each& hit, int k, const MixtureLobes& lobes);

  /// How often what was compared.
  struct {
    int num_lit = 0, num_diffuse = 0, num_mirrored = 0, num_glossy = 0, num_absorbed = 0, num_delta = 0;
  } compared;
  LobePairs hits_{};
  MixtureLobes lobes_;
  BsdfTables tables_{};
};

/// Relative, of f and density. The slope of a half vector has the rounding of directions over its length, and is asked for in widths
/// of the lobe.
/// @param wi  world
float tolerance_of(const MixtureLobes& lobes, Vec3f wi)
{
  constexpr float kRounding = 2e-6f;
  float slope = 0.0f;
  for (int i = 0; i < lobes.size; ++i) {
    const MixtureLobe& lobe = lobes.lobes[i];
    if (lobe.kind != MixtureLobeKind::kGgx) continue;
    const float width = min(lobe.shape.ggx.alpha.x, lobe.shape.ggx.alpha.y);
    slope = kRounding / (width * length(lobe.wo + to_local(lobe.frame, wi)));
  }
  return 1e-4f + slope;
}

void expect_close(float a, float b, const char* what, float relative = 1e-5f)
{
  constexpr float kAbsolute = 1e-6f;
  EXPECT_LE(std::fabs(a - b), relative * std::fabs(b) + kAbsolute) << what << ' ' << a << ' ' << b;
}

void expect_close(Vec3f a, Vec3f b, const char* what, float relative = 1e-5f)
{
  expect_close(a.x, b.x, what, relative);
  expect_close(a.y, b.y, what, relative);
  expect_close(a.z, b.z, what, relative);
}

void EightHits::compare(const Each& hit, int k, const MixtureLobes& lobes)
{
  const LobePairLane lane{&hits_, k, 1.0f / (1.0f - 0.5f * hit.passing)};
  const LobesSum sum = lobes_sum(lobes), sum_lane = lobes_sum(lane);
  expect_close(sum_lane.probability, sum.probability, "probability");
  expect_close(sum_lane.sharp, sum.sharp, "sharp");
  expect_close(sum_lane.weight, sum.weight, "weight");
  EXPECT_EQ(lobes_are_delta(lane), lobes_are_delta(lobes));
  expect_close(lobes_normal(lane, hit.Ns), lobes_normal(lobes, hit.Ns), "normal");
  compared.num_delta += lobes_are_delta(lobes) ? 1 : 0;

  const Frame side = frame_from_normal(shading_normal_towards(hit.Ns, hit.wo));
  const Mixture all = mixture_of(lobes, side, hit.Ng), diffuse = closure_diffuse(all);
  const Vec3f lamp = to_local(side, hit.to_lamp);
  const float cos_lamp = std::fabs(lamp.z);
  const BsdfEval e = closure_eval<kFeatures>(all, tables_, lamp), found = closure_eval<kFeatures>(lane, tables_, lamp);
  expect_close(found.f * cos_lamp, e.f * cos_lamp, "f", tolerance_of(lobes, hit.to_lamp));
  expect_close(found.pdf, e.pdf, "pdf", tolerance_of(lobes, hit.to_lamp));
  expect_close(closure_eval<kFeatures>(closure_diffuse(lane), tables_, lamp).f * cos_lamp,
               closure_eval<kFeatures>(diffuse, tables_, lamp).f * cos_lamp, "diffuse", 1e-4f);
  compared.num_lit += e.pdf > 0.0f ? 1 : 0;

  const BsdfSample s = closure_sample<kFeatures>(mixture_of(lobes, side, hit.Ng, lane.gain), tables_, 0.5f, hit.u);
  const BsdfSample sampled = closure_sample(lane);
  EXPECT_EQ(sampled.pdf > 0.0f, s.pdf > 0.0f);
  if (!(s.pdf > 0.0f)) {
    ++compared.num_absorbed;
    return;
  }
  EXPECT_EQ(sampled.lobe, s.lobe);
  // What is left of a number that has chosen a lobe has as many digits as the lobe is likely, and at rims of lobes the root
  // of them counts.
  const bool is_diffuse = (s.lobe & kLobeDiffuse) != 0, is_delta = (s.lobe & kLobeDelta) != 0;
  const MixtureLobe& chosen = lobes.lobes[mixture_lobe_is_diffuse(lobes.lobes[0]) == is_diffuse ? 0 : 1];
  EXPECT_LE(length(sampled.wi - s.wi), 5e-5f / (chosen.probability * all.scale));
  const float cos_i = std::fabs(sampled.wi.z), tolerance = tolerance_of(lobes, from_local(side, sampled.wi));
  const BsdfEval there = is_delta ? BsdfEval{s.f, s.pdf}
                                  : mixture_eval<TransportMode::kRadiance>(mixture_of(lobes, side, hit.Ng, lane.gain),
                                                                           tables_, sampled.wi, &chosen, false);
  expect_close(sampled.f * cos_i, there.f * cos_i, "sampled f", tolerance);
  expect_close(sampled.pdf, there.pdf, "sampled pdf", tolerance);
  expect_close(sampled.roughness, s.roughness, "width");
  ++(is_diffuse ? compared.num_diffuse : is_delta ? compared.num_mirrored : compared.num_glossy);
}

TEST_F(EightHits, ScatterAsEachByItself)
{
  vary_all();
  const GraphProgramView& plain = program();
  for (int i = 0; i < 12500 && !HasFailure(); ++i) {
    Each each[8];
    for (int k = 0; k < 8; ++k) {
      each[k] = thrown_hit(i % 3 != 0);
      throw_inputs(k, i % 2 != 0);
    }
    make(plain, each);
    for (int k = 0; k < 8; ++k) compare(each[k], k, make(plain, each[k], k));
  }
  EXPECT_GT(compared.num_lit, 30000);
  EXPECT_GT(compared.num_diffuse, 10000);
  EXPECT_GT(compared.num_mirrored, 100);
  EXPECT_GT(compared.num_glossy, 10000);
  EXPECT_GT(compared.num_absorbed, 1000);
  EXPECT_GT(compared.num_delta, 100);
}

TEST_F(EightHits, ThatHaveNoWeightScatterNothing)
{
  vary_all();
  vary(0);
  const GraphProgramView& plain = program();
  for (const float weight : {0.0f, -1.0f, kInfinity, std::numeric_limits<float>::quiet_NaN()}) {
    Each each[8];
    for (int k = 0; k < 8; ++k) {
      each[k] = thrown_hit(true);
      throw_inputs(k, false);
      registers_.lanes[0][k] = weight;
    }
    make(plain, each);
    for (int k = 0; k < 8; ++k) compare(each[k], k, make(plain, each[k], k));
  }
  EXPECT_EQ(compared.num_lit + compared.num_diffuse + compared.num_glossy, 0);
}

/// Closures of newer versions, and of nodes by themselves, are taken from lists.
TEST_F(EightHits, TakenFromListsScatterAsThese)
{
  const std::unique_ptr<MixtureLobes[]> lists(new MixtureLobes[8]);
  int num_groups = 0;
  for (int i = 0; i < 12000 && !HasFailure(); ++i) {
    Each each[8];
    SurfaceClosureSpec spec;
    spec.maths = i % 3 == 0 ? Maths::k34 : i % 3 == 1 ? Maths::k43 : Maths::k52;
    spec.distribution = i % 2 != 0 && i % 3 != 0 ? ClosureDistribution::kMultiscatterGgx : ClosureDistribution::kGgx;
    const float metallic = i % 5 == 0 ? 1.0f : 0.0f;
    const bool is_bent = i % 7 == 0;
    bool are_pairs = true;
    lobe_pairs_begin(hits_);
    for (int k = 0; k < 8; ++k) {
      Each& hit = each[k] = thrown_hit(i % 4 != 0);
      MixtureLobes& lobes = lists[static_cast<std::size_t>(k)];
      lobes.size = 0;
      MixtureBuild build{hit.wo, hit.Ng, hit.Ns, true, &full_tables(), &lobes};
      build.maths = spec.maths;
      const Vec3f color{random_.next(), random_.next(), random_.next()};
      const Vec3f normal = is_bent ? Vec3f{hit.Ns.x, -hit.Ns.z, hit.Ns.y} + 0.3f * color : Vec3f{};
      if (spec.maths != Maths::k34) {
        Principled4Inputs in;
        in.base_color = color;
        in.metallic = metallic;
        in.roughness = random_.next();
        in.specular_tint = {random_.next(), 1, 1};
        in.normal = normal;
        closure_add(build, spec, 0.9f, in);
      } else {
        DiffuseInputs diffuse;
        diffuse.color = color;
        diffuse.normal = normal;
        GlossyInputs glossy;
        glossy.roughness = random_.next() < 0.1f ? 0.0f : random_.next();
        glossy.normal = normal;
        closure_add(build, spec, 0.6f, diffuse);
        closure_add(build, spec, 0.4f, glossy);
      }
      if (hit.blur > 0.0f) lobes_blur(lobes, hit.blur, -1.0f);
      if (hit.is_first) lobes_defend(lobes, hit.passing);
      are_pairs = are_pairs && lobe_pairs_take(hits_, k, k == 0, lobes);
      lobe_pairs_set_surface(hits_, k, hit.Ng, frame_from_normal(shading_normal_towards(hit.Ns, hit.wo)));
      store_lane(hits_.to_lamp, k, hit.to_lamp);
      hits_.u[0][k] = hit.u.x;
      hits_.u[1][k] = hit.u.y;
    }
    // Since 4.0 diffuse lobes and reflections may have different normals.
    if (!are_pairs) continue;
    ++num_groups;
    lobe_pairs_light(hits_);
    lobe_pairs_sample(hits_);
    for (int k = 0; k < 8; ++k) compare(each[k], k, lists[static_cast<std::size_t>(k)]);
  }
  EXPECT_GT(num_groups, 3000);
  EXPECT_GT(compared.num_lit, 10000);
  EXPECT_GT(compared.num_diffuse, 5000);
  EXPECT_GT(compared.num_mirrored, 50);
  EXPECT_GT(compared.num_glossy, 5000);
}

}  // namespace
}  // namespace relief
