#include "scene/file_kind.h"

#include <utility>

namespace relief {

std::string_view file_kind(std::string_view begin)
{
  using namespace std::string_view_literals;
  static constexpr std::pair<std::string_view, std::string_view> kKinds[] = {
      {"version https://git-lfs.github.com/spec/"sv, "a Git LFS pointer (git lfs pull puts the file in its place)"sv},
      {"\x76\x2f\x31\x01"sv, "an OpenEXR picture"sv},
      {"\x89PNG"sv, "a PNG picture"sv},
      {"\xff\xd8\xff"sv, "a JPEG picture"sv},
      {"BLENDER"sv, "a Blender file (relief's add-on exports it)"sv},
      {"\x28\xb5\x2f\xfd"sv, "a file compressed by Zstandard, as Blender's are (relief's add-on exports them)"sv},
      {"\x1f\x8b"sv, "a file compressed by gzip"sv},
      {"PK\x03\x04"sv, "a ZIP archive, as USDZ is"sv},
      {"PXR-USDC"sv, "a USD file"sv},
      {"#usda"sv, "a USD file"sv},
      {"Kaydara FBX"sv, "an FBX file"sv},
      {"<?xml"sv, "XML, as COLLADA is"sv},
      {"ply"sv, "a PLY file"sv},
  };
  for (const auto& [magic, kind] : kKinds) {
    if (begin.substr(0, magic.size()) == magic) return kind;
  }
  return {};
}

}  // namespace relief
