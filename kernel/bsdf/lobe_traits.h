// What is known of a kind of lobe, whatever its parameters.
#pragma once

#include <cstdint>

namespace relief {

/// kBoth: on either side, as meant; kSphere: all around a strand, which has none.
enum class LobeSides : std::uint8_t { kReflect, kTransmit, kBoth, kSphere };

/// Whether lamps fade, as the surface's own normal sees them, that a bent normal sees.
enum class LobeFading : std::uint8_t { kNever, kBefore52, kAlways };

struct MixtureTraits {
  LobeSides sides = LobeSides::kReflect;
  bool is_diffuse = true;      ///< counts as diffuse, as lobe_sample has it
  bool is_microfacet = false;  ///< for what its version of Cycles makes of bent normals, see mixture_reaches
  bool has_fresnel = false;    ///< f is multiplied by the reflectance of the half angle
  LobeFading fading = LobeFading::kAlways;
  bool leaves_below = false;  ///< before 5.0 what it samples may leave on the wrong side of the true surface
  bool is_strand = false;     ///< has all directions around a strand: frames as in hair.h
};

}  // namespace relief
