// Closures of eight hits have the lobes that each hit has by itself.
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
  } else if (a.kind == MixtureLobeKind::kBeckmann) {
    EXPECT_EQ(a.shape.beckmann.alpha.x, b.shape.beckmann.alpha.x);
    EXPECT_EQ(a.shape.beckmann.alpha.y, b.shape.beckmann.alpha.y);
    EXPECT_EQ(a.shape.beckmann.masking, b.shape.beckmann.masking);
  } else if (a.kind == MixtureLobeKind::kRefraction) {
    EXPECT_EQ(a.shape.refraction.alpha, b.shape.refraction.alpha);
    EXPECT_EQ(a.shape.refraction.eta, b.shape.refraction.eta);
    EXPECT_EQ(a.shape.refraction.is_beckmann, b.shape.refraction.is_beckmann);
    EXPECT_EQ(a.shape.refraction.masking, b.shape.refraction.masking);
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

/// What was compared.
struct Compared {
  int num_lobes = 0, num_delta = 0, num_bent = 0, num_layers = 0, num_through = 0;
};

class PrincipledLanes : public PrincipledProgram {
 protected:
  /// Compares eight hits of the closure with each, of inputs that throw_lane(lane, is_bent) throws.
  template <typename Throw>
  Compared compare(const Throw& throw_lane);
};

template <typename Throw>
Compared PrincipledLanes::compare(const Throw& throw_lane)
{
  const GraphProgramView& view = program();
  EXPECT_EQ(closures_with_columns(view), 1u);
  const BsdfTables& tables = closure_tables();
  Compared all_compared;
  auto& [num_lobes, num_delta, num_bent, num_layers, num_through] = all_compared;
  for (int i = 0; i < 2000; ++i) {
    MixtureBuildLanes lanes{};
    lanes.tables = &tables;
    Vec3f wo[8], Ns[8];
    bool is_front[8];
    const Vec3f Ng{0, 0, 1};
    for (int k = 0; k < 8; ++k) {
      wo[k] = direction();
      Ns[k] = i % 3 == 0 ? Ng : direction();
      lane_set(lanes.wo, k, wo[k]);
      lane_set(lanes.Ng, k, Ng);
      lane_set(lanes.Ns, k, Ns[k]);
      is_front[k] = (i + k) % 3 != 0;
      lanes.is_front[k] = is_front[k] ? -1 : 0;
      throw_lane(k, i % 2 != 0);
    }
    LobeColumns columns{};
    closures_resolve_columns(view, 1, registers_, lanes, columns);
    for (int k = 0; k < 8; ++k) {
      MixtureLobes each, together;
      MixtureBuild by_itself{wo[k], Ng, Ns[k], is_front[k], &tables, &each};
      MixtureBuild all{wo[k], Ng, Ns[k], is_front[k], &tables, &together};
      const GraphLane lane{&view, &registers_, k};
      closures_resolve(lane, by_itself);
      closures_resolve(lane, all, &columns);
      EXPECT_EQ(together.size, each.size) << i;
      EXPECT_EQ(all.transmits, by_itself.transmits);
      if (HasFailure()) return all_compared;
      for (int l = 0; l < each.size; ++l) {
        const MixtureLobe& lobe = each.lobes[l];
        expect_same(together.lobes[l], lobe);
        num_delta += lobe.is_delta ? 1 : 0;
        num_bent += lobe.is_bent ? 1 : 0;
        num_through += mixture_traits(lobe.kind).sides != LobeSides::kReflect ? 1 : 0;
        num_layers += lobe.kind == MixtureLobeKind::kClearcoat || lobe.kind == MixtureLobeKind::kMicrofibre ||
                              lobe.kind == MixtureLobeKind::kPrincipledSheen ||
                              lobe.fresnel.kind == MixtureFresnel::kDielectric
                          ? 1
                          : 0;
      }
      num_lobes += each.size;
      if (HasFailure()) return all_compared;
    }
  }
  EXPECT_GT(num_lobes, 10000);
  EXPECT_GT(num_bent, 1000);
  return all_compared;
}

TEST_F(PrincipledLanes, EightHaveTheLobesOfEach)
{
  for (const PrincipledCase& one : kPrincipledCases) {
    SCOPED_TRACE(one.name);
    use(one);
    vary_all(one);
    const Compared all = compare([&](int lane, bool is_bent) { throw_inputs(lane, is_bent); });
    EXPECT_GT(all.num_lobes, 15000);
    EXPECT_GT(all.num_delta, 100);
    EXPECT_GT(all.num_layers, one.has_sheen || one.has_coat ? 5000 : -1);
  }
}

TEST_F(PrincipledLanes, EightPlainOnesHaveTheLobesOfEach)
{
  const auto compare_all = [&]<typename Inputs>(ClosureKind kind, const Inputs& inputs, std::size_t normal,
                                                const std::vector<std::size_t>& varied) {
    for (const Maths maths : {Maths::k34, Maths::k43, Maths::k52}) {
      for (const ClosureDistribution distribution : {ClosureDistribution::kGgx, ClosureDistribution::kBeckmann}) {
        if (kind == ClosureKind::glass && maths != Maths::k34) continue;
        SurfaceClosureSpec spec;
        spec.kind = kind;
        spec.maths = maths;
        spec.distribution = distribution;
        use(spec, inputs);
        vary(0);
        for (std::size_t i = 0; i < 3; ++i) {
          vary(result_of(offsetof(DiffuseInputs, color)) + static_cast<int>(i));
          vary(result_of(normal) + static_cast<int>(i));
        }
        for (const std::size_t offset : varied) vary(result_of(offset));
        const Compared all = compare([&](int lane, bool is_bent) {
          for (const std::uint16_t result : varying_) {
            const int first = result_of(normal);
            const bool is_normal = result >= first && result < first + 3;
            registers_.lanes[result][lane] = is_normal && !is_bent ? 0.0f : is_normal ? random_.next() : thrown();
          }
        });
        const bool goes_through = kind != ClosureKind::diffuse && kind != ClosureKind::glossy;
        EXPECT_EQ(all.num_through > 5000, goes_through);
        EXPECT_EQ(all.num_delta > 100, kind != ClosureKind::diffuse && kind != ClosureKind::translucent);
      }
    }
  };
  static_assert(offsetof(DiffuseInputs, color) == 0 && offsetof(GlassInputs, color) == 0);
  compare_all(ClosureKind::diffuse, DiffuseInputs{}, offsetof(DiffuseInputs, normal), {});
  compare_all(ClosureKind::translucent, TranslucentInputs{}, offsetof(TranslucentInputs, normal), {});
  compare_all(ClosureKind::glossy, GlossyInputs{}, offsetof(GlossyInputs, normal),
              {offsetof(GlossyInputs, roughness), offsetof(GlossyInputs, anisotropy)});
  compare_all(ClosureKind::refraction, RefractionInputs{}, offsetof(RefractionInputs, normal),
              {offsetof(RefractionInputs, roughness), offsetof(RefractionInputs, ior)});
  compare_all(ClosureKind::glass, GlassInputs{}, offsetof(GlassInputs, normal),
              {offsetof(GlassInputs, roughness), offsetof(GlassInputs, ior)});
}

TEST_F(PrincipledLanes, PlainOnesWithMoreHaveNone)
{
  const auto is_found = [&](const SurfaceClosureSpec& spec, const auto& inputs) {
    use(spec, inputs);
    return closures_with_columns(program()) != 0;
  };
  DiffuseInputs rough;
  rough.roughness = 0.5f;
  EXPECT_TRUE(is_found({.kind = ClosureKind::diffuse}, DiffuseInputs{}));
  EXPECT_FALSE(is_found({.kind = ClosureKind::diffuse}, rough));
  GlossyInputs turned;
  turned.tangent = {1, 0, 0};
  EXPECT_TRUE(is_found({.kind = ClosureKind::glossy}, GlossyInputs{}));
  EXPECT_FALSE(is_found({.kind = ClosureKind::glossy}, turned));
  for (const ClosureDistribution distribution :
       {ClosureDistribution::kMultiscatterGgx, ClosureDistribution::kAshikhminShirley, ClosureDistribution::kSharp}) {
    EXPECT_FALSE(is_found({.kind = ClosureKind::glossy, .distribution = distribution}, GlossyInputs{}));
    EXPECT_FALSE(is_found({.kind = ClosureKind::refraction, .distribution = distribution}, RefractionInputs{}));
    EXPECT_FALSE(is_found({.kind = ClosureKind::glass, .distribution = distribution}, GlassInputs{}));
  }
  EXPECT_TRUE(is_found({.kind = ClosureKind::glass}, GlassInputs{}));
  EXPECT_FALSE(is_found({.kind = ClosureKind::glass, .maths = Maths::k43}, GlassInputs{}));
  EXPECT_FALSE(is_found({.kind = ClosureKind::velvet}, VelvetInputs{}));
}

TEST_F(PrincipledLanes, AreAsManyAsThereAreColumnsFor)
{
  use(kPrincipledCases[3]);
  GraphProgramView view = program();
  const SurfaceClosureSpec translucent{.kind = ClosureKind::translucent};
  const std::vector<SurfaceClosureSpec> closures = {spec_, {.kind = ClosureKind::velvet}, spec_, spec_, translucent};
  view.closures = closures.data();
  const auto with_columns = [&](std::uint32_t count) {
    view.num_closures = count;
    return closures_with_columns(view);
  };
  // Each Principled one may need four.
  EXPECT_EQ(with_columns(1), 0b1u);
  EXPECT_EQ(with_columns(2), 0b1u);
  EXPECT_EQ(with_columns(3), 0b101u);
  EXPECT_EQ(with_columns(5), 0b101u);
  EXPECT_TRUE(closures_scatter_alone(view, 0b11111u));
  EXPECT_FALSE(closures_scatter_alone(view, 0b101u));
  view.num_closures = 1;
  EXPECT_TRUE(closures_scatter_alone(view, 0b1u));
}

TEST_F(PrincipledLanes, MoreThanLayersHasNone)
{
  const auto expect_none_with = [&](std::size_t offset) {
    const int result = result_of(offset);
    const float before = constants_[result];
    constants_[result] = 0.5f;
    EXPECT_EQ(closures_with_columns(program()), 0u) << offset;
    constants_[result] = before;
    const std::uint16_t constant = results_[static_cast<std::size_t>(result)];
    vary(result);
    EXPECT_EQ(closures_with_columns(program()), 0u) << offset;
    results_[static_cast<std::size_t>(result)] = constant;
  };
  EXPECT_NE(closures_with_columns(program()), 0u);
  for (const std::size_t offset : {offsetof(Principled3Inputs, subsurface), offsetof(Principled3Inputs, transmission),
                                   offsetof(Principled3Inputs, tangent)}) {
    expect_none_with(offset);
  }
  spec_.distribution = ClosureDistribution::kMultiscatterGgx;
  EXPECT_EQ(closures_with_columns(program()), 0u);

  use({"", ClosureKind::principled4, Maths::k52, ClosureDistribution::kMultiscatterGgx, true, true});
  EXPECT_NE(closures_with_columns(program()), 0u);
  using In = Principled4Inputs;
  for (const std::size_t offset :
       {offsetof(In, diffuse_roughness), offsetof(In, subsurface_weight), offsetof(In, transmission_weight),
        offsetof(In, thin_film_thickness), offsetof(In, tangent), offsetof(In, coat_tint)}) {
    expect_none_with(offset);
  }
  spec_.distribution = ClosureDistribution::kBeckmann;
  EXPECT_EQ(closures_with_columns(program()), 0u);
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
    EXPECT_EQ(closures_with_columns(both), 2u);
    registers_.lanes[0] = splat8(0.25f);
    registers_.lanes[0][3] = 0.0f;
    const BsdfTables& tables = closure_tables();
    const MixtureBuildLanes lanes{splat8(Vec3f{0.6f, 0, 0.8f}), splat8(Vec3f{0, 0, 1}), splat8(Vec3f{0, 0, 1}),
                                  &tables};
    LobeColumns columns{};
    closures_resolve_columns(one, 1, registers_, lanes, columns);
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
