// Writing the files of one frame: what it is as long as it is rendered, and what it has become.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <utility>

#include "cli/denoise_picture.h"
#include "cli/fingerprint.h"
#include "cli/progress_printer.h"
#include "cli/run_files.h"
#include "exporters/exr.h"
#include "exporters/png_ocio.h"
#include "integrator/render.h"

namespace relief {

class FrameFiles {
 public:
  /// All but the text must outlive it.
  /// @param files    of the run, to look once more before each is written
  /// @param command  the command line
  /// @param aov_mask  layers that the OpenEXR has
  /// @param camera    attributes of the OpenEXR that tell it
  FrameFiles(const RunFiles& files,
             const FramePaths& paths,
             std::string command,
             ExrOptions exr,
             AovMask aov_mask,
             Attributes camera,
             ProgressPrinter& progress)
      : files_(files),
        paths_(paths),
        command_(std::move(command)),
        exr_(exr),
        aov_mask_(aov_mask),
        camera_(std::move(camera)),
        progress_(progress)
  {
  }

  /// Writes the picture as it is while it is rendered, uncompressed, as it does not last, and tells whoever waits for it. If it
  /// cannot be written a warning says why, and there are no more.
  void write_preview(int frame, const FilmView& film, double samples);

  /// Writes the picture as it is with what the render goes on from. If it cannot be written a warning says why; an older one stays.
  /// @param fingerprint  of what decides the frame
  void write_checkpoint(const RenderState& state,
                        std::span<const float> sums,
                        const FilmView& film,
                        Statistics stats,
                        const std::string& fingerprint) const;

  /// Writes the frame's files, the OpenEXR last: its fingerprint says that all of them are there and whole. It is written even
  /// if another file cannot be, since it is worth the most; then without the fingerprint.
  /// @param denoised  null: nothing was
  /// @param page      makes the HTML page about the frame, given the OpenEXR's attributes
  /// @param is_whole  false: it was interrupted, or may be of files that changed; nobody is to take it for the frame
  /// @error OutputError of the first file that could not be written
  void write(const RenderedImage& image,
             const DenoisedPicture* denoised,
             const Statistics& stats,
             const Attributes& cryptomattes,
             const PngOptions& png,
             const std::function<std::string(const Attributes&)>& page,
             const std::string& fingerprint,
             bool is_whole) const;

 private:
  Attributes attributes_of(const Statistics& stats) const;

  const RunFiles& files_;
  const FramePaths& paths_;
  std::string command_;
  ExrOptions exr_;
  AovMask aov_mask_;
  Attributes camera_;
  ProgressPrinter& progress_;
  bool shows_previews_ = true;
};

}  // namespace relief
