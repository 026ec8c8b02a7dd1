#include "exporters/png_encode.h"

#include <png.h>

#include <bit>
#include <csetjmp>
#include <exception>
#include <limits>

#include "exporters/errors.h"
#include "kernel/assert.h"

namespace relief {
namespace {

/// What libpng hands over.
struct PngResult {
  std::string bytes, messages;
};

PngResult& result_of(void* pointer) { return *static_cast<PngResult*>(pointer); }

void on_warning(png_structp png, png_const_charp message)
{
  // It warns of what is wrong before it fails because something is.
  result_of(png_get_error_ptr(png)).messages += std::string(message) + "; ";
}

[[noreturn]] void on_error(png_structp png, png_const_charp message)
{
  result_of(png_get_error_ptr(png)).messages += message;
  png_longjmp(png, 1);
}

void on_write(png_structp png, png_bytep bytes, std::size_t num_bytes)
{
  try {
    result_of(png_get_io_ptr(png)).bytes.append(reinterpret_cast<const char*>(bytes), num_bytes);
  } catch (const std::exception& e) {
    // Not through the frames of a C library.
    png_error(png, e.what());
  }
}

void on_flush(png_structp) {}

/// Errors jump out of this function, so nothing in it may need a destructor.
/// @return whether it went well
template <typename Code>
bool write(png_structp png, png_infop info, int width, int height, int num_channels, const Code* codes)
{
  constexpr int kColorTypes[] = {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                 PNG_COLOR_TYPE_RGB_ALPHA};
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height),
               std::numeric_limits<Code>::digits, kColorTypes[num_channels - 1], PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_sRGB_gAMA_and_cHRM(png, info, PNG_sRGB_INTENT_ABSOLUTE);
  // zlib's Z_DEFAULT_STRATEGY. With libpng's choice, Z_FILTERED, renders of 4 and 64 samples were 2.6 and 0.2 % larger and
  // took longer to write.
  png_set_compression_strategy(png, 0);
  png_write_info(png, info);
  if (sizeof(Code) == 2 && std::endian::native == std::endian::little) png_set_swap(png);
  const auto row_codes = static_cast<std::size_t>(width) * static_cast<std::size_t>(num_channels);
  for (int y = 0; y < height; ++y) {
    png_write_row(png, reinterpret_cast<png_const_bytep>(codes + static_cast<std::size_t>(y) * row_codes));
  }
  png_write_end(png, info);
  return true;
}

template <typename Code>
std::string encode(int width, int height, std::span<const Code> codes)
{
  const std::size_t num_pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (num_pixels == 0) throw OutputError("PNG", "there are no pixels");
  const std::size_t num_channels = codes.size() / num_pixels;
  RELIEF_ASSERT(num_pixels * num_channels == codes.size() && num_channels >= 1 && num_channels <= 4);
  PngResult result;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &result, on_error, on_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  bool done = false;
  if (info != nullptr) {
    png_set_write_fn(png, &result, on_write, on_flush);
    done = write(png, info, width, height, static_cast<int>(num_channels), codes.data());
  }
  png_destroy_write_struct(&png, &info);
  if (!done) throw OutputError("PNG", result.messages.empty() ? "out of memory" : result.messages);
  return result.bytes;
}

}  // namespace

std::string png_encode(int width, int height, std::span<const std::uint8_t> codes)
{
  return encode(width, height, codes);
}

std::string png_encode(int width, int height, std::span<const std::uint16_t> codes)
{
  return encode(width, height, codes);
}

}  // namespace relief
