#include "scene/graph/closure_reader.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "kernel/bsdf/mixture.h"

namespace relief {
namespace {

enum class InputKind : std::uint8_t { kNumber, kColor, kVector };

struct ClosureInput {
  std::string_view name;
  InputKind kind;
  float value[3];
};

struct ClosureTable {
  std::string_view name;
  int most_lobes;  ///< that it becomes
  std::vector<ClosureInput> inputs;
};

/// The list of closures with their inputs; those of two Principled BSDFs share a name in files, and of two fibres.
const std::vector<ClosureTable>& closure_tables()
{
  static const std::vector<ClosureTable> tables = {
#define CLOSURE(name, Type, most_lobes) {#name, most_lobes, {
#define COLOR(name, json, r, g, b) {json, InputKind::kColor, {r, g, b}},
#define NUMBER(name, json, value) {json, InputKind::kNumber, {value, value, value}},
#define VECTOR(name, json) {json, InputKind::kVector, {0, 0, 0}},
#define END() \
  }           \
  }           \
  ,
#include "kernel/bsdf/closure_inputs.inc"
  };
  return tables;
}

SurfaceClosureSpec read_closure(const JsonReader& r)
{
  static constexpr std::string_view kDistributions[] = {"ggx", "multiscatter-ggx", "beckmann", "ashikhmin-shirley",
                                                        "sharp"};
  static constexpr std::string_view kMaths[] = {"3.4", "4.3", "5.2"};
  static constexpr std::string_view kComponents[] = {"diffuse", "glossy"};
  static constexpr std::string_view kHairComponents[] = {"reflection", "transmission"};
  static constexpr std::string_view kPigments[] = {"color", "melanin", "absorption"};
  static constexpr std::string_view kFresnels[] = {"f82", "physical"};
  static constexpr std::string_view kSubsurfaceMethods[] = {"random-walk", "random-walk-legacy", "random-walk-skin",
                                                            "christensen-burley"};
  SurfaceClosureSpec spec;
  spec.maths = static_cast<Maths>(r.choice("maths", kMaths, 0));
  std::string type = r.string("type", "");
  const std::string given = type;
  static constexpr std::string_view kFibreModels[] = {"chiang", "huang"};
  if (type == "fibre" && r.choice("model", kFibreModels, 0) == 1) type = "facet_fibre";
  if (type == "principled") type = spec.maths >= Maths::k43 ? "principled4" : "principled3";
  const auto& tables = closure_tables();
  const auto it = std::find_if(tables.begin(), tables.end(), [&](const ClosureTable& t) { return t.name == type; });
  if (it == tables.end() || given == "principled3" || given == "principled4" || given == "facet_fibre") {
    r.fail("type", "the type of a closure (docs/graphs.md)", '"' + given + '"');
  }
  spec.kind = static_cast<ClosureKind>(it - tables.begin());
  using K = ClosureKind;
  switch (spec.kind) {
    case K::glossy:
    case K::refraction:
    case K::glass:
    case K::metallic:
    case K::principled3:
    case K::principled4:
      spec.distribution = static_cast<ClosureDistribution>(r.choice("distribution", kDistributions, 0));
      break;
    case K::toon:
      if (r.choice("component", kComponents, 0) == 1) spec.variant = ClosureVariant::kGlossyToon;
      break;
    case K::hair:
      if (r.choice("component", kHairComponents, 0) == 1) spec.variant = ClosureVariant::kHairThrough;
      break;
    case K::fibre:
    case K::facet_fibre:
      spec.pigment = static_cast<FibrePigment>(r.choice("pigment", kPigments, 0));
      break;
    default:
      break;
  }
  if (spec.kind == K::metallic && r.choice("fresnel", kFresnels, 0) == 1) spec.variant = ClosureVariant::kPhysicalMetal;
  if (spec.kind == K::subsurface) {
    spec.subsurface = static_cast<SubsurfaceMethod>(r.choice("method", kSubsurfaceMethods, 0));
  } else if (spec.kind == K::principled3 || spec.kind == K::principled4) {
    spec.subsurface = static_cast<SubsurfaceMethod>(r.choice("subsurfaceMethod", kSubsurfaceMethods, 0));
  }
  return spec;
}

}  // namespace

std::vector<SurfaceClosureSpec> closures_read(const JsonReader& reader,
                                              const GraphInputReader& input,
                                              GraphBuilder& build,
                                              Warnings& warnings)
{
  if (!reader.has("closures") || !reader.raw("closures").is_array()) reader.fail("closures", "an array");
  const nlohmann::json& list = reader.raw("closures");
  std::vector<SurfaceClosureSpec> closures;
  int lobes = 0;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const JsonReader r(list[i], reader.file(), json_path_join(json_path_join(reader.path(), "closures"), i));
    SurfaceClosureSpec spec = read_closure(r);
    const ClosureTable& table = closure_tables()[static_cast<std::size_t>(spec.kind)];
    lobes += table.most_lobes;
    if (lobes > kMostMixtureLobes) {
      r.fail("", "closures of at most " + std::to_string(kMostMixtureLobes) + " lobes together",
             "one that is too many");
    }
    const GraphValue weight = input(r, "weight", GraphType::kNumber);
    float known = 0;
    const GraphScalar w = weight.v[0].index >= 0 ? weight.v[0] : build.constant(1.0f);
    const bool is_nothing = build.is_constant(w, &known) && known == 0.0f;
    std::vector<GraphScalar> results{w};
    for (const ClosureInput& socket : table.inputs) {
      const bool is_number = socket.kind == InputKind::kNumber;
      const GraphType type = is_number                          ? GraphType::kNumber
                             : socket.kind == InputKind::kColor ? GraphType::kColor
                                                                : GraphType::kVector;
      const GraphValue value = input(r, socket.name, type);
      for (std::size_t c = 0; c < (is_number ? 1u : 3u); ++c) {
        const bool is_given = value.v[c].index >= 0;
        const GraphScalar given = is_given ? value.v[c] : build.constant(socket.value[c]);
        results.push_back(socket.kind == InputKind::kVector ? build.unfiltered(given) : given);
      }
    }
    r.warn_unread(warnings);
    if (is_nothing) continue;
    spec.first_result = build.add_result(w);
    for (const GraphScalar a : build.guarded(std::span(results).subspan(1), w)) build.add_result(a);
    closures.push_back(spec);
  }
  reader.warn_unread(warnings);
  return closures;
}

ClosureSummary closures_summarize(const GraphProgram& program)
{
  ClosureSummary summary;
  for (const SurfaceClosureSpec& closure : program.closures) {
    /// A closure's input, or `otherwise` where it varies.
    const auto known = [&](std::string_view name, float otherwise) {
      std::size_t place = closure.first_result + 1u;
      for (const ClosureInput& input : closure_tables()[static_cast<std::size_t>(closure.kind)].inputs) {
        if (input.name == name) break;
        place += input.kind == InputKind::kNumber ? 1 : 3;
      }
      const std::uint16_t operand = program.results[place];
      return operand < kMostGraphRegisters ? otherwise : program.constants[operand - kMostGraphRegisters];
    };
    bool reflects = false, refracts = false;
    switch (closure.kind) {
      case ClosureKind::subsurface:
        summary.scatters_below = true;
        break;
      case ClosureKind::glossy:
      case ClosureKind::metallic:
        reflects = true;
        break;
      case ClosureKind::glass:
      case ClosureKind::refraction:
        refracts = true;
        break;
      case ClosureKind::principled3:
        reflects = known("metallic", 0) >= 0.5f;
        refracts = known("transmission", 1) > 0;
        summary.scatters_below = summary.scatters_below || known("subsurface", 1) > 0;
        break;
      case ClosureKind::principled4:
        reflects = known("metallic", 0) >= 0.5f;
        refracts = known("transmissionWeight", 1) > 0;
        summary.scatters_below = summary.scatters_below || known("subsurfaceWeight", 1) > 0;
        break;
      default:
        break;
    }
    if (!reflects && !refracts) continue;
    if (refracts) summary.transmission = 1;
    if (reflects) summary.metallic = 1;
    const bool is_sharp = closure.distribution == ClosureDistribution::kSharp;
    summary.roughness = std::min(summary.roughness, is_sharp ? 0.0f : std::abs(known("roughness", 0)));
  }
  return summary;
}

}  // namespace relief
