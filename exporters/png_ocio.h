// PNG for the eye: linear Rec.709 radiance through a display view of OpenColorIO, or through the exact sRGB curve where
// no configuration is installed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "exporters/picture.h"
#include "kernel/film/film_layout.h"

namespace relief {

struct PngOptions {
  /// View of the display. Empty: "Standard", the plain sRGB look, even where the configuration's own
  /// default is another (Blender's is Filmic); a configuration without a "Standard" view uses its own default.
  std::string view;
  double exposure = 0;  ///< stops; pixels are multiplied by 2^exposure before the view
  int bits = 8;         ///< 8 or 16
  bool alpha = false;   ///< keep coverage, unassociated as PNG wants it; otherwise the picture stands over black
  std::string display = {};  ///< whose view it is; empty: the configuration's default
};

/// Where pixels go after exposure. Made once, used for any number of pictures.
/// Looked for in this order: the configuration that $OCIO names; the one that Blender installs; the built-in sRGB view.
class ColorView {
 public:
  /// @param view, display  as in PngOptions
  /// @error InputError if $OCIO is set but its configuration cannot be used, or if there is no such display or view (lists those
  ///        that are)
  explicit ColorView(const std::string& view, const std::string& display = {});
  ~ColorView();
  ColorView(ColorView&&) noexcept;
  ColorView& operator=(ColorView&&) noexcept;

  /// One line for a log: view, display, and whose configuration it is.
  const std::string& description() const { return description_; }

  /// Configuration and tables that were read for it.
  const std::vector<std::string>& files() const { return files_; }

  /// Scene-linear RGB triples to display values in [0, 1], in place.
  void apply(std::span<float> rgb) const;

 private:
  struct Processor;
  std::unique_ptr<Processor> processor_;  ///< null: built-in sRGB
  std::string description_;
  std::vector<std::string> files_;
};

/// The sRGB encoding of a linear value. @return in [0, 1]; 0 for NaN
/// @source IEC 61966-2-1
float srgb_from_linear(float linear);

/// Writes the beauty of a film (its stored window only) as PNG. Values are rounded to the nearest code, without dither.
/// @return ColorView::description() of the view that was used
/// @error OutputError; InputError as for ColorView
std::string png_write(const std::filesystem::path& path, const FilmView& film, const PngOptions& options = {});

/// Likewise for views of R, G, B and, if there is a fourth channel, coverage. Other counts of channels are an OutputError.
std::string png_write(const std::filesystem::path& path, const ImageView& image, const PngOptions& options = {});

/// Writes bytes as they are: rows from the top, 3 channels. @error OutputError
void png_write_bytes(const std::filesystem::path& path, int width, int height, std::span<const std::uint8_t> rgb);

}  // namespace relief
