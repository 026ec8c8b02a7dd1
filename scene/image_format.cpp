#include "scene/image_format.h"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <string_view>

namespace relief {
namespace {

using namespace std::string_view_literals;

struct Signature {
  std::string_view bytes;
  const char* name;  ///< OpenImageIO's for what is read, ours for what is not
  std::size_t offset = 0;
};

constexpr Signature kRead[] = {
    {"\x89PNG"sv, "png"}, {"\xff\xd8\xff"sv, "jpeg"}, {"\x76\x2f\x31\x01"sv, "openexr"},
    {"#?"sv, "hdr"},      {"II*\0"sv, "tiff"},        {"MM\0*"sv, "tiff"},
    {"II+\0"sv, "tiff"},  {"MM\0+"sv, "tiff"},        {"BM"sv, "bmp"},
};

constexpr Signature kNotRead[] = {
    {"GIF8"sv, "a GIF image"},
    {"8BPS"sv, "a Photoshop image"},
    {"DDS "sv, "a DDS image"},
    {"\0\0\0\x0cjP"sv, "a JPEG 2000 image"},
    {"\xff\x4f\xff\x51"sv, "a JPEG 2000 image"},
    {"\xff\x0a"sv, "a JPEG XL image"},
    {"\0\0\0\x0cJXL"sv, "a JPEG XL image"},
    {"\xabKTX"sv, "a KTX image"},
    {"SDPX"sv, "a DPX image"},
    {"XPDS"sv, "a DPX image"},
    {"\x80\x2a\x5f\xd7"sv, "a Cineon image"},
    {"FOR4"sv, "an IFF image"},
    {"\x01\xda"sv, "an SGI image"},
    {"ftypavif"sv, "an AVIF image", 4},
    {"ftyphei"sv, "a HEIF image", 4},
    {"glTF"sv, "a GLB scene"},
    {"version https://g"sv, "a Git LFS pointer, which stands for a file that was not fetched"},
};

bool has(std::string_view bytes, const Signature& s)
{
  return bytes.size() >= s.offset && bytes.substr(s.offset, s.bytes.size()) == s.bytes;
}

/// Whether 18 bytes are a TGA header of a picture.
/// @source Truevision TGA File Format Specification 2.0, "TGA File Header"
bool is_tga_header(std::span<const unsigned char> head)
{
  if (head.size() < ImageEnds::kHeadBytes) {
    return false;
  }
  const int map_type = head[1], type = head[2], map_bits = head[7], bits = head[16];
  const bool is_mapped = type == 1 || type == 9;
  const bool is_type = is_mapped || type == 2 || type == 3 || type == 10 || type == 11;
  const bool is_map = map_type == 0 ? !is_mapped : map_type == 1 && map_bits >= 15 && map_bits <= 32;
  const bool is_depth = bits == 8 || bits == 15 || bits == 16 || bits == 24 || bits == 32;
  const bool has_texels = (head[12] | head[13]) != 0 && (head[14] | head[15]) != 0;
  return is_type && is_map && is_depth && has_texels;
}

std::string lower_case_extension(const std::filesystem::path& name)
{
  std::string text = name.extension().string();
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

ImageFormat image_format(const ImageEnds& ends, const std::filesystem::path& name)
{
  const std::string_view head(reinterpret_cast<const char*>(ends.head.data()), ends.head.size());
  const std::string_view tail(reinterpret_cast<const char*>(ends.tail.data()), ends.tail.size());
  if (head.empty()) {
    return {nullptr, "no data"};
  }
  for (const Signature& signature : kRead) {
    if (has(head, signature)) {
      return {signature.name, {}};
    }
  }
  if (has(head, {"RIFF"sv, ""}) && has(head, {"WEBP"sv, "", 8})) {
    return {"webp", {}};
  }
  const bool may_be_tga = tail == "TRUEVISION-XFILE.\0"sv || lower_case_extension(name) == ".tga";
  if (may_be_tga && is_tga_header(ends.head)) {
    return {"targa", {}};
  }
  const auto* known =
      std::find_if(std::begin(kNotRead), std::end(kNotRead), [&](const Signature& s) { return has(head, s); });
  return {nullptr, known != std::end(kNotRead) ? known->name : "bytes of an unknown format"};
}

}  // namespace relief
