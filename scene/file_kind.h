// What a file is, by its first bytes: for choosing an image's reader, and for messages about what should have been something else.
#pragma once

#include <cstddef>
#include <string_view>

namespace relief {

/// The bytes that tell a kind of file.
struct FileSignature {
  /// All signatures are within so many bytes from a file's start.
  static constexpr std::size_t kReach = 17;

  std::string_view bytes;
  std::string_view kind;         ///< in words: "a GIF image"
  const char* reader = nullptr;  ///< OpenImageIO's name of the format; null: it is no image that is read
  std::size_t offset = 0;        ///< of the bytes, from the file's start
};

/// @param begin  of a file: kReach bytes or more, or all there are
/// @return       the first one that fits; null: none
const FileSignature* file_signature(std::string_view begin);

/// In words what a file is that should be no image; empty: unknown. Signatures of two bytes do not count, as numbers may well
/// begin with them.
std::string_view file_kind(std::string_view begin);

}  // namespace relief
