#include "scene/gltf_document.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <new>
#include <optional>
#include <system_error>

#include "scene/file_kind.h"
#include "scene/memory.h"
#include "scene/reading_root.h"
#include "scene/validation.h"

namespace relief {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

/// Reads a regular file; pipes and devices are refused, since they may have no end.
/// @param most  bytes to read; the file may be longer
ByteArray read_file(const fs::path& path, const std::string& file, const std::string& json_path, std::uint64_t most)
{
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) {
    throw SceneError(file, json_path, "a file named \"" + path.string() + '"', "none");
  }
  if (!fs::is_regular_file(status)) {
    throw SceneError(file, json_path, "a regular file named \"" + path.string() + '"', "something else");
  }
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(std::fopen(path.c_str(), "rb"), &std::fclose);
  const std::uintmax_t size = fs::file_size(path, error);
  if (!stream || error) {
    throw SceneError(file, json_path, "a readable file \"" + path.string() + '"',
                     error ? error.message() : std::strerror(errno));
  }
  ByteArray bytes;
  bytes.size = static_cast<std::size_t>(std::min<std::uint64_t>(size, most));
  memory_require(bytes.size, path.string());
  bytes.data = std::make_unique_for_overwrite<std::byte[]>(bytes.size);
  if (std::fread(bytes.data.get(), 1, bytes.size, stream.get()) != bytes.size) {
    throw SceneError(file, json_path, std::to_string(bytes.size) + " bytes in \"" + path.string() + '"', "fewer");
  }
  return bytes;
}

std::uint32_t read_u32(std::span<const std::byte> bytes, std::size_t offset)
{
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    value |= std::to_integer<std::uint32_t>(bytes[offset + i]) << (8 * i);
  }
  return value;
}

struct Container {
  std::string_view json;
  std::optional<std::span<const std::byte>> binary;  ///< the GLB's BIN chunk
};

std::string_view as_text(std::span<const std::byte> bytes)
{
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Splits a GLB into its chunks; anything else is JSON text.
/// @source glTF 2.0 specification, section 4.4
Container split_container(std::span<const std::byte> bytes, const std::string& file)
{
  if (bytes.size() < 4 || as_text(bytes.first(4)) != "glTF") {
    return {as_text(bytes), {}};
  }
  const auto fail = [&](const std::string& expected, const std::string& found) {
    throw SceneError(file, "", expected, found);
  };
  if (bytes.size() < 20) {
    fail("a GLB header and a chunk header (20 bytes)", std::to_string(bytes.size()) + " bytes");
  }
  if (const std::uint32_t version = read_u32(bytes, 4); version != 2) {
    fail("GLB version 2", "version " + std::to_string(version));
  }
  const std::size_t length = read_u32(bytes, 8);
  if (length < 20 || length > bytes.size()) {
    fail("a GLB of " + std::to_string(length) + " bytes, as its header says", std::to_string(bytes.size()) + " bytes");
  }
  constexpr std::uint32_t kJsonChunk = 0x4e4f534a, kBinChunk = 0x004e4942;
  Container out;
  for (std::size_t offset = 12; offset < length;) {
    if (length - offset < 8) {
      fail("a GLB chunk header (8 bytes)", std::to_string(length - offset) + " bytes");
    }
    const std::size_t size = read_u32(bytes, offset);
    const std::uint32_t type = read_u32(bytes, offset + 4);
    if (size > length - offset - 8) {
      fail("a GLB chunk within the file",
           "a chunk of " + std::to_string(size) + " bytes where " + std::to_string(length - offset - 8) + " are left");
    }
    const std::span<const std::byte> chunk = bytes.subspan(offset + 8, size);
    if (offset == 12) {
      if (type != kJsonChunk) {
        fail("a JSON chunk first", "another type of chunk");
      }
      out.json = as_text(chunk);
    } else if (type == kBinChunk && !out.binary) {
      out.binary = chunk;
    }
    offset += 8 + size;
  }
  return out;
}

/// Loads `buffers[i]` and checks that it is as long as it says.
std::span<const std::byte> load_buffer(GltfDocument& document,
                                       std::size_t i,
                                       const std::optional<std::span<const std::byte>>& glb_binary)
{
  json& buffer = document.json["buffers"][i];
  const std::string path = "/buffers/" + std::to_string(i);
  const auto length = static_cast<std::uint64_t>(buffer["byteLength"].get<double>());
  std::span<const std::byte> bytes;
  if (length == 0) return bytes;
  const auto uri = buffer.find("uri");
  if (uri == buffer.end()) {
    if (i != 0 || !glb_binary) {
      throw SceneError(document.file, path + "/uri", "a uri (only buffer 0 of a .glb may have none)", "nothing");
    }
    bytes = *glb_binary;
  } else {
    const std::string& text = uri->get_ref<const std::string&>();
    if (gltf_is_data_uri(text)) {
      document.storage.push_back(gltf_decode_data_uri(text, document.file, path + "/uri"));
      *uri = "data:";
    } else {
      const fs::path file = gltf_resolve_uri(document, text, path + "/uri");
      document.files_read.push_back(file_stamp(file));
      document.storage.push_back(read_file(file, document.file, path + "/uri", length));
    }
    bytes = document.storage.back().span();
  }
  if (bytes.size() < length) {
    if (const std::string_view kind = file_kind(as_text(bytes)); !kind.empty()) {
      throw SceneError(document.file, path, "a buffer of " + std::to_string(length) + " bytes", std::string(kind));
    }
    throw SceneError(document.file, path + "/byteLength",
                     "at most the " + std::to_string(bytes.size()) + " bytes that there are", std::to_string(length));
  }
  return bytes.first(static_cast<std::size_t>(length));
}

/// File access for tinygltf that finds nothing and writes nothing. A template, since members differ between versions.
template <typename Callbacks>
Callbacks no_files()
{
  Callbacks none{};
  none.FileExists = [](const std::string&, void*) { return false; };
  none.ExpandFilePath = [](const std::string&, void*) { return std::string(); };
  none.ReadWholeFile = [](std::vector<unsigned char>*, std::string*, const std::string&, void*) { return false; };
  none.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&, void*) {
    return false;
  };
  // Since 2.9, which takes none of the others without it.
  if constexpr (requires { none.GetFileSizeInBytes; }) {
    none.GetFileSizeInBytes = [](std::size_t*, std::string*, const std::string&, void*) { return false; };
  }
  return none;
}

/// Hands the conforming copy to tinygltf. It sees no URI and no extension, so it opens no file, expands no path (its
/// default expands shell syntax) and decodes nothing.
void load_core(GltfDocument& document, const json& conforming)
{
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks(no_files<tinygltf::FsCallbacks>());
  loader.SetImageLoader([](tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int,
                           void*) { return false; },
                        nullptr);
  const std::string text = conforming.dump();
  if (text.size() > UINT32_MAX) {
    throw SceneError(document.file, "", "at most 4 GiB of JSON", std::to_string(text.size()) + " bytes");
  }
  std::string error, warning;
  if (!loader.LoadASCIIFromString(&document.core, &error, &warning, text.c_str(),
                                  static_cast<unsigned int>(text.size()), "")) {
    // It catches what its JSON parser throws.
    if (error == std::bad_alloc().what()) throw std::bad_alloc();
    throw SceneError(document.file, "", "glTF 2.0", error.empty() ? "something else" : error);
  }
}

/// Value of a base64 digit, or −1.
constexpr std::array<std::int8_t, 256> base64_digits()
{
  std::array<std::int8_t, 256> table{};
  for (auto& entry : table) {
    entry = -1;
  }
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < kDigits.size(); ++i) {
    table[static_cast<unsigned char>(kDigits[i])] = static_cast<std::int8_t>(i);
  }
  return table;
}

int hex_digit(char c)
{
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string percent_decode(const std::string& uri)
{
  std::string out;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const bool escape = uri[i] == '%' && i + 2 < uri.size();
    const int high = escape ? hex_digit(uri[i + 1]) : -1, low = escape ? hex_digit(uri[i + 2]) : -1;
    if (high >= 0 && low >= 0) {
      out += static_cast<char>(high * 16 + low);
      i += 2;
    } else {
      out += uri[i];
    }
  }
  return out;
}

/// The file that a reference names, percent-encoded or plain; nothing if there is none.
std::optional<fs::path> file_of_uri(const GltfDocument& document, const std::string& uri)
{
  for (const std::string& name : {percent_decode(uri), uri}) {
    // A string with a zero byte is another, shorter name for the operating system.
    if (name.empty() || name.find('\0') != std::string::npos) {
      continue;
    }
    fs::path path = document.path.parent_path() / name;
    std::error_code error;
    if (fs::is_regular_file(path, error)) {
      return path;
    }
  }
  return {};
}

/// The images that a file names, whether a material uses them or not: they are the scene's, and no output may replace them.
void add_images(GltfDocument& document)
{
  const std::size_t num_images = document.count("images");
  for (std::size_t i = 0; i < num_images; ++i) {
    const json& image = document.element("images", i);
    const auto uri = image.find("uri");
    if (uri == image.end() || !uri->is_string() || gltf_is_data_uri(uri->get_ref<const std::string&>())) {
      continue;
    }
    if (const auto file = file_of_uri(document, uri->get_ref<const std::string&>())) {
      document.files_read.push_back(file_stamp(*file));
    }
  }
}

}  // namespace

std::size_t GltfDocument::count(const char* array) const
{
  const auto it = json.find(array);
  return it != json.end() && it->is_array() ? it->size() : 0;
}

bool gltf_is_data_uri(const std::string& uri) { return uri.rfind("data:", 0) == 0; }

ByteArray gltf_decode_data_uri(const std::string& uri, const std::string& file, const std::string& json_path)
{
  static constexpr std::array<std::int8_t, 256> kDigits = base64_digits();
  const std::size_t comma = uri.find(',');
  constexpr std::string_view kMarker = ";base64";
  if (comma == std::string::npos || comma < kMarker.size() ||
      std::string_view(uri).substr(comma - kMarker.size(), kMarker.size()) != kMarker) {
    throw SceneError(file, json_path, "a data URI with \";base64,\"", '"' + uri.substr(0, 40) + '"');
  }
  std::string_view text = std::string_view(uri).substr(comma + 1);
  while (!text.empty() && text.back() == '=') {
    text.remove_suffix(1);
  }
  ByteArray out;
  out.size = text.size() / 4 * 3 + (text.size() % 4 > 0 ? text.size() % 4 - 1 : 0);
  out.data = std::make_unique_for_overwrite<std::byte[]>(out.size);
  std::size_t written = 0;
  std::uint32_t bits = 0;
  int num_bits = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const std::int8_t digit = kDigits[static_cast<unsigned char>(text[i])];
    if (digit < 0) {
      throw SceneError(file, json_path, "base64", "another character at position " + std::to_string(comma + 1 + i));
    }
    bits = (bits << 6) | static_cast<std::uint8_t>(digit);
    num_bits += 6;
    if (num_bits >= 8) {
      num_bits -= 8;
      out.data[written++] = static_cast<std::byte>(bits >> num_bits);
    }
  }
  out.size = written;
  return out;
}

fs::path gltf_resolve_uri(const GltfDocument& document, const std::string& uri, const std::string& json_path)
{
  const std::size_t colon = uri.find("://");
  if (colon != std::string::npos) {
    throw SceneError(document.file, json_path, "a path relative to the file", '"' + uri + '"');
  }
  if (auto file = file_of_uri(document, uri)) {
    if (!reading_is_allowed(*file)) {
      throw SceneError(document.file, json_path, "a file below " + reading_root().string() + " (--root)", '"' + uri + '"');
    }
    return *std::move(file);
  }
  throw SceneError(document.file, json_path, "an existing file", '"' + uri + '"');
}

ByteArray gltf_read_file(const fs::path& path,
                         const std::string& file,
                         const std::string& json_path,
                         std::uint64_t most)
{
  return read_file(path, file, json_path, most);
}

std::span<const std::byte> gltf_buffer_view(const GltfDocument& document, int index)
{
  const tinygltf::BufferView& view = document.core.bufferViews[static_cast<std::size_t>(index)];
  const std::span<const std::byte> buffer = document.buffers[static_cast<std::size_t>(view.buffer)];
  if (view.byteOffset > buffer.size() || view.byteLength > buffer.size() - view.byteOffset) {
    throw SceneError(
        document.file, "/bufferViews/" + std::to_string(index),
        "a view within the " + std::to_string(buffer.size()) + " bytes of its buffer",
        "bytes " + std::to_string(view.byteOffset) + " to " + std::to_string(view.byteOffset + view.byteLength));
  }
  return buffer.subspan(view.byteOffset, view.byteLength);
}

std::unique_ptr<GltfDocument> gltf_document_load(const fs::path& path, Warnings& warnings)
{
  auto document = std::make_unique<GltfDocument>();
  document->path = path;
  document->file = path.string();
  document->files_read.push_back(file_stamp(path));
  document->storage.push_back(read_file(path, document->file, "", std::numeric_limits<std::uint64_t>::max()));
  const Container container = split_container(document->storage.back().span(), document->file);
  document->json = validation_parse(container.json, document->file);
  validation_drop_nulls(document->json, document->file, warnings);
  validation_check_support(document->json, document->file, warnings);
  const json conforming = validation_conform(document->json, document->file, warnings);
  load_core(*document, conforming);
  const std::size_t num_buffers = document->count("buffers");
  for (std::size_t i = 0; i < num_buffers; ++i) {
    document->buffers.push_back(load_buffer(*document, i, container.binary));
  }
  add_images(*document);
  return document;
}

}  // namespace relief
