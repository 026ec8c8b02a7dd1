// The closures that a surface may be a weighted list of: their kinds, their inputs, and which of their variants are meant.
// What they scatter stands in mixture_make.h.
#pragma once

#include <cstdint>

#include "kernel/math/vec.h"

namespace relief {

enum class ClosureKind : std::uint8_t {
#define CLOSURE(name, Type, most_lobes) name,
#include "kernel/bsdf/closure_inputs.inc"
  kCount
};

// Inputs of each kind at a point: floats alone, in the order of the list.
#define CLOSURE(name, Type, most_lobes) struct Type##Inputs {
#define COLOR(name, json, r, g, b) Vec3f name{r, g, b};
#define NUMBER(name, json, value) float name = value;
#define VECTOR(name, json) Vec3f name{};
#define END() \
  }           \
  ;
#include "kernel/bsdf/closure_inputs.inc"

/// Inputs of closures: what is not finite counts as 0, and no product of a few of them overflows.
RELIEF_KERNEL float closure_input(float x)
{
  constexpr float kLargest = 1e8f;
  return x - x == 0.0f ? clamp(x, -kLargest, kLargest) : 0.0f;
}

/// Microfacets of glossy, refraction, glass, metallic and Principled closures.
enum class ClosureDistribution : std::uint8_t { kGgx, kMultiscatterGgx, kBeckmann, kAshikhminShirley, kSharp };

/// How radii and albedos are meant of what scatters below the surface, by Blender 5.2's names.
enum class SubsurfaceMethod : std::uint8_t {
  kRandomWalk,  ///< radii are mean free paths: 5.2's own
  kLegacy,      ///< 4π times as long as these: "Random Walk" of 4.0 to 5.1, "Fixed Radius" before
  kSkin,        ///< how far light comes up from where it went below; "Random Walk" up to 3.6
  kProfile,     ///< as kLegacy, and what is walked there is a profile of distances here: "Christensen-Burley"
};

/// What a fibre's absorption follows from.
enum class FibrePigment : std::uint8_t { kColor, kMelanin, kAbsorption };

/// The version of Blender whose Cycles gives the numbers: from it on, up to the next.
enum class Maths : std::uint8_t { k34, k43, k52 };

/// What a closure is of the kinds that have two.
enum class ClosureVariant : std::uint8_t {
  kFirst,
  kGlossyToon,
  kPhysicalMetal,  ///< by its complex index
  kHairThrough,    ///< what goes through strands
};

/// One closure of a material.
struct SurfaceClosureSpec {
  ClosureKind kind = ClosureKind::diffuse;
  ClosureDistribution distribution = ClosureDistribution::kGgx;
  Maths maths = Maths::k34;
  ClosureVariant variant = ClosureVariant::kFirst;
  SubsurfaceMethod subsurface = SubsurfaceMethod::kRandomWalk;
  FibrePigment pigment = FibrePigment::kColor;
  std::uint16_t first_result = 0;  ///< its weight among the program's results, then its inputs, float by float
};

}  // namespace relief
