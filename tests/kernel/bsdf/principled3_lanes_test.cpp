// The plain Principled closure of eight hits has the lobes that each hit has by itself.
#include "tests/kernel/bsdf/plain_principled.h"

namespace relief {
namespace {

void expect_same(const MixtureLobe& a, const MixtureLobe& b)
{
  EXPECT_EQ(a.kind, b.kind);
  EXPECT_EQ(a.maths, b.maths);
  EXPECT_EQ(a.is_delta, b.is_delta);
  EXPECT_EQ(a.is_bent, b.is_bent);
  EXPECT_EQ(a.mirrors_below, b.mirrors_below);
  EXPECT_EQ(a.probability, b.probability);
  EXPECT_EQ(a.roughness, b.roughness);
  EXPECT_EQ(a.weight, b.weight);
  EXPECT_EQ(a.frame.s, b.frame.s);
  EXPECT_EQ(a.frame.t, b.frame.t);
  EXPECT_EQ(a.frame.n, b.frame.n);
  EXPECT_EQ(a.wo, b.wo);
  EXPECT_EQ(a.surface_N, b.surface_N);
  EXPECT_EQ(a.fresnel.kind, b.fresnel.kind);
  EXPECT_EQ(a.fresnel.eta, b.fresnel.eta);
  EXPECT_EQ(a.fresnel.a, b.fresnel.a);
  if (a.kind == MixtureLobeKind::kGgx) {
    EXPECT_EQ(a.shape.ggx.alpha.x, b.shape.ggx.alpha.x);
    EXPECT_EQ(a.shape.ggx.alpha.y, b.shape.ggx.alpha.y);
    EXPECT_EQ(a.shape.ggx.masking, b.shape.ggx.masking);
  } else {
    EXPECT_EQ(a.shape.principled_diffuse.roughness, b.shape.principled_diffuse.roughness);
    EXPECT_EQ(a.shape.principled_diffuse.part, b.shape.principled_diffuse.part);
  }
}

TEST_F(PlainPrincipled, EightHaveTheLobesOfEach)
{
  vary_all();
  const GraphProgramView& plain = program();
  ASSERT_EQ(closures_plain(plain), &spec_);
  BsdfTables tables{};
  int num_lobes = 0, num_delta = 0, num_bent = 0;
  for (int i = 0; i < 3000; ++i) {
    MixtureBuildLanes lanes{};
    Vec3f wo[8], Ns[8];
    const Vec3f Ng{0, 0, 1};
    for (int k = 0; k < 8; ++k) {
      wo[k] = direction();
      Ns[k] = i % 3 == 0 ? Ng : direction();
      lane_set(lanes.wo, k, wo[k]);
      lane_set(lanes.Ng, k, Ng);
      lane_set(lanes.Ns, k, Ns[k]);
      throw_inputs(k, i % 2 != 0);
    }
    Principled3Columns columns;
    closures_resolve_plain(plain, spec_, registers_, lanes, columns);
    for (int k = 0; k < 8; ++k) {
      MixtureLobes each, together;
      MixtureBuild one{wo[k], Ng, Ns[k], true, &tables, &each}, all{wo[k], Ng, Ns[k], true, &tables, &together};
      const GraphLane lane{&plain, &registers_, k};
      closures_resolve(lane, one);
      closures_resolve(lane, all, &columns);
      ASSERT_EQ(together.size, each.size) << i;
      for (int l = 0; l < each.size; ++l) {
        expect_same(together.lobes[l], each.lobes[l]);
        num_delta += each.lobes[l].is_delta ? 1 : 0;
        num_bent += each.lobes[l].is_bent ? 1 : 0;
      }
      num_lobes += each.size;
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(num_lobes, 30000);
  EXPECT_GT(num_delta, 100);
  EXPECT_GT(num_bent, 1000);
}

TEST_F(PlainPrincipled, MoreThanThatIsNotPlain)
{
  using In = Principled3Inputs;
  EXPECT_NE(closures_plain(program()), nullptr);
  for (const std::size_t offset : {offsetof(In, subsurface), offsetof(In, sheen), offsetof(In, clearcoat),
                                   offsetof(In, transmission), offsetof(In, tangent)}) {
    const int result = result_of(offset);
    constants_[result] = 0.5f;
    EXPECT_EQ(closures_plain(program()), nullptr) << offset;
    constants_[result] = 0.0f;
    const std::uint16_t constant = results_[static_cast<std::size_t>(result)];
    vary(result);
    EXPECT_EQ(closures_plain(program()), nullptr) << offset;
    results_[static_cast<std::size_t>(result)] = constant;
  }
  spec_.distribution = ClosureDistribution::kMultiscatterGgx;
  EXPECT_EQ(closures_plain(program()), nullptr);
}

TEST_F(PlainPrincipled, IsFoundBesideOthersAndHasAWeight)
{
  vary(0);
  const GraphProgramView& one = program();
  const SurfaceClosureSpec two[] = {{.kind = ClosureKind::holdout, .first_result = 0}, spec_};
  GraphProgramView both = one;
  both.closures = two;
  both.num_closures = 2;
  EXPECT_EQ(closures_plain(both), &two[1]);
  registers_.lanes[0] = splat8(0.25f);
  registers_.lanes[0][3] = 0.0f;
  const MixtureBuildLanes lanes{splat8(Vec3f{0.6f, 0, 0.8f}), splat8(Vec3f{0, 0, 1}), splat8(Vec3f{0, 0, 1})};
  Principled3Columns columns;
  closures_resolve_plain(one, spec_, registers_, lanes, columns);
  for (const int lane : {2, 3}) {
    BsdfTables tables{};
    MixtureLobes lobes;
    MixtureBuild build{{0.6f, 0, 0.8f}, {0, 0, 1}, {0, 0, 1}, true, &tables, &lobes};
    closures_resolve({&one, &registers_, lane}, build, &columns);
    EXPECT_EQ(lobes.size, lane == 3 ? 0 : 2);
    if (lane == 2) {
      EXPECT_FLOAT_EQ(lobes.lobes[0].weight.x, 0.25f * 0.8f);
    }
  }
}

}  // namespace
}  // namespace relief
