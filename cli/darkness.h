// How much of a picture is as good as black, and whether what glows in a scene shows it.
#pragma once

#include "kernel/film/film_layout.h"
#include "scene/scene.h"

namespace relief {

/// Of the pixels that show something, by their coverage.
struct Darkness {
  double covered = 0;    ///< sum of coverages
  double dim = 0;        ///< of those that are hard to tell from black beside anything lit
  double brightest = 0;  ///< greatest value of a channel

  /// Whether so much is dim that the picture needs other light.
  bool is_mostly_dim() const { return dim > kMostDim * covered; }
  static constexpr double kMostDim = 0.75;
};

/// @pre the film has a beauty
Darkness darkness_of(const FilmView& film);

/// Whether a scene's camera sees enough of it by what glows, by a small picture of few samples.
/// @param scene  without lights or an environment
/// @param camera  into its cameras
/// @return  true if the camera sees nothing
bool emission_shows(const Scene& scene, std::size_t camera);

}  // namespace relief
