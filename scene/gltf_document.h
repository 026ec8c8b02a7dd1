// One glTF file in memory: its JSON (for extensions), its core as tinygltf structures (see validation.h for why that is
// safe), and its buffers. Files are opened here and nowhere else in scene/, except images.
#pragma once

#include <tiny_gltf.h>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "scene/diagnostics.h"
#include "scene/file_stamp.h"
#include "scene/json_reader.h"

namespace relief {

/// Whole file in memory, or bytes decoded from text. The bytes are not initialized before they are read.
struct ByteArray {
  std::unique_ptr<std::byte[]> data;
  std::size_t size = 0;

  std::span<const std::byte> span() const { return {data.get(), size}; }
};

struct GltfDocument {
  std::filesystem::path path;
  std::string file;                                 ///< how messages name it
  nlohmann::json json;                              ///< as written, minus the text of data URIs of buffers
  tinygltf::Model core;                             ///< validated; without buffers and images
  std::vector<std::span<const std::byte>> buffers;  ///< `byteLength` bytes each
  std::vector<FileStamp> files_read;                ///< this file, its buffers and its images, as before they were read
  std::vector<ByteArray> storage;                   ///< what `buffers` look into

  /// Reader for an extension of an object, e.g. ("/nodes/3", json["nodes"][3], "RELIEF_object").
  /// @return true and calls `read(JsonReader)` if the extension is there
  template <typename Read>
  bool read_extension(const nlohmann::json& object, const std::string& object_path, const char* name, Read&& read) const
  {
    const auto extensions = object.find("extensions");
    if (extensions == object.end()) {
      return false;
    }
    if (!extensions->is_object()) {
      throw SceneError(file, object_path + "/extensions", "an object", json_describe(*extensions));
    }
    const auto extension = extensions->find(name);
    if (extension == extensions->end()) {
      return false;
    }
    read(JsonReader(*extension, file, json_path_join(object_path + "/extensions", name)));
    return true;
  }

  /// Element `index` of a top-level array, e.g. ("nodes", 3).
  /// @pre  the validated core has it
  const nlohmann::json& element(const char* array, std::size_t index) const { return json.at(array).at(index); }

  /// Number of elements of a top-level array; 0 when it is absent.
  std::size_t count(const char* array) const;
};

/// Reads, parses and validates a file with its buffers.
/// @error SceneError
std::unique_ptr<GltfDocument> gltf_document_load(const std::filesystem::path& path, Warnings& warnings);

/// File that a relative or absolute reference names.
/// @param  uri  percent-encoded, as glTF wants, or plain, as many write it
/// @return path that exists and is a regular file
/// @error  SceneError at `json_path`: another scheme than none, or no such file
std::filesystem::path gltf_resolve_uri(const GltfDocument& document,
                                       const std::string& uri,
                                       const std::string& json_path);

/// Reads a regular file.
/// @param file, json_path  who names it, for messages
/// @param most             bytes to read; the file may be longer
/// @error SceneError: there is none, or it cannot be read
ByteArray gltf_read_file(const std::filesystem::path& path,
                         const std::string& file,
                         const std::string& json_path,
                         std::uint64_t most);

bool gltf_is_data_uri(const std::string& uri);

/// Bytes of a base64 data URI.
/// @error SceneError at `json_path` for other encodings and for characters that are not base64
ByteArray gltf_decode_data_uri(const std::string& uri, const std::string& file, const std::string& json_path);

/// Bytes of a buffer view.
/// @param  index  valid (validated core)
/// @error  SceneError if it reaches beyond its buffer
std::span<const std::byte> gltf_buffer_view(const GltfDocument& document, int index);

}  // namespace relief
