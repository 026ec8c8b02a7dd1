#include "cli/cmd_report.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "cli/arguments.h"
#include "cli/memory_option.h"
#include "cli/run_files.h"
#include "cli/value_hint.h"
#include "exporters/atomic_file.h"
#include "exporters/errors.h"
#include "exporters/exr.h"
#include "exporters/report/frame_report.h"

namespace relief {

namespace {

struct ReportArguments {
  std::filesystem::path picture;
  std::string statistics, reference, output;  ///< the first two may be empty
};

std::string text_of_file(const std::string& file)
{
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) throw InputError(file, "is a folder");
  std::ifstream stream(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(stream), {}};
  if (!stream) throw InputError(file, "cannot be read");
  if (text.empty()) throw InputError(file, "is empty");
  return text;
}

std::string window_text(const Picture& p)
{
  return fmt::format("{}x{} pixels at {},{}", p.width, p.height, p.crop_x, p.crop_y);
}

int report_run(const ReportArguments& arguments)
{
  RunFiles files;
  files.add_output("--output", arguments.output);
  files.add_input("the picture", arguments.picture);
  files.add_input("the statistics", arguments.statistics);
  files.add_input("the reference", arguments.reference);
  check_writable(arguments.output);
  const Picture picture = exr_load(arguments.picture);
  FrameReport report = frame_report_of(picture);
  if (!arguments.statistics.empty()) {
    report.statistics = text_of_file(arguments.statistics);
    report.statistics_file = arguments.statistics;
  }
  std::optional<Picture> reference;
  if (!arguments.reference.empty()) {
    reference = exr_load(arguments.reference);
    if (window_text(*reference) != window_text(picture)) {
      throw InputError(arguments.reference, "is " + window_text(*reference) + ", but '" + arguments.picture.string() +
                                                "' is " + window_text(picture));
    }
    report.reference = frame_report_of(*reference).beauty;
  }
  const std::string html = frame_report_html(report);
  files.check_output("--output", arguments.output);
  atomic_write(arguments.output, html);
  return 0;
}

}  // namespace

void cmd_report_register(CLI::App& app, std::function<int()>& run)
{
  CLI::App* command = app.add_subcommand("report", "Makes one page about a rendered frame: picture, error, cost");
  const auto arguments = std::make_shared<ReportArguments>();
  ReportArguments& a = *arguments;
  names_file(command->add_option("picture", a.picture, "OpenEXR file that was rendered"), {".exr"})->required();
  names_file(command->add_option("--stats", a.statistics, "JSON file of statistics that the render wrote"), {".json"});
  names_file(command->add_option("--reference", a.reference, "OpenEXR file to show and measure it against"), {".exr"});
  names_file(add_parsed(
                 *command, "-o,--output", a.output,
                 [](const std::string& text) { return parse_output("--output", text, ".html"); }, "HTML page to write"),
             {".html"})
      ->required();
  add_max_memory(*command);
  command->callback([arguments, &run] { run = [arguments] { return report_run(*arguments); }; });
}

}  // namespace relief
