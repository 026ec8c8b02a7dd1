#include "exporters/png_ocio.h"

#include <OpenColorIO/OpenColorIO.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <initializer_list>
#include <vector>

#include "exporters/atomic_file.h"
#include "exporters/errors.h"
#include "exporters/png_encode.h"

namespace relief {

namespace OCIO = OCIO_NAMESPACE;

struct ColorView::Processor {
  OCIO::ConstCPUProcessorRcPtr cpu;
};

namespace {

constexpr const char* kStandardView = "Standard";

// What configurations call linear light with Rec.709 primaries, most specific first. Where none of these is known, the role
// scene_linear stands in: right for Blender's configuration, an approximation for one whose scene space is ACEScg.
constexpr const char* kLinearRec709Names[] = {
    "Linear Rec.709 (sRGB)", "Linear Rec.709", "lin_rec709_scene", "lin_rec709", "Utility - Linear - sRGB", "lin_srgb"};

/// Configurations of installed Blenders, the system's first, newer ones before older.
std::vector<std::filesystem::path> installed_configs()
{
  namespace fs = std::filesystem;
  std::vector<fs::path> found;
  const auto consider = [&](const fs::path& data_files) {
    std::error_code error;
    const fs::path config = data_files / "datafiles/colormanagement/config.ocio";
    if (fs::is_regular_file(config, error)) found.push_back(config);
  };
  for (const char* root : {"/usr/share/blender", "/usr/local/share/blender", "/opt/blender", "/snap/blender/current",
                           "/Applications/Blender.app/Contents/Resources"}) {
    consider(root);
    std::error_code error;
    std::vector<fs::path> versions;
    for (const fs::directory_entry& entry : fs::directory_iterator(root, error)) {
      if (entry.is_directory(error)) versions.push_back(entry.path());
    }
    std::sort(versions.rbegin(), versions.rend());
    std::for_each(versions.begin(), versions.end(), consider);
  }
  return found;
}

std::string joined_views(const OCIO::ConstConfigRcPtr& config, const char* display)
{
  std::string text;
  for (int i = 0; i < config->getNumViews(display); ++i) {
    text += (i > 0 ? ", " : "") + std::string("'") + config->getView(display, i) + "'";
  }
  return text;
}

bool has_display(const OCIO::ConstConfigRcPtr& config, const std::string& display)
{
  for (int i = 0; i < config->getNumDisplays(); ++i) {
    if (display == config->getDisplay(i)) return true;
  }
  return false;
}

std::string joined_displays(const OCIO::ConstConfigRcPtr& config)
{
  std::string text;
  for (int i = 0; i < config->getNumDisplays(); ++i) {
    text += (i > 0 ? ", " : "") + std::string("'") + config->getDisplay(i) + "'";
  }
  return text;
}

bool has_view(const OCIO::ConstConfigRcPtr& config, const char* display, const std::string& view)
{
  for (int i = 0; i < config->getNumViews(display); ++i) {
    if (view == config->getView(display, i)) return true;
  }
  return false;
}

const char* source_space(const OCIO::ConstConfigRcPtr& config)
{
  for (const char* name : kLinearRec709Names) {
    if (config->getColorSpace(name)) return name;
  }
  return OCIO::ROLE_SCENE_LINEAR;
}

struct FoundView {
  OCIO::ConstCPUProcessorRcPtr cpu;
  std::string description;
  std::vector<std::string> files;
};

/// @error InputError if the display or the view is not there; OCIO::Exception if the configuration is broken
FoundView view_from_config(const std::string& file, const std::string& requested, const std::string& requested_display)
{
  const OCIO::ConstConfigRcPtr config = OCIO::Config::CreateFromFile(file.c_str());
  config->validate();
  if (!requested_display.empty() && !has_display(config, requested_display)) {
    throw InputError(file, "has no display '" + requested_display + "'; there are " + joined_displays(config));
  }
  const char* display = requested_display.empty() ? config->getDefaultDisplay() : requested_display.c_str();
  std::string view = requested;
  if (view.empty()) {
    view = has_view(config, display, kStandardView) ? kStandardView : config->getDefaultView(display);
  }
  if (!has_view(config, display, view)) {
    throw InputError(
        file, "has no view '" + view + "' for display '" + display + "'; there are " + joined_views(config, display));
  }
  const OCIO::DisplayViewTransformRcPtr transform = OCIO::DisplayViewTransform::Create();
  transform->setSrc(source_space(config));
  transform->setDisplay(display);
  transform->setView(view.c_str());
  const OCIO::ConstProcessorRcPtr processor = config->getProcessor(transform);
  std::vector<std::string> files = {file};
  const OCIO::ConstProcessorMetadataRcPtr metadata = processor->getProcessorMetadata();
  for (int i = 0; i < metadata->getNumFiles(); ++i) files.emplace_back(metadata->getFile(i));
  return {processor->getDefaultCPUProcessor(), "view '" + view + "' of display '" + display + "' from " + file,
          std::move(files)};
}

/// From a value in [0, 1] (NaN: 0) to the nearest code.
template <typename Code>
Code code_from(float value)
{
  constexpr float kLargest = static_cast<float>(std::numeric_limits<Code>::max());
  const float limited = value > 0.f ? std::min(value, 1.f) : 0.f;
  return static_cast<Code>(std::floor(limited * kLargest + 0.5f));
}

/// Encodes in memory, where nothing can fail half-way, then writes the file in one go.
template <typename Code>
void write_codes(const std::filesystem::path& path, int width, int height, std::span<const Code> codes)
{
  std::string bytes;
  try {
    bytes = png_encode(width, height, codes);
  } catch (const OutputError& error) {
    throw OutputError(path.string(), error.cause);
  }
  atomic_write(path, bytes);
}

/// Applies exposure and view row by row. @return rows from the top, 3 or 4 codes a pixel
template <typename Code>
std::vector<Code> encode(const ImageView& image, const ColorView& view, const PngOptions& options)
{
  const bool keep_alpha = options.alpha && image.channels.size() == 4;
  const float gain = static_cast<float>(std::exp2(options.exposure));
  std::vector<float> row(static_cast<std::size_t>(image.width) * 3);
  std::vector<Code> codes;
  codes.reserve(row.size() / 3 * static_cast<std::size_t>(image.height) * (keep_alpha ? 4 : 3));
  for (int y = 0; y < image.height; ++y) {
    const auto alpha_at = [&](int x) { return keep_alpha ? image.channels[3].at(x, y) : 1.f; };
    for (int x = 0; x < image.width; ++x) {
      // A light seen through nothing has radiance but no coverage; PNG cannot hold that, and dividing would blow it up.
      const float scale = alpha_at(x) > 0.f ? gain / alpha_at(x) : 0.f;
      for (std::size_t c = 0; c < 3; ++c) {
        row[static_cast<std::size_t>(x) * 3 + c] = image.channels[c].at(x, y) * scale;
      }
    }
    view.apply(row);
    for (int x = 0; x < image.width; ++x) {
      for (std::size_t c = 0; c < 3; ++c) {
        codes.push_back(code_from<Code>(row[static_cast<std::size_t>(x) * 3 + c]));
      }
      if (keep_alpha) codes.push_back(code_from<Code>(alpha_at(x)));
    }
  }
  return codes;
}

template <typename Code>
void write_encoded(const std::filesystem::path& path,
                   const ImageView& image,
                   const ColorView& view,
                   const PngOptions& options)
{
  const std::vector<Code> codes = encode<Code>(image, view, options);
  write_codes(path, image.width, image.height, std::span<const Code>(codes));
}

}  // namespace

ColorView::ColorView(const std::string& view, const std::string& display)
{
  const auto use = [&](FoundView found) {
    processor_ = std::make_unique<Processor>(Processor{std::move(found.cpu)});
    description_ = std::move(found.description);
    files_ = std::move(found.files);
  };
  if (const char* configured = std::getenv("OCIO"); configured != nullptr && *configured != '\0') {
    try {
      use(view_from_config(configured, view, display));
      return;
    } catch (const OCIO::Exception& error) {
      throw InputError(configured, std::string("is named by $OCIO but cannot be used: ") + error.what());
    }
  }
  for (const std::filesystem::path& config : installed_configs()) {
    try {
      use(view_from_config(config.string(), view, display));
      return;
    } catch (const OCIO::Exception&) {
      // A newer Blender's configuration may be beyond this OpenColorIO; nobody asked for it, so the next one is tried.
    }
  }
  if (!view.empty() && view != kStandardView) {
    throw InputError("view '" + view + "'",
                     "no OpenColorIO configuration was found, and without one there is only 'Standard'; set $OCIO");
  }
  if (!display.empty()) {
    throw InputError("display '" + display + "'",
                     "no OpenColorIO configuration was found, and without one there is only sRGB; set $OCIO");
  }
  description_ = "view 'Standard', built-in sRGB curve";
}

ColorView::~ColorView() = default;
ColorView::ColorView(ColorView&&) noexcept = default;
ColorView& ColorView::operator=(ColorView&&) noexcept = default;

void ColorView::apply(std::span<float> rgb) const
{
  if (processor_) {
    // A table's answer to NaN or infinity is not defined; the film's own report of such pixels is elsewhere.
    std::replace_if(
        rgb.begin(), rgb.end(), [](float value) { return std::isnan(value); }, 0.f);
    OCIO::PackedImageDesc pixels(rgb.data(), static_cast<long>(rgb.size() / 3), 1, 3);
    processor_->cpu->apply(pixels);
    return;
  }
  std::transform(rgb.begin(), rgb.end(), rgb.begin(), srgb_from_linear);
}

float srgb_from_linear(float linear)
{
  if (!(linear > 0.f)) return 0.f;
  const float limited = std::min(linear, 1.f);
  return limited <= 0.0031308f ? 12.92f * limited : 1.055f * std::pow(limited, 1.f / 2.4f) - 0.055f;
}

std::string png_write(const std::filesystem::path& path, const ImageView& image, const PngOptions& options)
{
  if (image.width <= 0 || image.height <= 0 || (image.channels.size() != 3 && image.channels.size() != 4)) {
    throw OutputError(path.string(),
                      "a PNG is made of red, green, blue and perhaps coverage, which this picture lacks");
  }
  const ColorView view(options.view, options.display);
  if (options.bits == 16) {
    write_encoded<std::uint16_t>(path, image, view, options);
  } else {
    write_encoded<std::uint8_t>(path, image, view, options);
  }
  return view.description();
}

std::string png_write(const std::filesystem::path& path, const FilmView& film, const PngOptions& options)
{
  return png_write(path, film_layer(film, Aov::kBeauty), options);
}

void png_write_bytes(const std::filesystem::path& path, int width, int height, std::span<const std::uint8_t> rgb)
{
  write_codes(path, width, height, rgb);
}

}  // namespace relief
