#include "cli/value_hint.h"

#include <optional>
#include <string_view>

namespace relief {

namespace {

constexpr std::string_view kBetweenWords = ", ";

/// What a validator of that name says of itself; nothing if the option has none.
std::optional<std::string> description_of(CLI::Option& option, const char* validator)
{
  try {
    return option.get_validator(validator)->get_description();
  } catch (const CLI::OptionNotFound&) {
    return std::nullopt;
  }
}

std::vector<std::string> words_of(std::string_view text)
{
  std::vector<std::string> words;
  while (!text.empty()) {
    const std::size_t end = text.find(kBetweenWords);
    words.emplace_back(text.substr(0, end));
    if (end == std::string_view::npos) break;
    text.remove_prefix(end + kBetweenWords.size());
  }
  return words;
}

}  // namespace

std::string words_text(const std::vector<std::string>& words)
{
  std::string text;
  for (const std::string& word : words) text.append(text.empty() ? "" : kBetweenWords).append(word);
  return text;
}

ValueHint value_hint(CLI::Option& option)
{
  ValueHint hint;
  hint.is_list = option.get_delimiter() == ',';
  if (const auto words = description_of(option, kOneOfCheck)) hint.words = words_of(*words);
  if (const auto words = description_of(option, kListCheck)) {
    hint.words = words_of(*words);
    hint.is_list = true;
  }
  if (const auto suffixes = description_of(option, kFileCheck)) {
    hint.is_file = true;
    hint.suffixes = words_of(*suffixes);
  }
  hint.range = description_of(option, kRangeCheck).value_or("");
  return hint;
}

CLI::Validator listed_words(const std::vector<std::string>& words)
{
  return CLI::Validator(words_text(words)).name(kListCheck);
}

CLI::Validator suggested_words(const std::vector<std::string>& words)
{
  return CLI::Validator(words_text(words)).name(kOneOfCheck);
}

CLI::Option* names_file(CLI::Option* option, const std::vector<std::string>& suffixes)
{
  return option->type_name("FILE")->check(CLI::Validator(words_text(suffixes)).name(kFileCheck));
}

}  // namespace relief
