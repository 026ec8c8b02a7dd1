// Errors and warnings about what the user gave us. Only cli/main.cpp prints them.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace relief {

/// A text as a terminal may be shown it: control characters (escape sequences, newlines, those that turn the direction of
/// writing) and bytes that are not UTF-8 become \\x1b or \\u202e. Names come from files, and a file must neither command a
/// terminal nor forge a line of what we say.
std::string printable_text(std::string_view text);

/// The scene is invalid. what() is the one line the user sees:
/// "FILE: JSON_PATH: expected EXPECTED, found FOUND".
class SceneError : public std::runtime_error {
 public:
  SceneError(std::string file_name, std::string path, std::string wanted, std::string got);

  std::string file, json_path, expected, found;
};

/// Collects warnings, each distinct text once, with the number of times it came up.
class Warnings {
 public:
  void add(const std::string& text);
  /// Texts in order of first appearance, " (×N)" appended where N > 1.
  std::vector<std::string> texts() const;

 private:
  struct Entry {
    std::string text;
    int count = 0;
  };
  std::vector<Entry> entries_;
  std::unordered_map<std::string, std::size_t> entry_of_;
};

}  // namespace relief
