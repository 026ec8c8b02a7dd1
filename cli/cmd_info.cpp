#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/scene_setup.h"
#include "integrator/scene_context.h"
#include "scene/displaced_mesh.h"
#include "scene/displacement_seams.h"
#include "scene/load.h"
#include "scene/texture_store.h"

namespace relief {

namespace {

struct FeatureName {
  bool FeatureSet::*present;
  const char* name;
};

constexpr FeatureName kFeatureNames[] = {
    {&FeatureSet::textures, "textures"},
    {&FeatureSet::normal_maps, "normal maps"},
    {&FeatureSet::transparency, "transparency"},
    {&FeatureSet::transmission, "transmission"},
    {&FeatureSet::volume, "volume"},
    {&FeatureSet::clearcoat, "clearcoat"},
    {&FeatureSet::sheen, "sheen"},
    {&FeatureSet::metal, "metal"},
    {&FeatureSet::displacement, "displacement"},
    {&FeatureSet::environment_map, "environment map"},
    {&FeatureSet::environment, "environment"},
    {&FeatureSet::mesh_lights, "mesh lights"},
    {&FeatureSet::area_lights, "area lights"},
    {&FeatureSet::delta_lights, "delta lights"},
    {&FeatureSet::many_lights, "many lights"},
    {&FeatureSet::instances, "instances"},
    {&FeatureSet::depth_of_field, "depth of field"},
    {&FeatureSet::caustic_casters, "caustic casters"},
};

std::string megabytes(std::size_t bytes) { return fmt::format("{:.1f} MiB", static_cast<double>(bytes) / (1 << 20)); }

void print_names(const char* what, const std::vector<std::string>& names)
{
  constexpr std::size_t kMost = 12;
  fmt::print("{} ({}):", what, names.size());
  for (std::size_t i = 0; i < std::min(names.size(), kMost); ++i) {
    fmt::print("{} {}", i == 0 ? "" : ",", names[i].empty() ? "(unnamed)" : names[i]);
  }
  fmt::print("{}\n", names.size() > kMost ? ", …" : "");
}

const char* label(HeightFormat format)
{
  return format == HeightFormat::kU8 ? "8-bit" : format == HeightFormat::kU16 ? "16-bit" : "float";
}

const char* label(Wrap wrap) { return wrap == Wrap::kRepeat ? "repeat" : wrap == Wrap::kMirror ? "mirror" : "clamp"; }

void print_height_maps(const Scene& scene, const std::vector<HeightRange>& ranges)
{
  fmt::print("height maps: {}\n", scene.height_maps.size());
  for (std::size_t i = 0; i < scene.height_maps.size(); ++i) {
    const HeightMap& map = scene.height_maps[i];
    fmt::print("  {}: {}x{}, {}, {}, heights {:.6g} to {:.6g}, wrap {}, {}\n", map.label, map.width, map.height,
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

void print_displacement(const Scene& scene, int index, const std::vector<HeightRange>& ranges)
{
  const DisplacementSettings& d = scene.displacements[static_cast<std::size_t>(index)];
  const auto map_index = static_cast<std::size_t>(d.height.texture_index);
  std::size_t num_meshes = 0;
  UvBounds uv;
  DisplacementSeams seams;
  for (const MeshDisplacement& displaced : displaced_meshes(scene)) {
    if (displaced.displacement_index != index) continue;
    const Mesh& mesh = scene.meshes[static_cast<std::size_t>(displaced.mesh_index)];
    ++num_meshes;
    uv = uv_bounds_union(uv, displaced_mesh_uv_bounds(mesh, d.height));
    const DisplacementSeams found = displacement_seams(mesh, d, scene.height_maps[map_index].view(), ranges[map_index]);
    seams.all = seam_extent_sum(seams.all, found.all);
    seams.split = seam_extent_sum(seams.split, found.split);
  }
  fmt::print("  {}: {}, method {}, scale {:g} m, midlevel {:g}, {} space\n", material_names(scene, index),
             scene.height_maps[map_index].label, kDisplacementMethodLabels[static_cast<std::size_t>(d.method)], d.scale,
             d.midlevel, d.space == DisplacementSpace::kWorld ? "world" : "object");
  fmt::print("    meshes: {}", num_meshes);
  if (uv.low.x <= uv.high.x) {
    fmt::print(", uv {:g} to {:g}, {:g} to {:g}", uv.low.x, uv.high.x, uv.low.y, uv.high.y);
  }
  fmt::print("\n    uv seams with different heights: {}\n", text(seams.all));
  if (d.weld_seams) fmt::print("      left open by welding: {}\n", text(seams.split));
}

void print_displacements(const Scene& scene)
{
  std::vector<HeightRange> ranges;
  for (const HeightMap& map : scene.height_maps) ranges.push_back(height_map_range(map.view()));
  print_height_maps(scene, ranges);
  fmt::print("displacements: {}\n", scene.displacements.size());
  for (std::size_t i = 0; i < scene.displacements.size(); ++i) {
    print_displacement(scene, static_cast<int>(i), ranges);
  }
}

/// What displacement costs to trace, and what of it could not be prepared.
void print_prepared(const DisplacementSet& displacements, const Statistics& stats)
{
  const DisplacedMeshReport report = displacements.report();
  fmt::print("displaced geometries: {}, traced by {}, {}\n", displacements.size(), stats.displacement.method,
             megabytes(stats.displacement.bytes));
  fmt::print("  prisms: {}; folded (slower to trace) {}, with normals that cancel {}, without a normal {}\n",
             stats.displacement.num_prisms, report.num_folded, report.num_short_normals, report.num_degenerate);
  if (report.num_walls > 0) fmt::print("  walls along seams: {}, one a side\n", report.num_walls);
  for (const std::string& reason : displacements.reasons()) fmt::print("  {}\n", reason);
}

int info(const std::string& file, bool strict, DisplacementOptions displacement, std::optional<CausticsMode> caustics)
{
  Scene scene = scene_load(file);
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
  for (const Instance& instance : scene.instances) {
    placed += scene.meshes[static_cast<std::size_t>(instance.mesh_index)].triangles.size();
  }
  const RenderSettings& r = scene.render;
  fmt::print("{}\n", file);
  fmt::print("image: {}x{}, {} samples, {} bounces, seed {}\n", r.width, r.height, r.samples, r.max_bounces, r.seed);
  fmt::print("frames: {} to {} at {:g} a second\n", r.frame_start, r.frame_end, r.frames_per_second);
  fmt::print("meshes: {} with {} triangles; instances: {} with {} triangles in all\n", scene.meshes.size(), triangles,
             scene.instances.size(), placed);
  std::vector<std::string> cameras;
  for (const SceneCamera& camera : scene.cameras) cameras.push_back(camera.name);
  print_names("cameras", cameras);
  print_names("materials", scene.material_names);
  fmt::print("lights: {} placed, {} emissive triangles, {}\n", scene.lights.size(),
             context.lights.num_emissive_triangles,
             scene.environment.texture_index >= 0 ? "environment map"
             : is_zero(scene.environment.color)   ? "no environment"
                                                  : "constant environment");
  const std::size_t num_textures = scene.textures->views().size();
  fmt::print("textures: {}\n", num_textures);
  for (std::size_t i = 0; i < num_textures; ++i) {
    const TextureView& view = scene.textures->views()[i];
    fmt::print("  {}: {}x{}, {} channel{}{}\n", scene.textures->label(static_cast<int>(i)), view.width, view.height,
               view.num_channels, view.num_channels == 1 ? "" : "s",
               scene.textures->is_cached(static_cast<int>(i)) ? ", through the tile cache" : "");
  }
  if (!scene.displacements.empty()) print_displacements(scene);
  if (context.displacements.size() > 0) print_prepared(context.displacements, stats);
  std::string features;
  for (const FeatureName& feature : kFeatureNames) {
    if (scene.features.*feature.present) features += fmt::format("{}{}", features.empty() ? "" : ", ", feature.name);
  }
  fmt::print("caustics: {} ({})\n", context.globals.caustics.enabled ? "photons" : "none", context.caustics_reason);
  fmt::print("features: {}\n", features.empty() ? "none" : features);
  fmt::print(
      "memory: meshes {}, textures {}, height maps {}, displacement {}, acceleration structure {}, lights "
      "{}\n",
      megabytes(stats.mesh_bytes), megabytes(stats.texture_bytes), megabytes(height_map_bytes(scene.height_maps)),
      megabytes(stats.displacement.bytes), megabytes(stats.bvh_bytes), megabytes(stats.light_bytes));
  for (const std::string& warning : warnings) fmt::print("warning: {}\n", warning);
  if (strict) refuse_warnings(file, warnings);
  return 0;
}

}  // namespace

void cmd_info_register(CLI::App& app, Run& run)
{
  struct Arguments {
    std::string scene;
    bool strict = false;
    DisplacementOptions displacement;
    std::optional<CausticsMode> caustics;
  };
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("info", "Shows what is in a scene, what it will cost, and every warning");
  command->add_option("scene", arguments->scene, "Scene file (.gltf, .glb)")->required();
  command->add_flag("--strict", arguments->strict, "Turn warnings into errors");
  add_displacement_method(*command, arguments->displacement);
  add_displacement_memory(*command, arguments->displacement);
  add_caustics_mode(*command, arguments->caustics);
  command->callback([&run, arguments] {
    run = [arguments] {
      return info(arguments->scene, arguments->strict, arguments->displacement, arguments->caustics);
    };
  });
}

}  // namespace relief
