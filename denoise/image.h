// What a denoiser is given and what it gives back: plain views of planes, so that it knows of no film and of no file.
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <vector>

namespace relief {

/// One channel of an image owned elsewhere. Strides are in floats; row 0 is the top. Null: there is none.
struct PlaneView {
  const float* first = nullptr;
  std::ptrdiff_t pixel_stride = 1, row_stride = 0;

  float at(int x, int y) const { return first[x * pixel_stride + y * row_stride]; }
};

/// Features in the order in which denoisers get them: albedo R, G, B; normal X, Y, Z; depth.
inline constexpr std::size_t kNumFeatures = 7;

/// What is known of a rendered picture: means of each pixel's samples, linear.
struct DenoiseInput {
  int width = 0, height = 0;
  std::array<PlaneView, 3> beauty;
  std::array<PlaneView, 3> half;      ///< mean of the even-numbered samples
  std::array<PlaneView, 3> variance;  ///< of the beauty
  PlaneView samples;
  std::array<PlaneView, kNumFeatures> features;
  std::array<PlaneView, kNumFeatures> features_half;  ///< as `half`; null: the features have no noise
  const std::atomic<bool>* stop = nullptr;            ///< gives up when it becomes true; null: never

  bool is_stopped() const { return stop != nullptr && *stop; }
};

/// Thrown by a denoiser that was told to give up.
struct DenoiseStopped : std::runtime_error {
  DenoiseStopped() : std::runtime_error("interrupted") {}
};

/// @error DenoiseStopped, if it was told to give up
inline void denoise_check_stop(const DenoiseInput& input)
{
  if (input.is_stopped()) throw DenoiseStopped();
}

/// Part of a pixel's n samples that are even-numbered: 1 if there are fewer than two, or no number that counts any, so that
/// there is no other half.
inline float even_share_of(float n) { return n >= 2 && std::isfinite(n) ? std::ceil(n / 2) / n : 1.0f; }

/// A denoised picture: R, G, B of pixel after pixel, rows from the top.
struct DenoiseResult {
  std::vector<float> color;
  /// Estimated root mean square error left, averaged over the neighbourhood: the mean of its square over the picture is the
  /// picture's squared error. Empty if the denoiser does not know.
  std::vector<float> error;
  double rmse = 0;  ///< of the picture; NaN: not known
};

}  // namespace relief
