#include "scene/image_format.h"

#include <algorithm>
#include <cctype>
#include <string_view>

#include "scene/file_kind.h"

namespace relief {
namespace {

using namespace std::string_view_literals;

static_assert(ImageEnds::kHeadBytes >= FileSignature::kReach);

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
  const FileSignature* signature = file_signature(head);
  if (signature != nullptr && signature->reader != nullptr) {
    return {signature->reader, {}};
  }
  if (head.starts_with("RIFF"sv) && head.find("WEBP"sv, 8) == 8) {
    return {"webp", {}};
  }
  const bool may_be_tga = tail == "TRUEVISION-XFILE.\0"sv || lower_case_extension(name) == ".tga";
  if (may_be_tga && is_tga_header(ends.head)) {
    return {"targa", {}};
  }
  return {nullptr, signature != nullptr ? std::string(signature->kind) : "bytes of an unknown format"};
}

}  // namespace relief
