// Principled closures of eight hits have the lobes that each hit has by itself.
#include "tests/kernel/bsdf/principled_program.h"

namespace relief {
namespace {

void expect_same(const MixtureLobe& a, const MixtureLobe& b)
{
  EXPECT_EQ(a.first_share, b.first_share);
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
  EXPECT_EQ(a.fresnel.b, b.fresnel.b);
  if (a.kind == MixtureLobeKind::kGgx) {
    EXPECT_EQ(a.shape.ggx.alpha.x, b.shape.ggx.alpha.x);
    EXPECT_EQ(a.shape.ggx.alpha.y, b.shape.ggx.alpha.y);
    EXPECT_EQ(a.shape.ggx.masking, b.shape.ggx.masking);
  } else if (a.kind == MixtureLobeKind::kClearcoat) {
    EXPECT_EQ(a.shape.clearcoat.alpha, b.shape.clearcoat.alpha);
  } else if (a.kind == MixtureLobeKind::kPrincipledDiffuse) {
    EXPECT_EQ(a.shape.principled_diffuse.roughness, b.shape.principled_diffuse.roughness);
    EXPECT_EQ(a.shape.principled_diffuse.part, b.shape.principled_diffuse.part);
  } else if (a.kind == MixtureLobeKind::kMicrofibre) {
    EXPECT_EQ(a.shape.microfibre.A, b.shape.microfibre.A);
    EXPECT_EQ(a.shape.microfibre.B, b.shape.microfibre.B);
    EXPECT_EQ(a.shape.microfibre.albedo, b.shape.microfibre.albedo);
  }
}

class PrincipledLanes : public PrincipledProgram {
 protected:
  void compare(const PrincipledCase& one);
};

void PrincipledLanes::compare(const PrincipledCase& one)
{
  use(one);
  vary_all(one);
  const GraphProgramView& view = program();
  ASSERT_EQ(closures_with_columns(view), &spec_);
  const BsdfTables& tables = closure_tables();
  int num_lobes = 0, num_delta = 0, num_bent = 0, num_layers = 0;
  for (int i = 0; i < 2000; ++i) {
    MixtureBuildLanes lanes{};
    lanes.tables = &tables;
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
    LobeColumns columns{};
    closures_resolve_columns(view, spec_, registers_, lanes, columns);
    for (int k = 0; k < 8; ++k) {
      MixtureLobes each, together;
      MixtureBuild by_itself{wo[k], Ng, Ns[k], true, &tables, &each}, all{wo[k], Ng, Ns[k], true, &tables, &together};
      const GraphLane lane{&view, &registers_, k};
      closures_resolve(lane, by_itself);
      closures_resolve(lane, all, &columns);
      ASSERT_EQ(together.size, each.size) << i;
      for (int l = 0; l < each.size; ++l) {
        const MixtureLobe& lobe = each.lobes[l];
        expect_same(together.lobes[l], lobe);
        num_delta += lobe.is_delta ? 1 : 0;
        num_bent += lobe.is_bent ? 1 : 0;
        num_layers += lobe.kind == MixtureLobeKind::kClearcoat || lobe.kind == MixtureLobeKind::kMicrofibre ||
                              lobe.kind == MixtureLobeKind::kPrincipledSheen ||
                              lobe.fresnel.kind == MixtureFresnel::kDielectric
                          ? 1
                          : 0;
      }
      num_lobes += each.size;
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(num_lobes, 15000);
  EXPECT_GT(num_delta, 100);
  EXPECT_GT(num_bent, 1000);
  EXPECT_GT(num_layers, one.has_sheen || one.has_coat ? 5000 : -1);
}

TEST_F(PrincipledLanes, EightHaveTheLobesOfEach)
{
  for (const PrincipledCase& one : kPrincipledCases) {
    SCOPED_TRACE(one.name);
    compare(one);
  }
}

TEST_F(PrincipledLanes, MoreThanLayersHasNone)
{
  const auto expect_none_with = [&](std::size_t offset) {
    const int result = result_of(offset);
    const float before = constants_[result];
    constants_[result] = 0.5f;
    EXPECT_EQ(closures_with_columns(program()), nullptr) << offset;
    constants_[result] = before;
    const std::uint16_t constant = results_[static_cast<std::size_t>(result)];
    vary(result);
    EXPECT_EQ(closures_with_columns(program()), nullptr) << offset;
    results_[static_cast<std::size_t>(result)] = constant;
  };
  EXPECT_NE(closures_with_columns(program()), nullptr);
  for (const std::size_t offset : {offsetof(Principled3Inputs, subsurface), offsetof(Principled3Inputs, transmission),
                                   offsetof(Principled3Inputs, tangent)}) {
    expect_none_with(offset);
  }
  spec_.distribution = ClosureDistribution::kMultiscatterGgx;
  EXPECT_EQ(closures_with_columns(program()), nullptr);

  use({"", ClosureKind::principled4, Maths::k52, ClosureDistribution::kMultiscatterGgx, true, true});
  EXPECT_NE(closures_with_columns(program()), nullptr);
  using In = Principled4Inputs;
  for (const std::size_t offset :
       {offsetof(In, diffuse_roughness), offsetof(In, subsurface_weight), offsetof(In, transmission_weight),
        offsetof(In, thin_film_thickness), offsetof(In, tangent), offsetof(In, coat_tint)}) {
    expect_none_with(offset);
  }
  spec_.distribution = ClosureDistribution::kBeckmann;
  EXPECT_EQ(closures_with_columns(program()), nullptr);
}

TEST_F(PrincipledLanes, AreFoundBesideOthersAndHaveAWeight)
{
  for (const PrincipledCase& one_case : {kPrincipledCases[0], kPrincipledCases[4]}) {
    use(one_case);
    vary(0);
    const GraphProgramView& one = program();
    const SurfaceClosureSpec two[] = {{.kind = ClosureKind::holdout, .first_result = 0}, spec_};
    GraphProgramView both = one;
    both.closures = two;
    both.num_closures = 2;
    EXPECT_EQ(closures_with_columns(both), &two[1]);
    registers_.lanes[0] = splat8(0.25f);
    registers_.lanes[0][3] = 0.0f;
    const BsdfTables& tables = closure_tables();
    const MixtureBuildLanes lanes{splat8(Vec3f{0.6f, 0, 0.8f}), splat8(Vec3f{0, 0, 1}), splat8(Vec3f{0, 0, 1}),
                                  &tables};
    LobeColumns columns{};
    closures_resolve_columns(one, spec_, registers_, lanes, columns);
    for (const int lane : {2, 3}) {
      MixtureLobes lobes;
      MixtureBuild build{{0.6f, 0, 0.8f}, {0, 0, 1}, {0, 0, 1}, true, &tables, &lobes};
      closures_resolve({&one, &registers_, lane}, build, &columns);
      EXPECT_EQ(lobes.size, lane == 3 ? 0 : 2) << one_case.name;
    }
  }
}

}  // namespace
}  // namespace relief
