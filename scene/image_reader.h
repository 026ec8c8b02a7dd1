// Opening images through OpenImageIO (image_io.h), or PNG, JPEG, HDR and EXR without it (png_file.h, jpeg_file.h, hdr_file.h, exr_file.h), and
// reading their rows: files or encoded bytes, any format, with the checks that every use of an image needs. What the values mean is up to
// texture_source.h (colours) and height_map.h (heights).
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "scene/image_io.h"
#include "scene/memory.h"

namespace relief {

class ImageBytes;  // scene/image_memory.h

/// An image to be read. Does not own the bytes.
struct ImageSource {
  std::string file;                        ///< empty when `encoded` is used
  std::span<const unsigned char> encoded;  ///< PNG, JPEG, …; must outlive every reader
  std::string scene_file, json_path;       ///< for SceneError
};

/// Longest side and most channels of an image; beyond it a header is taken to be corrupt.
inline constexpr int kMaxTextureSide = 65536;
inline constexpr int kMaxImageChannels = 1024;

/// An open image. Values come as the file has them: colours unassociated with alpha where the file says so, never
/// decoded from sRGB. Not for use by several threads at once.
class ImageReader {
 public:
  /// Opens the image and reads its header. Its content decides which format it has (image_format.h).
  /// @error SceneError: missing, not an image of a format that is read, deep, larger than kMaxTextureSide or kMaxImageChannels, or of samples that
  ///        OpenImageIO does not read (TIFF with doubles). OutOfMemory: decoding it would take more than there is
  explicit ImageReader(const ImageSource& source);

  const ImageHeader& header() const { return header_; }

  /// Says what load_rows is to give; called once, before it.
  /// @param channel_begin, channel_end  0 <= begin < end <= number of channels
  void select(int channel_begin, int channel_end, SampleType type);

  /// Bytes of one row of the selected channels.
  std::size_t row_bytes() const;

  /// How many rows to ask for at a time: few enough to stay small, enough for whole compression blocks where rows are short.
  int rows_at_once() const;

  /// Reads rows; going from top to bottom is fastest, and cheap in steps of any size.
  /// @param begin, end  0 <= begin < end <= height
  /// @return            rows `begin` to `end`, tightly packed, until the next call
  /// @error             SceneError: the data is truncated or corrupt; OutOfMemory
  const unsigned char* load_rows(int begin, int end);

 private:
  void open();
  void reserve_decoder(const std::string& format, ImageBytes& bytes);
  void check_header();
  void read(int begin, int end);

  ImageSource source_;
  MemoryReservation decoder_room_, block_room_, rows_room_;  ///< for what the decoder allocates, and for rows_
  std::vector<unsigned char> owned_;  ///< of a JPEG file, which is read whole to look for its end
  std::unique_ptr<ImageFile> image_;
  ImageHeader header_;
  int channel_begin_ = 0, channel_end_ = 0;
  SampleType type_ = SampleType::kFloat;

  std::vector<unsigned char> rows_;  ///< rows [rows_begin_, rows_end_) of the selected channels
  int rows_begin_ = 0, rows_end_ = 0;
};

}  // namespace relief
