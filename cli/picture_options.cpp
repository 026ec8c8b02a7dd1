#include "cli/picture_options.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "cli/scene_setup.h"
#include "integrator/stages.h"
#include "scene/framing.h"

namespace relief {

namespace {

/// @error CLI::ValidationError if there is no such camera
std::size_t camera_index(const std::vector<SceneCamera>& cameras, const std::string& text)
{
  if (const std::optional<std::size_t> index = camera_named(cameras, text)) return *index;
  std::string names;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    names += fmt::format("{}{} ('{}')", i == 0 ? "" : ", ", i, cameras[i].name);
  }
  throw CLI::ValidationError("--camera", fmt::format("expected one of {}, found '{}'", names, text));
}

/// The camera that was chosen, for an image of that size.
Camera camera_for_image(const SceneCamera& chosen, const PictureOptions& options, int width, int height)
{
  Camera camera = chosen.camera;
  if (options.fov > 0) {
    if (camera.projection != Projection::kPerspective) {
      throw CLI::ValidationError("--fov", "expected a perspective camera, found another");
    }
    camera.half_height = static_cast<float>(std::tan(options.fov * std::numbers::pi / 360));
  }
  camera_fit(camera, static_cast<float>(width), static_cast<float>(height));
  return camera;
}

}  // namespace

CameraChoice camera_choice(const PictureOptions& options)
{
  // With another file's cameras the scene's own do not matter: it is the same whatever the picture's size.
  if (!options.camera_from.empty()) return {{}, {}, 0, 1, {}, options.shutter};
  CameraChoice choice{options.look_from, options.look_at, options.fov, 0, options.camera, options.shutter};
  if (options.resolution.width > 0) {
    choice.image_aspect = static_cast<float>(options.resolution.width) / static_cast<float>(options.resolution.height);
  }
  return choice;
}

PictureCameras picture_cameras(const Scene& scene, const PictureOptions& options, std::optional<int> frame)
{
  if (options.camera_from.empty()) return {scene.cameras, {}};
  LoadOptions load;
  load.has_frame = frame.has_value();
  load.frame = frame.value_or(0);
  load.needs_camera = true;
  load.run_graph = stage_table_select().run_graph;
  load.camera.shutter = 0.0f;  // Motion is of the scene: such a camera stands still.
  Scene other = scene_load(options.camera_from, load);
  return {std::move(other.cameras), std::move(other.files)};
}

std::vector<CLI::Option*> add_ray_options(CLI::App& command, PictureOptions& options)
{
  return {add_displacement_method(command, options.displacement), add_displacement_lod(command, options.displacement),
          add_displacement_rmip(command, options.displacement)};
}

std::vector<CLI::Option*> add_picture_options(CLI::App& command, PictureOptions& options)
{
  constexpr SettingInfo kSamples = setting_info("samples"), kBounces = setting_info("maxBounces"),
                        kFilterGlossy = setting_info("filterGlossy");
  const auto point = [](const char* option) {
    return [option](const std::string& text) { return parse_point(option, text); };
  };
  CLI::Option* camera = command.add_option(
      "--camera", options.camera,
      "Name of the camera, its number from 0, or auto: one that shows everything (default: the first)");
  CLI::Option* file =
      command.add_option("--camera-from", options.camera_from, "Scene file whose cameras there are instead");
  CLI::Option* from =
      add_parsed(command, "--look-from", options.look_from, point("--look-from"), "X,Y,Z: a camera there instead");
  CLI::Option* at = add_parsed(command, "--look-at", options.look_at, point("--look-at"),
                               "X,Y,Z: what it looks at (default: the middle of everything)");
  from->excludes(camera);
  from->excludes(file);
  at->needs(from);
  return {
      file,
      camera,
      from,
      at,
      command.add_option("--fov", options.fov, "Vertical field of view of the camera in degrees")
          ->check(number(0.01, 179)),
      add_parsed(command, "--resolution", options.resolution, parse_resolution,
                 "WIDTHxHEIGHT in pixels (default: the scene's)"),
      command.add_option("--spp", options.samples, setting_help(kSamples))->check(setting_check(kSamples)),
      add_parsed(command, "--seed", options.seed, parse_seed, "Seed of the random numbers (default: the scene's)"),
      add_parsed(command, "--crop", options.crop, parse_crop, "X0,Y0,X1,Y1: render this window of the image only"),
      command.add_option("--max-bounces", options.max_bounces, setting_help(kBounces))->check(setting_check(kBounces)),
      add_displacement_error(command, options.displacement),
      add_displacement_memory(command, options.displacement),
      add_caustics_mode(command, options.caustics),
      command
          .add_option("--shutter", options.shutter,
                      "Frames that the shutter is open for motion blur; 0 is off (default: the camera's)")
          ->check(number(0, kLongestShutter)),
      add_choice(command, "--filter", options.filter, setting_info("pixelFilter.type")),
      command.add_option("--filter-glossy", options.filter_glossy, setting_help(kFilterGlossy))
          ->check(setting_check(kFilterGlossy)),
  };
}

RenderOptions render_options(const Scene& scene, const PictureOptions& given, const std::vector<SceneCamera>& cameras)
{
  RenderOptions options;
  RenderSettings& settings = options.settings;
  settings = scene.render;
  if (given.resolution.width > 0) {
    settings.width = given.resolution.width;
    settings.height = given.resolution.height;
  }
  if (given.samples > 0) settings.samples = given.samples;
  if (given.max_bounces >= 0) {
    settings.max_bounces = given.max_bounces;
    settings.diffuse_bounces = std::min(settings.diffuse_bounces, given.max_bounces);
    settings.glossy_bounces = std::min(settings.glossy_bounces, given.max_bounces);
    settings.transmission_bounces = std::min(settings.transmission_bounces, given.max_bounces);
    settings.volume_bounces = std::min(settings.volume_bounces, given.max_bounces);
  }
  if (given.seed) settings.seed = *given.seed;
  if (given.filter) {
    settings.filter = *given.filter;
    settings.filter_width = pixel_filter_width(*given.filter);
  }
  if (given.filter_glossy >= 0) settings.filter_glossy = static_cast<float>(given.filter_glossy);
  if (given.caustics) settings.caustics.mode = *given.caustics;
  const SceneCamera& camera = cameras[camera_index(cameras, given.camera)];
  options.camera = camera_for_image(camera, given, settings.width, settings.height);
  options.camera_motion_index = camera.motion_index;
  const PixelRect& crop = given.crop;
  if (crop.x1 > settings.width || crop.y1 > settings.height) {
    throw CLI::ValidationError(
        "--crop", fmt::format("expected a window inside the image of {}x{}, found '{},{},{},{}'", settings.width,
                              settings.height, crop.x0, crop.y0, crop.x1, crop.y1));
  }
  options.crop_x0 = crop.x0;
  options.crop_y0 = crop.y0;
  options.crop_x1 = crop.x1;
  options.crop_y1 = crop.y1;
  options.displacement = given.displacement;
  return options;
}

std::vector<std::string> words_given(const std::vector<CLI::Option*>& options)
{
  std::vector<std::string> words;
  for (const CLI::Option* option : options) {
    for (const std::string& value : option->results()) words.insert(words.end(), {option->get_name(), value});
  }
  return words;
}

std::string replay_command(const std::string& scene,
                           const std::vector<std::string>& given,
                           std::optional<int> frame,
                           const PixelSample& at)
{
  std::string text = "relief trace " + shell_quoted(scene);
  for (const std::string& word : given) text += ' ' + shell_quoted(word);
  if (frame) text += fmt::format(" --frame {}", *frame);
  return text + fmt::format(" --pixel {},{},{}", at.x, at.y, at.sample_index);
}

}  // namespace relief
