// An error in one line, as people are told of it.
#pragma once

#include <exception>
#include <string>

namespace relief {

/// Whether an error comes of a lack of memory, as far as can be told.
bool is_of_memory(const std::exception& error);

/// The line without "relief: ".
std::string error_text(const std::exception& error);

}  // namespace relief
