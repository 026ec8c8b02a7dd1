// What subsurface scattering is given: data alone, which paths keep while they are below a surface. subsurface.h evaluates it.
#pragma once

#include <cstdint>

#include "kernel/bsdf/lobe_traits.h"
#include "kernel/math/vec.h"

namespace relief {

/// How paths enter.
enum class SubsurfaceEntry : std::uint8_t {
  kDiffuse,    ///< as if scattered below the surface: up to Blender 3.6
  kRefracted,  ///< by rough facets
  kEither,     ///< half of them each way, facets of roughness 1: "skin" since 4.0
  kProfile,    ///< they do not: they leave as far away as a profile says
};

struct Subsurface {
  static constexpr MixtureTraits kTraits{.sides = LobeSides::kBoth};
  Vec3f albedo;  ///< of the surface as a whole, above 0
  Vec3f
      radius;  ///< mean free path, metres, world; if not is_similar, of the even medium that this one is like; of a profile its own; 0: does not enter
  float anisotropy = 0;
  bool is_similar = false;  ///< the single albedo is that of an even medium made similar; else it is a fit
  float entry_alpha = 1, entry_ior = 1.4f;  ///< of the facets
  SubsurfaceEntry entry = SubsurfaceEntry::kDiffuse;
  bool leaves_by_fresnel =
      false;  ///< what leaves is darkened at grazing angles, as the Principled BSDF up to 3.6 has it
};

}  // namespace relief
