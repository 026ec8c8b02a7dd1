#include "scene/diagnostics.h"

#include <algorithm>
#include <utility>

namespace relief {
namespace {

/// Text fit for one line of a terminal: control characters escaped, overlong text cut in the middle of nothing but
/// whole UTF-8 characters.
std::string one_line(const std::string& text)
{
  constexpr std::size_t kLongest = 400;
  constexpr char kHex[] = "0123456789abcdef";
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    // Cutting before a continuation byte (10xxxxxx) would leave half a character.
    if (out.size() >= kLongest && (byte & 0xc0u) != 0x80u) {
      return out + "…";
    }
    if (byte < 0x20 || byte == 0x7f) {
      out += "\\x";
      out += kHex[byte >> 4];
      out += kHex[byte & 15];
    } else {
      out += c;
    }
  }
  return out;
}

std::string message(const std::string& file,
                    const std::string& json_path,
                    const std::string& expected,
                    const std::string& found)
{
  std::string text = one_line(file) + ": ";
  if (!json_path.empty()) {
    text += one_line(json_path) + ": ";
  }
  return text + "expected " + one_line(expected) + ", found " + one_line(found);
}

}  // namespace

SceneError::SceneError(std::string file_name, std::string path, std::string wanted, std::string got)
    : std::runtime_error(message(file_name, path, wanted, got)),
      file(std::move(file_name)),
      json_path(std::move(path)),
      expected(std::move(wanted)),
      found(std::move(got))
{
}

void Warnings::add(const std::string& text)
{
  const std::string line = one_line(text);
  const auto [known, is_new] = entry_of_.try_emplace(line, entries_.size());
  if (is_new) {
    entries_.push_back({line, 0});
  }
  ++entries_[known->second].count;
}

std::vector<std::string> Warnings::texts() const
{
  std::vector<std::string> out;
  out.reserve(entries_.size());
  for (const Entry& e : entries_) {
    out.push_back(e.count > 1 ? e.text + " (×" + std::to_string(e.count) + ")" : e.text);
  }
  return out;
}

}  // namespace relief
