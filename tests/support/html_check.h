// Looks at HTML pages as a strict reader would: elements nest, and pictures in data URIs are PNG files.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace relief::test {

/// Elements that are open where they should not be, or closed without having been opened; empty for a page that nests.
/// Scripts and styles are no markup, and attributes may be quoted or not.
inline std::string html_nesting_error(std::string_view html)
{
  const std::set<std::string, std::less<>> kVoid = {"meta", "img", "input", "br"};
  std::vector<std::string> open;
  for (std::size_t at = html.find('<'); at != std::string_view::npos; at = html.find('<', at)) {
    if (html.substr(at, 2) == "<!") {
      at = html.find('>', at);
      continue;
    }
    std::size_t end = at + 1;
    for (char quote = 0; end < html.size() && (quote != 0 || html[end] != '>'); ++end) {
      if (quote != 0) {
        if (html[end] == quote) quote = 0;
      } else if (html[end] == '\'' || html[end] == '"') {
        quote = html[end];
      }
    }
    if (end >= html.size()) return "an element without an end";
    const bool closes = html[at + 1] == '/', is_empty = html[end - 1] == '/';
    const std::size_t first = at + (closes ? 2 : 1);
    const std::string name(html.substr(first, html.find_first_of(" />\n", first) - first));
    at = end;
    if (name.empty()) return "'<' that begins nothing";
    if (closes) {
      if (open.empty() || open.back() != name) return "</" + name + "> within " + (open.empty() ? "" : open.back());
      open.pop_back();
    } else if (!is_empty && kVoid.count(name) == 0) {
      open.push_back(name);
      if (name == "script" || name == "style") at = html.find("</" + name, at);
    }
  }
  return open.empty() ? "" : "<" + open.back() + "> is not closed";
}

/// @source RFC 4648, section 4
inline std::string base64_bytes(std::string_view text)
{
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  std::uint32_t bits = 0;
  int num_bits = 0;
  for (const char c : text) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos) break;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    num_bits += 6;
    if (num_bits >= 8) {
      num_bits -= 8;
      bytes += static_cast<char>(bits >> num_bits & 255u);
    }
  }
  return bytes;
}

/// Files of all pictures in a page, in its order.
inline std::vector<std::string> html_pictures(std::string_view html)
{
  constexpr std::string_view kStart = "data:image/png;base64,";
  std::vector<std::string> files;
  for (std::size_t at = html.find(kStart); at != std::string_view::npos; at = html.find(kStart, at)) {
    at += kStart.size();
    files.push_back(base64_bytes(html.substr(at, html.find('\'', at) - at)));
  }
  return files;
}

/// Width and height in a PNG's header; 0, 0 if it is none.
/// @source ISO/IEC 15948, sections 5.2 and 11.2.2
inline std::array<int, 2> png_size(std::string_view png)
{
  constexpr std::string_view kSignature("\x89PNG\r\n\x1a\n", 8);
  if (png.size() < 24 || png.substr(0, 8) != kSignature || png.substr(12, 4) != "IHDR") return {0, 0};
  const auto integer = [&](std::size_t at) {
    int value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(png[at + i]);
    return value;
  };
  return {integer(16), integer(20)};
}

}  // namespace relief::test
