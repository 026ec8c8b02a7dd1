// A picture of a render that is not finished, with what the render goes on from: an OpenEXR file of two parts. The first is a
// picture like any other; the second, "relief.state", has the film's sums as channels of floats, uncompressed, and the rest as
// attributes, one of which is a hash of all of it.
#pragma once

#include <optional>
#include <span>

#include "exporters/exr.h"
#include "kernel/render_state.h"

namespace relief {

/// What stands in the second part.
struct ExrState {
  const RenderState& state;
  std::span<const float> sums;  ///< of the film's window, as SavedRender has them
  std::string fingerprint;      ///< of what decides the picture
};

/// Writes both. @error OutputError; an older file is then as it was
/// @param more  as for a film alone
void exr_write(const std::filesystem::path& path,
               const FilmView& film,
               const Attributes& attributes,
               const ExrOptions& options,
               const ExrState& state,
               const std::vector<ChannelView>& more = {});

/// Reads the second part.
/// @return nothing if there is no file, no such part, or one of another fingerprint
/// @error OutOfMemory; InputError, with what was expected and found, if the file is no OpenEXR file or the part is damaged
std::optional<SavedRender> exr_state_load(const std::filesystem::path& path, const std::string& fingerprint);

}  // namespace relief
