#include "scene/graph/volume_reader.h"

#include <array>
#include <span>
#include <string>

namespace relief {

std::vector<VolumeClosureSpec> volume_closures_read(const JsonReader& reader,
                                                    const GraphInputReader& input,
                                                    GraphBuilder& build,
                                                    Warnings& warnings)
{
  if (!reader.has("closures") || !reader.raw("closures").is_array()) reader.fail("closures", "an array");
  static constexpr auto kChoices = std::to_array<std::string_view>({
#define VOLUME_CLOSURE(name, Type) Type::kName,
#include "kernel/volume/volume_closures.inc"
  });
  const nlohmann::json& list = reader.raw("closures");
  std::vector<VolumeClosureSpec> closures;
  int phases = 0;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const JsonReader r(list[i], reader.file(), json_path_join(json_path_join(reader.path(), "closures"), i));
    if (!r.has("type")) r.fail("type", "the type of a closure of volumes (docs/graphs.md)", "none");
    const auto kind = static_cast<VolumeClosureKind>(r.choice("type", kChoices, 0));
    phases += volume_closure_visit(kind, [](auto type) { return type.kPhases; });
    if (phases > kMostPhases) {
      r.fail("", "at most " + std::to_string(kMostPhases) + " phase functions", "one that is too many");
    }
    const GraphValue given_weight = input(r, "weight", GraphType::kNumber);
    const GraphScalar weight = given_weight.v[0].index >= 0 ? given_weight.v[0] : build.constant(1.0f);
    VolumeClosureSpec spec{kind, build.add_result(weight)};
    const auto inputs =
        volume_closure_visit(kind, [](auto type) { return std::span<const VolumeInput>(type.kInputs); });
    for (const VolumeInput& socket : inputs) {
      const GraphValue value = input(r, socket.name, socket.is_color ? GraphType::kColor : GraphType::kNumber);
      for (std::size_t c = 0; c < (socket.is_color ? 3u : 1u); ++c) {
        const bool is_given = value.v[c].index >= 0;
        const GraphScalar a = is_given ? value.v[c] : build.constant(socket.value);
        float known = 0;
        if (build.is_constant(a, &known) && known < 0.0f && !socket.is_signed) {
          warnings.add(r.file() + ": " + json_path_join(r.path(), socket.name) + ": below 0, which counts as 0");
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
  graph_program_run(view, nullptr, registers);
  return medium_resolve(volume.closures, {&view, &registers, 0});
}

}  // namespace relief
