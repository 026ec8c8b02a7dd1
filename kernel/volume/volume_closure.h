// The closures that RELIEF_volume is a weighted list of: which there are, and where their inputs are. What they come to is in
// medium_closures.h.
#pragma once

#include <cstdint>

namespace relief {

enum class VolumeClosureKind : std::uint8_t { kAbsorption, kScatter, kPrincipled, kEmission };

/// One closure of a medium.
struct VolumeClosureSpec {
  VolumeClosureKind kind = VolumeClosureKind::kAbsorption;
  std::uint16_t first_result = 0;  ///< its weight among the program's results, then its inputs, float by float
};

}  // namespace relief
