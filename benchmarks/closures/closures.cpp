// The cases, and their hits. Compiled once an instruction set (see CMakeLists.txt), with RELIEF_CLOSURES_ROUND naming the
// function of this one.
//
// A hit is a point of a flat surface, seen from anywhere above it, whose interpolated normal leans a little. Each case is a
// material of closures whose inputs are constant, as most are: what graphs cost is in benchmarks/graph_nodes.cpp.
#include "benchmarks/closures/closures.h"

#include <chrono>
#include <memory>

#include "kernel/bsdf/mixture.h"
#include "kernel/stage/shade_surfaces.h"

namespace relief {

namespace {

constexpr unsigned kFeatures =
    kFeatureMixture | kFeatureGraphs | kFeatureTextures | kFeatureTransparency | kFeatureTransmission;

/// A material's closures as a program that has nothing to run.
class ClosureCase {
 public:
  explicit ClosureCase(const char* case_name) : name(case_name) {}

  template <typename Inputs>
  ClosureCase& add(SurfaceClosureSpec spec, const Inputs& inputs, float weight = 1.0f)
  {
    constexpr int kNumbers = std::is_empty_v<Inputs> ? 0 : sizeof(Inputs) / sizeof(float);
    spec.first_result = static_cast<std::uint16_t>(num_results_);
    constants_[num_results_++] = weight;
    if constexpr (kNumbers > 0) std::memcpy(constants_ + num_results_, &inputs, sizeof(Inputs));
    num_results_ += kNumbers;
    specs_[num_specs_++] = spec;
    return *this;
  }

  GraphProgramView program()
  {
    for (int i = 0; i < num_results_; ++i) results_[i] = static_cast<std::uint16_t>(kMostGraphRegisters + i);
    GraphProgramView view;
    view.constants = view.result_values = constants_;
    view.results = results_;
    view.varying_before = varying_before_;
    view.varying = results_;
    view.closures = specs_;
    view.num_closures = static_cast<std::uint32_t>(num_specs_);
    return view;
  }

  const char* name;
  bool is_curve = false;

 private:
  static constexpr int kMostResults = 256;
  float constants_[kMostResults] = {};
  std::uint16_t results_[kMostResults] = {}, varying_before_[kMostResults] = {};
  SurfaceClosureSpec specs_[4];
  int num_results_ = 0, num_specs_ = 0;
};

SurfaceClosureSpec spec_of(ClosureKind kind,
                           Maths maths = Maths::k34,
                           ClosureDistribution distribution = ClosureDistribution::kGgx)
{
  SurfaceClosureSpec spec;
  spec.kind = kind;
  spec.maths = maths;
  spec.distribution = distribution;
  return spec;
}

template <typename Inputs>
Inputs with(void (*change)(Inputs&))
{
  Inputs inputs;
  change(inputs);
  return inputs;
}

/// Each kind of lobe, then the mixtures that people's materials most often are.
template <typename F>
void cases_visit(F&& visit)
{
  using K = ClosureKind;
  using D = ClosureDistribution;
  const auto one = [&]<typename Inputs>(const char* name, SurfaceClosureSpec spec, const Inputs& inputs) {
    visit(ClosureCase(name).add(spec, inputs));
  };
  one("Lambert", spec_of(K::diffuse), DiffuseInputs{});
  one("Oren-Nayar", spec_of(K::diffuse), with<DiffuseInputs>([](auto& in) { in.roughness = 0.5f; }));
  one("Oren-Nayar, 4.3", spec_of(K::diffuse, Maths::k43), with<DiffuseInputs>([](auto& in) { in.roughness = 0.5f; }));
  one("translucent", spec_of(K::translucent), TranslucentInputs{});
  one("velvet", spec_of(K::velvet), VelvetInputs{});
  one("sheen of microfibres", spec_of(K::sheen, Maths::k43), SheenInputs{});
  one("toon", spec_of(K::toon), ToonInputs{});
  one("GGX", spec_of(K::glossy), GlossyInputs{});
  one("GGX, more than once", spec_of(K::glossy, Maths::k34, D::kMultiscatterGgx), GlossyInputs{});
  one("Beckmann", spec_of(K::glossy, Maths::k34, D::kBeckmann), GlossyInputs{});
  one("Ashikhmin-Shirley", spec_of(K::glossy, Maths::k34, D::kAshikhminShirley), GlossyInputs{});
  one("metal", spec_of(K::metallic, Maths::k52), MetallicInputs{});
  one("refraction", spec_of(K::refraction), with<RefractionInputs>([](auto& in) { in.roughness = 0.3f; }));
  one("glass", spec_of(K::glass, Maths::k43), with<GlassInputs>([](auto& in) { in.roughness = 0.3f; }));
  one("glass, smooth", spec_of(K::glass, Maths::k43), GlassInputs{});
  one("subsurface", spec_of(K::subsurface, Maths::k43), SubsurfaceInputs{});
  ClosureCase hair("hair");
  hair.add(spec_of(K::hair), HairInputs{});
  ClosureCase fibre("fibre");
  fibre.add(spec_of(K::fibre), FibreInputs{});
  ClosureCase facet_fibre("fibre of facets");
  facet_fibre.add(spec_of(K::facet_fibre), FacetFibreInputs{});
  hair.is_curve = fibre.is_curve = facet_fibre.is_curve = true;
  visit(hair);
  visit(fibre);
  visit(facet_fibre);

  one("Principled", spec_of(K::principled3), Principled3Inputs{});
  one("Principled metal", spec_of(K::principled3), with<Principled3Inputs>([](auto& in) { in.metallic = 1; }));
  one("Principled with a coat", spec_of(K::principled3), with<Principled3Inputs>([](auto& in) { in.clearcoat = 1; }));
  one("Principled with sheen", spec_of(K::principled3), with<Principled3Inputs>([](auto& in) { in.sheen = 1; }));
  one("Principled glass", spec_of(K::principled3), with<Principled3Inputs>([](auto& in) {
        in.transmission = 1;
        in.roughness = 0.1f;
      }));
  one("Principled, 4.3", spec_of(K::principled4, Maths::k43, D::kMultiscatterGgx), Principled4Inputs{});
  one("Principled, 5.2", spec_of(K::principled4, Maths::k52, D::kMultiscatterGgx), Principled4Inputs{});
  const SurfaceClosureSpec of_5 = spec_of(K::principled4, Maths::k52, D::kMultiscatterGgx);
  one("Principled metal, 5.2", of_5, with<Principled4Inputs>([](auto& in) { in.metallic = 1; }));
  one("Principled half metal, 5.2", of_5, with<Principled4Inputs>([](auto& in) { in.metallic = 0.5f; }));
  one("Principled with a coat, 5.2", of_5, with<Principled4Inputs>([](auto& in) { in.coat_weight = 1; }));
  one("Principled with sheen, 5.2", of_5, with<Principled4Inputs>([](auto& in) { in.sheen_weight = 1; }));
  visit(ClosureCase("diffuse and glossy")
            .add(spec_of(K::diffuse), DiffuseInputs{}, 0.7f)
            .add(spec_of(K::glossy), GlossyInputs{}, 0.3f));
  visit(ClosureCase("Principled and transparent")
            .add(spec_of(K::principled3), Principled3Inputs{}, 0.8f)
            .add(spec_of(K::transparent), TransparentInputs{}, 0.2f));
  visit(ClosureCase("diffuse and translucent")
            .add(spec_of(K::diffuse), DiffuseInputs{}, 0.5f)
            .add(spec_of(K::translucent), TranslucentInputs{}, 0.5f));
}

/// What is thrown of a hit.
struct Hit {
  Vec3f wo, light;  ///< world, unit
  Vec3f Ns;
  float u_branch;
  Vec2f u;
};

float thrown(std::uint32_t index, std::uint32_t dimension) { return sample_1d(1, index, dimension); }

void hits_make(Hit* hits, int num_hits)
{
  for (int i = 0; i < num_hits; ++i) {
    const auto index = static_cast<std::uint32_t>(i);
    const auto direction = [&](std::uint32_t first) {
      return warp_cosine_hemisphere({thrown(index, first), thrown(index, first + 1)});
    };
    const Vec3f bend = direction(4) * 0.2f;
    hits[i] = {direction(0),
               direction(2),
               normalize(Vec3f{bend.x, bend.y, 1.0f}),
               thrown(index, 6),
               {thrown(index, 7), thrown(index, 8)}};
  }
}

/// What stages have of a hit once its closures are resolved.
struct Resolved {
  SurfaceInteraction at;
  MixtureLobes* lobes;  ///< one of eight that follow each other
};

[[gnu::noinline, gnu::flatten]] void resolve(const KernelGlobals& g,
                                             const GraphLane& lane,
                                             ClosureSight sight,
                                             const Hit& hit,
                                             Resolved& resolved)
{
  resolved.at.hit.Ns = hit.Ns;
  surface_interaction_mix<kFeatures>(g, hit.wo, lane, nullptr, sight, resolved.at, *resolved.lobes);
}

[[gnu::noinline, gnu::flatten]] float evaluate(const KernelGlobals& g, const Hit& hit, const Resolved& resolved)
{
  const ShadingSide& side = resolved.at.side;
  const Mixture closure = mixture_of(*resolved.lobes, side.frame, side.Ng);
  if (lobes_are_delta(*resolved.lobes)) return 0.0f;
  const BsdfEval e = closure_eval<kFeatures>(closure, *g.bsdf_tables, to_local(side.frame, hit.light));
  return e.f.x + e.pdf;
}

[[gnu::noinline, gnu::flatten]] float sample(const KernelGlobals& g, const Hit& hit, const Resolved& resolved)
{
  const ShadingSide& side = resolved.at.side;
  const Mixture closure = mixture_of(*resolved.lobes, side.frame, side.Ng, 1.0f / resolved.at.params.alpha);
  const BsdfSample s = closure_sample<kFeatures>(closure, *g.bsdf_tables, hit.u_branch, hit.u);
  return s.f.x + s.pdf + s.wi.z;
}

/// Resolves eight hits as stages do. @return  whether columns have their lobes, too
[[gnu::noinline, gnu::flatten]] bool resolve_eight(const KernelGlobals& g,
                                                   const GraphProgramView& program,
                                                   const GraphRegisters& registers,
                                                   ClosureSight sight,
                                                   const Hit* hits,
                                                   Resolved* resolved,
                                                   HitColumns& columns)
{
  const std::uint64_t closures = closures_with_columns(program);
  const bool is_resolved = closures != 0 && closures_scatter_alone(program, closures);
  if (is_resolved) {
    MixtureBuildLanes b{{}, splat8(Vec3f{0, 0, 1}), {}, g.bsdf_tables};
    for (int k = 0; k < 8; ++k) {
      lane_set(b.wo, k, hits[k].wo);
      lane_set(b.Ns, k, hits[k].Ns);
    }
    closures_resolve_columns(program, closures, registers, b, columns.lobes);
    hit_columns_begin(b, frame_from_normal(shading_normal_towards(b.Ns, b.wo)), splat8(sight.blur.alpha), splat8(-1.0f),
                      columns);
  }
  for (int k = 0; k < 8; ++k) {
    SurfaceInteraction& at = resolved[k].at;
    at.hit.Ns = hits[k].Ns;
    const GraphLane lane{&program, &registers, k};
    if (is_resolved) {
      HitLane one{&columns, k};
      surface_interaction_mix<kFeatures>(g, hits[k].wo, lane, &columns.lobes, sight, at, one);
    } else {
      surface_interaction_mix<kFeatures>(g, hits[k].wo, lane, nullptr, sight, at, *resolved[k].lobes);
      hit_columns_set_surface(columns, k, at.side.Ng, at.side.frame);
    }
  }
  return is_resolved || lobe_columns_take(columns.lobes, resolved[0].lobes, 8);
}

/// Evaluates and samples eight hits in columns.
[[gnu::noinline, gnu::flatten]] float scatter_eight(const KernelGlobals& g,
                                                    const Hit* hits,
                                                    const Resolved* resolved,
                                                    HitColumns& columns)
{
  for (int k = 0; k < 8; ++k) {
    store_lane(columns.to[0], k, hits[k].light);
    columns.u[0][k] = hits[k].u.x;
    columns.u[1][k] = hits[k].u.y;
    columns.u[2][k] = hits[k].u_branch;
  }
  hit_columns_ask<HitTowards::kLamp>(columns);
  hit_columns_sample<false>(columns);
  float sum = 0.0f;
  for (int k = 0; k < 8; ++k) {
    const HitLane lane{&columns, k, 1.0f / resolved[k].at.params.alpha};
    const BsdfEval e = closure_eval<kFeatures>(lane, *g.bsdf_tables, {});
    const BsdfSample s = closure_sample(lane);
    sum += e.f.x + e.pdf + s.f.x + s.pdf + s.wi.z;
  }
  return sum;
}

/// @return  seconds
template <typename F>
double timed(F&& f)
{
  const auto start = std::chrono::steady_clock::now();
  f();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void case_run(const KernelGlobals& g,
              ClosureCase& one,
              const Hit* hits,
              int num_hits,
              Resolved* resolved,
              ClosureTimes& times)
{
  const GraphProgramView program = one.program();
  const GraphRegisters registers{};
  HitColumns columns{};
  ClosureSight sight;
  sight.enters = true;
  if (one.is_curve) sight.tangent = {1, 0, 0};
  times.name = one.name;
  times.sum = 0;
  const auto step = [&](ClosureStep which, auto&& f) {
    times.seconds[static_cast<int>(which)] = timed([&] {
      for (int i = 0; i < num_hits; i += 8) f(i);
    });
  };
  const auto resolve_at = [&](int i, int k) { resolve(g, {&program, &registers, k}, sight, hits[i + k], resolved[k]); };
  step(ClosureStep::kResolve, [&](int i) {
    for (int k = 0; k < 8; ++k) resolve_at(i, k);
    times.sum += resolved[0].lobes->lobes[0].probability;
  });
  // The same eight hits' lobes, towards other lamps and with other numbers.
  step(ClosureStep::kEvaluate, [&](int i) {
    for (int k = 0; k < 8; ++k) times.sum += evaluate(g, hits[i + k], resolved[k]);
  });
  step(ClosureStep::kSample, [&](int i) {
    for (int k = 0; k < 8; ++k) times.sum += sample(g, hits[i + k], resolved[k]);
  });
  step(ClosureStep::kHit, [&](int i) {
    for (int k = 0; k < 8; ++k) {
      resolve_at(i, k);
      times.sum += evaluate(g, hits[i + k], resolved[k]) + sample(g, hits[i + k], resolved[k]);
    }
  });
  step(ClosureStep::kEight, [&](int i) {
    if (resolve_eight(g, program, registers, sight, hits + i, resolved, columns)) {
      times.sum += scatter_eight(g, hits + i, resolved, columns);
      return;
    }
    for (int k = 0; k < 8; ++k) times.sum += evaluate(g, hits[i + k], resolved[k]);
    for (int k = 0; k < 8; ++k) times.sum += sample(g, hits[i + k], resolved[k]);
  });
}

const BsdfTables& tables()
{
  static const BsdfTables* const made = [] {
    auto* t = new BsdfTables;
    bsdf_tables_make(*t, kFeatureAll | kFeatureMixture);
    return t;
  }();
  return *made;
}

}  // namespace

int RELIEF_CLOSURES_ROUND(int num_hits, ClosureTimes* times)
{
  const std::unique_ptr<Hit[]> hits(new Hit[static_cast<std::size_t>(num_hits)]);
  hits_make(hits.get(), num_hits);
  Material material;
  material.has_closures = true;
  KernelGlobals g;
  g.bsdf_tables = &tables();
  const std::unique_ptr<Resolved[]> resolved(new Resolved[8]);
  const std::unique_ptr<MixtureLobes[]> lists(new MixtureLobes[8]);
  for (int k = 0; k < 8; ++k) {
    resolved[k].lobes = &lists[k];
    resolved[k].at.material = &material;
    resolved[k].at.hit.Ng = resolved[k].at.side.Ng = {0, 0, 1};
    resolved[k].at.side.front = true;
  }
  int count = 0;
  cases_visit([&](ClosureCase one) { case_run(g, one, hits.get(), num_hits, resolved.get(), times[count++]); });
  return count;
}

}  // namespace relief
