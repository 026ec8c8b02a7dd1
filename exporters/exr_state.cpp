#include "exporters/exr_state.h"

#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfStringAttribute.h>
#include <ImfThreading.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <new>

#include <nlohmann/json.hpp>

#include "exporters/errors.h"
#include "exporters/exr_rows.h"
#include "exporters/side_file.h"
#include "scene/memory.h"

namespace relief {

namespace {

constexpr const char* kPartName = "relief.state";
constexpr const char* kFingerprint = "relief:state_of";
constexpr const char* kState = "relief:state";
constexpr const char* kHash = "relief:state_hash";
/// More sums than all layers have.
constexpr int kMostSums = 999;

/// Hands each name and member of a state to `field`: the one list for writing and reading.
template <class State, class Field>
void visit(State& state, const Field& field)
{
  field("done_samples", state.done_samples);
  field("pass_samples", state.pass_samples);
  field("active", state.active);
  field("tile_samples", state.tile_samples);
  field("photons_a_pass", state.photons.photons_a_pass);
  field("first_radius", state.photons.first_radius);
  field("first_radius_in_media", state.photons.first_radius_in_media);
  field("photons_stored", state.photons.stored);
  field("photon_seconds", state.photons.seconds);
  field("photon_passes", state.photons.passes);
  field("photon_maps", state.photons.maps);
  field("photons_served", state.photons.served);
  field("seconds", state.seconds);
  field("stage_seconds", state.stage_seconds);
  field("most_displacement_steps", state.most_displacement_steps);
  field("first_nonfinite", state.first_nonfinite);
#define X(name) field(#name, state.counters.name);
  RELIEF_COUNTERS(X)
#undef X
}

/// Of all that stands in the part: it is stored as it is, so nothing else would tell a bit that has turned, in a sum or in a
/// number of the text, from the truth.
/// @cost  0.2 s a GB
std::string state_hash(const std::string& text, std::span<const float> sums)
{
  std::uint64_t hash = hash_of(text);
  // As FNV-1a, but two sums at once. The shift brings high bits down, which products leave where they are.
  for (std::size_t i = 0; i < sums.size(); i += 2) {
    std::uint64_t word = 0;
    std::memcpy(&word, &sums[i], std::min<std::size_t>(2, sums.size() - i) * sizeof(float));
    hash = (hash ^ word) * 0x100000001b3u;
    hash ^= hash >> 32;
  }
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(hash));
  return digits;
}

/// Without a dot in it, which would make it a layer.
std::string sum_name(std::size_t index)
{
  char name[32];
  std::snprintf(name, sizeof name, "sum%03zu", index);
  return name;
}

/// The sums as OpenEXR finds them in memory.
/// @param sums  the first pixel's, of the window
Imf::FrameBuffer frame_buffer(const float* sums, std::size_t num_sums, const Imath::Box2i& window)
{
  const int width = window.max.x - window.min.x + 1, height = window.max.y - window.min.y + 1;
  const std::size_t stride = num_sums * sizeof(float);
  Imf::FrameBuffer buffer;
  for (std::size_t i = 0; i < num_sums; ++i) {
    buffer.insert(sum_name(i), Imf::Slice::Make(Imf::FLOAT, sums + i, window.min, width, height, stride,
                                                stride * static_cast<std::size_t>(width)));
  }
  return buffer;
}

std::string attribute_of(const Imf::Header& header, const char* name)
{
  const auto* text = header.findTypedAttribute<Imf::StringAttribute>(name);
  return text != nullptr ? text->value() : std::string();
}

[[noreturn]] void refuse(const char* expected, const std::string& found)
{
  throw std::runtime_error(std::string("expected ") + expected + ", found " + found);
}

/// @error std::exception of any kind if the part is not what was written
SavedRender part_load(Imf::MultiPartInputFile& input, int index, const std::string& file)
{
  const Imf::Header& header = input.header(index);
  const Imath::Box2i& window = header.dataWindow();
  SavedRender saved;
  std::size_t num_sums = 0;
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) ++num_sums;
  // The sides are within kMaxSide, or OpenEXR would not have opened the file.
  saved.width = window.max.x - window.min.x + 1;
  saved.height = window.max.y - window.min.y + 1;
  if (num_sums == 0 || num_sums > kMostSums)
    refuse("a state's sums in channels", std::to_string(num_sums) + " channels");
  if (!input.partComplete(index)) refuse("all rows of the state", "a file that was cut short");
  const std::size_t size = static_cast<std::size_t>(saved.width) * static_cast<std::size_t>(saved.height) * num_sums;
  // It is stored uncompressed: whoever claims more sums than the file has room for asks for no memory.
  const std::uintmax_t file_size = std::filesystem::file_size(file);
  if (size > file_size / sizeof(float)) {
    refuse("a state within the file", std::to_string(size) + " sums in " + std::to_string(file_size) + " bytes");
  }
  memory_require(size * sizeof(float), file);
  saved.sums.resize(size);
  Imf::InputPart part(input, index);
  part.setFrameBuffer(frame_buffer(saved.sums.data(), num_sums, window));
  part.readPixels(window.min.y, window.max.y);
  const std::string text = attribute_of(header, kState);
  const std::string expected = attribute_of(header, kHash), found = state_hash(text, saved.sums);
  if (expected != found) refuse(("a state whose hash is '" + expected + "'").c_str(), "one of '" + found + "'");
  const nlohmann::json json = nlohmann::json::parse(text);
  visit(saved.state, [&](const char* name, auto& value) { json.at(name).get_to(value); });
  return saved;
}

}  // namespace

void exr_write(const std::filesystem::path& path,
               const FilmView& film,
               const Attributes& attributes,
               const ExrOptions& options,
               const ExrState& state,
               const std::vector<ChannelView>& more)
{
  const ExrWindows windows = exr_windows(film);
  std::vector<ChannelView> channels = more;
  for (ChannelView& channel : exr_film_channels(film, options)) channels.push_back(std::move(channel));
  nlohmann::json json;
  visit(state.state, [&](const char* name, const auto& value) { json[name] = value; });
  const std::size_t num_sums =
      state.sums.size() / (static_cast<std::size_t>(film.width) * static_cast<std::size_t>(film.height));
  std::vector<ChannelView> sums(num_sums);
  for (std::size_t i = 0; i < num_sums; ++i) sums[i].name = sum_name(i);

  const std::string text = json.dump();
  Imf::Header headers[] = {
      exr_header_make(windows, channels, attributes, options.compression, options.color_space),
      exr_header_make(windows, sums,
                      {{kFingerprint, state.fingerprint}, {kState, text}, {kHash, state_hash(text, state.sums)}},
                      ExrCompression::kNone)};
  headers[0].setName("picture");
  headers[1].setName(kPartName);
  for (Imf::Header& header : headers) header.setType(Imf::SCANLINEIMAGE);
  exr_file_write(path, [&](Imf::OStream& stream) {
    Imf::MultiPartOutputFile output(stream, headers, 2);
    Imf::OutputPart picture(output, 0), kept(output, 1);
    exr_rows_write(picture, windows, channels, options.color_space);
    kept.setFrameBuffer(frame_buffer(state.sums.data(), num_sums, headers[1].dataWindow()));
    kept.writePixels(windows.height);
  });
}

std::optional<SavedRender> exr_state_load(const std::filesystem::path& path, const std::string& fingerprint)
{
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return {};
  exr_threads_choose();
  Imf::Header::setMaxImageSize(kMaxSide, kMaxSide);
  const std::string file = path.string();
  try {
    const std::uint64_t decoder_bytes = exr_decoder_bytes(file);
    Imf::MultiPartInputFile input(file.c_str(), Imf::globalThreadCount(), false);
    const MemoryReservation room(decoder_bytes, file);
    for (int part = 0; part < input.parts(); ++part) {
      const Imf::Header& header = input.header(part);
      if (!header.hasName() || header.name() != kPartName) continue;
      if (attribute_of(header, kFingerprint) != fingerprint) return {};
      return part_load(input, part, file);
    }
  } catch (const OutOfMemory&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw OutOfMemory(file);
  } catch (const std::exception& error) {
    // What the libraries say may be several lines, and name the file.
    std::string cause = error.what();
    if (!cause.starts_with("expected ")) cause = "expected a saved state, found a file that cannot be read: " + cause;
    throw InputError(file, cause);
  }
  return {};
}

}  // namespace relief
