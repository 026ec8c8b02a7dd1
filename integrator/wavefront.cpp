#include "integrator/wavefront.h"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <numeric>
#include <utility>

#include "integrator/graph_stop.h"
#include "integrator/media.h"
#include "integrator/subsurface_stage.h"
#include "kernel/stage/path_access.h"

namespace relief {

namespace {

using Clock = std::chrono::steady_clock;

/// Searches after which every path of a batch has ended: it scatters, passes transparent surfaces, and passes each lamp twice
/// between two such events at most. A search that does not get on from a hit would otherwise last for ever.
std::uint64_t most_searches(const KernelGlobals& g)
{
  const auto scatterings = static_cast<std::uint64_t>(g.limits.total) + 2;
  const std::uint64_t boundaries = g.media != nullptr ? kMostBoundaries : 0;
  return scatterings * (2 * std::uint64_t{g.num_area_lights} + 1) + static_cast<std::uint64_t>(g.limits.transparent) +
         boundaries + 2;
}

/// Of paths where shadow catchers are alone.
WavefrontColumns columns_alone(WavefrontColumns columns)
{
  columns.caustics = columns.light_passes = columns.catchers = false;
  return columns;
}

/// Takes a path out of media that bound no shadow catcher.
void leave_all_but_catchers(const KernelGlobals& g, MediumState& m)
{
  const auto stays = [&g](std::int32_t instance) {
    return instance == kWholeWorld || (g.instances[instance].flags & kShadowCatcher) != 0;
  };
  m.size = static_cast<std::int32_t>(std::stable_partition(m.inside, m.inside + m.size, stays) - m.inside);
}

}  // namespace

std::size_t Wavefront::bytes(const WavefrontColumns& columns)
{
  return sizeof(Memory) + (columns.caustics ? sizeof(CausticMemory) : 0u) +
         (columns.motion ? sizeof(MotionMemory) : 0u) + (columns.facets ? kColumnEntries * sizeof(FacetState) : 0u) +
         (columns.media ? kColumnEntries * sizeof(MediumState) : 0u) +
         (columns.light_passes ? kColumnEntries * sizeof(LightPassState) : 0u) +
         (columns.gloss ? kColumnEntries * sizeof(LightGloss) : 0u) +
         (columns.subsurface ? sizeof(SubsurfaceMemory) : 0u) +
         (columns.catchers ? kBatchPaths * sizeof(CatcherState) + bytes(columns_alone(columns)) : 0u);
}

Wavefront::Wavefront(const WavefrontColumns& columns)
    : memory_(std::make_unique_for_overwrite<Memory>()), state_(memory_->state), shadow_(memory_->shadow)
{
  auto queue = std::begin(memory_->queues);
  for (QueueView* q : {&active_, &next_}) q->paths = *queue++;
  for (QueueView& q : met_.surfaces) q.paths = *queue++;
  for (QueueView* q : {&met_.lights, &met_.background}) q->paths = *queue++;
  if (columns.media) {
    medium_memory_ = std::make_unique_for_overwrite<MediumState[]>(kColumnEntries);
    state_.media = medium_memory_.get();
  }
  if (columns.light_passes) {
    light_pass_memory_ = std::make_unique_for_overwrite<LightPassState[]>(kColumnEntries);
    state_.light_passes = light_pass_memory_.get();
  }
  if (columns.gloss) {
    gloss_memory_ = std::make_unique_for_overwrite<LightGloss[]>(kColumnEntries);
    state_.scatter_gloss = gloss_memory_.get();
  }
  if (columns.facets) {
    facet_memory_ = std::make_unique_for_overwrite<FacetState[]>(kColumnEntries);
    state_.facets = facet_memory_.get();
  }
  if (columns.motion) {
    motion_memory_ = std::make_unique_for_overwrite<MotionMemory>();
    state_.motion = {motion_memory_->time, motion_memory_->instances, motion_memory_->meshes};
  }
  if (columns.catchers) {
    catcher_memory_ = std::make_unique<CatcherState[]>(kBatchPaths);
    state_.catchers = catcher_memory_.get();
    alone_ = std::make_unique<Wavefront>(columns_alone(columns));
  }
  if (columns.subsurface) {
    subsurface_memory_ = std::make_unique_for_overwrite<SubsurfaceMemory>();
    state_.subsurface.entries = subsurface_memory_->entries;
    state_.subsurface.entered.paths = subsurface_memory_->entered;
  }
  if (!columns.caustics) return;
  caustic_memory_ = std::make_unique_for_overwrite<CausticMemory>();
  CausticStateView& c = state_.caustic;
  c.irradiance = &caustic_memory_->irradiance;
  c.radiance = &caustic_memory_->radiance;
  c.wi = caustic_memory_->wi;
  c.bounces = caustic_memory_->bounces;
  c.root = caustic_memory_->root;
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
  next_.size = shadow_.size = 0;
  met_.lights.size = met_.background.size = 0;
  for (QueueView& queue : met_.surfaces) queue.size = 0;
}

void Wavefront::trace_shadows(const KernelGlobals& g,
                              const Accel& accel,
                              ShadowStart start,
                              DisplacementWork& displacement)
{
  counters.shadow_rays += shadow_.size;
  intersect_shadow(g, accel, state_, shadow_, start, memory_->visibility, displacement);
  if (recorder != nullptr) record_shadow_rays();
}

void Wavefront::record_rays() const
{
  for (std::uint32_t i = 0; i < active_.size; ++i) {
    const std::uint32_t p = active_.paths[i];
    recorder->push_back(
        {false, state_.O[p], state_.D[p], state_.t_min[p], state_.t_max[p], state_.hit_t[p], state_.pixel[p]});
  }
}

void Wavefront::record_shadow_rays() const
{
  for (std::uint32_t i = 0; i < shadow_.size; ++i) {
    recorder->push_back({true, shadow_.O[i], shadow_.D[i], 0.0f, shadow_.t_max[i],
                         !is_zero(memory_->visibility[i]) ? shadow_.t_max[i] : 0.0f, state_.pixel[shadow_.path[i]]});
  }
}

Vec3f Wavefront::first_radiance(std::uint32_t pixel) const
{
  const std::uint32_t i = static_cast<std::uint32_t>(
      std::find(state_.pixel.entries, state_.pixel.entries + kBatchPaths, pixel) - state_.pixel.entries);
  RELIEF_ASSERT(i < kBatchPaths);
  Vec3f radiance = state_.direct[i] + state_.indirect[i];
  const CausticStateView& c = state_.caustic;
  if (c.radiance != nullptr) radiance += (*c.radiance)[i];
  return radiance;
}

void Wavefront::charge(Stage stage)
{
  const Clock::time_point now = Clock::now();
  seconds[static_cast<std::size_t>(stage)] += std::chrono::duration<double>(now - last_).count();
  last_ = now;
}

void Wavefront::search(const Tools& tools, bool camera, DisplacementWork& displacement)
{
  const auto& [g, accel, stages] = tools;
  clear_queues();
  intersect_closest(g, accel, state_, active_, camera, met_, displacement);
  if (recorder != nullptr) record_rays();
  charge(Stage::kIntersectClosest);
  if (media == nullptr) return;
  stages.shade_media(g, state_, met_, next_, shadow_);
  charge(Stage::kShade);
  trace_shadows(g, accel, ShadowStart::kInMedium, displacement);
  charge(Stage::kIntersectShadow);
  stages.accumulate_shadow(g, state_, shadow_, memory_->visibility);
  shadow_.size = 0;
}

void Wavefront::shade(const Tools& tools, DisplacementWork& displacement)
{
  const auto& [g, accel, stages] = tools;
  if (g.caustics.enabled) {
    for (const QueueView& queue : met_.surfaces) stages.gather_photons(g, state_, queue);
    charge(Stage::kGatherPhotons);
  }
  stages.shade_background(g, state_, met_.background, counters);
  stages.shade_light(g, state_, met_.lights, next_);
  for (std::size_t k = 0; k < kNumSurfaceKernels; ++k) {
    if (met_.surfaces[k].size > 0) stages.shade_surface[k](g, state_, met_.surfaces[k], next_, shadow_, counters);
  }
  charge(Stage::kShade);

  trace_shadows(g, accel, ShadowStart::kAtHit, displacement);
  charge(Stage::kIntersectShadow);
  stages.accumulate_shadow(g, state_, shadow_, memory_->visibility);
  if (QueueView& entered = state_.subsurface.entered; entered.size > 0) {
    charge(Stage::kShade);
    QueueView left{subsurface_memory_->left};
    walk_below_surfaces(g, accel, *stages.walks, state_, entered, left, displacement);
    entered.size = 0;
    charge(Stage::kIntersectClosest);
    if (g.caustics.enabled) stages.gather_photons(g, state_, left);
    shadow_.size = 0;
    stages.leave_surfaces(g, state_, left, next_, shadow_, counters);
    charge(Stage::kShade);
    trace_shadows(g, accel, ShadowStart::kAtHit, displacement);
    charge(Stage::kIntersectShadow);
    stages.accumulate_shadow(g, state_, shadow_, memory_->visibility);
  }
  if (media != nullptr) {
    for (std::uint32_t i = 0; i < next_.size; ++i) medium_follow(state_, next_.paths[i]);
  }
  std::swap(active_, next_);
  charge(Stage::kShade);
}

bool Wavefront::follow(const Tools& tools, bool camera, DisplacementWork& displacement)
{
  // Graphs that were given up gave nothing that may count.
  const auto is_stopped = [&] {
    return displacement.total.stopped ||
           (tools.g.graphs != nullptr && stop != nullptr && stop->load(std::memory_order_relaxed));
  };
  std::uint64_t searches_left = most_searches(tools.g);
  for (; active_.size > 0 && !is_stopped(); camera = false) {
    if (searches_left-- == 0) {
      counters.endless_paths += active_.size;
      break;
    }
    if (!camera) counters.bounce_rays += active_.size;
    search(tools, camera, displacement);
    if (alone_ != nullptr) split_at_catchers(tools.g);
    shade(tools, displacement);
  }
  return !is_stopped();
}

bool Wavefront::run(const KernelGlobals& g,
                    const Accel& accel,
                    const StageTable& stages,
                    const std::vector<std::uint8_t>& surface_kernel,
                    const Batch& batch)
{
  RELIEF_ASSERT(static_cast<std::uint32_t>(batch.width * batch.height) * batch.num_samples <= kBatchPaths);
  RELIEF_ASSERT(alone_ == nullptr || catchers != nullptr);
  last_ = Clock::now();
  met_.surface_kernel = surface_kernel.data();
  const std::uint32_t num_paths = stages.generate(g, state_, batch);
  active_.size = num_paths;
  for (std::uint32_t i = 0; i < active_.size; ++i) active_.paths[i] = i;
  if (g.camera.projection == Projection::kPanoramic) drop_unseen(g);
  if (media != nullptr) media->start(state_, active_);
  if (g.caustics.enabled) {
    for (std::uint32_t i = 0; i < num_paths; ++i) (*state_.caustic.radiance)[i] = Vec3f{};
    std::iota(state_.caustic.root, state_.caustic.root + num_paths, 0u);
    state_.caustic.num_paths = num_paths;
  }
  if (alone_ != nullptr) {
    for (std::uint32_t i = 0; i < kBatchPaths; ++i) state_.catchers[i].is_met = i >= num_paths;
    alone_->active_.size = 0;
  }
  counters.camera_rays += num_paths;
  charge(Stage::kGenerate);

  DisplacementWork displacement;
  displacement.total.stop = stop;
  const GraphStop graphs(stop);
  const Tools tools{g, accel, stages};
  const bool is_done =
      follow(tools, true, displacement) && (alone_ == nullptr || follow_alone(tools, num_paths, displacement));
  note_displacement(displacement);
  if (!is_done) return false;
  stages.finish(g, state_, batch, num_paths, counters, first_nonfinite);
  charge(Stage::kFilm);
  return true;
}

void Wavefront::split_at_catchers(const KernelGlobals& g)
{
  // Forks, which come of scattering, count as having met one.
  const auto is_split = [&](std::uint32_t path) {
    const std::uint32_t flags = g.instances[state_.hit_object[path]].flags;
    if ((flags & (kShadowCatcher | kHoldout)) != kShadowCatcher || state_.catchers[path].is_met) return false;
    return state_.bounces[path] == 0 || (g.clear_alpha >= 0.0f && (state_.flags[path] & kPathCovers) == 0);
  };
  PathState& copies = alone_->state_;
  for (const QueueView& queue : met_.surfaces) {
    for (std::uint32_t i = 0; i < queue.size; ++i) {
      const std::uint32_t path = queue.paths[i];
      if (!is_split(path)) continue;
      CatcherState& c = state_.catchers[path];
      c.is_met = true;
      c.direct = state_.direct[path];
      c.indirect = state_.indirect[path];
      c.caustic = state_.caustic.radiance != nullptr ? Vec3f((*state_.caustic.radiance)[path]) : Vec3f{};
      if (state_.light_passes != nullptr) std::ranges::copy(state_.light_passes[path].light, c.light);
      c.share = light_scalar(state_.throughput[path]);
      // What lies behind changes nothing of how much the film is covered.
      state_.flags[path] |= kPathCovers;
      path_copy(state_, path, copies, path);
      if (const std::uint32_t flags = g.instances[state_.hit_object[path]].flags; (flags & (kMoves | kDeforms)) != 0) {
        copies.motion.instances[path] = state_.motion.instances[path];
        if ((flags & kDeforms) != 0) copies.motion.meshes[path] = state_.motion.meshes[path];
      }
      copies.flags[path] = path_flags_left_to_paths(state_.flags[path]) | kPathSawSurface | kPathSawFeature;
      queue_push(alone_->active_, path);
    }
  }
}

bool Wavefront::follow_alone(const Tools& tools, std::uint32_t num_paths, DisplacementWork& displacement)
{
  Wavefront& alone = *alone_;
  if (alone.active_.size == 0) return true;
  alone.media = media;
  alone.recorder = recorder;
  alone.stop = stop;
  alone.counters = {};
  alone.seconds = {};
  alone.last_ = Clock::now();
  alone.met_.surface_kernel = catchers->surface_kernel->data();
  const QueueView met{alone.active_.paths, alone.active_.size};
  QueueView& background = alone.met_.background;
  alone.clear_queues();
  for (std::uint32_t i = 0; i < met.size; ++i) queue_push(background, met.paths[i]);
  // In a catcher's place the camera would see the surroundings.
  if (tools.g.environment_visible_to_camera) {
    tools.stages.shade_background(tools.g, alone.state_, background, alone.counters);
  }
  for (std::uint32_t i = 0; i < met.size; ++i) {
    const std::uint32_t path = met.paths[i];
    state_.catchers[path].backdrop = alone.state_.direct[path];
    alone.state_.direct[path] = Vec3f{};
    if (media != nullptr) leave_all_but_catchers(tools.g, alone.state_.media[path]);
  }

  KernelGlobals g = tools.g;
  g.catchers_alone = true;
  g.lights.lights = catchers->lights;
  g.caustics.enabled = false;
  const int num_floats = g.film.layout.num_floats;
  g.film.layout = {};
  g.film.layout.num_floats = num_floats;
  const Tools tools_alone{g, tools.accel, tools.stages};
  alone.clear_queues();
  for (std::uint32_t i = 0; i < met.size; ++i) {
    const std::uint32_t path = met.paths[i];
    hit_queue_push(alone.met_, path_instance(g, alone.state_, path), path);
  }
  alone.shade(tools_alone, displacement);
  if (!alone.follow(tools_alone, false, displacement)) return false;
  for (std::uint32_t i = 0; i < num_paths; ++i) {
    if (state_.catchers[i].is_met) state_.catchers[i].alone = alone.state_.direct[i] + alone.state_.indirect[i];
  }
  counters_add(counters, alone.counters);
  for (std::size_t i = 0; i < seconds.size(); ++i) seconds[i] += alone.seconds[i];
  last_ = alone.last_;
  return true;
}

/// Ends paths that start where a lens shows nothing: black, and no surroundings either.
void Wavefront::drop_unseen(const KernelGlobals& g)
{
  std::uint32_t num_seen = 0;
  for (std::uint32_t i = 0; i < active_.size; ++i) {
    const std::uint32_t path = active_.paths[i];
    if (state_.t_max[path] < 0.0f) {
      film_add_clear(g.film, state_.pixel[path], -1.0f);
      if (state_.media != nullptr) state_.media[path] = {};
    } else {
      active_.paths[num_seen++] = path;
    }
  }
  active_.size = num_seen;
}

void Wavefront::trace_photons(const KernelGlobals& g,
                              const Accel& accel,
                              const StageTable& stages,
                              const std::vector<std::uint8_t>& surface_kernel,
                              const PhotonSourcesView& sources,
                              std::uint64_t first,
                              std::uint32_t count,
                              KeptPhotons& out)
{
  RELIEF_ASSERT(count <= kBatchPaths);
  const Clock::time_point start = Clock::now();
  counters.photon_paths += count;
  met_.surface_kernel = surface_kernel.data();
  active_.size = 0;
  stages.emit_photons(g, sources, state_, first, count, active_);
  if (media != nullptr) media->start(state_, active_);
  DisplacementWork displacement;
  displacement.total.stop = stop;
  const GraphStop graphs(stop);
  const auto is_stopped = [&] {
    return displacement.total.stopped ||
           (g.graphs != nullptr && stop != nullptr && stop->load(std::memory_order_relaxed));
  };
  for (std::uint64_t searches_left = most_searches(g); active_.size > 0 && !is_stopped();) {
    if (searches_left-- == 0) {
      counters.endless_paths += active_.size;
      break;
    }
    clear_queues();
    counters.photon_rays += active_.size;
    intersect_closest(g, accel, state_, active_, false, met_, displacement);
    // Each photon is kept once at most.
    const auto keep = [&](std::vector<Photon>& kept, const auto& stage) {
      const std::size_t before = kept.size();
      kept.resize(before + active_.size);
      PhotonQueueView photons{kept.data() + before, 0};
      stage(photons);
      kept.resize(before + photons.size);
    };
    if (media != nullptr) {
      keep(out.in_media, [&](PhotonQueueView& photons) { stages.shade_photon_media(g, state_, met_, next_, photons); });
    }
    keep(out.on_surfaces, [&](PhotonQueueView& photons) {
      for (const QueueView& queue : met_.surfaces) stages.shade_photons(g, sources, state_, queue, next_, photons);
    });
    // Area lights let rays pass.
    for (std::uint32_t i = 0; i < met_.lights.size; ++i) {
      const std::uint32_t path = met_.lights.paths[i];
      state_.t_min[path] = t_min_behind(state_.hit_t[path]);
      queue_push(next_, path);
    }
    if (media != nullptr) {
      for (std::uint32_t i = 0; i < next_.size; ++i) medium_follow(state_, next_.paths[i]);
    }
    std::swap(active_, next_);
  }
  note_displacement(displacement);
  seconds[static_cast<std::size_t>(Stage::kTracePhotons)] +=
      std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace relief
