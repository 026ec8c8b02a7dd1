#include "cli/scene_setup.h"

#include <algorithm>
#include <iterator>
#include <numeric>

#include <fmt/format.h>

#include "cli/darkness.h"
#include "cli/value_hint.h"
#include "integrator/stages.h"
#include "scene/diagnostics.h"

namespace relief {

void refuse_warnings(const std::string& file, const std::vector<std::string>& warnings)
{
  if (warnings.empty()) return;
  throw SceneError(file, "", "no warnings (--strict)", fmt::format("{}, first: {}", warnings.size(), warnings.front()));
}

std::vector<int> frames_of(const FrameList& list, const std::string& scene)
{
  if (!list.all) return list.numbers;
  const RenderSettings settings = scene_settings(scene);
  const int first = settings.frame_start, last = settings.frame_end;
  if (first < 0 || last > kLastFrame) {
    throw CLI::ValidationError("--frames", fmt::format("expected a scene whose frames are from 0 to {}, found {} to {}",
                                                       kLastFrame, first, last));
  }
  std::vector<int> frames(static_cast<std::size_t>(last - first + 1));
  std::iota(frames.begin(), frames.end(), first);
  return frames;
}

LoadOptions SceneSetup::load_options(std::optional<int> frame) const
{
  LoadOptions options;
  options.has_frame = frame.has_value();
  options.frame = frame.value_or(0);
  options.luminous_efficacy = static_cast<float>(luminous_efficacy);
  options.environment = environment;
  options.continue_without_textures = continue_without_textures;
  options.emission_shows = emission_shows;
  options.run_graph = stage_table_select().run_graph;
  if (!background.empty()) options.environment_visible = background == "world";
  return options;
}

std::string SceneSetup::environment_file() const
{
  return environment && environment->source == EnvironmentSource::kFile ? environment->file : "";
}

void add_continue_without_textures(CLI::App& command, SceneSetup& setup)
{
  command.add_flag("--continue-without-textures", setup.continue_without_textures,
                   "Show images that are missing or broken as magenta, with a warning for each, in place of an error");
}

std::vector<CLI::Option*> add_light_options(CLI::App& command, SceneSetup& setup)
{
  constexpr SettingInfo kEfficacy = setting_info("luminousEfficacy");
  return {
      command.add_option("--luminous-efficacy", setup.luminous_efficacy, setting_help(kEfficacy))
          ->check(setting_check(kEfficacy)),
      names_file(
          add_parsed(
              command, "--environment", setup.environment, parse_environment,
              "studio, sky, none, or a lat-long image: surroundings in place of the scene's; ,STRENGTH may follow"),
          kImageSuffixes)
          ->check(suggested_words({std::begin(kEnvironmentPresetLabels), std::end(kEnvironmentPresetLabels)})),
      command
          .add_option(
              "--background", setup.background,
              "What shows beside the scene: its surroundings (world), black, or nothing (transparent, in the PNG too)")
          ->check(one_of({"world", "black", "transparent"}))};
}

CLI::Option* add_displacement_method(CLI::App& command, DisplacementOptions& options)
{
  const auto set = [&options](const std::string& text) {
    const auto* found = std::find(std::begin(kDisplacementMethodLabels), std::end(kDisplacementMethodLabels), text);
    options.method = static_cast<DisplacementMethod>(found - std::begin(kDisplacementMethodLabels));
  };
  return command
      .add_option_function<std::string>("--displacement", set, "How displaced meshes are traced (default: the scene's)")
      ->check(one_of({std::begin(kDisplacementMethodLabels), std::end(kDisplacementMethodLabels)}));
}

CLI::Option* add_displacement_memory(CLI::App& command, DisplacementOptions& options)
{
  const auto set = [&options](double gib) {
    options.auto_bytes = static_cast<std::uint64_t>(gib * static_cast<double>(1 << 30));
  };
  return command
      .add_option_function<double>("--displacement-memory", set,
                                   "GiB that --displacement auto may use for tessellations where they save time")
      ->check(number(0, 1e6));
}

CLI::Option* add_displacement_error(CLI::App& command, DisplacementOptions& options)
{
  return command
      .add_option(
          "--displacement-error", options.error,
          "Pixels that detail of height maps may be wide and shown by its light alone, for speed (default: 0, none)")
      ->check(number(0, 1e3));
}

CLI::Option* add_displacement_lod(CLI::App& command, DisplacementOptions& options)
{
  const auto set = [&options](const std::string& text) { options.lod = parse_lod(text); };
  return command
      .add_option_function<std::string>(
          "--lod", set, "Level of the height maps, 0 the finest; auto: what the pixels can show (default: the scene's)")
      ->check(suggested_words({"auto"}));
}

CLI::Option* add_displacement_rmip(CLI::App& command, DisplacementOptions& options)
{
  return add_parsed(
      command, "--rmip", options.rmip, parse_rmip,
      "KEY=VALUE,… of RMIP: scale (texels), resolution (of its table), inversion (on, off), split (bound, "
      "ray), leaf (bilinear, triangles), levels (mixed, interpolated), bounds (hull, affine)");
}

CLI::Option* add_caustics_mode(CLI::App& command, std::optional<CausticsMode>& mode)
{
  return add_choice(command, "--caustics", mode, setting_info("caustics.mode"));
}

}  // namespace relief
