// Compiled once an instruction set (see CMakeLists.txt), with RELIEF_STAGE_TABLE naming the function that returns this
// set's table. Nothing here may have external linkage but that function: see scripts/check_isa.
#include "integrator/stages.h"

#include <utility>

#include "integrator/surface_kernels.h"
#include "kernel/stage/accumulate_shadow.h"
#include "kernel/stage/emit_photon.h"
#include "kernel/stage/gather_photons.h"
#include "kernel/stage/generate_camera_path.h"
#include "kernel/stage/shade_background.h"
#include "kernel/stage/shade_light.h"
#include "kernel/stage/shade_photon.h"
#include "kernel/stage/shade_surfaces.h"

namespace relief {

namespace {

/// Pixels of a batch in blocks of 4×2, so that eight camera rays that follow each other are neighbours, however few samples
/// there are.
/// Widths and heights that are no multiples (image borders) go row by row.
void batch_pixel(const Batch& batch, std::uint32_t index, int* x, int* y)
{
  const auto width = static_cast<std::uint32_t>(batch.width);
  if (width % 4 != 0 || batch.height % 2 != 0) {
    *x = batch.x0 + static_cast<int>(index % width);
    *y = batch.y0 + static_cast<int>(index / width);
    return;
  }
  const std::uint32_t block = index / 8;
  const std::uint32_t blocks_a_row = width / 4;
  *x = batch.x0 + static_cast<int>(block % blocks_a_row * 4 + index % 4);
  *y = batch.y0 + static_cast<int>(block / blocks_a_row * 2 + index / 4 % 2);
}

/// Sample of a pixel that is its next in a batch.
std::uint32_t next_sample(const KernelGlobals& g, const Batch& batch, std::uint32_t pixel)
{
  return batch.first_sample + (g.film.layout.samples >= 0 ? film_pixel_samples(g.film, pixel) : 0u);
}

std::uint32_t generate(const KernelGlobals& g, PathState& state, const Batch& batch)
{
  const auto num_pixels = static_cast<std::uint32_t>(batch.width * batch.height);
  std::uint32_t path = 0;
  for (std::uint32_t p = 0; p < num_pixels; ++p) {
    int x = 0;
    int y = 0;
    batch_pixel(batch, p, &x, &y);
    const auto pixel = static_cast<std::uint32_t>(y * g.film.width + x);
    if (film_pixel_rests(g.film, pixel)) continue;
    const std::uint32_t first = next_sample(g, batch, pixel);
    for (std::uint32_t s = 0; s < batch.num_samples; ++s, ++path) generate_camera_path(g, state, path, x, y, first + s);
  }
  return path;
}

/// Puts paths in the order of the materials that they have hit; those of one material stay in the order they had. By bytes of the
/// material's index, of which few are needed: comparing paths took 3 % of all time.
void sort_by_material(const KernelGlobals& g, const PathState& state, const QueueView& queue)
{
  struct Entry {
    std::uint32_t material, path;
  };
  Entry entries[2][kBatchPaths];
  std::uint32_t differ = 0;  // bits in which they do
  for (std::uint32_t i = 0; i < queue.size; ++i) {
    const std::uint32_t path = queue.paths[i];
    const auto material = static_cast<std::uint32_t>(g.instances[state.hit_object[path]].material_index);
    entries[0][i] = {material, path};
    differ |= material ^ entries[0][0].material;
  }
  int from = 0;
  for (int shift = 0; shift < 32 && differ >> shift != 0; shift += 8, from ^= 1) {
    std::uint32_t ends[256] = {};
    for (std::uint32_t i = 0; i < queue.size; ++i) ++ends[entries[from][i].material >> shift & 0xffu];
    std::uint32_t begin = 0;
    for (std::uint32_t& end : ends) begin += std::exchange(end, begin);
    for (std::uint32_t i = 0; i < queue.size; ++i) {
      const Entry entry = entries[from][i];
      entries[from ^ 1][ends[entry.material >> shift & 0xffu]++] = entry;
    }
  }
  for (std::uint32_t i = 0; i < queue.size; ++i) queue.paths[i] = entries[from][i].path;
}

/// Paths that are taken together.
constexpr std::uint32_t kLanes = 8;

/// Where some paths of a queue are: as surface_interaction_locate, which of a kernel's features needs to know of textures alone.
template <unsigned kFeatures>
void locate(const KernelGlobals& g,
            const PathState& state,
            const QueueView& queue,
            std::uint32_t first,
            std::uint32_t count,
            SurfaceInteraction located[kLanes])
{
  surface_interactions_locate<kFeatures & kFeatureTextures>(g, state, queue.paths + first, static_cast<int>(count),
                                                            located);
}

/// Shades up to eight paths at located hits of one material whose graph has run.
template <unsigned kFeatures>
void shade_group(const KernelGlobals& g,
                 PathState& state,
                 const SurfaceGroup& group,
                 HitColumns& hits,
                 const SurfaceSinks& sinks)
{
  if constexpr ((kFeatures & kFeatureMixture) != 0) {
    // Fewer are not worth it.
    const std::uint64_t closures = __builtin_popcount(group.lanes) > 2 ? closures_with_columns(group.program) : 0;
    MixtureBuildLanes b;
    if (closures != 0) {
      b = surface_group_build(g, state, group);
      closures_resolve_columns(group.program, closures, group.registers, b, hits.lobes);
    }
    MixtureLobes lists[kLanes];
    if (closures != 0 && surface_group_is_resolved(g, state, group, closures)) {
      surface_group_resolve<kFeatures>(g, state, group, b, hits);
    } else if (!surface_group_resolve<kFeatures>(g, state, group, closures != 0 ? &hits.lobes : nullptr, lists, hits)) {
      surface_group_visit(group, [&](int k) {
        shade_surface_listed<kFeatures>(g, state, group.paths[k], group.at[k], lists[k], sinks);
      });
      return;
    }
    shade_surface_group<kFeatures>(g, state, group, hits, sinks);
  } else {
    surface_group_visit(group, [&](int k) {
      const GraphHit hit{{&group.program, &group.registers, k}};
      shade_surface<kFeatures>(g, state, group.paths[k], group.at[k], sinks, &hit);
    });
  }
}

/// Sends on those paths of a group that meet nothing but what lets them through whole, as most do that meet an image of a leaf: no
/// lobes, lights or films are asked.
/// @return  lanes of the others, bit by bit
unsigned pass_clear(const KernelGlobals& g, PathState& state, const SurfaceGroup& group, const SurfaceSinks& sinks)
{
  unsigned others = group.lanes;
  if (const Material& material = *group.at[0].material;
      material.transparency_index < 0 || !is_zero(material.emission)) {
    return others;
  }
  const unsigned clear = closures_clear(group.program, group.registers);
  for (int k = 0; k < static_cast<int>(kLanes); ++k) {
    if ((clear >> k & 1u) == 0 || (group.at[k].instance->flags & kHoldout) != 0) continue;
    const Vec3f passes = closures_transparency({&group.program, &group.registers, k});
    if (!(max_component(passes) > 0.0f)) continue;
    others &= ~(1u << k);
    sinks.counters.surface_hits += 1;
    sinks.counters.transparent_hits += 1;
    if (path_pass_through(g, state, group.paths[k], passes)) queue_push(sinks.next, group.paths[k]);
  }
  return others;
}

/// Runs the graphs of up to eight paths that have hit one material, then shades them.
template <unsigned kFeatures>
void shade_surfaces_by_graph(const KernelGlobals& g,
                             PathState& state,
                             const QueueView& queue,
                             const SurfaceSinks& sinks)
{
  const auto material_of = [&](std::uint32_t path) { return g.instances[state.hit_object[path]].material_index; };
  sort_by_material(g, state, queue);
  GraphRegisters registers;
  registers.rays = g.graph_scene.rays;
  SurfaceInteraction located[kLanes];
  HitColumns hits{};
  for (std::uint32_t first = 0, count = 0; first < queue.size; first += count) {
    const Material& material = g.materials[material_of(queue.paths[first])];
    count = 1;
    while (count < kLanes && first + count < queue.size &&
           &g.materials[material_of(queue.paths[first + count])] == &material) {
      ++count;
    }
    locate<kFeatures>(g, state, queue, first, count, located);
    // Closures have a program, if of nothing but constants.
    if ((kFeatures & kFeatureMixture) == 0 && material.graph_index < 0) {
      for (std::uint32_t lane = 0; lane < count; ++lane) {
        shade_surface<kFeatures>(g, state, queue.paths[first + lane], located[lane], sinks);
      }
      continue;
    }
    const GraphProgramView& program = g.graphs[material.graph_index];
    surface_graph_run(g, state, program, queue.paths + first, static_cast<int>(count), located, registers);
    sinks.counters.graph_runs += 1;
    sinks.counters.graph_points += count;
    SurfaceGroup group{queue.paths + first, located, program, registers, registers.used};
    if constexpr ((kFeatures & kFeatureMixture) != 0) group.lanes = pass_clear(g, state, group, sinks);
    shade_group<kFeatures>(g, state, group, hits, sinks);
  }
}

template <unsigned kFeatures>
void shade_surfaces(const KernelGlobals& g,
                    PathState& state,
                    const QueueView& queue,
                    QueueView& next,
                    ShadowQueue& shadow,
                    Counters& counters)
{
  const SurfaceSinks sinks{next, shadow, counters};
  if constexpr ((kFeatures & kFeatureGraphs) != 0) {
    shade_surfaces_by_graph<kFeatures>(g, state, queue, sinks);
  } else {
    SurfaceInteraction located[kLanes];
    for (std::uint32_t first = 0; first < queue.size; first += kLanes) {
      const std::uint32_t count = queue.size - first < kLanes ? queue.size - first : kLanes;
      locate<kFeatures>(g, state, queue, first, count, located);
      for (std::uint32_t lane = 0; lane < count; ++lane) {
        shade_surface<kFeatures>(g, state, queue.paths[first + lane], located[lane], sinks);
      }
    }
  }
}

void shade_backgrounds(const KernelGlobals& g, PathState& state, const QueueView& queue, Counters& counters)
{
  for (std::uint32_t i = 0; i < queue.size; ++i) shade_background(g, state, queue.paths[i], counters);
}

void shade_lights(const KernelGlobals& g, PathState& state, const QueueView& queue, QueueView& next)
{
  for (std::uint32_t i = 0; i < queue.size; ++i) {
    shade_light(g, state, queue.paths[i]);
    queue_push(next, queue.paths[i]);
  }
}

void accumulate_shadows(const KernelGlobals& g, PathState& state, const ShadowQueue& shadow, const Vec3f* visibility)
{
  for (std::uint32_t i = 0; i < shadow.size; ++i) {
    if (!is_zero(visibility[i])) accumulate_shadow(g, state, shadow, i, visibility[i]);
  }
}

void gather(const KernelGlobals& g, PathState& state, const QueueView& queue)
{
  for (std::uint32_t i = 0; i < queue.size; ++i) gather_photons(g, state, queue.paths[i]);
}

void emit(const KernelGlobals& g,
          const PhotonSourcesView& sources,
          PathState& state,
          std::uint64_t first,
          std::uint32_t count,
          QueueView& next)
{
  for (std::uint32_t i = 0; i < count; ++i) {
    if (emit_photon(g, sources, state, i, first + i)) queue_push(next, i);
  }
}

void shade_photons(const KernelGlobals& g,
                   const PhotonSourcesView& sources,
                   PathState& state,
                   const QueueView& queue,
                   QueueView& next,
                   PhotonQueueView& photons)
{
  for (std::uint32_t i = 0; i < queue.size; ++i) shade_photon(g, sources, state, queue.paths[i], next, photons);
}

/// Adds a finished sample whose path has met a shadow catcher.
/// @return  as film_add_sample
[[gnu::noinline]] bool finish_caught(const KernelGlobals& g,
                                     const PathState& state,
                                     std::uint32_t path,
                                     std::uint32_t sample,
                                     Vec3f caustic)
{
  const CatcherState& c = state.catchers[path];
  const std::uint32_t pixel = state.pixel[path];
  float* record = film_record(g.film, pixel);
  // Behind the catcher nothing counts: see shade_background.
  film_add_clear(g.film, pixel, (state.flags[path] & kPathSawSurface) != 0 ? c.share : c.share - 1.0f);
  if (g.film.layout.shadow_catcher) film_add_holdout(g.film, pixel, c.share);
  record[g.film.layout.catcher + CatcherSums::kShare] += c.share;
  const Vec3f before = c.direct + c.indirect + c.caustic;
  // Where nothing was before, the same sum as that of a path without catchers: then both end in the film as the same number.
  const Vec3f caught = (state.direct[path] - c.direct) + (state.indirect[path] - c.indirect) + (caustic - c.caustic);
  if (!film_add_radiance(g.film, pixel, sample, before + caught)) return false;
  const AccumulatorLayout& layout = g.film.layout;
  if (layout.direct >= 0) film_add3(record + layout.direct, c.direct);
  if (layout.caustic >= 0) film_add3(record + layout.caustic, c.caustic);
  if (state.light_passes != nullptr) film_add_light_passes(g.film, pixel, c.light);
  if (state.media != nullptr) {
    const MediumLight light = medium_light(state.media[path], c.direct, c.indirect, c.caustic);
    film_add_volume(g.film, pixel, light.direct, light.indirect);
  }
  // Of one that is not finite there is no shadow.
  film_add_caught(g.film, pixel, sample, caught, is_finite(c.alone) ? c.alone : caught,
                  is_finite(c.backdrop) ? c.backdrop : Vec3f{});
  return true;
}

void finish(const KernelGlobals& g,
            PathState& state,
            const Batch& batch,
            std::uint32_t num_paths,
            Counters& counters,
            std::uint64_t& first_nonfinite)
{
  for (std::uint32_t i = num_paths; i < state.caustic.num_paths; ++i) path_add_to_root(state, i);
  const bool counts = g.film.layout.samples >= 0;
  for (std::uint32_t i = 0; i < num_paths; ++i) {
    const std::uint32_t sample =
        counts ? next_sample(g, batch, state.pixel[i]) : batch.first_sample + i % batch.num_samples;
    Vec3f caustic;
    if (state.caustic.radiance != nullptr) caustic = (*state.caustic.radiance)[i];
    const bool is_caught = __builtin_expect(state.catchers != nullptr, 0) && state.catchers[i].is_met;
    const bool finite =
        is_caught ? finish_caught(g, state, i, sample, caustic)
                  : film_add_sample(g.film, state.pixel[i], sample, state.direct[i], state.indirect[i], caustic);
    if (finite) {
      if (is_caught) continue;
      if (state.light_passes != nullptr) film_add_light_passes(g.film, state.pixel[i], state.light_passes[i].light);
      if (state.media != nullptr) {
        const MediumLight light = medium_light(state.media[i], state.direct[i], state.indirect[i], caustic);
        film_add_volume(g.film, state.pixel[i], light.direct, light.indirect);
      }
      continue;
    }
    ++counters.nonfinite_samples;
    const std::uint64_t key = std::uint64_t{state.pixel[i]} << 32 | sample;
    if (key < first_nonfinite) first_nonfinite = key;
  }
}

const StageTable kTable = {
    RELIEF_ISA_NAME,
    generate,
    {shade_surfaces<kSurfaceKernelFeatures[0]>, shade_surfaces<kSurfaceKernelFeatures[1]>,
     shade_surfaces<kSurfaceKernelFeatures[2]>, shade_surfaces<kSurfaceKernelFeatures[3]>,
     shade_surfaces<kSurfaceKernelFeatures[4]>, shade_surfaces<kSurfaceKernelFeatures[5]>,
     shade_surfaces<kSurfaceKernelFeatures[6]>, shade_surfaces<kSurfaceKernelFeatures[7]>,
     shade_surfaces<kSurfaceKernelFeatures[8]>, shade_surfaces<kSurfaceKernelFeatures[9]>,
     shade_surfaces<kSurfaceKernelFeatures[10]>, shade_surfaces<kSurfaceKernelFeatures[11]>},
    RELIEF_SHADE_MEDIA,
    RELIEF_SHADE_PHOTON_MEDIA,
    &RELIEF_WALK_STAGES,
    RELIEF_LEAVE_SURFACES,
    shade_backgrounds,
    shade_lights,
    accumulate_shadows,
    gather,
    emit,
    shade_photons,
    finish,
    RELIEF_GRAPH_RUN,
    RELIEF_SHADOW_TRANSMITTANCE,
    RELIEF_SHADOW_SURFACES,
};

}  // namespace

const StageTable& RELIEF_STAGE_TABLE() { return kTable; }

}  // namespace relief
