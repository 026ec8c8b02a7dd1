// A material as glTF means it: constants and texture references. surface_params.h turns it into the parameters of
// one surface point.
#pragma once

#include "kernel/texture/texture_view.h"

namespace relief {

enum class AlphaMode : std::uint8_t { kOpaque, kMask, kBlend };

/// glTF 2.0 metallic-roughness with KHR_materials_{transmission, ior, volume, clearcoat, sheen, specular,
/// emissive_strength, unlit}. Defaults are glTF's.
struct Material {
  Vec3f base_color{1, 1, 1};  ///< linear Rec.709
  float base_alpha = 1;
  TextureRef base_color_texture;  ///< sRGB; alpha in A
  float metallic = 1, roughness = 1;
  TextureRef metallic_roughness_texture;  ///< roughness in G, metallic in B, linear
  TextureRef normal_texture;              ///< tangent space, linear
  float normal_scale = 1;
  Vec3f emission{0, 0, 0};  ///< radiance: emissiveFactor × emissiveStrength
  TextureRef emission_texture;
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  float alpha_cutoff = 0.5f;
  bool double_sided = false;  ///< glTF: back faces are culled for the *camera* only in rasterizers; here emission
                              ///< is one-sided unless set, and everything else ignores it
  bool unlit = false;         ///< base colour is emitted, nothing is reflected

  float transmission = 0;
  TextureRef transmission_texture;  ///< R
  float ior = 1.5f;
  float thickness = 0;  ///< 0: thin wall; otherwise the mesh bounds a volume

  float clearcoat = 0, clearcoat_roughness = 0;
  TextureRef clearcoat_texture;            ///< R
  TextureRef clearcoat_roughness_texture;  ///< G
  TextureRef clearcoat_normal_texture;
  float clearcoat_normal_scale = 1;

  Vec3f sheen_color{0, 0, 0};
  float sheen_roughness = 0;
  TextureRef sheen_color_texture;      ///< sRGB
  TextureRef sheen_roughness_texture;  ///< A

  float specular = 1;  ///< KHR_materials_specular factor on the dielectric F0 and F90
  Vec3f specular_color{1, 1, 1};
  TextureRef specular_texture;        ///< A
  TextureRef specular_color_texture;  ///< sRGB

  int graph_index = -1;  ///< into KernelGlobals::graphs, which gives factors in place of those above; −1: none
  std::uint32_t graph_outputs = 0;  ///< bit GraphOutput: what it gives
  bool has_closures = false;        ///< the graph's closures scatter, in place of everything above but the emission;
                                    ///< transmission, metallic, roughness sum them up
  bool scatters_below = false;      ///< some closure lets paths go below the surface
  bool depends_on_ray = false;      ///< what the graph gives differs by how a ray came, so that photons cannot be told
  int transparency_index = -1;      ///< into KernelGlobals::graphs: its transparent closures alone; −1: none
  int emission_index = -1;          ///< likewise: what gives its emission, or part of it; −1: no graph does

  int medium_index = -1;        ///< into Scene::media: what fills what its meshes bound; −1: nothing
  bool is_boundary = false;     ///< there is no surface, but for what begins or ends there
  int displacement_index = -1;  ///< into Scene::displacements; −1: none
};

}  // namespace relief
