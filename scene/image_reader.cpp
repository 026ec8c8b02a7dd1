#include "scene/image_reader.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "kernel/assert.h"
#include "scene/diagnostics.h"
#include "scene/png_file.h"

namespace relief {
namespace {

[[noreturn]] void fail(const ImageSource& source, const std::string& expected, std::string found)
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

std::vector<unsigned char> file_load(const ImageSource& source)
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

}  // namespace

ImageReader::ImageReader(const ImageSource& source) : source_(source)
{
  try {
    open();
    check_header();
  } catch (const SceneError&) {
    throw;
  } catch (const std::exception& e) {
    fail(source_, "a readable image", e.what());
  }
}

void ImageReader::open()
{
  std::vector<unsigned char> head(16);
  if (!source_.file.empty()) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(source_.file, error)) {
      fail(source_, "an image file", std::filesystem::exists(source_.file, error) ? "not a file" : "no such file");
    }
    std::ifstream stream(source_.file, std::ios::binary);
    stream.read(reinterpret_cast<char*>(head.data()), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(stream.gcount()));
  } else {
    head.assign(source_.encoded.begin(), source_.encoded.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(
                                                                       head.size(), source_.encoded.size())));
  }
  std::string format = format_from_signature(head);
  if (format.empty()) {
    if (source_.file.empty()) {
      fail(source_, "an image that OpenImageIO reads", head.empty() ? "no data" : "bytes of an unknown format");
    }
    format = std::filesystem::path(source_.file).extension().string();
    format.erase(0, 1);
  }
  if (format == "jpeg") {
    if (!source_.file.empty()) {
      owned_ = file_load(source_);
    }
    if (!jpeg_is_complete(owned_.empty() ? source_.encoded : std::span<const unsigned char>(owned_))) {
      fail(source_, "a complete JPEG image", "truncated data");
    }
  }
  if (!format.empty()) {
    image_ = format == "png" ? png_file_make() : image_io().make_file(format);
  }
  if (image_ == nullptr) {
    fail(source_, "an image that OpenImageIO reads", "format \"" + format + "\"");
  }
  const std::span<const unsigned char> bytes = owned_.empty() ? source_.encoded : owned_;
  const bool is_embedded = source_.file.empty() || !owned_.empty();
  if (is_embedded && !image_->can_be_embedded()) {
    fail(source_, "an image format that can be embedded", "format \"" + format + "\"");
  }
  const std::string name = source_.file.empty() ? "embedded." + format : source_.file;
  const std::string error = image_->open(name, bytes, header_);
  if (!error.empty()) {
    fail(source_, "a readable image", error);
  }
}

void ImageReader::check_header() const
{
  const bool sane = header_.width >= 1 && header_.height >= 1 && header_.width <= kMaxTextureSide &&
                    header_.height <= kMaxTextureSide && header_.depth <= 1 && header_.num_channels >= 1 &&
                    header_.num_channels <= kMaxImageChannels;
  if (!sane) {
    fail(source_,
         "a flat image of at most " + std::to_string(kMaxTextureSide) + " texels a side and " +
             std::to_string(kMaxImageChannels) + " channels",
         std::to_string(header_.width) + " x " + std::to_string(header_.height) + " x " +
             std::to_string(header_.depth) + " texels, " + std::to_string(header_.num_channels) + " channels");
  }
  if (header_.is_deep) {
    fail(source_, "a flat image", "a deep image");
  }
  // OpenImageIO 2.4 says that it has read such samples, but leaves the buffer as it was.
  if (!header_.is_integer && header_.sample_bits == 64 && header_.format_name == "tiff") {
    fail(source_, "a TIFF image of at most 32 bits a sample", "64 bits");
  }
}

void ImageReader::select(int channel_begin, int channel_end, SampleType type)
{
  RELIEF_ASSERT(0 <= channel_begin && channel_begin < channel_end && channel_end <= header_.num_channels);
  channel_begin_ = channel_begin;
  channel_end_ = channel_end;
  type_ = type;
}

std::size_t ImageReader::row_bytes() const
{
  const std::size_t sample_bytes = type_ == SampleType::kU8 ? 1 : type_ == SampleType::kU16 ? 2 : 4;
  return static_cast<std::size_t>(header_.width) * static_cast<std::size_t>(channel_end_ - channel_begin_) *
         sample_bytes;
}

const unsigned char* ImageReader::load_rows(int begin, int end)
{
  RELIEF_ASSERT(0 <= begin && begin < end && end <= header_.height);
  if (begin < rows_begin_ || end > rows_end_) {
    read(begin, end);
  }
  return rows_.data() + static_cast<std::size_t>(begin - rows_begin_) * row_bytes();
}

/// Brings at least the rows [begin, end) into `rows_`; tiled files give whole rows of tiles.
void ImageReader::read(int begin, int end)
{
  rows_begin_ = rows_end_ = 0;
  if (const int tile = header_.tile_height; tile > 0) {
    begin = begin / tile * tile;
    end = static_cast<int>(std::min<std::int64_t>((std::int64_t{end} + tile - 1) / tile * tile, header_.height));
  }
  // Zeroed every time: a reader that gives up silently must not leave an earlier image's texels.
  rows_.assign(static_cast<std::size_t>(end - begin) * row_bytes(), 0);
  const std::string error = image_->read_rows(begin, end, channel_begin_, channel_end_, type_, rows_.data());
  if (!error.empty()) {
    fail(source_, "complete image data", error);
  }
  rows_begin_ = begin;
  rows_end_ = end;
}

}  // namespace relief
