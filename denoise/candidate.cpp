#include "denoise/candidate.h"

#include <algorithm>

#include "denoise/fit_tile.h"

namespace relief {

namespace {

/// Squared error of a pixel's value, by chance far from the truth: only sums tell something. See the header.
float raw_error(const Halves& halves, const Candidate& candidate, std::size_t c, int x, int y)
{
  const float even = halves.even_share.row(y)[x], off = candidate.color[c].row(y)[x] - halves.mean(c, x, y);
  const float noise = halves.color[0][c].row(y)[x] - halves.color[1][c].row(y)[x];
  return off * off + even * (1.0f - even) * noise * (2.0f * candidate.difference[c].row(y)[x] - noise);
}

/// Each candidate's part in the picture, from errors averaged over the neighbourhood.
std::vector<Plane> parts_choose(const Halves& halves, const std::vector<Candidate>& candidates)
{
  // Averages over 13×13 pixels, more in the middle; the choice is smoothed by less.
  constexpr int kReach = 3, kSmoothing = 2;
  const int width = halves.is_known.width(), height = halves.is_known.height();
  Plane scale(width, height);
  for_pixels(scale, [&](int x, int y) {
    for (const Plane& variance : halves.variance) scale.row(y)[x] += variance.row(y)[x];
  });
  box_filter(scale, kReach);
  std::vector<Plane> parts;
  for (const Candidate& candidate : candidates) {
    Plane& error = parts.emplace_back(width, height);
    for_pixels(error, [&](int x, int y) {
      if (!(scale.row(y)[x] > 0)) return;
      float sum = 0;
      for (std::size_t c = 0; c < 3; ++c) sum += raw_error(halves, candidate, c, x, y);
      error.row(y)[x] = sum / scale.row(y)[x];
    });
    box_filter(error, kReach);
    box_filter(error, kReach);
  }
  for_pixels(scale, [&](int x, int y) {
    std::size_t best = 0;
    for (std::size_t i = 1; i < parts.size(); ++i) {
      if (parts[i].row(y)[x] < parts[best].row(y)[x]) best = i;
    }
    for (std::size_t i = 0; i < parts.size(); ++i) parts[i].row(y)[x] = i == best ? 1.0f : 0.0f;
  });
  for (Plane& part : parts) box_filter(part, kSmoothing);
  return parts;
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

Candidate candidates_choose(const Halves& halves, const std::vector<Candidate>& candidates)
{
  const int width = halves.is_known.width(), height = halves.is_known.height();
  const std::vector<Plane> parts = parts_choose(halves, candidates);
  const Plane uncertain = uncertain_around(halves);
  Candidate to(width, height);
  for_pixels(uncertain, [&](int x, int y) {
    const bool stays = !(halves.is_known.row(y)[x] > 0) || !(uncertain.row(y)[x] > 0);
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const float part = stays ? (i + 1 == candidates.size() ? 1.0f : 0.0f) : parts[i].row(y)[x];
      for (std::size_t c = 0; c < 3; ++c) {
        to.color[c].row(y)[x] += part * candidates[i].color[c].row(y)[x];
        to.difference[c].row(y)[x] += part * candidates[i].difference[c].row(y)[x];
      }
    }
    // No light is negative; a regression may be.
    for (std::size_t c = 0; c < 3; ++c) {
      float& value = to.color[c].row(y)[x];
      if (halves.mean(c, x, y) >= 0) value = std::max(value, 0.0f);
    }
  });
  return to;
}

}  // namespace relief
