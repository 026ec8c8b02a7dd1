// Sends photons where the picture shows them: of many casters the camera may look at one, and the light of all others would be
// traced for nothing. Half of all photons are shared out by how much each source's bring to where camera paths go. The other half
// is shared out as before, so that nothing is lost that a pilot did not see; and as the chance of every source is known, the mean
// stays what it is.
//
// After Grittmann, Pérard-Gayot, Slusallek and Křivánek 2018, "Efficient Caustic Rendering with Lightweight Photon Mapping", who
// guide the directions of emission, too.
#pragma once

#include <vector>

#include "integrator/photon_pass.h"

namespace relief {

/// Shares out photons by the light that they bring to a picture.
/// @param sources  get other chances, and more photons within a radius, if that is worth it
/// @param groups   the first source of each group, and the number of sources: those of one are told apart no further
/// @param photons  of each group, with all of its power
/// @param looks    where camera paths meet surfaces, world
/// @param radius   of photons, metres: within it they are seen
/// @return         how many times as dense photons lie where they show, by what they bring there; 1 if nothing was changed
double photon_sources_guide(PhotonSources& sources,
                            const std::vector<std::size_t>& groups,
                            const std::vector<std::vector<Photon>>& photons,
                            const std::vector<Vec3f>& looks,
                            float radius);

}  // namespace relief
