// Builds small glTF files for tests: JSON that a test may change at will, and a binary buffer that grows as accessors
// are added. Files are written into a folder that goes away with the test.
#pragma once

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <unistd.h>

namespace relief::test {

/// A new, empty folder; removed with everything in it.
class TemporaryFolder {
 public:
  TemporaryFolder()
  {
    std::string pattern = (std::filesystem::temp_directory_path() / "relief_scene_XXXXXX").string();
    path_ = ::mkdtemp(pattern.data());
  }
  ~TemporaryFolder()
  {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

  std::filesystem::path write(const std::string& name, std::string_view bytes) const
  {
    std::ofstream(path_ / name, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path_ / name;
  }

 private:
  std::filesystem::path path_;
};

inline std::string base64(std::string_view bytes)
{
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned word = 0;
    const std::size_t n = std::min<std::size_t>(3, bytes.size() - i);
    for (std::size_t k = 0; k < 3; ++k) {
      word = (word << 8) | (k < n ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      out += k <= n ? kDigits[(word >> (18 - 6 * k)) & 63] : '=';
    }
  }
  return out;
}

/// Bytes of base64 text without white space.
inline std::string from_base64(std::string_view text)
{
  static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  unsigned word = 0;
  int num_bits = 0;
  for (const char c : text.substr(0, text.find('='))) {
    word = (word << 6) | static_cast<unsigned>(kDigits.find(c));
    num_bits += 6;
    if (num_bits >= 8) {
      num_bits -= 8;
      out += static_cast<char>((word >> num_bits) & 0xff);
    }
  }
  return out;
}

/// A PNG of one opaque pixel.
inline constexpr std::string_view kPixelPng =
    "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJg"
    "gg==";

/// A PNG of one grey pixel, 128/255.
inline constexpr std::string_view kGreyPixelPng =
    "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR42mNoAAAAggCB2kUIOwAAAA"
    "BJRU5ErkJggg==";

class GltfBuilder {
 public:
  nlohmann::json json = {{"asset", {{"version", "2.0"}}}};
  std::string binary;
  bool declares_extensions = true;  ///< whether extensionsUsed gets the names that it lacks

  /// Appends bytes, aligned to four, and a buffer view of them.
  template <typename T>
  int view(const std::vector<T>& values, int stride = 0)
  {
    binary.resize((binary.size() + 3) / 4 * 4);
    nlohmann::json v = {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", values.size() * sizeof(T)}};
    if (stride > 0) {
      v["byteStride"] = stride;
    }
    binary.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    return push("bufferViews", v);
  }

  template <typename T>
  static constexpr int component_type()
  {
    if constexpr (std::is_same_v<T, std::int8_t>) return 5120;
    if constexpr (std::is_same_v<T, std::uint8_t>) return 5121;
    if constexpr (std::is_same_v<T, std::int16_t>) return 5122;
    if constexpr (std::is_same_v<T, std::uint16_t>) return 5123;
    if constexpr (std::is_same_v<T, std::uint32_t>) return 5125;
    return 5126;
  }

  /// Tightly packed accessor of its own view.
  /// @param type  "SCALAR", "VEC2", …
  template <typename T>
  int accessor(const std::vector<T>& values, const std::string& type, bool normalized = false)
  {
    const std::size_t n = type == "SCALAR" ? 1 : static_cast<std::size_t>(type.back() - '0');
    nlohmann::json a = {{"bufferView", view(values)},
                        {"componentType", component_type<T>()},
                        {"count", values.size() / n},
                        {"type", type}};
    if (normalized) {
      a["normalized"] = true;
    }
    return push("accessors", a);
  }

  int push(const std::string& array, const nlohmann::json& value)
  {
    json[array].push_back(value);
    return static_cast<int>(json[array].size()) - 1;
  }

  /// A mesh of one primitive.
  int mesh(const nlohmann::json& primitive) { return push("meshes", {{"primitives", {primitive}}}); }

  /// A root node of the default scene.
  int root_node(const nlohmann::json& node)
  {
    json["scene"] = 0;
    if (!json.contains("scenes")) {
      json["scenes"] = nlohmann::json::array({{{"nodes", nlohmann::json::array()}}});
    }
    const int index = push("nodes", node);
    json["scenes"][0]["nodes"].push_back(index);
    return index;
  }

  /// The file as text, its buffer inside as a data URI.
  std::string gltf() const
  {
    nlohmann::json out = with_extensions_used();
    if (!binary.empty() && !out.contains("buffers")) {
      out["buffers"] = {
          {{"byteLength", binary.size()}, {"uri", "data:application/octet-stream;base64," + base64(binary)}}};
    }
    return out.dump();
  }

  /// The file as GLB, its buffer in the BIN chunk.
  std::string glb() const
  {
    nlohmann::json with_buffer = with_extensions_used();
    if (!binary.empty()) {
      with_buffer["buffers"] = {{{"byteLength", binary.size()}}};
    }
    std::string text = with_buffer.dump(), bin = binary;
    text.resize((text.size() + 3) / 4 * 4, ' ');
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    const auto u32 = [](std::size_t x) {
      const auto word = static_cast<std::uint32_t>(x);
      return std::string(reinterpret_cast<const char*>(&word), 4);
    };
    std::string chunks = u32(text.size()) + "JSON" + text;
    if (!bin.empty()) {
      chunks += u32(bin.size()) + std::string("BIN\0", 4) + bin;
    }
    return "glTF" + u32(2) + u32(12 + chunks.size()) + chunks;
  }

 private:
  static void add_extensions(const nlohmann::json& value, std::set<std::string>& names)
  {
    for (const auto& item : value.items()) {
      if (value.is_object() && item.key() == "extensions" && item.value().is_object()) {
        for (const auto& extension : item.value().items()) names.insert(extension.key());
      }
      if (item.value().is_structured()) add_extensions(item.value(), names);
    }
  }

  nlohmann::json with_extensions_used() const
  {
    nlohmann::json out = json;
    const bool has_list = json.contains("extensionsUsed");
    if (!declares_extensions || (has_list && !json["extensionsUsed"].is_array())) return out;
    std::set<std::string> names;
    add_extensions(json, names);
    if (has_list) {
      for (const nlohmann::json& name : json["extensionsUsed"]) {
        if (name.is_string()) names.erase(name.get<std::string>());
      }
    }
    for (const std::string& name : names) out["extensionsUsed"].push_back(name);
    return out;
  }
};

/// A unit square in the xy plane that faces +z: positions, normals, uv (v down, as glTF has it), four vertices and two
/// triangles, one node, no material.
inline GltfBuilder square_scene()
{
  GltfBuilder b;
  const int P = b.accessor<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3");
  const int N = b.accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int uv = b.accessor<float>({0, 1, 1, 1, 1, 0, 0, 0}, "VEC2");
  const int indices = b.accessor<std::uint16_t>({0, 1, 2, 0, 2, 3}, "SCALAR");
  const int mesh = b.mesh({{"attributes", {{"POSITION", P}, {"NORMAL", N}, {"TEXCOORD_0", uv}}}, {"indices", indices}});
  b.root_node({{"name", "square"}, {"mesh", mesh}});
  return b;
}

}  // namespace relief::test
