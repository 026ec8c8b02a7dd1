// What decides a path: the options that `render` and `trace --pixel` share, so that the one can follow the other's.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "cli/arguments.h"
#include "integrator/render.h"
#include "scene/framing.h"

namespace relief {

struct PictureOptions {
  std::string camera_from;  ///< file whose cameras there are in place of the scene's; empty: none
  std::string camera;       ///< name or number; empty: the first
  std::optional<Vec3f> look_from, look_at;
  double fov = 0;                ///< vertical, degrees; 0: the camera's
  std::optional<float> shutter;  ///< frames; empty: the camera's
  Resolution resolution;
  PixelRect crop;
  int samples = 0, max_bounces = -1;
  std::optional<std::uint64_t> seed;
  std::optional<CausticsMode> caustics;
  std::optional<PixelFilter> filter;
  double filter_glossy = -1;  ///< negative: the scene's
  DisplacementOptions displacement;
};

/// Adds the options that mean something without a picture, too; `options` must outlive the parser.
std::vector<CLI::Option*> add_ray_options(CLI::App& command, PictureOptions& options);

/// Adds the others likewise.
std::vector<CLI::Option*> add_picture_options(CLI::App& command, PictureOptions& options);

/// What a scene has to be loaded with for the camera of the options.
CameraChoice camera_choice(const PictureOptions& options);

/// The cameras that the options choose among, and the files that they are read from if it is not the scene.
struct PictureCameras {
  std::vector<SceneCamera> cameras;
  std::vector<FileStamp> files;
};

/// @param scene  was loaded with camera_choice
/// @param frame  of an animation of the camera's file; empty: its rest pose
/// @error SceneError if the camera's file cannot be read or has none
PictureCameras picture_cameras(const Scene& scene, const PictureOptions& options, std::optional<int> frame);

/// The scene's settings with the options' changes.
/// @error CLI::ValidationError for a crop or a camera that there is not
RenderOptions render_options(const Scene& scene,
                             const PictureOptions& options,
                             const std::vector<SceneCamera>& cameras);

/// What was given of some options, as words of a command line.
/// @pre the command line has been parsed
std::vector<std::string> words_given(const std::vector<CLI::Option*>& options);

/// The command that shows a path of a render, for a shell.
/// @param given  words_given of the render's ray and picture options
/// @param frame  of the animation
std::string replay_command(const std::string& scene,
                           const std::vector<std::string>& given,
                           std::optional<int> frame,
                           const PixelSample& at);

}  // namespace relief
