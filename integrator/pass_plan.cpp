#include "integrator/pass_plan.h"

#include <algorithm>
#include <cmath>

#include "integrator/checkpoint.h"

namespace relief {

namespace {

/// Samples between two times at which noise is judged.
constexpr std::uint32_t kJudgingStep = 16;

}  // namespace

std::uint32_t samples_wanted(const RenderOptions& options)
{
  return options.num_samples > 0 ? options.num_samples : static_cast<std::uint32_t>(options.settings.samples);
}

std::uint32_t pass_samples(std::uint32_t done,
                           std::uint32_t wanted,
                           double seconds,
                           double time_limit,
                           bool is_watched,
                           std::uint32_t most)
{
  std::uint32_t samples = std::min({wanted - done, kMostPassSamples - done % kMostPassSamples, most});
  const double per_sample = done > 0 ? seconds / done : 0.0;
  if (is_watched) {
    constexpr double kLongestSeconds = 4;
    constexpr std::uint32_t kLeastSamples = 4;  // fewer would leave batches too empty
    samples = std::min(samples, std::max(done, 1u));
    if (per_sample * kMostPassSamples > kLongestSeconds) {
      samples = std::min(samples, std::max(kLeastSamples, static_cast<std::uint32_t>(kLongestSeconds / per_sample)));
    }
  }
  if (time_limit > 0) {
    samples = std::min(samples, std::max(done, 1u));
    const double fitting = per_sample > 0 ? (time_limit - seconds) / per_sample : 1.0;
    // In doubles: a day has room for more samples of a small picture than 32 bits can count.
    samples = static_cast<std::uint32_t>(std::min<double>(samples, std::max(1.0, fitting)));
  }
  return samples;
}

std::uint32_t least_samples(const RenderSettings& settings)
{
  constexpr int kLeast = 4;
  if (settings.min_samples > 0) return static_cast<std::uint32_t>(std::max(settings.min_samples, kLeast));
  const double automatic = std::ceil(16.0 / std::pow(static_cast<double>(settings.noise_threshold), 0.3));
  return static_cast<std::uint32_t>(std::clamp(automatic, double{kLeast}, double{kLargestSettingInt}));
}

bool is_judged_after(const RenderSettings& settings, std::uint32_t samples)
{
  return settings.noise_threshold > 0 && samples % kJudgingStep == 0 && samples > least_samples(settings) + 1;
}

NoiseJudging judging_after(const RenderSettings& settings, std::uint32_t done, std::uint32_t wanted)
{
  const std::uint32_t before = std::max(done, least_samples(settings) + 1);
  return {before - before % kJudgingStep + kJudgingStep, kJudgingStep, wanted};
}

}  // namespace relief
