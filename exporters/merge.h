// Joins renders of the same frame with different samples, by their seeds or as parts of one sequence, into the picture that one longer render would have given.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "exporters/picture.h"

namespace relief {

struct MergeOptions {
  /// Accept pictures whose metadata name another scene or frame, or no seed. The same samples are never accepted twice:
  /// that would only look like less noise.
  bool force = false;
};

struct MergeResult {
  Picture picture;  ///< types and windows of the first; seeds joined by ","; samples and seconds summed
  std::vector<std::string> warnings;  ///< e.g. layers that not every picture has, and that are therefore left out
};

/// Reads and joins at least two pictures, one at a time. With n the samples of a pixel (layer samples.N, else the attribute
/// relief:samples):
///   means            Σ n·x / Σ n; depth and position, which are means over samples that hit, with n·A
///   half             likewise with the number of even-numbered samples, ⌈n/2⌉
///   variance         Σ n²·v / (Σ n)²: that of the mean above, for independent renders. Of parts of one sequence it is too
///                    much, as they complete each other
///   samples          Σ n
///   ids              of the first picture that sampled the pixel
/// Sums are in double precision.
/// @error InputError naming the files: unreadable, different sizes or windows, the same samples twice, other scene or frame, no
///        samples; not finished, as a checkpoint, and without the layer of samples. OutOfMemory, before the sums are made
/// @cost  8 bytes a value for the sums, and one picture more
MergeResult merge_pictures(std::span<const std::filesystem::path> files, const MergeOptions& options = {});

}  // namespace relief
