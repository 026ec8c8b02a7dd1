#include "scene/image_reader.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>

#include "kernel/assert.h"
#include "scene/diagnostics.h"
#include "scene/exr_file.h"
#include "scene/hdr_file.h"
#include "scene/image_format.h"
#include "scene/image_memory.h"
#include "scene/jpeg_file.h"
#include "scene/memory.h"
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

/// What messages about memory call an image.
std::string label_of(const ImageSource& source)
{
  return source.scene_file + ": " + source.json_path + (source.file.empty() ? "" : " (" + source.file + ')');
}

/// For errors of libraries, which may mean a lack of memory.
[[noreturn]] void fail_to_read(const ImageSource& source, const std::string& expected, const std::string& error)
{
  if (is_out_of_memory(error)) {
    throw OutOfMemory(label_of(source) + ": " + error);
  }
  fail(source, expected, error);
}

/// The first and last bytes of an image.
struct Ends {
  std::vector<unsigned char> head, tail;
};

Ends ends_of_bytes(std::span<const unsigned char> bytes)
{
  const std::size_t head = std::min(bytes.size(), ImageEnds::kHeadBytes);
  const std::size_t tail = std::min(bytes.size(), ImageEnds::kTailBytes);
  return {{bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(head)},
          {bytes.end() - static_cast<std::ptrdiff_t>(tail), bytes.end()}};
}

Ends ends_of_file(const ImageSource& source)
{
  std::ifstream stream(source.file, std::ios::binary | std::ios::ate);
  const auto size = static_cast<std::size_t>(std::max<std::streamoff>(stream.tellg(), 0));
  Ends ends;
  ends.head.resize(std::min(size, ImageEnds::kHeadBytes));
  ends.tail.resize(std::min(size, ImageEnds::kTailBytes));
  stream.seekg(0);
  stream.read(reinterpret_cast<char*>(ends.head.data()), static_cast<std::streamsize>(ends.head.size()));
  stream.seekg(static_cast<std::streamoff>(size - ends.tail.size()));
  stream.read(reinterpret_cast<char*>(ends.tail.data()), static_cast<std::streamsize>(ends.tail.size()));
  if (!stream) {
    fail(source, "an image file", "cannot be read");
  }
  return ends;
}

class BytesOfMemory final : public ImageBytes {
 public:
  explicit BytesOfMemory(std::span<const unsigned char> bytes) : bytes_(bytes) {}

  bool read(std::uint64_t offset, std::span<unsigned char> bytes) override
  {
    if (offset > bytes_.size() || bytes.size() > bytes_.size() - offset) {
      return false;
    }
    std::ranges::copy(bytes_.subspan(static_cast<std::size_t>(offset), bytes.size()), bytes.begin());
    return true;
  }

 private:
  std::span<const unsigned char> bytes_;
};

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
  memory_require(static_cast<std::uint64_t>(std::max<std::streamoff>(size, 0)), label_of(source));
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
  } catch (const OutOfMemory&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(label_of(source_));
  } catch (const std::exception& e) {
    fail_to_read(source_, "a readable image", e.what());
  }
}

void ImageReader::open()
{
  if (!source_.file.empty()) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(source_.file, error)) {
      fail(source_, "an image file", std::filesystem::exists(source_.file, error) ? "not a file" : "no such file");
    }
  }
  const Ends ends = source_.file.empty() ? ends_of_bytes(source_.encoded) : ends_of_file(source_);
  const ImageFormat found = image_format({ends.head, ends.tail}, source_.file);
  if (found.reader == nullptr) {
    fail(source_, kImageFormats, found.found);
  }
  const std::string format = found.reader;
  if (source_.file.empty()) {
    BytesOfMemory bytes(source_.encoded);
    reserve_decoder(format, bytes);
  } else {
    BytesOfFile bytes(source_.file);
    reserve_decoder(format, bytes);
  }
  if (format == "jpeg" || format == "hdr") {
    if (!source_.file.empty()) {
      owned_ = file_load(source_);
    }
    if (format == "jpeg" &&
        !jpeg_is_complete(owned_.empty() ? source_.encoded : std::span<const unsigned char>(owned_))) {
      fail(source_, "a complete JPEG image", "truncated data");
    }
  }
  const std::span<const unsigned char> bytes = owned_.empty() ? source_.encoded : owned_;
  image_ = format == "png"    ? png_file_make()
           : format == "jpeg" ? jpeg_file_make(bytes)
           : format == "hdr"  ? hdr_file_make(bytes)
           : format == "openexr" ? exr_file_make(source_.file, bytes)
                              : nullptr;
  if (image_ == nullptr) image_ = image_io().make_file(format);
  if (image_ == nullptr) {
    fail(source_, "an image that OpenImageIO reads", "format \"" + format + "\", which it was built without");
  }
  const bool is_embedded = source_.file.empty() || !owned_.empty();
  if (is_embedded && !image_->can_be_embedded()) {
    fail(source_, "an image format that can be embedded", "format \"" + format + "\"");
  }
  const std::string name = source_.file.empty() ? "embedded." + format : source_.file;
  const std::string error = image_->open(name, bytes, header_);
  if (!error.empty()) {
    fail_to_read(source_, "a readable image", error);
  }
}

void ImageReader::reserve_decoder(const std::string& format, ImageBytes& bytes)
{
  const std::optional<std::uint64_t> num_bytes = decoder_bytes(format, bytes);
  if (!num_bytes) {
    fail(source_, "a whole OpenEXR header", "a file that ends before it does");
  }
  decoder_room_ = MemoryReservation(*num_bytes, label_of(source_));
}

void ImageReader::check_header()
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
  block_room_ = MemoryReservation(decoder_block_bytes(header_), label_of(source_));
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
  return static_cast<std::size_t>(header_.width) * static_cast<std::size_t>(channel_end_ - channel_begin_) *
         sample_bytes(type_);
}

int ImageReader::rows_at_once() const
{
  // Of all channels: some decoders bring rows of them along for the few that are selected.
  constexpr std::size_t kBandBytes = std::size_t{64} << 20, kSampleBytes = sizeof(float);
  constexpr std::size_t kMostRows = 256;  // a multiple of the usual tile sides and compression blocks
  const std::size_t row =
      static_cast<std::size_t>(header_.width) * static_cast<std::size_t>(header_.num_channels) * kSampleBytes;
  return static_cast<int>(std::clamp<std::size_t>(kBandBytes / row, 1, kMostRows));
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
  const std::size_t num_bytes = static_cast<std::size_t>(end - begin) * row_bytes();
  if (num_bytes > rows_.capacity()) {
    rows_room_ = MemoryReservation(num_bytes, label_of(source_));
  }
  rows_.assign(num_bytes, 0);
  const std::string error = image_->read_rows(begin, end, channel_begin_, channel_end_, type_, rows_.data());
  if (!error.empty()) {
    fail_to_read(source_, "complete image data", error);
  }
  rows_begin_ = begin;
  rows_end_ = end;
}

}  // namespace relief
