// One half of the samples, filtered by what the other half and the features say is alike.
#pragma once

#include <vector>

#include "denoise/candidate.h"
#include "denoise/features.h"

namespace relief {

/// Filters one half in all widths (kFitWidths) and adds it, by its share of the samples, to the widths' candidates.
/// @param half      0 or 1
/// @param variance  of a half's colours, smoothed; its border filled, as that of the colours
/// @param input     may tell it to give up
/// @error DenoiseStopped
/// @cost  about 80 bytes a pixel while it runs
void half_filter(const DenoiseInput& input,
                 const Halves& halves,
                 std::size_t half,
                 const ColorPlanes& variance,
                 const FeatureColumns& features,
                 std::vector<Candidate>& candidates);

}  // namespace relief
