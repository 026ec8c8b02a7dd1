#include "cli/cmd_merge.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <vector>

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
  const MergeResult merged = merge_pictures(arguments.inputs, arguments.options);
  for (const std::string& warning : merged.warnings) {
    std::fprintf(stderr, "relief: warning: %s\n", warning.c_str());
  }
  exr_write(arguments.output, merged.picture);
  std::printf("%s: %zu pictures, %s samples a pixel\n", arguments.output.c_str(), arguments.inputs.size(),
              merged.picture.attributes.at("relief:samples").c_str());
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
  command->add_option("-o,--output", arguments->output, "OpenEXR file to write")->required();
  command->add_flag("--force", arguments->options.force,
                    "Accept files that name another scene or frame, or no seed; equal seeds are never accepted");
  command->callback([arguments, &run] { run = [arguments] { return merge_run(*arguments); }; });
}

}  // namespace relief
