#include "exporters/exr.h"

#include <ImfChannelList.h>
#include <ImfChromaticities.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfThreading.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <mutex>
#include <new>
#include <thread>

#include "exporters/atomic_file.h"
#include "exporters/errors.h"
#include "scene/cryptomatte.h"
#include "scene/memory.h"

namespace relief {

namespace {

// Rows handled at once. A multiple of every compression's block (1, 16, 32, 256 rows), so that no block is compressed
// twice or decompressed twice, and enough of them to keep a few threads busy.
constexpr int kRowsAtOnce = 256;

// A hostile header is refused before anything of its size is allocated: sides and channels of real pictures are smaller.
constexpr int kMaxSide = 1 << 17;
constexpr std::int64_t kMaxRowValues = std::int64_t{1} << 22;  // one block of rows is then at most 4 GiB
constexpr std::int64_t kMaxValues = std::int64_t{1} << 33;

constexpr float kHalfMax = 65504.f;

constexpr Imf::Compression kImfCompressions[] = {Imf::NO_COMPRESSION,  Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,
                                                 Imf::PIZ_COMPRESSION, Imf::DWAA_COMPRESSION, Imf::DWAB_COMPRESSION};
constexpr Imf::PixelType kImfTypes[] = {Imf::UINT, Imf::HALF, Imf::FLOAT};

std::once_flag g_threads_chosen;

void use_machine_threads()
{
  // More threads than 16 do not pay: a block of 256 rows holds no more than 16 ZIP chunks.
  std::call_once(g_threads_chosen, [] {
    Imf::setGlobalThreadCount(static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1u, 16u)));
  });
}

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

std::size_t bytes_of(ChannelType type) { return type == ChannelType::kHalf ? 2 : 4; }

void pack_row(const ChannelView& channel, int width, int y, char* packed)
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

struct Windows {
  int width = 0, height = 0, crop_x = 0, crop_y = 0, full_width = 0, full_height = 0;
};

Imf::Header header_make(const Windows& windows,
                        const std::vector<ChannelView>& channels,
                        const Attributes& attributes,
                        ExrCompression compression)
{
  const Imath::Box2i display(Imath::V2i(0, 0), Imath::V2i(windows.full_width - 1, windows.full_height - 1));
  const Imath::Box2i data(Imath::V2i(windows.crop_x, windows.crop_y),
                          Imath::V2i(windows.crop_x + windows.width - 1, windows.crop_y + windows.height - 1));
  Imf::Header header(display, data);
  header.compression() = kImfCompressions[static_cast<std::size_t>(compression)];
  Imf::addChromaticities(header, Imf::Chromaticities());  // Rec.709 primaries and D65 are its defaults
  for (const auto& [name, text] : attributes) {
    header.insert(name, Imf::StringAttribute(text));
  }
  for (const ChannelView& channel : channels) {
    header.channels().insert(channel.name, Imf::Channel(kImfTypes[static_cast<std::size_t>(channel.type)]));
  }
  return header;
}

/// Packs and writes the rows, a block at a time, so that a film is never held twice.
void write_rows(Imf::OutputFile& output, const Windows& windows, const std::vector<ChannelView>& channels)
{
  const std::size_t width = static_cast<std::size_t>(windows.width);
  std::vector<std::vector<char>> packed;
  packed.reserve(channels.size());
  for (const ChannelView& channel : channels) {
    packed.emplace_back(width * kRowsAtOnce * bytes_of(channel.type));
  }
  for (int y0 = 0; y0 < windows.height; y0 += kRowsAtOnce) {
    const int num_rows = std::min(kRowsAtOnce, windows.height - y0);
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < channels.size(); ++c) {
      const std::size_t pixel_bytes = bytes_of(channels[c].type), row_bytes = pixel_bytes * width;
      for (int row = 0; row < num_rows; ++row) {
        pack_row(channels[c], windows.width, y0 + row, packed[c].data() + row_bytes * static_cast<std::size_t>(row));
      }
      buffer.insert(channels[c].name,
                    Imf::Slice::Make(kImfTypes[static_cast<std::size_t>(channels[c].type)], packed[c].data(),
                                     Imath::V2i(windows.crop_x, windows.crop_y + y0), windows.width, num_rows,
                                     pixel_bytes, row_bytes));
    }
    output.setFrameBuffer(buffer);
    output.writePixels(num_rows);
  }
}

void write_channels(const std::filesystem::path& path,
                    const Windows& windows,
                    const std::vector<ChannelView>& channels,
                    const Attributes& attributes,
                    ExrCompression compression)
{
  use_machine_threads();
  try {
    if (windows.width <= 0 || windows.height <= 0 || channels.empty()) {
      throw OutputError(path.string(), "the picture has no pixels or no channels");
    }
    AtomicFile file(path);
    AtomicStream stream(file);
    {
      Imf::OutputFile output(stream, header_make(windows, channels, attributes, compression));
      write_rows(output, windows, channels);
      // The destructor writes the table of chunk offsets and swallows every error; a full disk shows in commit().
    }
    file.commit();
  } catch (const OutputError&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw OutOfMemory("writing " + path.string());
  } catch (const std::exception& error) {
    throw OutputError(path.string(), error.what());
  }
}

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

std::string one_line(std::string text)
{
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\r' || c == '\0'; }, ' ');
  return text;
}

/// The attributes that are text, except those by which OpenEXR itself describes a part.
Attributes attributes_of(const Imf::Header& header)
{
  Attributes attributes;
  for (auto entry = header.begin(); entry != header.end(); ++entry) {
    const std::string name = entry.name();
    if (name == "name" || name == "type" || name == "view") continue;
    const auto* text = dynamic_cast<const Imf::StringAttribute*>(&entry.attribute());
    if (text != nullptr) attributes[name] = text->value();
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
  const std::size_t width = static_cast<std::size_t>(picture.width);
  std::vector<float> values(width * kRowsAtOnce * picture.channels.size());
  std::vector<std::uint32_t> integers;
  const bool has_integers = std::any_of(picture.channels.begin(), picture.channels.end(),
                                        [](const Channel& channel) { return channel.type == ChannelType::kUint; });
  if (has_integers) integers.resize(values.size());
  for (int y0 = 0; y0 < picture.height; y0 += kRowsAtOnce) {
    const int num_rows = std::min(kRowsAtOnce, picture.height - y0);
    const Imath::V2i origin(data.min.x, data.min.y + y0);
    const std::size_t block = width * static_cast<std::size_t>(num_rows);
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < picture.channels.size(); ++c) {
      const bool is_integer = picture.channels[c].type == ChannelType::kUint;
      void* target = is_integer ? static_cast<void*>(integers.data() + c * block) : values.data() + c * block;
      // Halves come as floats: OpenEXR converts between the two, but it turns integers above a half's range into garbage.
      buffer.insert(picture.channels[c].name, Imf::Slice::Make(is_integer ? Imf::UINT : Imf::FLOAT, target, origin,
                                                               picture.width, num_rows, std::size_t{4}, 4 * width));
    }
    part.setFrameBuffer(buffer);
    part.readPixels(origin.y, origin.y + num_rows - 1);
    for (std::size_t c = 0; c < picture.channels.size(); ++c) {
      std::vector<float>& kept = picture.channels[c].values;
      if (picture.channels[c].type == ChannelType::kUint) {
        const std::uint32_t* first = integers.data() + c * block;
        std::transform(first, first + block, std::back_inserter(kept),
                       [](std::uint32_t i) { return static_cast<float>(i); });
      } else {
        kept.insert(kept.end(), values.data() + c * block, values.data() + (c + 1) * block);
      }
    }
  }
}

}  // namespace

void exr_use_threads(int num_threads)
{
  std::call_once(g_threads_chosen, [] {});
  Imf::setGlobalThreadCount(std::max(num_threads, 0));
}

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
  std::erase_if(attributes, [](const auto& entry) { return entry.second.empty(); });
  return attributes;
}

Attributes exr_cryptomatte_attributes(const Scene& scene, std::uint32_t aov_mask)
{
  Attributes attributes;
  for (int i = 0; i < kNumCryptomattes; ++i) {
    if ((aov_mask >> (kFirstCryptomatte + i) & 1u) == 0) continue;
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
                         info.aov == Aov::kHalf || info.aov == Aov::kDenoisingNormal || info.channels.empty();
    if (kept && is_data) damaged.emplace_back(info.name);
  }
  return damaged;
}

void exr_write(const std::filesystem::path& path,
               const FilmView& film,
               const Attributes& attributes,
               const ExrOptions& options)
{
  std::vector<ChannelView> channels;
  for (const AovInfo& info : kAovInfo) {
    for (ChannelView& channel : film_layer(film, info.aov).channels) {
      channel.type = film_channel_type(info, options);
      channels.push_back(channel);
    }
  }
  const Windows windows{film.width, film.height, film.crop_x, film.crop_y, film.full_width, film.full_height};
  write_channels(path, windows, channels, attributes, options.compression);
}

void exr_write(const std::filesystem::path& path, const Picture& picture, ExrCompression compression)
{
  std::vector<ChannelView> channels;
  for (const Channel& channel : picture.channels) {
    channels.push_back({channel.values.data(), 1, picture.width, channel.type, channel.name});
  }
  const Windows windows{picture.width,  picture.height,     picture.crop_x,
                        picture.crop_y, picture.full_width, picture.full_height};
  write_channels(path, windows, channels, picture.attributes, compression);
}

Picture exr_load(const std::filesystem::path& path)
{
  use_machine_threads();
  const std::string file = path.string();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) throw InputError(file, "no such file");
  if (!std::filesystem::is_regular_file(path, ignored)) throw InputError(file, "not a regular file");
  // OpenEXR allocates its table of chunks from the header's claim when it opens a file, so its own limit is needed too.
  Imf::Header::setMaxImageSize(kMaxSide, kMaxSide);
  Imf::Header::setMaxTileSize(4096, 4096);
  try {
    Imf::MultiPartInputFile input(file.c_str(), Imf::globalThreadCount(), false);
    if (input.parts() < 1) throw InputError(file, "holds no picture");
    const Imf::Header& header = input.header(0);
    Picture picture = picture_from_header(header, file);
    if (!input.partComplete(0)) throw InputError(file, "is incomplete: its writer was interrupted");
    Imf::InputPart part(input, 0);
    read_rows(part, header.dataWindow(), picture);
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
