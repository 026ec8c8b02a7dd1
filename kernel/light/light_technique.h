// How direct light is estimated.
#pragma once

#include <cstdint>

namespace relief {

/// All three converge to the same picture, which tests rely on; the default has the least noise. Delta lights can only be sampled,
/// delta lobes only be followed: each is always done by the one that can.
enum class LightTechnique : std::uint8_t { kMis, kLightSampling, kBsdfSampling };

}  // namespace relief
