// `relief man`, `relief completion`, and `relief complete`, which the scripts of the second call.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "cli/arguments.h"
#include "cli/commands.h"
#include "cli/completion.h"
#include "cli/completion_scripts.h"
#include "cli/man_page.h"
#include "cli/value_hint.h"
#include "exporters/atomic_file.h"

namespace relief {

namespace {

/// @error CLI::ValidationError: no such command
std::string page_of(CLI::App& app, const std::vector<std::string>& words)
{
  std::vector<CLI::App*> path = {&app};
  for (const std::string& word : words) {
    std::vector<std::string> names;
    CLI::App* next = nullptr;
    for (CLI::App* command : path.back()->get_subcommands([](CLI::App*) { return true; })) {
      if (command->get_group().empty()) continue;
      names.push_back(command->get_name());
      if (command->get_name() == word) next = command;
    }
    if (next == nullptr) {
      const std::string expected = names.empty() ? "no more words" : "one of " + words_text(names);
      throw CLI::ValidationError("man", "expected " + expected + ", found '" + word + "'");
    }
    path.push_back(next);
  }
  return man_page(path, RELIEF_VERSION, RELIEF_DATE);
}

void write_pages(CLI::App& app, const std::filesystem::path& folder)
{
  std::filesystem::create_directories(folder);
  for (const std::vector<CLI::App*>& path : man_page_paths(app)) {
    atomic_write(folder / (man_page_name(path) + ".1"), man_page(path, RELIEF_VERSION, RELIEF_DATE));
  }
}

}  // namespace

void cmd_help_files_register(CLI::App& app, Run& run)
{
  struct Arguments {
    std::vector<std::string> page, words;
    std::string folder, shell;
  };
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* man = app.add_subcommand("man", "Prints the manual page of a command, for man -l -");
  CLI::Option* page = man->add_option("command", arguments->page, "Command, such as render, or bench displacement");
  man->add_option("--folder", arguments->folder, "Write the pages of all commands there instead")->excludes(page);
  man->callback([&app, &run, arguments] {
    run = [&app, arguments] {
      if (arguments->folder.empty()) {
        std::fputs(page_of(app, arguments->page).c_str(), stdout);
      } else {
        write_pages(app, arguments->folder);
      }
      return 0;
    };
  });

  CLI::App* completion = app.add_subcommand("completion", "Prints the script that completes commands in a shell");
  completion->add_option("shell", arguments->shell, "Shell")->required()->check(one_of({"bash", "zsh", "fish"}));
  completion->callback([&run, arguments] {
    run = [arguments] {
      const std::string& shell = arguments->shell;
      std::fputs(shell == "bash" ? kBashCompletion : shell == "zsh" ? kZshCompletion : kFishCompletion, stdout);
      return 0;
    };
  });

  // For the scripts; without a group it is not shown.
  CLI::App* complete = app.add_subcommand("complete", "Prints what may come next")->group("");
  complete->add_option("words", arguments->words, "Words after the program's name, the last to be completed");
  complete->callback([&app, &run, arguments] {
    run = [&app, arguments] {
      std::fputs(completions_text(completions_of(app, arguments->words)).c_str(), stdout);
      return 0;
    };
  });
}

}  // namespace relief
