#include "scene/exr_file.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfPartType.h>
#include <ImfThreading.h>
#include <ImfTileDescription.h>

#include <cstdint>
#include <cstring>
#include <new>
#include <optional>
#include <stdexcept>

#include "kernel/assert.h"
#include "scene/sample_put.h"

namespace relief {
namespace {

class MemoryStream final : public Imf::IStream {
 public:
  explicit MemoryStream(std::span<const unsigned char> bytes) : IStream("embedded.openexr"), bytes_(bytes) {}

  bool read(char to[], int count) override
  {
    const auto size = static_cast<std::size_t>(count);
    if (at_ > bytes_.size() || size > bytes_.size() - at_) throw std::runtime_error("the data end before they should");
    std::memcpy(to, bytes_.data() + at_, size);
    at_ += size;
    return at_ < bytes_.size();
  }

  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t at) override { at_ = at; }

 private:
  std::span<const unsigned char> bytes_;
  std::uint64_t at_ = 0;
};

/// The channels in their usual order. @return nothing: others
std::optional<std::vector<std::string>> names_of(const Imf::ChannelList& channels, Imf::PixelType type)
{
  std::size_t num = 0;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel, ++num) {
    const Imf::Channel& c = channel.channel();
    if (c.type != type || c.xSampling != 1 || c.ySampling != 1) return {};
  }
  std::vector<std::string> names;
  for (const char* name : {"R", "G", "B", "A"}) {
    if (channels.findChannel(name) != nullptr) names.emplace_back(name);
  }
  if (names.empty() && channels.findChannel("Y") != nullptr) names.emplace_back("Y");
  if (names.empty() || names.size() != num) return {};
  return names;
}

class ExrFile final : public ImageFile {
 public:
  ExrFile(const std::string& file, std::span<const unsigned char> encoded)
  {
    // Where the table of rows is missing, they are looked for: images that Blender 5.2 packs have none.
    if (file.empty()) {
      stream_.emplace(encoded);
      input_.emplace(*stream_, Imf::globalThreadCount(), true);
    } else {
      input_.emplace(file.c_str(), Imf::globalThreadCount(), true);
    }
    const Imf::Header& header = input_->header(0);
    const bool is_flat = !header.hasType() || header.type() == Imf::SCANLINEIMAGE || header.type() == Imf::TILEDIMAGE;
    if (input_->parts() != 1 || !is_flat) return;
    const auto first = header.channels().begin();
    if (first == header.channels().end() || first.channel().type == Imf::UINT) return;
    type_ = first.channel().type;
    if (auto names = names_of(header.channels(), type_)) names_ = std::move(*names);
  }

  /// Whether it is of the kind that exr_file_make tells.
  bool is_plain() const { return !names_.empty(); }

  bool can_be_embedded() const override { return true; }

  std::string open(const std::string&, std::span<const unsigned char>, ImageHeader& header) override
  {
    const Imf::Header& found = input_->header(0);
    window_ = found.dataWindow();
    // Wider than 2^31, it is not even an image whose size can be told.
    const auto side = [](int least, int most) {
      const std::int64_t size = std::int64_t{most} - least + 1;
      return size > INT32_MAX ? 0 : static_cast<int>(size);
    };
    header.width = side(window_.min.x, window_.max.x);
    header.height = side(window_.min.y, window_.max.y);
    header.depth = 1;
    header.num_channels = static_cast<int>(names_.size());
    if (found.hasTileDescription()) {
      header.tile_width = static_cast<int>(found.tileDescription().xSize);
      header.tile_height = static_cast<int>(found.tileDescription().ySize);
    }
    header.sample_type = SampleType::kFloat;
    header.sample_bits = type_ == Imf::HALF ? 16 : 32;
    header.channel_names = names_;
    if (names_.back() == "A") header.alpha_channel = header.num_channels - 1;
    header.format_name = "openexr";
    return {};
  }

  std::string read_rows(int row_begin,
                        int row_end,
                        int channel_begin,
                        int channel_end,
                        SampleType type,
                        unsigned char* rows) override
  {
    const std::int64_t width = std::int64_t{window_.max.x} - window_.min.x + 1;
    const int num_channels = channel_end - channel_begin;
    const std::int64_t num_values = width * (row_end - row_begin) * num_channels;
    const bool is_float = type == SampleType::kFloat;
    if (!is_float) values_.resize(static_cast<std::size_t>(num_values));
    auto* const values = is_float ? reinterpret_cast<char*>(rows) : reinterpret_cast<char*>(values_.data());
    constexpr std::size_t kBytes = sizeof(float);
    const std::size_t texel = kBytes * static_cast<std::size_t>(num_channels);
    const Imath::V2i origin(window_.min.x, window_.min.y + row_begin);
    try {
      Imf::FrameBuffer buffer;
      for (int c = channel_begin; c < channel_end; ++c) {
        buffer.insert(names_[static_cast<std::size_t>(c)],
                      Imf::Slice::Make(Imf::FLOAT, values + kBytes * static_cast<std::size_t>(c - channel_begin), origin,
                                       width, row_end - row_begin, texel, texel * static_cast<std::size_t>(width)));
      }
      Imf::InputPart part(*input_, 0);
      part.setFrameBuffer(buffer);
      part.readPixels(origin.y, window_.min.y + row_end - 1);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      return error.what();
    }
    for (std::int64_t i = 0; !is_float && i < num_values; ++i) sample_put(values_[static_cast<std::size_t>(i)], type, rows);
    return {};
  }

 private:
  std::optional<MemoryStream> stream_;
  std::optional<Imf::MultiPartInputFile> input_;
  Imf::PixelType type_ = Imf::HALF;
  std::vector<std::string> names_;
  Imath::Box2i window_;
  std::vector<float> values_;  ///< of rows that become integers
};

}  // namespace

std::unique_ptr<ImageFile> exr_file_make(const std::string& file, std::span<const unsigned char> encoded)
{
  try {
    auto made = std::make_unique<ExrFile>(file, encoded);
    if (made->is_plain()) return made;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception&) {
    // OpenImageIO says what is wrong.
  }
  return nullptr;
}

}  // namespace relief
