// OpenEXR: one scanline part with every AOV as a layer, the crop as data window inside the full image's display window,
// and the render's facts as attributes, so that any compositor reads it and `relief merge` and `compare` know what it is.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "exporters/color_space.h"
#include "exporters/picture.h"
#include "kernel/statistics.h"
#include "scene/scene.h"

namespace relief {

enum class ExrCompression : std::uint8_t { kNone, kZips, kZip, kPiz, kDwaa, kDwab };

/// Names of the compressions in enumerator order, for options and messages.
inline constexpr std::array<std::string_view, 6> kExrCompressionNames = {"none", "zips", "zip", "piz", "dwaa", "dwab"};

struct ExrOptions {
  ExrCompression compression = ExrCompression::kZip;
  bool float_color = false;  ///< radiance, albedo and normals as 32-bit floats instead of halves
  ColorSpace color_space = ColorSpace::kRec709;  ///< of the layers that are colours (color_component)
};

/// Number of threads that compress and decompress, for the whole process. Without a call it is the machine's.
/// @param num_threads  0: none besides the caller's
void exr_use_threads(int num_threads);

/// The facts of a render as attributes: relief:version, scene, seed, frame, samples, seconds, error_rmse, warnings, …
/// @param command  the command line that made it, or empty
Attributes exr_attributes(const Statistics& statistics, std::string_view command);

/// A picture's camera: worldToCamera and worldToNDC, for rows of coordinates that stand before them. The camera looks along its −Z,
/// with +Y up. NDC are −1…1 from left to right and from the bottom up, of the whole picture; the third is 1 − 1/d in a perspective view
/// and d in an orthographic one, where d is the distance along the axis in metres.
Attributes exr_camera_attributes(const Camera& camera);

/// What compositors need to know of the Cryptomattes among a film's layers: their names, and whose ids they hold.
Attributes exr_cryptomatte_attributes(const Scene& scene, AovMask aov_mask);

/// Layers of a film that a compression would change beyond their stored type although their values are data, not
/// colours: DWA treats every channel called R, G, B or Y as colour. Empty for lossless compressions.
std::vector<std::string> exr_damaged_layers(const FilmLayout& layout, ExrCompression compression);

/// Writes a film. Ids and counts are stored as 32-bit integers; depth, position, uv, variance and half as floats; colours and
/// normals as halves unless asked otherwise. Finite values beyond a half's range become its largest value, 65504.
/// @param attributes  to store, see exr_attribute.h; a name that OpenEXR itself uses with another type is an error
/// @param more        further channels of the film's size, stored as their types say
/// @error OutputError; nothing is left behind
/// @cost  memory for a block of rows only
void exr_write(const std::filesystem::path& path,
               const FilmView& film,
               const Attributes& attributes,
               const ExrOptions& options = {},
               const std::vector<ChannelView>& more = {});

/// Writes a picture, each channel with the type it has. @error OutputError
void exr_write(const std::filesystem::path& path,
               const Picture& picture,
               ExrCompression compression = ExrCompression::kZip);

/// Reads the first part of any flat OpenEXR file, scanline or tiled, with the attributes that are text or of our own. Colours of a
/// file whose chromaticities are those of ACEScg become Rec.709; others are taken as they are.
/// @error InputError for anything else: unreadable, truncated, corrupt, deep, subsampled, or absurdly large
/// @cost  4 bytes a value; memory grows with what was really read, whatever the header claims
Picture exr_load(const std::filesystem::path& path);

}  // namespace relief
