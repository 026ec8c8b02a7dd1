#include "cli/denoise_picture.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "cli/arguments.h"
#include "denoise/builtin.h"
#include "denoise/oidn.h"
#include "exporters/errors.h"
#include "scene/memory.h"

namespace relief {

namespace {

constexpr Aov kNeeded[] = {
    Aov::kBeauty,          Aov::kHalf,          Aov::kVariance, Aov::kSampleCount, Aov::kDenoisingAlbedo,
    Aov::kDenoisingNormal, Aov::kDenoisingDepth};

/// Looks up channels by name and remembers what is missing.
class Planes {
 public:
  explicit Planes(const ImageView& layers) : layers_(layers) {}

  /// Channel i of a layer; null if there is none.
  PlaneView find(Aov aov, std::size_t i) const
  {
    const std::string name = channel_name(kAovInfo[static_cast<std::size_t>(aov)], i);
    const auto found = std::find_if(layers_.channels.begin(), layers_.channels.end(),
                                    [&](const ChannelView& channel) { return channel.name == name; });
    if (found == layers_.channels.end()) return {};
    return {found->first, found->pixel_stride, found->row_stride};
  }

  PlaneView get(Aov aov, std::size_t i)
  {
    const PlaneView plane = find(aov, i);
    const std::string layer(kAovInfo[static_cast<std::size_t>(aov)].name);
    if (plane.first == nullptr && std::find(missing_.begin(), missing_.end(), layer) == missing_.end()) {
      missing_.push_back(layer);
    }
    return plane;
  }

  const std::vector<std::string>& missing() const { return missing_; }

 private:
  const ImageView& layers_;
  std::vector<std::string> missing_;
};

DenoiseInput input_of(const ImageView& layers, const std::string& file)
{
  DenoiseInput input;
  input.width = layers.width;
  input.height = layers.height;
  Planes planes(layers);
  for (std::size_t c = 0; c < 3; ++c) {
    input.beauty[c] = planes.get(Aov::kBeauty, c);
    input.half[c] = planes.get(Aov::kHalf, c);
    input.variance[c] = planes.get(Aov::kVariance, c);
    input.features[c] = planes.get(Aov::kDenoisingAlbedo, c);
    input.features[3 + c] = planes.get(Aov::kDenoisingNormal, c);
  }
  input.samples = planes.get(Aov::kSampleCount, 0);
  input.features[6] = planes.get(Aov::kDenoisingDepth, 0);
  for (std::size_t i = 0; i < kNumFeatures; ++i) input.features_half[i] = planes.find(Aov::kDenoisingHalf, i);
  if (planes.missing().empty()) return input;
  std::string wanted;
  for (const Aov aov : kNeeded) {
    wanted += (wanted.empty() ? "" : ",") + std::string(kAovInfo[static_cast<std::size_t>(aov)].name);
  }
  throw InputError(file, fmt::format("to denoise it takes the layers of --aov {},denoising_half; it lacks {}", wanted,
                                     fmt::join(planes.missing(), ", ")));
}

}  // namespace

CLI::Option* add_denoiser(CLI::App& command, Denoiser& denoiser, Denoiser least)
{
  const auto first = static_cast<std::ptrdiff_t>(least);
  const auto set = [&denoiser](const std::string& text) {
    denoiser =
        static_cast<Denoiser>(std::find(kDenoiserNames.begin(), kDenoiserNames.end(), text) - kDenoiserNames.begin());
  };
  return command
      .add_option_function<std::string>("--denoise", set,
                                        "Denoiser: builtin, or oidn if Open Image Denoise is installed")
      ->check(one_of({kDenoiserNames.begin() + first, kDenoiserNames.end()}))
      ->default_str(std::string(kDenoiserNames[static_cast<std::size_t>(denoiser)]));
}

void denoiser_require(Denoiser denoiser)
{
  if (denoiser == Denoiser::kOidn) oidn_require();
}

AovMask denoiser_aovs()
{
  AovMask mask = aov_bit(Aov::kDenoisingHalf);
  for (const Aov aov : kNeeded) mask |= aov_bit(aov);
  return mask;
}

std::vector<ChannelView> DenoisedPicture::channels() const
{
  std::vector<ChannelView> views;
  for (const auto& [layer, pixels] : {std::pair("denoised", &result.color), {"denoised_error", &result.error}}) {
    for (std::ptrdiff_t c = 0; c < 3; ++c) {
      views.push_back(
          {pixels->data() + c, 3, std::ptrdiff_t{3} * width, ChannelType::kFloat, std::string(layer) + "." + "RGB"[c]});
    }
  }
  return views;
}

ImageView DenoisedPicture::beauty(int height) const
{
  ImageView view{width, height, {}};
  for (std::ptrdiff_t c = 0; c < 3; ++c) {
    view.channels.push_back(
        {result.color.data() + c, 3, std::ptrdiff_t{3} * width, ChannelType::kFloat, std::string(1, "RGB"[c])});
  }
  return view;
}

Attributes DenoisedPicture::attributes() const
{
  Attributes attributes = {{"relief:denoiser", std::string(kDenoiserNames[static_cast<std::size_t>(denoiser)])},
                           {"relief:denoise_seconds", attribute_number(seconds)}};
  if (std::isfinite(result.rmse)) attributes["relief:denoised_rmse"] = attribute_number(result.rmse);
  return attributes;
}

std::string DenoisedPicture::report() const
{
  const std::string error =
      std::isfinite(result.rmse) ? fmt::format("estimated RMSE {:.3g}", result.rmse) : "error unknown";
  return fmt::format("denoised ({}) in {:.2f} s, {}", kDenoiserNames[static_cast<std::size_t>(denoiser)], seconds,
                     error);
}

ImageView all_channels(const FilmView& film)
{
  ImageView view{film.width, film.height, {}};
  for (const AovInfo& info : kAovInfo) {
    for (ChannelView& channel : film_layer(film, info.aov).channels) view.channels.push_back(std::move(channel));
  }
  return view;
}

ImageView all_channels(const Picture& picture)
{
  ImageView view{picture.width, picture.height, {}};
  for (const Channel& channel : picture.channels) {
    view.channels.push_back({channel.values.data(), 1, picture.width, channel.type, channel.name});
  }
  return view;
}

DenoisedPicture denoise_picture(Denoiser denoiser,
                                const ImageView& layers,
                                const std::string& file,
                                const std::atomic<bool>* stop)
{
  DenoiseInput input = input_of(layers, file);
  input.stop = stop;
  // Measured with 1920 x 1080 pixels.
  constexpr std::uint64_t kPixelBytes = 350;
  memory_require(kPixelBytes * static_cast<std::uint64_t>(input.width) * static_cast<std::uint64_t>(input.height),
                 "denoising " + file);
  const auto start = std::chrono::steady_clock::now();
  DenoisedPicture picture{layers.width, denoiser,
                          denoiser == Denoiser::kOidn ? denoise_oidn(input) : denoise_builtin(input), 0};
  picture.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return picture;
}

}  // namespace relief
