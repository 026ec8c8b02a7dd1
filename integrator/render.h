// Renders a scene: builds what the kernels need, then samples tiles in passes until a limit is reached.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <span>

#include "displacement/displacement_set.h"
#include "integrator/film.h"
#include "kernel/camera/camera.h"
#include "kernel/light/light_technique.h"
#include "kernel/statistics.h"
#include "scene/scene.h"

namespace relief {

struct Batch;           // integrator/stages.h
struct ContextOptions;  // integrator/kept_context.h
struct FilterTable;     // kernel/film/pixel_filter.h
struct KernelGlobals;   // kernel/globals.h
class KeptContext;      // integrator/kept_context.h
class KeptTrees;        // integrator/kept_trees.h
struct SceneContext;    // integrator/scene_context.h

struct RenderOptions {
  RenderSettings settings;                                 ///< the scene's, with the command line's changes
  Camera camera;                                           ///< half_width already set for the image's aspect ratio
  int camera_motion_index = -1;                            ///< SceneCamera::motion_index
  int crop_x0 = 0, crop_y0 = 0, crop_x1 = 0, crop_y1 = 0;  ///< pixels, half open; all 0: the whole image
  /// Of settings.samples, only these are taken; 0 of them: all. The first is a multiple of four, so that halves and quarters
  /// of the samples, which the error is estimated by, are as large as without the samples before.
  std::uint32_t first_sample = 0, num_samples = 0;
  /// 0: none; counted from the start of sampling. The pass under way is finished, as long as its tiles are.
  double time_limit_seconds = 0;
  AovMask aov_mask = 1;
  LightTechnique light_technique = LightTechnique::kMis;
  DisplacementOptions displacement;
  std::shared_ptr<KeptTrees> trees;  ///< of the scenes before; null: none are kept
  /// Called once what rays need is built, before the first of them; may be empty.
  std::function<void()> prepared;
  /// Called once the first photons are traced, with the seconds that it took; may be empty.
  std::function<void(double)> traced_photons;
  /// Gets the beauty so far and its samples a pixel, soon after the start and then as often as takes a hundredth of the
  /// time, at most twice a second; may be empty. Sampling waits meanwhile. The picture is the same with it, if no time limit counts what it takes.
  std::function<void(const FilmView&, double)> preview;
  /// Gets the state and the film's sums every so many seconds, while sampling waits, with the beauty so far. The statistics then
  /// tell seed, size, samples, error and seconds. May be empty; if not, an interrupted render's picture has its state.
  std::function<void(const RenderState&, std::span<const float>, const FilmView&)> checkpoint;
  double checkpoint_seconds = 0;  ///< 0: only an interrupted picture has a state
  /// What to go on from, to the same picture in every bit; its sums are taken. Null: begins. One of another film is a warning.
  SavedRender* saved = nullptr;
  /// Fill in Statistics::errors. Passes then begin with one sample, so that there is something to see from the start.
  bool keeps_errors = false;
  /// With keeps_errors: the beauty's error by a reference; may be empty. Sampling waits meanwhile.
  std::function<ImageError(const FilmView&)> reference_error;
};

struct RenderProgress {
  /// Of the samples and their photons (or of the time limit, whichever ends sooner); with a noise threshold, of the samples that
  /// it is expected to take.
  double fraction = 0;
  double samples_per_pixel = 0, seconds = 0, seconds_left = 0, rays_per_second = 0;
  std::uint64_t photons = 0;  ///< traced so far
};

/// The pixels that are rendered: the crop, or the whole image.
struct FilmWindow {
  int x0 = 0, y0 = 0, width = 0, height = 0;
};
FilmWindow render_window(const RenderOptions& options);

/// The table for a picture's filter; of a box nothing is asked.
void pixel_filter_table_make(PixelFilter filter, FilterTable& table);

/// How a render's context is made.
ContextOptions render_context_options(const RenderOptions& options);

/// What a render needs of its scene, which must outlive it.
/// @error std::runtime_error out of memory and the like
SceneContext render_context(const Scene& scene, const RenderOptions& options);

/// Kernel globals of a render; the film is left for the caller to fill in.
/// @param filter  Blackman–Harris table; must outlive the globals
KernelGlobals render_globals(const SceneContext& context, const RenderOptions& options, const FilterTable& filter);

/// Samples of a tile's pixels.
Batch tile_batch(const Film& film, int tile, std::uint32_t first_sample, std::uint32_t num_samples);

/// Renders; returns what was sampled when `stop` became true. Tiles that are searching displaced meshes
/// or running value graphs then are dropped.
/// @param progress  called a few times a second from any thread, one call at a time; may be empty
/// @param kept      what was built of this scene before; what is built now stays in it
/// @param stats     filled but for what only the caller knows (scene, version, load_seconds, warnings)
/// @error std::runtime_error out of memory and the like
RenderedImage render(const Scene& scene,
                     const RenderOptions& options,
                     const std::atomic<bool>& stop,
                     const std::function<void(const RenderProgress&)>& progress,
                     KeptContext& kept,
                     Statistics& stats);
/// The same with nothing kept.
RenderedImage render(const Scene& scene,
                     const RenderOptions& options,
                     const std::atomic<bool>& stop,
                     const std::function<void(const RenderProgress&)>& progress,
                     Statistics& stats);

}  // namespace relief
