#include "scene/texture_source.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <vector>

namespace relief {
namespace {

[[noreturn]] void fail(const TextureSource& source, const std::string& expected, std::string found)
{
  if (!source.file.empty()) {
    found = "\"" + source.file + "\": " + found;
  }
  throw SceneError(source.scene_file, source.json_path, expected, found);
}

/// OpenImageIO's name of the format with this signature; empty: unknown.
std::string format_from_signature(std::span<const unsigned char> bytes)
{
  const std::string_view head(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  struct Signature {
    std::string_view bytes, format;
  };
  using namespace std::string_view_literals;
  constexpr Signature kSignatures[] = {
      {"\x89PNG"sv, "png"},
      {"\xff\xd8\xff"sv, "jpeg"},
      {"\x76\x2f\x31\x01"sv, "openexr"},
      {"#?"sv, "hdr"},
      {"II*\0"sv, "tiff"},
      {"MM\0*"sv, "tiff"},
      {"II+\0"sv, "tiff"},
      {"MM\0+"sv, "tiff"},
      {"BM"sv, "bmp"},
      {"GIF8"sv, "gif"},
      {"8BPS"sv, "psd"},
      {"DDS "sv, "dds"},
      {"\0\0\0\x0cjP"sv, "jpeg2000"},
      {"\xab"
       "KTX"sv,
       "KTX"},
  };
  for (const Signature& signature : kSignatures) {
    if (head.substr(0, signature.bytes.size()) == signature.bytes) {
      return std::string(signature.format);
    }
  }
  if (head.substr(0, 4) == "RIFF" && head.size() >= 12 && head.substr(8, 4) == "WEBP") {
    return "webp";
  }
  return {};
}

/// Whether a JPEG stream reaches its end marker. The decoder itself fills what is missing with grey and says nothing.
bool jpeg_is_complete(std::span<const unsigned char> bytes)
{
  constexpr unsigned char kStartOfImage = 0xd8, kEndOfImage = 0xd9;
  const auto stands_alone = [](unsigned char marker) {
    return marker == kStartOfImage || marker == 0x01 || (marker >= 0xd0 && marker <= 0xd7);
  };
  std::size_t i = 0;
  while (i + 1 < bytes.size()) {
    const unsigned char marker = bytes[i + 1];
    if (bytes[i] != 0xff || marker == 0xff || marker == 0x00) {
      ++i;  // coded data, fill bytes, stuffed bytes
    } else if (marker == kEndOfImage) {
      return true;
    } else if (stands_alone(marker)) {
      i += 2;
    } else if (i + 3 < bytes.size()) {
      // Skipping segments keeps a thumbnail's own end marker from being taken for the image's.
      i += 2 + (static_cast<std::size_t>(bytes[i + 2]) << 8 | bytes[i + 3]);
    } else {
      return false;
    }
  }
  return false;
}

std::vector<unsigned char> file_load(const TextureSource& source)
{
  std::ifstream stream(source.file, std::ios::binary | std::ios::ate);
  const std::streamoff size = stream.tellg();
  std::vector<unsigned char> bytes(static_cast<std::size_t>(std::max<std::streamoff>(size, 0)));
  stream.seekg(0);
  stream.read(reinterpret_cast<char*>(bytes.data()), size);
  if (!stream) {
    fail(source, "an image file", "cannot be read");
  }
  return bytes;
}

/// Channels of the file that become R, G, B, A (or grey, alpha).
std::vector<int> select_channels(const OIIO::ImageSpec& spec)
{
  if (spec.nchannels == 2 && spec.alpha_channel != 1) {
    return {0, 1, -1};
  }
  if (spec.nchannels <= 4) {
    std::vector<int> all(static_cast<std::size_t>(spec.nchannels));
    for (int c = 0; c < spec.nchannels; ++c) {
      all[static_cast<std::size_t>(c)] = c;
    }
    return all;
  }
  const int r = spec.channelindex("R"), g = spec.channelindex("G"), b = spec.channelindex("B");
  const int a = spec.channelindex("A");
  std::vector<int> channels = r >= 0 && g >= 0 && b >= 0 ? std::vector<int>{r, g, b} : std::vector<int>{0, 1, 2};
  if (a >= 0) {
    channels.push_back(a);
  }
  return channels;
}

float linear_from_srgb(float encoded)
{
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

}  // namespace

struct TextureReader::Impl {
  explicit Impl(const TextureSource& wanted);

  void open();
  void read_layout();
  std::size_t source_row_bytes() const;
  void load_rows(int begin, int end);
  void convert_row(const unsigned char* source_row, unsigned char* texels);
  std::uint16_t convert_value(float value, bool is_alpha);

  TextureSource source;
  std::vector<unsigned char> owned;  ///< of a JPEG file, which is read whole to look for its end
  std::unique_ptr<OIIO::Filesystem::IOMemReader> memory;
  std::unique_ptr<OIIO::ImageInput> input;
  OIIO::ImageSpec spec;
  std::vector<int> channels;               ///< of the file, one a texel channel; −1: zero
  int channel_begin = 0, channel_end = 0;  ///< range that is read from the file
  bool is_8_bit = false, decode_srgb = false;
  TexelLayout layout;
  TexelRepairs repairs;

  std::vector<unsigned char> rows;  ///< as read from the file: channels [channel_begin, channel_end), u8 or float
  int rows_begin = 0, rows_end = 0;
};

TextureReader::Impl::Impl(const TextureSource& wanted) : source(wanted)
{
  try {
    open();
    read_layout();
  } catch (const SceneError&) {
    throw;
  } catch (const std::exception& e) {
    fail(source, "a readable image", e.what());
  }
}

void TextureReader::Impl::open()
{
  std::vector<unsigned char> head(16);
  if (!source.file.empty()) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(source.file, error)) {
      fail(source, "an image file", std::filesystem::exists(source.file, error) ? "not a file" : "no such file");
    }
    std::ifstream stream(source.file, std::ios::binary);
    stream.read(reinterpret_cast<char*>(head.data()), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(stream.gcount()));
  } else {
    head.assign(source.encoded.begin(), source.encoded.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(
                                                                     head.size(), source.encoded.size())));
  }
  std::string format = format_from_signature(head);
  if (format.empty()) {
    if (source.file.empty()) {
      fail(source, "an image that OpenImageIO reads", head.empty() ? "no data" : "bytes of an unknown format");
    }
    format = std::filesystem::path(source.file).extension().string();
    format.erase(0, 1);
  }
  if (format == "jpeg") {
    if (!source.file.empty()) {
      owned = file_load(source);
    }
    if (!jpeg_is_complete(owned.empty() ? source.encoded : std::span<const unsigned char>(owned))) {
      fail(source, "a complete JPEG image", "truncated data");
    }
  }
  input = format.empty() ? nullptr : OIIO::ImageInput::create(format);
  if (input == nullptr) {
    OIIO::geterror();
    fail(source, "an image that OpenImageIO reads", "format \"" + format + "\"");
  }
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  if (source.file.empty() || !owned.empty()) {
    if (input->supports("ioproxy") == 0) {
      fail(source, "an image format that can be embedded", "format \"" + format + "\"");
    }
    const std::span<const unsigned char> bytes = owned.empty() ? source.encoded : owned;
    memory = std::make_unique<OIIO::Filesystem::IOMemReader>(bytes.data(), bytes.size());
    input->set_ioproxy(memory.get());
  }
  const std::string name = source.file.empty() ? "embedded." + format : source.file;
  if (!input->open(name, spec, config)) {
    fail(source, "a readable image", input->geterror());
  }
}

void TextureReader::Impl::read_layout()
{
  const bool sane = spec.width >= 1 && spec.height >= 1 && spec.width <= kMaxTextureSide &&
                    spec.height <= kMaxTextureSide && spec.depth <= 1 && spec.nchannels >= 1 &&
                    spec.nchannels <= kMaxImageChannels;
  if (!sane) {
    fail(source,
         "a flat image of at most " + std::to_string(kMaxTextureSide) + " texels a side and " +
             std::to_string(kMaxImageChannels) + " channels",
         std::to_string(spec.width) + " x " + std::to_string(spec.height) + " x " + std::to_string(spec.depth) +
             " texels, " + std::to_string(spec.nchannels) + " channels");
  }
  if (spec.deep) {
    fail(source, "a flat image", "a deep image");
  }
  channels = select_channels(spec);
  channel_begin = spec.nchannels;
  for (const int c : channels) {
    if (c >= 0) {
      channel_begin = std::min(channel_begin, c);
      channel_end = std::max(channel_end, c + 1);
    }
  }
  is_8_bit = spec.format == OIIO::TypeDesc::UINT8;
  const bool is_srgb = source.color == TextureColor::kSrgb && !spec.format.is_floating_point();
  decode_srgb = is_srgb && !is_8_bit;
  layout.width = spec.width;
  layout.height = spec.height;
  layout.num_channels = static_cast<int>(channels.size());
  layout.format = !is_8_bit ? TexelFormat::kHalf : is_srgb ? TexelFormat::kU8Srgb : TexelFormat::kU8;
}

std::size_t TextureReader::Impl::source_row_bytes() const
{
  return static_cast<std::size_t>(spec.width) * static_cast<std::size_t>(channel_end - channel_begin) *
         (is_8_bit ? 1 : sizeof(float));
}

/// Brings at least the rows [begin, end) into `rows`; tiled files give whole rows of tiles.
void TextureReader::Impl::load_rows(int begin, int end)
{
  if (begin >= rows_begin && end <= rows_end) {
    return;
  }
  rows_begin = rows_end = 0;
  const bool tiled = spec.tile_width > 0 && spec.tile_height > 0;
  if (tiled) {
    begin = begin / spec.tile_height * spec.tile_height;
    end = static_cast<int>(std::min<std::int64_t>(
        (std::int64_t{end} + spec.tile_height - 1) / spec.tile_height * spec.tile_height, spec.height));
  }
  // Zeroed every time: a reader that gives up silently must not leave an earlier image's texels.
  rows.assign(static_cast<std::size_t>(end - begin) * source_row_bytes(), 0);
  const OIIO::TypeDesc type = is_8_bit ? OIIO::TypeDesc::UINT8 : OIIO::TypeDesc::FLOAT;
  const int y0 = spec.y + begin, y1 = spec.y + end;
  bool ok = false;
  std::string error;
  try {
    ok = tiled ? input->read_tiles(0, 0, spec.x, spec.x + spec.width, y0, y1, spec.z, spec.z + 1, channel_begin,
                                   channel_end, type, rows.data())
               : input->read_scanlines(0, 0, y0, y1, spec.z, channel_begin, channel_end, type, rows.data());
    if (input->has_error()) {
      ok = false;
      error = input->geterror();
    }
  } catch (const std::exception& e) {
    ok = false;
    error = e.what();
  }
  if (!ok) {
    fail(source, "complete image data", error.empty() ? "truncated or corrupt data" : error);
  }
  rows_begin = begin;
  rows_end = end;
}

std::uint16_t TextureReader::Impl::convert_value(float value, bool is_alpha)
{
  if (!is_finite(value)) {
    ++repairs.num_non_finite;
    return 0;
  }
  if (decode_srgb && !is_alpha) {
    value = linear_from_srgb(value);
  }
  if (std::abs(value) > kHalfMax) {
    ++repairs.num_clamped;
    value = std::copysign(kHalfMax, value);
  }
  return half_from_float(value);
}

void TextureReader::Impl::convert_row(const unsigned char* source_row, unsigned char* texels)
{
  const auto num_read = static_cast<std::size_t>(channel_end - channel_begin);
  const std::size_t num_channels = channels.size();
  for (std::size_t c = 0; c < num_channels; ++c) {
    if (channels[c] < 0) {
      continue;  // the caller's texels are zero
    }
    const auto offset = static_cast<std::size_t>(channels[c] - channel_begin);
    const bool is_alpha = (num_channels == 2 || num_channels == 4) && c == num_channels - 1;
    for (std::size_t x = 0; x < static_cast<std::size_t>(spec.width); ++x) {
      const std::size_t from = x * num_read + offset, to = x * num_channels + c;
      if (is_8_bit) {
        texels[to] = source_row[from];
      } else {
        float value;
        std::memcpy(&value, source_row + from * sizeof value, sizeof value);
        const std::uint16_t half = convert_value(value, is_alpha);
        std::memcpy(texels + to * sizeof half, &half, sizeof half);
      }
    }
  }
}

TextureReader::TextureReader(const TextureSource& source) : impl_(std::make_unique<Impl>(source)) {}
TextureReader::~TextureReader() = default;

const TexelLayout& TextureReader::layout() const { return impl_->layout; }
const TexelRepairs& TextureReader::repairs() const { return impl_->repairs; }

void TextureReader::read_rows(int begin, int end, unsigned char* texels)
{
  RELIEF_ASSERT(0 <= begin && begin < end && end <= impl_->layout.height);
  impl_->load_rows(begin, end);
  const std::size_t row_bytes = texel_row_bytes(impl_->layout);
  std::memset(texels, 0, static_cast<std::size_t>(end - begin) * row_bytes);
  for (int y = begin; y < end; ++y) {
    impl_->convert_row(impl_->rows.data() + static_cast<std::size_t>(y - impl_->rows_begin) * impl_->source_row_bytes(),
                       texels + static_cast<std::size_t>(y - begin) * row_bytes);
  }
}

}  // namespace relief
