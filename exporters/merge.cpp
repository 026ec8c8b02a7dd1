#include "exporters/merge.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <sstream>
#include <utility>

#include "exporters/errors.h"
#include "exporters/exr.h"
#include "exporters/sample_range.h"
#include "scene/cryptomatte.h"
#include "scene/memory.h"

namespace relief {

namespace {

constexpr const char* kSamplesChannel = "samples.N";

/// How a channel of several renders becomes one.
enum class Rule { kMean, kMeanOverHits, kHalf, kVariance, kSum, kFirst };

Rule rule_of(const std::string& channel)
{
  const std::size_t dot = channel.rfind('.');
  const std::string layer = dot == std::string::npos ? "" : channel.substr(0, dot);
  for (const AovInfo& info : kAovInfo) {
    if (layer != info.name) continue;
    switch (info.aov) {
      case Aov::kDepth:
      case Aov::kPosition:
        return Rule::kMeanOverHits;
      case Aov::kHalf:
      case Aov::kDenoisingHalf:
        return Rule::kHalf;
      case Aov::kVariance:
        return Rule::kVariance;
      case Aov::kSampleCount:
        return Rule::kSum;
      case Aov::kObjectId:
      case Aov::kMaterialId:
        return Rule::kFirst;
      default:
        return Rule::kMean;
    }
  }
  return Rule::kMean;
}

/// Whether a channel is one of a Cryptomatte's.
bool is_cryptomatte(std::string_view channel)
{
  for (int i = 0; i < kNumCryptomattes; ++i) {
    const std::string_view layer = cryptomatte_layer(i);
    if (!channel.starts_with(layer)) continue;
    const std::string_view rest = channel.substr(layer.size());
    if (rest.size() > 2 && rest[2] == '.') return true;
  }
  return false;
}

/// Why a channel has no place among merged ones; empty: it has.
std::string reason_to_leave_out(std::string_view channel)
{
  if (is_cryptomatte(channel)) return "ids have no mean";
  const bool is_denoised = channel.starts_with("denoised.") || channel.starts_with("denoised_error.");
  return is_denoised ? "denoise the merged picture, which has less noise" : "";
}

std::string attribute_of(const Picture& picture, const std::string& name)
{
  const auto found = picture.attributes.find(name);
  return found == picture.attributes.end() ? std::string() : found->second;
}

std::optional<double> number_of(const Picture& picture, const std::string& name)
{
  const std::string text = attribute_of(picture, name);
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::vector<std::string> list_of(const Picture& picture, const std::string& attribute)
{
  std::vector<std::string> words;
  std::istringstream text(attribute_of(picture, attribute));
  for (std::string word; std::getline(text, word, ',');) words.push_back(word);
  return words;
}

/// Samples that a picture is made of.
struct SampleOrigin {
  std::string seed, file;
  std::optional<SampleRange> range;  ///< nothing: all of the seed
};

constexpr const char* kAllSamples = "all";

/// Where a picture's samples are from, several places if it is itself a merge.
std::vector<SampleOrigin> origins_of(const Picture& picture)
{
  const std::vector<std::string> seeds = list_of(picture, "relief:seed");
  const std::vector<std::string> ranges = list_of(picture, "relief:sample_ranges");
  if (!ranges.empty() && ranges.size() != seeds.size()) {
    throw InputError(picture.file, "has another number of relief:sample_ranges than of relief:seed");
  }
  std::vector<SampleOrigin> origins;
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    origins.push_back({seeds[i], picture.file, std::nullopt});
    if (ranges.empty() || ranges[i] == kAllSamples) continue;
    origins.back().range = sample_range_parse(ranges[i]);
    if (!origins.back().range) {
      throw InputError(picture.file, "expected relief:sample_ranges such as 16-32/64, found '" + ranges[i] + "'");
    }
  }
  return origins;
}

/// The pair of ranges of one seed of which the second continues the first; nothing if there is none.
std::optional<std::pair<std::size_t, std::size_t>> continued_range(const std::vector<SampleOrigin>& origins)
{
  for (std::size_t i = 0; i < origins.size(); ++i) {
    for (std::size_t k = 0; k < origins.size(); ++k) {
      const SampleOrigin &a = origins[i], &b = origins[k];
      if (a.seed == b.seed && a.range && b.range && a.range->end == b.range->first) return std::pair(i, k);
    }
  }
  return std::nullopt;
}

/// Puts such ranges together. What then is all that was planned counts as any render of that seed.
void join_ranges(std::vector<SampleOrigin>& origins)
{
  while (const auto pair = continued_range(origins)) {
    origins[pair->first].range->end = origins[pair->second].range->end;
    origins.erase(origins.begin() + static_cast<std::ptrdiff_t>(pair->second));
  }
  for (SampleOrigin& origin : origins) {
    if (origin.range && origin.range->is_all()) origin.range.reset();
  }
}

/// Sums over the pictures so far.
class Merger {
 public:
  explicit Merger(const MergeOptions& options) : options_(options) {}

  void add(const Picture& picture)
  {
    check_finished(picture);
    check_same_image(picture);
    check_seeds(picture);
    drop_missing_layers(picture);
    add_values(picture);
    add_attributes(picture);
    ++num_pictures_;
  }

  MergeResult finish();

 private:
  struct Sum {
    std::string name;
    ChannelType type = ChannelType::kFloat;
    Rule rule = Rule::kMean;
    std::vector<double> value;
    std::vector<double> weight;  ///< only for kMeanOverHits, whose weight is its own
  };

  static void check_finished(const Picture& picture);
  static void require_memory(const Picture& picture, std::size_t num_pixels);
  void check_same_image(const Picture& picture);
  void check_seeds(const Picture& picture);
  void warn_left_out(const std::string& channel, const std::string& why);
  void drop_missing_layers(const Picture& picture);
  void add_values(const Picture& picture);
  void add_attributes(const Picture& picture);
  std::vector<double> sample_counts(const Picture& picture) const;
  [[noreturn]] void refuse(const Picture& picture, const std::string& why) const
  {
    throw InputError(picture.file, "cannot be merged with '" + result_.file + "': " + why);
  }

  MergeOptions options_;
  int num_pictures_ = 0;
  Picture result_;  ///< windows and attributes; its channels are made at the end
  std::vector<Sum> sums_;
  std::vector<double> num_samples_, num_even_samples_;
  std::vector<SampleOrigin> origins_;
  double samples_ = 0, seconds_ = 0, weighted_square_error_ = 0;
  bool knows_error_ = true;
  std::vector<std::string> warnings_;
};

void Merger::check_finished(const Picture& picture)
{
  if (attribute_of(picture, "relief:stop_reason") != "interrupted" || picture.find(kSamplesChannel) != nullptr) return;
  // Some tiles may have had no sample yet: what is black there would count as much as the rest.
  throw InputError(picture.file, "is of a render that is not finished, and has no layer samples.N to weight it by");
}

/// Of all sums, which are twice as large as the pictures.
void Merger::require_memory(const Picture& picture, std::size_t num_pixels)
{
  // The pixels' samples: all, the even-numbered ones, and those of one picture.
  std::size_t num_values = 3;
  for (const Channel& channel : picture.channels) {
    if (!reason_to_leave_out(channel.name).empty()) continue;
    num_values += rule_of(channel.name) == Rule::kMeanOverHits ? 2 : 1;
  }
  memory_require(std::uint64_t{num_values} * num_pixels * sizeof(double), picture.file + ": the sums of its layers");
}

void Merger::check_same_image(const Picture& picture)
{
  if (num_pictures_ == 0) {
    result_.file = picture.file;
    result_.width = picture.width;
    result_.height = picture.height;
    result_.crop_x = picture.crop_x;
    result_.crop_y = picture.crop_y;
    result_.full_width = picture.full_width;
    result_.full_height = picture.full_height;
    result_.attributes = picture.attributes;
    std::erase_if(result_.attributes, [](const auto& entry) { return entry.first.starts_with("cryptomatte/"); });
    const std::size_t num_pixels = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
    require_memory(picture, num_pixels);
    num_samples_.assign(num_pixels, 0);
    num_even_samples_.assign(num_pixels, 0);
    for (const Channel& channel : picture.channels) {
      if (const std::string reason = reason_to_leave_out(channel.name); !reason.empty()) {
        warn_left_out(channel.name, reason);
        continue;
      }
      const Rule rule = rule_of(channel.name);
      sums_.push_back({channel.name, channel.type, rule, std::vector<double>(num_pixels),
                       std::vector<double>(rule == Rule::kMeanOverHits ? num_pixels : 0)});
    }
    return;
  }
  const auto size_text = [](const Picture& p) {
    return std::to_string(p.width) + "x" + std::to_string(p.height) + " at " + std::to_string(p.crop_x) + "," +
           std::to_string(p.crop_y) + " of " + std::to_string(p.full_width) + "x" + std::to_string(p.full_height);
  };
  if (size_text(picture) != size_text(result_)) {
    refuse(picture, "its window is " + size_text(picture) + ", not " + size_text(result_));
  }
  if (options_.force) return;
  for (const char* name : {"relief:scene", "relief:frame"}) {
    const std::string here = attribute_of(picture, name), there = attribute_of(result_, name);
    if (here != there) refuse(picture, std::string(name) + " is '" + here + "', not '" + there + "'");
  }
}

void Merger::check_seeds(const Picture& picture)
{
  const std::vector<SampleOrigin> origins = origins_of(picture);
  if (origins.empty() && !options_.force) {
    throw InputError(picture.file, "has no attribute relief:seed, so its samples may be those of another file");
  }
  for (const SampleOrigin& origin : origins) {
    for (const SampleOrigin& known : origins_) {
      if (known.seed != origin.seed) continue;
      const std::string same = "has the same seed, " + origin.seed + ", as '" + known.file + "': ";
      if (!origin.range || !known.range) throw InputError(picture.file, same + "the same samples twice");
      if (origin.range->of != known.range->of) {
        throw InputError(picture.file, same + "parts of " + std::to_string(origin.range->of) + " and of " +
                                           std::to_string(known.range->of) + " samples, which are in different order");
      }
      if (origin.range->first < known.range->end && known.range->first < origin.range->end) {
        throw InputError(picture.file, same + "some samples twice, " + sample_range_text(*origin.range) + " and " +
                                           sample_range_text(*known.range));
      }
    }
  }
  origins_.insert(origins_.end(), origins.begin(), origins.end());
}

void Merger::warn_left_out(const std::string& channel, const std::string& why)
{
  const std::size_t dot = channel.rfind('.');
  const std::string what = dot == std::string::npos ? "channel '" + channel : "layer '" + channel.substr(0, dot);
  const std::string start = what + "' is left out: ";
  const auto is_said = [&](const std::string& text) { return text.starts_with(start); };
  if (std::any_of(warnings_.begin(), warnings_.end(), is_said)) return;
  warnings_.push_back(start + why);
}

void Merger::drop_missing_layers(const Picture& picture)
{
  const auto warn = [&](const std::string& channel, const std::string& poorer_file) {
    warn_left_out(channel, "'" + poorer_file + "' does not have it");
  };
  std::erase_if(sums_, [&](const Sum& sum) {
    if (picture.find(sum.name) != nullptr) return false;
    warn(sum.name, picture.file);
    return true;
  });
  for (const Channel& channel : picture.channels) {
    const auto is_kept = [&](const Sum& sum) { return sum.name == channel.name; };
    if (!reason_to_leave_out(channel.name).empty()) continue;
    if (std::none_of(sums_.begin(), sums_.end(), is_kept)) warn(channel.name, result_.file);
  }
}

std::vector<double> Merger::sample_counts(const Picture& picture) const
{
  if (const Channel* counts = picture.find(kSamplesChannel)) {
    std::vector<double> result(counts->values.begin(), counts->values.end());
    for (double& n : result) {
      if (!(n >= 0) || !std::isfinite(n)) throw InputError(picture.file, "has impossible values in samples.N");
    }
    return result;
  }
  const std::optional<double> samples = number_of(picture, "relief:samples");
  if (!samples || !(*samples > 0)) {
    throw InputError(picture.file, "has neither a layer samples.N nor an attribute relief:samples to weight it by");
  }
  return std::vector<double>(num_samples_.size(), *samples);
}

void Merger::add_values(const Picture& picture)
{
  const std::vector<double> n = sample_counts(picture);
  const Channel* coverage = picture.find("A");
  for (Sum& sum : sums_) {
    const std::vector<float>& x = picture.find(sum.name)->values;
    for (std::size_t i = 0; i < n.size(); ++i) {
      // A pixel without samples has no value, whatever is stored there.
      if (!(n[i] > 0)) continue;
      const double value = double{x[i]};
      switch (sum.rule) {
        case Rule::kMean:
          sum.value[i] += n[i] * value;
          break;
        case Rule::kMeanOverHits: {
          const double num_hits = coverage != nullptr ? n[i] * std::max(double{coverage->values[i]}, 0.0) : n[i];
          if (num_hits > 0) sum.value[i] += num_hits * value;
          sum.weight[i] += num_hits;
          break;
        }
        case Rule::kHalf:
          sum.value[i] += std::ceil(n[i] / 2) * value;
          break;
        case Rule::kVariance:
          sum.value[i] += n[i] * n[i] * value;
          break;
        case Rule::kSum:
          sum.value[i] += value;
          break;
        case Rule::kFirst:
          if (!(num_samples_[i] > 0)) sum.value[i] = value;
          break;
      }
    }
  }
  double total = 0;
  for (std::size_t i = 0; i < n.size(); ++i) {
    num_samples_[i] += n[i];
    num_even_samples_[i] += std::ceil(n[i] / 2);
    total += n[i];
  }
  const double mean_samples = total / static_cast<double>(n.size());
  const std::optional<double> error = number_of(picture, "relief:error_rmse");
  knows_error_ = knows_error_ && error.has_value();
  weighted_square_error_ += mean_samples * mean_samples * error.value_or(0) * error.value_or(0);
  samples_ += mean_samples;
}

void Merger::add_attributes(const Picture& picture)
{
  seconds_ += number_of(picture, "relief:seconds").value_or(0);
  if (num_pictures_ == 0) return;
  // Warnings are lines; each is kept once.
  std::string& warnings = result_.attributes["relief:warnings"];
  std::istringstream lines(attribute_of(picture, "relief:warnings"));
  for (std::string line; std::getline(lines, line);) {
    if (("\n" + warnings + "\n").find("\n" + line + "\n") == std::string::npos) {
      warnings += (warnings.empty() ? "" : "\n") + line;
    }
  }
}

MergeResult Merger::finish()
{
  for (Sum& sum : sums_) {
    Channel channel{sum.name, sum.type, {}};
    channel.values.reserve(sum.value.size());
    for (std::size_t i = 0; i < sum.value.size(); ++i) {
      const double n = num_samples_[i];
      double divisor = 1;
      switch (sum.rule) {
        case Rule::kMean:
          divisor = n;
          break;
        case Rule::kMeanOverHits:
          divisor = sum.weight[i];
          break;
        case Rule::kHalf:
          divisor = num_even_samples_[i];
          break;
        case Rule::kVariance:
          divisor = n * n;
          break;
        case Rule::kSum:
        case Rule::kFirst:
          break;
      }
      channel.values.push_back(divisor > 0 ? static_cast<float>(sum.value[i] / divisor) : 0.f);
    }
    sum.value = {};
    result_.channels.push_back(std::move(channel));
  }
  join_ranges(origins_);
  std::string seeds, ranges;
  bool has_ranges = false;
  for (const SampleOrigin& origin : origins_) {
    seeds += (seeds.empty() ? "" : ",") + origin.seed;
    ranges +=
        (ranges.empty() ? "" : ",") + (origin.range ? sample_range_text(*origin.range) : std::string(kAllSamples));
    has_ranges = has_ranges || origin.range;
  }
  // What remains describes the joined render; what was true of one of its parts only (threads, command, …) goes.
  const Attributes first = std::move(result_.attributes);
  result_.attributes.clear();
  for (const char* kept : {"software", "capDate", "utcOffset", "worldToCamera", "worldToNDC", "pixelAspectRatio",
                           "relief:version", "relief:scene", "relief:frame", "relief:view", "relief:warnings"}) {
    if (const auto found = first.find(kept); found != first.end() && !found->second.empty())
      result_.attributes.insert(*found);
  }
  if (!seeds.empty()) result_.attributes["relief:seed"] = seeds;
  if (has_ranges) result_.attributes["relief:sample_ranges"] = ranges;
  result_.attributes["relief:samples"] = attribute_number(samples_);
  result_.attributes["relief:seconds"] = attribute_number(seconds_);
  result_.attributes["relief:merged"] = std::to_string(num_pictures_);
  if (knows_error_ && samples_ > 0) {
    result_.attributes["relief:error_rmse"] = attribute_number(std::sqrt(weighted_square_error_) / samples_);
  }
  return {std::move(result_), std::move(warnings_)};
}

}  // namespace

MergeResult merge_pictures(std::span<const std::filesystem::path> files, const MergeOptions& options)
{
  Merger merger(options);
  for (const std::filesystem::path& file : files) {
    merger.add(exr_load(file));
  }
  return merger.finish();
}

}  // namespace relief
