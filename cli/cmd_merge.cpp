#include "cli/cmd_merge.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <vector>

#include "cli/arguments.h"
#include "cli/run_files.h"
#include "cli/standard_streams.h"
#include "exporters/exr.h"
#include "exporters/merge.h"

namespace relief {

namespace {

struct MergeArguments {
  std::vector<std::filesystem::path> inputs;
  std::filesystem::path output;
  MergeOptions options;
};

int merge_run(const MergeArguments& arguments)
{
  RunFiles files;
  files.add_output("--output", arguments.output);
  for (const std::filesystem::path& input : arguments.inputs) files.add_input("a picture to join", input);
  check_writable(arguments.output);
  const MergeResult merged = merge_pictures(arguments.inputs, arguments.options);
  for (const std::string& warning : merged.warnings) {
    print_warning(warning);
  }
  files.check_output("--output", arguments.output);
  exr_write(arguments.output, merged.picture);
  print_line(arguments.output.string() + ": " + std::to_string(arguments.inputs.size()) + " pictures, " +
             merged.picture.attributes.at("relief:samples") + " samples a pixel");
  return 0;
}

}  // namespace

void cmd_merge_register(CLI::App& app, std::function<int()>& run)
{
  CLI::App* command =
      app.add_subcommand("merge", "Join renders of the same frame with different seeds, weighted by samples");
  const auto arguments = std::make_shared<MergeArguments>();
  command->add_option("inputs", arguments->inputs, "OpenEXR files of the same scene, frame and window")
      ->required()
      ->expected(2, -1);
  command
      ->add_option_function<std::string>(
          "-o,--output",
          [arguments](const std::string& text) { arguments->output = parse_output("--output", text, ".exr"); },
          "OpenEXR file to write")
      ->required();
  command->add_flag("--force", arguments->options.force,
                    "Accept files that name another scene or frame, or no seed; equal seeds are never accepted");
  command->callback([arguments, &run] { run = [arguments] { return merge_run(*arguments); }; });
}

}  // namespace relief
