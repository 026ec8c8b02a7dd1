// Speed against error: every scene rendered in every way, with more and more samples, and judged by one reference.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "benchmarks/error/series.h"
#include "exporters/picture.h"
#include "integrator/render.h"

namespace relief {

/// A renderer of another program.
struct OtherRenderer {
  struct Seconds {
    double sampling = 0, preparation = 0;
  };
  std::string name;
  /// Renders a scene's file to an OpenEXR file with so many samples a pixel. @error std::runtime_error
  std::function<Seconds(const std::string& scene, int width, int height, int samples, const std::string& output)>
      render;
};

struct ErrorSceneResult {
  std::string scene;
  int width = 0, height = 0;
  double reference_samples = 0;  ///< a pixel; 0: it was given
  double reference_rmse = 0;     ///< estimated error of the reference itself; NaN: not known
  std::vector<ErrorSeries> series;
  std::vector<std::string> failures;  ///< of other renderers, which are then missing
};

struct ErrorStudyResults {
  std::vector<double> times;
  std::vector<ErrorSceneResult> scenes;
};

struct ErrorStudyOptions {
  std::vector<std::string> scenes;  ///< files
  /// Ways to render are all combinations of these. What makes no difference to a scene is left out.
  std::vector<DisplacementMethod> methods;  ///< empty: the scene's
  std::vector<float> levels;                ///< as DisplacementOptions::lod
  std::vector<CausticsMode> caustics;
  std::vector<LightTechnique> lights;
  std::vector<OtherRenderer> others;
  std::vector<double> times;         ///< seconds, rising: errors are told at these; none is sampled for much longer
  std::optional<Picture> reference;  ///< of the only scene; empty: rendered
  double reference_seconds = 0;      ///< of sampling
  std::function<RenderOptions(const Scene&)> render_options;  ///< of a scene, whatever the way
  std::string scratch;                                        ///< folder for pictures of others
  std::function<void(const std::string&)> progress;           ///< empty: none
  std::function<void(const ErrorStudyResults&)> measured;     ///< gets all that there is, after each render; empty: none
};

/// Names of ways to sample lights in the order of LightTechnique.
inline constexpr std::string_view kLightTechniqueLabels[] = {"mis", "lights", "surfaces"};

/// @error SceneError; InputError if the reference does not fit
ErrorStudyResults error_study_run(const ErrorStudyOptions& options);
std::string error_study_markdown(const ErrorStudyResults& results);
std::string error_study_json(const ErrorStudyResults& results);
std::string error_study_html(const ErrorStudyResults& results);

}  // namespace relief
