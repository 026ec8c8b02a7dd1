// Whether a frame on disk is what a render would make again: the question behind --resume.
#pragma once

#include <filesystem>
#include <string>

#include "integrator/render.h"

namespace relief {

/// Hash over every file the scene was read from (path, size, time of last change), the frame's camera, transforms and
/// the settings that change pixels. 16 hexadecimal digits.
/// @param storage  how the pixels are stored, as text: whatever changes the files but not the render
std::string render_fingerprint(const Scene& scene, const RenderOptions& options, const std::string& storage);

/// True if the file is a complete picture that carries the fingerprint. A picture that was interrupted carries none.
bool is_whole_render(const std::filesystem::path& exr, const std::string& fingerprint);

}  // namespace relief
