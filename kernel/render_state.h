// What a render goes on from that was ended at any moment: taken and put back by the integrator, stored by exporters.
#pragma once

#include <cstdint>
#include <vector>

#include "kernel/counters.h"

namespace relief {

/// Of the photon pass, before the turn that is under way; its photons are traced again.
struct PhotonPassState {
  std::uint32_t photons_a_pass = 0;
  float first_radius = 0, first_radius_in_media = 0;  ///< metres; 0: not known yet
  std::uint64_t stored = 0;
  double seconds = 0;
  std::uint32_t passes = 0;  ///< with those left out
  std::uint32_t maps = 0;    ///< of the last of them, that are in use
  double served = 0;         ///< samples of the whole window that these have brought light to
};

/// All but the film's sums. A pass over the picture may be under way: it goes on with those of its tiles that have not had it,
/// as large as it was begun, so that every sum has the order that it would have had.
struct RenderState {
  std::uint32_t done_samples = 0;           ///< of the passes before
  std::uint32_t pass_samples = 0;           ///< of the pass that is under way
  std::vector<int> active;                  ///< tiles that the pass is for
  std::vector<std::uint32_t> tile_samples;  ///< of all tiles; of active ones done_samples, or those and the pass's
  PhotonPassState photons;

  // These only tell what the render has cost.
  double seconds = 0;
  Counters counters;
  std::vector<double> stage_seconds;
  std::uint64_t most_displacement_steps = 0, first_nonfinite = ~std::uint64_t{0};
};

/// A state with its film.
struct SavedRender {
  RenderState state;
  int width = 0, height = 0;  ///< of the window that is rendered, pixels
  std::vector<float> sums;    ///< row by row, all of a pixel's side by side
};

}  // namespace relief
