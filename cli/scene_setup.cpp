#include "cli/scene_setup.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "cli/arguments.h"
#include "scene/diagnostics.h"

namespace relief {

void refuse_warnings(const std::string& file, const std::vector<std::string>& warnings)
{
  if (warnings.empty()) return;
  throw SceneError(file, "", "no warnings (--strict)", fmt::format("{}, first: {}", warnings.size(), warnings.front()));
}

Camera camera_for_image(const Scene& scene, const std::string& name, int width, int height)
{
  auto found = scene.cameras.begin();
  if (!name.empty()) {
    found =
        std::find_if(scene.cameras.begin(), scene.cameras.end(), [&](const SceneCamera& c) { return c.name == name; });
  }
  if (found == scene.cameras.end()) {
    std::string names;
    for (const SceneCamera& camera : scene.cameras)
      names += fmt::format("{}'{}'", names.empty() ? "" : ", ", camera.name);
    throw CLI::ValidationError("--camera", fmt::format("expected one of {}, found '{}'", names, name));
  }
  Camera camera = found->camera;
  camera.half_width = camera.half_height * static_cast<float>(width) / static_cast<float>(height);
  return camera;
}

void add_displacement_method(CLI::App& command, DisplacementOptions& options)
{
  const auto set = [&options](const std::string& text) {
    const auto* found = std::find(std::begin(kDisplacementMethodLabels), std::end(kDisplacementMethodLabels), text);
    options.method = static_cast<DisplacementMethod>(found - std::begin(kDisplacementMethodLabels));
  };
  command
      .add_option_function<std::string>("--displacement", set, "How displaced meshes are traced (default: the scene's)")
      ->check(one_of(displacement_method_names()));
}

void add_displacement_memory(CLI::App& command, DisplacementOptions& options)
{
  const auto set = [&options](double gib) {
    options.auto_bytes = static_cast<std::uint64_t>(gib * static_cast<double>(1 << 30));
  };
  command
      .add_option_function<double>("--displacement-memory", set,
                                   "GiB that --displacement auto may use for tessellations where they save time")
      ->check(number(0, 1e6));
}

void add_displacement_lod(CLI::App& command, DisplacementOptions& options)
{
  const auto set = [&options](const std::string& text) { options.lod = parse_lod(text); };
  command.add_option_function<std::string>(
      "--lod", set, "Level of the height maps, 0 the finest; auto: what the pixels can show (default: the scene's)");
}

void add_caustics_mode(CLI::App& command, std::optional<CausticsMode>& mode)
{
  const auto set = [&mode](const std::string& text) {
    const auto* found = std::find(std::begin(kCausticsModeLabels), std::end(kCausticsModeLabels), text);
    mode = static_cast<CausticsMode>(found - std::begin(kCausticsModeLabels));
  };
  command
      .add_option_function<std::string>(
          "--caustics", set,
          "Photons for caustics: auto (where something casts them), on, or off (default: the scene's)")
      ->check(one_of({std::begin(kCausticsModeLabels), std::end(kCausticsModeLabels)}));
}

}  // namespace relief
