#include "denoise/candidate.h"

#include <algorithm>

#include "denoise/fit_tile.h"

namespace relief {

namespace {

/// Averages are over 13×13 pixels, more in the middle: with the weight of as many as kNumAveraged.
constexpr int kReach = 3;
constexpr float kNumAveraged = 108;

/// The part of a row's pixel in its own average of averages over 2·reach + 1 pixels.
std::vector<float> own_parts(int size)
{
  const auto count = [&](int at) {
    return static_cast<float>(std::min(at + kReach, size - 1) - std::max(at - kReach, 0) + 1);
  };
  std::vector<float> parts;
  for (int at = 0; at < size; ++at) {
    float sum = 0;
    for (int other = std::max(at - kReach, 0); other <= std::min(at + kReach, size - 1); ++other) {
      sum += 1.0f / count(other);
    }
    parts.push_back(sum / count(at));
  }
  return parts;
}

/// Averages a plane over neighbourhoods without the pixel itself.
void average_around(Plane& plane)
{
  const std::vector<float> own_x = own_parts(plane.width()), own_y = own_parts(plane.height());
  const Plane raw = plane;
  box_filter(plane, kReach);
  box_filter(plane, kReach);
  for_pixels(plane, [&](int x, int y) {
    const float own = own_x[static_cast<std::size_t>(x)] * own_y[static_cast<std::size_t>(y)];
    plane.row(y)[x] = own < 1 ? (plane.row(y)[x] - own * raw.row(y)[x]) / (1 - own) : 0.0f;
  });
}

/// What the pixels' errors are measured by: else the brightest of a neighbourhood would decide for all.
Plane scale_make(const Halves& halves)
{
  Plane scale(halves.is_known.width(), halves.is_known.height());
  for_pixels(scale, [&](int x, int y) {
    for (const Plane& variance : halves.variance) scale.row(y)[x] += variance.row(y)[x];
  });
  box_filter(scale, kReach);
  return scale;
}

/// Averages of what a candidate gains, all channels together.
struct GainPlanes {
  Plane square, noise, noise_square;
};

GainPlanes gain_planes(const Halves& halves, const Candidate& candidate, const Plane& scale)
{
  const int width = scale.width(), height = scale.height();
  GainPlanes planes{Plane(width, height), Plane(width, height), Plane(width, height)};
  for_pixels(scale, [&](int x, int y) {
    if (!(scale.row(y)[x] > 0)) return;
    for (std::size_t c = 0; c < 3; ++c) {
      const Gain gain = gain_of(halves, candidate, c, x, y);
      planes.square.row(y)[x] += gain.square / scale.row(y)[x];
      planes.noise.row(y)[x] += gain.noise / scale.row(y)[x];
    }
    planes.noise_square.row(y)[x] = planes.noise.row(y)[x] * planes.noise.row(y)[x];
  });
  for (Plane* plane : {&planes.square, &planes.noise, &planes.noise_square}) average_around(*plane);
  return planes;
}

/// The candidates' best parts; the choice is smoothed.
Candidate best_of(const Halves& halves, const std::vector<Candidate>& candidates, const Plane& scale)
{
  constexpr int kSmoothing = 1;
  std::vector<Plane> parts;
  for (const Candidate& candidate : candidates) {
    GainPlanes planes = gain_planes(halves, candidate, scale);
    for_pixels(scale, [&](int x, int y) { planes.square.row(y)[x] -= 2 * planes.noise.row(y)[x]; });
    parts.push_back(std::move(planes.square));
  }
  for_pixels(scale, [&](int x, int y) {
    std::size_t best = 0;
    for (std::size_t i = 1; i < parts.size(); ++i) {
      if (parts[i].row(y)[x] < parts[best].row(y)[x]) best = i;
    }
    for (std::size_t i = 0; i < parts.size(); ++i) parts[i].row(y)[x] = i == best ? 1.0f : 0.0f;
  });
  Candidate to(scale.width(), scale.height());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    box_filter(parts[i], kSmoothing);
    for_pixels(scale, [&](int x, int y) {
      for (std::size_t c = 0; c < 3; ++c) {
        to.color[c].row(y)[x] += parts[i].row(y)[x] * candidates[i].color[c].row(y)[x];
        to.difference[c].row(y)[x] += parts[i].row(y)[x] * candidates[i].difference[c].row(y)[x];
      }
    });
  }
  return to;
}

/// How far a pixel moves towards a candidate.
float part_of(const GainPlanes& averages, int x, int y)
{
  const float square = averages.square.row(y)[x], noise = averages.noise.row(y)[x];
  // A few bright pixels may make all of the average: then it is known badly, and the less is done.
  const float variance = std::max(averages.noise_square.row(y)[x] - noise * noise, 0.0f) / kNumAveraged;
  const float known = noise > 0 ? noise - variance / noise : 0.0f;
  // Where nothing moves it does not matter.
  return !(known > 0) ? 0.0f : known < square ? known / square : 1.0f;
}

/// 0 where all is certain as far as patches reach, so that there is nothing to denoise.
Plane uncertain_around(const Halves& halves)
{
  Plane uncertain(halves.is_known.width(), halves.is_known.height());
  for_pixels(uncertain, [&](int x, int y) {
    const bool any = std::any_of(halves.variance.begin(), halves.variance.end(),
                                 [&](const Plane& variance) { return variance.row(y)[x] > 0; });
    uncertain.row(y)[x] = any ? 1.0f : 0.0f;
  });
  box_filter(uncertain, kFitPatch);
  return uncertain;
}

}  // namespace

Gain gain_of(const Halves& halves, const Candidate& candidate, std::size_t channel, int x, int y)
{
  const float even = halves.even_share.row(y)[x], off = candidate.color[channel].row(y)[x] - halves.mean(channel, x, y);
  const float noise = halves.color[0][channel].row(y)[x] - halves.color[1][channel].row(y)[x];
  const float shares = halves.independent[channel].row(y)[x] * even * (1.0f - even);
  return {off * off, shares * noise * (noise - candidate.difference[channel].row(y)[x]), shares * noise * noise};
}

Candidate candidates_combine(const Halves& halves, const std::vector<Candidate>& candidates)
{
  const Plane scale = scale_make(halves), uncertain = uncertain_around(halves);
  Candidate to = best_of(halves, candidates, scale);
  const GainPlanes averages = gain_planes(halves, to, scale);
  for_pixels(scale, [&](int x, int y) {
    const bool stays = !(halves.is_known.row(y)[x] > 0) || !(uncertain.row(y)[x] > 0);
    const float part = stays ? 0.0f : part_of(averages, x, y);
    for (std::size_t c = 0; c < 3; ++c) {
      const float mean = halves.mean(c, x, y);
      const float difference = halves.color[0][c].row(y)[x] - halves.color[1][c].row(y)[x];
      float &value = to.color[c].row(y)[x], &left = to.difference[c].row(y)[x];
      value = mean + part * (value - mean);
      left = difference + part * (left - difference);
      // No light is negative; a regression may be.
      if (mean >= 0) value = std::max(value, 0.0f);
    }
  });
  return to;
}

}  // namespace relief
