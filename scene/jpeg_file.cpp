#include "scene/jpeg_file.h"

#include <csetjmp>
#include <cstdint>
#include <cstdio>

#include <jpeglib.h>

#include "kernel/assert.h"
#include "scene/samples_convert.h"

namespace relief {
namespace {

/// libjpeg reports errors by a function that must not return: here it jumps over the frames above it, up to the functions
/// here that call setjmp. In those nothing may need a destructor.
class JpegFile final : public ImageFile {
 public:
  JpegFile()
  {
    jpeg_.err = jpeg_std_error(&errors_);
    errors_.error_exit = on_error;
    errors_.output_message = [](j_common_ptr) {};
    jpeg_.client_data = this;
  }
  ~JpegFile() override { jpeg_destroy_decompress(&jpeg_); }
  JpegFile(const JpegFile&) = delete;
  JpegFile& operator=(const JpegFile&) = delete;

  bool can_be_embedded() const override { return true; }

  std::string open(const std::string&, std::span<const unsigned char> encoded, ImageHeader& header) override
  {
    encoded_ = encoded;
    if (!start()) return message_;
    num_channels_ = jpeg_.output_components;
    width_ = jpeg_.output_width;
    height_ = static_cast<int>(jpeg_.output_height);
    header.width = static_cast<int>(width_);
    header.height = height_;
    header.depth = 1;
    header.num_channels = num_channels_;
    header.sample_bits = 8;
    header.sample_type = SampleType::kU8;
    header.is_integer = true;
    header.channel_names = num_channels_ == 1 ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"};
    header.format_name = "jpeg";
    return {};
  }

  std::string read_rows(int row_begin,
                        int row_end,
                        int channel_begin,
                        int channel_end,
                        SampleType type,
                        unsigned char* rows) override
  {
    RELIEF_ASSERT(0 <= row_begin && row_begin < row_end && row_end <= height_);
    const std::size_t type_bytes = sample_bytes(type);
    const int num_copied = channel_end - channel_begin;
    row_.resize(width_ * static_cast<std::size_t>(num_channels_));
    for (int row = row_begin; row < row_end; ++row) {
      failed_ = failed_ || (row < next_row_ && !start()) || !decode_to(row);
      if (failed_) return message_;
      samples_convert<std::uint8_t>(row_.data() + channel_begin, width_, num_channels_, num_copied, type, rows);
      rows += width_ * static_cast<std::size_t>(num_copied) * type_bytes;
    }
    return {};
  }

 private:
  [[noreturn]] static void on_error(j_common_ptr jpeg)
  {
    auto* self = static_cast<JpegFile*>(jpeg->client_data);
    jpeg->err->format_message(jpeg, self->message_);
    std::longjmp(self->jump_, 1);
  }

  /// Reads up to the first row, also once more. @return false: message_ says why not
  bool start()
  {
    next_row_ = 0;
    if (setjmp(jump_) != 0) return false;
    jpeg_destroy_decompress(&jpeg_);
    jpeg_create_decompress(&jpeg_);
    jpeg_mem_src(&jpeg_, encoded_.data(), encoded_.size());
    jpeg_read_header(&jpeg_, TRUE);
    jpeg_start_decompress(&jpeg_);
    return true;
  }

  /// Decodes rows until this one is in row_. @return false: message_ says why not
  bool decode_to(int row)
  {
    if (next_row_ > row) return true;
    if (setjmp(jump_) != 0) return false;
    for (; next_row_ <= row; ++next_row_) {
      JSAMPROW to = row_.data();
      jpeg_read_scanlines(&jpeg_, &to, 1);
    }
    return true;
  }

  std::span<const unsigned char> encoded_;
  jpeg_decompress_struct jpeg_ = {};
  jpeg_error_mgr errors_ = {};
  std::jmp_buf jump_;
  char message_[JMSG_LENGTH_MAX] = {};  ///< of the last error
  bool failed_ = false;                 ///< rows were asked for and could not be had: no others can
  std::size_t width_ = 0;
  int height_ = 0, num_channels_ = 0;
  std::vector<unsigned char> row_;  ///< the last decoded one, with all channels
  int next_row_ = 0;                ///< that will be decoded
};

/// Channels that a file's frame header names; 0: it has none.
int num_components(std::span<const unsigned char> bytes)
{
  // Markers from the start to the frame follow each other, each but the first with its length. A frame's has, after it, the
  // bits of a sample, height and width.
  std::size_t i = 2;
  while (i + 9 < bytes.size() && bytes[i] == 0xff) {
    const unsigned char marker = bytes[i + 1];
    if (marker == 0xff) {
      ++i;  // fill
      continue;
    }
    const bool is_frame = marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (is_frame) return bytes[i + 9];
    i += 2 + (static_cast<std::size_t>(bytes[i + 2]) << 8 | bytes[i + 3]);
  }
  return 0;
}

}  // namespace

std::unique_ptr<ImageFile> jpeg_file_make(std::span<const unsigned char> encoded)
{
  const int channels = num_components(encoded);
  if (channels != 1 && channels != 3) return nullptr;
  return std::make_unique<JpegFile>();
}

}  // namespace relief
