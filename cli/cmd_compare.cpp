#include "cli/cmd_compare.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "cli/arguments.h"
#include "cli/memory_option.h"
#include "cli/run_files.h"
#include "cli/standard_streams.h"
#include "cli/value_hint.h"
#include "exporters/atomic_file.h"
#include "exporters/difference_picture.h"
#include "exporters/errors.h"
#include "exporters/exr.h"
#include "exporters/flip.h"
#include "exporters/image_metrics.h"
#include "exporters/z_test.h"
#include "scene/diagnostics.h"

namespace relief {

namespace {

struct CompareArguments {
  std::filesystem::path a, b;
  std::string layer = "beauty";
  std::string diff, json;  ///< empty: not asked for
  std::optional<double> max_rmse, max_relmse, max_flip;
  bool wants_z_test = false;
  ZTestOptions z_test;
  FlipOptions flip;
};

struct Comparison {
  ImageErrors errors;
  std::optional<double> flip_mean;  ///< absent if the layer has no colours
  std::optional<ZTestResult> z_test;
};

ImageView layer_or_throw(const Picture& picture, const std::string& layer)
{
  ImageView view = picture_layer(picture, layer);
  if (!view.channels.empty()) return view;
  std::string known;
  for (const std::string& name : picture_layers(picture)) {
    known += (known.empty() ? "'" : ", '") + name + "'";
  }
  throw InputError(picture.file, "has no layer '" + layer + "'; there are " + known);
}

bool has_same_channels(const ImageView& a, const ImageView& b)
{
  if (a.channels.size() != b.channels.size()) return false;
  for (std::size_t c = 0; c < a.channels.size(); ++c) {
    if (a.channels[c].name != b.channels[c].name) return false;
  }
  return true;
}

std::string window_text(const Picture& picture)
{
  return std::to_string(picture.width) + "x" + std::to_string(picture.height) + " pixels at " +
         std::to_string(picture.crop_x) + "," + std::to_string(picture.crop_y);
}

bool has_colors(const ImageView& view)
{
  return view.channels.size() >= 3 && view.channels[0].name.ends_with('R') && view.channels[1].name.ends_with('G') &&
         view.channels[2].name.ends_with('B');
}

ZTestResult z_test_of_pictures(const CompareArguments& arguments,
                               const Picture& a,
                               const ImageView& view_a,
                               const Picture& b,
                               const ImageView& view_b)
{
  if (arguments.layer != "beauty" || view_a.channels.size() != 3) {
    throw InputError(a.file, "the z-test needs the red, green and blue of the beauty, whose variance is known");
  }
  for (const Picture* picture : {&a, &b}) {
    if (picture->lossy) {
      print_warning(picture->file + ": its lossy compression is not in the variances; the z-test may fail for it");
    }
  }
  const std::string layer(kAovInfo[static_cast<std::size_t>(Aov::kVariance)].name);
  const ImageView variance_a = layer_or_throw(a, layer), variance_b = layer_or_throw(b, layer);
  for (const auto& [picture, variance] : {std::pair{&a, &variance_a}, std::pair{&b, &variance_b}}) {
    if (!has_colors(*variance)) throw InputError(picture->file, "its layer 'variance' lacks red, green or blue");
  }
  return z_test(view_a, variance_a, view_b, variance_b, arguments.z_test);
}

void print_comparison(const CompareArguments& arguments, const Comparison& comparison)
{
  const ImageErrors& errors = comparison.errors;
  std::printf("RMSE    %.6g\n", errors.rmse);
  std::printf("relMSE  %.6g\n", errors.relmse);
  std::printf("PSNR    %.4g dB (peak 1)\n", errors.psnr);
  std::printf("MAE     %.6g\n", errors.mae);
  std::printf("bias    %+.6g\n", errors.bias);
  std::printf("max     %.6g", errors.max_difference);
  if (errors.max_difference > 0) {
    std::printf(" at %d,%d in %s", errors.max_x, errors.max_y, printable_text(errors.max_channel).c_str());
  }
  std::printf("\n");
  if (comparison.flip_mean) {
    std::printf("FLIP    %.6g (exposure %g, %g pixels a degree)\n", *comparison.flip_mean, arguments.flip.exposure,
                arguments.flip.pixels_per_degree);
  }
  if (errors.num_nonfinite > 0) {
    std::printf("left out: %llu values that are not finite\n", static_cast<unsigned long long>(errors.num_nonfinite));
  }
  if (!comparison.z_test) return;
  const ZTestResult& z = *comparison.z_test;
  std::printf("z-test  %s: p = %.3g, significance %g\n", z.passed ? "passed" : "FAILED", z.p, z.significance);
  std::printf("        pixels  p = %-9.3g largest z = %+.3g at %d,%d in %s\n", z.pixel_p, z.largest_pixel.z,
              z.largest_pixel.x, z.largest_pixel.y, printable_text(z.largest_pixel.channel).c_str());
  std::printf("        blocks  p = %-9.3g largest z = %+.3g at %d,%d in %s\n", z.block_p, z.largest_block.z,
              z.largest_block.x, z.largest_block.y, printable_text(z.largest_block.channel).c_str());
  std::printf("        mean    p = %-9.3g largest z = %+.3g in %s\n", z.mean_p, z.largest_mean.z,
              printable_text(z.largest_mean.channel).c_str());
  std::printf("        chi2    p = %.3g\n", z.chi2_p);
}

/// Prints what is not acceptable. @return whether all of it is
bool is_acceptable(const CompareArguments& arguments, const Comparison& comparison)
{
  bool acceptable = true;
  const auto check = [&](const char* name, double value, const std::optional<double>& bound) {
    // Written so that NaN is above every bound.
    if (!bound || value <= *bound) return;
    std::fprintf(stderr, "%s %.6g is above the bound %.6g\n", name, value, *bound);
    acceptable = false;
  };
  check("RMSE", comparison.errors.rmse, arguments.max_rmse);
  check("relMSE", comparison.errors.relmse, arguments.max_relmse);
  if (comparison.flip_mean) check("FLIP", *comparison.flip_mean, arguments.max_flip);
  const bool has_bound = arguments.max_rmse || arguments.max_relmse || arguments.max_flip;
  if (has_bound && comparison.errors.num_nonfinite > 0) {
    std::fprintf(stderr, "values that are not finite meet no bound\n");
    acceptable = false;
  }
  if (comparison.z_test && !comparison.z_test->passed) {
    std::fprintf(stderr, "z-test failed: the pictures are not estimates of the same image\n");
    acceptable = false;
  }
  return acceptable;
}

int compare_run(const CompareArguments& arguments)
{
  RunFiles files;
  files.add_output("--diff", arguments.diff);
  if (arguments.json != "-") files.add_output("--json", arguments.json);
  files.add_input("the picture to judge", arguments.a);
  files.add_input("the reference", arguments.b);
  for (const std::string& output : {arguments.diff, arguments.json}) {
    if (output != "-") check_writable(output);
  }
  const Picture a = exr_load(arguments.a), b = exr_load(arguments.b);
  if (window_text(a) != window_text(b)) {
    throw InputError(a.file, "is " + window_text(a) + ", but '" + b.file + "' is " + window_text(b));
  }
  const ImageView view_a = layer_or_throw(a, arguments.layer), view_b = layer_or_throw(b, arguments.layer);
  if (!has_same_channels(view_a, view_b)) {
    throw InputError(a.file, "its layer '" + arguments.layer + "' has other channels than that of '" + b.file + "'");
  }
  Comparison comparison;
  comparison.errors = image_errors(view_a, view_b);
  if (has_colors(view_a)) comparison.flip_mean = flip_mean(flip_map(view_a, view_b, arguments.flip));
  if (arguments.max_flip && !comparison.flip_mean) {
    throw InputError(a.file, "its layer '" + arguments.layer + "' has no colours, which FLIP needs");
  }
  if (arguments.wants_z_test) comparison.z_test = z_test_of_pictures(arguments, a, view_a, b, view_b);

  files.check_output("--diff", arguments.diff);
  if (arguments.json != "-") files.check_output("--json", arguments.json);
  if (!arguments.diff.empty()) difference_picture_write(arguments.diff, view_a, view_b, arguments.flip.exposure);
  const std::string json = metrics_json(a.file, b.file, comparison.errors, comparison.flip_mean, comparison.z_test);
  if (arguments.json == "-") {
    std::fputs(json.c_str(), stdout);
  } else {
    if (!arguments.json.empty()) atomic_write(arguments.json, json);
    print_comparison(arguments, comparison);
  }
  standard_output_flush();
  return is_acceptable(arguments, comparison) ? 0 : 1;
}

}  // namespace

void cmd_compare_register(CLI::App& app, std::function<int()>& run)
{
  CLI::App* command = app.add_subcommand("compare", "Measure how far picture A is from picture B, the reference");
  const auto arguments = std::make_shared<CompareArguments>();
  names_file(command->add_option("A", arguments->a, "Picture to judge"), {".exr"})->required();
  names_file(command->add_option("B", arguments->b, "Picture that is the reference"), {".exr"})->required();
  command->add_option("--layer", arguments->layer, "Layer to compare")->capture_default_str();
  names_file(
      command->add_option_function<std::string>(
          "--diff", [arguments](const std::string& text) { arguments->diff = parse_output("--diff", text, ".png"); },
          "PNG to write: A, B and their signed difference with its scale"),
      {".png"});
  command->add_option("--max-rmse", arguments->max_rmse, "Fail (exit code 1) above this RMSE");
  command->add_option("--max-relmse", arguments->max_relmse, "Fail above this mean of (a-b)^2 / (b^2 + 0.01)");
  command->add_option("--max-flip", arguments->max_flip, "Fail above this mean FLIP error");
  command->add_option("--exposure", arguments->flip.exposure, "Stops, for FLIP and --diff")->capture_default_str();
  command->add_option("--pixels-per-degree", arguments->flip.pixels_per_degree, "Viewing distance, for FLIP")
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  command->add_flag("--z-test", arguments->wants_z_test,
                    "Fail unless both are estimates of the same image, judged by their variance layers");
  command->add_option("--significance", arguments->z_test.significance, "Rate of false alarms of the z-test")
      ->check(CLI::Range(1e-12, 0.5))
      ->capture_default_str();
  command->add_option("--z-floor", arguments->z_test.variance_floor, "Least variance of a difference, for the z-test")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--z-outliers", arguments->z_test.allowed_outliers,
                   "Fraction of pixels that may fail the z-test of single pixels")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str();
  names_file(command->add_option("--json", arguments->json,
                                 "Write the figures to this file as JSON; -: to standard output, instead of text"),
             {".json"});
  add_max_memory(*command);
  command->callback([arguments, &run] { run = [arguments] { return compare_run(*arguments); }; });
}

}  // namespace relief
