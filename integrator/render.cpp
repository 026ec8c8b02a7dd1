#include "integrator/render.h"

#include <algorithm>

#include "integrator/kept_context.h"
#include "integrator/pass_plan.h"
#include "integrator/scene_context.h"
#include "integrator/scene_displacement.h"
#include "scene/memory.h"

namespace relief {

FilmWindow render_window(const RenderOptions& options)
{
  const bool is_whole = options.crop_x1 <= options.crop_x0 || options.crop_y1 <= options.crop_y0;
  if (is_whole) return {0, 0, options.settings.width, options.settings.height};
  return {options.crop_x0, options.crop_y0, options.crop_x1 - options.crop_x0, options.crop_y1 - options.crop_y0};
}

ContextOptions render_context_options(const RenderOptions& options)
{
  DisplacementOptions displacement = options.displacement;
  displacement.dicing_bytes = memory_limit().bytes / 8;
  displacement.num_rays = expected_rays(options.settings);
  displacement.camera = options.camera;
  displacement.picture_height = options.settings.height;
  const bool light_sampling_alone = options.light_technique == LightTechnique::kLightSampling;
  return {displacement, light_sampling_alone ? EnvironmentDensity::kRadiance : EnvironmentDensity::kExcess,
          options.settings.caustics.mode, options.trees, options.settings.caustics.kinds};
}

void pixel_filter_table_make(PixelFilter filter, FilterTable& table)
{
  filter_table_make(filter == PixelFilter::kGaussian ? gaussian : blackman_harris, table);
}

SceneContext render_context(const Scene& scene, const RenderOptions& options)
{
  return context_make(scene, render_context_options(options));
}

KernelGlobals render_globals(const SceneContext& context, const RenderOptions& options, const FilterTable& filter)
{
  const RenderSettings& settings = options.settings;
  KernelGlobals g = context.globals;
  g.camera = options.camera;
  g.camera_forward = normalize(-options.camera.world_from_camera.z);
  g.camera_motion = context.motion.view(options.camera_motion_index);
  g.graph_scene.camera = options.camera;
  g.graph_scene.camera.world_from_camera = camera_graph_frame(options.camera);
  g.graph_scene.camera_from_world = inverse(g.graph_scene.camera.world_from_camera);
  // A path counts in bytes; between mirrors that take nothing only this ends it.
  constexpr int kMostBounces = 200;
  g.limits = {std::min(settings.max_bounces, kMostBounces),
              settings.diffuse_bounces,
              settings.glossy_bounces,
              settings.transmission_bounces,
              settings.transparent_bounces,
              settings.volume_bounces};
  g.clamp_direct = settings.clamp_direct;
  g.clamp_indirect = settings.clamp_indirect;
  g.filter_glossy = settings.filter_glossy;
  g.light_technique = options.light_technique;
  g.filter = settings.filter == PixelFilter::kBox ? nullptr : &filter;
  g.filter_width = settings.filter_width;
  g.seed = settings.seed;
  g.mist = settings.mist;
  g.occlusion_distance = settings.occlusion_distance;
  const auto planned = static_cast<std::uint32_t>(settings.samples);
  g.log2_stream =
      sample_log2_stream(settings.noise_threshold > 0 ? std::min(least_samples(settings), planned) : planned);
  g.full_width = settings.width;
  g.full_height = settings.height;
  g.pixel_size = std::sqrt(options.camera.pixel_aspect) / static_cast<float>(settings.height);
  const FilmWindow window = render_window(options);
  g.crop_x = window.x0;
  g.crop_y = window.y0;
  return g;
}

Batch tile_batch(const Film& film, int tile, std::uint32_t first_sample, std::uint32_t num_samples)
{
  Batch batch;
  film.tile_rect(tile, &batch.x0, &batch.y0, &batch.width, &batch.height);
  batch.first_sample = first_sample;
  batch.num_samples = num_samples;
  return batch;
}

}  // namespace relief
