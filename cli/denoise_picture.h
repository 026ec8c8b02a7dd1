// Denoising of what a render or a file holds: layers in, layers out.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/App.hpp>

#include "denoise/image.h"
#include "exporters/picture.h"

namespace relief {

enum class Denoiser : std::uint8_t { kNone, kBuiltin, kOidn };

/// Names of the denoisers in enumerator order.
inline constexpr std::array<std::string_view, 3> kDenoiserNames = {"none", "builtin", "oidn"};

/// Adds --denoise. @param least  first that may be chosen
CLI::Option* add_denoiser(CLI::App& command, Denoiser& denoiser, Denoiser least);

/// Fails now if a denoiser is not there. @error as for denoise_oidn
void denoiser_require(Denoiser denoiser);

/// Layers that a denoiser is given, as bits of Aov.
AovMask denoiser_aovs();

/// What a denoiser made of a picture.
struct DenoisedPicture {
  int width = 0;
  Denoiser denoiser = Denoiser::kNone;
  DenoiseResult result;
  double seconds = 0;

  /// The layers `denoised` and `denoised_error`. They look at this.
  std::vector<ChannelView> channels() const;
  /// Denoised R, G, B under the beauty's names, to show or compare it; likewise.
  ImageView beauty(int height) const;
  /// relief:denoiser, relief:denoised_rmse and relief:denoise_seconds.
  Attributes attributes() const;
  /// One line about it for people.
  std::string report() const;
};

/// All channels of a film or of a picture.
ImageView all_channels(const FilmView& film);
ImageView all_channels(const Picture& picture);

/// Denoises.
/// @param layers  with all channels of denoiser_aovs; those of denoising_half may be missing: features then have no noise
/// @param file    for messages
/// @param stop    gives up when it becomes true; null: never
/// @error InputError that names the layers that are missing; as for denoise_oidn; DenoiseStopped
DenoisedPicture denoise_picture(Denoiser denoiser,
                                const ImageView& layers,
                                const std::string& file,
                                const std::atomic<bool>* stop = nullptr);

}  // namespace relief
