#include "benchmarks/error/study.h"

#include <atomic>
#include <exception>
#include <filesystem>
#include <limits>

#include <fmt/format.h>

#include "exporters/errors.h"
#include "exporters/exr.h"
#include "exporters/image_metrics.h"
#include "integrator/scene_context.h"
#include "scene/load.h"

namespace relief {

namespace {

constexpr int kMostSamples = 1 << 16;

/// One way to render a scene.
struct Choice {
  std::string name;
  RenderOptions options;
};

std::string level_text(float level) { return level < 0 ? "auto" : fmt::format("{:g}", level); }

/// All ways that differ for a scene.
std::vector<Choice> choices_of(const ErrorStudyOptions& study, const Scene& scene, const RenderOptions& base)
{
  std::vector<Choice> choices = {{"", base}};
  // Each choice so far becomes one for each value; a single value goes without saying.
  const auto multiply = [&](const auto& values, const auto& set) {
    if (values.empty()) return;
    std::vector<Choice> more;
    for (const Choice& choice : choices) {
      for (const auto& value : values) {
        Choice next = choice;
        const std::string label = set(next.options, value);
        if (values.size() > 1) next.name += (next.name.empty() ? "" : ", ") + label;
        more.push_back(std::move(next));
      }
    }
    choices = std::move(more);
  };
  if (!scene.displacements.empty()) {
    multiply(study.methods, [](RenderOptions& o, DisplacementMethod method) {
      o.displacement.method = method;
      return std::string(displacement_method_label(method));
    });
    multiply(study.levels, [](RenderOptions& o, float level) {
      o.displacement.lod = level;
      return "level " + level_text(level);
    });
  }
  RenderOptions with_photons = base;
  with_photons.settings.caustics.mode = CausticsMode::kOn;
  if (render_context(scene, with_photons).globals.caustics.enabled) {
    multiply(study.caustics, [](RenderOptions& o, CausticsMode mode) {
      o.settings.caustics.mode = mode;
      return "caustics " + std::string(kCausticsModeLabels[static_cast<std::size_t>(mode)]);
    });
  }
  multiply(study.lights, [](RenderOptions& o, LightTechnique technique) {
    o.light_technique = technique;
    return std::string(kLightTechniqueLabels[static_cast<std::size_t>(technique)]);
  });
  if (choices.size() == 1) choices.front().name = "relief";
  return choices;
}

/// A picture to judge by, in the form of a view.
struct Reference {
  RenderedImage rendered;
  std::optional<Picture> given;
  double samples = 0, rmse = std::numeric_limits<double>::quiet_NaN();

  ImageView view() const
  {
    ImageView colors = given ? picture_layer(*given, "") : film_layer(rendered.view, Aov::kBeauty);
    colors.channels.resize(3);
    return colors;
  }
};

/// Nobody ends a render: what was measured before is told meanwhile.
const std::atomic<bool> kNeverStop{false};

Reference reference_make(const ErrorStudyOptions& study, const Scene& scene, RenderOptions options)
{
  Reference reference;
  if (study.reference) {
    reference.given = study.reference;
    const ImageView colors = picture_layer(*study.reference, "");
    if (colors.channels.size() < 3 || colors.width != options.settings.width ||
        colors.height != options.settings.height) {
      throw InputError(study.reference->file, fmt::format("expected red, green and blue of {}x{} pixels, found {} "
                                                          "channels of {}x{}",
                                                          options.settings.width, options.settings.height,
                                                          colors.channels.size(), colors.width, colors.height));
    }
    return reference;
  }
  // Another seed: samples that both have would look like agreement.
  ++options.settings.seed;
  options.settings.samples = kMostSamples;
  options.time_limit_seconds = study.reference_seconds;
  options.displacement.lod = 0;
  options.settings.caustics.mode = CausticsMode::kAuto;
  Statistics stats;
  reference.rendered = render(scene, options, kNeverStop, {}, stats);
  reference.samples = stats.samples_per_pixel;
  reference.rmse = stats.error_rmse;
  return reference;
}

ErrorMeasurement measured(const ImageView& picture, const ImageView& reference, double samples, double seconds)
{
  ImageView colors = picture;
  colors.channels.resize(3);
  const ImageErrors errors = image_errors(colors, reference);
  return {samples, seconds, errors.rmse, errors.relmse};
}

/// Results that grow, and who is told.
struct Log {
  const ErrorStudyOptions& study;
  ErrorStudyResults results;
};

/// Renders with four times the samples each, until one has taken as long as the last time. A line needs a few points anyway.
template <class Render>
void series_measure(Log& log, std::string name, Render render_with)
{
  const ErrorStudyOptions& study = log.study;
  ErrorSeries& series = log.results.scenes.back().series.emplace_back();
  series.name = std::move(name);
  for (int samples = 1; samples <= kMostSamples; samples *= 4) {
    series.points.push_back(render_with(samples, series.preparation_seconds));
    if (study.measured) study.measured(log.results);
    constexpr std::size_t kFewestPoints = 3;
    if (series.points.size() >= kFewestPoints && series.points.back().seconds >= study.times.back()) break;
  }
}

void choice_measure(Log& log, const Scene& scene, const Choice& choice, const ImageView& reference)
{
  series_measure(log, choice.name, [&](int samples, double& preparation) {
    RenderOptions options = choice.options;
    options.settings.samples = samples;
    Statistics stats;
    const RenderedImage image = render(scene, options, kNeverStop, {}, stats);
    preparation = stats.build_seconds;
    return measured(film_layer(image.view, Aov::kBeauty), reference, samples, stats.render_seconds);
  });
}

void other_measure(Log& log, const OtherRenderer& other, const std::string& scene, const ImageView& reference)
{
  const std::string output = (std::filesystem::path(log.study.scratch) / "picture.exr").string();
  series_measure(log, other.name, [&](int samples, double& preparation) {
    const OtherRenderer::Seconds seconds = other.render(scene, reference.width, reference.height, samples, output);
    preparation = seconds.preparation;
    const Picture picture = exr_load(output);
    const ImageView colors = picture_layer(picture, "");
    if (colors.channels.size() < 3 || colors.width != reference.width || colors.height != reference.height) {
      throw InputError(output, fmt::format("expected red, green and blue of {}x{} pixels, which {} should have written",
                                           reference.width, reference.height, other.name));
    }
    return measured(colors, reference, samples, seconds.sampling);
  });
}

}  // namespace

ErrorStudyResults error_study_run(const ErrorStudyOptions& study)
{
  Log log{study, {study.times, {}}};
  const auto say = [&](const std::string& line) {
    if (study.progress) study.progress(line);
  };
  for (const std::string& file : study.scenes) {
    const Scene scene = scene_load(file);
    const RenderOptions base = study.render_options(scene);
    say(file + ": reference");
    const Reference reference = reference_make(study, scene, base);
    ErrorSceneResult& result = log.results.scenes.emplace_back();
    result.scene = std::filesystem::path(file).stem().string();
    result.width = base.settings.width;
    result.height = base.settings.height;
    result.reference_samples = reference.samples;
    result.reference_rmse = reference.rmse;
    for (const Choice& choice : choices_of(study, scene, base)) {
      say(file + ": " + choice.name);
      choice_measure(log, scene, choice, reference.view());
    }
    for (const OtherRenderer& other : study.others) {
      say(file + ": " + other.name);
      // Another renderer need not know what a scene has; that must not cost what was measured so far.
      try {
        other_measure(log, other, file, reference.view());
      } catch (const std::exception& error) {
        result.series.pop_back();
        result.failures.push_back(other.name + ": " + error.what());
      }
    }
  }
  return std::move(log.results);
}

}  // namespace relief
