// How many samples a pass of a render has, and when noise is judged.
#pragma once

#include <cstdint>

#include "integrator/render.h"

namespace relief {

/// Samples that a render takes of a pixel at most.
std::uint32_t samples_wanted(const RenderOptions& options);

/// Samples of the next pass. Passes are as large as a batch holds, but at the start, where the first picture and the
/// first measure of speed are wanted soon, and towards a time limit, which is kept by asking for less. Whatever was asked for
/// before, they come to multiples of kMostPassSamples, after which noise is judged.
/// @param is_watched  the picture is shown between passes: they begin with one sample, and slow ones are smaller
/// @param most        samples after which a checkpoint may be due
std::uint32_t pass_samples(std::uint32_t done,
                           std::uint32_t wanted,
                           double seconds,
                           double time_limit,
                           bool is_watched,
                           std::uint32_t most);

/// Samples after which pixels are judged for the first time: Cycles' numbers.
std::uint32_t least_samples(const RenderSettings& settings);

/// Whether pixels are judged after a number of samples.
bool is_judged_after(const RenderSettings& settings, std::uint32_t samples);

/// When pixels are judged once some samples are done.
NoiseJudging judging_after(const RenderSettings& settings, std::uint32_t done, std::uint32_t wanted);

}  // namespace relief
