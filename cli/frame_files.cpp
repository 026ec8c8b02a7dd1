#include "cli/frame_files.h"

#include <exception>
#include <new>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "exporters/atomic_file.h"
#include "exporters/errors.h"
#include "exporters/exr_state.h"
#include "exporters/stats_json.h"

namespace relief {

namespace {

/// The film without the layers that only a denoiser wanted.
FilmView asked_layers(FilmView film, AovMask aov_mask)
{
  for (std::size_t i = 0; i < film.layout.offset.size(); ++i) {
    if (!aov_is_in(static_cast<Aov>(i), aov_mask)) film.layout.offset[i] = -1;
  }
  return film;
}

/// What the PNG shows: the beauty, denoised if it was.
ImageView shown(const FilmView& film, const DenoisedPicture* denoised)
{
  ImageView view = film_layer(film, Aov::kBeauty);
  if (denoised == nullptr) return view;
  ImageView color = denoised->beauty(film.height);
  color.channels.push_back(view.channels[3]);
  return color;
}

}  // namespace

Attributes FrameFiles::attributes_of(const Statistics& stats) const
{
  Attributes attributes = exr_attributes(stats, command_);
  attributes.insert(camera_.begin(), camera_.end());
  return attributes;
}

void FrameFiles::write_preview(int frame, const FilmView& film, double samples)
{
  if (!shows_previews_) return;
  try {
    files_.check_output("--preview", paths_.preview);
    exr_write(paths_.preview, film, {{"relief:samples", fmt::format("{:g}", samples)}}, {ExrCompression::kNone, true, exr_.color_space});
  } catch (const OutputError& error) {
    progress_.warnings({fmt::format("no more previews: {}", error.what())});
    shows_previews_ = false;
    return;
  }
  progress_.event({{"event", "preview"}, {"frame", frame}, {"output", paths_.preview.string()}, {"samples", samples}});
}

void FrameFiles::write_checkpoint(const RenderState& state,
                                  std::span<const float> sums,
                                  const FilmView& film,
                                  Statistics stats,
                                  const std::string& fingerprint) const
{
  files_.check_output("--output", paths_.exr);
  stats.stop_reason = "interrupted";
  try {
    exr_write(paths_.exr, film, attributes_of(stats), {ExrCompression::kNone, exr_.float_color, exr_.color_space},
              {state, sums, fingerprint});
  } catch (const OutputError& error) {
    progress_.warnings({fmt::format("a checkpoint could not be written: {}", error.what())});
    return;
  } catch (const std::bad_alloc&) {
    progress_.warnings({fmt::format("a checkpoint could not be written: {}: out of memory", paths_.exr.string())});
    return;
  }
  progress_.event({{"event", "checkpoint"},
                   {"frame", stats.frame},
                   {"output", paths_.exr.string()},
                   {"samples", stats.samples_per_pixel}});
}

void FrameFiles::write(const RenderedImage& image,
                       const DenoisedPicture* denoised,
                       const Statistics& stats,
                       const Attributes& cryptomattes,
                       const PngOptions& png,
                       const std::function<std::string(const Attributes&)>& page,
                       const std::string& fingerprint,
                       bool is_whole) const
{
  Attributes attributes = attributes_of(stats);
  std::exception_ptr failure;
  try {
    files_.check_output("--png", paths_.png);
    if (!paths_.png.empty()) png_write(paths_.png, shown(image.view, denoised), png);
    files_.check_output("--stats", paths_.stats);
    if (!paths_.stats.empty()) atomic_write(paths_.stats, stats_json(stats));
    files_.check_output("--report", paths_.report);
    if (!paths_.report.empty()) atomic_write(paths_.report, page(attributes));
  } catch (...) {
    failure = std::current_exception();
  }
  attributes.insert(cryptomattes.begin(), cryptomattes.end());
  if (is_whole && !failure) attributes.merge(frame_attributes(paths_, fingerprint));
  if (denoised != nullptr) attributes.merge(denoised->attributes());
  const std::vector<ChannelView> more = denoised != nullptr ? denoised->channels() : std::vector<ChannelView>();
  const FilmView film = asked_layers(image.view, aov_mask_);
  files_.check_output("--output", paths_.exr);
  if (image.saved) {
    exr_write(paths_.exr, film, attributes, exr_, {image.saved->state, image.saved->sums, fingerprint}, more);
  } else {
    exr_write(paths_.exr, film, attributes, exr_, more);
  }
  if (!failure) return;
  progress_.note(fmt::format("{}: saved, but not all files of its frame could be", paths_.exr.string()));
  std::rethrow_exception(failure);
}

}  // namespace relief
