#include "cli/suggestion.h"

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <utility>

namespace relief {

namespace {

/// Options by the names that they have elsewhere.
constexpr std::pair<std::string_view, std::string_view> kOtherNames[] = {
    {"--samples", "--spp"},       {"--size", "--resolution"},       {"--width", "--resolution"},
    {"--height", "--resolution"}, {"--bounces", "--max-bounces"},   {"--depth", "--max-bounces"},
    {"--frame", "--frames"},      {"--jobs", "--threads"},          {"--quiet", "--progress"},
    {"--silent", "--progress"},   {"--noise", "--noise-threshold"}, {"--passes", "--aov"},
    {"--region", "--crop"},       {"--time", "--time-limit"},
};

/// Letters that have to be put in, taken out, replaced, or swapped with the next one.
std::size_t edit_distance(std::string_view a, std::string_view b)
{
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

std::string option_meant(const CLI::App& command, const std::string& typed)
{
  for (const auto& [other, own] : kOtherNames) {
    if (typed == other && command.get_option_no_throw(std::string(own)) != nullptr) return std::string(own);
  }
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return nearest_word(typed, names);
}

}  // namespace

std::string nearest_word(const std::string& word, const std::vector<std::string>& known)
{
  constexpr std::size_t kLongest = 64;
  if (word.size() > kLongest) return {};
  std::string nearest;
  std::size_t least = 1 + word.size() / 4;
  for (const std::string& candidate : known) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance > least || (distance == least && !nearest.empty())) continue;
    least = distance;
    nearest = candidate;
  }
  return nearest;
}

std::string suggestion(const CLI::App& app, const std::vector<std::string>& arguments)
{
  const auto commands = app.get_subcommands();
  if (commands.empty()) {
    const auto word =
        std::find_if(arguments.begin(), arguments.end(), [](const auto& a) { return a.rfind('-', 0) != 0; });
    if (word == arguments.end()) return {};
    const std::string suffix = std::filesystem::path(*word).extension().string();
    if (suffix == ".gltf" || suffix == ".glb") return "did you mean relief render " + *word + " -o picture.exr?";
    std::vector<std::string> names;
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(command->get_name());
    }
    const std::string meant = nearest_word(*word, names);
    return meant.empty() ? "" : "did you mean relief " + meant + "?";
  }
  for (const std::string& argument : arguments) {
    const std::string typed = argument.substr(0, argument.find('='));
    if (typed.rfind("--", 0) != 0 || commands.front()->get_option_no_throw(typed) != nullptr) continue;
    const std::string meant = option_meant(*commands.front(), typed);
    if (!meant.empty()) return "did you mean " + meant + "?";
  }
  return {};
}

}  // namespace relief
