// What shading kernels are instantiated for. A bit that is absent compiles its code and registers away, so a scene
// pays only for what one of its materials uses. Few bits: every one doubles the number of possible kernels.
#pragma once

#include <array>
#include <string_view>

#include "kernel/bsdf/material.h"
#include "kernel/graph/graph_program.h"

namespace relief {

enum FeatureBit : unsigned {
  kFeatureTextures = 1u << 0,      ///< some material looks a texture up
  kFeatureNormalMaps = 1u << 1,    ///< normal or clearcoat normal maps
  kFeatureTransparency = 1u << 2,  ///< alpha below one: masked or blended surfaces
  kFeatureTransmission = 1u << 3,  ///< glass: solid or thin walls, and absorption inside
  kFeatureLayers = 1u << 4,        ///< clearcoat or sheen
  kFeatureMetal = 1u << 5,         ///< metallic above zero
  kFeatureCaustics = 1u << 6,      ///< photons bring part of the light: of the render, not of a material
  kFeatureGraphs = 1u << 7,        ///< value graphs give factors
  kFeatureMixture = 1u << 8,       ///< closures scatter, in place of glTF's layered material
};
/// Of the bits, from the first on.
inline constexpr std::array<std::string_view, 9> kFeatureNames = {
    "textures", "normal maps", "transparency", "transmission", "layers", "metal", "caustics", "graphs", "closures"};
inline constexpr unsigned kFeatureAll = (1u << 6) - 1u;  ///< of materials, but for graphs

/// Bits that one material needs; a scene needs the union over its materials.
RELIEF_KERNEL unsigned feature_mask_of(const Material& m)
{
  const auto has = [](const TextureRef& ref) { return ref.texture_index >= 0; };
  unsigned mask = 0;
  if (m.has_closures) {
    mask = kFeatureGraphs | kFeatureMixture | kFeatureTransmission | kFeatureTextures;
    return m.alpha_mode != AlphaMode::kOpaque ? mask | kFeatureTransparency : mask;
  }
  if (has(m.base_color_texture) || has(m.metallic_roughness_texture) || has(m.emission_texture) ||
      has(m.transmission_texture) || has(m.clearcoat_texture) || has(m.clearcoat_roughness_texture) ||
      has(m.sheen_color_texture) || has(m.sheen_roughness_texture) || has(m.specular_texture) ||
      has(m.specular_color_texture)) {
    mask |= kFeatureTextures;
  }
  if (has(m.normal_texture) || (m.clearcoat > 0.0f && has(m.clearcoat_normal_texture))) mask |= kFeatureNormalMaps;
  if (m.alpha_mode != AlphaMode::kOpaque) mask |= kFeatureTransparency;
  if (m.transmission > 0.0f) mask |= kFeatureTransmission;
  if (m.clearcoat > 0.0f || max_component(m.sheen_color) > 0.0f) mask |= kFeatureLayers;
  if (m.metallic > 0.0f) mask |= kFeatureMetal;
  if (m.graph_index >= 0) {
    const auto gives = [&m](GraphOutput output) { return (m.graph_outputs >> static_cast<int>(output) & 1u) != 0; };
    mask |= kFeatureGraphs;
    if (gives(GraphOutput::metallic)) mask |= kFeatureMetal;
    if (gives(GraphOutput::transmission)) mask |= kFeatureTransmission;
    if (gives(GraphOutput::clearcoat) || gives(GraphOutput::sheen_color)) mask |= kFeatureLayers;
  }
  return mask;
}

}  // namespace relief
