#include "cli/man_page.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <set>
#include <sstream>
#include <string_view>

#include <fmt/format.h>

#include "cli/exit_code.h"
#include "cli/value_hint.h"

namespace relief {

namespace {

struct EnvironmentVariable {
  const char* name;
  const char* meaning;
};
constexpr EnvironmentVariable kEnvironment[] = {
    {"OCIO",
     "OpenColorIO configuration for the PNG's view. Without it, the one that Blender installs is used if there is one, "
     "and "
     "otherwise the plain sRGB curve."},
    {"RELIEF_ISA", "baseline or avx2: kernels to use instead of the best that the processor can run."},
};

/// Code points of UTF-8; bytes that are none stand for themselves.
std::vector<std::uint32_t> code_points(std::string_view text)
{
  std::vector<std::uint32_t> points;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte & 0xc0u) == 0x80u && !points.empty()) {
      points.back() = points.back() << 6 | (byte & 0x3fu);
    } else {
      points.push_back(byte < 0x80u ? byte : byte < 0xe0u ? byte & 0x1fu : byte < 0xf0u ? byte & 0x0fu : byte & 0x07u);
    }
  }
  return points;
}

/// Text as roff takes it for what it is: ASCII, and nothing that is a request, an escape or another glyph.
std::string roff(std::string_view text)
{
  std::string out;
  for (const std::uint32_t c : code_points(text)) {
    switch (c) {
      case '\\':
        out += "\\e";
        break;
      case '-':
        out += "\\-";
        break;
      case '\'':
        out += "\\(aq";
        break;
      case '`':
        out += "\\(ga";
        break;
      case '^':
        out += "\\(ha";
        break;
      case '~':
        out += "\\(ti";
        break;
      case '"':
        out += "\\(dq";
        break;
      case '\n':
        out += ' ';
        break;
      default:
        out += c < 0x80 ? std::string(1, static_cast<char>(c)) : fmt::format("\\[u{:04X}]", c);
    }
  }
  return out;
}

/// Running text in lines as short as source should be.
std::string paragraph(std::string_view text)
{
  constexpr std::size_t kWidth = 78;
  std::string out;
  std::size_t column = 0;
  std::istringstream words(roff(text));
  for (std::string word; words >> word;) {
    const bool fits = column > 0 && column + 1 + word.size() <= kWidth;
    if (column > 0) out += fits ? ' ' : '\n';
    if (!fits) column = 0;
    // A request begins with a dot at the start of a line.
    if (column == 0 && word.starts_with('.')) word.insert(0, "\\&");
    out += word;
    column += word.size() + (fits ? 1 : 0);
  }
  return out;
}

std::string bold(std::string_view text) { return "\\fB" + roff(text) + "\\fR"; }
std::string italic(std::string_view text) { return "\\fI" + roff(text) + "\\fR"; }

/// What stands for the value of an option: the type of --help without what is said of it in words.
std::string value_name(const CLI::Option& option)
{
  const std::string type = option.get_type_name();
  return type.substr(0, type.find_first_of(": "));
}

std::string sentence(std::string text)
{
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

/// Names of options, in an order that does not depend on where they are in memory.
std::string names_text(const std::set<CLI::Option*>& options)
{
  std::set<std::string> names;
  for (const CLI::Option* option : options) names.insert(option->get_name());
  return words_text({names.begin(), names.end()});
}

/// All that is known of an option, as sentences.
std::string option_text(CLI::Option& option)
{
  const ValueHint hint = value_hint(option);
  std::string text = sentence(option.get_description());
  const auto add = [&](const std::string& more) { text += (text.empty() ? "" : " ") + more; };
  if (!hint.words.empty()) {
    const char* start = hint.is_list ? "Some of " : hint.is_file ? "A file, or one of " : "One of ";
    add(start + words_text(hint.words) + ".");
  }
  if (!hint.suffixes.empty()) add("Files: " + words_text(hint.suffixes) + ".");
  if (!hint.range.empty()) add("Range: " + hint.range + ".");
  if (!option.get_default_str().empty()) add("Default: " + option.get_default_str() + ".");
  if (option.get_required()) add("Required.");
  if (!option.get_needs().empty()) add("Needs " + names_text(option.get_needs()) + ".");
  if (!option.get_excludes().empty()) add("Not together with " + names_text(option.get_excludes()) + ".");
  return text;
}

/// -o, --output FILE
std::string option_title(const CLI::Option& option)
{
  std::string title;
  for (const std::string& name : option.get_snames()) title += (title.empty() ? "" : ", ") + bold("-" + name);
  for (const std::string& name : option.get_lnames()) title += (title.empty() ? "" : ", ") + bold("--" + name);
  if (option.get_items_expected_max() > 0) title += " " + italic(value_name(option));
  return title;
}

std::string operand_name(const CLI::Option& option)
{
  std::string name = option.get_name(true);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return name;
}

std::string item(const std::string& title, const std::string& text)
{
  return ".TP\n" + title + "\n" + paragraph(text) + "\n";
}

std::string command_name(const std::vector<CLI::App*>& path)
{
  std::string name;
  for (const CLI::App* app : path) name += (name.empty() ? "" : " ") + app->get_name();
  return name;
}

std::vector<CLI::App*> commands_of(CLI::App& app)
{
  std::vector<CLI::App*> commands = app.get_subcommands([](CLI::App*) { return true; });
  std::erase_if(commands, [](const CLI::App* command) { return command->get_group().empty(); });
  return commands;
}

/// Options and operands that --help shows.
std::vector<CLI::Option*> shown_options(CLI::App& app, bool operands)
{
  return app.get_options(
      [=](CLI::Option* option) { return option->get_positional() == operands && !option->get_group().empty(); });
}

std::string synopsis(const std::vector<CLI::App*>& path)
{
  CLI::App& app = *path.back();
  std::string text = ".SH SYNOPSIS\n" + bold(command_name(path));
  for (const CLI::Option* operand : shown_options(app, true)) {
    std::string name = italic(operand_name(*operand));
    if (operand->get_items_expected_max() > 1) name += " \\&...";
    text += operand->get_required() ? " " + name : " [" + name + "]";
  }
  for (const CLI::Option* option : shown_options(app, false)) {
    if (option->get_required()) text += " " + bold(option->get_name()) + " " + italic(value_name(*option));
  }
  text += " [" + italic("OPTIONS") + "]";
  if (!commands_of(app).empty()) text += " " + italic("COMMAND");
  return text + "\n";
}

}  // namespace

std::string man_page_name(const std::vector<CLI::App*>& path)
{
  std::string name = command_name(path);
  std::replace(name.begin(), name.end(), ' ', '-');
  return name;
}

std::string man_page(const std::vector<CLI::App*>& path, const std::string& version, const std::string& date)
{
  CLI::App& app = *path.back();
  const std::string name = man_page_name(path);
  std::string title = name;
  std::transform(title.begin(), title.end(), title.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  // The program's own description has its version before it, for --help.
  std::string description = app.get_description();
  if (path.size() == 1) description = description.substr(description.find(": ") + 2);

  std::string text = fmt::format(".TH {} 1 {} \"relief {}\" \"relief manual\"\n", title, date, version);
  text += ".SH NAME\n" + roff(name) + " \\- " + roff(description) + "\n" + synopsis(path);
  text += ".SH DESCRIPTION\n" + paragraph(sentence(description)) + "\n";
  if (!shown_options(app, true).empty()) text += ".SH OPERANDS\n";
  for (CLI::Option* operand : shown_options(app, true))
    text += item(italic(operand_name(*operand)), option_text(*operand));
  text += ".SH OPTIONS\n";
  for (CLI::Option* option : shown_options(app, false)) text += item(option_title(*option), option_text(*option));
  const std::vector<CLI::App*> commands = commands_of(app);
  if (!commands.empty()) text += ".SH COMMANDS\n";
  std::string pages;
  const auto refer = [&](const std::vector<CLI::App*>& to) {
    // The comma belongs to the line of the name before it.
    pages += (pages.empty() ? "" : ",\n") + (".BR " + roff(man_page_name(to)) + " (1)");
  };
  if (path.size() > 1) refer({path.begin(), path.end() - 1});
  for (CLI::App* command : commands) {
    text += item(bold(command->get_name()), sentence(command->get_description()));
    std::vector<CLI::App*> below = path;
    below.push_back(command);
    refer(below);
  }
  text += ".SH EXIT STATUS\n";
  for (const ExitCodeInfo& exit : kExitCodes) text += item(bold(std::to_string(exit.code)), sentence(exit.meaning));
  text += ".SH ENVIRONMENT\n";
  for (const EnvironmentVariable& variable : kEnvironment) text += item(bold(variable.name), variable.meaning);
  if (!pages.empty()) text += ".SH SEE ALSO\n" + pages + "\n";
  return text;
}

std::vector<std::vector<CLI::App*>> man_page_paths(CLI::App& app)
{
  std::vector<std::vector<CLI::App*>> paths = {{&app}};
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const std::vector<CLI::App*> path = paths[i];
    for (CLI::App* command : commands_of(*path.back())) {
      paths.push_back(path);
      paths.back().push_back(command);
    }
  }
  return paths;
}

}  // namespace relief
