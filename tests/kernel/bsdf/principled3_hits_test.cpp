// Eight surfaces of a plain Principled closure scatter as each does by the list of its lobes.
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
    principled3_hits_make(b, frame_from_normal(shading_normal_towards(b.Ns, b.wo)), blur, hits_);
    for (int k = 0; k < 8; ++k) {
      Principled3Lane lane{&hits_, k};
      if (each[k].is_first) lobes_defend(lane, each[k].passing);
    }
    principled3_hits_light(hits_);
    principled3_hits_sample(hits_);
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

  Principled3Hits hits_{};
  MixtureLobes lobes_;
  BsdfTables tables_{};
};

/// Relative, of what stands on the last digits of half vectors, which are short at grazing angles, as far as a lobe is narrow.
float tolerance_of(const MixtureLobes& lobes)
{
  float least = 1.0f;
  for (int i = 0; i < lobes.size; ++i) {
    const MixtureLobe& lobe = lobes.lobes[i];
    if (lobe.kind == MixtureLobeKind::kGgx) least = min(lobe.shape.ggx.alpha.x, lobe.shape.ggx.alpha.y);
  }
  return 1e-4f + 1e-4f / least;
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

TEST_F(EightHits, ScatterAsEachByItself)
{
  vary_all();
  const GraphProgramView& plain = program();
  int num_lit = 0, num_kinds[3] = {}, num_absorbed = 0, num_delta = 0;
  for (int i = 0; i < 12500; ++i) {
    Each each[8];
    for (int k = 0; k < 8; ++k) {
      each[k] = thrown_hit(i % 3 != 0);
      throw_inputs(k, i % 2 != 0);
    }
    make(plain, each);
    for (int k = 0; k < 8; ++k) {
      const Each& hit = each[k];
      const Principled3Lane lane{&hits_, k, 1.0f / (1.0f - 0.5f * hit.passing)};
      const MixtureLobes& lobes = make(plain, hit, k);
      const float tolerance = tolerance_of(lobes);
      const LobesSum sum = lobes_sum(lobes), sum_lane = lobes_sum(lane);
      expect_close(sum_lane.probability, sum.probability, "probability");
      expect_close(sum_lane.sharp, sum.sharp, "sharp");
      expect_close(sum_lane.weight, sum.weight, "weight");
      EXPECT_EQ(lobes_are_delta(lane), lobes_are_delta(lobes));
      expect_close(lobes_normal(lane, hit.Ns), lobes_normal(lobes, hit.Ns), "normal");
      num_delta += lobes_are_delta(lobes) ? 1 : 0;

      const Frame side = frame_from_normal(shading_normal_towards(hit.Ns, hit.wo));
      const Mixture all = mixture_of(lobes, side, hit.Ng), diffuse = closure_diffuse(all);
      const Vec3f lamp = to_local(side, hit.to_lamp);
      const float cos_lamp = std::fabs(lamp.z);
      const BsdfEval e = closure_eval<kFeatures>(all, tables_, lamp),
                     found = closure_eval<kFeatures>(lane, tables_, lamp);
      expect_close(found.f * cos_lamp, e.f * cos_lamp, "f", tolerance);
      expect_close(found.pdf, e.pdf, "pdf", tolerance);
      expect_close(closure_eval<kFeatures>(closure_diffuse(lane), tables_, lamp).f * cos_lamp,
                   closure_eval<kFeatures>(diffuse, tables_, lamp).f * cos_lamp, "diffuse", 1e-4f);
      num_lit += e.pdf > 0.0f ? 1 : 0;

      const BsdfSample s = closure_sample<kFeatures>(mixture_of(lobes, side, hit.Ng, lane.gain), tables_, 0.5f, hit.u);
      const BsdfSample sampled = closure_sample(lane);
      EXPECT_EQ(sampled.pdf > 0.0f, s.pdf > 0.0f);
      if ((sampled.pdf > 0.0f) != (s.pdf > 0.0f)) {
        const Vec3f w = from_local(side, sampled.wi);
        printf("u %.9g %.9g wi.Ng %g wi.z %g pdf %g bits %u p %g %g alpha %g %g, size %d\n", hit.u.x, hit.u.y,
               dot(w, hit.Ng), sampled.wi.z, sampled.pdf, sampled.lobe, hits_.p_diffuse[k], hits_.p_reflection[k],
               hits_.lobes.alpha[0][k], hits_.lobes.alpha[1][k], lobes.size);
      }
      if (!(s.pdf > 0.0f)) {
        ++num_absorbed;
        continue;
      }
      EXPECT_EQ(sampled.lobe, s.lobe);
      // What is left of a number that has chosen a lobe has as many digits as the lobe is likely, and at rims of lobes the root
      // of them counts.
      const bool is_diffuse = (s.lobe & kLobeDiffuse) != 0, is_delta = (s.lobe & kLobeDelta) != 0;
      const MixtureLobe& chosen = lobes.lobes[is_diffuse ? 0 : lobes.size - 1];
      EXPECT_LE(length(sampled.wi - s.wi), 5e-5f / (chosen.probability * all.scale));
      const float cos_i = std::fabs(sampled.wi.z);
      const BsdfEval there = is_delta
                                 ? BsdfEval{s.f, s.pdf}
                                 : mixture_eval<TransportMode::kRadiance>(mixture_of(lobes, side, hit.Ng, lane.gain),
                                                                          tables_, sampled.wi, &chosen, false);
      expect_close(sampled.f * cos_i, there.f * cos_i, "sampled f", tolerance);
      expect_close(sampled.pdf, there.pdf, "sampled pdf", tolerance);
      expect_close(sampled.roughness, s.roughness, "width");
      ++num_kinds[is_diffuse ? 0 : is_delta ? 1 : 2];
    }
    if (HasFailure()) {
      ADD_FAILURE() << "round " << i;
      return;
    }
  }
  EXPECT_GT(num_lit, 30000);
  EXPECT_GT(num_kinds[0], 10000);
  EXPECT_GT(num_kinds[1], 100);
  EXPECT_GT(num_kinds[2], 10000);
  EXPECT_GT(num_absorbed, 1000);
  EXPECT_GT(num_delta, 100);
}

}  // namespace
}  // namespace relief
