// What the value of an option may be, written beside its check: --help shows it, manual pages and completion read it.
#pragma once

#include <string>
#include <vector>

#include <CLI/App.hpp>

namespace relief {

/// What is known of an option's values; all of it empty: nothing.
struct ValueHint {
  std::vector<std::string> words;     ///< it is one of them
  bool is_list = false;               ///< or several, separated by commas
  bool is_file = false;               ///< or the name of a file
  std::vector<std::string> suffixes;  ///< such as ".exr", what files are called; empty: anything
  std::string range;                  ///< such as "1..4096"
};

ValueHint value_hint(CLI::Option& option);

/// Hints that are no checks, for options whose text is parsed elsewhere.
CLI::Validator listed_words(const std::vector<std::string>& words);
CLI::Validator suggested_words(const std::vector<std::string>& words);

/// Says that an option's value is a file's name.
/// @param suffixes  as in ValueHint
/// @return the option
CLI::Option* names_file(CLI::Option* option, const std::vector<std::string>& suffixes);
inline const std::vector<std::string> kSceneSuffixes = {".gltf", ".glb"};
inline const std::vector<std::string> kImageSuffixes = {".exr", ".hdr", ".png", ".jpg", ".tif"};

/// Words as they are shown, ", " between them.
std::string words_text(const std::vector<std::string>& words);

/// Names of the validators that hints are read from.
inline constexpr const char* kOneOfCheck = "one of";
inline constexpr const char* kListCheck = "list of";
inline constexpr const char* kFileCheck = "file";
inline constexpr const char* kRangeCheck = "range";

}  // namespace relief
