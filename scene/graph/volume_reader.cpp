#include "scene/graph/volume_reader.h"

#include <array>
#include <span>
#include <string>

namespace relief {
namespace {

struct VolumeInput {
  std::string_view name;
  bool is_color = false;
  std::array<float, 3> value{};
};

/// A closure's name in files and its inputs, the first two of which are a colour and a number.
struct VolumeTable {
  std::string_view name;
  std::span<const VolumeInput> inputs;
};

constexpr std::array<float, 3> all(float value) { return {value, value, value}; }

constexpr VolumeInput kAbsorptionInputs[] = {{"color", true, all(0.8f)}, {"density", false, all(1)}};
constexpr VolumeInput kScatterInputs[] = {{"color", true, all(0.8f)},
                                          {"density", false, all(1)},
                                          {"anisotropy", false, all(0)}};
constexpr VolumeInput kPrincipledInputs[] = {{"color", true, all(0.5f)},
                                             {"density", false, all(1)},
                                             {"anisotropy", false, all(0)},
                                             {"absorptionColor", true, all(0)},
                                             {"emissionStrength", false, all(0)},
                                             {"emissionColor", true, all(1)},
                                             {"blackbodyIntensity", false, all(0)},
                                             {"blackbodyTint", true, all(1)},
                                             {"temperature", false, all(1000)}};
constexpr VolumeInput kEmissionInputs[] = {{"color", true, all(1)}, {"strength", false, all(1)}};

/// In the order of VolumeClosureKind.
constexpr VolumeTable kTables[] = {{"absorption", kAbsorptionInputs},
                                   {"scatter", kScatterInputs},
                                   {"principled", kPrincipledInputs},
                                   {"emission", kEmissionInputs}};

}  // namespace

std::vector<VolumeClosureSpec> volume_closures_read(const JsonReader& reader,
                                                    const GraphInputReader& input,
                                                    GraphBuilder& build,
                                                    Warnings& warnings)
{
  if (!reader.has("closures") || !reader.raw("closures").is_array()) reader.fail("closures", "an array");
  static constexpr std::string_view kNames[] = {kTables[0].name, kTables[1].name, kTables[2].name, kTables[3].name};
  const nlohmann::json& list = reader.raw("closures");
  std::vector<VolumeClosureSpec> closures;
  int phases = 0;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const JsonReader r(list[i], reader.file(), json_path_join(json_path_join(reader.path(), "closures"), i));
    if (!r.has("type")) r.fail("type", "the type of a closure of volumes (docs/graphs.md)", "none");
    const auto kind = static_cast<VolumeClosureKind>(r.choice("type", kNames, 0));
    phases += volume_closure_phases(kind);
    if (phases > kMostPhases) {
      r.fail("", "at most " + std::to_string(kMostPhases) + " closures that scatter", "one that is too many");
    }
    const GraphValue given_weight = input(r, "weight", GraphType::kNumber);
    const GraphScalar weight = given_weight.v[0].index >= 0 ? given_weight.v[0] : build.constant(1.0f);
    VolumeClosureSpec spec{kind, build.add_result(weight)};
    for (const VolumeInput& socket : kTables[static_cast<std::size_t>(kind)].inputs) {
      const GraphValue value = input(r, socket.name, socket.is_color ? GraphType::kColor : GraphType::kNumber);
      for (std::size_t c = 0; c < (socket.is_color ? 3u : 1u); ++c) {
        const bool is_given = value.v[c].index >= 0;
        const GraphScalar a = is_given ? value.v[c] : build.constant(socket.value[c]);
        float known = 0;
        const bool is_signed = kind == VolumeClosureKind::kEmission || socket.name == "anisotropy" ||
                               socket.name == "blackbodyTint" || socket.name == "emissionColor";
        if (build.is_constant(a, &known) && known < 0.0f && !is_signed) {
          warnings.add(r.file() + ": " + json_path_join(r.path(), std::string(socket.name)) +
                       ": below 0, which counts as 0");
        }
        build.add_result(a);
      }
    }
    r.warn_unread(warnings);
    closures.push_back(spec);
  }
  reader.warn_unread(warnings);
  return closures;
}

bool medium_is_even(const VolumeProgram& volume)
{
  return volume.program.inputs.empty() && graph_textures(volume.program).empty() && volume.program.voxels.empty();
}

Medium medium_of(const VolumeProgram& volume)
{
  const GraphProgramView view = volume.program.view();
  GraphRegisters registers;
  graph_program_run(view, registers);
  return medium_resolve(volume.closures, {&view, &registers, 0});
}

}  // namespace relief
