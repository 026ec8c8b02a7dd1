#include "scene/png_file.h"

#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstdio>
#include <cstring>

#include "kernel/assert.h"
#include "scene/samples_convert.h"

namespace relief {
namespace {

/// libpng reports errors by jumping over the frames above it, up to the functions here that call setjmp: in those nothing
/// may need a destructor.
class PngFile final : public ImageFile {
 public:
  PngFile() = default;
  ~PngFile() override { close(); }
  PngFile(const PngFile&) = delete;
  PngFile& operator=(const PngFile&) = delete;

  bool can_be_embedded() const override { return true; }

  std::string open(const std::string& name, std::span<const unsigned char> encoded, ImageHeader& header) override
  {
    name_ = name;
    encoded_ = encoded;
    if (!start()) {
      return message_;
    }
    const std::vector<std::string> names[] = {{"Y"}, {"Y", "A"}, {"R", "G", "B"}, {"R", "G", "B", "A"}};
    const int num_channels = png_get_channels(png_, info_);
    header.width = static_cast<int>(png_get_image_width(png_, info_));
    header.height = static_cast<int>(png_get_image_height(png_, info_));
    header.depth = 1;
    header.num_channels = num_channels;
    header.sample_bits = png_get_bit_depth(png_, info_);
    header.sample_type = header.sample_bits == 16 ? SampleType::kU16 : SampleType::kU8;
    header.is_integer = true;
    header.channel_names = names[num_channels - 1];
    header.alpha_channel = num_channels % 2 == 0 ? num_channels - 1 : -1;
    header.alpha_is_straight = header.alpha_channel >= 0;
    header.format_name = "png";
    width_ = static_cast<std::size_t>(header.width);
    height_ = header.height;
    num_channels_ = num_channels;
    sample_bytes_ = header.sample_bits == 16 ? 2 : 1;
    row_bytes_ = png_get_rowbytes(png_, info_);
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
    // The passes of an interlaced image go over all of it.
    rows_.resize(row_bytes_ * static_cast<std::size_t>(num_passes_ > 1 ? height_ : 1));
    for (int row = row_begin; row < row_end; ++row) {
      const bool is_past = row < next_row_ && num_passes_ == 1;
      failed_ = failed_ || (is_past && !restart()) || !decode_to(row);
      if (failed_) {
        return message_;
      }
      const unsigned char* texels = rows_.data() + (num_passes_ > 1 ? static_cast<std::size_t>(row) * row_bytes_ : 0) +
                                    static_cast<std::size_t>(channel_begin) * sample_bytes_;
      const auto convert = sample_bytes_ == 2 ? samples_convert<std::uint16_t> : samples_convert<std::uint8_t>;
      convert(texels, width_, num_channels_, num_copied, type, rows);
      rows += width_ * static_cast<std::size_t>(num_copied) * type_bytes;
    }
    return {};
  }

 private:
  [[noreturn]] static void on_error(png_structp png, png_const_charp message)
  {
    auto* self = static_cast<PngFile*>(png_get_error_ptr(png));
    // A string could throw, and that must not go through a C library either.
    std::snprintf(self->message_, sizeof self->message_, "%s", message);
    png_longjmp(png, 1);
  }

  static void on_warning(png_structp, png_const_charp) {}

  static void on_read(png_structp png, png_bytep bytes, std::size_t num_bytes)
  {
    auto* self = static_cast<PngFile*>(png_get_io_ptr(png));
    if (self->file_ != nullptr) {
      if (std::fread(bytes, 1, num_bytes, self->file_) != num_bytes) {
        png_error(png, "truncated data");
      }
      return;
    }
    if (num_bytes > self->encoded_.size() - self->position_) {
      png_error(png, "truncated data");
    }
    std::memcpy(bytes, self->encoded_.data() + self->position_, num_bytes);
    self->position_ += num_bytes;
  }

  void close()
  {
    png_destroy_read_struct(&png_, &info_, nullptr);
    if (file_ != nullptr) {
      std::fclose(file_);
      file_ = nullptr;
    }
  }

  /// Reads up to the first row. @return false: message_ says why not
  bool start()
  {
    close();
    next_row_ = 0;
    position_ = 0;
    if (encoded_.empty()) {
      file_ = std::fopen(name_.c_str(), "rb");
      if (file_ == nullptr) {
        std::snprintf(message_, sizeof message_, "cannot be opened");
        return false;
      }
    }
    std::snprintf(message_, sizeof message_, "out of memory");
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, on_error, on_warning);
    info_ = png_ != nullptr ? png_create_info_struct(png_) : nullptr;
    return info_ != nullptr && read_header();
  }

  /// Reads up to the first row once more.
  bool restart()
  {
    const int num_passes = num_passes_;
    if (!start()) {
      return false;
    }
    const bool is_same = num_passes_ == num_passes && png_get_rowbytes(png_, info_) == row_bytes_ &&
                         png_get_image_height(png_, info_) == static_cast<png_uint_32>(height_);
    if (!is_same) {
      std::snprintf(message_, sizeof message_, "changed while it was read");
    }
    return is_same;
  }

  bool read_header()
  {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    png_set_read_fn(png_, this, on_read);
    png_read_info(png_, info_);
    png_set_expand(png_);
    if (std::endian::native == std::endian::little) {
      png_set_swap(png_);
    }
    num_passes_ = png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }

  /// Decodes rows until this one is in rows_; all of them, if the image is interlaced.
  /// @return  false: message_ says why not
  bool decode_to(int row)
  {
    if (next_row_ > row) {
      return true;
    }
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    if (num_passes_ == 1) {
      for (; next_row_ <= row; ++next_row_) {
        png_read_row(png_, rows_.data(), nullptr);
      }
      return true;
    }
    for (int pass = 0; pass < num_passes_; ++pass) {
      for (int y = 0; y < height_; ++y) {
        png_read_row(png_, rows_.data() + static_cast<std::size_t>(y) * row_bytes_, nullptr);
      }
    }
    next_row_ = height_;
    return true;
  }

  std::string name_;
  std::span<const unsigned char> encoded_;  ///< empty: read from file_
  std::size_t position_ = 0;                ///< in encoded_
  std::FILE* file_ = nullptr;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  char message_[256] = {};  ///< of the last error
  bool failed_ = false;     ///< rows were asked for and could not be had: no others can

  std::size_t width_ = 0, sample_bytes_ = 1;
  std::size_t row_bytes_ = 0;  ///< of a decoded row, with all channels
  int height_ = 0, num_channels_ = 0, num_passes_ = 1;
  std::vector<unsigned char> rows_;  ///< the last decoded row, or all of an interlaced image; libpng's channels
  int next_row_ = 0;                 ///< that will be decoded
};

}  // namespace

std::unique_ptr<ImageFile> png_file_make() { return std::make_unique<PngFile>(); }

}  // namespace relief
