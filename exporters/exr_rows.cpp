#include "exporters/exr_rows.h"

#include <ImfChromaticities.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfThreading.h>

#include <cmath>
#include <cstring>
#include <mutex>
#include <new>
#include <thread>

#include "exporters/atomic_file.h"
#include "exporters/exr_attribute.h"
#include "exporters/errors.h"
#include "kernel/texture/half.h"
#include "scene/image_memory.h"
#include "scene/memory.h"

namespace relief {

namespace {


constexpr Imf::Compression kImfCompressions[] = {Imf::NO_COMPRESSION,  Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,
                                                 Imf::PIZ_COMPRESSION, Imf::DWAA_COMPRESSION, Imf::DWAB_COMPRESSION};
constexpr Imf::PixelType kImfTypes[] = {Imf::UINT, Imf::HALF, Imf::FLOAT};

std::once_flag g_threads_chosen;

/// OpenEXR's way of writing, onto a file that appears whole or not at all.
class AtomicStream : public Imf::OStream {
 public:
  explicit AtomicStream(AtomicFile& file) : Imf::OStream(file.path().string().c_str()), file_(file) {}
  void write(const char* bytes, int num_bytes) override { file_.write(bytes, static_cast<std::size_t>(num_bytes)); }
  std::uint64_t tellp() override { return file_.position(); }
  void seekp(std::uint64_t position) override { file_.seek(position); }

 private:
  AtomicFile& file_;
};

ChannelType film_channel_type(const AovInfo& info, const ExrOptions& options)
{
  if (info.integer_like) return ChannelType::kUint;
  switch (info.aov) {
    case Aov::kBeauty:
    case Aov::kDirect:
    case Aov::kIndirect:
    case Aov::kAlbedo:
    case Aov::kNormal:
    case Aov::kEmission:
    case Aov::kEnvironment:
    case Aov::kDenoisingAlbedo:
    case Aov::kDenoisingNormal:
      return options.float_color ? ChannelType::kFloat : ChannelType::kHalf;
    default:
      return ChannelType::kFloat;
  }
}

}  // namespace

std::uint64_t exr_decoder_bytes(const std::string& file)
{
  BytesOfFile bytes(file);
  const std::optional<std::uint64_t> num_bytes = decoder_bytes("openexr", bytes);
  if (!num_bytes) throw InputError(file, "not a readable OpenEXR file: it ends before its header does");
  return *num_bytes;
}

void exr_threads_choose()
{
  // More threads than 16 do not pay: a block of 256 rows holds no more than 16 ZIP chunks.
  std::call_once(g_threads_chosen, [] {
    Imf::setGlobalThreadCount(static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1u, 16u)));
  });
}

void exr_use_threads(int num_threads)
{
  std::call_once(g_threads_chosen, [] {});
  Imf::setGlobalThreadCount(std::max(num_threads, 0));
}

Imf::PixelType exr_pixel_type(ChannelType type) { return kImfTypes[static_cast<std::size_t>(type)]; }

std::size_t exr_value_bytes(ChannelType type) { return type == ChannelType::kHalf ? 2 : 4; }

ExrWindows exr_windows(const FilmView& film)
{
  return {film.width, film.height, film.crop_x, film.crop_y, film.full_width, film.full_height};
}

std::vector<ChannelView> exr_film_channels(const FilmView& film, const ExrOptions& options)
{
  std::vector<ChannelView> channels;
  for (const AovInfo& info : kAovInfo) {
    for (ChannelView& channel : film_layer(film, info.aov).channels) {
      channel.type = film_channel_type(info, options);
      channels.push_back(channel);
    }
  }
  return channels;
}

Imf::Header exr_header_make(const ExrWindows& windows,
                            const std::vector<ChannelView>& channels,
                            const Attributes& attributes,
                            ExrCompression compression,
                            ColorSpace space)
{
  const Imath::Box2i display(Imath::V2i(0, 0), Imath::V2i(windows.full_width - 1, windows.full_height - 1));
  const Imath::Box2i data(Imath::V2i(windows.crop_x, windows.crop_y),
                          Imath::V2i(windows.crop_x + windows.width - 1, windows.crop_y + windows.height - 1));
  Imf::Header header(display, data);
  header.compression() = kImfCompressions[static_cast<std::size_t>(compression)];
  const Chromaticities& primaries = kChromaticities[static_cast<std::size_t>(space)];
  const auto xy = [](const std::array<double, 2>& at) {
    return Imath::V2f(static_cast<float>(at[0]), static_cast<float>(at[1]));
  };
  Imf::addChromaticities(header, Imf::Chromaticities(xy(primaries.red), xy(primaries.green), xy(primaries.blue),
                                                     xy(primaries.white)));
  for (const auto& [name, text] : attributes) exr_attribute_insert(header, name, text);
  for (const ChannelView& channel : channels) {
    header.channels().insert(channel.name, Imf::Channel(exr_pixel_type(channel.type)));
  }
  return header;
}

void exr_file_write(const std::filesystem::path& path, const std::function<void(Imf::OStream&)>& write)
{
  exr_threads_choose();
  try {
    AtomicFile file(path);
    AtomicStream stream(file);
    // The outputs' destructors write the table of chunk offsets and swallow every error; a full disk shows in commit().
    write(stream);
    file.commit();
  } catch (const OutputError&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw OutOfMemory("writing " + path.string());
  } catch (const std::exception& error) {
    throw OutputError(path.string(), error.what());
  }
}

void exr_row_pack(const ChannelView& channel, int width, int y, char* packed)
{
  for (int x = 0; x < width; ++x) {
    const float value = channel.at(x, y);
    switch (channel.type) {
      case ChannelType::kUint: {
        // NaN fails the comparison and becomes 0, which means "none" for ids and counts.
        const double rounded = value > 0.f ? std::min(std::floor(double{value} + 0.5), 4294967295.0) : 0.0;
        const std::uint32_t integer = static_cast<std::uint32_t>(rounded);
        std::memcpy(packed + 4 * x, &integer, 4);
        break;
      }
      case ChannelType::kHalf: {
        // An infinity in a picture spreads through every filter of a compositor; a large number does not.
        const float limited = std::isfinite(value) ? std::clamp(value, -kHalfMax, kHalfMax) : value;
        const std::uint16_t bits = Imath::half(limited).bits();
        std::memcpy(packed + 2 * x, &bits, 2);
        break;
      }
      case ChannelType::kFloat:
        std::memcpy(packed + 4 * x, &value, 4);
        break;
    }
  }
}

void exr_row_pack(const ChannelView& channel,
                  const std::array<const ChannelView*, 3>& rgb,
                  const std::array<double, 3>& weights,
                  int width,
                  int y,
                  char* packed)
{
  std::vector<float> row(static_cast<std::size_t>(width));
  for (int x = 0; x < width; ++x) {
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i) sum += weights[i] * double{rgb[i]->at(x, y)};
    row[static_cast<std::size_t>(x)] = static_cast<float>(sum);
  }
  exr_row_pack({row.data(), 1, 0, channel.type, {}}, width, 0, packed);
}

std::array<const ChannelView*, 3> exr_colors_of(const ChannelView& channel, const std::vector<ChannelView>& channels)
{
  if (!color_component(channel.name)) return {};
  std::array<const ChannelView*, 3> rgb{};
  for (std::size_t i = 0; i < 3; ++i) {
    std::string name = channel.name;
    name.back() = "RGB"[i];
    const auto found = std::find_if(channels.begin(), channels.end(), [&](const ChannelView& c) { return c.name == name; });
    if (found == channels.end()) return {};
    rgb[i] = &*found;
  }
  return rgb;
}

}  // namespace relief
