#include "scene/material_traits.h"

#include "kernel/graph/graph_program.h"

namespace relief {

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

bool material_is_light(const Material& material)
{
  return (!is_zero(material.emission) || material.emission_index >= 0) && !material.unlit &&
         material.displacement_index < 0;
}

bool material_casts_caustics(const Material& material)
{
  constexpr float kRoughest = 0.5f;
  // Photons are spread over a radius, which bumps are narrower than: on a woven torus of copper, rough by 0.3, a third of their
  // light was lost, in six times the time. Paths find what goes in so many directions.
  constexpr float kRoughestDisplaced = 0.25f;
  const bool bends = material.transmission > 0 || material.metallic >= 0.5f;
  const float roughest = material.displacement_index >= 0 ? kRoughestDisplaced : kRoughest;
  return bends && !material.unlit && !material.depends_on_ray && material.roughness <= roughest;
}

bool material_lets_light_in(const Material& m)
{
  const bool may_be_given = (m.graph_outputs >> static_cast<unsigned>(GraphOutput::transmission) & 1u) != 0;
  return (m.transmission > 0.0f || may_be_given) && (m.thickness > 0.0f || m.has_closures);
}

bool material_has_no_surface(const Material& m)
{
  return m.alpha_mode == AlphaMode::kBlend && m.base_alpha == 0.0f && !m.has_closures && m.graph_index < 0 &&
         is_zero(m.emission);
}

}  // namespace relief
