#include "scene/file_kind.h"

#include <algorithm>
#include <iterator>

namespace relief {
namespace {

using namespace std::string_view_literals;

constexpr FileSignature kSignatures[] = {
    {"\x89PNG"sv, "a PNG image"sv, "png"},
    {"\xff\xd8\xff"sv, "a JPEG image"sv, "jpeg"},
    {"\x76\x2f\x31\x01"sv, "an OpenEXR image"sv, "openexr"},
    {"#?"sv, "an HDR image"sv, "hdr"},
    {"II*\0"sv, "a TIFF image"sv, "tiff"},
    {"MM\0*"sv, "a TIFF image"sv, "tiff"},
    {"II+\0"sv, "a TIFF image"sv, "tiff"},
    {"MM\0+"sv, "a TIFF image"sv, "tiff"},
    {"BM"sv, "a BMP image"sv, "bmp"},
    {"GIF8"sv, "a GIF image"sv},
    {"8BPS"sv, "a Photoshop image"sv},
    {"DDS "sv, "a DDS image"sv},
    {"\0\0\0\x0cjP"sv, "a JPEG 2000 image"sv},
    {"\xff\x4f\xff\x51"sv, "a JPEG 2000 image"sv},
    {"\xff\x0a"sv, "a JPEG XL image"sv},
    {"\0\0\0\x0cJXL"sv, "a JPEG XL image"sv},
    {"\xabKTX"sv, "a KTX image"sv},
    {"SDPX"sv, "a DPX image"sv},
    {"XPDS"sv, "a DPX image"sv},
    {"\x80\x2a\x5f\xd7"sv, "a Cineon image"sv},
    {"FOR4"sv, "an IFF image"sv},
    {"\x01\xda"sv, "an SGI image"sv},
    {"ftypavif"sv, "an AVIF image"sv, nullptr, 4},
    {"ftyphei"sv, "a HEIF image"sv, nullptr, 4},
    {"version https://g"sv, "a Git LFS pointer (git lfs pull puts the file in its place)"sv},
    {"glTF"sv, "a GLB scene"sv},
    {"BLENDER"sv, "a Blender file (relief's add-on exports it)"sv},
    {"\x28\xb5\x2f\xfd"sv, "a file compressed by Zstandard, as Blender's are (relief's add-on exports them)"sv},
    // 8 stands for deflate, the only method there is.
    {"\x1f\x8b\x08"sv, "a file compressed by gzip"sv},
    {"PK\x03\x04"sv, "a ZIP archive, as USDZ is"sv},
    {"PXR-USDC"sv, "a USD file"sv},
    {"#usda"sv, "a USD file"sv},
    {"Kaydara FBX"sv, "an FBX file"sv},
    {"<?xml"sv, "XML, as COLLADA and SVG are"sv},
    {"ply"sv, "a PLY file"sv},
};

static_assert(std::ranges::all_of(kSignatures, [](const FileSignature& s) {
  return s.offset + s.bytes.size() <= FileSignature::kReach;
}));

}  // namespace

const FileSignature* file_signature(std::string_view begin)
{
  const auto* found = std::ranges::find_if(kSignatures, [=](const FileSignature& s) {
    return begin.size() >= s.offset && begin.substr(s.offset, s.bytes.size()) == s.bytes;
  });
  return found != std::end(kSignatures) ? found : nullptr;
}

std::string_view file_kind(std::string_view begin)
{
  const FileSignature* signature = file_signature(begin);
  return signature != nullptr && signature->bytes.size() > 2 ? signature->kind : std::string_view();
}

}  // namespace relief
