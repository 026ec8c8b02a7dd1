#include "cli/cmd_merge.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "cli/arguments.h"
#include "cli/memory_option.h"
#include "cli/run_files.h"
#include "cli/standard_streams.h"
#include "cli/value_hint.h"
#include "exporters/exr.h"
#include "exporters/merge.h"

namespace relief {

namespace {

struct MergeArguments {
  std::vector<std::filesystem::path> inputs;
  std::filesystem::path output;
  FrameList frames;
  MergeOptions options;
};

/// What becomes one picture.
struct Join {
  std::vector<std::filesystem::path> inputs;
  std::filesystem::path output;
};

/// A join for each frame, or the one of the names as they are.
std::vector<Join> joins_of(const MergeArguments& arguments)
{
  if (arguments.frames.numbers.empty()) return {{arguments.inputs, arguments.output}};
  std::vector<Join> joins;
  for (const int frame : arguments.frames.numbers) {
    Join join{{}, frame_path(arguments.output, frame)};
    for (const std::filesystem::path& input : arguments.inputs) join.inputs.push_back(frame_path(input, frame));
    joins.push_back(std::move(join));
  }
  return joins;
}

int merge_run(const MergeArguments& arguments)
{
  const std::vector<Join> joins = joins_of(arguments);
  RunFiles files;
  for (const Join& join : joins) files.add_output("--output", join.output);
  for (const Join& join : joins) {
    for (const std::filesystem::path& input : join.inputs) files.add_input("a picture to join", input);
  }
  check_writable(joins.front().output);
  for (const Join& join : joins) {
    const MergeResult merged = merge_pictures(join.inputs, arguments.options);
    for (const std::string& warning : merged.warnings) {
      print_warning(warning);
    }
    files.check_output("--output", join.output);
    exr_write(join.output, merged.picture);
    print_line(join.output.string() + ": " + std::to_string(join.inputs.size()) + " pictures, " +
               merged.picture.attributes.at("relief:samples") + " samples a pixel");
  }
  return 0;
}

}  // namespace

void cmd_merge_register(CLI::App& app, std::function<int()>& run)
{
  CLI::App* command =
      app.add_subcommand("merge", "Join renders of the same frame, of different seeds or parts, weighted by samples");
  const auto arguments = std::make_shared<MergeArguments>();
  names_file(command->add_option("inputs", arguments->inputs, "Pictures of the same scene, frame and window"), {".exr"})
      ->required()
      ->expected(2, -1);
  names_file(command->add_option_function<std::string>(
                 "-o,--output",
                 [arguments](const std::string& text) { arguments->output = parse_output("--output", text, ".exr"); },
                 "OpenEXR file to write"),
             {".exr"})
      ->required();
  add_parsed(*command, "--frames", arguments->frames, parse_frames,
             "Join these frames, such as 1-10,20,30-60x2; in all names #### stands for the number");
  command->add_flag(
      "--force", arguments->options.force,
      "Accept files that name another scene or frame, or no seed; the same samples twice are never accepted");
  add_max_memory(*command);
  command->callback([arguments, &run] {
    if (arguments->frames.all) throw CLI::ValidationError("--frames", "expected numbers of frames, found 'all'");
    run = [arguments] { return merge_run(*arguments); };
  });
}

}  // namespace relief
