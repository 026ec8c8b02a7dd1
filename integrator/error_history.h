// The error of a picture over the time of its rendering.
#pragma once

#include <vector>

#include "integrator/film.h"
#include "integrator/render.h"
#include "kernel/statistics.h"

namespace relief {

class ErrorHistory {
 public:
  /// All must outlive it.
  ErrorHistory(const Film& film, const RenderOptions& options, const FilmWindow& window)
      : film_(film), options_(options), window_(window)
  {
  }

  /// Whether there are twice the samples of the last point, or the first from which an error can be told.
  bool is_due() const;

  /// Adds a point. Nobody may be adding samples.
  /// @param seconds  of sampling so far
  void add(double seconds);

  /// All points, the last being that of the finished picture.
  /// @param stats  with the seconds, samples and errors of that
  std::vector<ErrorPoint> finish(const Statistics& stats) &&;

 private:
  void add(ErrorPoint point);

  const Film& film_;
  const RenderOptions& options_;
  const FilmWindow& window_;
  std::vector<ErrorPoint> points_;
};

}  // namespace relief
