// What may come next on a command line, for the completion of shells. Shells hand the words over that were typed and get an
// answer; so there is one implementation for all of them, out of the tree of options that --help prints.
#pragma once

#include <string>
#include <vector>

#include <CLI/App.hpp>

namespace relief {

struct Completions {
  struct Word {
    std::string text;         ///< the whole word that may stand there
    std::string description;  ///< one line; may be empty
  };
  std::vector<Word> words;
  bool may_go_on = false;             ///< the words may be longer still, as those of a list
  bool files = false;                 ///< names of files may stand there as well
  std::vector<std::string> suffixes;  ///< of these files; empty: any
  std::string before_file;            ///< what stands in the word before the name, "--png="
};

/// @param app    with all commands registered; nothing is parsed
/// @param words  after the program's name; the last is the one to be completed, perhaps empty
Completions completions_of(CLI::App& app, const std::vector<std::string>& words);

/// What shells read, a line each: "word", "part" (may go on) or "file", then a tab and, of a word, itself, a tab and its
/// description; of files their suffixes, a space between them, a tab and what stands before the name.
std::string completions_text(const Completions& completions);

}  // namespace relief
