// Cryptomatte: ids made of names, by which compositors tell objects, materials and assets apart in a picture.
// Friedman and Jones 2015, "Fully Automatic ID Mattes with Support for Motion Blur and Transparency"; the file format by its
// specification 1.2.0, https://github.com/Psyop/Cryptomatte/blob/master/specification
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "kernel/film/film_layout.h"
#include "scene/scene.h"

namespace relief {

/// Ids of instances, materials, and instances' assets, in this order; empty: not asked for.
using CryptomatteIds = std::array<std::vector<float>, kNumCryptomattes>;

/// MurmurHash3_x86_32 with seed 0.
/// @source A. Appleby, https://github.com/aappleby/smhasher
std::uint32_t cryptomatte_hash(std::string_view name);

/// The hash as a float that is neither denormal, infinite nor NaN: where the exponent's bits are all alike, its lowest is
/// turned over.
float cryptomatte_id(std::uint32_t hash);

/// @param aov_mask  bit i: enumerator i of Aov is asked for
CryptomatteIds cryptomatte_ids(const Scene& scene, AovMask aov_mask);

/// Name of a Cryptomatte's layers in a file, which two digits follow.
/// @param index  0 … kNumCryptomattes − 1
std::string_view cryptomatte_layer(int index);

/// JSON of a Cryptomatte's names and their ids as eight hexadecimal digits.
/// @param index  0 … kNumCryptomattes − 1
std::string cryptomatte_manifest(const Scene& scene, int index);

}  // namespace relief
