#include "scene/feature_set.h"

#include <vector>

namespace relief {
namespace {

bool has_texture(const TextureRef& ref) { return ref.texture_index >= 0; }

void add_material(FeatureSet& f, const Material& m)
{
  for (const TextureRef* ref : material_textures(m)) {
    f.textures |= has_texture(*ref);
  }
  f.normal_maps |= has_texture(m.normal_texture) || has_texture(m.clearcoat_normal_texture);
  f.transparency |= m.alpha_mode != AlphaMode::kOpaque;
  f.transmission |= m.transmission > 0;
  f.volume |= m.transmission > 0 && m.thickness > 0;
  f.clearcoat |= m.clearcoat > 0;
  f.sheen |= !is_zero(m.sheen_color);
  f.metal |= m.metallic > 0;
  f.displacement |= m.displacement_index >= 0;
}

}  // namespace

std::array<const TextureRef*, 12> material_textures(const Material& m)
{
  return {&m.base_color_texture,
          &m.metallic_roughness_texture,
          &m.normal_texture,
          &m.emission_texture,
          &m.transmission_texture,
          &m.clearcoat_texture,
          &m.clearcoat_roughness_texture,
          &m.clearcoat_normal_texture,
          &m.sheen_color_texture,
          &m.sheen_roughness_texture,
          &m.specular_texture,
          &m.specular_color_texture};
}

bool material_casts_caustics(const Material& material)
{
  constexpr float kRoughest = 0.5f;
  const bool bends = material.transmission > 0 || material.metallic >= 0.5f;
  return bends && !material.unlit && material.roughness <= kRoughest;
}

FeatureSet feature_set_detect(const Scene& scene)
{
  FeatureSet f;
  std::vector<bool> placed(scene.meshes.size(), false);
  std::size_t num_emitters = scene.lights.size();
  for (const Instance& instance : scene.instances) {
    const auto mesh = static_cast<std::size_t>(instance.mesh_index);
    const Material& material = scene.materials[static_cast<std::size_t>(instance.material_index)];
    add_material(f, material);
    f.instances |= placed[mesh];
    placed[mesh] = true;
    f.caustic_casters |= (instance.flags & kCausticCaster) != 0;
    if ((!is_zero(material.emission) || material.emission_index >= 0) && !material.unlit) {
      f.mesh_lights = true;
      num_emitters += scene.meshes[mesh].triangles.size();
    }
  }
  for (const Light& light : scene.lights) {
    const bool has_area = light.kind == LightKind::kRectangle || light.kind == LightKind::kDisk;
    (has_area ? f.area_lights : f.delta_lights) = true;
  }
  f.environment = !is_zero(scene.environment.color);
  f.environment_map = f.environment && scene.environment.texture_index >= 0;
  num_emitters += f.environment ? 1 : 0;
  constexpr std::size_t kFew = 8;
  f.many_lights = num_emitters > kFew;
  for (const SceneCamera& camera : scene.cameras) {
    f.depth_of_field |= camera.camera.aperture_radius > 0;
  }
  return f;
}

}  // namespace relief
