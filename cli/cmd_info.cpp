#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/commands.h"
#include "cli/memory_option.h"
#include "cli/picture_info.h"
#include "cli/scene_setup.h"
#include "cli/standard_streams.h"
#include "cli/value_hint.h"
#include "displacement/method.h"
#include "displacement/seams.h"
#include "integrator/border_seams.h"
#include "integrator/scene_context.h"
#include "integrator/scene_displacement.h"
#include "kernel/feature_mask.h"
#include "scene/displaced_mesh.h"
#include "scene/load.h"
#include "scene/setting_values.h"
#include "scene/texture_store.h"

namespace relief {

namespace {

/// Prints one line; what is in it may come from the scene.
template <class... Values>
void line(fmt::format_string<Values...> format, Values&&... values)
{
  print_line(fmt::format(format, std::forward<Values>(values)...));
}

std::string megabytes(std::size_t bytes) { return fmt::format("{:.1f} MiB", static_cast<double>(bytes) / (1 << 20)); }

void print_names(const char* what, const std::vector<std::string>& names, std::size_t most = 12)
{
  std::string list;
  for (std::size_t i = 0; i < std::min(names.size(), most); ++i) {
    list += fmt::format("{} {}", i == 0 ? "" : ",", names[i].empty() ? "(unnamed)" : names[i]);
  }
  line("{} ({}):{}{}", what, names.size(), list, names.size() > most ? ", …" : "");
}

const char* label(HeightFormat format)
{
  return format == HeightFormat::kU8 ? "8-bit" : format == HeightFormat::kU16 ? "16-bit" : "float";
}

const char* label(Wrap wrap) { return wrap == Wrap::kRepeat ? "repeat" : wrap == Wrap::kMirror ? "mirror" : "clamp"; }

void print_height_maps(const Scene& scene, const std::vector<HeightRange>& ranges)
{
  line("height maps: {}", scene.height_maps.size());
  for (std::size_t i = 0; i < scene.height_maps.size(); ++i) {
    const HeightMap& map = scene.height_maps[i];
    line("  {}: {}x{}, {}, {}, heights {:.6g} to {:.6g}, wrap {}, {}", map.label, map.width, map.height,
         label(map.format), megabytes(map.bytes()), ranges[i].low, ranges[i].high, label(map.wrap_u),
         label(map.wrap_v));
  }
}

/// Names of the materials that share the displacement.
std::string material_names(const Scene& scene, int displacement_index)
{
  std::string names;
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    if (scene.materials[i].displacement_index == displacement_index) {
      const std::string& name = scene.material_names[i];
      names += fmt::format("{}{}", names.empty() ? "" : ", ", name.empty() ? "(unnamed)" : name);
    }
  }
  return names;
}

std::string text(const SeamExtent& seams)
{
  return fmt::format("{} edges, {:g} m, gap up to {:g} m", seams.num_edges, seams.length, seams.largest_gap);
}

/// The seams of all meshes that a displacement moves.
SeamReport seams_of(const DisplacementSet& displacements, int displacement_index)
{
  SeamReport sum;
  for (std::size_t i = 0; i < displacements.size(); ++i) {
    if (displacements.displacement_index(i) != displacement_index) continue;
    const SeamReport found = displacements.seams(i);
    sum.all = seam_extent_sum(sum.all, found.all);
    sum.split = seam_extent_sum(sum.split, found.split);
  }
  return sum;
}

/// @param borders  of its meshes with those of other materials
void print_displacement(const Scene& scene,
                        const DisplacementSet& displacements,
                        const BorderReport& borders,
                        int index)
{
  const DisplacementSettings& d = scene.displacements[static_cast<std::size_t>(index)];
  std::size_t num_meshes = 0;
  UvBounds uv;
  for (const MeshDisplacement& displaced : displaced_meshes(scene)) {
    if (displaced.displacement_index != index) continue;
    const Mesh& mesh = scene.meshes[static_cast<std::size_t>(displaced.mesh_index)];
    ++num_meshes;
    if (d.height.texture_index >= 0) uv = uv_bounds_union(uv, displaced_mesh_uv_bounds(mesh, d.height));
  }
  std::string heights = d.by_vectors ? "vectors" : d.graph_index >= 0 ? "computed heights" : "no heights";
  if (d.height.texture_index >= 0) heights = scene.height_maps[static_cast<std::size_t>(d.height.texture_index)].label;
  line("  {}: {}{}, method {}, scale {:g} m, midlevel {:g}, {} space", material_names(scene, index), heights,
       d.curved ? " over a curved base" : "", displacement_method_label(d.method), d.scale, d.midlevel,
       d.space == DisplacementSpace::kWorld ? "world" : "object");
  std::string covered;
  if (uv.low.x <= uv.high.x) {
    covered = fmt::format(", uv {:g} to {:g}, {:g} to {:g}", uv.low.x, uv.high.x, uv.low.y, uv.high.y);
  }
  line("    meshes: {}{}", num_meshes, covered);
  if (borders.all.num_edges > 0) {
    line("    borders with other materials: {}", text(borders.all));
    line("      left open: {}", text(borders.open));
  }
  if (displacement_is_computed(d)) return;
  const SeamReport seams = seams_of(displacements, index);
  line("    uv seams with different heights: {}", text(seams.all));
  if (d.weld_seams) line("      left open by welding: {}", text(seams.split));
}

void print_displacements(const Scene& scene, const DisplacementSet& displacements)
{
  std::vector<HeightRange> ranges;
  for (const HeightMap& map : scene.height_maps) ranges.push_back(height_map_range(map.view()));
  print_height_maps(scene, ranges);
  line("displacements: {}", scene.displacements.size());
  const std::vector<BorderReport> borders = border_seams(scene, displacements);
  for (std::size_t i = 0; i < scene.displacements.size(); ++i) {
    print_displacement(scene, displacements, borders[i], static_cast<int>(i));
  }
}

/// What displacement costs to trace, and what of it could not be prepared.
void print_prepared(const DisplacementSet& displacements, const Statistics& stats)
{
  const DisplacedMeshReport report = displacements.report();
  line("displaced geometries: {}, traced by {}, {}", stats.displacement.num_geometries, stats.displacement.method,
       megabytes(stats.displacement.bytes));
  line("  prisms: {}; folded (slower to trace) {}, with normals that cancel {}, without a normal {}",
       stats.displacement.num_prisms, report.num_folded, report.num_short_normals, report.num_degenerate);
  if (report.num_walls > 0) line("  walls along seams: {}, one a side", report.num_walls);
  for (const std::string& reason : displacements.reasons()) line("  {}", reason);
}

/// A limit as JSON; null: there is none.
nlohmann::ordered_json limit_json(double limit)
{
  if (!std::isfinite(limit)) return nullptr;
  // Whole ones without a decimal point.
  if (limit == std::floor(limit)) return static_cast<std::int64_t>(limit);
  return limit;
}

/// Prints a JSON array, an entry a line.
int print_entries(const std::vector<nlohmann::ordered_json>& entries)
{
  line("[");
  for (const nlohmann::ordered_json& entry : entries)
    line("  {}{}", entry.dump(), &entry == &entries.back() ? "" : ",");
  line("]");
  return 0;
}

/// Prints every setting that RELIEF_render may have.
int print_declared_settings()
{
  std::vector<nlohmann::ordered_json> entries;
  for (const SettingValue& setting : setting_values({})) {
    const auto& [name, type, range, description] = *setting.info;
    nlohmann::ordered_json allowed;
    if (type == SettingType::kChoice) {
      allowed = range.labels;
    } else if (type != SettingType::kText) {
      allowed = {limit_json(range.low), limit_json(range.high)};
    }
    entries.push_back({{"name", name},
                       {"type", kSettingTypeLabels[static_cast<std::size_t>(type)]},
                       {"default", setting.fallback},
                       {"range", allowed},
                       {"description", description}});
  }
  return print_entries(entries);
}

/// Prints the methods that displaced meshes may be traced by.
int print_declared_methods()
{
  std::vector<nlohmann::ordered_json> entries;
  entries.push_back({{"name", displacement_method_label(DisplacementMethod::kAuto)},
                     {"title", "Automatic"},
                     {"description", "The program chooses"}});
  for (const DisplacementMethod method : kDisplacementMethods) {
    const DisplacementMethodEntry& entry = displacement_method(method);
    entries.push_back(
        {{"name", displacement_method_label(method)}, {"title", entry.title}, {"description", entry.description}});
  }
  return print_entries(entries);
}

/// The scene's settings that are not what they are where nobody says anything.
std::string changed_settings(const RenderSettings& settings)
{
  std::string text;
  for (const SettingValue& setting : setting_values(settings)) {
    if (setting.value == setting.fallback) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", setting.info->name, setting_text(setting.value));
  }
  return text.empty() ? "as by default" : text;
}

/// What the materials of a scene's instances ask of the kernels, and what else costs something that no other line counts.
std::string features(const Scene& scene)
{
  unsigned mask = 0;
  std::size_t num_casters = 0;
  for (std::size_t i = 0; i < scene.num_placed(); ++i) {
    const Instance& instance = scene.instances[i];
    mask |= feature_mask_of(scene.materials[static_cast<std::size_t>(instance.material_index)]);
    num_casters += (instance.flags & kCausticCaster) != 0 ? 1 : 0;
  }
  std::string text;
  for (std::size_t bit = 0; bit < kFeatureNames.size(); ++bit) {
    if ((mask >> bit & 1u) != 0) text += fmt::format("{}{}", text.empty() ? "" : ", ", kFeatureNames[bit]);
  }
  const auto num_apertures = std::count_if(scene.cameras.begin(), scene.cameras.end(),
                                           [](const SceneCamera& c) { return c.camera.aperture_radius > 0; });
  return fmt::format("{}; caustic casters {}, value graphs {}, open apertures {}", text.empty() ? "none" : text,
                     num_casters, scene.graphs.size(), num_apertures);
}

int info(const std::string& file,
         bool strict,
         const SceneSetup& setup,
         DisplacementOptions displacement,
         std::optional<CausticsMode> caustics)
{
  Scene scene = scene_load(file, setup.load_options());
  if (caustics) scene.render.caustics.mode = *caustics;
  displacement.num_rays = expected_rays(scene.render);
  const SceneContext context(scene, displacement, EnvironmentDensity::kExcess, scene.render.caustics);
  std::vector<std::string> warnings = scene.warnings;
  for (std::string& text : displacement_warnings(scene, displacement)) warnings.push_back(std::move(text));
  for (std::string& text : context.displacements.warnings()) warnings.push_back(std::move(text));
  Statistics stats;
  context.fill(stats);

  std::size_t triangles = 0;
  std::size_t placed = 0;
  for (const Mesh& mesh : scene.meshes) triangles += mesh.triangles.size();
  for (const Border& border : scene.borders) triangles -= border.edges.size();
  for (std::size_t i = 0; i < scene.num_placed(); ++i) {
    placed += scene.meshes[static_cast<std::size_t>(scene.instances[i].mesh_index)].triangles.size();
  }
  const RenderSettings& r = scene.render;
  line("{}", file);
  line("image: {}x{}, {} samples, {} bounces, seed {}", r.width, r.height, r.samples, r.max_bounces, r.seed);
  line("settings: {}", changed_settings(r));
  line("frames: {} to {} at {:g} a second", r.frame_start, r.frame_end, r.frames_per_second);
  line("meshes: {} with {} triangles; instances: {} with {} triangles in all",
       scene.meshes.size() - scene.borders.size(), triangles, scene.num_placed(), placed);
  for (const AnimationClip& clip : scene.clips) {
    line("  clip {}: {:g} s, from {:g} to {:g} s", clip.name.empty() ? "(unnamed)" : clip.name, clip.end - clip.start,
         clip.start, clip.end);
  }
  if (!scene.instances.empty()) {
    const Vec3f low = scene.bounds_low, high = scene.bounds_high;
    line("bounding box: {:g} {:g} {:g} to {:g} {:g} {:g} m", low.x, low.y, low.z, high.x, high.y, high.z);
  }
  // Those that RELIEF_reference may override.
  constexpr std::size_t kMostNodes = 100;
  print_names("named nodes", scene.node_names, kMostNodes);
  std::vector<std::string> cameras;
  for (const SceneCamera& camera : scene.cameras) cameras.push_back(camera.name);
  print_names("cameras", cameras);
  print_names("materials", scene.material_names);
  line("lights: {} placed, {} emissive triangles, {}", scene.lights.size(), context.lights.num_emissive_triangles,
       scene.environment.texture_index >= 0 ? "environment map"
       : scene.environment.graph            ? "environment by graph"
       : is_zero(scene.environment.color)   ? "no environment"
                                            : "constant environment");
  const std::size_t num_textures = scene.textures->views().size();
  line("textures: {}", num_textures);
  for (std::size_t i = 0; i < num_textures; ++i) {
    const TextureView& view = scene.textures->views()[i];
    line("  {}: {}x{}, {} channel{}{}", scene.textures->label(static_cast<int>(i)), view.width, view.height,
         view.num_channels, view.num_channels == 1 ? "" : "s",
         scene.textures->is_cached(static_cast<int>(i)) ? ", through the tile cache" : "");
  }
  if (!scene.displacements.empty()) print_displacements(scene, context.displacements);
  if (stats.displacement.num_geometries > 0) print_prepared(context.displacements, stats);
  const char* photons = r.caustics.mode == CausticsMode::kAuto ? "photons where they pay" : "photons";
  line("caustics: {} ({})", context.globals.caustics.enabled ? photons : "none", context.caustics_reason);
  line("features: {}", features(scene));
  line(
      "memory: meshes {}, textures {}, height maps {}, displacement {}, acceleration structure {}, lights "
      "{}",
      megabytes(stats.mesh_bytes), megabytes(stats.texture_bytes), megabytes(height_map_bytes(scene.height_maps)),
      megabytes(stats.displacement.bytes), megabytes(stats.bvh_bytes), megabytes(stats.light_bytes));
  for (const std::string& warning : warnings) line("warning: {}", warning);
  if (strict) refuse_warnings(file, warnings);
  return 0;
}

}  // namespace

void cmd_info_register(CLI::App& app, Run& run)
{
  struct Arguments {
    std::string scene;
    bool strict = false, settings = false, methods = false;
    SceneSetup setup;
    DisplacementOptions displacement;
    std::optional<CausticsMode> caustics;
  };
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("info", "Shows what is in a scene, what it will cost, and every warning; or what a picture says of itself");
  CLI::Option* scene = names_file(command->add_option("scene", arguments->scene, "Scene or OpenEXR picture to show"), {".gltf", ".glb", ".exr"});
  CLI::Option* settings =
      command->add_flag("--settings", arguments->settings, "Prints all settings that RELIEF_render may have, as JSON")
          ->excludes(scene);
  command
      ->add_flag("--methods", arguments->methods, "Prints the methods that displaced meshes can be traced by, as JSON")
      ->excludes(scene)
      ->excludes(settings);
  command->add_flag("--strict", arguments->strict, "Turn warnings into errors");
  add_light_options(*command, arguments->setup);
  add_displacement_method(*command, arguments->displacement);
  add_displacement_memory(*command, arguments->displacement);
  add_caustics_mode(*command, arguments->caustics);
  add_continue_without_textures(*command, arguments->setup);
  add_max_memory(*command);
  command->callback([&run, arguments] {
    if (arguments->settings || arguments->methods) {
      run = arguments->settings ? print_declared_settings : print_declared_methods;
      return;
    }
    if (arguments->scene.empty()) throw CLI::RequiredError("scene");
    run = [arguments] {
      if (is_exr_file(arguments->scene)) return picture_info(arguments->scene);
      return info(arguments->scene, arguments->strict, arguments->setup, arguments->displacement, arguments->caustics);
    };
  });
}

}  // namespace relief
