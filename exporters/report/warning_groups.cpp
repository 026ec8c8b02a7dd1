#include "exporters/report/warning_groups.h"

#include <algorithm>

namespace relief {

namespace {

constexpr std::string_view kAny = "…";

/// Quoted texts, blanks included, as single words. An apostrophe within a word quotes nothing.
std::string without_quotes(std::string_view text)
{
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool starts_word = i == 0 || text[i - 1] == ' ' || text[i - 1] == '(';
    const std::size_t end =
        (text[i] == '\'' || text[i] == '"') && starts_word ? text.find(text[i], i + 1) : std::string_view::npos;
    if (end == std::string_view::npos) {
      result += text[i];
    } else {
      result += kAny;
      i = end;
    }
  }
  return result;
}

bool is_particular(std::string_view word)
{
  return word.find_first_of("0123456789/") != std::string_view::npos || word.find(kAny) != std::string_view::npos;
}

}  // namespace

std::string warning_kind(std::string_view text)
{
  const std::string plain = without_quotes(text);
  std::string kind;
  bool was_particular = false;
  for (std::size_t start = 0; start <= plain.size();) {
    const std::size_t end = std::min(plain.find(' ', start), plain.size());
    const std::string_view word = std::string_view(plain).substr(start, end - start);
    start = end + 1;
    const bool particular = is_particular(word);
    if (particular && was_particular) continue;
    was_particular = particular;
    if (!kind.empty()) kind += ' ';
    kind += particular ? kAny : word;
  }
  return kind;
}

std::vector<WarningGroup> warning_groups(const std::vector<std::string>& texts)
{
  std::vector<WarningGroup> groups;
  for (const std::string& text : texts) {
    const std::string kind = warning_kind(text);
    auto group = std::find_if(groups.begin(), groups.end(), [&](const WarningGroup& g) { return g.kind == kind; });
    if (group == groups.end()) group = groups.insert(groups.end(), {kind, {}});
    group->texts.push_back(text);
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const WarningGroup& a, const WarningGroup& b) { return a.texts.size() > b.texts.size(); });
  return groups;
}

}  // namespace relief
