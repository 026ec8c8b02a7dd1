#include "cli/cmd_denoise.h"

#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include <tbb/global_control.h>
#include <tbb/info.h>

#include "cli/arguments.h"
#include "cli/denoise_picture.h"
#include "cli/memory_option.h"
#include "cli/run_files.h"
#include "cli/standard_streams.h"
#include "cli/value_hint.h"
#include "exporters/exr.h"
#include "exporters/png_ocio.h"

namespace relief {

namespace {

struct DenoiseArguments {
  std::filesystem::path input;
  std::string output, png, view, display;
  double exposure = 0;
  int threads = 0;
  Denoiser denoiser = Denoiser::kBuiltin;
};

/// Puts the layers of a denoised picture into it, in place of older ones.
void add_layers(Picture& picture, const DenoisedPicture& denoised)
{
  for (const ChannelView& view : denoised.channels()) {
    std::erase_if(picture.channels, [&](const Channel& channel) { return channel.name == view.name; });
    Channel channel{view.name, view.type, {}};
    channel.values.reserve(static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height));
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x) channel.values.push_back(view.at(x, y));
    }
    picture.channels.push_back(std::move(channel));
  }
  for (const auto& [name, text] : denoised.attributes()) picture.attributes[name] = text;
}

int denoise_run(const DenoiseArguments& arguments)
{
  RunFiles files;
  files.add_output("--output", arguments.output);
  files.add_output("--png", arguments.png);
  files.add_input("the picture to denoise", arguments.input);
  if (!arguments.png.empty()) {
    const ColorView view(arguments.view);
    for (const std::string& file : view.files()) files.add_input("a file of the colour view", file);
  }
  denoiser_require(arguments.denoiser);
  check_writable(arguments.output);
  check_writable(arguments.png);
  const int threads = arguments.threads > 0 ? arguments.threads : tbb::info::default_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  exr_use_threads(threads > 1 ? threads : 0);
  Picture picture = exr_load(arguments.input);
  const DenoisedPicture denoised = denoise_picture(arguments.denoiser, all_channels(picture), arguments.input.string());
  files.check_output("--png", arguments.png);
  if (!arguments.png.empty()) {
    PngOptions png{arguments.view, arguments.exposure};
    png.display = arguments.display;
    png_write(arguments.png, denoised.beauty(picture.height), png);
  }
  add_layers(picture, denoised);
  files.check_output("--output", arguments.output);
  exr_write(arguments.output, picture);
  print_line(arguments.output + ": " + denoised.report());
  return 0;
}

}  // namespace

void cmd_denoise_register(CLI::App& app, std::function<int()>& run)
{
  CLI::App* command = app.add_subcommand("denoise", "Denoise a render, with the error that is left as a layer");
  const auto arguments = std::make_shared<DenoiseArguments>();
  const auto output = [](const char* option, const char* suffix) {
    return [=](const std::string& text) { return parse_output(option, text, suffix); };
  };
  names_file(command->add_option("input", arguments->input, "OpenEXR file with the layers that a denoiser needs"),
             {".exr"})
      ->required();
  names_file(add_parsed(*command, "-o,--output", arguments->output, output("--output", ".exr"),
                        "OpenEXR file to write: the input with the layers denoised and denoised_error"),
             {".exr"})
      ->required();
  names_file(
      add_parsed(*command, "--png", arguments->png, output("--png", ".png"), "PNG of the denoised picture to write"),
      {".png"});
  command->add_option("--view", arguments->view, setting_help(setting_info("view")));
  command->add_option("--display", arguments->display,
                      "OpenColorIO display of the PNG's view (default: the configuration's)");
  constexpr SettingInfo kExposure = setting_info("exposure");
  command->add_option("--exposure", arguments->exposure, setting_help(kExposure))->check(setting_check(kExposure));
  command->add_option("--threads", arguments->threads, "Threads (default: all processors)")
      ->check(whole_number(1, 4096));
  add_denoiser(*command, arguments->denoiser, Denoiser::kBuiltin);
  add_max_memory(*command);
  command->callback([arguments, &run] { run = [arguments] { return denoise_run(*arguments); }; });
}

}  // namespace relief
