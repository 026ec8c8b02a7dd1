#include "integrator/wavefront.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <new>
#include <utility>

namespace relief {

namespace {

constexpr std::size_t kAlignment = 64;

constexpr std::size_t aligned(std::size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

/// Columns are staggered by one cache line each: at equal distances of a power of two they would all fall into the
/// same few sets of a cache.
constexpr std::size_t kStagger = kAlignment;

constexpr std::size_t kNumQueues = 4 + kNumSurfaceKernels;
constexpr std::size_t kNumColumns = kPathStateBytes / 4 + kShadowRayBytes / 4 + 1 + kNumQueues;

using Clock = std::chrono::steady_clock;

}  // namespace

void Wavefront::Free::operator()(void* p) const { std::free(p); }

std::size_t Wavefront::bytes(bool caustics)
{
  return (kNumColumns + (caustics ? kNumCausticColumns : 0u)) * (aligned(kBatchPaths * 4) + kStagger);
}

template <class T>
T* Wavefront::column(std::size_t count)
{
  T* start = reinterpret_cast<T*>(memory_.get() + used_);
  used_ += aligned(count * sizeof(T)) + kStagger;
  return start;
}

Wavefront::Wavefront(bool caustics) : memory_(static_cast<std::byte*>(std::aligned_alloc(kAlignment, bytes(caustics))))
{
  if (memory_ == nullptr) throw std::bad_alloc();
#define X(type, name) state_.name = column<type>(kBatchPaths);
#include "kernel/state/path_state_fields.inc"
#undef X
  state_.capacity = kBatchPaths;
  for (float** p :
       {&shadow_.O_x, &shadow_.O_y, &shadow_.O_z, &shadow_.D_x, &shadow_.D_y, &shadow_.D_z, &shadow_.t_max,
        &shadow_.cone_width, &shadow_.cone_spread, &shadow_.gain_r, &shadow_.gain_g, &shadow_.gain_b, &visibility_}) {
    *p = column<float>(kBatchPaths);
  }
  shadow_.path = column<std::uint32_t>(kBatchPaths);
  shadow_.scatterings = column<std::uint32_t>(kBatchPaths);
  for (QueueView* queue : {&active_, &next_, &lights_, &background_}) {
    queue->paths = column<std::uint32_t>(kBatchPaths);
  }
  for (QueueView& queue : surfaces_) queue.paths = column<std::uint32_t>(kBatchPaths);
  if (!caustics) return;
  CausticStateView& c = state_.caustic;
  for (float** p : {&c.irradiance_r, &c.irradiance_g, &c.irradiance_b, &c.radiance_r, &c.radiance_g, &c.radiance_b}) {
    *p = column<float>(kBatchPaths);
  }
  c.wi = column<std::uint32_t>(kBatchPaths);
}

void Wavefront::note_displacement(const DisplacementWork& work)
{
  counters.displaced_prisms += work.total.prisms;
  counters.displaced_bounds += work.total.bounds;
  counters.displaced_texels += work.total.texels;
  counters.displaced_inversions += work.total.inversions;
  most_displacement_steps = std::max(most_displacement_steps, work.most_steps);
}

void Wavefront::clear_queues()
{
  lights_.size = background_.size = next_.size = shadow_.size = 0;
  for (QueueView& queue : surfaces_) queue.size = 0;
}

void Wavefront::record_rays() const
{
  for (std::uint32_t i = 0; i < active_.size; ++i) {
    const std::uint32_t p = active_.paths[i];
    recorder->push_back({false,
                         {state_.O_x[p], state_.O_y[p], state_.O_z[p]},
                         {state_.D_x[p], state_.D_y[p], state_.D_z[p]},
                         state_.t_min[p],
                         state_.t_max[p],
                         state_.hit_t[p]});
  }
}

void Wavefront::record_shadow_rays() const
{
  for (std::uint32_t i = 0; i < shadow_.size; ++i) {
    recorder->push_back({true,
                         {shadow_.O_x[i], shadow_.O_y[i], shadow_.O_z[i]},
                         {shadow_.D_x[i], shadow_.D_y[i], shadow_.D_z[i]},
                         0.0f,
                         shadow_.t_max[i],
                         visibility_[i] > 0.0f ? shadow_.t_max[i] : 0.0f});
  }
}

void Wavefront::run(const KernelGlobals& g,
                    const Accel& accel,
                    const StageTable& stages,
                    const std::vector<std::uint8_t>& surface_kernel,
                    const Batch& batch)
{
  RELIEF_ASSERT(batch.num_paths() <= kBatchPaths);
  Clock::time_point last = Clock::now();
  const auto charge = [&](Stage stage) {
    const Clock::time_point now = Clock::now();
    seconds[static_cast<std::size_t>(stage)] += std::chrono::duration<double>(now - last).count();
    last = now;
  };

  stages.generate(g, state_, batch);
  if (g.caustics.enabled) {
    for (float* p : {state_.caustic.radiance_r, state_.caustic.radiance_g, state_.caustic.radiance_b}) {
      std::fill_n(p, batch.num_paths(), 0.0f);
    }
  }
  active_.size = batch.num_paths();
  for (std::uint32_t i = 0; i < active_.size; ++i) active_.paths[i] = i;
  counters.camera_rays += active_.size;
  charge(Stage::kGenerate);

  DisplacementWork displacement;
  for (bool camera = true; active_.size > 0; camera = false) {
    if (!camera) counters.bounce_rays += active_.size;
    clear_queues();
    intersect_closest(g, accel, state_, active_, camera, surface_kernel.data(), surfaces_.data(), lights_, background_,
                      displacement);
    if (recorder != nullptr) record_rays();
    charge(Stage::kIntersectClosest);

    if (g.caustics.enabled) {
      for (const QueueView& queue : surfaces_) stages.gather_photons(g, state_, queue);
      charge(Stage::kGatherPhotons);
    }
    stages.shade_background(g, state_, background_, counters);
    stages.shade_light(g, state_, lights_, next_);
    for (std::size_t k = 0; k < surfaces_.size(); ++k) {
      if (surfaces_[k].size > 0) stages.shade_surface[k](g, state_, surfaces_[k], next_, shadow_, counters);
    }
    charge(Stage::kShade);

    counters.shadow_rays += shadow_.size;
    intersect_shadow(g, accel, state_, shadow_, visibility_, displacement);
    if (recorder != nullptr) record_shadow_rays();
    charge(Stage::kIntersectShadow);
    stages.accumulate_shadow(g, state_, shadow_, visibility_);
    std::swap(active_, next_);
    charge(Stage::kShade);
  }

  note_displacement(displacement);
  stages.finish(g, state_, batch, counters, first_nonfinite);
  charge(Stage::kFilm);
}

void Wavefront::trace_photons(const KernelGlobals& g,
                              const Accel& accel,
                              const StageTable& stages,
                              const std::vector<std::uint8_t>& surface_kernel,
                              const PhotonSourcesView& sources,
                              std::uint64_t first,
                              std::uint32_t count,
                              std::vector<Photon>& out)
{
  RELIEF_ASSERT(count <= kBatchPaths);
  const Clock::time_point start = Clock::now();
  counters.photon_paths += count;
  active_.size = 0;
  stages.emit_photons(g, sources, state_, first, count, active_);
  DisplacementWork displacement;
  while (active_.size > 0) {
    clear_queues();
    counters.photon_rays += active_.size;
    intersect_closest(g, accel, state_, active_, false, surface_kernel.data(), surfaces_.data(), lights_, background_,
                      displacement);
    const std::size_t before = out.size();
    out.resize(before + active_.size);
    PhotonQueueView photons{out.data() + before, 0};
    for (const QueueView& queue : surfaces_) {
      stages.shade_photons(g, sources, state_, queue, next_, photons);
    }
    out.resize(before + photons.size);
    // Area lights let rays pass.
    for (std::uint32_t i = 0; i < lights_.size; ++i) {
      const std::uint32_t path = lights_.paths[i];
      state_.t_min[path] = next_float_up(state_.hit_t[path]);
      queue_push(next_, path);
    }
    std::swap(active_, next_);
  }
  note_displacement(displacement);
  seconds[static_cast<std::size_t>(Stage::kTracePhotons)] +=
      std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace relief
