#include "cli/completion.h"

#include <algorithm>
#include <string_view>

#include "cli/value_hint.h"

namespace relief {

namespace {

/// An option without a group is for programs, not for people.
bool is_shown(const CLI::Option& option) { return !option.get_group().empty(); }

bool takes_value(const CLI::Option& option) { return option.get_items_expected_max() > 0; }

bool is_option(std::string_view word) { return word.size() > 1 && word.front() == '-'; }

CLI::App* command_named(CLI::App& app, const std::string& word)
{
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    if (command->check_name(word) && !command->get_group().empty()) return command;
  }
  return nullptr;
}

/// Where the words before the last one lead.
struct Place {
  CLI::App* app;
  CLI::Option* option = nullptr;  ///< whose value comes next
  int num_positionals = 0;
  bool only_positionals = false;  ///< after "--"
  std::vector<CLI::Option*> given;
};

Place place_after(CLI::App& root, const std::vector<std::string>& words)
{
  Place place{&root, nullptr, 0, false, {}};
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    const std::string& word = words[i];
    if (place.option != nullptr) {
      place.option = nullptr;
    } else if (word == "--" && !place.only_positionals) {
      place.only_positionals = true;
    } else if (is_option(word) && !place.only_positionals) {
      const std::size_t sign = word.find('=');
      CLI::Option* option = place.app->get_option_no_throw(word.substr(0, sign));
      if (option == nullptr) continue;
      place.given.push_back(option);
      if (sign == std::string::npos && takes_value(*option)) place.option = option;
    } else if (CLI::App* command = place.num_positionals == 0 ? command_named(*place.app, word) : nullptr) {
      place = {command, nullptr, 0, false, {}};
    } else {
      ++place.num_positionals;
    }
  }
  return place;
}

/// The operand at that place; null: no more are taken.
CLI::Option* positional_at(CLI::App& app, int index)
{
  for (CLI::Option* option : app.get_options()) {
    if (!option->get_positional() || !is_shown(*option)) continue;
    if (index < option->get_items_expected_max()) return option;
    index -= option->get_items_expected_max();
  }
  return nullptr;
}

void add_word(Completions& found, const std::string& typed, std::string word, std::string description)
{
  if (!word.starts_with(typed)) return;
  std::replace(description.begin(), description.end(), '\n', ' ');
  found.words.push_back({std::move(word), std::move(description)});
}

/// @param before  what of the word comes before the value, "--png="
/// @param typed   of the value so far
void add_values(Completions& found, CLI::Option& option, const std::string& before, const std::string& typed)
{
  const ValueHint hint = value_hint(option);
  const std::size_t comma = typed.rfind(',');
  const std::string listed = hint.is_list && comma != std::string::npos ? typed.substr(0, comma + 1) : "";
  const auto is_listed = [&](const std::string& word) {
    return ("," + listed).find("," + word + ",") != std::string::npos;
  };
  for (const std::string& word : hint.words) {
    if (!is_listed(word)) add_word(found, before + typed, before + listed + word, "");
  }
  found.may_go_on = hint.is_list;
  found.files = hint.is_file;
  found.suffixes = hint.suffixes;
  found.before_file = before;
}

void add_options(Completions& found, const Place& place, const std::string& typed)
{
  for (CLI::Option* option : place.app->get_options()) {
    if (!is_shown(*option) || option->get_lnames().empty()) continue;
    const bool is_given = std::find(place.given.begin(), place.given.end(), option) != place.given.end();
    if (is_given && option->get_items_expected_max() <= 1) continue;
    add_word(found, typed, "--" + option->get_lnames().front(), option->get_description());
  }
}

}  // namespace

Completions completions_of(CLI::App& app, const std::vector<std::string>& words)
{
  Completions found;
  const std::string typed = words.empty() ? "" : words.back();
  const Place place = place_after(app, words);
  if (place.option != nullptr) {
    add_values(found, *place.option, "", typed);
    return found;
  }
  if (!place.only_positionals && typed.starts_with('-')) {
    const std::size_t sign = typed.find('=');
    if (sign == std::string::npos) {
      add_options(found, place, typed);
    } else if (CLI::Option* option = place.app->get_option_no_throw(typed.substr(0, sign))) {
      add_values(found, *option, typed.substr(0, sign + 1), typed.substr(sign + 1));
    }
    return found;
  }
  CLI::Option* positional = positional_at(*place.app, place.num_positionals);
  if (positional != nullptr) add_values(found, *positional, "", typed);
  if (place.num_positionals == 0 && !place.only_positionals) {
    for (const CLI::App* command : place.app->get_subcommands([](CLI::App*) { return true; })) {
      if (!command->get_group().empty()) add_word(found, typed, command->get_name(), command->get_description());
    }
  }
  if (found.words.empty() && !found.files && typed.empty() && !place.only_positionals) add_options(found, place, typed);
  return found;
}

std::string completions_text(const Completions& completions)
{
  std::string text;
  for (const Completions::Word& word : completions.words) {
    text += (completions.may_go_on ? "part\t" : "word\t") + word.text + '\t' + word.description + '\n';
  }
  if (completions.files) {
    std::string suffixes;
    for (const std::string& suffix : completions.suffixes) suffixes += (suffixes.empty() ? "" : " ") + suffix;
    text += "file\t" + suffixes + '\t' + completions.before_file + '\n';
  }
  return text;
}

}  // namespace relief
