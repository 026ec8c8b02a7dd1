#include "scene/khronos_extensions.h"

#include <algorithm>
#include <cmath>

#include "kernel/volume/medium.h"
#include "scene/gltf_accessor.h"
#include "scene/relief_extensions.h"

namespace relief {
namespace {

constexpr double kNoLimit = JsonReader::kNoLimit;

/// What reading one material needs at every step.
struct MaterialContext {
  const GltfDocument& document;
  const nlohmann::json& json;
  std::string path;
  TextureTable& textures;
  Warnings& warnings;

  TextureRef texture(const JsonReader& parent, std::string_view name, TextureColor color) const
  {
    return khronos_texture_ref(document, parent, name, color, textures, warnings);
  }

  template <typename Read>
  void extension(const char* name, Read&& read) const
  {
    document.read_extension(json, path, name, [&](const JsonReader& reader) {
      read(reader);
      reader.warn_unread(warnings);
    });
  }
};

void read_core(const MaterialContext& c, Material& m, int index)
{
  const tinygltf::Material& core = c.document.core.materials[static_cast<std::size_t>(index)];
  const tinygltf::PbrMetallicRoughness& pbr = core.pbrMetallicRoughness;
  const auto f = [](double x) { return static_cast<float>(x); };
  m.base_color = {f(pbr.baseColorFactor[0]), f(pbr.baseColorFactor[1]), f(pbr.baseColorFactor[2])};
  m.base_alpha = f(pbr.baseColorFactor[3]);
  m.metallic = f(pbr.metallicFactor);
  m.roughness = f(pbr.roughnessFactor);
  m.emission = {f(core.emissiveFactor[0]), f(core.emissiveFactor[1]), f(core.emissiveFactor[2])};
  m.alpha_mode = core.alphaMode == "MASK"    ? AlphaMode::kMask
                 : core.alphaMode == "BLEND" ? AlphaMode::kBlend
                                             : AlphaMode::kOpaque;
  m.alpha_cutoff = f(core.alphaCutoff);
  m.double_sided = core.doubleSided;
  m.normal_scale = f(core.normalTexture.scale);
  const JsonReader material(c.json, c.document.file, c.path);
  if (material.has("pbrMetallicRoughness")) {
    const JsonReader reader = material.object("pbrMetallicRoughness");
    m.base_color_texture = c.texture(reader, "baseColorTexture", TextureColor::kSrgb);
    m.metallic_roughness_texture = c.texture(reader, "metallicRoughnessTexture", TextureColor::kLinear);
  }
  m.normal_texture = c.texture(material, "normalTexture", TextureColor::kLinear);
  m.emission_texture = c.texture(material, "emissiveTexture", TextureColor::kSrgb);
}

/// @param sigma_a  see KhronosMaterial
void read_transmission(const MaterialContext& c, Material& m, Vec3f& sigma_a)
{
  c.extension("KHR_materials_transmission", [&](const JsonReader& r) {
    m.transmission = r.factor("transmissionFactor", 0, c.warnings);
    m.transmission_texture = c.texture(r, "transmissionTexture", TextureColor::kLinear);
  });
  c.extension("KHR_materials_ior", [&](const JsonReader& r) {
    m.ior = r.number_f("ior", 1.5f, 0, 1000);
    // 0 is the specification's "always reflect"; between 0 and 1 lies nothing physical.
    if (m.ior != 0 && m.ior < 1) {
      r.fail("ior", "0 or a number ≥ 1");
    }
  });
  c.extension("KHR_materials_volume", [&](const JsonReader& r) {
    m.thickness = r.number_f("thicknessFactor", 0, 0, kNoLimit);
    const Vec3f color = r.color("attenuationColor", {1, 1, 1});
    const float distance = r.number_f("attenuationDistance", kInfinity, 0, kNoLimit);
    if (!(distance > 0)) {
      r.fail("attenuationDistance", "a number > 0");
    }
    if (max_component(color) > 1) {
      c.warnings.add(r.file() + ": " + json_path_join(r.path(), "attenuationColor") +
                     ": expected numbers within 0…1; those above count as 1");
    }
    sigma_a = volume_sigma_a(min(color, splat3(1)), distance);
    if (r.has("thicknessTexture")) {
      // The texture scales a thickness that rasterizers pretend; a ray measures the real one.
      static_cast<void>(r.object("thicknessTexture"));
    }
  });
}

void read_layers(const MaterialContext& c, Material& m)
{
  c.extension("KHR_materials_clearcoat", [&](const JsonReader& r) {
    m.clearcoat = r.factor("clearcoatFactor", 0, c.warnings);
    m.clearcoat_texture = c.texture(r, "clearcoatTexture", TextureColor::kLinear);
    m.clearcoat_roughness = r.factor("clearcoatRoughnessFactor", 0, c.warnings);
    m.clearcoat_roughness_texture = c.texture(r, "clearcoatRoughnessTexture", TextureColor::kLinear);
    m.clearcoat_normal_texture = c.texture(r, "clearcoatNormalTexture", TextureColor::kLinear);
    if (m.clearcoat_normal_texture.texture_index >= 0) {
      m.clearcoat_normal_scale = r.object("clearcoatNormalTexture").number_f("scale", 1);
    }
  });
  c.extension("KHR_materials_sheen", [&](const JsonReader& r) {
    m.sheen_color = r.color("sheenColorFactor", {0, 0, 0});
    m.sheen_color_texture = c.texture(r, "sheenColorTexture", TextureColor::kSrgb);
    m.sheen_roughness = r.factor("sheenRoughnessFactor", 0, c.warnings);
    m.sheen_roughness_texture = c.texture(r, "sheenRoughnessTexture", TextureColor::kLinear);
  });
  c.extension("KHR_materials_specular", [&](const JsonReader& r) {
    m.specular = r.factor("specularFactor", 1, c.warnings);
    m.specular_texture = c.texture(r, "specularTexture", TextureColor::kLinear);
    m.specular_color = r.color("specularColorFactor", {1, 1, 1});
    m.specular_color_texture = c.texture(r, "specularColorTexture", TextureColor::kSrgb);
  });
}

/// Attribute of EXT_mesh_gpu_instancing; empty view (count 0) when absent.
AccessorView open_instance_attribute(const GltfDocument& document,
                                     const JsonReader& attributes,
                                     const char* name,
                                     AccessorKind kind,
                                     int components)
{
  const int index = attributes.index(name, document.core.accessors.size(), "accessors");
  return index < 0
             ? AccessorView{}
             : accessor_open(document, index, kind, components, components, json_path_join(attributes.path(), name));
}

template <std::size_t N>
std::vector<std::array<float, N>> read_instance_attribute(const AccessorView& view)
{
  return view.count > 0 ? accessor_read<std::array<float, N>>(view) : std::vector<std::array<float, N>>{};
}

}  // namespace

void khronos_texture_transform(TextureRef& ref,
                               double offset_u,
                               double offset_v,
                               double rotation,
                               double scale_u,
                               double scale_v)
{
  // The extension's text (counter-clockwise on an image whose v points down), its example and its test model agree on
  // this sign; the GLSL printed beside them has the opposite one.
  const double c = std::cos(rotation), s = std::sin(rotation);
  const auto f = [](double x) { return static_cast<float>(x); };
  ref.m00 = f(c * scale_u), ref.m01 = f(s * scale_v), ref.m02 = f(offset_u);
  ref.m10 = f(-s * scale_u), ref.m11 = f(c * scale_v), ref.m12 = f(offset_v);
}

void khronos_texture_transform(TextureRef& ref, const JsonReader& extension, Warnings& warnings)
{
  constexpr double kLargest = 1e9;
  std::vector<double> offset = extension.numbers("offset", 2, 2, -kLargest, kLargest);
  std::vector<double> scale = extension.numbers("scale", 2, 2, -kLargest, kLargest);
  const double rotation = extension.number("rotation", 0, -kLargest, kLargest);
  offset.resize(2, 0);
  scale.resize(2, 1);
  ref.uv_set = static_cast<int>(extension.integer("texCoord", ref.uv_set, 0, 1));
  khronos_texture_transform(ref, offset[0], offset[1], rotation, scale[0], scale[1]);
  extension.warn_unread(warnings);
}

TextureRef khronos_texture_ref(const GltfDocument& document,
                               const JsonReader& parent,
                               std::string_view name,
                               TextureColor color,
                               TextureTable& textures,
                               Warnings& warnings)
{
  TextureRef ref;
  if (!parent.has(name)) {
    return ref;
  }
  const JsonReader info = parent.object(name);
  if (!info.has("index")) {
    info.fail("index", "the index of a texture");
  }
  const int texture = info.index("index", document.core.textures.size(), "textures");
  ref.uv_set = static_cast<int>(info.integer("texCoord", 0, 0, 1));
  document.read_extension(parent.raw(name), info.path(), "KHR_texture_transform",
                          [&](const JsonReader& r) { khronos_texture_transform(ref, r, warnings); });
  ref.texture_index = textures.add_texture(document, texture, color);
  return ref;
}

KhronosMaterial khronos_material(const GltfDocument& document, int index, TextureTable& textures, Warnings& warnings)
{
  const MaterialContext c{document, document.element("materials", static_cast<std::size_t>(index)),
                          "/materials/" + std::to_string(index), textures, warnings};
  KhronosMaterial out;
  Material& m = out.material;
  read_core(c, m, index);
  read_transmission(c, m, out.sigma_a);
  read_layers(c, m);
  c.extension("KHR_materials_emissive_strength",
              [&](const JsonReader& r) { m.emission *= r.number_f("emissiveStrength", 1, 0, kNoLimit); });
  c.extension("KHR_materials_unlit", [&](const JsonReader&) { m.unlit = true; });
  if (!is_finite(m.emission)) {
    throw SceneError(document.file, c.path + "/emissiveFactor", "a finite radiance", "one beyond single precision");
  }
  return out;
}

std::vector<Light> khronos_node_light(const GltfDocument& document,
                                      int node_index,
                                      const Transform& world,
                                      const LightUnits& units,
                                      const LampGraphReader& read_graph,
                                      Warnings& warnings)
{
  static constexpr std::string_view kTypes[] = {"point", "spot", "directional"};
  const std::string node_path = "/nodes/" + std::to_string(node_index);
  std::vector<Light> out;
  const auto read_light = [&](const JsonReader& r) {
    Light light;
    light.P = transform_to_affine(world).p;
    light.axis = -unit_direction(world.z);
    const int type = r.choice("type", kTypes, -1);
    if (type < 0) {
      r.fail("type", "\"point\", \"spot\" or \"directional\"");
    }
    light.kind = type == 0 ? LightKind::kPoint : type == 1 ? LightKind::kSpot : LightKind::kSun;
    const float intensity = r.number_f("intensity", 1, 0, kNoLimit);
    light.emission =
        r.color("color", {1, 1, 1}) * (intensity / (light_is_sun(light) ? units.irradiance : units.intensity));
    if (!is_finite(light.emission)) {
      r.fail("intensity", "a finite emission");
    }
    static_cast<void>(r.string("name", ""));
    if (r.has("range")) {
      warnings.add(document.file + ": range of lights is ignored: light falls off with the square of the distance");
    }
    if (r.has("spot")) {
      const JsonReader spot = r.object("spot");
      const double outer = spot.number("outerConeAngle", 0.78539816339744831, 0, 1.5707963267948966);
      const double inner = spot.number("innerConeAngle", 0, 0, outer);
      if (!(outer > inner)) {
        spot.fail("outerConeAngle", "an angle > innerConeAngle");
      }
      light.cos_inner = static_cast<float>(std::cos(inner));
      light.cos_outer = static_cast<float>(std::cos(outer));
      spot.warn_unread(warnings);
    } else if (light.kind == LightKind::kSpot) {
      light.cos_inner = 1;
      light.cos_outer = static_cast<float>(std::sqrt(0.5));
    }
    r.warn_unread(warnings);
    out.push_back(light);
  };
  const auto& node = document.element("nodes", static_cast<std::size_t>(node_index));
  document.read_extension(node, node_path, "KHR_lights_punctual", [&](const JsonReader& r) {
    const nlohmann::json* lights = nullptr;
    document.read_extension(document.json, "", "KHR_lights_punctual",
                            [&](const JsonReader& top) { lights = top.has("lights") ? &top.raw("lights") : nullptr; });
    const std::size_t num_lights = lights != nullptr && lights->is_array() ? lights->size() : 0;
    const int light = r.index("light", num_lights, "lights");
    if (light < 0) {
      r.fail("light", "the index of a light");
    }
    const nlohmann::json& value = (*lights)[static_cast<std::size_t>(light)];
    const std::string path = "/extensions/KHR_lights_punctual/lights/" + std::to_string(light);
    read_light(JsonReader(value, document.file, path));
    relief_light(document, value, path, read_graph, out.back(), warnings);
  });
  return out;
}

std::vector<Transform> khronos_instances(const GltfDocument& document, int node_index, Warnings& warnings)
{
  std::vector<Transform> out;
  const auto read = [&](const JsonReader& r) {
    if (!r.has("attributes")) {
      r.fail("attributes", "an object");
    }
    const JsonReader attributes = r.object("attributes");
    const AccessorView t =
        open_instance_attribute(document, attributes, "TRANSLATION", AccessorKind::kFloatOrNormalized, 3);
    const AccessorView q =
        open_instance_attribute(document, attributes, "ROTATION", AccessorKind::kFloatOrNormalized, 4);
    const AccessorView s = open_instance_attribute(document, attributes, "SCALE", AccessorKind::kFloatOrNormalized, 3);
    const std::size_t count = std::max({t.count, q.count, s.count});
    for (const AccessorView* view : {&t, &q, &s}) {
      if (view->count != 0 && view->count != count) {
        attributes.fail("", "attributes of equal counts",
                        std::to_string(view->count) + " and " + std::to_string(count) + " elements");
      }
    }
    if (count == 0) {
      attributes.fail("", "TRANSLATION, ROTATION or SCALE");
    }
    const auto translations = read_instance_attribute<3>(t);
    const auto rotations = read_instance_attribute<4>(q);
    const auto scales = read_instance_attribute<3>(s);
    out.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      Trs trs;
      if (!translations.empty()) std::copy_n(translations[i].begin(), 3, trs.translation.begin());
      if (!rotations.empty()) std::copy_n(rotations[i].begin(), 4, trs.rotation.begin());
      if (!scales.empty()) std::copy_n(scales[i].begin(), 3, trs.scale.begin());
      out.push_back(transform_from_trs(trs));
    }
    r.warn_unread(warnings);
  };
  document.read_extension(document.element("nodes", static_cast<std::size_t>(node_index)),
                          "/nodes/" + std::to_string(node_index), "EXT_mesh_gpu_instancing", read);
  return out;
}

std::vector<std::array<float, 4>> khronos_instance_values(const GltfDocument& document,
                                                          int node_index,
                                                          const std::string& name,
                                                          std::size_t count)
{
  std::vector<std::array<float, 4>> out;
  const auto read = [&](const JsonReader& r) {
    const JsonReader attributes = r.object("attributes");
    if (!attributes.has(name)) return;
    const int index = attributes.index(name, document.core.accessors.size(), "accessors");
    const AccessorView view =
        accessor_open(document, index, AccessorKind::kFloatOrNormalized, 1, 4, json_path_join(attributes.path(), name));
    if (view.count != count) {
      attributes.fail(name, std::to_string(count) + " elements, as TRANSLATION has", std::to_string(view.count));
    }
    const auto n = static_cast<std::size_t>(view.num_components);
    std::vector<float> numbers(count * n);
    accessor_read_floats(view, 0, count, numbers.data());
    out.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      out[i] = {0, 0, 0, 1};
      std::copy_n(numbers.begin() + static_cast<std::ptrdiff_t>(i * n), n, out[i].begin());
      if (n == 1) out[i] = {numbers[i], numbers[i], numbers[i], 1};
    }
  };
  document.read_extension(document.element("nodes", static_cast<std::size_t>(node_index)),
                          "/nodes/" + std::to_string(node_index), "EXT_mesh_gpu_instancing", read);
  return out;
}

}  // namespace relief
