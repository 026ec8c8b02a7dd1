#include "displacement/displacement_choice.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <unistd.h>

#include "displacement/picture_share.h"

namespace relief {

namespace {

bool is_whole(float x) { return x == std::floor(x); }

/// With fewer texels than this along a triangle's side a map has little left to show; levels beyond would only widen the
/// prisms.
constexpr double kLeastTexelsASide = 16;

/// Levels that rays may choose by themselves lose no more of the surface's slopes than this, metres a metre, nor move a
/// point further than this many of their texels: half a pixel, since texels are a quarter as wide as that. A picture's
/// mean then changes by a fortieth of the slope's square at most (docs/displacement.md), .3 %.
constexpr double kMostSlopeLost = 1.0 / 3;
constexpr double kMostTexelsLost = 2;

RmipOptionsUse rmip_options_use(DisplacementMethod method)
{
  return method != DisplacementMethod::kAuto ? displacement_method(method).rmip_options : RmipOptionsUse::kNone;
}

}  // namespace

DisplacementMethod asked_method(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  return options.method.value_or(settings.method);
}

float lod_of(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  return options.lod.value_or(settings.lod);
}

std::string gibibytes(std::uint64_t bytes)
{
  char text[32];
  std::snprintf(text, sizeof text, "%.1f GiB", static_cast<double>(bytes) / (1 << 30));
  return text;
}

std::uint64_t memory_of_machine()
{
  return static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

std::uint64_t dicing_allowance(const DisplacementOptions& options)
{
  return options.auto_bytes > 0     ? options.auto_bytes
         : options.dicing_bytes > 0 ? options.dicing_bytes
                                    : memory_of_machine() / 8;
}

std::optional<TessellationKind> tessellation_kind(DisplacementMethod method)
{
  return method == DisplacementMethod::kAuto ? std::nullopt : displacement_method(method).tessellation;
}

bool blends_levels(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  const float lod = lod_of(settings, options);
  return rmip_options_use(asked_method(settings, options)) == RmipOptionsUse::kAll && options.rmip &&
         options.rmip->levels == RmipLevels::kInterpolated && lod > 0 && !is_whole(lod);
}

std::vector<std::string> displacement_warnings(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  std::vector<std::string> texts;
  const float lod = lod_of(settings, options);
  const DisplacementMethod asked = asked_method(settings, options);
  if (displacement_is_computed(settings)) {
    const std::string of_maps = settings.by_vectors ? " has no effect on displacement by vectors"
                                                    : " has no effect on heights that are computed";
    if (asked != DisplacementMethod::kAuto && asked != kDefaultMethod)
      texts.push_back("displacement method '" + std::string(displacement_method_label(asked)) + "'" + of_maps);
    if (lod > 0) texts.push_back("a level of detail" + of_maps);
    return texts;
  }
  if (tessellation_kind(asked) && lod > 0 && !is_whole(lod)) {
    texts.push_back("tessellations have whole levels of detail; level " + std::to_string(static_cast<int>(lod)) +
                    " is used");
  }
  const RmipOptionsUse use = rmip_options_use(asked);
  const std::string_view without_effect = use == RmipOptionsUse::kNone ? "options" : "options but 'bounds'";
  const bool is_obeyed = use == RmipOptionsUse::kAll || (use == RmipOptionsUse::kBounds && options.rmip &&
                                                         *options.rmip == RmipOptions{.bounds = options.rmip->bounds});
  if (options.rmip && !is_obeyed) {
    texts.push_back(std::string(without_effect) + " of RMIP have no effect on displacement method '" +
                    std::string(displacement_method_label(asked)) + "'");
  } else if (options.rmip && options.rmip->levels == RmipLevels::kInterpolated && !blends_levels(settings, options)) {
    texts.push_back(std::string("RMIP interpolates only between levels of detail that are fixed, such as 1.5; ") +
                    (lod < 0 ? "those that rays choose by their cones are mixed" : "a whole level is traced as it is"));
  }
  return texts;
}

DisplacementMethod DisplacementSet::method_of(const Use& use, const DisplacementOptions& options) const
{
  const DisplacementMethod asked = asked_method(use.settings, options);
  return !use.steps.empty() && tessellation_kind(asked) ? kDefaultMethod : asked;
}

/// Says what is not done with a mesh that deforms.
void DisplacementSet::leave_untessellated(const Use& use, const DisplacementOptions& options)
{
  const DisplacementMethod asked = asked_method(use.settings, options);
  if (has_error(use, options)) {
    reasons_.push_back("mesh '" + use.mesh_name + "': not diced, as it deforms while the shutter is open");
  } else if (tessellation_kind(asked)) {
    unfollowed_.push_back("mesh '" + use.mesh_name + "' deforms while the shutter is open, and is traced by method '" +
                          std::string(displacement_method_label(kDefaultMethod)) + "': tessellations are of one time");
  }
}

bool DisplacementSet::has_error(const Use& use, const DisplacementOptions& options) const
{
  return options.error > 0 && options.camera && use.heights == nullptr && !(lod_of(use.settings, options) > 0) &&
         method_of(use, options) == DisplacementMethod::kAuto;
}

int DisplacementSet::num_useful_levels(const Use& use) const
{
  const HeightMapView& map = map_of(use).view;
  double side = mean_texels_a_side(use.mesh, use.settings.height, map.width, map.height);
  int count = 1;
  // Levels of the map end too: with one texel it is a constant.
  for (int texels = std::max(map.width, map.height); side >= 2 * kLeastTexelsASide && texels > 2; side /= 2) {
    texels = (texels + 1) / 2;
    ++count;
  }
  return count;
}

DisplacementSet::Levels DisplacementSet::levels_of(const Use& use, const DisplacementOptions& options) const
{
  constexpr float kCoarsest = kMaxLodLevels - 1;
  const float lod = lod_of(use.settings, options);
  const bool tessellates = tessellation_kind(method_of(use, options)).has_value();
  Levels levels;
  if (lod >= 0) {
    levels.first = static_cast<int>(std::min(lod, kCoarsest));
    if (tessellates) return levels;
    const bool is_one_surface = !use.has_borders || blends_levels(use.settings, options);
    levels.fixed = is_one_surface ? std::min(lod, kCoarsest) - static_cast<float>(levels.first) : 0.0f;
    levels.count = levels.fixed > 0 ? 2 : 1;
  } else if (!tessellates) {
    levels.count = use.has_borders ? 1 : num_useful_levels(use);
    levels.by_cone = levels.count > 1;
  }
  return levels;
}

int DisplacementSet::num_faithful_levels(const Use& use, int most)
{
  const TextureRef& mapping = use.settings.height;
  const double scale = std::abs(use.scale);
  const MapDensity density = map_density(use.mesh, mapping);
  const HeightFields::Map& map = map_of(use);
  const double texel = 1 / std::sqrt(std::max(density.u * map.view.width * density.v * map.view.height, 1e-300));
  LevelLoss lost;
  for (int k = 1; k < most; ++k) {
    const bool is_new = !fields_->has(map, k);
    lost = lost + fields_->loss(map, k);
    const double slope = use.steepening * scale * (lost.slope_u * density.u + lost.slope_v * density.v);
    const double texels = scale * lost.height / (texel * (1 << k));
    if (slope <= kMostSlopeLost && texels <= kMostTexelsLost) continue;
    if (is_new) fields_->drop(map, k);
    return k;
  }
  return most;
}

/// @pre  there is a camera
PictureView DisplacementSet::picture_view(const Use& use, const DisplacementOptions& options)
{
  return {*options.camera, static_cast<double>(options.picture_height),
          static_cast<double>(use.settings.coarser_outside)};
}

/// About which part of a picture's rays meet each use; 1 without a camera. Where together they would cover more than the picture, they
/// hide one another.
std::vector<double> DisplacementSet::shares_of(std::span<const Use> uses, const DisplacementOptions& options)
{
  std::vector<double> shares(uses.size(), 1.0);
  if (!options.camera || options.picture_height <= 0) return shares;
  double sum = 0;
  for (std::size_t k = 0; k < uses.size(); ++k) {
    // What is not in the picture is met by bounced light alone. (Not measured: it is diced so coarsely that little pays.)
    constexpr double kBounced = 1.0 / 16;
    const PictureView view = picture_view(uses[k], options);
    const double seen = picture_share(uses[k].mesh, uses[k].places, view);
    shares[k] = seen > 0 ? seen : kBounced * box_share(uses[k].mesh, uses[k].places, view);
    sum += shares[k];
  }
  for (double& share : shares) share /= std::max(sum, 1.0);
  return shares;
}

}  // namespace relief
