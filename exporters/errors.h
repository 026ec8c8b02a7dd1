// The two ways in which a file can let us down. Only cli/main.cpp prints them and picks the exit code.
#pragma once

#include <stdexcept>
#include <string>

namespace relief {

/// A file that could not be written. what() is the one line the user sees: "FILE: CAUSE".
class OutputError : public std::runtime_error {
 public:
  OutputError(std::string file_name, std::string cause_text)
      : std::runtime_error(file_name + ": " + cause_text), file(std::move(file_name)), cause(std::move(cause_text))
  {
  }

  std::string file, cause;
};

/// A picture or colour configuration that could not be read, or that does not fit its use. what(): "FILE: CAUSE".
class InputError : public std::runtime_error {
 public:
  InputError(std::string file_name, std::string cause_text)
      : std::runtime_error(file_name + ": " + cause_text), file(std::move(file_name)), cause(std::move(cause_text))
  {
  }

  std::string file, cause;
};

}  // namespace relief
