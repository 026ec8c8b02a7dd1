// What `auto` chooses displacement methods by: the seconds that a render would take by each.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "displacement/method.h"

namespace relief {

/// Seconds that all rays take, building included.
/// @param num_micro_triangles  0: the method does not tessellate
double method_seconds(const MethodCost& cost, std::uint64_t num_micro_triangles, double num_rays);

/// A method that may be chosen for a mesh.
struct MethodOffer {
  DisplacementMethod method = kDefaultMethod;
  MethodCost cost = {};
  std::uint64_t num_micro_triangles = 0;  ///< as method_seconds has it
  std::uint64_t bytes = 0;                ///< while it is built
  double preparation_seconds = 0;         ///< besides
};

struct DisplacementChoice {
  DisplacementMethod method = kDefaultMethod;
  std::string reason;  ///< "0.9 s by tessellate (210 MiB) against 2.1 s by chord"
};

/// The method that takes the least time; those that tessellate count if building them needs no more than what is left of
/// the allowance.
/// @param offers  the first one takes no memory
DisplacementChoice displacement_choose(std::span<const MethodOffer> offers,
                                       double num_rays,
                                       std::uint64_t allowance_bytes);

}  // namespace relief
