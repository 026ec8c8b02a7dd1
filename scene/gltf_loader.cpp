#include "scene/gltf_loader.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <new>
#include <set>
#include <utility>

#include "scene/border_walls.h"
#include "scene/displaced_mesh.h"
#include "scene/framing.h"
#include "scene/gltf_mesh.h"
#include "scene/graph/closure_reader.h"
#include "scene/graph/graph_reader.h"
#include "scene/khronos_extensions.h"
#include "scene/limits.h"
#include "scene/material_traits.h"
#include "scene/memory.h"
#include "scene/relief_extensions.h"
#include "scene/texture_faults.h"
#include "scene/texture_store.h"
#include "scene/world_displacement.h"

namespace relief {
namespace {

std::uint32_t instance_flags(const ObjectSettings& object, const Material& material, const Transform& world)
{
  // What rays for light pass, or may pass, must not send that light on as photons as well; nor what some rays do not see.
  const bool caster =
      object.hidden_from == 0 &&
      ((object.caustic_caster == CausticCaster::kYes && !material.depends_on_ray) ||
       (object.caustic_caster == CausticCaster::kAuto && object.casts_shadow && material_casts_caustics(material)));
  return (object.visible_to_camera ? kVisibleToCamera : 0u) | (object.casts_shadow ? kCastsShadow : 0u) |
         (transform_mirrors(world) ? kMirrored : 0u) | (caster ? kCausticCaster : 0u) |
         (object.caustic_receiver ? kCausticReceiver : 0u) | (object.caustic_light ? 0u : kNoCausticLight) |
         (object.holdout ? kHoldout : 0u) | (object.shadow_catcher ? kShadowCatcher : 0u) |
         object.hidden_from << kHiddenFromShift;
}

/// Texture coordinates that a material's normal maps are laid out in; −1: it has none.
int normal_map_uv_set(const Material& m)
{
  if (m.normal_texture.texture_index >= 0) {
    return m.normal_texture.uv_set;
  }
  return m.clearcoat_normal_texture.texture_index >= 0 ? m.clearcoat_normal_texture.uv_set : -1;
}

/// Where RELIEF_render says nothing of frames, they are those that the animations last for.
void frame_range_from_clips(const GltfDocument& root, const std::vector<AnimationClip>& clips, RenderSettings& settings)
{
  constexpr SettingInfo kFrames = setting_info("frameRange");
  bool is_given = false;
  root.read_extension(root.json, "", "RELIEF_render", [&](const JsonReader& r) { is_given = r.has(kFrames.name); });
  if (is_given || clips.empty()) return;
  double start = clips.front().start, end = clips.front().end;
  for (const AnimationClip& clip : clips) {
    start = std::min(start, clip.start);
    end = std::max(end, clip.end);
  }
  // A key may stand a rounding error beside its frame.
  constexpr double kMargin = 1e-3;
  const auto fps = static_cast<double>(settings.frames_per_second);
  settings.frame_start = static_cast<int>(std::clamp(std::floor(start * fps + kMargin), 0.0, kFrames.range.high));
  settings.frame_end = static_cast<int>(std::clamp(std::ceil(end * fps - kMargin), 0.0, kFrames.range.high));
}

/// Before texels are read.
void add_files(Scene& scene, const std::vector<TextureRequest>& requests)
{
  for (const TextureRequest& request : requests) {
    if (!request.file.empty()) {
      scene.files.push_back(file_stamp(request.file));
    }
  }
}

/// Reads the height maps, once, and points the displacements at them.
/// @param requests  empty, as is `baked`: done before
/// @param baked     maps of height graphs, which come first
void load_height_maps(Scene& scene,
                      const std::vector<TextureRequest>& requests,
                      std::vector<HeightMap> baked,
                      KeptImages* kept,
                      Warnings& warnings)
{
  if (requests.empty() && baked.empty()) return;
  add_files(scene, requests);
  HeightMapSet heights = height_maps_load(requests, warnings, kept);
  for (DisplacementSettings& displacement : scene.displacements) {
    if (displacement.has_graph || displacement.height.texture_index < 0) continue;
    displacement.height.texture_index =
        heights.map_of_request[static_cast<std::size_t>(displacement.height.texture_index)] +
        static_cast<int>(baked.size());
  }
  scene.height_maps = std::move(baked);
  std::move(heights.maps.begin(), heights.maps.end(), std::back_inserter(scene.height_maps));
}

}  // namespace

Scene GltfLoader::load(const std::filesystem::path& path, const LoadOptions& options)
{
  const GltfDocument& root = documents_.load(path, warnings_);
  root_ = &root;
  height_graphs_.run_by(options.run_graph);
  scene_.file = root.file;
  scene_.render = relief_render(root, warnings_);
  if (options.luminous_efficacy > 0) scene_.render.luminous_efficacy = options.luminous_efficacy;
  image_aspect_ = options.camera.image_aspect > 0
                      ? options.camera.image_aspect
                      : static_cast<float>(scene_.render.width) / static_cast<float>(scene_.render.height);
  std::optional<double> time;
  if (options.has_frame) {
    time = open_shutter(options) / static_cast<double>(scene_.render.frames_per_second);
  }
  composition_traverse(documents_, root, time, warnings_, [this](const PlacedNode& node) { place(node); });
  set_environment(options);
  if (!says_light_) unlit_ = placements({});
  // What is made of each later: 440 bytes an instance with 10^6 of one triangle, of which 90 are Embree's; 220 a light.
  constexpr std::uint64_t kInstanceBytes = 512, kLightBytes = 256;
  memory_require(scene_.instances.size() * kInstanceBytes + scene_.lights.size() * kLightBytes,
                 root.file + ": " + std::to_string(scene_.instances.size()) + " instances and " +
                     std::to_string(scene_.lights.size()) + " lights");
  describe();
  set_camera(options);
  const auto chosen = camera_named(scene_.cameras, options.camera.look_from ? "" : options.camera.name);
  const float asked = chosen ? scene_.cameras[*chosen].shutter.frames : 0;
  if (!options.has_frame && !scene_.clips.empty() && options.camera.shutter.value_or(asked) > 0) {
    warnings_.add(scene_.file + ": the shutter is open, but no frame of the animation is asked for: nothing moves");
  }
  const std::vector<FileStamp> files = documents_.files_read();
  scene_.files.insert(scene_.files.begin(), files.begin(), files.end());
  scene_.files.insert(scene_.files.end(), textures_.files_read().begin(), textures_.files_read().end());
  return std::move(scene_);
}

void GltfLoader::set_environment(const LoadOptions& options)
{
  std::optional<Environment> environment;
  if (!options.environment) {
    environment = relief_environment(*root_, textures_, scene_.light_groups, warnings_);
  } else {
    environment.emplace();
    // The scene's own is not read, and may well be what is missing; but no output may take its place.
    try {
      TextureTable replaced;
      std::vector<std::string> groups;
      relief_environment(*root_, replaced, groups, warnings_);
      add_files(scene_, replaced.take());
    } catch (const SceneError&) {
    }
    if (options.environment->source == EnvironmentSource::kFile) {
      environment->color = splat3(options.environment->strength);
      environment->texture_index = textures_.add_path(options.environment->file, "--environment", TextureColor::kSrgb,
                                                      {Wrap::kRepeat, Wrap::kClamp, TexelFilter::kLinear});
    }
  }
  says_light_ = says_light_ || environment.has_value();
  scene_.environment = environment.value_or(Environment{});
}

std::vector<Placement> GltfLoader::placements(std::optional<double> time_seconds)
{
  std::vector<Placement> out;
  Warnings said;  // when the scene was loaded
  composition_traverse(documents_, *root_, time_seconds, said, [&](const PlacedNode& node) {
    const int mesh = node.document->core.nodes[static_cast<std::size_t>(node.node_index)].mesh;
    if (mesh < 0) return;
    std::vector<Transform> copies = khronos_instances(*node.document, node.node_index, said);
    if (copies.empty()) copies.emplace_back();
    for (const Primitive& primitive : primitives_of(*node.document, mesh, nullptr)) {
      const int material_index = placed_material(node, primitive.material_index);
      for (const Transform& copy : copies) {
        const Transform world = node.world * copy;
        if (transform_defect(world) != TransformDefect::kNone) continue;
        out.push_back({primitive.mesh_index, material_index, transform_to_affine(world)});
      }
    }
  });
  return out;
}

void GltfLoader::describe()
{
  std::set<std::string> seen;
  for (const auto& document : documents_.all()) {
    for (const tinygltf::Node& node : document->core.nodes) {
      if (!node.name.empty() && seen.insert(node.name).second) scene_.node_names.push_back(node.name);
    }
    std::vector<AnimationClip> clips = animation_clips(*document);
    scene_.clips.insert(scene_.clips.end(), clips.begin(), clips.end());
  }
  scene_.bounds_low = world_bounds_.low;
  scene_.bounds_high = world_bounds_.high;
  frame_range_from_clips(*documents_.all().front(), scene_.clips, scene_.render);
}

void GltfLoader::place(const PlacedNode& node)
{
  ++num_visited_;
  const tinygltf::Node& source = node.document->core.nodes[static_cast<std::size_t>(node.node_index)];
  if (source.mesh >= 0) {
    place_meshes(node);
  }
  if (source.camera >= 0) {
    place_camera(node);
  }
  place_lights(node);
}

/// Whether something may stand here. What is flat, shrunk to nothing, or beyond the numbers, is left out with a warning.
bool GltfLoader::is_usable(const PlacedNode& node, const Transform& world, const std::string& path)
{
  const TransformDefect defect = transform_defect(world);
  if (defect == TransformDefect::kNone) {
    return true;
  }
  const std::string where = node.defect_path.empty() ? path : node.defect_path;
  warnings_.add(node.document->file + ": " + where + ": " +
                (defect == TransformDefect::kSingular ? "singular transform" : "transform beyond single precision") +
                (node.animated ? " at this frame" : "") + ", left out");
  return false;
}

/// @param extent  largest coordinates, metres
void GltfLoader::check_positions(const PlacedNode& node, const std::string& path, Vec3f extent)
{
  if (!(max_component(extent) <= kFarthest)) {
    throw SceneError(node.document->file, path, "positions within 1e15 m of the origin", "farther ones");
  }
}

void GltfLoader::place_meshes(const PlacedNode& node)
{
  const GltfDocument& document = *node.document;
  const tinygltf::Node& source = document.core.nodes[static_cast<std::size_t>(node.node_index)];
  const std::string path = "/nodes/" + std::to_string(node.node_index);
  const MorphWeights morph{node.weights, shutter_nodes_.weights(num_visited_ - 1)};
  const std::vector<Primitive>& primitives = primitives_of(document, source.mesh, &morph);
  const std::vector<Transform> copies = khronos_instances(document, node.node_index, warnings_);
  const InstanceValues own = node_values(node);
  std::map<std::uint16_t, std::vector<std::array<float, 4>>> of_copies;
  if (!copies.empty()) {
    for (std::size_t place = 0; place < scene_.attribute_names.size(); ++place) {
      auto values = khronos_instance_values(document, node.node_index, scene_.attribute_names[place], copies.size());
      if (!values.empty()) of_copies.emplace(static_cast<std::uint16_t>(place), std::move(values));
    }
  }
  for (const Primitive& primitive : primitives) {
    if (copies.empty()) {
      const std::size_t next = scene_.instances.size();
      place_instance(node, primitive, {}, path);
      if (scene_.instances.size() == next) continue;
      scene_.instances[next].object_index = num_objects_;
      set_values(next, own);
    }
    for (std::size_t copy = 0; copy < copies.size(); ++copy) {
      const std::size_t next = scene_.instances.size();
      place_instance(node, primitive, copies[copy], path + "/extensions/EXT_mesh_gpu_instancing");
      if (scene_.instances.size() == next) continue;
      scene_.instances[next].object_index = num_objects_ + static_cast<int>(copy);
      set_values(next, own);
      for (const auto& [place, values] : of_copies) set_values(next, {{place, values[copy]}});
    }
  }
  num_objects_ += copies.empty() ? 1 : static_cast<int>(copies.size());
}

/// Values of a node's RELIEF_object that graphs read.
GltfLoader::InstanceValues GltfLoader::node_values(const PlacedNode& node) const
{
  InstanceValues out;
  if (node.object.values == nullptr) return out;
  for (const auto& [name, value] : *node.object.values) {
    const auto it = std::find(scene_.attribute_names.begin(), scene_.attribute_names.end(), name);
    if (it == scene_.attribute_names.end()) continue;
    out.emplace(static_cast<std::uint16_t>(it - scene_.attribute_names.begin()), value);
  }
  return out;
}

void GltfLoader::set_values(std::size_t instance_index, const InstanceValues& values)
{
  for (const auto& [place, value] : values) {
    auto column = std::find_if(scene_.instance_columns.begin(), scene_.instance_columns.end(),
                               [name = place](const InstanceColumn& c) { return c.name == name; });
    if (column == scene_.instance_columns.end()) {
      column = scene_.instance_columns.insert(column, {place, {}});
    }
    memory_.add(sizeof(value), scene_.file + ": values of instances");
    column->values.resize(4 * instance_index);
    column->values.insert(column->values.end(), value.begin(), value.end());
  }
}

void GltfLoader::place_instance(const PlacedNode& node,
                                const Primitive& primitive,
                                const Transform& copy,
                                const std::string& path)
{
  const Transform world = node.world * copy;
  if (!is_usable(node, world, path)) {
    return;
  }
  constexpr std::size_t kMostInstances = std::size_t{1} << 24;
  if (scene_.instances.size() >= kMostInstances) {
    throw SceneError(node.document->file, path, "at most " + std::to_string(kMostInstances) + " instances", "more");
  }
  Instance instance;
  const std::string& name = node.document->core.nodes[static_cast<std::size_t>(node.node_index)].name;
  constexpr std::size_t kLongestName = 255;  // every instance holds a copy
  instance.name = name.substr(0, kLongestName);
  instance.asset = node.object.asset.substr(0, kLongestName);
  instance.mesh_index = primitive.mesh_index;
  const bool is_curves = !scene_.meshes[static_cast<std::size_t>(primitive.mesh_index)].radius.empty();
  instance.material_index = placed_material(node, primitive.material_index);
  if (is_curves) instance.material_index = material_of_curves(instance.material_index);
  instance.world_from_object = transform_to_affine(world);
  instance.flags =
      instance_flags(node.object, scene_.materials[static_cast<std::size_t>(instance.material_index)], world);
  instance.flags |= light_group_of(node) << kLightGroupShift;
  if (node.object.caustic_caster == CausticCaster::kYes) {
    const bool by_material = scene_.materials[static_cast<std::size_t>(instance.material_index)].depends_on_ray;
    if (by_material || node.object.hidden_from != 0) {
      warnings_.add(node.document->file + ": " + path + (by_material ? ": its material depends on the kind of ray" : ": some rays do not see it") +
                    ", so that it casts no caustics of photons");
    }
  }
  // Paths alone bring light to curves and from them.
  if (is_curves) instance.flags &= ~std::uint32_t{kCausticCaster | kCausticReceiver};
  const Affine3 inverse_of_it = inverse(instance.world_from_object);
  if (!(max_component(max(abs(inverse_of_it.x), max(abs(inverse_of_it.y), abs(inverse_of_it.z)))) <= kFarthest)) {
    warnings_.add(node.document->file + ": " + path + ": scaled to less than 1e-15" +
                  (node.animated ? " at this frame" : "") + ", left out");
    return;
  }
  const Bounds& own_bounds = mesh_bounds_[static_cast<std::size_t>(primitive.mesh_index)];
  const Bounds bounds = bounds_transform(instance.world_from_object, own_bounds);
  for (const Bounds& each : {own_bounds, bounds}) {
    check_positions(node, path, max(abs(each.low), abs(each.high)));
  }
  world_bounds_ = bounds_union(world_bounds_, bounds);
  instance.motion_index = motion_of(node, path, copy);
  const Material& material = scene_.materials[static_cast<std::size_t>(instance.material_index)];
  const bool deforms = !scene_.meshes[static_cast<std::size_t>(instance.mesh_index)].steps.empty();
  if ((instance.motion_index >= 0 || deforms) && material_is_light(material)) {
    warnings_.add(node.document->file + ": " + path +
                  ": shines and moves while the shutter is open: its light is found by chance alone, which is noisier");
  }
  if (instance.motion_index >= 0) {
    for (const Affine3& step : scene_.motions[static_cast<std::size_t>(instance.motion_index)]) {
      const Bounds moved = bounds_transform(step, own_bounds);
      check_positions(node, path, max(abs(moved.low), abs(moved.high)));
      world_bounds_ = bounds_union(world_bounds_, moved);
    }
  }
  check_displacement(node, instance);
  memory_.add(sizeof(Instance), node.document->file + ": instances");
  scene_.instances.push_back(std::move(instance));
}

/// A material as curves have it: they are not displaced, and there is nothing in them.
int GltfLoader::material_of_curves(int own)
{
  const Material& material = scene_.materials[static_cast<std::size_t>(own)];
  if (material.displacement_index < 0 && material.medium_index < 0) return own;
  const auto [it, is_new] = material_of_curves_.try_emplace(own, static_cast<int>(scene_.materials.size()));
  if (is_new) {
    Material bare = material;
    bare.displacement_index = -1;
    bare.medium_index = -1;
    bare.is_boundary = false;
    scene_.materials.push_back(bare);
    scene_.material_names.push_back(scene_.material_names[static_cast<std::size_t>(own)]);
  }
  return it->second;
}

int GltfLoader::placed_material(const PlacedNode& node, int own)
{
  const std::optional<MaterialChoice> choice =
      material_choice(node, scene_.material_names[static_cast<std::size_t>(own)]);
  return choice ? material_of(*choice->document, choice->index) : own;
}

double GltfLoader::open_shutter(const LoadOptions& options)
{
  std::vector<SceneCamera> cameras;
  if (!options.camera.look_from) {
    Warnings unheard;  // the load has the same
    const double time = options.frame / static_cast<double>(scene_.render.frames_per_second);
    composition_traverse(documents_, *root_, time, unheard, [&](const PlacedNode& node) {
      if (node.document->core.nodes[static_cast<std::size_t>(node.node_index)].camera < 0) return;
      if (transform_defect(node.world) != TransformDefect::kNone) return;
      cameras.push_back(gltf_camera(*node.document, node.node_index, node.world, image_aspect_, unheard));
    });
  }
  Shutter shutter;
  if (const auto chosen = camera_named(cameras, options.camera.name)) shutter = cameras[*chosen].shutter;
  shutter.frames = options.camera.shutter.value_or(shutter.frames);
  if (!(shutter.frames > 0)) return options.frame;
  shutter_nodes_ =
      ShutterNodes(documents_, *root_, shutter, options.frame, static_cast<double>(scene_.render.frames_per_second));
  return shutter.frame_at(options.frame, 0.5);
}

int GltfLoader::motion_of(const PlacedNode& node, const std::string& path, const Transform& copy)
{
  std::vector<Affine3> steps = shutter_nodes_.steps(num_visited_ - 1, copy);
  if (steps.empty()) return -1;
  if (const std::string defect = motion_defect(steps); !defect.empty()) {
    warnings_.add(node.document->file + ": " + path + ": " + defect +
                  " while the shutter is open: it stands still meanwhile");
    return -1;
  }
  return add_motion(std::move(steps), *node.document);
}

int GltfLoader::add_motion(std::vector<Affine3> steps, const GltfDocument& document)
{
  memory_.add(steps.size() * sizeof(Affine3), document.file + ": motion of instances");
  scene_.motions.push_back(std::move(steps));
  return static_cast<int>(scene_.motions.size()) - 1;
}

/// Gives a light that has been placed its motion.
void GltfLoader::move_light(const PlacedNode& node, const std::string& path, Light& light)
{
  const std::vector<Affine3> steps = shutter_nodes_.steps(num_visited_ - 1);
  if (steps.empty()) return;
  const bool is_sun = light_is_sun(light);
  if (is_sun && std::all_of(steps.begin(), steps.end(), [&](const Affine3& step) {
        return step.x == steps[0].x && step.y == steps[0].y && step.z == steps[0].z;
      })) {
    return;  // A sun is as far away as before.
  }
  std::vector<Affine3> motion;
  if (!is_sun && light.lamp_index < 0) motion = light_motion(steps, transform_to_affine(node.world), light.P);
  if (motion.empty()) {
    const char* reason = is_sun ? "a sun" : light.lamp_index >= 0 ? "one with a graph" : "one that changes its size";
    warnings_.add(node.document->file + ": " + path + ": a light that moves while the shutter is open, " + reason +
                  ": it stands still meanwhile");
    return;
  }
  light.motion_index = add_motion(std::move(motion), *node.document);
}

void GltfLoader::place_camera(const PlacedNode& node)
{
  const std::string path = "/nodes/" + std::to_string(node.node_index);
  if (is_usable(node, node.world, path)) {
    check_positions(node, path, abs(transform_to_affine(node.world).p));
    SceneCamera camera = gltf_camera(*node.document, node.node_index, node.world, image_aspect_, warnings_);
    camera.motion_index = motion_of(node, path);
    if (camera.motion_index >= 0) {
      // A camera has no scale.
      for (Affine3& step : scene_.motions[static_cast<std::size_t>(camera.motion_index)]) {
        step = camera_frame(normalize(step.z), normalize(step.y), step.p);
      }
    }
    scene_.cameras.push_back(std::move(camera));
  }
}

/// Makes a Lamp of the graph that a light's lamp_index names.
void GltfLoader::place_lamp(const PlacedNode& node, Light& light)
{
  if (light.lamp_index < 0) return;
  const GraphProgram& program = scene_.graphs[static_cast<std::size_t>(light.lamp_index)];
  if (program.inputs.empty() && program.code.empty()) {
    // The same everywhere.
    const auto factor = [&program](std::size_t i) {
      return program.constants[std::size_t{program.results[i]} - kMostGraphRegisters];
    };
    light.emission = light.emission * Vec3f{factor(0), factor(1), factor(2)};
    if (!is_finite(light.emission)) light.emission = {};
    light.lamp_index = -1;
    light.is_even = true;
    return;
  }
  Lamp lamp;
  lamp.graph_index = light.lamp_index;
  lamp.node.world_from_object = transform_to_affine(node.world);
  lamp.node.object_from_world = inverse(lamp.node.world_from_object);
  light.lamp_index = static_cast<std::int32_t>(scene_.lamps.size());
  scene_.lamps.push_back(lamp);
}

std::uint32_t GltfLoader::light_group_of(const PlacedNode& node)
{
  return light_group_number(scene_.light_groups, node.object.light_group, node.document->file,
                            "/nodes/" + std::to_string(node.node_index) + "/extensions/RELIEF_object");
}

void GltfLoader::place_lights(const PlacedNode& node)
{
  const std::string path = "/nodes/" + std::to_string(node.node_index);
  const auto add = [&](const std::vector<Light>& lights) {
    says_light_ = says_light_ || !lights.empty();
    if (!lights.empty() && is_usable(node, node.world, path)) {
      for (const Light& light : lights) {
        check_positions(node, path, abs(light.P) + abs(light.edge_u) + abs(light.edge_v) + splat3(light.radius));
      }
      memory_.add(sizeof(Light) * lights.size(), node.document->file + ": lights");
      scene_.lights.insert(scene_.lights.end(), lights.begin(), lights.end());
      scene_.lights.back().casts_caustics = node.object.caustic_light;
      scene_.lights.back().multiple_importance = node.object.multiple_importance;
      scene_.lights.back().hidden_from = static_cast<std::uint8_t>(node.object.hidden_from);
      scene_.lights.back().light_group = static_cast<std::uint8_t>(light_group_of(node));
      scene_.lights.back().in_footage = node.object.lights_footage;
      place_lamp(node, scene_.lights.back());
      move_light(node, path, scene_.lights.back());
    }
  };
  const LampGraphReader read_graph = [&](const JsonReader& graph) {
    const auto [it, is_new] =
        lamp_graph_of_.try_emplace({node.document, graph.path()}, static_cast<int>(scene_.graphs.size()));
    if (is_new) scene_.graphs.push_back(graph_read_lamp(*node.document, graph, textures_, warnings_));
    return it->second;
  };
  const auto [units, is_new] = light_units_of_.try_emplace(node.document);
  if (is_new) units->second = light_units(*node.document, scene_.render.luminous_efficacy);
  const std::vector<Light> lights =
      khronos_node_light(*node.document, node.node_index, node.world, units->second, read_graph, warnings_);
  if (!lights.empty() && !units->second.assumed.empty()) {
    warnings_.add(node.document->file + ": " + std::exchange(units->second.assumed, {}));
  }
  add(lights);
  const auto& json = node.document->element("nodes", static_cast<std::size_t>(node.node_index));
  // An area light divides by its area, so it must not be made before its transform is known to be good.
  node.document->read_extension(json, "", "RELIEF_area_light", [&](const JsonReader&) {
    says_light_ = true;
    if (is_usable(node, node.world, path)) {
      add(relief_area_light(*node.document, node.node_index, node.world, read_graph, warnings_));
    }
  });
}

/// Says what a material asks of a mesh that the mesh does not have.
void GltfLoader::warn_missing_attributes(const std::string& label, const Mesh& mesh, const Material& material)
{
  for (const TextureRef* ref : material_textures(material)) {
    if (ref->texture_index >= 0 && mesh.uv[ref->uv_set].empty()) {
      warnings_.add(label + ": the material's textures need TEXCOORD_" + std::to_string(ref->uv_set) +
                    ", which is missing");
    }
  }
}

/// Says what displacement asks of a mesh that the mesh does not have.
void GltfLoader::check_displacement(const PlacedNode& node, const Instance& instance)
{
  const int index = scene_.materials[static_cast<std::size_t>(instance.material_index)].displacement_index;
  if (index < 0 || !displaced_.emplace(instance.mesh_index, index).second) {
    return;
  }
  const int mesh_index = node.document->core.nodes[static_cast<std::size_t>(node.node_index)].mesh;
  const std::string label = node.document->file + ": /meshes/" + std::to_string(mesh_index);
  const Mesh& mesh = scene_.meshes[static_cast<std::size_t>(instance.mesh_index)];
  const DisplacementSettings& d = scene_.displacements[static_cast<std::size_t>(index)];
  if (d.by_vectors) return;  // neither normals nor seams open anything
  const bool has_map = d.height.texture_index >= 0;
  displaced_mesh_warn(label, mesh, has_map ? &d.height : nullptr, warnings_);
  if (!d.has_graph || !has_map) return;
  const HeightMap& map = height_graphs_.maps()[static_cast<std::size_t>(d.height.texture_index)];
  const UvBounds bounds = displaced_mesh_uv_bounds(mesh, d.height);
  const auto is_outside = [](Wrap wrap, float low, float high) {
    constexpr float kRounding = 1e-5f;
    return wrap == Wrap::kClamp && (low < -kRounding || high > 1 + kRounding);
  };
  if (is_outside(map.wrap_u, bounds.low.x, bounds.high.x) || is_outside(map.wrap_v, bounds.low.y, bounds.high.y)) {
    warnings_.add(label + ": texture coordinates beyond the uvRange of " + map.label +
                  ": heights there are those of its border");
  }
}

const std::vector<GltfLoader::Primitive>& GltfLoader::primitives_of(const GltfDocument& document,
                                                                    int mesh_index,
                                                                    const MorphWeights* morph)
{
  auto& known = primitives_of_[{&document, mesh_index}];
  if (morph == nullptr && !known.empty()) return known.begin()->second;
  const auto [it, is_new] = known.try_emplace(morph != nullptr ? *morph : MorphWeights{});
  if (!is_new) {
    return it->second;
  }
  const tinygltf::Mesh& source = document.core.meshes[static_cast<std::size_t>(mesh_index)];
  for (std::size_t p = 0; p < source.primitives.size(); ++p) {
    const int material = material_of(document, source.primitives[p].material);
    const int mesh = mesh_of(document, mesh_index, it->first, static_cast<int>(p), material);
    if (mesh >= 0) {
      warn_missing_attributes(document.file + ": /meshes/" + std::to_string(mesh_index),
                              scene_.meshes[static_cast<std::size_t>(mesh)],
                              scene_.materials[static_cast<std::size_t>(material)]);
      it->second.push_back({mesh, material});
    }
  }
  return it->second;
}

/// What the graphs of a material read by name, sorted.
std::vector<std::uint16_t> GltfLoader::attributes_of(const Material& material) const
{
  std::vector<std::uint16_t> all;
  const auto add = [&](int graph) {
    if (graph < 0) return;
    const std::vector<std::uint16_t>& attributes = scene_.graphs[static_cast<std::size_t>(graph)].attributes;
    std::vector<std::uint16_t> both;
    std::set_union(all.begin(), all.end(), attributes.begin(), attributes.end(), std::back_inserter(both));
    all = std::move(both);
  };
  add(material.graph_index);
  const int displacement = material.displacement_index;
  if (displacement >= 0) add(scene_.displacements[static_cast<std::size_t>(displacement)].graph_index);
  return all;
}

/// Index of a primitive's mesh; −1: it has no triangles.
int GltfLoader::mesh_of(const GltfDocument& document,
                        int mesh_index,
                        const MorphWeights& morph,
                        int primitive_index,
                        int material_index)
{
  const tinygltf::Mesh& source = document.core.meshes[static_cast<std::size_t>(mesh_index)];
  const tinygltf::Primitive& primitive = source.primitives[static_cast<std::size_t>(primitive_index)];
  const int tangent_uv_set = normal_map_uv_set(scene_.materials[static_cast<std::size_t>(material_index)]);
  const std::vector<std::uint16_t> columns = attributes_of(scene_.materials[static_cast<std::size_t>(material_index)]);
  std::string curves;  // what else makes one mesh of the same accessors differ from another
  const nlohmann::json& json = document.element("meshes", static_cast<std::size_t>(mesh_index))
                                   .at("primitives")
                                   .at(static_cast<std::size_t>(primitive_index));
  document.read_extension(json, "", "RELIEF_curves",
                          [&](const JsonReader& r) { curves = "," + r.string("shape", ""); });
  document.read_extension(json, "", "RELIEF_points", [&](const JsonReader&) { curves = ",points"; });
  const auto [it, is_new] = mesh_of_.try_emplace({&document, primitive.attributes, primitive.indices, primitive.mode,
                                                  curves, tangent_uv_set, primitive.targets, morph, columns},
                                                 -1);
  if (!is_new) {
    return it->second;
  }
  std::map<std::string, std::uint16_t> wanted;
  for (const std::uint16_t place : columns) wanted.emplace(scene_.attribute_names[place], place);
  std::optional<Mesh> mesh =
      gltf_mesh_load(document, mesh_index, primitive_index, morph, tangent_uv_set, wanted, warnings_);
  if (mesh) {
    memory_.add(mesh->bytes(), document.file + ": /meshes/" + std::to_string(mesh_index));
    mesh->material_index = material_index;
    it->second = static_cast<int>(scene_.meshes.size());
    mesh_bounds_.push_back(bounds_of_points(mesh->P));
    for (const MeshStep& step : mesh->steps) {
      mesh_bounds_.back() = bounds_union(mesh_bounds_.back(), bounds_of_points(step.P));
    }
    scene_.meshes.push_back(std::move(*mesh));
  }
  return it->second;
}

void GltfLoader::read_programs(const GltfDocument& document,
                               const nlohmann::json& json,
                               const std::string& path,
                               Material& material)
{
  // The closures' reader stands within the graph's, for they refer to its nodes.
  const auto read = [&](const JsonReader* graph, const JsonReader* surface, const JsonReader* volume) {
    GraphPrograms programs = graph_read(document, graph, surface, volume, textures_, scene_.attribute_names, warnings_);
    if (programs.volume) {
      const bool is_even = medium_is_even(*programs.volume);
      // Their bounds are of interest, as those of heights are.
      for (const int texture : graph_textures(programs.volume->program)) textures_.use_for_heights(texture);
      material.medium_index = static_cast<int>(scene_.media.size());
      scene_.media.push_back(is_even ? medium_of(*programs.volume) : Medium{});
      scene_.varying_media.push_back(is_even ? VolumeProgram{} : std::move(*programs.volume));
    }
    if (!programs.surface) return;
    const auto add = [this](GraphProgram&& program) {
      scene_.graphs.push_back(std::move(program));
      return static_cast<int>(scene_.graphs.size()) - 1;
    };
    material.graph_index = add(std::move(*programs.surface));
    const GraphProgram& program = scene_.graphs.back();
    material.graph_outputs = program.given;
    material.depends_on_ray = std::any_of(program.inputs.begin(), program.inputs.end(), [](const GraphInput& input) {
      using Q = GraphQuantity;
      // Photons show sharply what they show at all.
      const bool is_blurred = input.index == static_cast<int>(GraphRayKind::kBlurred);
      return (input.quantity == Q::ray_kind && !is_blurred) || input.quantity == Q::ray_depth ||
             input.quantity == Q::ray_length;
    });
    material.has_closures = surface != nullptr;
    if (material.has_closures) {
      const ClosureSummary known = closures_summarize(program);
      material.transmission = known.transmission;
      material.metallic = known.metallic;
      material.roughness = known.roughness;
      material.scatters_below = known.scatters_below;
    }
    constexpr auto kEmission = static_cast<unsigned>(GraphOutput::emission);
    if (programs.emission) {
      material.emission_index = add(std::move(*programs.emission));
    } else if (!material.has_closures && (material.graph_outputs >> kEmission & 1u) != 0) {
      material.emission_index = material.graph_index;
    }
    says_light_ = says_light_ || material.emission_index >= 0;
    if (material.has_closures) material.alpha_mode = programs.transparency ? AlphaMode::kBlend : AlphaMode::kOpaque;
    if (programs.transparency) material.transparency_index = add(std::move(*programs.transparency));
  };
  const auto read_with = [&](const JsonReader* surface, const JsonReader* volume) {
    const bool has_graph = document.read_extension(json, path, "RELIEF_graph",
                                                   [&](const JsonReader& graph) { read(&graph, surface, volume); });
    if (!has_graph && (surface != nullptr || volume != nullptr)) read(nullptr, surface, volume);
  };
  const auto read_around = [&](const JsonReader* volume) {
    const bool has_surface = document.read_extension(json, path, "RELIEF_surface",
                                                     [&](const JsonReader& surface) { read_with(&surface, volume); });
    if (!has_surface) read_with(nullptr, volume);
  };
  const bool has_volume =
      document.read_extension(json, path, "RELIEF_volume", [&](const JsonReader& volume) { read_around(&volume); });
  if (!has_volume) read_around(nullptr);
  material.is_boundary = material.medium_index >= 0 && material_has_no_surface(material);
}

/// Lets what a material's meshes bound absorb light, besides what fills them already.
/// @param sigma_a  1/m
void GltfLoader::add_absorption(const std::string& place, Vec3f sigma_a, Material& material)
{
  if (material.medium_index < 0) {
    material.medium_index = static_cast<int>(scene_.media.size());
    scene_.media.emplace_back().sigma_t = sigma_a;
    scene_.varying_media.emplace_back();
    return;
  }
  const auto medium = static_cast<std::size_t>(material.medium_index);
  if (scene_.varying_media[medium].closures.empty()) {
    scene_.media[medium].sigma_t += sigma_a;
  } else {
    warnings_.add(place + ": what KHR_materials_volume absorbs is left out beside a RELIEF_volume that varies");
  }
}

int GltfLoader::material_of(const GltfDocument& document, int material_index)
{
  // All files share glTF's default material.
  const GltfDocument* owner = material_index >= 0 ? &document : nullptr;
  const auto [it, is_new] =
      material_of_.try_emplace({owner, material_index}, static_cast<int>(scene_.materials.size()));
  if (!is_new) {
    return it->second;
  }
  Material material;
  std::string name = "default";
  if (owner != nullptr) {
    const KhronosMaterial khronos = khronos_material(document, material_index, textures_, warnings_);
    material = khronos.material;
    name = document.core.materials[static_cast<std::size_t>(material_index)].name;
    const std::string path = "/materials/" + std::to_string(material_index);
    read_programs(document, document.element("materials", static_cast<std::size_t>(material_index)), path, material);
    if (!is_zero(khronos.sigma_a) && material_lets_light_in(material)) {
      add_absorption(document.file + ": " + path, khronos.sigma_a, material);
    }
    if (auto displacement = relief_displacement(document, material_index, height_maps_, height_graphs_, warnings_)) {
      material.displacement_index = static_cast<int>(scene_.displacements.size());
      scene_.displacements.push_back(*displacement);
    }
  }
  scene_.materials.push_back(material);
  scene_.material_names.push_back(std::move(name));
  return it->second;
}

/// Times at which everything must be in view. The camera must not follow what moves, nor depend on which frames a run renders:
/// they are those of the whole animation, whatever frame this is.
std::vector<std::optional<double>> GltfLoader::framed_times(const LoadOptions& options)
{
  if (!options.has_frame) return {std::nullopt};
  double end = 0;
  for (const AnimationClip& clip : scene_.clips) end = std::max(end, clip.end);
  // So many that what moves evenly leaves the picture by little, and that large scenes are walked through for a second or two.
  constexpr double kMost = 128, kLeast = 8, kMostPlacements = 1e6;
  const double num_placements = static_cast<double>(placements({}).size()) + 1;
  const double most = std::clamp(kMostPlacements / num_placements, kLeast, kMost);
  const double frames = std::ceil(end * static_cast<double>(scene_.render.frames_per_second));
  const int num_steps = static_cast<int>(std::min(frames, most));
  std::vector<std::optional<double>> times = {0.0};
  for (int i = 1; i <= num_steps; ++i) times.emplace_back(end * i / num_steps);
  return times;
}

void GltfLoader::set_camera(const LoadOptions& options)
{
  if (scene_.instances.empty()) {
    warnings_.add(scene_.file + ": nothing to render: no node has a mesh with triangles");
  }
  const CameraChoice& choice = options.camera;
  if (choice.look_from && choice.look_at) {
    scene_.cameras = {look_camera(*choice.look_from, *choice.look_at, choice.fov, image_aspect_)};
    return;
  }
  const bool is_auto = choice.name == kAutoCamera && !camera_named(scene_.cameras, choice.name);
  if (!choice.look_from && !is_auto && !scene_.cameras.empty()) return;
  if (options.needs_camera) throw SceneError(scene_.file, "/nodes", "one with a camera", "none");
  // Heights of float maps may be anything.
  load_height_maps(scene_, height_maps_.take(), height_graphs_.take(), options.kept, warnings_);
  std::vector<float> reach_of;
  for (const DisplacementSettings& d : scene_.displacements) {
    HeightRange range{0, 1};  // what graphs mostly give
    if (d.height.texture_index >= 0) {
      range = height_map_range(scene_.height_maps[static_cast<std::size_t>(d.height.texture_index)].view());
    }
    reach_of.push_back(std::fabs(d.scale) * max(std::fabs(range.low - d.midlevel), std::fabs(range.high - d.midlevel)));
  }
  Framing framing(choice.fov, image_aspect_);
  std::map<int, std::vector<Vec3f>> points_of;
  for (const std::optional<double> time : framed_times(options)) {
    for (const Placement& p : placements(time)) {
      const auto [points, is_new] = points_of.try_emplace(p.mesh_index);
      if (is_new) points->second = extreme_points(scene_.meshes[static_cast<std::size_t>(p.mesh_index)].P);
      const Material& material = scene_.materials[static_cast<std::size_t>(p.material_index)];
      float reach = 0;
      bool in_world = false;
      if (material.displacement_index >= 0) {
        const auto d = static_cast<std::size_t>(material.displacement_index);
        reach = reach_of[d];
        in_world = scene_.displacements[d].space == DisplacementSpace::kWorld;
      }
      framing.add(p.world_from_object, points->second, in_world ? 0 : reach, in_world ? reach : 0);
    }
  }
  if (choice.look_from) {
    scene_.cameras = {look_camera(*choice.look_from, framing.middle(), choice.fov, image_aspect_)};
    return;
  }
  if (!is_auto) warnings_.add(scene_.file + ": no camera: one that frames everything is used");
  scene_.cameras = {framing.camera()};
  if (is_auto) scene_.cameras.front().name = kAutoCamera;
}

RenderSettings scene_settings(const std::filesystem::path& path)
{
  Warnings unheard;  // the load has the same
  DocumentSet documents;
  const GltfDocument& root = documents.load(path, unheard);
  RenderSettings settings = relief_render(root, unheard);
  composition_traverse(documents, root, {}, unheard, [](const PlacedNode&) {});
  std::vector<AnimationClip> all;
  for (const auto& document : documents.all()) {
    const std::vector<AnimationClip> clips = animation_clips(*document);
    all.insert(all.end(), clips.begin(), clips.end());
  }
  frame_range_from_clips(root, all, settings);
  return settings;
}

std::vector<FileStamp> scene_files(const std::filesystem::path& path)
{
  Warnings unheard;  // the load has the same
  TextureFaults unheard_faults;
  GltfLoader loader(unheard, unheard_faults);
  // A camera that is given: one that frames everything would have to know the height maps.
  LoadOptions options;
  options.camera.look_from = options.camera.look_at = Vec3f{};
  Scene scene = loader.load(path, options);
  add_files(scene, loader.take_textures());
  add_files(scene, loader.take_height_maps());
  return std::move(scene.files);
}

Scene scene_load(const std::filesystem::path& path, const LoadOptions& options)
{
  Warnings warnings;
  TextureFaults faults;
  try {
    Scene scene;
    std::vector<TextureRequest> textures, height_maps;
    std::vector<HeightMap> height_graphs;
    std::vector<Placement> unlit;
    {
      // The files go away before texels come: the two need not be in memory together.
      GltfLoader loader(warnings, faults);
      scene = loader.load(path, options);
      unlit = loader.take_unlit();
      textures = loader.take_textures();
      height_maps = loader.take_height_maps();
      height_graphs = loader.take_height_graphs();
    }
    add_files(scene, textures);
    load_height_maps(scene, height_maps, std::move(height_graphs), options.kept, warnings);
    const auto store =
        std::make_shared<TextureStore>(std::move(textures), options.texture_budget_bytes, warnings, options.kept);
    scene.textures = store;
    faults.settle(options.continue_without_textures, warnings);
    const bool has_backdrop = !options.environment_visible.has_value();
    world_displacement_bake(scene);
    border_walls_add(scene);
    std::function<bool()> emission_shows;
    // Of an animation all frames have the same light, so that none of them can tell.
    if (options.emission_shows != nullptr && (!options.has_frame || scene.clips.empty())) {
      const std::size_t camera = camera_named(scene.cameras, options.camera.name).value_or(0);
      emission_shows = [&scene, &options, camera] { return options.emission_shows(scene, camera); };
    }
    if (!unlit.empty()) default_light_add(scene, unlit, has_backdrop, emission_shows, *store, warnings);
    if (options.environment && options.environment->source != EnvironmentSource::kFile) {
      environment_set(scene, *options.environment, has_backdrop, *store);
    }
    scene.environment.visible_to_camera = options.environment_visible.value_or(scene.environment.visible_to_camera);
    scene.warnings = warnings.texts();
    return scene;
  } catch (const OutOfMemory&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(path.string());
  } catch (const std::length_error&) {
    throw OutOfMemory(path.string());
  }
}

}  // namespace relief
