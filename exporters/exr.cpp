#include "exporters/exr.h"

#include <ImfChromaticities.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfThreading.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <iterator>
#include <new>
#include <utility>

#include "exporters/errors.h"
#include "exporters/exr_attribute.h"
#include "exporters/exr_rows.h"
#include "scene/cryptomatte.h"
#include "scene/memory.h"

namespace relief {

namespace {

// Likewise of channels: see kMaxSide.
constexpr std::int64_t kMaxRowValues = std::int64_t{1} << 22;
constexpr std::int64_t kMaxValues = std::int64_t{1} << 33;

void write_channels(const std::filesystem::path& path,
                    const ExrWindows& windows,
                    const std::vector<ChannelView>& channels,
                    const Attributes& attributes,
                    ExrCompression compression,
                    ColorSpace space = ColorSpace::kRec709)
{
  if (windows.width <= 0 || windows.height <= 0 || channels.empty()) {
    throw OutputError(path.string(), "the picture has no pixels or no channels");
  }
  exr_file_write(path, [&](Imf::OStream& stream) {
    Imf::OutputFile output(stream, exr_header_make(windows, channels, attributes, compression, space));
    exr_rows_write(output, windows, channels, space);
  });
}

std::string one_line(std::string text)
{
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\r' || c == '\0'; }, ' ');
  return text;
}

/// The attributes that can be written again, except those by which OpenEXR itself describes a part.
Attributes attributes_of(const Imf::Header& header)
{
  Attributes attributes;
  for (auto entry = header.begin(); entry != header.end(); ++entry) {
    const std::string name = entry.name();
    if (name == "name" || name == "type" || name == "view") continue;
    if (auto text = exr_attribute_text(name, entry.attribute())) attributes[name] = std::move(*text);
  }
  return attributes;
}

/// Checks what the header claims, before anything of that size is allocated.
Picture picture_from_header(const Imf::Header& header, const std::string& file)
{
  if (header.hasType() && header.type() != Imf::SCANLINEIMAGE && header.type() != Imf::TILEDIMAGE) {
    throw InputError(file, "holds a picture of type '" + one_line(header.type()) + "'; only flat pictures are read");
  }
  const Imath::Box2i &data = header.dataWindow(), &display = header.displayWindow();
  const auto side = [](int first, int last) { return std::int64_t{last} - first + 1; };
  const std::int64_t width = side(data.min.x, data.max.x), height = side(data.min.y, data.max.y);
  const std::int64_t full_width = side(display.min.x, display.max.x), full_height = side(display.min.y, display.max.y);
  Picture picture;
  std::int64_t num_channels = 0;
  for (auto entry = header.channels().begin(); entry != header.channels().end(); ++entry) {
    const Imf::Channel& channel = entry.channel();
    if (channel.xSampling != 1 || channel.ySampling != 1) {
      throw InputError(file, "channel '" + one_line(entry.name()) + "' is subsampled; that is not read");
    }
    const ChannelType type = channel.type == Imf::UINT   ? ChannelType::kUint
                             : channel.type == Imf::HALF ? ChannelType::kHalf
                                                         : ChannelType::kFloat;
    picture.channels.push_back({entry.name(), type, {}});
    ++num_channels;
  }
  const auto is_sane = [](std::int64_t s) { return s > 0 && s <= kMaxSide; };
  if (!is_sane(width) || !is_sane(height) || !is_sane(full_width) || !is_sane(full_height) || num_channels == 0 ||
      width * num_channels > kMaxRowValues || width * height * num_channels > kMaxValues) {
    throw InputError(file, "its header claims " + std::to_string(width) + "x" + std::to_string(height) + " pixels in " +
                               std::to_string(num_channels) + " channels, which is not plausible");
  }
  const std::int64_t crop_x = std::int64_t{data.min.x} - display.min.x,
                     crop_y = std::int64_t{data.min.y} - display.min.y;
  if (std::abs(crop_x) > 2 * kMaxSide || std::abs(crop_y) > 2 * kMaxSide) {
    throw InputError(file, "its data window lies far outside its display window");
  }
  constexpr std::int64_t kValueBytes = sizeof(float);
  memory_require(static_cast<std::uint64_t>(width * height * num_channels * kValueBytes), file);
  picture.file = file;
  picture.width = static_cast<int>(width);
  picture.height = static_cast<int>(height);
  picture.crop_x = static_cast<int>(crop_x);
  picture.crop_y = static_cast<int>(crop_y);
  picture.full_width = static_cast<int>(full_width);
  picture.full_height = static_cast<int>(full_height);
  picture.lossy = header.compression() >= Imf::PXR24_COMPRESSION;
  picture.attributes = attributes_of(header);
  return picture;
}

void read_rows(Imf::InputPart& part, const Imath::Box2i& data, Picture& picture)
{
  constexpr std::size_t kBlockBytes = std::size_t{64} << 20;
  const std::size_t width = static_cast<std::size_t>(picture.width), num_channels = picture.channels.size();
  const std::size_t row_values = width * num_channels;
  const int most_rows = std::min(kRowsAtOnce, picture.height);
  const int rows_at_once =
      std::clamp(static_cast<int>(kBlockBytes / std::max<std::size_t>(row_values * sizeof(float), 1)), 1, most_rows);
  // Integers and floats are of one size.
  const MemoryReservation room(row_values * sizeof(float) * static_cast<std::size_t>(rows_at_once), picture.file);
  std::vector<std::uint32_t> words(row_values * static_cast<std::size_t>(rows_at_once));
  // Not committed before it is written: a header may claim more than the file has.
  for (Channel& channel : picture.channels) channel.values.reserve(width * static_cast<std::size_t>(picture.height));
  for (int y0 = 0; y0 < picture.height; y0 += rows_at_once) {
    const int num_rows = std::min(rows_at_once, picture.height - y0);
    const Imath::V2i origin(data.min.x, data.min.y + y0);
    const std::size_t block = width * static_cast<std::size_t>(num_rows);
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < num_channels; ++c) {
      // Halves come as floats: OpenEXR converts between the two, but it turns integers above a half's range into garbage.
      const Imf::PixelType type = picture.channels[c].type == ChannelType::kUint ? Imf::UINT : Imf::FLOAT;
      buffer.insert(picture.channels[c].name, Imf::Slice::Make(type, words.data() + c * block, origin, picture.width,
                                                               num_rows, std::size_t{4}, 4 * width));
    }
    part.setFrameBuffer(buffer);
    part.readPixels(origin.y, origin.y + num_rows - 1);
    for (std::size_t c = 0; c < num_channels; ++c) {
      const auto first = words.begin() + static_cast<std::ptrdiff_t>(c * block);
      const bool is_integer = picture.channels[c].type == ChannelType::kUint;
      std::transform(first, first + static_cast<std::ptrdiff_t>(block), std::back_inserter(picture.channels[c].values),
                     [=](std::uint32_t w) { return is_integer ? static_cast<float>(w) : std::bit_cast<float>(w); });
    }
  }
}

/// Whether a file's colours are those of ACEScg, as far as floats tell.
bool is_acescg(const Imf::Header& header)
{
  if (!Imf::hasChromaticities(header)) return false;
  const Imf::Chromaticities& found = Imf::chromaticities(header);
  const Chromaticities& expected = kChromaticities[static_cast<std::size_t>(ColorSpace::kAcescg)];
  const auto is_near = [](const Imath::V2f& a, const std::array<double, 2>& b) {
    return std::abs(a.x - b[0]) < 1e-4 && std::abs(a.y - b[1]) < 1e-4;
  };
  return is_near(found.red, expected.red) && is_near(found.green, expected.green) &&
         is_near(found.blue, expected.blue) && is_near(found.white, expected.white);
}

/// Converts the colours of a picture from ACEScg to Rec.709.
void convert_colors(Picture& picture)
{
  const ColorMatrix matrix = color_matrix(ColorSpace::kAcescg, ColorSpace::kRec709);
  for (Channel& red : picture.channels) {
    if (color_component(red.name) != std::size_t{0}) continue;
    const auto other = [&](char letter) {
      const std::string name = red.name.substr(0, red.name.size() - 1) + letter;
      return std::find_if(picture.channels.begin(), picture.channels.end(),
                          [&](const Channel& channel) { return channel.name == name; });
    };
    const auto green = other('G'), blue = other('B');
    if (green == picture.channels.end() || blue == picture.channels.end()) continue;
    for (std::size_t i = 0; i < red.values.size(); ++i) {
      const double r = red.values[i], g = green->values[i], b = blue->values[i];
      const auto row = [&](std::size_t c) {
        return static_cast<float>(matrix[c][0] * r + matrix[c][1] * g + matrix[c][2] * b);
      };
      red.values[i] = row(0);
      green->values[i] = row(1);
      blue->values[i] = row(2);
    }
  }
}

}  // namespace

Attributes exr_attributes(const Statistics& statistics, std::string_view command)
{
  std::string warnings;
  for (const std::string& warning : statistics.warnings) {
    warnings += (warnings.empty() ? "" : "\n") + warning;
  }
  Attributes attributes = {
      {"software", "relief " + statistics.version},
      {"relief:version", statistics.version},
      {"relief:scene", statistics.scene},
      {"relief:seed", std::to_string(statistics.seed)},
      {"relief:frame", std::to_string(statistics.frame)},
      {"relief:samples", attribute_number(statistics.samples_per_pixel)},
      {"relief:seconds", attribute_number(statistics.render_seconds)},
      {"relief:threads", std::to_string(statistics.threads)},
      {"relief:isa", statistics.isa},
      {"relief:error_rmse", attribute_number(statistics.error_rmse)},
      {"relief:error_relmse", attribute_number(statistics.error_relmse)},
      {"relief:view", statistics.view},
      {"relief:stop_reason", statistics.stop_reason},
      {"relief:warnings", warnings},
      {"relief:command", std::string(command)},
  };
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  std::array<char, 32> date{};
  if (::localtime_r(&now, &local) != nullptr &&
      std::strftime(date.data(), date.size(), "%Y:%m:%d %H:%M:%S", &local) > 0) {
    attributes["capDate"] = date.data();
    // Seconds to be added to local time.
    attributes["utcOffset"] = std::to_string(-local.tm_gmtoff);
  }
  std::erase_if(attributes, [](const auto& entry) { return entry.second.empty(); });
  return attributes;
}

Attributes exr_camera_attributes(const Camera& camera)
{
  // Rows of a matrix that a row of coordinates stands before, as OpenEXR has it.
  const auto text = [](const std::array<std::array<double, 4>, 4>& m) {
    std::string numbers;
    for (const auto& row : m) {
      for (const double value : row) numbers += (numbers.empty() ? "" : " ") + attribute_number(value);
    }
    return numbers;
  };
  const Affine3 to = inverse(camera.world_from_camera);
  const std::array<Vec3f, 4> images = {to.x, to.y, to.z, to.p};
  const double x_scale = 1.0 / static_cast<double>(camera.half_width), y_scale = 1.0 / static_cast<double>(camera.half_height);
  // A shift is a fraction of the whole window, which is 2 wide in these coordinates.
  const double x_shift = 2.0 * static_cast<double>(camera.shift_x), y_shift = 2.0 * static_cast<double>(camera.shift_y);
  const bool is_perspective = camera.projection == Projection::kPerspective;
  std::array<std::array<double, 4>, 4> camera_matrix{}, screen_matrix{};
  for (std::size_t i = 0; i < 4; ++i) {
    const double x = static_cast<double>(images[i].x), y = static_cast<double>(images[i].y),
                 z = static_cast<double>(images[i].z), one = i == 3 ? 1.0 : 0.0;
    camera_matrix[i] = {x, y, z, one};
    const double w = is_perspective ? -z : one;
    // There need not be planes that the third coordinate could lie between: it rises with the distance, and tells it.
    screen_matrix[i] = {x * x_scale - w * x_shift, y * y_scale - w * y_shift, is_perspective ? w - one : -z, w};
  }
  Attributes attributes = {{"worldToCamera", text(camera_matrix)}};
  // No matrix makes a panorama.
  if (camera.projection == Projection::kPanoramic) return attributes;
  attributes["worldToNDC"] = text(screen_matrix);
  if (camera.pixel_aspect != 1)
    attributes["pixelAspectRatio"] = attribute_number(static_cast<double>(camera.pixel_aspect));
  return attributes;
}

Attributes exr_cryptomatte_attributes(const Scene& scene, AovMask aov_mask)
{
  Attributes attributes;
  for (int i = 0; i < kNumCryptomattes; ++i) {
    if (!aov_is_in(static_cast<Aov>(kFirstCryptomatte + i), aov_mask)) continue;
    const std::string layer(cryptomatte_layer(i));
    char key[9];
    std::snprintf(key, sizeof key, "%08x", cryptomatte_hash(layer));
    const std::string prefix = "cryptomatte/" + std::string(key, 7) + "/";
    attributes[prefix + "name"] = layer;
    attributes[prefix + "hash"] = "MurmurHash3_32";
    attributes[prefix + "conversion"] = "uint32_to_float32";
    attributes[prefix + "manifest"] = cryptomatte_manifest(scene, i);
  }
  return attributes;
}

std::vector<std::string> exr_damaged_layers(const FilmLayout& layout, ExrCompression compression)
{
  std::vector<std::string> damaged;
  if (compression != ExrCompression::kDwaa && compression != ExrCompression::kDwab) return damaged;
  for (const AovInfo& info : kAovInfo) {
    const bool kept = layout.offset[static_cast<std::size_t>(info.aov)] >= 0;
    const bool is_data = info.aov == Aov::kNormal || info.aov == Aov::kPosition || info.aov == Aov::kVariance ||
                         info.aov == Aov::kHalf || info.aov == Aov::kDenoisingNormal ||
                         info.aov == Aov::kDenoisingHalf || info.channels.empty();
    if (kept && is_data) damaged.emplace_back(info.name);
  }
  return damaged;
}

void exr_write(const std::filesystem::path& path,
               const FilmView& film,
               const Attributes& attributes,
               const ExrOptions& options,
               const std::vector<ChannelView>& more)
{
  std::vector<ChannelView> channels = more;
  for (ChannelView& channel : exr_film_channels(film, options)) channels.push_back(std::move(channel));
  write_channels(path, exr_windows(film), channels, attributes, options.compression, options.color_space);
}

void exr_write(const std::filesystem::path& path, const Picture& picture, ExrCompression compression)
{
  std::vector<ChannelView> channels;
  for (const Channel& channel : picture.channels) {
    channels.push_back({channel.values.data(), 1, picture.width, channel.type, channel.name});
  }
  const ExrWindows windows{picture.width,  picture.height,     picture.crop_x,
                           picture.crop_y, picture.full_width, picture.full_height};
  write_channels(path, windows, channels, picture.attributes, compression);
}

Picture exr_load(const std::filesystem::path& path)
{
  exr_threads_choose();
  const std::string file = path.string();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) throw InputError(file, "no such file");
  if (!std::filesystem::is_regular_file(path, ignored)) throw InputError(file, "not a regular file");
  // OpenEXR allocates its table of chunks from the header's claim when it opens a file, so its own limit is needed too.
  Imf::Header::setMaxImageSize(kMaxSide, kMaxSide);
  Imf::Header::setMaxTileSize(4096, 4096);
  const std::uint64_t decoder_bytes = exr_decoder_bytes(file);
  try {
    Imf::MultiPartInputFile input(file.c_str(), Imf::globalThreadCount(), false);
    if (input.parts() < 1) throw InputError(file, "holds no picture");
    const Imf::Header& header = input.header(0);
    Picture picture = picture_from_header(header, file);
    const MemoryReservation room(decoder_bytes, file);
    if (!input.partComplete(0)) throw InputError(file, "is incomplete: its writer was interrupted");
    Imf::InputPart part(input, 0);
    read_rows(part, header.dataWindow(), picture);
    if (is_acescg(header)) convert_colors(picture);
    return picture;
  } catch (const InputError&) {
    throw;
  } catch (const OutOfMemory&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(file);
  } catch (const std::exception& error) {
    throw InputError(file, "not a readable OpenEXR file: " + one_line(error.what()));
  }
}

}  // namespace relief
