#include "benchmarks/displacement/obj_file.h"

#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <string_view>

#include <fmt/format.h>

#include "exporters/errors.h"

namespace relief {

namespace {

struct ObjReader {
  const std::string& file;
  std::vector<Vec3f> positions, normals;
  std::vector<Vec2f> texture;
  std::map<std::array<std::int64_t, 3>, std::uint32_t>
      vertices;  ///< by position, texture coordinates, normal (−1: none)
  ObjMesh mesh;
  bool has_normals = true;
  std::int64_t number = 0;  ///< of the line
  std::string line;

  [[noreturn]] void refuse(const std::string& expected) const
  {
    throw InputError(file, fmt::format("line {}: expected {}, found '{}'", number, expected, line.substr(0, 80)));
  }

  std::vector<std::string_view> words() const
  {
    std::vector<std::string_view> found;
    constexpr const char* kBlanks = " \t\r";
    for (std::size_t at = line.find_first_not_of(kBlanks); at != std::string::npos;) {
      const std::size_t end = std::min(line.find_first_of(kBlanks, at), line.size());
      found.push_back(std::string_view(line).substr(at, end - at));
      at = line.find_first_not_of(kBlanks, end);
    }
    return found;
  }

  /// The first numbers after a line's keyword.
  template <std::size_t Count>
  std::array<float, Count> numbers(const std::vector<std::string_view>& from) const
  {
    std::array<float, Count> values{};
    for (std::size_t k = 0; k < Count; ++k) {
      double value = HUGE_VAL;
      if (k + 1 < from.size()) {
        const std::string_view word = from[k + 1];
        const auto read = std::from_chars(word.data(), word.data() + word.size(), value);
        if (read.ec != std::errc() || read.ptr != word.data() + word.size()) value = HUGE_VAL;
      }
      values[k] = static_cast<float>(value);
      if (!std::isfinite(values[k])) refuse(fmt::format("{} finite numbers after '{}'", Count, from[0]));
    }
    return values;
  }

  /// Entry that a corner names, counted from 0; −1 where there is none.
  std::int64_t entry(std::string_view word, std::size_t count) const
  {
    if (word.empty()) return -1;
    std::int64_t index = 0;
    const auto read = std::from_chars(word.data(), word.data() + word.size(), index);
    const std::int64_t at = index < 0 ? index + static_cast<std::int64_t>(count) : index - 1;
    if (read.ec != std::errc() || read.ptr != word.data() + word.size() || at < 0 ||
        at >= static_cast<std::int64_t>(count)) {
      refuse(fmt::format("entries from 1 to {}, or counted back from -1", count));
    }
    return at;
  }

  std::uint32_t corner(std::string_view word)
  {
    std::array<std::string_view, 3> parts;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t slash = word.find('/');
      parts[k] = word.substr(0, slash);
      word = slash == std::string_view::npos ? std::string_view{} : word.substr(slash + 1);
    }
    const std::array key{entry(parts[0], positions.size()), entry(parts[1], texture.size()),
                         entry(parts[2], normals.size())};
    if (key[0] < 0 || key[1] < 0) refuse("corners with texture coordinates, as 'f 1/1 2/2 3/3'");
    const auto [found, is_new] = vertices.try_emplace(key, static_cast<std::uint32_t>(mesh.P.size()));
    if (is_new) {
      mesh.P.push_back(positions[static_cast<std::size_t>(key[0])]);
      mesh.uv.push_back(texture[static_cast<std::size_t>(key[1])]);
      has_normals = has_normals && key[2] >= 0;
      if (has_normals) {
        const Vec3f n = normals[static_cast<std::size_t>(key[2])];
        mesh.N.push_back({n.x, n.y, n.z});
      }
    }
    return found->second;
  }

  void read_line()
  {
    const std::vector<std::string_view> w = words();
    if (w.empty()) return;
    if (w[0] == "v" || w[0] == "vn") {
      const std::array n = numbers<3>(w);
      (w[0] == "v" ? positions : normals).push_back({n[0], n[1], n[2]});
    } else if (w[0] == "vt") {
      const std::array n = numbers<2>(w);
      texture.push_back({n[0], 1 - n[1]});
    } else if (w[0] == "f") {
      if (w.size() < 4) refuse("three corners or more after 'f'");
      const std::uint32_t first = corner(w[1]);
      std::uint32_t before = corner(w[2]);
      for (std::size_t k = 3; k < w.size(); ++k) {
        const std::uint32_t next = corner(w[k]);
        mesh.triangles.push_back({first, before, next});
        before = next;
      }
    }
  }
};

}  // namespace

ObjMesh obj_load(const std::string& file)
{
  std::error_code ignored;
  std::ifstream in(file);
  if (!in || std::filesystem::is_directory(file, ignored))
    throw InputError(file, "expected a readable OBJ file, found none");
  ObjReader reader{file, {}, {}, {}, {}, {}, true, 0, {}};
  // Longer lines are no text: a device has none that end.
  std::vector<char> room(1 << 16);
  while (in.getline(room.data(), static_cast<std::streamsize>(room.size()))) {
    reader.line = room.data();
    ++reader.number;
    reader.read_line();
  }
  if (!in.eof()) {
    throw InputError(
        file, fmt::format("line {}: expected at most {} characters, found more", reader.number + 1, room.size() - 1));
  }
  if (reader.mesh.triangles.empty()) throw InputError(file, "expected faces ('f 1/1 2/2 3/3'), found none");
  if (!reader.has_normals) reader.mesh.N.clear();
  return std::move(reader.mesh);
}

}  // namespace relief
