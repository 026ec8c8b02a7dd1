// The closures that RELIEF_volume is a weighted list of: which there are, and where their inputs are. What they come to is in
// medium_closures.h.
#pragma once

#include <cstdint>

namespace relief {

enum class VolumeClosureKind : std::uint8_t {
#define VOLUME_CLOSURE(name, Type) name,
#include "kernel/volume/volume_closures.inc"
};

/// One closure of a medium.
struct VolumeClosureSpec {
  VolumeClosureKind kind = VolumeClosureKind::kAbsorption;
  std::uint16_t first_result = 0;  ///< its weight among the program's results, then its inputs, float by float
};

/// An input of a closure.
struct VolumeInput {
  const char* name;        ///< in files
  bool is_color;           ///< three numbers, else one
  float value;             ///< of all of them, where it is not given
  bool is_signed = false;  ///< below 0 it means something
};

// A closure is a type with
//   kName      in files
//   kInputs    VolumeInput, in their order
//   kPhases    how many phase functions it has
// and two functions, both of which read those inputs that they need, from the first on:
//   medium_add(Type, weight, VolumeNumbers&, Medium&)    adds what it comes to at a point; the weight is above 0
//   rate_add(Type, weight, in, MediumRate&)              adds a bound of that; in.number() and in.color() are ValueBounds

}  // namespace relief
