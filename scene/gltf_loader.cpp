#include "scene/gltf_loader.h"

#include <new>
#include <utility>

#include "scene/displaced_mesh.h"
#include "scene/feature_set.h"
#include "scene/gltf_mesh.h"
#include "scene/khronos_extensions.h"
#include "scene/relief_extensions.h"
#include "scene/texture_store.h"

namespace relief {
namespace {

bool shows_light(const Scene& scene)
{
  if (!scene.lights.empty() || !is_zero(scene.environment.color)) {
    return true;
  }
  for (const Instance& instance : scene.instances) {
    const Material& m = scene.materials[static_cast<std::size_t>(instance.material_index)];
    if (m.unlit || !is_zero(m.emission)) {
      return true;
    }
  }
  return false;
}

std::uint32_t instance_flags(const ObjectSettings& object, const Material& material, const Transform& world)
{
  const bool caster = object.caustic_caster == CausticCaster::kYes ||
                      (object.caustic_caster == CausticCaster::kAuto && material_casts_caustics(material));
  return (object.visible_to_camera ? kVisibleToCamera : 0u) | (object.casts_shadow ? kCastsShadow : 0u) |
         (transform_mirrors(world) ? kMirrored : 0u) | (caster ? kCausticCaster : 0u) |
         (object.caustic_receiver ? kCausticReceiver : 0u) | (object.caustic_light ? 0u : kNoCausticLight);
}

/// Texture coordinates that a material's normal maps are laid out in; −1: it has none.
int normal_map_uv_set(const Material& m)
{
  if (m.normal_texture.texture_index >= 0) {
    return m.normal_texture.uv_set;
  }
  return m.clearcoat_normal_texture.texture_index >= 0 ? m.clearcoat_normal_texture.uv_set : -1;
}

void add_files(Scene& scene, const std::vector<TextureRequest>& requests)
{
  for (const TextureRequest& request : requests) {
    if (!request.file.empty()) {
      scene.files.push_back(request.file.string());
    }
  }
}

/// Reads the height maps and points the displacements at them.
void load_height_maps(Scene& scene, const std::vector<TextureRequest>& requests, Warnings& warnings)
{
  HeightMapSet heights = height_maps_load(requests, warnings);
  for (DisplacementSettings& displacement : scene.displacements) {
    displacement.height.texture_index =
        heights.map_of_request[static_cast<std::size_t>(displacement.height.texture_index)];
  }
  scene.height_maps = std::move(heights.maps);
}

}  // namespace

Scene GltfLoader::load(const std::filesystem::path& path, const LoadOptions& options)
{
  const GltfDocument& root = documents_.load(path, warnings_);
  scene_.file = root.file;
  scene_.render = relief_render(root, warnings_);
  image_aspect_ = static_cast<float>(scene_.render.width) / static_cast<float>(scene_.render.height);
  std::optional<double> time;
  if (options.has_frame) {
    time = options.frame / static_cast<double>(scene_.render.frames_per_second);
  }
  composition_traverse(documents_, root, time, warnings_, [this](const PlacedNode& node) { place(node); });
  scene_.environment = relief_environment(root, textures_, warnings_).value_or(Environment{});
  add_defaults();
  scene_.files = documents_.files_read();
  return std::move(scene_);
}

void GltfLoader::place(const PlacedNode& node)
{
  const tinygltf::Node& source = node.document->core.nodes[static_cast<std::size_t>(node.node_index)];
  if (source.mesh >= 0) {
    place_meshes(node);
  }
  if (source.camera >= 0) {
    place_camera(node);
  }
  place_lights(node);
}

/// Whether something may stand here. What an animation has shrunk to nothing is left out; anything else that is flat,
/// or beyond the numbers, is a mistake.
bool GltfLoader::is_usable(const PlacedNode& node, const Transform& world, const std::string& path)
{
  const TransformDefect defect = transform_defect(world);
  if (defect == TransformDefect::kNone) {
    return true;
  }
  const std::string where = node.defect_path.empty() ? path : node.defect_path;
  if (defect == TransformDefect::kSingular && node.animated) {
    warnings_.add(node.document->file + ": " + where + ": singular transform at this frame, left out");
    return false;
  }
  throw SceneError(node.document->file, where, "a transform that can be inverted",
                   defect == TransformDefect::kSingular ? "a singular one" : "one beyond single precision");
}

void GltfLoader::place_meshes(const PlacedNode& node)
{
  const GltfDocument& document = *node.document;
  const tinygltf::Node& source = document.core.nodes[static_cast<std::size_t>(node.node_index)];
  const std::string path = "/nodes/" + std::to_string(node.node_index);
  const std::vector<int>& meshes = meshes_of(document, source.mesh);
  const std::vector<Transform> copies = khronos_instances(document, node.node_index, warnings_);
  for (const int mesh : meshes) {
    if (copies.empty()) {
      place_instance(node, mesh, node.world, path);
    }
    for (const Transform& copy : copies) {
      place_instance(node, mesh, node.world * copy, path + "/extensions/EXT_mesh_gpu_instancing");
    }
  }
}

void GltfLoader::place_instance(const PlacedNode& node, int mesh_index, const Transform& world, const std::string& path)
{
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
  instance.mesh_index = mesh_index;
  instance.material_index = node.material_document != nullptr
                                ? material_of(*node.material_document, node.material_index)
                                : scene_.meshes[static_cast<std::size_t>(mesh_index)].material_index;
  instance.world_from_object = transform_to_affine(world);
  instance.flags =
      instance_flags(node.object, scene_.materials[static_cast<std::size_t>(instance.material_index)], world);
  const Bounds bounds =
      bounds_transform(instance.world_from_object, mesh_bounds_[static_cast<std::size_t>(mesh_index)]);
  // A tenth of a light-year: squares of such distances still fit single precision.
  constexpr float kFarthest = 1e15f;
  if (!(max_component(max(abs(bounds.low), abs(bounds.high))) <= kFarthest)) {
    throw SceneError(node.document->file, path, "positions within 1e15 m of the origin", "farther ones");
  }
  world_bounds_ = bounds_union(world_bounds_, bounds);
  check_displacement(node, instance);
  scene_.instances.push_back(std::move(instance));
}

void GltfLoader::place_camera(const PlacedNode& node)
{
  if (is_usable(node, node.world, "/nodes/" + std::to_string(node.node_index))) {
    scene_.cameras.push_back(gltf_camera(*node.document, node.node_index, node.world, image_aspect_, warnings_));
  }
}

void GltfLoader::place_lights(const PlacedNode& node)
{
  const auto add = [&](const std::vector<Light>& lights) {
    if (!lights.empty() && is_usable(node, node.world, "/nodes/" + std::to_string(node.node_index))) {
      scene_.lights.insert(scene_.lights.end(), lights.begin(), lights.end());
      scene_.lights.back().casts_caustics = node.object.caustic_light;
    }
  };
  add(khronos_node_light(*node.document, node.node_index, node.world, scene_.render.luminous_efficacy, warnings_));
  const auto& json = node.document->element("nodes", static_cast<std::size_t>(node.node_index));
  // An area light divides by its area, so it must not be made before its transform is known to be good.
  node.document->read_extension(json, "", "RELIEF_area_light", [&](const JsonReader&) {
    if (is_usable(node, node.world, "/nodes/" + std::to_string(node.node_index))) {
      add(relief_area_light(*node.document, node.node_index, node.world, warnings_));
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
  const int mesh = node.document->core.nodes[static_cast<std::size_t>(node.node_index)].mesh;
  displaced_mesh_warn(node.document->file + ": /meshes/" + std::to_string(mesh),
                      scene_.meshes[static_cast<std::size_t>(instance.mesh_index)],
                      scene_.displacements[static_cast<std::size_t>(index)].height, warnings_);
}

const std::vector<int>& GltfLoader::meshes_of(const GltfDocument& document, int mesh_index)
{
  const auto [it, is_new] = meshes_of_.try_emplace({&document, mesh_index});
  if (!is_new) {
    return it->second;
  }
  const tinygltf::Mesh& source = document.core.meshes[static_cast<std::size_t>(mesh_index)];
  for (std::size_t p = 0; p < source.primitives.size(); ++p) {
    const int material_index = material_of(document, source.primitives[p].material);
    const Material& material = scene_.materials[static_cast<std::size_t>(material_index)];
    std::optional<Mesh> mesh =
        gltf_mesh_load(document, mesh_index, static_cast<int>(p), normal_map_uv_set(material), warnings_);
    if (!mesh) {
      continue;
    }
    mesh->material_index = material_index;
    warn_missing_attributes(document.file + ": /meshes/" + std::to_string(mesh_index), *mesh, material);
    it->second.push_back(static_cast<int>(scene_.meshes.size()));
    mesh_bounds_.push_back(bounds_of_points(mesh->P));
    scene_.meshes.push_back(std::move(*mesh));
  }
  return it->second;
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
    material = khronos_material(document, material_index, textures_, warnings_);
    name = document.core.materials[static_cast<std::size_t>(material_index)].name;
    if (auto displacement = relief_displacement(document, material_index, height_maps_, warnings_)) {
      material.displacement_index = static_cast<int>(scene_.displacements.size());
      scene_.displacements.push_back(*displacement);
    }
  }
  scene_.materials.push_back(material);
  scene_.material_names.push_back(std::move(name));
  return it->second;
}

void GltfLoader::add_defaults()
{
  if (scene_.instances.empty()) {
    warnings_.add(scene_.file + ": nothing to render: no node has a mesh with triangles");
  }
  if (scene_.cameras.empty()) {
    warnings_.add(scene_.file + ": no camera: one that frames everything is used");
    scene_.cameras.push_back(framing_camera(world_bounds_, image_aspect_));
  }
  if (!shows_light(scene_)) {
    warnings_.add(
        scene_.file +
        ": no light, emission or environment: a constant environment of radiance 1, which cameras do not see, is used");
    scene_.environment = Environment{};
    scene_.environment.color = {1, 1, 1};
    // White things would not show before it.
    scene_.environment.visible_to_camera = false;
  }
}

Scene scene_load(const std::filesystem::path& path, const LoadOptions& options)
{
  Warnings warnings;
  try {
    Scene scene;
    std::vector<TextureRequest> textures, height_maps;
    {
      // The files go away before texels come: the two need not be in memory together.
      GltfLoader loader(warnings);
      scene = loader.load(path, options);
      textures = loader.take_textures();
      height_maps = loader.take_height_maps();
    }
    add_files(scene, textures);
    add_files(scene, height_maps);
    load_height_maps(scene, height_maps, warnings);
    scene.textures = std::make_shared<const TextureStore>(std::move(textures), options.texture_budget_bytes, warnings);
    scene.features = feature_set_detect(scene);
    scene.warnings = warnings.texts();
    return scene;
  } catch (const std::bad_alloc&) {
    throw SceneError(path.string(), "", "a scene that fits in memory", "one that does not");
  } catch (const std::length_error&) {
    throw SceneError(path.string(), "", "a scene that fits in memory", "one that does not");
  }
}

}  // namespace relief
