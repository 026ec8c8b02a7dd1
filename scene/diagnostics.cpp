#include "scene/diagnostics.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <utility>

namespace relief {
namespace {

/// Length of the UTF-8 character at the start of a text, and its number; length 0: no character starts there.
/// @source Unicode 15.0, table 3-7
struct Utf8Character {
  std::size_t length = 0;
  std::uint32_t code = 0;
};

Utf8Character utf8_first(std::string_view text)
{
  const auto byte = [&](std::size_t i) { return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i])); };
  const std::uint32_t lead = byte(0);
  if (lead < 0x80) {
    return {1, lead};
  }
  const std::size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < length) {
    return {};
  }
  std::uint32_t code = lead & (0x7fu >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0u) != 0x80u) {
      return {};
    }
    code = (code << 6) | (byte(i) & 0x3fu);
  }
  const bool is_overlong = (length == 3 && code < 0x800) || (length == 4 && code < 0x10000);
  const bool is_surrogate = code >= 0xd800 && code <= 0xdfff;
  return is_overlong || is_surrogate || code > 0x10ffff ? Utf8Character{} : Utf8Character{length, code};
}

/// Whether a terminal does something else with a character than to show it: control characters of both sets, the separators
/// of lines and paragraphs, and those that turn the direction of writing and so change the order of what is read.
bool is_control(std::uint32_t code)
{
  return code < 0x20 || (code >= 0x7f && code < 0xa0) || (code >= 0x2028 && code <= 0x202e) ||
         (code >= 0x2066 && code <= 0x2069) || code == 0x200e || code == 0x200f;
}

/// Printable text of a bounded length.
std::string one_line(const std::string& text)
{
  constexpr std::size_t kLongest = 400;
  const std::string out = printable_text(std::string_view(text).substr(0, 2 * kLongest));
  if (out.size() <= kLongest && text.size() <= 2 * kLongest) {
    return out;
  }
  std::size_t end = std::min(kLongest, out.size());
  // Cutting before a continuation byte (10xxxxxx) would leave half a character.
  while (end > 0 && end < out.size() && (static_cast<unsigned char>(out[end]) & 0xc0u) == 0x80u) {
    --end;
  }
  return out.substr(0, end) + "…";
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

std::string printable_text(std::string_view text)
{
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const Utf8Character first = utf8_first(text);
    const std::size_t length = std::max<std::size_t>(first.length, 1);
    if (first.length > 0 && !is_control(first.code)) {
      out += text.substr(0, length);
    } else {
      char escape[16];
      const bool is_byte = first.length <= 1;
      const unsigned value = is_byte ? static_cast<unsigned char>(text[0]) : first.code;
      std::snprintf(escape, sizeof escape, is_byte ? "\\x%02x" : "\\u%04x", value);
      out += escape;
    }
    text.remove_prefix(length);
  }
  return out;
}

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
