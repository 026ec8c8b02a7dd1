// What somebody meant who typed something that relief does not know.
#pragma once

#include <string>
#include <vector>

#include <CLI/App.hpp>

namespace relief {

/// The word that one with typing errors was meant to be; empty: none is near.
std::string nearest_word(const std::string& word, const std::vector<std::string>& known);

/// A question such as "did you mean --spp?"; empty: nothing is near.
/// @param app   has tried to parse the arguments
/// @param arguments  without the program's name
std::string suggestion(const CLI::App& app, const std::vector<std::string>& arguments);

}  // namespace relief
