// Whether a frame on disk is what a render would make again: the question behind --resume.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "exporters/picture.h"
#include "scene/file_stamp.h"
#include "scene/render_settings.h"

namespace relief {

/// Files of one frame; empty: not asked for.
struct FramePaths {
  std::filesystem::path exr, png, stats, reference, preview, report;
};

/// Every option of the command line that was given, with its values, but for those of which fingerprint.cpp says that they do
/// not change what is written, or no more than RenderSettings tell. So an option that is new counts.
/// @pre the command line has been parsed
std::vector<std::string> settings_given(const CLI::App& command);

/// Hash over what decides a frame: this version, the options, the settings, the frame, and every file that it was read from
/// (inode, size, time of the last change of content and of anything else; not the name or the device, which differ between
/// machines that share a folder). 16 hexadecimal digits.
/// @param options   settings_given
/// @param settings  the scene's, with the options' changes
/// @param files     stamps from before the files were read
std::string render_fingerprint(const std::vector<std::string>& options,
                               const RenderSettings& settings,
                               std::optional<int> frame,
                               const std::vector<FileStamp>& files);

/// Attributes of a whole frame's OpenEXR: its fingerprint, and hashes of the other files as they are on disk.
Attributes frame_attributes(const FramePaths& paths, const std::string& fingerprint);

/// True if the OpenEXR is a complete picture with the attributes that this frame would get, so that the other files are what
/// was written with it. A picture that was interrupted has none.
bool is_whole_render(const FramePaths& paths, const std::string& fingerprint);

}  // namespace relief
