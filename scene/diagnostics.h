// Errors and warnings about what the user gave us. Only cli/main.cpp prints them.
#pragma once

#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

namespace relief {

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
  bool empty() const { return entries_.empty(); }

 private:
  struct Entry {
    std::string text;
    int count = 0;
  };
  std::vector<Entry> entries_;
  std::unordered_map<std::string, std::size_t> entry_of_;
};

}  // namespace relief
