#include "integrator/checkpoint.h"

#include <algorithm>
#include <functional>
#include <utility>

namespace relief {

namespace {

bool fits(const SavedRender& saved, const Film& film, std::uint32_t wanted)
{
  const RenderState& state = saved.state;
  if (saved.width != film.width() || saved.height != film.height() || saved.sums.size() != film.sums().size() ||
      state.tile_samples.size() != static_cast<std::size_t>(film.num_tiles())) {
    return false;
  }
  if (state.done_samples >= wanted || state.pass_samples == 0 || state.pass_samples > wanted - state.done_samples ||
      state.pass_samples > kMostPassSamples || state.active.empty()) {
    return false;
  }
  // In rising order as it was begun: a tile that stood there twice would be rendered by two threads at once.
  if (std::adjacent_find(state.active.begin(), state.active.end(), std::greater_equal<>()) != state.active.end()) {
    return false;
  }
  const auto is_sane = [&](std::uint32_t samples) { return samples <= wanted; };
  const auto is_of_pass = [&](int tile) {
    if (tile < 0 || tile >= film.num_tiles()) return false;
    const std::uint32_t samples = state.tile_samples[static_cast<std::size_t>(tile)];
    return samples == state.done_samples || samples == state.done_samples + state.pass_samples;
  };
  return std::all_of(state.tile_samples.begin(), state.tile_samples.end(), is_sane) &&
         std::all_of(state.active.begin(), state.active.end(), is_of_pass);
}

}  // namespace

void state_add_work(RenderState& state, const Workers& workers)
{
  state.stage_seconds.resize(kNumStages);
  for (const Wavefront& worker : workers) {
    counters_add(state.counters, worker.counters);
    for (std::size_t s = 0; s < kNumStages; ++s) state.stage_seconds[s] += worker.seconds[s];
    state.most_displacement_steps =
        std::max<std::uint64_t>(state.most_displacement_steps, worker.most_displacement_steps);
    state.first_nonfinite = std::min(state.first_nonfinite, worker.first_nonfinite);
  }
}

bool state_restore(SavedRender& saved, Film& film, Wavefront& worker, std::uint32_t wanted)
{
  if (!fits(saved, film, wanted)) return false;
  const RenderState& state = saved.state;
  film.restore(std::move(saved.sums), state.tile_samples);
  counters_add(worker.counters, state.counters);
  const std::size_t num_stages = std::min(worker.seconds.size(), state.stage_seconds.size());
  for (std::size_t s = 0; s < num_stages; ++s) worker.seconds[s] += state.stage_seconds[s];
  worker.most_displacement_steps = static_cast<std::uint32_t>(state.most_displacement_steps);
  worker.first_nonfinite = state.first_nonfinite;
  return true;
}

void CheckpointSchedule::run(const std::function<void()>& save)
{
  const Clock::time_point before = Clock::now();
  save();
  const Clock::time_point after = Clock::now();
  // The next one has to be whole when the interval is over. Where writing takes longer than that, half of the time is left to
  // the render.
  next_ = std::max(before + duration(interval_) - (after - before), after + (after - before));
}

}  // namespace relief
