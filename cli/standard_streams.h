// Standard input, output and error, which a program does not open by itself and so may find closed or full.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace relief {

/// Puts something in the place of standard streams that are closed, where writing fails. Otherwise the first file that is
/// opened would take the place, and be written into by messages. Before anything is opened.
void standard_streams_reserve();

/// Prints one line, in which what is not fit for a terminal is escaped, newlines too: names in it come from files.
/// That standard output cannot be written shows in standard_output_flush.
void print_line(const std::string& line);

/// Likewise on standard error, "relief: warning: " before it.
void print_warning(const std::string& text);

/// Prints a JSON object as a line, at once; lines of several threads do not mix.
/// @return false if it cannot be written
bool print_json(const nlohmann::json& object);

/// Writes what standard output still holds.
/// @error OutputError if this or any earlier write to it has failed, e.g. on a full disk
void standard_output_flush();

}  // namespace relief
