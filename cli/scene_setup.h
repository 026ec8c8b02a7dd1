// What several sub-commands make of a scene and their arguments.
#pragma once

#include <string>

#include "scene/scene.h"

namespace relief {

/// The named camera (empty: the first), framed for an image.
/// @error CLI::ValidationError listing the cameras there are
Camera camera_for_image(const Scene& scene, const std::string& name, int width, int height);

}  // namespace relief
